//! Logs without velocities, and readings that are held over several rows.

use super::*;

/// The layout of the valid log without its velocities.
fn without_velocities() -> Layout {
    let layout = include_str!("../../layouts/armid.toml");
    let lines = layout.lines().filter(|line| !line.starts_with("qd = \"actual"));
    let text = lines.collect::<Vec<_>>().join("\n");
    assert!(text.len() < layout.len() - 10, "{text}");
    Layout::from_toml(&text, "no_qd.toml").unwrap()
}

/// Columns of zeros are not velocities, and the suggested remedy works: slopes of the angles, also of wrapped ones,
/// have an error of (ω h)⁴/30 of up to 1.8 rad/s, and six times that at the ends, where they are one-sided.
#[test]
fn velocities_that_were_not_recorded_are_slopes_of_the_angles() {
    let mut rows = valid();
    scale(&mut rows, 7..13, 0.0);
    assert_eq!(suspected(read(text(&rows, ",", "\n"))), ("no velocity", ""));
    for row in &mut rows[1..] {
        let angle: f64 = row[4].parse().unwrap();
        row[4] = ((angle + 1.0).rem_euclid(TAU) - PI).to_string();
    }
    let (text, layout) = (text(&rows, ",", "\n"), without_velocities());
    let log = read_log_from(text.as_bytes(), "run.csv", &layout, JOINTS).unwrap();
    assert_eq!(log.rows.used, SAMPLES);
    let [LogWarning::Unwrapped { joint: 4, .. }, LogWarning::SlopesOfAngles] =
        log.rows.warnings[..]
    else {
        panic!("{:?}", log.rows.warnings)
    };
    let bound = 6.0 * 1.8 * (2.0 * STEP_S).powi(4) / 30.0;
    for j in 0..JOINTS {
        for (slope, t) in log.qd_rad_s.joint(j).iter().zip(&log.time_s) {
            let off = slope - velocity_rad_s(j, *t);
            assert!(off.abs() < bound, "joint {}: off by {off} at {t} s", j + 1);
        }
    }
}

/// Velocities that are slopes of the angles agree with them in any unit of time; the clock tells the unit, and minutes
/// are told by the speed.
#[test]
fn the_units_of_a_log_without_velocities_are_recognised() {
    let layout = without_velocities();
    for (factors, expected) in [
        ([1e3, 1.0], ("clock", "ms")),
        ([1e6, 1.0], ("clock", "us")),
        ([1e9, 1.0], ("clock", "ns")),
        ([1.0 / 60.0, 1.0], ("speed", "")),
        ([1.0 / 3600.0, 1.0], ("speed", "")),
        ([1.0, 180.0 / PI], ("both", "deg")),
        ([1e3, 180.0 / PI], ("clock", "ms")),
    ] {
        let mut rows = valid();
        scale(&mut rows, 0..1, factors[0]);
        scale(&mut rows, 1..7, factors[1]);
        let text = text(&rows, ",", "\n");
        let result = read_log_from(text.as_bytes(), "run.csv", &layout, JOINTS);
        assert_eq!(suspected(result), expected, "{factors:?}");
    }
}

/// Steps of a second are those of a slow recorder or of milliseconds, and not rows that do not follow from each other.
#[test]
fn rows_that_are_far_apart_are_not_only_taken_for_milliseconds() {
    let mut rows = valid();
    let mut k = 0;
    rows.retain(|_| {
        k += 1;
        k < 3 || k % 50 == 2
    });
    scale(&mut rows, 0..1, 1.0 / (50.0 * STEP_S));
    let text = text(&rows, ",", "\n");
    let result = read_log_from(text.as_bytes(), "run.csv", &without_velocities(), JOINTS);
    let parts = ["by 1.000e0 s", "row 2", "too far apart", "or the time is in ms", "time = \"ms\""];
    assert_says(result, &parts);
}

/// Stamps rounded to 0.01 s at 125 rows per second, without velocities that could show that the rows are evenly spaced.
#[test]
fn rounded_stamps_are_mended_without_velocities() {
    let mut rows = valid();
    for line in &mut rows[1..] {
        let time: f64 = line[0].parse().unwrap();
        line[0] = format!("{:.2}", time);
    }
    let text = text(&rows, ",", "\n");
    let log = read_log_from(text.as_bytes(), "run.csv", &without_velocities(), JOINTS).unwrap();
    assert_eq!(log.rows.used, SAMPLES);
    assert!(matches!(log.rows.warnings[0], LogWarning::RoundedStamps { .. }), "{}", log.rows);
    for (k, slope) in log.qd_rad_s.joint(1).iter().enumerate() {
        // The line through 400 stamps is known to 0.01 s/√(12 · 400) at its middle, and its slope to a ten thousandth.
        let truth = velocity_rad_s(1, 100.0 + STEP_S * k as f64);
        assert!((slope - truth).abs() < 2e-3, "{slope} {truth}");
    }
}

/// A wild angle costs only its own row. The rows beside it stay, and the wild angle does not enter their slopes.
#[test]
fn wild_angles_are_in_no_slopes() {
    let mut rows = valid();
    let wild: Vec<usize> = (20..SAMPLES).step_by(40).collect();
    for k in &wild {
        rows[row(*k) - 1][3] = "2.5".into();
    }
    let text = text(&rows, ",", "\n");
    let log = read_log_from(text.as_bytes(), "run.csv", &without_velocities(), JOINTS).unwrap();
    assert_eq!(log.rows.used, SAMPLES - wild.len());
    assert_eq!(log.rows.set_aside[0].reason, Reason::Inconsistent);
    assert!(log.rows.set_aside[0].example.contains("2.5"), "{}", log.rows);
    for (slope, t) in log.qd_rad_s.joint(2).iter().zip(&log.time_s) {
        // Beside a missing row the steps are twice as long; at the ends, slopes are one-sided.
        let bound = 16.0 * 6.0 * 1.8 * (2.0 * STEP_S).powi(4) / 30.0;
        assert!((slope - velocity_rad_s(2, *t)).abs() < bound, "{slope} at {t} s");
    }
}

/// Readings at 42 Hz in a file at 125 Hz: two in three rows repeat old readings. An arm at rest with noisy velocities
/// must not be mistaken for this.
#[test]
fn rows_that_hold_old_readings_are_told() {
    let log = edited(|rows| {
        for k in 0..SAMPLES {
            let read = rows[row(k - k % 3) - 1].clone();
            rows[row(k) - 1][1..].clone_from_slice(&read[1..]);
        }
    })
    .unwrap();
    let held = log.rows.warnings.iter().find_map(|warning| match warning {
        LogWarning::Held { share, rate_hz } => Some((*share, *rate_hz)),
        _ => None,
    });
    let (share, rate_hz) = held.expect("it is told");
    let at_rest = edited(|rows| {
        for k in 0..SAMPLES / 2 {
            for j in 0..JOINTS {
                rows[row(k) - 1][1 + j] = rows[row(SAMPLES / 2) - 1][1 + j].clone();
                rows[row(k) - 1][1 + JOINTS + j] =
                    (0.004 * (k as f64 + j as f64).sin()).to_string();
            }
        }
    });
    let warnings = at_rest.unwrap().rows.warnings;
    assert!(!warnings.iter().any(|w| matches!(w, LogWarning::Held { .. })), "{warnings:?}");
    // 400 rows are 133 groups of three and one more row.
    assert!((share - 2.0 / 3.0).abs() < 0.003, "{share}");
    assert!((rate_hz * STEP_S - 1.0 / 3.0).abs() < 0.003, "{rate_hz}");
}
