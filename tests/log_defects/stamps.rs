//! Time stamps: coarse, backward and wild ones, pauses, and stamps in two columns.

use super::*;

/// The line through 400 stamps that are off by 10 ms/√12 is known to 0.15 ms in the middle and to twice that at its
/// ends; the bound is five times that.
#[test]
fn stamps_that_are_coarser_than_the_rows() {
    let rounded = |rows: &mut Vec<Vec<String>>| {
        for row in &mut rows[1..] {
            let t: f64 = row[0].parse().unwrap();
            row[0] = format!("{:.2}", t);
        }
    };
    for lost in [None, Some(200)] {
        let log = edited(|rows| {
            rounded(rows);
            // A row that is set aside keeps its place in time.
            lost.into_iter().for_each(|k: usize| rows[k][3] = "x".into());
        })
        .unwrap();
        assert_eq!(log.samples(), SAMPLES - lost.iter().count());
        for (t, row) in log.time_s.iter().zip((0..SAMPLES).filter(|k| lost != Some(k + 1))) {
            assert!((t - 100.0 - STEP_S * row as f64).abs() < 1.5e-3, "{t} {row}");
        }
        assert!(log.rows.warnings.iter().any(|w| matches!(w, LogWarning::RoundedStamps { .. })));
    }
}

/// Patterns of stamps that could also come from rounding: every twentieth row missing, or every row written twice. The
/// motion shows that the stamps are right.
#[test]
fn stamps_that_only_look_rounded() {
    let is_rounded =
        |log: &Log| log.rows.warnings.iter().any(|w| matches!(w, LogWarning::RoundedStamps { .. }));
    let missing = edited(|rows| {
        let mut k = 0;
        rows.retain(|_| {
            k += 1;
            k % 20 != 0
        });
    })
    .unwrap();
    assert!(!is_rounded(&missing));
    assert_eq!(missing.samples(), SAMPLES - SAMPLES / 20);
    let twice = edited(|rows| {
        *rows = rows.iter().flat_map(|row| [row.clone(), row.clone()]).skip(1).collect();
    })
    .unwrap();
    assert!(!is_rounded(&twice));
    assert_eq!(twice.rows.count(Reason::TimeRepeated), SAMPLES);
}

/// Rows are held back and written just before the next row; one of them is set aside.
#[test]
fn stamps_of_rows_that_are_written_in_bursts() {
    let log = edited(|rows| {
        for (first, count) in [(50, 4), (120, 10), (300, 1)] {
            let written_s: f64 = rows[first + count][0].parse().unwrap();
            for row in &mut rows[first..first + count] {
                let t: f64 = row[0].parse().unwrap();
                row[0] = (t + 0.98 * (written_s - t)).to_string();
            }
        }
        rows[125][3] = "x".into();
    })
    .unwrap();
    assert_eq!((log.samples(), log.rows.missed_samples), (SAMPLES - 1, 0), "{}", log.rows);
    for (t, k) in log.time_s.iter().zip((0..SAMPLES).filter(|k| *k != 124)) {
        assert!((t - 100.0 - STEP_S * k as f64).abs() < 1e-9, "{t} {k}");
    }
    let [LogWarning::LateBursts { rows: 14, bursts: 3, after_row: 50, latest_s }] =
        log.rows.warnings[..]
    else {
        panic!("{}", log.rows)
    };
    assert!((latest_s - 9.8 * STEP_S).abs() < 1e-9, "{latest_s}");
    assert!(log.rows.to_string().contains(
        "late in bursts, by up to 78.4 ms (rows: 14, bursts: 3, the first after row 50)"
    ));
}

/// Rows arrive late by exponential times of 4 ms, never before the row in front; two are lost, and the clock is set by
/// 0.25 s. The line through 398 such stamps is known to 4 ms·√12/√398, 0.7 ms, over the log, and the size of the step to
/// 4 ms/3·√(2/128), 0.17 ms, which turns the line by 0.2 ms; the bound is four times both.
#[test]
fn stamps_of_rows_that_arrive_late_beside_lost_ones_and_a_clock_that_is_set() {
    let lost = [100_usize, 320];
    let log = edited(|rows| {
        let mut last_s = 0.0_f64;
        for (k, row) in rows[1..].iter_mut().enumerate() {
            let chance = ((k * 7919) % 1009 + 1) as f64 / 1010.0;
            let sampled_s: f64 = row[0].parse().unwrap();
            last_s = last_s.max(sampled_s - 4e-3 * chance.ln());
            let set_s = if k < 250 { 0.0 } else { 0.25 };
            row[0] = (last_s + set_s).to_string();
        }
        lost.iter().rev().for_each(|k| drop(rows.remove(k + 1)));
    })
    .unwrap();
    assert_eq!((log.samples(), log.rows.missed_samples), (SAMPLES - 2, 2), "{}", log.rows);
    let sampled_s: Vec<f64> =
        (0..SAMPLES).filter(|k| !lost.contains(k)).map(|k| 100.0 + STEP_S * k as f64).collect();
    let late_s = |k: usize| log.time_s[k] - sampled_s[k];
    for k in 0..log.samples() {
        assert!((late_s(k) - late_s(0)).abs() < 3e-3, "{k}: {} {}", late_s(k), late_s(0));
    }
    // Sample 249 is in row 250, as one before it was lost.
    let [
        LogWarning::ArrivalStamps { .. },
        LogWarning::ClockSet { times: 1, after_row: 250, first_s },
        LogWarning::MissedSamples { missed: 2, gaps: 2, .. },
    ] = log.rows.warnings[..]
    else {
        panic!("{}", log.rows)
    };
    assert!((first_s - 0.25).abs() < 1e-3, "{first_s}");
}

/// All rows are written in blocks of eight, and the arm moves in 30 of them only: these decide nothing about a line, and
/// the blocks are bursts. Each ends 70 µs late.
#[test]
fn stamps_of_rows_that_are_all_written_in_bursts() {
    let log = edited(|rows| {
        rows.truncate(394);
        for (k, row) in rows[1..].iter_mut().enumerate() {
            let stamp_s = STEP_S * (k.div_ceil(8) * 8) as f64 + 1e-5 * ((k + 7) % 8) as f64;
            row[0] = (100.0 + stamp_s).to_string();
            let (moves_s, way_rad) = (30.0 * STEP_S, 0.1);
            let s = ((STEP_S * k as f64 - 0.04) / moves_s).clamp(0.0, 1.0);
            let come = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            let rate = 30.0 * (s * (1.0 - s)).powi(2) / moves_s;
            for j in 0..JOINTS {
                row[1 + j] = (angle_rad(j, 100.0) + way_rad * come).to_string();
                row[1 + JOINTS + j] = (way_rad * rate).to_string();
            }
        }
    })
    .unwrap();
    assert_eq!((log.samples(), log.rows.missed_samples), (393, 0), "{}", log.rows);
    for (k, t) in log.time_s.iter().enumerate() {
        assert!((t - 100.0 - STEP_S * k as f64).abs() < 1e-4, "{t} {k}");
    }
    assert!(
        matches!(log.rows.warnings[..], [LogWarning::LateBursts { rows: 343, bursts: 49, .. }]),
        "{}",
        log.rows
    );
}

/// A recorder that reads the arm every 2 to 14 ms: the stamps are right, and no row is missing.
#[test]
fn rows_that_are_sampled_unevenly_are_all_there() {
    let log = edited(|rows| {
        let mut t = 100.0_f64;
        for (k, row) in rows[1..].iter_mut().enumerate() {
            row[0] = t.to_string();
            for j in 0..JOINTS {
                row[1 + j] = angle_rad(j, t).to_string();
                row[1 + JOINTS + j] = velocity_rad_s(j, t).to_string();
            }
            t += 0.002 + 0.003 * ((k * 7919) % 1009 % 5) as f64;
        }
    })
    .unwrap();
    assert_eq!((log.samples(), log.rows.missed_samples), (SAMPLES, 0), "{}", log.rows);
    assert_eq!(log.rows.warnings, [], "{}", log.rows);
}

#[test]
fn repeated_and_backward_times() {
    let result = edited(|rows| rows[51][0] = rows[50][0].clone());
    assert_one_row_aside(result, Reason::TimeRepeated, 52, "100.392");
    let result = edited(|rows| rows[51][0] = "3.25".into());
    assert_one_row_aside(result, Reason::TimeBackwards, 52, "3.25");
    let result = edited(|rows| {
        let copy = rows[51].clone();
        rows.insert(51, copy);
    });
    assert_one_row_aside(result, Reason::TimeRepeated, 53, "100.4");
    let result = edited(|rows| rows.swap(51, 52));
    assert_one_row_aside(result, Reason::TimeBackwards, 53, "100.4");
}

#[test]
fn one_time_far_ahead_costs_one_row_and_not_all_that_follow() {
    for k in [1, 51, SAMPLES - 2] {
        let result = edited(|rows| rows[k][0] = "5000".into());
        assert_one_row_aside(result, Reason::TimeAhead, k + 1, "5000");
    }
}

#[test]
fn a_few_times_far_ahead_cost_their_rows_and_not_all_that_follow() {
    let ahead = |k: usize, times: &[f64]| {
        let log = edited(|rows| {
            for (row, time) in rows[k..].iter_mut().zip(times) {
                row[0] = time.to_string();
            }
        });
        log.unwrap().rows
    };
    for k in [1, 51] {
        for count in [2_usize, 8] {
            let times: Vec<f64> = (0..count).map(|i| 5000.0 + STEP_S * i as f64).collect();
            let rows = ahead(k, &times);
            assert_eq!(
                (rows.count(Reason::TimeAhead), rows.used),
                (count, SAMPLES - count),
                "{rows}"
            );
            assert_eq!(rows.set_aside[0].first_row, k + 1);
            assert_eq!(rows.missed_samples, 0, "{rows}");
        }
    }
    // The clock stands still or jumps about far ahead.
    for times in [[5000.0, 5000.0, 5000.0], [5000.0, 4000.0, 6000.0]] {
        assert_eq!(ahead(51, &times).used, SAMPLES - 3);
    }
}

#[test]
fn a_log_that_goes_on_behind_a_pause_is_kept() {
    // Three rows after a pause of a minute, two stamps go back to before the pause; they are too few to be believed.
    let log = edited(|rows| {
        for row in &mut rows[51..] {
            row[0] = (row[0].parse::<f64>().unwrap() + 60.0).to_string();
        }
        for (row, time) in [(54, "101"), (55, "102")] {
            rows[row][0] = time.into();
        }
    });
    let rows = log.unwrap().rows;
    assert_eq!((rows.count(Reason::TimeBackwards), rows.used), (2, SAMPLES - 2), "{rows}");
}

/// Seconds and nanoseconds since 1970; their sum as a number of 53 bits resolves a quarter of a microsecond.
#[test]
fn stamps_in_two_columns_are_added() {
    let mut rows = valid();
    rows[0].insert(1, "nanoseconds".to_owned());
    for (k, row) in rows[1..].iter_mut().enumerate() {
        let nanoseconds = 1_700_000_000_900_000_000 + 8_000_000 * k as u64;
        row[0] = (nanoseconds / 1_000_000_000).to_string();
        row.insert(1, (nanoseconds % 1_000_000_000).to_string());
    }
    let layout = include_str!("../../layouts/armid.toml");
    let layout = layout.replace("[columns]", "[columns]\ntime_nanoseconds = \"nanoseconds\"");
    let layout = Layout::from_toml(&layout, "ros.toml").unwrap();
    let read = |rows: &[Vec<String>]| {
        read_log_from(text(rows, ",", "\n").as_bytes(), "run.csv", &layout, JOINTS)
    };
    let log = read(&rows).unwrap();
    assert_eq!((log.samples(), log.rows.warnings.len()), (SAMPLES, 0), "{}", log.rows);
    for (k, time_s) in log.time_s.iter().enumerate() {
        let since_s = time_s - 1_700_000_000.0 - 0.9;
        assert!((since_s - STEP_S * k as f64).abs() < 5e-7, "{k}: {since_s}");
    }
    rows[8][1] = "5000000000".to_owned();
    assert_one_row_aside(read(&rows), Reason::Implausible, row(7), "5000000000");
}
