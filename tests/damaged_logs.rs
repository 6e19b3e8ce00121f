//! Whatever damage a log has, identification and diagnosis must end in an answer or in a fitting message, never in a
//! panic, a non-finite number or an endless run.

use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use armid::diagnose::{DiagnoseError, Diagnoser, Diagnosis};
use armid::identify::covariance::CovarianceError;
use armid::identify::{FitError, Identification, Identifier, IdentifyError, Measurement, Options};
use armid::log::{Effort, Layout, Log, read_log_from, write_log};
use armid::plant::Measured;
use armid::signal::SignalError;

use crate::damage::{Sound, few_families};
use crate::other_arms::Designed;
use crate::simulated::Run;

/// How the processing of a log ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Answer,
    /// The reader refuses it.
    Unread,
    TooShort,
    NoMotion,
    NoTorque,
    /// The motion leaves parameters unidentified.
    Open,
    /// The rate is too low for the low-pass.
    TooSlow,
}

use End::{Answer, NoMotion, NoTorque, Open, TooShort, TooSlow, Unread};

/// Expected end for each damage: where the period is searched for, and where the log is treated as a single run. Rows
/// that contradict the rows before them are set aside, so that too little remains of columns that are exchanged. Where
/// angles and velocities are related by a wrong factor throughout, such as −1, the reader says so. Half of the log, and
/// the part on one side of a pause, has two periods, too few because their σ needs six seconds of data.
const ENDS: &[(&str, [End; 2])] = &[
    ("nothing", [Answer, Answer]),
    ("an angle for its velocity", [TooShort, TooShort]),
    ("an angle for an effort", [TooShort, TooShort]),
    ("the time for an angle", [TooShort, TooShort]),
    ("every row written twice", [Answer, Answer]),
    ("the last row first", [Unread, Unread]),
    ("semicolons", [Answer, Answer]),
    ("a time that is no number", [Answer, Answer]),
    ("an angle beyond all bounds", [Answer, Answer]),
    ("an effort beyond all bounds", [Answer, Answer]),
    ("an effort without end", [Answer, Answer]),
    ("a velocity left out", [Answer, Answer]),
    ("all is cut off", [Unread, Unread]),
    ("a byte is left", [Unread, Unread]),
    ("97 bytes are left", [Unread, Unread]),
    ("5000 bytes are left", [TooShort, TooShort]),
    ("half is left", [TooShort, Answer]),
    ("the last byte is cut off", [Answer, Answer]),
    ("an angle that stands still", [Open, Open]),
    ("a velocity that is zero", [Open, Open]),
    ("velocities that are zero", [Unread, Unread]),
    ("an arm that stands still", [NoMotion, NoMotion]),
    ("an effort that is another's", [Answer, Answer]),
    ("an effort that is zero", [NoTorque, NoTorque]),
    ("efforts without the arm", [Answer, Answer]),
    ("spikes of an effort", [Answer, Answer]),
    ("spikes of an angle", [Answer, Answer]),
    ("angles of the other sign", [Unread, Unread]),
    ("velocities of the other sign", [Unread, Unread]),
    ("time in nanoseconds", [Unread, Unread]),
    ("time since 1970", [Answer, Answer]),
    ("time that stands still", [Unread, Unread]),
    ("time with a pause", [TooShort, Answer]),
    ("time that is uneven", [Answer, Answer]),
    ("every second row lost", [Answer, Answer]),
    ("nine of ten rows lost", [Answer, TooSlow]),
    ("a recorder that hung", [TooShort, TooShort]),
];

/// Hundreds of times the duration of one case.
const LIMIT: Duration = Duration::from_secs(300);

/// 14 s of an arm that repeats a motion of 2.5 s, at 50 rows per second.
#[test]
fn every_damage_ends_in_an_answer_or_in_a_message_that_fits() {
    let designed = Designed::new("three_joints", 2.5, &[0.5, 0.4, 0.1]);
    let bench = Arc::new(designed.run(6, "[plant]\nlog_rate_hz = 50.0\n"));
    let text = written(bench.log.clone());
    let (header, rows) = text.split_at(text.find('\n').unwrap() + 1);
    let rows: Vec<&str> = rows.lines().take(700).collect();
    let damaged = Sound { header, rows, joints: bench.arm.dof() }.damaged();
    assert_eq!(damaged.len(), ENDS.len());
    let mut wrong = Vec::new();
    for ((name, text), (expected_of, expected)) in damaged.into_iter().zip(ENDS) {
        assert_eq!(name, *expected_of);
        let found = ends_in_time(&bench, name, text);
        if found != expected.map(|end| [end; 2]) {
            wrong.push(format!("{name}: {found:?} in place of {expected:?}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The log as the text of its file.
fn written(log: Measured) -> String {
    let Measured { time_s, q_rad, qd_rad_s, torque_nm, .. } = log;
    let log = Log::new("sound", time_s, q_rad, qd_rad_s, Effort::Torque(torque_nm)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sound.csv");
    write_log(&path, &log).unwrap();
    std::fs::read_to_string(path).unwrap()
}

/// Ends for a log that may repeat and for a single run, each identified and diagnosed.
fn ends_in_time(bench: &Arc<Run>, name: &str, text: String) -> [[End; 2]; 2] {
    let (sender, receiver) = mpsc::channel();
    let bench = Arc::clone(bench);
    thread::spawn(move || sender.send([None, Some(0.0)].map(|s| ends(&bench, &text, s))));
    // A thread that panics prints its message and sends nothing.
    receiver.recv_timeout(LIMIT).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn ends(bench: &Run, text: &str, period_s: Option<f64>) -> [End; 2] {
    let Run { arm, model, set, .. } = bench;
    let log = match read_log_from(text.as_bytes(), "log.csv", &Layout::default(), arm.dof()) {
        Ok(log) => log,
        Err(error) => {
            assert!(error.to_string().starts_with("log.csv: "), "{error}");
            return [Unread; 2];
        }
    };
    let torque_nm = log.torque_nm(arm).unwrap();
    let m = Measurement {
        source: &log.source,
        time_s: &log.time_s,
        q_rad: &log.q_rad,
        qd_rad_s: &log.qd_rad_s,
        torque_nm: &torque_nm,
    };
    let options = Options { repetition: period_s.into(), ..Options::default() };
    let identified = match Identifier::new(model, set, options.clone()).identify(&m) {
        Ok(identification) => {
            assert_numbers(&identification);
            Answer
        }
        Err(error) => end_of(&error).unwrap_or_else(|| panic!("{error}")),
    };
    let mut diagnoser = Diagnoser::with_families(arm, model, set, options, few_families());
    let diagnosed = match diagnoser.diagnose(&m, &[], None) {
        Ok(finding) => {
            assert_numbers_of(&finding.diagnosis);
            Answer
        }
        Err(DiagnoseError::NotExcited { .. }) => Open,
        Err(DiagnoseError::Identify(error)) => end_of(&error).unwrap_or_else(|| panic!("{error}")),
        Err(DiagnoseError::Signal(error)) => {
            end_of_signal(&error).unwrap_or_else(|| panic!("{error}"))
        }
        Err(error) => panic!("{error}"),
    };
    [identified, diagnosed]
}

fn end_of(error: &IdentifyError) -> Option<End> {
    match error {
        IdentifyError::TooShort { .. }
        | IdentifyError::Covariance { error: CovarianceError::TooShort { .. }, .. } => {
            Some(TooShort)
        }
        IdentifyError::NoMotion { .. } => Some(NoMotion),
        IdentifyError::Cutoff { .. } => Some(TooSlow),
        IdentifyError::DeadTorque { .. } => Some(NoTorque),
        IdentifyError::Fit(FitError::NotExcited { .. }) => Some(Open),
        IdentifyError::Signal(error) => end_of_signal(error),
        _ => None,
    }
}

fn end_of_signal(error: &SignalError) -> Option<End> {
    match error {
        SignalError::TooFewSamples { .. } => Some(TooShort),
        SignalError::Cutoff { .. } => Some(TooSlow),
        _ => None,
    }
}

fn assert_numbers(found: &Identification) {
    let Identification { fit, covariance, .. } = found;
    assert!(fit.theta.iter().all(|value| value.is_finite()), "{:?}", fit.theta);
    assert!(covariance.matrix.iter().all(|value| value.is_finite()), "{}", covariance.matrix);
    let rms_nm = found.residual().rms_nm;
    assert!(rms_nm.iter().all(|rms| rms.is_finite()), "{rms_nm:?}");
}

fn assert_numbers_of(diagnosis: &Diagnosis) {
    let is_probability = |value: &f64| (0.0..=1.0).contains(value);
    let rms_nm = diagnosis.before.rms_nm.iter().chain(&diagnosis.after.rms_nm);
    let base = diagnosis.base_parameters.iter().map(|parameter| &parameter.value);
    assert!(rms_nm.chain(base).all(|value| value.is_finite()), "{diagnosis:?}");
    let lack_of_fit = diagnosis.lack_of_fit_probability;
    assert!(lack_of_fit.iter().all(is_probability), "{lack_of_fit:?}");
    for left in diagnosis.unexplained.iter().chain(&diagnosis.form_error) {
        let mut numbers = left.curve.iter().flatten().chain([&left.rms_nm]);
        assert!(numbers.all(|value| value.is_finite()), "{left:?}");
    }
    for limit in &diagnosis.detection_limits {
        let mut numbers = limit.value.iter().chain(&limit.sqrt_lambda).chain(limit.given.values());
        assert!(numbers.all(|value| value.is_finite()), "{limit:?}");
        assert!(is_probability(&limit.power), "{limit:?}");
    }
    for cause in &diagnosis.causes {
        assert!(is_probability(&cause.confidence), "{cause:?}");
        // A fault of the record that is counted, not compared with noise, has an infinite strength.
        let most = if cause.kind.is_of_the_record() { f64::INFINITY } else { f64::MAX };
        assert!((0.0..=most).contains(&cause.strength), "{cause:?}");
        let estimates = cause.parameters.values();
        let mut numbers = estimates.flat_map(|e| [e.value, e.ci95[0], e.ci95[1]]);
        assert!(numbers.all(f64::is_finite), "{cause:?}");
    }
}
