//! `armid study paper`, `armid study cutoff` and `armid study noise` as a user runs them, with as few trials as
//! possible.

use std::path::Path;

use serde_json::Value;

use crate::cli::Folder;

/// Runs a study and returns its JSON and Markdown; checks that the page exists.
fn study(folder: &Folder, words: &str) -> (Value, String) {
    let outputs = "--trials 2 --json a.json --markdown a.md --report a.html";
    folder.armid(&format!("study {words} {outputs}")).says(0, &[]);
    let html = folder.read("a.html");
    assert!(html.contains("<svg") && !html.contains("NaN"), "a page without figures");
    (folder.json("a.json"), folder.read("a.md"))
}

/// `file` of `sims/` with `old` replaced by `new`, and relative paths made absolute.
fn changed(file: &str, old: &str, new: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("sims").join(file)).unwrap();
    assert!(text.contains(old), "{file} without {old}");
    text.replace(old, new).replace("\"../", &format!("\"{}/", root.display()))
}

#[test]
fn the_paper_is_repeated_and_its_negative_rotor_inertias_with_it() {
    let folder = Folder::empty();
    folder.write("paper.toml", changed("paper.toml", "periods = 3", "periods = 2"));
    folder.write("validation.json", include_str!("../trajectories/ur5_paper_validation.json"));
    let (result, markdown) = study(&folder, "paper paper.toml --validation validation.json");
    assert_eq!(result["schema"], "armid.study-paper/1");
    assert_eq!(result["parameters"].as_array().unwrap().len(), 33);
    assert!(markdown.contains("iG") || markdown.contains("Ia1"), "{markdown}");

    let noise = result["noise_e_n"].as_f64().unwrap();
    let errors = result["errors"].as_array().unwrap();
    for error in errors.iter().filter(|e| e["torque_filtered"] == false) {
        let fit = error["e_n"][0].as_f64().unwrap();
        let rigid = error["hidden_effects"] == false;
        // Noise with a memory of 1 s has about 10 independent samples per joint in 10 s for its slow fifth, so that its
        // size is known to about 0.2/√10 = 6 %; the fit of 33 … 52 parameters absorbs a little.
        assert!(fit > 0.75 * noise, "{error}");
        assert_eq!(rigid, fit < 1.25 * noise, "{error}");
    }

    let rotors = |kind: &str| -> Vec<f64> {
        let of = |m: &&Value| m["mechanism"]["kind"] == kind;
        let rows = result["mechanisms"].as_array().unwrap().iter().filter(of);
        rows.flat_map(|m| m["rotor_inertia_kg_m2"].as_array().unwrap().clone())
            .map(|value| value.as_f64().unwrap())
            .collect()
    };
    // Truth: 1.6 and 0.25 kg m², for 33 parameters without noise.
    let nothing = rotors("nothing");
    assert!((nothing[0] / 1.6 - 1.0).abs() < 0.03, "{nothing:?}");
    assert!(nothing[1..].iter().all(|ia| (ia / 0.25 - 1.0).abs() < 0.05), "{nothing:?}");
    // The torque is 100 ms late; or (33) is applied literally to the angle, which reverses the sign.
    assert!(rotors("delay").iter().any(|ia| *ia < 0.0));
    assert!(rotors("literal_filter")[4..].iter().all(|ia| *ia < 0.0));

    // Static friction holds the arm before it starts; an arm without it has no error there.
    let at_zero = |k: usize| result["starts"][k]["error_at_zero_nm"][1].as_f64().unwrap().abs();
    assert!(at_zero(0) > 4.0 && at_zero(1) < 0.5, "{} {}", at_zero(0), at_zero(1));
}

#[test]
fn the_cutoff_has_a_best_value_and_e_n_falls_with_the_record() {
    let folder = Folder::empty();
    folder.write("cutoff.toml", include_str!("../sims/cutoff.toml"));
    let (result, _) = study(&folder, "cutoff cutoff.toml");
    assert_eq!(result["schema"], "armid.study-cutoff/1");
    let curves = result["curves"].as_array().unwrap();
    assert_eq!(curves.len(), 8);
    for curve in curves {
        let error = |k: usize| curve["points"][k]["predicted"].as_f64().unwrap();
        let last = curve["points"].as_array().unwrap().len() - 1;
        let least = (0..=last).map(error).fold(f64::INFINITY, f64::min);
        assert!(least < error(0), "no left branch: {curve}");
        if curve["velocity_sd_rad_s"] == 1e-2 && curve["method"] == "paper" {
            assert!(least < 0.7 * error(last), "no right branch: {curve}");
        }
    }
    // eᵀe of white noise has a relative standard deviation of √(2 Σs⁴/m)/Σs²: 1.7 % at 1250 samples, half of that for
    // e_N. The bound of 5 % is six of these; encoder noise and the filter add less than 1 %.
    for length in result["lengths"].as_array().unwrap() {
        let [found, formula] = ["e_n", "predicted_e_n"].map(|key| length[key].as_f64().unwrap());
        assert!((found / formula - 1.0).abs() < 0.05, "{length}");
    }
    // (20) is right for white noise of 1 Nm, and off by the factor 0.3 for noise of 0.3 Nm.
    let rms = |k: usize| result["sigmas"][k]["predicted"][1].as_f64().unwrap();
    assert!((rms(0) - 1.0).abs() < 0.03, "{}", rms(0));
    assert!((rms(1) - 0.3).abs() < 0.03, "{}", rms(1));
}

/// Scenarios run separately and then combined give the same study as all of them together.
#[test]
fn scenarios_of_noise_are_put_together_from_files() {
    let folder = Folder::empty();
    let noise = |words: &str| folder.armid(&format!("study noise {words}"));
    for (name, scenario) in [("a", "default.toml"), ("b", "noise_white.toml")] {
        folder.write(&format!("{name}.toml"), changed(scenario, "periods = 8", "periods = 4"));
        let words = format!("{name}.toml --trials 2 --slow-every 2 --json {name}.json");
        noise(&words).says(0, &[]);
    }
    let words = "--from a.json b.json --json all.json --markdown all.md --report all.html";
    noise(words).says(0, &[]);
    let all = folder.json("all.json");
    for (k, part) in ["a.json", "b.json"].iter().enumerate() {
        assert_eq!(all["scenarios"][k], folder.json(part)["scenarios"][0]);
    }
    let markdown = folder.read("all.md");
    assert!(markdown.contains("| default ") && markdown.contains("| white "));
    let command = all["program"]["command"].as_str().unwrap();
    assert_eq!(command.matches("armid study noise").count(), 3, "{command}");

    noise("--from a.json all.json").complains(1, &["default is already there"]);
    noise("--from all.md").says(1, &[]);
}
