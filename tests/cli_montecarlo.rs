//! `montecarlo` run in parts, as on many machines: shards, resuming after a stop, merging, and what is refused.

use std::sync::OnceLock;

use serde_json::{Value, json};

use crate::cli::{Folder, default_scenario};

/// Options that all parts of one run share.
const RUN: &str = "--scenario s.toml --trials 6";

/// File name of the shard with trials `first..end`.
fn file_of(folder: &str, first: u64, end: u64) -> String {
    format!("{folder}/shard-{first:012}-{end:012}.json")
}

/// Six trials of 20 s, run as a whole with its result in `whole.json`, and as two shards in `a` and `b`.
fn runs() -> &'static Folder {
    static FOLDER: OnceLock<Folder> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Folder::empty();
        folder.write("s.toml", default_scenario(2));
        for words in [
            "--json whole.json",
            "--shard 0/2 --out a --json a.json",
            "--shard 1/2 --out b --threads 1",
        ] {
            folder.montecarlo(&format!("{RUN} {words}")).says(0, &[]);
        }
        folder
    })
}

/// A result without its command and speed: only what it says about the trials.
fn of_trials(folder: &Folder, name: &str) -> Value {
    let mut result = folder.result(name);
    for key in ["program", "trials_per_second"] {
        assert!(result.as_object_mut().unwrap().remove(key).is_some(), "{name} without {key}");
    }
    result
}

/// Copies shard 0 of 2 to `to`, modified by `change`.
fn changed(folder: &Folder, to: &str, change: impl Fn(&mut Value)) {
    let mut first = folder.json(&file_of("a", 0, 3));
    change(&mut first);
    folder.write(to, first.to_string());
}

/// Shard 0 of 2, rewritten as the shard of a whole run of `trials` that was stopped after three.
fn stopped(folder: &Folder, to: &str, trials: u64) {
    changed(folder, &file_of(to, 0, trials), |shard| {
        shard["header"]["trials"] = trials.into();
        shard["range"] = json!([0, trials]);
    });
}

#[test]
fn shards_together_are_the_run_in_one_bit_for_bit() {
    let folder = runs();
    // A single shard does not count the trials of other shards as missing.
    let alone = folder.result("a.json");
    assert_eq!((&alone["trials"], &alone["missing"]), (&json!(3), &json!([])));
    let whole = of_trials(folder, "whole.json");
    assert_eq!(whole["trials"], 6);
    for (order, result) in [("a b", "ab.json"), ("b a", "ba.json")] {
        folder.montecarlo(&format!("merge {order} --json {result}")).says(0, &["6 trials"]);
        assert_eq!(of_trials(folder, result), whole, "{order}");
    }
}

/// Finished trials are written; the exit code alone says that some are missing.
#[test]
fn a_part_ends_with_130_and_names_the_missing_trials() {
    let folder = runs();
    let words = "merge a --json part.json";
    folder.montecarlo(words).says(130, &["trials 3…5 have not been run"]);
    let part = folder.result("part.json");
    assert_eq!((&part["trials"], &part["missing"]), (&json!(3), &json!([[3, 6]])));
    folder.montecarlo("merge b").says(130, &["trials 0…2 have not been run"]);
}

#[test]
fn a_stopped_run_goes_on_where_it_was() {
    let folder = runs();
    stopped(folder, "half", 6);
    folder.montecarlo("merge half").says(130, &["trials 3…5 have not been run"]);
    let file = file_of("half", 0, 6);
    let half = folder.read(&file);
    let refused = |words: &str, expected: &[&str]| {
        folder.montecarlo(&format!("{RUN} --out half {words}")).complains(1, expected);
        assert_eq!(folder.read(&file), half, "{words}");
    };
    refused("", &[&file, "exists: give --resume"]);
    refused("--resume --seed 7", &[&file, "seed is 20200601", "7: not the same run"]);
    // The second time, nothing is left to do.
    for done in [3, 6] {
        let said = format!("going on after {done} trials");
        let words = format!("{RUN} --out half --resume --json resumed.json");
        folder.montecarlo(&words).says(0, &[&said]);
        assert_eq!(of_trials(folder, "resumed.json"), of_trials(folder, "whole.json"), "{said}");
    }
    folder.montecarlo("merge half").says(0, &["6 trials"]);
}

/// A shard that cannot be written, or that another output would replace, is refused before anything is simulated.
#[test]
fn a_shard_has_a_file_of_its_own() {
    let folder = runs();
    let file = file_of("own", 0, 6);
    folder.write("own/note.txt", "nothing yet");
    let refused = |words: &str, expected: &[&str]| {
        let said = folder.montecarlo(&format!("{RUN} {words}"));
        said.complains(1, expected);
        assert!(!said.stderr.contains("simulating"), "{words}: {}", said.stderr);
    };
    for output in ["json", "report", "markdown"] {
        let words = format!("--out own --{output} {file}");
        refused(&words, &[&file, "two outputs would go to this file"]);
    }
    assert!(!folder.path(&file).exists());
    refused("--out s.toml/own", &["s.toml/own"]);
}

/// What goes to the standard output is added to the file behind it, and does not replace it.
#[cfg(unix)]
#[test]
fn a_redirected_output_keeps_what_the_file_has() {
    let folder = runs();
    folder.write("all.txt", "earlier\n");
    let path = folder.path("all.txt");
    let all = std::fs::OpenOptions::new().append(true).open(&path).unwrap();
    let mut merge = folder.montecarlo_command("merge a b --json /dev/stdout");
    let output = merge.stdout(all).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = folder.read("all.txt");
    assert!(text.starts_with("earlier\n"), "{text}");
    for part in ["6 trials (", "\"schema\""] {
        assert!(text.contains(part), "\"{part}\" is not in: {text}");
    }
}

#[test]
fn shards_that_do_not_belong_together_are_refused() {
    let folder = runs();
    let refused = |words: &str, expected: &[&str]| {
        folder.montecarlo(&format!("merge {words} --json no.json")).complains(1, expected);
        assert!(!folder.path("no.json").exists(), "{words}");
    };
    stopped(folder, "over", 6);
    let another = "are in another shard too";
    refused("a over", &[&file_of("over", 0, 6), another]);
    // Trials assigned to one shard but not run may come from another one.
    folder.montecarlo("merge b over --json both.json").says(0, &["6 trials"]);
    assert_eq!(of_trials(folder, "both.json"), of_trials(folder, "whole.json"));
    refused("a a", &[&file_of("a", 0, 3), "trials 0…2", another]);

    // These shards come after the first one, with which they are compared.
    let later = |folder: &str| file_of(folder, 3, 6);
    folder.montecarlo(&format!("{RUN} --shard 1/2 --out seed --seed 7")).says(0, &[]);
    refused("a seed", &[&later("seed"), "seed is 7", "20200601: not the same run"]);
    for (name, key, value, what) in [
        ("longer", "trials", json!(8), "number of trials is 8"),
        ("motion", "scenario_sha256", json!("0"), "scenario text, robot or motion is 0"),
        ("older", "version", json!("0.0.1"), "program version is 0.0.1"),
    ] {
        changed(folder, &later(name), |shard| {
            shard["header"][key] = value.clone();
            shard["range"] = json!([3, 6]);
            shard["next"] = json!(6);
        });
        refused(&format!("a {name}"), &[&later(name), what, "not the same run"]);
    }

    let whole = folder.read(&later("b"));
    folder.write(&later("cut"), &whole[..whole.len() / 2]);
    refused("a cut", &[&later("cut"), "not a shard file this program can read"]);
    // The number of trials does not match the sums in the file.
    changed(folder, &file_of("more", 0, 3), |shard| shard["next"] = json!(2));
    refused("more b", &[&file_of("more", 0, 3), "3 trials do not fit 0…2"]);
    folder.write("empty/note.txt", "nothing yet");
    refused("a empty", &["empty: no shard files"]);
    // A damaged shard is not resumed either.
    let cut = folder.montecarlo(&format!("{RUN} --shard 1/2 --out cut --resume"));
    cut.complains(1, &[&later("cut"), "not a shard file this program can read"]);
}

/// Ctrl-C ends a run after the trials that are in progress.
#[cfg(unix)]
#[test]
fn an_interrupted_run_keeps_what_it_has() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};

    let folder = runs();
    stopped(folder, "long", 200);
    let words = "--scenario s.toml --trials 200 --threads 1 --out long --resume --json long.json";
    let mut run = folder
        .montecarlo_command(words)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.starts_with("going on after 3 trials")));
    // The handler is already installed, and about ten seconds of trials remain.
    let signal = format!("kill -INT {}", run.id());
    assert!(Command::new("sh").args(["-c", &signal]).status().unwrap().success());
    let said: Vec<String> = lines.collect();
    assert_eq!(run.wait().unwrap().code(), Some(130), "{said:?}");
    let reached = folder.json(&file_of("long", 0, 200))["next"].as_u64().unwrap();
    assert!((3..200).contains(&reached), "{reached}");
    assert!(said.contains(&format!("interrupted after {reached} trials")), "{said:?}");
    assert_eq!(folder.result("long.json")["missing"], json!([[reached, 200]]));
    let missing = format!("trials {reached}…199 have not been run");
    folder.montecarlo("merge long").says(130, &[&missing]);
}
