//! `armid diagnose` as in the README, with half the periods: effects hidden in a simulated arm are named.

use serde_json::Value;

use crate::cli::Folder;

/// A folder with the arm of the README, two logs of one motion, and a log of another motion to be held out.
fn hidden() -> Folder {
    let folder = Folder::empty();
    for (name, text) in [
        ("hidden.toml", include_str!("../sims/hidden.toml")),
        ("other.toml", include_str!("../sims/hidden_other_motion.toml")),
    ] {
        folder.write(name, text.replace("periods = 8", "periods = 4"));
    }
    for words in [
        "--scenario hidden.toml --out hidden.csv --truth truth.json",
        "--scenario hidden.toml --out again.csv --trial 1",
        "--scenario other.toml --out other.csv",
    ] {
        folder.armid(&format!("simulate {words}")).says(0, &[]);
    }
    folder.result("truth.json");
    folder
}

/// Asserts that `truth` lies within twice the 95 % interval: 3.9 σ, which noise exceeds once in 10 000 logs, so that
/// the seed need not be selected.
fn holds(cause: &Value, name: &str, truth: f64) {
    let found = &cause["parameters"][name];
    let value = found["value"].as_f64().unwrap();
    let twice = |end: usize| value + 2.0 * (found["ci95"][end].as_f64().unwrap() - value);
    let [low, high] = [0, 1].map(twice);
    assert!(low < truth && truth < high, "{name}: {low} … {high} without {truth}");
}

/// Asserts that the arm with the causes reproduces the torque of the log.
///
/// In units of the noise of the mean period, the causes are worth 8 along one motion and 10 along the other, squares
/// added over the joints. Of these, the replay loses at most Δ²τ/4 for every reversal of joint 2 (see `replay.rs`):
/// with ten reversals in 10 s, Δ = 2 · 0.06 · 90 Nm and τ = 16 ms, that is 0.47 Nm² over 0.25 Nm² of noise, 1.9 of the
/// 8. The contribution of the noise is itself known to √(6 · (2/1250 + 2/3750)) = 0.11, and the parameters add 52/1250
/// = 0.04. The share removed is thus below 1 by at most 0.24, and varies by chance by 4 % (three standard deviations).
fn is_replayed(log: &Value) {
    let removed = log["removed_fraction"].as_f64().unwrap();
    assert!(removed > 0.7 && removed < 1.05, "{log}");
}

#[test]
fn what_the_example_hides_is_named() {
    let folder = hidden();
    // A log cannot be held out from itself.
    let same = folder.armid("diagnose hidden.csv --robot ur5 --held-out hidden.csv");
    same.says(1, &["is held out, but it is also the log"]);

    // Nor can a result from the same log tell what has changed since.
    let words = "identify hidden.csv --robot ur5 --validate other.csv --json result.json";
    folder.armid(words).says(0, &[]);
    folder.result("result.json");
    let itself = folder.armid("diagnose hidden.csv --robot ur5 --sim result.json");
    itself.says(1, &["identified from the log that is diagnosed"]);

    // The result says little about another log, because the effects hidden in its own log bias it.
    let words = "diagnose other.csv --robot ur5 --sim result.json --json doubtful.json";
    folder.armid(words).says(0, &[]);
    let answer = folder.result("doubtful.json");
    assert!(
        answer["sentences"][0].as_str().unwrap().starts_with("The model is wrong along the log")
    );
    for cause in answer["causes"].as_array().unwrap() {
        assert!(cause["confidence"].as_f64().unwrap() <= 0.9, "{cause}");
    }

    // All options at once; the flange is as bare in the second log as in the first.
    let words = "diagnose hidden.csv again.csv --robot ur5 --known-payload 1 --held-out other.csv \
                 --replay --json why.json --report why.html --extended-scenario found.toml";
    let text = folder.armid(words).says(0, &[]);
    let answer = folder.result("why.json");
    let causes = answer["causes"].as_array().unwrap();
    let named: Vec<_> =
        causes.iter().map(|c| (c["kind"].as_str().unwrap(), c["joint"].as_u64())).collect();
    assert_eq!(named, [("load_friction", Some(2)), ("stribeck", Some(4))], "{text}");
    holds(&causes[0], "mu", 0.06);
    holds(&causes[1], "extra_nm", 0.4);
    holds(&causes[1], "vs_rad_s", 0.08);
    assert_eq!(answer["payload"]["is_named"], false, "{text}");
    is_replayed(&answer["replay"]["log"]);
    is_replayed(&answer["replay"]["held_out"][0]);

    // The page begins with the verdict, and the scenario contains the causes as physical effects.
    let verdict = "model misses friction that grows with the load on the gear";
    assert!(text.starts_with(&format!("Joint 2's {verdict}")), "{text}");
    assert!(folder.read("why.html").contains(verdict));
    let found = folder.read("found.toml");
    for kind in ["load_friction", "stribeck"] {
        assert!(found.contains(kind), "{kind} is not in {found}");
    }
}
