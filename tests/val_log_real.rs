//! Real logs of a UR10e and a UR3e with known defects, read from the folder named by `ARMID_DATA`.
//!
//! The numbers below were counted from the files by other means: field counts per line and time steps, with awk and
//! NumPy.

use armid::log::{Effort, Layout, Log, LogWarning, Reason, read_log};
use armid::robot::Arm;

use crate::real_logs;

fn check_sums(log: &Log) {
    let rows = &log.rows;
    println!("{}\n{rows}", log.source);
    assert_eq!(rows.read, rows.used + rows.total_set_aside(), "{}", log.source);
    assert_eq!(log.samples(), rows.used);
    assert!(log.time_s.windows(2).all(|pair| pair[1] > pair[0]), "{}", log.source);
    assert_eq!(log.sha256.len(), 64);
}

/// File, rows read, rows used, samples missed, and whether the file has the manufacturer's feed-forward.
const UR10E: [(&str, usize, usize, usize, bool); 13] = [
    ("collision_2link.csv", 5772, 5772, 0, false),
    ("collision_free.csv", 1731, 1731, 0, false),
    // Rows 1 to 20 hold uninitialised numbers, shifted fields, zeros or the posture of another time.
    ("ur-19_09_27-11_32_02.csv", 1139, 1119, 0, false),
    ("ur-20_01_17-ptp_10_points.csv", 5347, 5347, 0, true),
    ("ur-20_01_22-joint_1.csv", 5889, 5889, 0, true),
    ("ur-20_01_22-joint_2.csv", 6030, 6030, 0, true),
    ("ur-20_01_22-joint_4.csv", 6288, 6288, 0, true),
    ("ur-20_01_31-load.csv", 2881, 2881, 0, true),
    ("ur-20_01_31-unload.csv", 2623, 2623, 2, true),
    ("ur-20_02_10-30sec_12harm.csv", 3691, 3691, 0, true),
    ("ur-20_02_12-50sec_12harm.csv", 5457, 5457, 1, true),
    // The last line has no line end.
    ("ur-20_02_19_14harm50sec.csv", 5375, 5374, 0, true),
    ("ur-20_02_19_14harm50secLoad.csv", 5307, 5307, 0, true),
];

#[test]
fn one_layout_takes_every_ur10e_file_and_accounts_for_every_row() {
    let Some(folder) = real_logs::folder() else { return };
    let layout = Layout::load("ur10e_innopolis").unwrap();
    for (name, read, used, missed, feed_forward) in UR10E {
        let log = read_log(&folder.join("ur10e").join(name), &layout, 6).unwrap();
        check_sums(&log);
        assert_eq!((log.rows.read, log.rows.used), (read, used), "{name}");
        assert_eq!(log.rows.missed_samples, missed, "{name}");
        assert_eq!(log.target_effort.is_some(), feed_forward, "{name}");
    }
    let mut files: Vec<_> = std::fs::read_dir(folder.join("ur10e"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".csv"))
        .collect();
    files.sort();
    assert_eq!(files, UR10E.map(|(name, ..)| name), "a file of the folder is not in this test");
}

#[test]
fn uninitialised_rows_are_set_aside_by_reason() {
    let Some(folder) = real_logs::folder() else { return };
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let log = read_log(&folder.join("ur10e/ur-19_09_27-11_32_02.csv"), &layout, 6).unwrap();
    // Rows 2 (without large numbers), 5, 9, 13, 14, 15 and 18 are plausible numbers in the wrong columns.
    assert_eq!(log.rows.count(Reason::Implausible) + log.rows.count(Reason::Inconsistent), 20);
    let first_used = log.time_s[0];
    assert!(
        (first_used - 0.731).abs() < 0.02,
        "the first good stretch begins in row 21: {first_used}"
    );
    assert!(log.q_rad.joint(1).iter().all(|q| q.abs() < 3.5));
    let log = read_log(&folder.join("ur10e/ur-20_02_19_14harm50sec.csv"), &layout, 6).unwrap();
    assert_eq!(log.rows.count(Reason::CutShort), 1);
    assert_eq!(log.rows.set_aside[0].first_row, 5375);
}

#[test]
fn the_ur10e_layouts_bring_their_own_drive_gains() {
    let Some(folder) = real_logs::folder() else { return };
    let arm = Arm::built_in("ur10e").unwrap();
    let file = folder.join("ur10e/ur-20_02_19_14harm50sec.csv");
    for (name, gain) in [("ur10e_innopolis", 11.98), ("ur10e_innopolis_author", 10.0)] {
        let log = read_log(&file, &Layout::load(name).unwrap(), 6).unwrap();
        let torque_nm = log.torque_nm(&arm).unwrap();
        let Effort::Current { ampere, .. } = &log.effort else { panic!("these are currents") };
        assert_eq!(torque_nm.joint(0)[100], gain * ampere.joint(0)[100]);
        assert!(log.target_torque_nm(&arm).unwrap().is_some());
    }
}

#[test]
fn the_ur3e_log_is_read_with_the_default_layout() {
    let Some(folder) = real_logs::folder() else { return };
    let log = read_log(&folder.join("ur3e/rtde_full_log.csv"), &Layout::default(), 6).unwrap();
    check_sums(&log);
    assert_eq!((log.rows.read, log.rows.used), (1968, 1968));
    let missed = log.rows.warnings.iter().find_map(|w| match w {
        LogWarning::MissedSamples { missed, gaps, .. } => Some((*missed, *gaps)),
        _ => None,
    });
    // 24 steps of 16 ms and one of 24 ms among steps of 8 ms.
    assert_eq!(missed, Some((26, 25)));
    assert!(log.temperature_c.is_some() && log.target_qdd_rad_s2.is_some());
}

#[test]
fn the_wrong_layout_is_named() {
    let Some(folder) = real_logs::folder() else { return };
    let ur10e = folder.join("ur10e/ur-20_02_19_14harm50sec.csv");
    let message = read_log(&ur10e, &Layout::default(), 6).unwrap_err().to_string();
    assert!(message.contains("838.4650") && message.contains("--layout"), "{message}");
    let ur3e = folder.join("ur3e/rtde_full_log.csv");
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let message = read_log(&ur3e, &layout, 6).unwrap_err().to_string();
    assert!(message.contains("timestamp") && message.contains("header"), "{message}");
}
