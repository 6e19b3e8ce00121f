//! A log whose torques lead to an inertia that no arm has.

use crate::cli::{Folder, default_scenario};

/// How late the torque of joint 3 is logged, in rows of 8 ms.
const LATE_ROWS: usize = 25;

/// The other joints tell gravity, friction is positive, and only the inertia along joint 3 is negative: about −1.1 kg m².
#[test]
fn a_torque_that_is_logged_much_too_late_is_a_contradiction() {
    let folder = Folder::empty();
    folder.write("s.toml", default_scenario(4));
    folder.armid("simulate --scenario s.toml --out run.csv").says(0, &["samples"]);
    let text = folder.read("run.csv");
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let torque = rows[0].iter().position(|name| *name == "actual_torque_2").unwrap();
    let late = |k: usize| {
        let mut row = rows[k].clone();
        // Row 0 is the header.
        if k > LATE_ROWS {
            row[torque] = rows[k - LATE_ROWS][torque];
        }
        row.join(",")
    };
    let lines: Vec<String> = (0..rows.len()).map(late).collect();
    folder.write("late.csv", lines.join("\n") + "\n");
    let told = ["physically impossible", "which no arm has: joint 3 in a pose of the log (-1."];
    folder.armid("identify run.csv --robot ur5 --json run.json").says(0, &["Identified 52"]);
    assert_eq!(folder.result("run.json")["verdict"], "identified");
    folder.armid("identify late.csv --robot ur5 --json late.json").says(3, &told);
    let result = folder.result("late.json");
    assert_eq!(result["verdict"], "contradicted");
    assert!(result["doubt"].as_str().unwrap().contains("never below 2."), "{}", result["doubt"]);
}
