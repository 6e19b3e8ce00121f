//! The longest run of a log in which the angles jump, as where another recording begins.

use super::measurement::Measurement;
use crate::robot::JointSignals;

/// The rows of the longest run between two jumps of the angles.
pub struct Untorn {
    time_s: Vec<f64>,
    q_rad: JointSignals,
    qd_rad_s: JointSignals,
    torque_nm: JointSignals,
    /// The row of the log with which this run begins.
    pub first_row: usize,
    /// Time of the log before this run, s.
    pub before_s: f64,
    /// What the user should know of the jumps.
    pub warning: String,
}

impl Untorn {
    /// The longest run of `m`, to which filters and slopes are confined as between gaps in time; `None` where nothing
    /// jumps.
    pub fn of(m: &Measurement) -> Option<Self> {
        let tears = m.tears();
        if tears.count() == 0 {
            return None;
        }
        let run = tears.longest_run();
        let (start_s, end_s) = (m.time_s[run.start], m.time_s[run.end - 1]);
        let jumps = match tears.count() {
            1 => "the position jumps once".to_owned(),
            count => format!("the position jumps {count} times"),
        };
        Some(Self {
            time_s: m.time_s[run.clone()].to_vec(),
            q_rad: m.q_rad.slice(run.clone()),
            qd_rad_s: m.qd_rad_s.slice(run.clone()),
            torque_nm: m.torque_nm.slice(run.clone()),
            first_row: run.start,
            before_s: start_s - m.time_s[0],
            warning: format!(
                "{jumps}, as where another recording begins: only the longest stretch without such a jump, {start_s:.2} s to {end_s:.2} s, \
                 is used (cut into files, the others count as logs beside it)"
            ),
        })
    }

    /// This run as a measurement from `source`.
    pub fn measurement<'a>(&'a self, source: &'a str) -> Measurement<'a> {
        let Self { time_s, q_rad, qd_rad_s, torque_nm, .. } = self;
        Measurement { source, time_s, q_rad, qd_rad_s, torque_nm }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 600 rows at 100 Hz; from row 250 on, a joint at rest is elsewhere.
    #[test]
    fn the_longest_run_is_what_is_used() {
        let time_s: Vec<f64> = (0..600).map(|k| 7.0 + 0.01 * f64::from(k)).collect();
        let signals =
            |jump: f64| JointSignals::from_fn(1, 600, |_, k| if k < 250 { 0.0 } else { jump });
        let [still, torn, torque_nm] = [0.0, 0.5, 3.0].map(signals);
        let of = |q_rad: &JointSignals| {
            let (qd_rad_s, torque_nm) = (&still, &torque_nm);
            let m = Measurement { source: "two", time_s: &time_s, q_rad, qd_rad_s, torque_nm };
            Untorn::of(&m)
        };
        assert!(of(&still).is_none());
        let run = of(&torn).unwrap();
        assert!(run.warning.contains("jumps once") && run.warning.contains("9.50 s to 12.99 s"));
        assert!((run.before_s - 2.5).abs() < 1e-12 && run.first_row == 250);
        let m = run.measurement("two");
        assert_eq!((m.time_s, m.torque_nm.joint(0)), (&time_s[250..], &[3.0; 350][..]));
    }
}
