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
    /// A program that stands still never ends, and a faster one leaves the limits of the design.
    #[error(
        "a speed of {speed} cannot be played: choose a share of the designed one, above 0 and at most 1"
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
        if !(speed > 0.0 && speed <= 1.0) {
            return Err(PlaybackError::Speed { speed });
        }
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
