//! Exports a motion to other programs: samples as CSV, and a URScript program that plays it.

use std::io::{self, Write};

use thiserror::Error;

use super::error::readable;
use super::reference::Reference;
use super::run_in::Excitation;

/// How a URScript program plays a motion.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Playback {
    /// Speed at which the script begins; whoever plays it may edit it there.
    pub speed: Speed,
    /// Largest joint speed while approaching the start pose, rad/s.
    pub approach_rad_s: f64,
}

/// Why no controller can play a motion.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlaybackError {
    /// A motion that hardly moves hardly ends, and a faster one leaves the limits of the design.
    #[error(
        "a speed of {} cannot be played: choose a share of the designed one, from {SLOWEST} to 1",
        readable(*speed)
    )]
    Speed {
        /// Share of the designed speed.
        speed: f64,
    },
    /// Arms of Universal Robots have six joints.
    #[error("a controller of Universal Robots moves {JOINTS} joints, the motion has {joints}")]
    Joints {
        /// Joints of the motion.
        joints: usize,
    },
}

/// Joints that `servoj` takes.
const JOINTS: usize = 6;
/// Time between two set points of a script, s: one cycle of a controller of the CB-Series, four of one of the e-Series.
/// The script evaluates the series itself, so that the rate of the data does not matter.
const CYCLE_S: f64 = 0.008;
/// Largest joint speed while approaching the start pose, rad/s.
const APPROACH_RAD_S: f64 = 0.3;
/// Slowest speed, as a share of the designed one: a motion of 80 s then takes two hours.
const SLOWEST: f64 = 0.01;

impl Playback {
    /// For a motion of `joints` joints, played at `speed`.
    ///
    /// # Errors
    /// [`PlaybackError::Joints`] for any other arm than those that a controller of Universal Robots moves.
    pub fn new(joints: usize, speed: Speed) -> Result<Self, PlaybackError> {
        if joints != JOINTS {
            return Err(PlaybackError::Joints { joints });
        }
        Ok(Self { speed, approach_rad_s: APPROACH_RAD_S })
    }
}

/// A speed at which a motion can be played, as a share of the designed one: from 0.01 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speed(f64);

impl Speed {
    /// The speed `share`, if it can be played.
    ///
    /// # Errors
    /// [`PlaybackError::Speed`] if it cannot.
    pub fn new(share: f64) -> Result<Self, PlaybackError> {
        let is_playable = (SLOWEST..=1.0).contains(&share);
        if is_playable { Ok(Self(share)) } else { Err(PlaybackError::Speed { speed: share }) }
    }

    /// The share of the designed speed.
    pub fn share(self) -> f64 {
        self.0
    }
}

/// A motion played more slowly: the same path, with all velocities times `speed` and all accelerations times its
/// square.
#[derive(Debug, Clone, Copy)]
pub struct Slowed<'a, M: Reference> {
    motion: &'a M,
    speed: f64,
}

impl<'a, M: Reference> Slowed<'a, M> {
    /// The `motion` at a `speed`.
    pub fn new(motion: &'a M, speed: Speed) -> Self {
        Self { motion, speed: speed.share() }
    }
}

impl<M: Reference> Reference for Slowed<'_, M> {
    fn joints(&self) -> usize {
        self.motion.joints()
    }

    fn duration_s(&self) -> f64 {
        self.motion.duration_s() / self.speed
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        self.motion.sample(self.speed * t_s, q_rad, qd_rad_s, qdd_rad_s2);
        qd_rad_s.iter_mut().for_each(|qd| *qd *= self.speed);
        qdd_rad_s2.iter_mut().for_each(|qdd| *qdd *= self.speed * self.speed);
    }
}

/// The columns of a motion's samples: `timestamp, target_q_0…, target_qd_0…, target_qdd_0…` (s, rad, rad/s, rad/s²).
pub(super) fn columns(joints: usize) -> Vec<String> {
    let of_joints = |name: &'static str| (0..joints).map(move |j| format!("{name}_{j}"));
    let motion = ["target_q", "target_qd", "target_qdd"].into_iter().flat_map(of_joints);
    std::iter::once("timestamp".to_owned()).chain(motion).collect()
}

/// Writes `motion` sampled at `rate_hz` with the header `timestamp, target_q_0…, target_qd_0…,
/// target_qdd_0…` (s, rad, rad/s, rad/s²). [`PlannedMotion`](super::PlannedMotion) reads it back.
pub fn write_csv(out: &mut dyn Write, motion: &impl Reference, rate_hz: f64) -> io::Result<()> {
    let n = motion.joints();
    writeln!(out, "{}", columns(n).join(","))?;
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let last = (motion.duration_s() * rate_hz).round() as usize;
    for k in 0..=last {
        let t_s = k as f64 / rate_hz;
        motion.sample(t_s, &mut q, &mut qd, &mut qdd);
        write!(out, "{t_s}")?;
        for value in q.iter().chain(&qd).chain(&qdd) {
            write!(out, ",{value}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// The script, with names in braces where the motion's values go.
const SCRIPT: &str = include_str!("excitation.script");

/// A URScript program that moves slowly to the start pose, waits for the operator, and plays
/// `motion` with `servoj`, evaluating the series (24) on the controller.
///
/// The script contains the closed-form integral of the joint speeds in run-in and run-out, so it needs no table and is
/// as long for one period as for a hundred.
pub fn urscript(motion: &Excitation, playback: &Playback) -> String {
    let series = motion.series();
    let (n, order) = (motion.joints(), series.order());
    let [begin_s, end_s] = motion.periodic_window_s();
    let (mut q, mut v, mut a) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    series.sample(0.0, &mut q, &mut v, &mut a);
    let column = |rows: &[Vec<f64>], l: usize| {
        list(&rows.iter().map(|row| row[l - 1]).collect::<Vec<f64>>())
    };
    let of_harmonics = |text: &dyn Fn(usize) -> String, between: &str| {
        (1..=order).map(text).collect::<Vec<String>>().join(between)
    };
    let coefficients = |l: usize| {
        let [a, b] = [&series.a_rad_s, &series.b_rad_s].map(|rows| column(rows, l));
        format!("  a{l} = {a}\n  b{l} = {b}")
    };
    let harmonic = |l: usize| {
        format!("      s{l} = sin({l}*x) / ({l}*omega)\n      c{l} = cos({l}*x) / ({l}*omega)")
    };
    let term = |l: usize| format!(" + a{l}[i]*s{l} - b{l}[i]*c{l}");
    let values = [
        ("{periods}", motion.periods().to_string()),
        ("{period}", series.period_s.to_string()),
        ("{speed}", playback.speed.share().to_string()),
        ("{cycle}", CYCLE_S.to_string()),
        ("{omega}", series.omega_rad_s().to_string()),
        ("{begin}", begin_s.to_string()),
        ("{finish}", end_s.to_string()),
        ("{total}", motion.duration_s().to_string()),
        ("{start_pose}", list(&motion.start_rad())),
        ("{offset}", list(&series.q0_rad)),
        ("{join_q}", list(&q)),
        ("{join_v}", list(&v)),
        ("{join_a}", list(&a)),
        ("{coefficients}", of_harmonics(&coefficients, "\n")),
        ("{approach}", playback.approach_rad_s.to_string()),
        ("{joints}", n.to_string()),
        ("{harmonics}", of_harmonics(&harmonic, "\n")),
        ("{terms}", of_harmonics(&term, "")),
    ];
    values.into_iter().fold(SCRIPT.to_owned(), |script, (name, value)| script.replace(name, &value))
}

fn list(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|v| format!("{v}")).collect();
    format!("[{}]", words.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::FourierSeries;

    fn motion() -> Excitation {
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        Excitation::new(series, 1.5, 2).unwrap().with_run_out(1.0).unwrap()
    }

    #[test]
    fn the_csv_holds_the_motion_to_the_last_bit() {
        let motion = motion();
        let mut text = Vec::new();
        write_csv(&mut text, &motion, 125.0).unwrap();
        let text = String::from_utf8(text).unwrap();
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows.len(), 2 + (motion.duration_s() * 125.0).round() as usize);
        assert!(rows[0].starts_with("timestamp,target_q_0,") && rows[0].ends_with("target_qdd_5"));
        let row: Vec<f64> = rows[501].split(',').map(|w| w.parse().unwrap()).collect();
        let [mut q, mut qd, mut qdd] = [[0.0; 6]; 3];
        motion.sample(500.0 / 125.0, &mut q, &mut qd, &mut qdd);
        assert_eq!(row[0], 4.0);
        assert_eq!(row[1..], [q, qd, qdd].concat());
    }

    /// A motion at the speed s is the designed one at the times s t, and its velocity is the derivative of its angle. A
    /// central difference over ± h is off by at most h²/6 times the largest third derivative, which is s³ Σ_l (l ω)²
    /// (|a_l| + |b_l|), and by rounding: times of up to 100 s are known to 1.4e-14 s, which at less than 3 rad/s moves
    /// the two angles by less than 1e-13 rad together.
    #[test]
    fn a_slowed_motion_takes_the_same_path() {
        let motion = motion();
        let (s, h) = (0.25, 1e-3);
        let slowed = Slowed::new(&motion, Speed::new(s).unwrap());
        assert_eq!(slowed.duration_s(), motion.duration_s() / s);
        let at = |motion: &dyn Reference, t_s: f64| {
            let [mut q, mut qd, mut qdd] = [[0.0; 6]; 3];
            motion.sample(t_s, &mut q, &mut qd, &mut qdd);
            [q, qd, qdd]
        };
        let series = motion.series();
        let third = |j: usize| -> f64 {
            let pairs = (1..).zip(series.a_rad_s[j].iter().zip(&series.b_rad_s[j]));
            let of = |(l, (a, b)): (i32, (&f64, &f64))| {
                (f64::from(l) * series.omega_rad_s()).powi(2) * (a.abs() + b.abs())
            };
            s.powi(3) * pairs.map(of).sum::<f64>()
        };
        let [begin_s, end_s] = motion.periodic_window_s();
        for k in 1..100 {
            let t_s = (begin_s + (end_s - begin_s) * f64::from(k) / 100.0) / s;
            let [q, qd, qdd] = at(&slowed, t_s);
            let designed = at(&motion, s * t_s);
            assert_eq!(q, designed[0]);
            assert_eq!(qd, designed[1].map(|qd| s * qd));
            assert_eq!(qdd, designed[2].map(|qdd| s * s * qdd));
            let [before, after] = [t_s - h, t_s + h].map(|t_s| at(&slowed, t_s)[0]);
            for j in 0..6 {
                let off = (after[j] - before[j]) / (2.0 * h) - qd[j];
                let tolerance = h * h / 6.0 * third(j) + 1e-13 / (2.0 * h);
                assert!(off.abs() < tolerance, "joint {j} at {t_s} s: {off:e}, {tolerance:e}");
            }
        }
    }

    #[test]
    fn only_what_a_controller_can_play_is_a_playback() {
        for speed in [0.0, -0.5, 0.009, 1.01, f64::NAN] {
            assert!(matches!(Speed::new(speed), Err(PlaybackError::Speed { .. })));
        }
        let full = Speed::new(1.0).unwrap();
        assert!(Playback::new(6, full).is_ok());
        assert_eq!(Playback::new(7, full), Err(PlaybackError::Joints { joints: 7 }));
    }

    fn script() -> String {
        urscript(&motion(), &Playback::new(6, Speed::new(0.25).unwrap()).unwrap())
    }

    #[test]
    fn the_script_is_complete() {
        let script = script();
        assert!(!script.contains(['{', '}']), "{script}");
        let series = motion().series().clone();
        let order = series.order();
        let last: Vec<f64> = series.b_rad_s.iter().map(|row| row[order - 1]).collect();
        assert!(script.contains(&format!("\n  b{order} = {}\n", list(&last))));
        assert!(script.contains(&format!(" + a{order}[i]*s{order} - b{order}[i]*c{order}\n")));
    }

    /// Whoever edits the speed must not make the motion faster than it was designed, nor run it backwards for ever.
    #[test]
    fn a_speed_that_was_edited_is_checked_before_the_arm_moves() {
        let script = script();
        let guard = script.find("  if speed <= 0 or speed > 1:\n    popup(").unwrap();
        let halt = script.find("    halt\n  end\n").unwrap();
        assert!(script.find("speed = 0.25\n").unwrap() < guard);
        assert!(guard < halt && halt < script.find("movej(").unwrap());
    }

    #[test]
    fn the_script_is_balanced_and_starts_gently() {
        let script = script();
        let opened = script
            .lines()
            .filter(|l| {
                let l = l.trim_start();
                l.starts_with("def ") || l.starts_with("if ") || l.starts_with("while ")
            })
            .count();
        assert_eq!(opened, script.lines().filter(|l| l.trim() == "end").count());
        let places = ["popup(", "movej(start_pose, a = 0.3, v = 0.3)", "popup(", "servoj("];
        let find = |from: usize, text: &str| Some(from + script[from..].find(text)? + text.len());
        assert!(places.into_iter().try_fold(0, find).is_some(), "each is behind the one before");
        assert!(script.contains("speed = 0.25\n"));
    }
}
