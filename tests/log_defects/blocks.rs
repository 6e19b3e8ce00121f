//! Optional quantities of a log.

use super::*;
use armid::log::Effort;
use armid::robot::Arm;

/// Column of the first desired moment in [`with_optional_blocks`]; the temperatures follow the moments.
const MOMENT: usize = 19;

/// The log that results when `edit` changes the fields of the valid one with desired moments and temperatures.
fn with_optional_blocks(edit: impl FnOnce(&mut Vec<Vec<String>>)) -> Log {
    let log = edited(|rows| {
        for name in ["target_moment", "joint_temperatures"] {
            rows[0].extend((0..JOINTS).map(|j| format!("{name}_{j}")));
            for row in &mut rows[1..] {
                row.extend((0..JOINTS).map(|j| format!("{j}.5")));
            }
        }
        edit(rows);
    });
    log.unwrap()
}

#[test]
fn a_bad_field_that_nothing_needs_costs_its_block_and_no_row() {
    let log = with_optional_blocks(|_| {});
    assert!(log.rows.warnings.is_empty() && log.target_effort.is_some(), "{}", log.rows);
    for value in ["", "NaN", "n/a", "1e293"] {
        let log = with_optional_blocks(|rows| {
            rows[51][MOMENT + 2] = value.into();
            rows[71][MOMENT] = value.into();
        });
        assert_eq!((log.samples(), log.rows.set_aside.len()), (SAMPLES, 0), "{}", log.rows);
        assert!(log.target_effort.is_none() && log.temperature_c.is_some());
        let warning = log.rows.warnings[0].to_string();
        for part in ["2 fields", "target_moment", "row 52", "column 22 (target_moment_2)"] {
            assert!(warning.contains(part), "{warning}");
        }
    }
    let blank = with_optional_blocks(|rows| {
        rows[1..].iter_mut().for_each(|row| row[MOMENT + JOINTS..].fill(String::new()));
    });
    assert_eq!((blank.samples(), blank.rows.warnings.len()), (SAMPLES, 1), "{}", blank.rows);
    assert!(blank.target_effort.is_some() && blank.temperature_c.is_none());
    let warning = blank.rows.warnings[0].to_string();
    assert!(warning.contains(&format!("{} fields", SAMPLES * JOINTS)), "{warning}");
}

#[test]
fn a_column_that_nothing_needs_may_be_missing() {
    for (block, name, column) in [
        ("target_moment", "target_moment_0", MOMENT),
        ("target_moment", "target_moment_3", MOMENT + 3),
        ("temperature", "joint_temperatures_5", MOMENT + JOINTS + 5),
    ] {
        let log = with_optional_blocks(|rows| rows[0][column] = "another".into());
        assert_eq!((log.samples(), log.rows.warnings.len()), (SAMPLES, 1), "{}", log.rows);
        let is_temperature = block == "temperature";
        assert_eq!(log.target_effort.is_some(), is_temperature);
        assert_eq!(log.temperature_c.is_none(), is_temperature);
        let warning = log.rows.warnings[0].to_string();
        for part in [block, name, "left out"] {
            assert!(warning.contains(part), "{warning}");
        }
    }
}

#[test]
fn a_bad_field_in_a_row_that_is_set_aside_costs_no_block() {
    let log = with_optional_blocks(|rows| rows[51][1..].fill("1e293".into()));
    assert_eq!(log.rows.count(Reason::Implausible), 1, "{}", log.rows);
    assert!(log.rows.warnings.is_empty(), "{}", log.rows);
    assert!(log.target_effort.is_some() && log.temperature_c.is_some());
}

/// What a layout inherits from a built-in one is no statement about the file, and what it says itself is.
#[test]
fn a_layout_that_inherits_the_velocities_can_do_without_them() {
    let mut rows = valid();
    rows.iter_mut().for_each(|row| {
        row.drain(1 + JOINTS..1 + 2 * JOINTS);
    });
    let text = text(&rows, ",", "\n");
    let inherited =
        "name = \"mine\"\nlike = \"armid\"\ndrive_gain_nm_a = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\n";
    let layout = Layout::from_toml(inherited, "mine.toml").unwrap();
    let log = read_log_from(text.as_bytes(), "run.csv", &layout, JOINTS).unwrap();
    assert_eq!(log.samples(), SAMPLES);
    let own = format!("{inherited}[columns]\nqd = \"velocity_{{0}}\"\n");
    let layout = Layout::from_toml(&own, "mine.toml").unwrap();
    let result = read_log_from(text.as_bytes(), "run.csv", &layout, JOINTS);
    assert_says(result, &["no column \"velocity_0\""]);
}

/// Rows of `ros2 topic echo --csv /joint_states`: stamp in two columns, frame, names, and the joints' values.
#[test]
fn joint_states_of_ros_are_read() {
    let layout = Layout::load("ros2_joint_states").unwrap();
    let names = "shoulder_pan,shoulder_lift,elbow,wrist_1,wrist_2,wrist_3";
    let rows = valid();
    let lines = rows[1..].iter().enumerate().map(|(k, row)| {
        let nanoseconds = 8_000_000 * k as u64;
        let stamp = (100 + nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
        format!("{},{},base,{names},{}\n", stamp.0, stamp.1, row[1..].join(","))
    });
    let text: String = lines.collect();
    // The default layout takes no row for a header, although it holds names, and says which layouts have none.
    let result = read_log_from(text.as_bytes(), "echo.csv", &Layout::default(), JOINTS);
    assert_says(result, &["begins with the number 100", "ros2_joint_states"]);
    let log = read_log_from(text.as_bytes(), "echo.csv", &layout, JOINTS).unwrap();
    assert_eq!(log.samples(), SAMPLES);
    for k in [0, 130, SAMPLES - 1] {
        let t = 100.0 + STEP_S * k as f64;
        // Digits are written in full; stamps are seconds counted from the first row or from 1970.
        assert!((log.q_rad.joint(2)[k] - angle_rad(2, t)).abs() < 1e-12);
        assert!((log.qd_rad_s.joint(5)[k] - velocity_rad_s(5, t)).abs() < 1e-12);
        assert!((log.time_s[k] - log.time_s[0] - STEP_S * k as f64).abs() < 1e-9);
    }
}

/// Torques that the controller makes of the currents are read as they are; a log without them is not read in ampere.
#[test]
fn torques_of_the_controller_need_no_gain() {
    let layout = Layout::load("ur_torque").unwrap();
    let currents = text(&valid(), ",", "\n");
    let result = read_log_from(currents.as_bytes(), "run.csv", &layout, JOINTS);
    assert_says(result, &["no column \"actual_current_as_torque_0\"", "\"ur_torque\""]);
    let torques = currents.replace("actual_current", "actual_current_as_torque");
    let log = read_log_from(torques.as_bytes(), "run.csv", &layout, JOINTS).unwrap();
    let in_ampere =
        read_log_from(currents.as_bytes(), "run.csv", &Layout::default(), JOINTS).unwrap();
    let arm = Arm::built_in("ur5e").unwrap();
    assert_eq!(log.drive_gain_nm_a(&arm), None);
    assert_eq!(log.torque_nm(&arm).unwrap(), *in_ampere.effort.signals());
}

/// Only logs in ampere depend on gains, and only those of arms whose gains are a guess get a warning.
#[test]
fn guessed_gains_are_told() {
    let currents = text(&valid(), ",", "\n");
    let torques = currents.replace("actual_current", "actual_torque");
    let own =
        "name = \"mine\"\nlike = \"armid\"\ndrive_gain_nm_a = [9.0, 9.0, 9.0, 9.0, 9.0, 9.0]\n";
    let own = Layout::from_toml(own, "mine.toml").unwrap();
    let remarks = |robot: &str, text: &str, layout: &Layout| -> Vec<String> {
        let arm = Arm::built_in(robot).unwrap();
        let mut log = read_log_from(text.as_bytes(), "run.csv", layout, JOINTS).unwrap();
        let before = log.rows.warnings.len();
        log.warn_of_assumed_gains(&arm);
        log.rows.warnings[before..].iter().map(ToString::to_string).collect()
    };
    let guessed = remarks("ur5e", &currents, &Layout::default());
    assert!(guessed[0].contains("ur5e (12.625, ") && guessed.len() == 1, "{guessed:?}");
    assert!(remarks("ur5e", &torques, &Layout::default()).is_empty());
    assert!(remarks("ur5e", &currents, &own).is_empty());
    assert!(remarks("ur10e", &currents, &Layout::default()).is_empty());
}

/// The log that a layout like armid's, with `lines` of its own, reads in the valid file with torques behind its
/// currents.
fn read_with_torques(lines: &str) -> Result<Log, LogError> {
    let mut rows = valid();
    rows[0].extend((0..JOINTS).map(|j| format!("actual_torque_{j}")));
    rows[1..].iter_mut().for_each(|row| row.extend((0..JOINTS).map(|j| format!("{j}.5"))));
    let layout = format!("name = \"mine\"\nlike = \"armid\"\n{lines}\n");
    let layout = Layout::from_toml(&layout, "mine.toml").unwrap();
    read_log_from(text(&rows, ",", "\n").as_bytes(), "run.csv", &layout, JOINTS)
}

/// The columns that a layout names itself count before those that it inherits.
#[test]
fn own_currents_count_before_inherited_torques() {
    let currents = "[columns]\ncurrent = \"actual_current_{0}\"";
    let both = format!("{currents}\ntorque = \"actual_torque_{{0}}\"");
    for (lines, has_currents) in [("", false), (currents, true), (&*both, false)] {
        let log = read_with_torques(lines).unwrap();
        assert_eq!(matches!(log.effort, Effort::Current { .. }), has_currents, "{lines}");
        assert!(log.rows.warnings.is_empty(), "{lines}: {}", log.rows);
    }
}

#[test]
fn what_a_layout_says_of_currents_in_vain_is_told() {
    for (lines, said) in [
        ("drive_gain_nm_a = [9.0, 9.0, 9.0, 9.0, 9.0, 9.0]", "drive_gain_nm_a"),
        ("[units]\ncurrent = \"mA\"", "current under [units]"),
        ("[columns]\ncurrent = \"ampere_{0}\"", "current under [columns]"),
    ] {
        let log = read_with_torques(lines).unwrap();
        assert!(matches!(log.effort, Effort::Torque(_)), "{lines}");
        let [LogWarning::TorquesRead { stated, .. }] = &log.rows.warnings[..] else {
            panic!("{lines}: {}", log.rows)
        };
        assert_eq!(*stated, [said]);
        let warning = log.rows.warnings[0].to_string();
        assert!(warning.contains("\"mine\"") && warning.contains(said), "{warning}");
    }
}

/// Gains for another number of joints belong to another arm, even if this log needs none.
#[test]
fn there_is_a_gain_for_each_joint() {
    let result = read_with_torques("drive_gain_nm_a = [1.0, 2.0, 3.0]");
    assert_says(result, &["layout mine.toml", "drive_gain_nm_a has 3 number(s)", "6 joints"]);
}

/// A layout without torque columns does not ask for them.
#[test]
fn the_effort_that_a_layout_names_is_the_one_that_is_missing() {
    let layout = include_str!("../../layouts/armid.toml").lines();
    let layout: Vec<&str> = layout.filter(|line| !line.starts_with("torque =")).collect();
    let layout = Layout::from_toml(&layout.join("\n"), "ampere.toml").unwrap();
    let text = text(&valid(), ",", "\n").replace("actual_current", "ampere");
    let result = read_log_from(text.as_bytes(), "run.csv", &layout, JOINTS);
    assert_says(result, &["no column \"actual_current_0\"", "\"armid\""]);
}
