//! A recorder that holds rows back and writes them in bursts: the results are those of an even clock, and a warning is
//! given.

use armid::diagnose::{Diagnosis, Kind};
use armid::identify::{Identification, Identifier, Measurement};
use armid::log::{Effort, Layout, Log, LogWarning, read_log, write_log};

use crate::simulated::{NOISE, Run, scenario};

/// The log of `run` with the stamps `time_s`, written to a file and read back.
fn read_back(run: &Run, time_s: &[f64]) -> Log {
    let [q_rad, qd_rad_s, torque_nm] =
        [&run.log.q_rad, &run.log.qd_rad_s, &run.log.torque_nm].map(Clone::clone);
    let effort = Effort::Torque(torque_nm);
    let log = Log::new("made", time_s.to_vec(), q_rad, qd_rad_s, effort).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    write_log(&path, &log).unwrap();
    read_log(&path, &Layout::default(), run.arm.dof()).unwrap()
}

fn answers(run: &Run, log: &Log) -> (Identification, Diagnosis) {
    let torque_nm = log.torque_nm(&run.arm).unwrap();
    let m = Measurement {
        source: "log.csv",
        time_s: &log.time_s,
        q_rad: &log.q_rad,
        qd_rad_s: &log.qd_rad_s,
        torque_nm: &torque_nm,
    };
    let mut identifier = Identifier::new(&run.model, &run.set, run.options.clone());
    let identified = identifier.identify(&m).unwrap();
    (identified, run.diagnoser().diagnose(&m, &[], None).unwrap().diagnosis)
}

fn named(diagnosis: &Diagnosis) -> Vec<(Kind, Option<usize>)> {
    diagnosis.causes.iter().map(|cause| (cause.kind, cause.joint)).collect()
}

/// Five bursts of 1 to 30 rows in four periods.
#[test]
fn rows_that_are_written_in_bursts_change_nothing() {
    let run = Run::new(scenario(("bursts", 361), ("ur5_identification", 4), NOISE, ""));
    let even_s = run.log.time_s.clone();
    let mut late_s = even_s.clone();
    let bursts = [(700, 4), (1500, 10), (2203, 30), (3100, 1), (4000, 17)];
    for (first, count) in bursts {
        let written_s = even_s[first + count];
        for t in &mut late_s[first..first + count] {
            *t += 0.98 * (written_s - *t);
        }
    }
    let [even, late] = [&even_s, &late_s].map(|time_s| read_back(&run, time_s));
    assert_eq!(even.rows.warnings, []);
    let [LogWarning::LateBursts { rows: 62, bursts: 5, .. }] = late.rows.warnings[..] else {
        panic!("{}", late.rows)
    };
    assert_eq!((late.rows.missed_samples, late.rows.used), (0, even.rows.used));
    for (late, even) in late.time_s.iter().zip(&even.time_s) {
        assert!((late - even).abs() < 1e-9, "{late} {even}");
    }

    let [(identified, diagnosis), (expected, without)] =
        [&late, &even].map(|log| answers(&run, log));
    // Stamps are corrected to 1 ns: this changes the estimates by far less than a ten thousandth of σ.
    let close = |a: f64, b: f64, sigma: f64| (a - b).abs() < 1e-4 * sigma;
    let sigma = expected.covariance.sigma();
    for (k, sigma) in sigma.iter().enumerate() {
        let [found, truth] = [&identified, &expected].map(|answer| answer.fit.theta[k]);
        assert!(close(found, truth, *sigma), "{}: {found} {truth}", run.set.name(k));
    }
    assert_eq!(named(&diagnosis), named(&without));
    assert_eq!(diagnosis.verdict, without.verdict, "{:?}", diagnosis.sentences);
    for (found, truth) in diagnosis.base_parameters.iter().zip(&without.base_parameters) {
        assert!(close(found.value, truth.value, truth.sigma), "{}", truth.name);
    }
}
