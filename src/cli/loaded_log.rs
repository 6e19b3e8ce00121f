//! A log as the commands read it: with its torque in Nm, mended, and told from other recordings.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use crate::diagnose::Mended;
use crate::identify::{Measurement, Misreading, Options, Regression};
use crate::log::{Layout, Log, LogWarning, read_log};
use crate::report::json::Input;
use crate::robot::{Arm, JointSignals};
use crate::signal::{empty_above_hz, natural_rate_hz};

/// A log with its torque in Nm.
pub struct LoadedLog {
    /// The log.
    pub log: Log,
    /// Drive torque at the joint, Nm.
    pub torque_nm: JointSignals,
    /// The file the log was read from.
    pub input: Input,
    /// Remarks on faults of the record.
    pub mended: Vec<String>,
}

impl LoadedLog {
    /// Reads a log and prints how many of its rows were used or set aside.
    pub fn read(
        file: &Path,
        arm: &Arm,
        layout: &Layout,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let mut log = read_log(file, layout, arm.dof())?;
        log.warn_of_assumed_gains(arm);
        let torque_nm = log.torque_nm(arm);
        let rate_hz = natural_rate_hz(&log.time_s).ok();
        if let (Ok(torque_nm), Some(rate_hz)) = (&torque_nm, rate_hz)
            && let Some(above_hz) = empty_above_hz(torque_nm, rate_hz)
        {
            log.rows.warnings.push(LogWarning::FilteredTorque { above_hz });
        }
        eprintln!("{}:\n{}", file.display(), log.rows);
        let input = Input { path: file.to_owned(), sha256: log.sha256.clone() };
        Ok(Self { log, torque_nm: torque_nm?, input, mended: Vec::new() })
    }

    /// The channels that identification needs.
    pub fn measurement(&self) -> Measurement<'_> {
        Measurement {
            source: &self.log.source,
            time_s: &self.log.time_s,
            q_rad: &self.log.q_rad,
            qd_rad_s: &self.log.qd_rad_s,
            torque_nm: &self.torque_nm,
        }
    }

    /// Corrects what can be corrected within its rows, and remarks on every other fault of the record. Logs that cannot be
    /// processed are left to the identification, which says why.
    pub fn mend(&mut self) {
        let Ok(Mended { time_s, channels, remarks }) = Mended::of(&self.measurement()) else {
            return;
        };
        self.log.time_s = time_s;
        [self.log.q_rad, self.log.qd_rad_s, self.torque_nm] = channels;
        let of_log = |remark| format!("{}: {remark}", self.log.source);
        self.mended = remarks.into_iter().map(of_log).collect();
    }

    /// How the log has to be read, if not as it was.
    pub fn misreading(
        &self,
        arm: &Arm,
        regression: &Regression,
        options: &Options,
    ) -> Option<Misreading> {
        let gain = self.log.drive_gain_nm_a(arm);
        Misreading::of(arm, regression, options, gain.as_deref())
    }

    /// What tells its recording from others.
    pub fn rows(&self) -> RowsOf<'_> {
        let channels = [&self.log.q_rad, &self.log.qd_rad_s, &self.torque_nm];
        let joints = channels.into_iter().flat_map(|y| (0..y.joints()).map(|j| y.joint(j)));
        let joints: Vec<&[f64]> = joints.collect();
        let row = |k: usize| {
            let mut hasher = DefaultHasher::new();
            joints.iter().for_each(|y| y[k].to_bits().hash(&mut hasher));
            hasher.finish()
        };
        let hashes: Vec<u64> = (0..self.log.time_s.len()).map(row).collect();
        RowsOf { log: self, known: hashes.iter().copied().collect(), hashes }
    }
}

/// Share of common rows above which two logs count as the same: at rest, and with rounded readings, some rows coincide
/// by chance.
const SAME: f64 = 0.5;

/// Hashes of the rows of a log.
pub struct RowsOf<'a> {
    /// The log.
    pub log: &'a LoadedLog,
    hashes: Vec<u64>,
    known: HashSet<u64>,
}

impl RowsOf<'_> {
    /// Whether these are rows of the same recording as those of `other`, or one is a part of the other.
    pub fn are_of(&self, other: &Self) -> bool {
        let common = self.hashes.iter().filter(|row| other.known.contains(row)).count();
        common as f64 > SAME * self.hashes.len().min(other.hashes.len()) as f64
    }
}

/// Reads logs and prints how many rows of each were used or set aside ([`LoadedLog::read`]).
pub fn read_logs(
    files: &[PathBuf],
    arm: &Arm,
    layout: &Layout,
) -> Result<Vec<LoadedLog>, Box<dyn std::error::Error>> {
    files.iter().map(|file| LoadedLog::read(file, arm, layout)).collect()
}
