//! `sims/example.toml` shows every key of a scenario. The tests of the commands check that `docs/formats.md` describes
//! every key of a result, whenever they read one: [`Folder::result`](crate::cli::Folder::result).

use std::collections::BTreeSet;
use std::path::Path;

use crate::cli::{keys, words};

/// `sims/example.toml` has every key of the tables that it shows; its values in `[plant]` and `[processing]` are the
/// defaults of keys left out.
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
    // Optional keys may be shown in a comment.
    let shown: BTreeSet<String> =
        text.lines().flat_map(|line| words(line.trim_start_matches("# "))).collect();
    let missing: Vec<&String> = wanted.difference(&shown).collect();
    assert!(missing.is_empty(), "{missing:?}");
}
