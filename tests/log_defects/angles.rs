//! Angles that jump or wrap around.

use super::*;

/// Adds `offset_rad` to the angle of joint 2 from row 201 of the file on.
fn with_a_jump(offset_rad: f64) -> Log {
    let log = edited(|rows| {
        for row in &mut rows[200..] {
            row[2] = (row[2].parse::<f64>().unwrap() + offset_rad).to_string();
        }
    });
    log.unwrap()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn an_angle_that_jumps_by_a_turn_is_unwrapped() {
    let expected = edited(|_| {}).unwrap();
    for offset_rad in [2.0 * PI, -2.0 * PI] {
        let log = with_a_jump(offset_rad);
        assert_eq!((log.samples(), log.rows.warnings.len()), (SAMPLES, 1), "{}", log.rows);
        let warning = log.rows.warnings[0].to_string();
        for part in ["row 200", "joint 2", "unwrapped 1 times"] {
            assert!(warning.contains(part), "{warning}");
        }
        // Two roundings of numbers below 16.
        assert!(largest_difference(log.q_rad.joint(1), expected.q_rad.joint(1)) < 4e-15);
        assert_eq!(log.q_rad.joint(2), expected.q_rad.joint(2));
    }
}

#[test]
fn a_jump_that_is_no_turn_stays() {
    let expected = edited(|_| {}).unwrap();
    let log = with_a_jump(3.0);
    let warning = log.rows.warnings[0].to_string();
    for part in ["jumps 1 times", "row 200", "joint 2", "3.0"] {
        assert!(warning.contains(part), "{warning}");
    }
    let jump_rad = log.q_rad.joint(1)[300] - expected.q_rad.joint(1)[300];
    assert!((jump_rad - 3.0).abs() < 1e-14);
}

/// Angles are wrapped to the range −1 to 2π − 1: each joint crosses the seam in the middle of its motion, on its way up
/// and down.
#[test]
fn wrapped_angles_and_their_targets_are_put_together_again() {
    let wrapped = |q: f64| if q < -1.0 { q + 2.0 * PI } else { q };
    // The target leads the angle and crosses the seam in other rows.
    let target_rad = |j: usize, t: f64| angle_rad(j, t + 0.05);
    let mut seams = 0;
    let log = edited(|rows| {
        rows[0].extend((0..JOINTS).map(|j| format!("target_q_{j}")));
        for row in &mut rows[1..] {
            let t: f64 = row[0].parse().unwrap();
            for j in 0..JOINTS {
                row[1 + j] = wrapped(angle_rad(j, t)).to_string();
                row.push(wrapped(target_rad(j, t)).to_string());
            }
        }
        let is_high = |row: &[String], j: usize| row[1 + j].parse::<f64>().unwrap() > 1.0;
        for pair in rows[1..].windows(2) {
            seams += (0..JOINTS).filter(|&j| is_high(&pair[0], j) != is_high(&pair[1], j)).count();
        }
    })
    .unwrap();
    assert!(seams > JOINTS);
    assert_eq!(log.samples(), SAMPLES);
    assert!(
        matches!(log.rows.warnings[..], [LogWarning::Unwrapped { count, .. }] if count == seams)
    );
    let target = log.target_q_rad.unwrap();
    for j in 0..JOINTS {
        // The first angle of a joint is not changed.
        let begin = log.q_rad.joint(j)[0] - angle_rad(j, log.time_s[0]);
        let of = |f: &dyn Fn(usize, f64) -> f64| -> Vec<f64> {
            log.time_s.iter().map(|&t| begin + f(j, t)).collect()
        };
        assert!(largest_difference(log.q_rad.joint(j), &of(&angle_rad)) < 1e-14);
        assert!(largest_difference(target.joint(j), &of(&target_rad)) < 1e-14);
    }
}
