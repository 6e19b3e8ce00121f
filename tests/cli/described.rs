//! Compares `docs/formats.md` with what the commands write.

use std::collections::BTreeSet;

use serde_json::Value;

/// All keys of the objects in `value`.
pub fn keys(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| {
            found.insert(key.clone());
            keys(value, found);
        }),
        Value::Array(values) => values.iter().for_each(|value| keys(value, found)),
        _ => {}
    }
}

pub fn words(text: &str) -> Vec<String> {
    let split = text.split(|c: char| !c.is_alphanumeric() && c != '_');
    split.map(str::to_owned).collect()
}

/// The words in back ticks in `markdown`.
fn quoted(markdown: &str) -> BTreeSet<String> {
    markdown.split('`').skip(1).step_by(2).flat_map(words).collect()
}

/// The words outside of comments in the scenarios that the description refers to.
fn of_scenarios() -> BTreeSet<String> {
    let scenarios =
        [include_str!("../../sims/example.toml"), include_str!("../../sims/effects.toml")].concat();
    let lines = scenarios.lines().filter_map(|line| line.split('#').next());
    lines.flat_map(words).collect()
}

/// The part of `markdown` below `heading`, up to the next heading of the same or a higher level.
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

/// Asserts that the description of the format mentions every key in `result`, the content of `file`.
pub fn assert_described(file: &str, result: &Value) {
    let schema = result["schema"].as_str().unwrap_or_else(|| panic!("{file} has no schema"));
    let format = schema.split('/').next().unwrap();
    let heading = match format {
        "armid.identify" => "### `armid identify --json`",
        "armid.diagnose" => "### `armid diagnose --json`",
        "armid.trajectory" => "#### Trajectory",
        _ => "### The others",
    };
    let description = include_str!("../../docs/formats.md");
    let of_all = section(description, "## Results").split("\n### ").next().unwrap();
    let mut known = quoted(&[of_all, section(description, heading)].concat());
    if format == "armid.truth" {
        // This file repeats the hidden effects and the noise in the form of the scenario.
        known.extend(of_scenarios());
    }
    let mut found = BTreeSet::new();
    keys(result, &mut found);
    let missing: Vec<&String> = found.difference(&known).collect();
    assert!(missing.is_empty(), "{file}: {missing:?}");
}
