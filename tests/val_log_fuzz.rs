//! Whatever its input bytes, the reader returns a log or an error, and a log keeps its guarantees.
//!
//! `ARMID_FUZZ_CASES` sets the number of inputs per test (default 400).

use std::panic::{AssertUnwindSafe, catch_unwind};

use armid::log::{Layout, Log, LogError, read_log_from};
use proptest::prelude::*;
use proptest::sample::Index;

fn config() -> ProptestConfig {
    let cases =
        std::env::var("ARMID_FUZZ_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(400);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

const JOINTS: usize = 2;

/// The default layout, and a layout without a header that has two widths, with decimal points and with commas.
fn layouts() -> [Layout; 3] {
    let plain = "name = \"plain\"\nheader = false\n[columns]\ntime = 1\n\
        q = { first = 2, last = 3 }\nqd = { first = 4, last = 5 }\ncurrent = { first = 6, last = 7 }\n\
        torque = { first = 8, last = 9 }\n\
        [[width]]\nfields = 7\nblocks = [\"time\", \"q\", \"qd\", \"current\"]\n\
        [[width]]\nfields = 9\nblocks = [\"time\", \"q\", \"qd\", \"torque\"]\n";
    let comma = plain.replacen("header", "decimal_comma = true\nheader", 1);
    [
        Layout::default(),
        Layout::from_toml(plain, "plain").unwrap(),
        Layout::from_toml(&comma, "comma").unwrap(),
    ]
}

/// A valid log of two joints, with or without a header.
fn valid(header: bool, rows: usize) -> Vec<u8> {
    let mut text = String::new();
    if header {
        text += "timestamp,actual_q_0,actual_q_1,actual_qd_0,actual_qd_1,actual_current_0,actual_current_1\n";
    }
    for k in 0..rows {
        let t = 0.01 * k as f64;
        let (s, c) = (2.0 * t).sin_cos();
        text += &format!("{t},{s},{c},{},{},{},{}\n", 2.0 * c, -2.0 * s, s - c, s + c);
    }
    text.into_bytes()
}

/// Checks the guarantees of a log, or the message of an error.
fn check(result: Result<Log, LogError>) {
    match result {
        Ok(log) => {
            assert_eq!(log.rows.read, log.rows.used + log.rows.total_set_aside());
            assert!(log.rows.used >= 2 && log.samples() == log.rows.used);
            assert!(log.time_s.windows(2).all(|pair| pair[1] > pair[0]));
            for signals in [&log.q_rad, &log.qd_rad_s, log.effort.signals()] {
                assert_eq!((signals.joints(), signals.samples()), (JOINTS, log.samples()));
                assert!((0..JOINTS).all(|j| signals.joint(j).iter().all(|v| v.is_finite())));
            }
            assert!(log.q_rad.joint(0).iter().all(|q| q.abs() <= 1e3));
            assert!(!log.rows.to_string().is_empty());
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.csv: "), "{error}"),
    }
}

fn read_with_all_layouts(bytes: &[u8]) {
    for layout in layouts() {
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            check(read_log_from(bytes, "fuzz.csv", &layout, JOINTS));
        }));
        assert!(outcome.is_ok(), "{}: {}", layout.name, bytes.escape_ascii());
    }
}

#[derive(Debug, Clone)]
enum Mutation {
    Cut(Index),
    Byte(Index, u8),
    Insert(Index, Vec<u8>),
    Remove(Index, usize),
    SwapColumns(Index, Index),
    RepeatRow(Index),
    MoveRow(Index, Index),
    Field(Index, Index, String),
    Replace(&'static str, &'static str),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let index = any::<Index>;
    let field = prop::sample::select(vec![
        "NaN",
        "inf",
        "-inf",
        "1e293",
        "-1e308",
        "1e-320",
        "1e999",
        "",
        "0",
        "-0",
        "253.0",
        "1,5",
        "\"1\"",
        "x",
        "99999999999999999999",
        "+.5",
        "1e",
        "\u{feff}",
        "é",
    ]);
    let text = prop::sample::select(vec![
        (",", ";"),
        (",", " "),
        (",", "\t"),
        (".", ","),
        ("\n", "\r\n"),
        ("\n", "\r"),
        ("\n", "\r\r\n"),
        ("\n", "\n\n"),
        ("_q_", "_Q_"),
        ("current", "torque"),
        ("timestamp", "\u{feff}timestamp"),
    ]);
    prop_oneof![
        index().prop_map(Mutation::Cut),
        (index(), any::<u8>()).prop_map(|(at, byte)| Mutation::Byte(at, byte)),
        (index(), prop::collection::vec(any::<u8>(), 1..40))
            .prop_map(|(at, bytes)| Mutation::Insert(at, bytes)),
        (index(), 1..60_usize).prop_map(|(at, length)| Mutation::Remove(at, length)),
        (index(), index()).prop_map(|(a, b)| Mutation::SwapColumns(a, b)),
        index().prop_map(Mutation::RepeatRow),
        (index(), index()).prop_map(|(a, b)| Mutation::MoveRow(a, b)),
        (index(), index(), field).prop_map(|(row, column, text)| Mutation::Field(
            row,
            column,
            text.to_owned()
        )),
        (index(), index(), any::<f64>()).prop_map(|(row, column, value)| Mutation::Field(
            row,
            column,
            value.to_string()
        )),
        text.prop_map(|(from, to)| Mutation::Replace(from, to)),
    ]
}

/// The fields of every row.
type Fields = Vec<Vec<Vec<u8>>>;

fn apply(bytes: &mut Vec<u8>, mutation: &Mutation) {
    if bytes.is_empty() {
        return;
    }
    let in_rows = |bytes: &mut Vec<u8>, edit: &dyn Fn(&mut Fields)| {
        let mut rows: Fields = bytes
            .split(|&b| b == b'\n')
            .map(|row| row.split(|&b| b == b',').map(<[u8]>::to_vec).collect())
            .collect();
        edit(&mut rows);
        let rows: Vec<Vec<u8>> = rows.iter().map(|row| row.join(&b","[..])).collect();
        *bytes = rows.join(&b"\n"[..]);
    };
    match mutation {
        Mutation::Cut(at) => bytes.truncate(at.index(bytes.len())),
        Mutation::Byte(at, byte) => {
            let at = at.index(bytes.len());
            bytes[at] = *byte;
        }
        Mutation::Insert(at, inserted) => {
            let at = at.index(bytes.len());
            bytes.splice(at..at, inserted.iter().copied());
        }
        Mutation::Remove(at, length) => {
            let at = at.index(bytes.len());
            bytes.drain(at..(at + length).min(bytes.len()));
        }
        Mutation::SwapColumns(a, b) => in_rows(bytes, &|rows| {
            for row in rows {
                let (a, b) = (a.index(7), b.index(7));
                if a.max(b) < row.len() {
                    row.swap(a, b);
                }
            }
        }),
        Mutation::RepeatRow(at) => in_rows(bytes, &|rows| {
            let at = at.index(rows.len());
            let row = rows[at].clone();
            rows.insert(at, row);
        }),
        Mutation::MoveRow(from, to) => in_rows(bytes, &|rows| {
            let row = rows.remove(from.index(rows.len()));
            let to = to.index(rows.len() + 1);
            rows.insert(to, row);
        }),
        Mutation::Field(row, column, text) => in_rows(bytes, &|rows| {
            let row = row.index(rows.len());
            let column = column.index(rows[row].len());
            rows[row][column] = text.as_bytes().to_vec();
        }),
        Mutation::Replace(from, to) => {
            *bytes = String::from_utf8_lossy(bytes).replace(from, to).into_bytes();
        }
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        read_with_all_layouts(&bytes);
    }

    #[test]
    fn random_text_never_panics(text in "[0-9eE+.,; \t\r\n\"a-f_-]{0,400}") {
        read_with_all_layouts(text.as_bytes());
    }

    #[test]
    fn damaged_logs_never_panic(
        header in any::<bool>(),
        rows in 0..60_usize,
        mutations in prop::collection::vec(mutation(), 1..6),
    ) {
        let mut bytes = valid(header, rows);
        for mutation in &mutations {
            apply(&mut bytes, mutation);
        }
        read_with_all_layouts(&bytes);
    }

    #[test]
    fn damaged_layouts_never_panic(at in any::<Index>(), byte in any::<u8>(), cut in any::<Index>()) {
        let mut bytes = include_bytes!("../layouts/ur10e_innopolis.toml").to_vec();
        let place = at.index(bytes.len());
        bytes[place] = byte;
        bytes.truncate(cut.index(2 * bytes.len()));
        if let Ok(layout) = Layout::from_toml(&String::from_utf8_lossy(&bytes), "fuzz.csv") {
            let row = "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19\n".repeat(3);
            let _ = read_log_from(row.as_bytes(), "fuzz.csv", &layout, 6);
        }
    }
}

#[test]
fn the_valid_log_is_read_in_full() {
    let log = read_log_from(&valid(true, 60)[..], "fuzz.csv", &Layout::default(), JOINTS).unwrap();
    assert_eq!((log.rows.read, log.rows.used), (60, 60));
}
