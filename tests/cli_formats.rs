//! `docs/formats.md` knows every key that the commands write.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Runs a command in `folder`.
fn run(folder: &Path, program: &str, words: &str) {
    let output =
        Command::new(program).current_dir(folder).args(words.split_whitespace()).output().unwrap();
    assert!(
        output.status.success(),
        "{words}: {}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

/// All keys of the objects in `value`.
fn keys(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| {
            found.insert(key.clone());
            keys(value, found);
        }),
        Value::Array(values) => values.iter().for_each(|value| keys(value, found)),
        _ => {}
    }
}

fn words(text: &str) -> Vec<String> {
    let split = text.split(|c: char| !c.is_alphanumeric() && c != '_');
    split.map(str::to_owned).collect()
}

/// What stands in back ticks in `markdown`.
fn quoted(markdown: &str) -> BTreeSet<String> {
    markdown.split('`').skip(1).step_by(2).flat_map(words).collect()
}

/// What stands outside of comments in the scenarios that the description refers to.
fn of_scenarios() -> BTreeSet<String> {
    let scenarios =
        [include_str!("../sims/example.toml"), include_str!("../sims/effects.toml")].concat();
    let lines = scenarios.lines().filter_map(|line| line.split('#').next());
    lines.flat_map(words).collect()
}

/// The part of `markdown` below `heading`, down to the next heading of the same level or a higher one.
fn section<'a>(markdown: &'a str, heading: &str) -> &'a str {
    let level = heading.split(' ').next().unwrap().len();
    let start = markdown.find(&format!("{heading}\n")).unwrap_or_else(|| panic!("{heading}"));
    let body = &markdown[start + heading.len()..];
    let is_end = |line: &str| {
        let hashes = line.bytes().take_while(|byte| *byte == b'#').count();
        (1..=level).contains(&hashes)
    };
    let mut end = 0;
    for line in body.split_inclusive('\n') {
        if end > 0 && is_end(line) {
            break;
        }
        end += line.len();
    }
    &body[..end]
}

#[test]
fn every_key_of_every_result_is_described() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let (armid, montecarlo) = (env!("CARGO_BIN_EXE_armid"), env!("CARGO_BIN_EXE_montecarlo"));
    let clean = include_str!("../sims/default.toml").replace("periods = 8", "periods = 4");
    let stribeck =
        "\n[[effect]]\nkind = \"stribeck\"\njoint = 4\nextra_nm = 0.4\nvs_rad_s = 0.08\n";
    let hidden = clean.clone() + stribeck;
    let other = hidden.replace("ur5_identification", "ur5_validation");
    for (name, text) in [("clean.toml", clean), ("hidden.toml", hidden), ("other.toml", other)] {
        std::fs::write(here.join(name), text).unwrap();
    }
    for (program, words) in [
        (armid, "simulate --scenario hidden.toml --out log.csv --truth truth.json"),
        (armid, "simulate --scenario other.toml --out other.csv"),
        (armid, "simulate --scenario hidden.toml --out again.csv --trial 1"),
        (armid, "base --robot ur5 --json base.json"),
        (
            armid,
            "identify log.csv --robot ur5 --physical --validate other.csv --json identified.json",
        ),
        (armid, "identify log.csv again.csv --robot ur5 --json both.json"),
        (
            armid,
            "diagnose log.csv again.csv --robot ur5 --known-payload 1 --held-out other.csv --json why.json",
        ),
        (armid, "diagnose again.csv --robot ur5 --sim identified.json --json moved.json"),
        (armid, "excite --robot ur5 --order 2 --starts 2 --finalists 1 --out motion.json"),
        (montecarlo, "--scenario clean.toml --trials 3 --json trials.json"),
    ] {
        run(here, program, words);
    }
    let description = include_str!("../docs/formats.md");
    let of_all = section(description, "## Results").split("\n### ").next().unwrap();
    for (file, heading) in [
        ("truth", "### The others"),
        ("base", "### The others"),
        ("trials", "### The others"),
        ("motion", "#### Trajectory"),
        ("identified", "### `armid identify --json`"),
        ("both", "### `armid identify --json`"),
        ("why", "### `armid diagnose --json`"),
        ("moved", "### `armid diagnose --json`"),
    ] {
        let mut known = quoted(&[of_all, section(description, heading)].concat());
        if file == "truth" {
            // It repeats what was hidden and the noise, as the scenario has them.
            known.extend(of_scenarios());
        }
        let text = std::fs::read_to_string(here.join(file).with_extension("json")).unwrap();
        let mut found = BTreeSet::new();
        keys(&serde_json::from_str(&text).unwrap(), &mut found);
        let missing: Vec<&String> = found.difference(&known).collect();
        assert!(missing.is_empty(), "{file}: {missing:?}");
    }
}

/// `sims/example.toml` has every key of the tables that it shows, and a left-out line of `[plant]` and `[processing]` means what
/// stands there.
#[test]
fn the_example_of_a_scenario_is_complete() {
    use armid::identify::Options;
    use armid::montecarlo::Scenario;
    use armid::plant::{PlantConfig, SensorConfig};
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("sims/example.toml");
    let scenario = Scenario::load(Some(&file)).unwrap();
    assert_eq!(scenario.plant, PlantConfig::default());
    assert_eq!(scenario.processing, Options::default());
    let text = std::fs::read_to_string(&file).unwrap();
    let mut wanted = BTreeSet::new();
    keys(&serde_json::to_value(PlantConfig::default()).unwrap(), &mut wanted);
    keys(&serde_json::to_value(SensorConfig::default()).unwrap(), &mut wanted);
    keys(&serde_json::to_value(Options::default()).unwrap(), &mut wanted);
    // A key whose line may be left out stands behind a comment mark.
    let shown: BTreeSet<String> =
        text.lines().flat_map(|line| words(line.trim_start_matches("# "))).collect();
    let missing: Vec<&String> = wanted.difference(&shown).collect();
    assert!(missing.is_empty(), "{missing:?}");
}
