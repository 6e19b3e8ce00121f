//! Damaged rows, columns and bytes.

use super::*;

#[test]
fn the_valid_log_is_read_as_it_is() {
    let log = edited(|_| {}).unwrap();
    assert_eq!((log.rows.read, log.rows.used), (SAMPLES, SAMPLES));
    assert!(log.rows.set_aside.is_empty() && log.rows.warnings.is_empty(), "{}", log.rows);
    let t = log.time_s[7];
    assert_eq!(log.q_rad.joint(3)[7], angle_rad(3, t));
    assert_eq!(log.qd_rad_s.joint(3)[7], velocity_rad_s(3, t));
    assert_eq!(log.effort.signals().joint(3)[7], 1.5 * (t + 3.0).sin());
}

#[test]
fn byte_order_mark_line_ends_blank_lines_and_delimiters_change_nothing() {
    let rows = valid();
    let expected = read(text(&rows, ",", "\n")).unwrap();
    let quoted = text(&rows, ",", "\n").replacen("timestamp", "\"timestamp\"", 1);
    for variant in [
        format!("\u{feff}{}", text(&rows, ",", "\n")),
        text(&rows, ",", "\r\n"),
        text(&rows, " ", "\r\r\n"),
        text(&rows, ",", "\r"),
        text(&rows, ";", "\n"),
        text(&rows, "\t", "\n"),
        text(&rows, "  ", " \n"),
        text(&rows, ", ", "\n"),
        text(&rows, ",", ",\n"),
        text(&rows, ",", "\n") + "\n\n  \n",
        text(&rows, ",", "\n\n"),
        quoted,
    ] {
        let mut log = read(&variant).unwrap_or_else(|e| panic!("{e}: {:?}", &variant[..60]));
        log.sha256.clone_from(&expected.sha256);
        // Apart from the hash, only the row numbers could differ, where blank lines lie between rows.
        assert_eq!(log, expected, "{:?}", &variant[..60]);
    }
}

#[test]
fn rows_are_numbered_as_in_the_file() {
    let mut lines = text(&valid(), ",", "\n");
    lines = format!("\n\n{lines}").replacen("\n100.016,", "\n\n100.016,NaN", 1);
    let log = read(lines).unwrap();
    // Two blank lines, the header, two samples, a blank line: the third sample is row 7.
    assert_eq!(log.rows.set_aside[0].first_row, 7, "{}", log.rows);
}

#[test]
fn a_missing_column() {
    let result = edited(|rows| rows[0][9] = "speed_2".into());
    assert_says(result, &["run.csv", "row 1", "actual_qd_2", "armid"]);
    let result = edited(|rows| rows[0][0] = "time".into());
    assert_says(result, &["run.csv", "row 1", "\"timestamp\"", "\"time\""]);
}

#[test]
fn a_duplicate_column() {
    let result = edited(|rows| rows[0][9] = "actual_qd_1".into());
    assert_says(result, &["run.csv", "row 1", "\"actual_qd_1\" twice", "9 and 10"]);
}

#[test]
fn neither_currents_nor_torques() {
    let result = edited(|rows| rows.iter_mut().for_each(|row| row.truncate(13)));
    assert_says(result, &["run.csv", "row 1", "actual_current_0", "actual_torque_0"]);
}

#[test]
fn a_log_of_another_arm() {
    let three = edited(|rows| {
        for row in rows {
            let fields: Vec<String> =
                [0, 1, 2, 3, 7, 8, 9, 13, 14, 15].iter().map(|&c| row[c].clone()).collect();
            *row = fields;
        }
    });
    assert_says(three, &["run.csv", "3 joints", "arm has 6"]);
    let result =
        read_log_from(text(&valid(), ",", "\n").as_bytes(), "run.csv", &Layout::default(), 3);
    assert_says(result, &["run.csv", "6 joints", "arm has 3"]);
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let rows = text(&valid()[1..], ",", "\n");
    let result = read_log_from(rows.as_bytes(), "run.csv", &layout, 3);
    assert_says(result, &["run.csv", "layout has 6 joints", "arm has 3"]);
}

#[test]
fn a_wrong_layout() {
    assert_says(read(text(&valid()[1..], ",", "\n")), &["run.csv", "row 1", "100", "--layout"]);
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let with_header = text(&valid(), ",", "\n");
    let result = read_log_from(with_header.as_bytes(), "run.csv", &layout, 6);
    assert_says(result, &["run.csv", "row 1", "\"timestamp\"", "header"]);
    let narrow: Vec<Vec<String>> = valid()[1..].iter().map(|row| row[..18].to_vec()).collect();
    let result = read_log_from(text(&narrow, ",", "\n").as_bytes(), "run.csv", &layout, 6);
    assert_says(result, &["run.csv", "row 1", "18 fields", "19, 25, 31"]);
}

#[test]
fn one_cut_row_at_the_top_does_not_decide_the_width() {
    let mut rows = valid()[1..].to_vec();
    rows[0].truncate(12);
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let result = read_log_from(text(&rows, ",", "\n").as_bytes(), "run.csv", &layout, 6);
    assert_one_row_aside(result, Reason::TooFewFields, 1, "12 fields of 19");
}

#[test]
fn numbers_that_are_none() {
    for (value, reason) in [
        ("NaN", Reason::NotFinite),
        ("inf", Reason::NotFinite),
        ("-Infinity", Reason::NotFinite),
        ("1e999", Reason::NotFinite),
        ("", Reason::EmptyField),
        ("n/a", Reason::NotANumber),
        ("1e293", Reason::Implausible),
        ("-5.9e293", Reason::Implausible),
    ] {
        for column in [0, 3, 10, 18] {
            let result = edited(|rows| rows[51][column] = value.into());
            assert_one_row_aside(result, reason, 52, value);
        }
    }
}

#[test]
fn implausible_values_of_each_quantity() {
    for (column, value) in [(3, "1001"), (10, "-101"), (18, "501")] {
        let result = edited(|rows| rows[51][column] = value.into());
        assert_one_row_aside(result, Reason::Implausible, 52, value);
    }
}

/// Currents in milliamperes: only rows near a zero crossing of all joints would be plausible in amperes.
#[test]
fn a_unit_in_which_most_rows_are_implausible() {
    let result = edited(|rows| scale(rows, 13..19, 1000.0));
    assert_says(result, &["run.csv", "implausible", "row 2", "actual_current_0", "units"]);
}

/// A delimiter at the end of every row does not make another field, with or without a header.
#[test]
fn delimiters_at_the_ends_of_rows_without_a_header() {
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let read = |end: &str| {
        let rows = text(&valid()[1..], ",", end);
        read_log_from(rows.as_bytes(), "run.csv", &layout, JOINTS).unwrap_or_else(|e| panic!("{e}"))
    };
    let (plain, ended) = (read("\n"), read(",\n"));
    assert_eq!((plain.samples(), plain.rows), (ended.samples(), ended.rows));
    assert_eq!(plain.effort.signals(), ended.effort.signals());
}

#[test]
fn rows_of_another_width() {
    let result = edited(|rows| rows[51].truncate(12));
    assert_one_row_aside(result, Reason::TooFewFields, 52, "12 fields of 19");
    let result = edited(|rows| rows[51].push("1".into()));
    assert_one_row_aside(result, Reason::TooManyFields, 52, "20 fields of 19");
}

#[test]
fn a_file_cut_anywhere_in_its_last_row() {
    let whole = text(&valid(), ",", "\n");
    let last = whole.trim_end().rfind('\n').unwrap() + 1;
    for cut in last + 1..whole.len() {
        let log = read(&whole[..cut]).unwrap();
        assert_eq!(log.rows.count(Reason::CutShort), 1, "{}", log.rows);
        assert_eq!(log.rows.set_aside[0].first_row, row(SAMPLES - 1));
        assert_eq!(log.samples(), SAMPLES - 1);
    }
}

#[test]
fn a_row_shifted_by_a_column() {
    let result = edited(|rows| rows[51][1..].rotate_right(1));
    let log = result.unwrap();
    assert_eq!(log.rows.count(Reason::Inconsistent), 1, "{}", log.rows);
    assert_eq!(log.rows.set_aside[0].first_row, 52);
}

#[test]
fn every_fifth_row_uninitialised() {
    let log = edited(|rows| {
        for row in rows[1..].iter_mut().step_by(5) {
            row[1..].fill("0".into());
        }
    })
    .unwrap();
    assert_eq!(log.rows.count(Reason::Inconsistent), SAMPLES / 5, "{}", log.rows);
    assert_eq!(log.rows.missed_samples, 0, "rows set aside are not rows the recorder left out");
    assert!(log.rows.warnings.iter().any(|w| matches!(w, LogWarning::ManySetAside { .. })));
}

#[test]
fn missed_samples_are_counted() {
    let log = edited(|rows| drop(rows.drain(51..54))).unwrap();
    assert_eq!(log.rows.missed_samples, 3);
    let warning = log.rows.warnings[0].to_string();
    assert!(warning.contains("3 samples") && warning.contains("row 51"), "{warning}");
}

#[test]
fn files_without_data() {
    assert_says(read(""), &["run.csv", "the file is empty; record"]);
    assert_says(read("\n"), &["run.csv", "empty", "(1 blank line)"]);
    assert_says(read("\n\r\n  \n"), &["run.csv", "empty", "3 blank lines"]);
    assert_says(edited(|rows| rows.truncate(1)), &["run.csv", "row 1", "header"]);
    assert_says(edited(|rows| rows.truncate(2)), &["run.csv", "1 can be used"]);
    let result = edited(|rows| rows.iter_mut().skip(1).for_each(|row| row[4] = "NaN".into()));
    assert_says(result, &["run.csv", "400 rows read", "row 2", "actual_q_3", "NaN"]);
}

#[test]
fn files_that_are_no_text() {
    assert_says(read(b"\x7fELF\x02\x01\x01\x00\x00"), &["run.csv", "byte 8", "0x00"]);
    assert_says(read(b"\xff\xfet\x00i\x00"), &["run.csv", "UTF-16", "UTF-8"]);
    let endless = vec![b'x'; 1 << 20];
    assert_says(read(endless), &["run.csv", "row 1", "65536 bytes"]);
    let folder = tempfile::tempdir().unwrap();
    let read_path = |path: &Path| read_log(path, &Layout::default(), JOINTS);
    assert_says(read_path(folder.path()), &["folder"]);
    assert_says(read_path(&folder.path().join("none.csv")), &["none.csv", "cannot be read"]);
}
