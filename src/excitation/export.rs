//! Exports a motion to other programs: samples as CSV, and a URScript program that plays it.

use std::fmt::Write as _;
use std::io::{self, Write};

use thiserror::Error;

use super::reference::Reference;
use super::run_in::Excitation;

/// How a URScript program plays a motion.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Playback {
    /// Cycle of the controller, s: 0.008 for the CB series, 0.002 for the e-Series.
    pub cycle_s: f64,
    /// Speed as a fraction of the designed one, in (0, 1]. The path is the same, only slower.
    pub speed: f64,
    /// Largest joint speed while approaching the start pose, rad/s.
    pub approach_rad_s: f64,
}

/// Why no controller can play a motion.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlaybackError {
    /// `servoj` lasts a whole number of controller cycles; any other rate would play another motion.
    #[error(
        "{rate_hz} set points per second are no whole number of a controller's cycles apart, which last 2 ms (e-Series) \
         or 8 ms (CB-Series): choose 500 over a whole number, such as 125, 250 or 500"
    )]
    Rate {
        /// Set points per second, Hz.
        rate_hz: f64,
    },
    /// A motion that hardly moves hardly ends, and a faster one leaves the limits of the design.
    #[error(
        "a speed of {speed} cannot be played: choose a share of the designed one, from {SLOWEST} to 1"
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
/// Cycles per second of a controller of the e-Series, Hz.
const E_SERIES_HZ: f64 = 500.0;
/// Cycles per second of a controller of the CB-Series, Hz.
const CB_SERIES_HZ: f64 = 125.0;

impl Playback {
    /// For a motion of `joints` joints with `rate_hz` set points per second, played at `speed` in (0, 1].
    ///
    /// # Errors
    /// What no controller can play; see [`PlaybackError`].
    pub fn new(joints: usize, rate_hz: f64, speed: f64) -> Result<Self, PlaybackError> {
        if joints != JOINTS {
            return Err(PlaybackError::Joints { joints });
        }
        if !is_whole(E_SERIES_HZ / rate_hz) {
            return Err(PlaybackError::Rate { rate_hz });
        }
        let speed = checked_speed(speed)?;
        // 166.667 means 500/3.
        let cycle_s = (E_SERIES_HZ / rate_hz).round() / E_SERIES_HZ;
        Ok(Self { cycle_s, speed, approach_rad_s: 0.3 })
    }

    /// Whether a controller of the CB-Series can play it as well as one of the e-Series.
    pub fn suits_cb_series(&self) -> bool {
        is_whole(self.cycle_s * CB_SERIES_HZ)
    }
}

/// Whether `cycles` is a whole number ≥ 1, to within the accuracy of a rate written with six digits.
fn is_whole(cycles: f64) -> bool {
    cycles.round() >= 1.0 && (cycles - cycles.round()).abs() < 1e-5 * cycles
}

/// A motion played more slowly: the same path, with all velocities times `speed` and all accelerations times its square.
#[derive(Debug, Clone, Copy)]
pub struct Slowed<'a, M: Reference> {
    motion: &'a M,
    speed: f64,
}

impl<'a, M: Reference> Slowed<'a, M> {
    /// The `motion` at a `speed` in (0, 1], as a fraction of its own.
    ///
    /// # Errors
    /// [`PlaybackError::Speed`] for any other speed.
    pub fn new(motion: &'a M, speed: f64) -> Result<Self, PlaybackError> {
        checked_speed(speed).map(|speed| Self { motion, speed })
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

/// Slowest speed, as a fraction of the designed one: a motion of 80 s then takes two hours.
pub const SLOWEST: f64 = 0.01;

/// Returns the speed if it can be played.
fn checked_speed(speed: f64) -> Result<f64, PlaybackError> {
    let is_share = (SLOWEST..=1.0).contains(&speed);
    if is_share { Ok(speed) } else { Err(PlaybackError::Speed { speed }) }
}

/// Writes `motion` sampled at `rate_hz` with the header `timestamp, target_q_0…, target_qd_0…,
/// target_qdd_0…` (s, rad, rad/s, rad/s²).
pub fn write_csv(out: &mut dyn Write, motion: &impl Reference, rate_hz: f64) -> io::Result<()> {
    let n = motion.joints();
    let mut header = String::from("timestamp");
    for name in ["target_q", "target_qd", "target_qdd"] {
        for j in 0..n {
            header.push_str(&format!(",{name}_{j}"));
        }
    }
    writeln!(out, "{header}")?;
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

/// A URScript program that moves slowly to the start pose, waits for the operator, and plays
/// `motion` with `servoj`, evaluating the series (24) on the controller.
///
/// The script contains the closed-form integral of the joint speeds in run-in and run-out, so it needs no table and is
/// as long for one period as for a hundred.
pub fn urscript(motion: &Excitation, playback: &Playback) -> String {
    let series = motion.series();
    let (n, order) = (motion.joints(), series.order());
    let [begin_s, end_s] = motion.periodic_window_s();
    let (mut v, mut a, mut q0) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    series.sample(0.0, &mut q0, &mut v, &mut a);
    let mut out = String::new();
    // Writing into a String cannot fail.
    let mut line = |text: String| {
        let _ = writeln!(out, "{text}");
    };
    line("def excitation():".into());
    line(format!(
        "  # {} periods of {} s, run-in {} s",
        motion.periods(),
        series.period_s,
        begin_s
    ));
    line("  # Check the cell, keep a hand on the emergency stop, and play it slowly first.".into());
    line(format!("  speed = {}", playback.speed));
    line(format!("  cycle = {}", playback.cycle_s));
    line(format!("  omega = {}", series.omega_rad_s()));
    line(format!("  begin = {begin_s}"));
    line(format!("  finish = {end_s}"));
    line(format!("  total = {}", motion.duration_s()));
    line(format!("  start_pose = {}", list(&motion.start_rad())));
    line(format!("  offset = {}", list(&series.q0_rad)));
    line(format!("  join_q = {}", list(&q0)));
    line(format!("  join_v = {}", list(&v)));
    line(format!("  join_a = {}", list(&a)));
    for l in 0..order {
        let column = |rows: &[Vec<f64>]| rows.iter().map(|row| row[l]).collect::<Vec<f64>>();
        line(format!("  a{} = {}", l + 1, list(&column(&series.a_rad_s))));
        line(format!("  b{} = {}", l + 1, list(&column(&series.b_rad_s))));
    }
    line("  q = start_pose".into());
    let approach = playback.approach_rad_s;
    line("  popup(\"The arm will move straight to the start pose, slowly. Is that way clear?\", \"Excitation\", blocking = True)".into());
    line(format!("  movej(start_pose, a = {approach}, v = {approach})"));
    line("  popup(\"At the start pose. Continue plays the excitation.\", \"Excitation\", blocking = True)".into());
    line("  t = 0.0".into());
    line("  while t < total:".into());
    line("    i = 0".into());
    line("    if t < begin or t > finish:".into());
    // The blend of `run_in.rs`; backwards in time the joint velocity changes its sign.
    line("      if t < begin:".into());
    line("        d = begin".into());
    line("        s = t / d".into());
    line("        sign = 1.0".into());
    line("      else:".into());
    line("        d = total - finish".into());
    line("        s = (total - t) / d".into());
    line("        sign = -1.0".into());
    line("      end".into());
    line("      of_v = d * (s*s*s - s*s*s*s/2 - 0.5)".into());
    line("      of_a = d * d * (s*s*s*s/4 - s*s*s/3 + 1.0/12)".into());
    line(format!("      while i < {n}:"));
    line("        q[i] = join_q[i] + sign * join_v[i] * of_v + join_a[i] * of_a".into());
    line("        i = i + 1".into());
    line("      end".into());
    line("    else:".into());
    line("      x = omega * (t - begin)".into());
    for l in 1..=order {
        line(format!("      s{l} = sin({l}*x) / ({l}*omega)"));
        line(format!("      c{l} = cos({l}*x) / ({l}*omega)"));
    }
    line(format!("      while i < {n}:"));
    let terms: String = (1..=order).map(|l| format!(" + a{l}[i]*s{l} - b{l}[i]*c{l}")).collect();
    line(format!("        q[i] = offset[i]{terms}"));
    line("        i = i + 1".into());
    line("      end".into());
    line("    end".into());
    line("    servoj(q, t = cycle, lookahead_time = 0.1, gain = 300)".into());
    line("    t = t + cycle * speed".into());
    line("  end".into());
    line("  stopj(1.0)".into());
    line("end".into());
    line("excitation()".into());
    out
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
    /// (|a_l| + |b_l|), and by rounding: times of up to 100 s are known to 1.4e-14 s, which at less than 3 rad/s moves the
    /// two angles by less than 1e-13 rad together.
    #[test]
    fn a_slowed_motion_takes_the_same_path() {
        let motion = motion();
        let (s, h) = (0.25, 1e-3);
        let slowed = Slowed::new(&motion, s).unwrap();
        assert_eq!(slowed.duration_s(), motion.duration_s() / s);
        assert!(matches!(Slowed::new(&motion, 0.0), Err(PlaybackError::Speed { .. })));
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

    /// Rates that divide the 500 Hz of an e-Series; the CB-Series needs those that divide 125 Hz.
    #[test]
    fn only_what_a_controller_can_play_is_a_playback() {
        for (rate_hz, cb_series) in
            [(500.0, false), (250.0, false), (125.0, true), (500.0 / 3.0, false), (62.5, true)]
        {
            let playback = Playback::new(6, rate_hz, 1.0).unwrap();
            assert_eq!(playback.suits_cb_series(), cb_series, "{rate_hz} Hz");
        }
        for rate_hz in [1000.0, 300.0, 333.0, 0.0, -125.0, f64::NAN] {
            let refused = Playback::new(6, rate_hz, 1.0).unwrap_err();
            assert!(matches!(refused, PlaybackError::Rate { .. }), "{rate_hz} Hz: {refused}");
        }
        for speed in [0.0, -0.5, 1.01, f64::NAN] {
            assert!(matches!(Playback::new(6, 125.0, speed), Err(PlaybackError::Speed { .. })));
        }
        let refused = Playback::new(7, 125.0, 1.0).unwrap_err();
        assert_eq!(refused, PlaybackError::Joints { joints: 7 });
    }

    #[test]
    fn the_script_is_balanced_and_starts_gently() {
        let playback = Playback::new(6, 125.0, 0.25).unwrap();
        let script = urscript(&motion(), &playback);
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
