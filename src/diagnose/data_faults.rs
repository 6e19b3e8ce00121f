//! Faults of the record itself, looked for before any physics: what they do to a log would otherwise be
//! explained by a wrong law of friction.
//!
//! All tests are on the raw channels. Angle and velocity say the same twice, which shows a velocity that
//! lags and a clock that stood still while the time stamps went on:
//!
//! - lag d of q̇: q̇ − Δq/Δt = −d q̈ in least squares;
//! - time lost between two rows: l = Σ_j q̇_j (Δq_j − q̇_j Δt)/Σ_j q̇_j².

use std::collections::BTreeMap;

use super::kind::Kind;
use super::verdict::{Cause, Estimate};
use crate::identify::Measurement;
use crate::robot::JointSignals;

/// Deviations of this many robust standard deviations are no noise: in 10⁶ Gaussian values one in 10⁵
/// logs has such a value.
const FAR: f64 = 8.0;
/// A lag that a reader of a log need not care about, in samples.
const SMALL_LAG_SAMPLES: f64 = 0.01;
/// A step of this part of the rms change from sample to sample adds a tenth to the variance of the noise:
/// white noise changes by √2 σ, a step s adds s²/12.
const COARSE: f64 = 0.77;
/// A step as large as the rms change between samples leaves errors that repeat with the motion, as physics
/// does.
const TOO_COARSE: f64 = 1.0;
/// Blocks for the scatter of the lag.
const BLOCKS: usize = 20;
/// Student's t₁₉ for a chance of 10⁻⁵ in two tails, six joints.
const LAG_T: f64 = 6.5;

/// All faults of the record of `m`.
pub fn find(m: &Measurement) -> Vec<Cause> {
    let mut out = velocity_lag(m);
    out.extend(clock_fault(m));
    out.extend(repeated_or_missing(m));
    out.extend(outliers(m));
    out.extend(quantisation(m));
    out
}

fn cause(
    kind: Kind,
    joint: Option<usize>,
    in_words: &str,
    strength: f64,
    parameters: &[(&'static str, Estimate)],
) -> Cause {
    Cause {
        kind,
        joint: joint.map(|j| j + 1),
        class: Vec::new(),
        confidence: 1.0,
        parameters: parameters.iter().cloned().collect::<BTreeMap<_, _>>(),
        gain_fraction: None,
        separating_experiment: None,
        strength,
        in_words: in_words.to_owned(),
        rivals: Vec::new(),
    }
}

fn exact(value: f64, unit: &'static str) -> Estimate {
    Estimate { value, unit, ci95: [value, value] }
}

/// A velocity channel that lags behind the angle, per joint or of all joints alike.
fn velocity_lag(m: &Measurement) -> Vec<Cause> {
    let step_s = median_step(m.time_s);
    let lags: Vec<Option<(f64, f64)>> = (0..m.q_rad.joints()).map(|j| lag(m, j)).collect();
    let is_late = |&(lag, sigma): &(f64, f64)| {
        lag.abs() > SMALL_LAG_SAMPLES * step_s && lag.abs() > LAG_T * sigma
    };
    let words = "a velocity that lags behind the angle";
    let estimate = |lag: f64, sigma: f64| {
        let reach = 2.09 * sigma;
        [("delay_s", Estimate { value: lag, unit: "s", ci95: [lag - reach, lag + reach] })]
    };
    let late: Vec<(f64, f64)> = lags.iter().flatten().copied().filter(is_late).collect();
    if late.len() == lags.len() && late.len() > 1 {
        let weight: f64 = late.iter().map(|(_, s)| s.powi(-2)).sum();
        let mean = late.iter().map(|(d, s)| d / (s * s)).sum::<f64>() / weight;
        let alike = late.iter().all(|(d, s)| (d - mean).abs() < 5.0 * s + 0.1 * mean.abs());
        if alike {
            let sigma = weight.powf(-0.5);
            return vec![cause(
                Kind::VelocityLag,
                None,
                words,
                mean.abs() / sigma,
                &estimate(mean, sigma),
            )];
        }
    }
    lags.iter()
        .enumerate()
        .filter_map(|(j, lag)| {
            let (lag, sigma) = lag.filter(is_late)?;
            Some(cause(Kind::VelocityLag, Some(j), words, lag.abs() / sigma, &estimate(lag, sigma)))
        })
        .collect()
}

/// The velocities of `m` without the lags found in it, by straight interpolation between samples.
pub fn without_lag(m: &Measurement, faults: &[Cause]) -> JointSignals {
    let mut out = m.qd_rad_s.clone();
    for fault in faults.iter().filter(|f| f.kind == Kind::VelocityLag) {
        let lag = fault.parameters["delay_s"].value;
        let joints = fault.joint.map_or(0..out.joints(), |j| j - 1..j);
        for j in joints {
            let (t, qd) = (m.time_s, m.qd_rad_s.joint(j));
            for (value, now) in out.joint_mut(j).iter_mut().zip(t) {
                let at = now + lag;
                let right = t.partition_point(|s| *s < at).clamp(1, t.len() - 1);
                let u = ((at - t[right - 1]) / (t[right] - t[right - 1])).clamp(0.0, 1.0);
                *value = qd[right - 1] * (1.0 - u) + qd[right] * u;
            }
        }
    }
    out
}

/// Lag of joint `j`'s velocity and its σ from the scatter between blocks, s.
fn lag(m: &Measurement, j: usize) -> Option<(f64, f64)> {
    let (t, q, qd) = (m.time_s, m.q_rad.joint(j), m.qd_rad_s.joint(j));
    let n = t.len();
    // Two samples to each side: the difference is the mean velocity over four steps, and so is what it
    // is compared with, so that the curvature of the motion drops out.
    let terms: Vec<(f64, f64)> = (2..n.saturating_sub(2))
        .map(|k| {
            let span = t[k + 2] - t[k - 2];
            let mean: f64 =
                (k - 2..k + 2).map(|i| 0.5 * (qd[i] + qd[i + 1]) * (t[i + 1] - t[i])).sum::<f64>()
                    / span;
            let slope = (q[k + 2] - q[k - 2]) / span;
            let acceleration = (qd[k + 2] - qd[k - 2]) / span;
            (-(mean - slope) * acceleration, acceleration * acceleration)
        })
        .collect();
    let sum = |part: &[(f64, f64)]| part.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let (product, square) = sum(&terms);
    if square.is_nan() || square <= 0.0 || terms.len() < 10 * BLOCKS {
        return None;
    }
    let lag = product / square;
    let scatter: f64 = terms
        .chunks(terms.len().div_ceil(BLOCKS))
        .map(|block| {
            let (product, square) = sum(block);
            (product - lag * square).powi(2)
        })
        .sum();
    let variance = scatter * BLOCKS as f64 / (BLOCKS - 1) as f64 / square.powi(2);
    Some((lag, variance.sqrt()))
}

/// Rows between which more time passed than the time stamps say.
fn clock_fault(m: &Measurement) -> Option<Cause> {
    let joints = m.q_rad.joints();
    let lost: Vec<f64> = (0..m.time_s.len() - 1)
        .map(|k| {
            let dt = m.time_s[k + 1] - m.time_s[k];
            let (mut along, mut square) = (0.0, 0.0);
            for j in 0..joints {
                let (q, qd) = (m.q_rad.joint(j), m.qd_rad_s.joint(j));
                let mean = 0.5 * (qd[k] + qd[k + 1]);
                along += mean * (q[k + 1] - q[k] - mean * dt);
                square += mean * mean;
            }
            // Slower than this, the quantum of the angle is all that is seen.
            if square > 1e-2 { along / square } else { 0.0 }
        })
        .collect();
    let sigma = robust_sigma(&lost);
    let step_s = median_step(m.time_s);
    let limit = (FAR * sigma).max(0.5 * step_s);
    let at: Vec<usize> = (0..lost.len()).filter(|&k| lost[k] > limit).collect();
    if at.len() < 3 {
        return None;
    }
    let lost_s = at.iter().map(|&k| lost[k]).sum::<f64>() / at.len() as f64;
    let mut between: Vec<f64> = at.windows(2).map(|w| (w[1] - w[0]) as f64).collect();
    let every = median(&mut between);
    let reach = 1.96 * sigma / (at.len() as f64).sqrt();
    let lost = Estimate { value: lost_s, unit: "s", ci95: [lost_s - reach, lost_s + reach] };
    Some(cause(
        Kind::ClockFault,
        None,
        "time that passed without the time stamps showing it",
        lost_s / sigma.max(f64::MIN_POSITIVE),
        &[("lost_s", lost), ("every_rows", exact(every, "rows"))],
    ))
}

/// Rows that repeat the row before in every channel, or are missing by the time stamps.
fn repeated_or_missing(m: &Measurement) -> Option<Cause> {
    let rows = m.time_s.len();
    let step_s = median_step(m.time_s);
    let missing: f64 =
        m.time_s.windows(2).map(|t| ((t[1] - t[0]) / step_s - 1.0).round().max(0.0)).sum();
    let channels = [m.q_rad, m.qd_rad_s, m.torque_nm];
    let moves = |k: usize| (0..m.q_rad.joints()).any(|j| m.qd_rad_s.joint(j)[k].abs() > 0.01);
    let repeats = (1..rows).filter(|&k| {
        let same = |s: &JointSignals| (0..s.joints()).all(|j| s.joint(j)[k] == s.joint(j)[k - 1]);
        moves(k) && channels.iter().all(|s| same(s))
    });
    let fraction = (missing + repeats.count() as f64) / rows as f64;
    // Single missed samples of an ordinary recorder are no cause of anything.
    (fraction > 2e-3).then(|| {
        let words = "samples that are missing or repeat the one before";
        let parameters = [("fraction", exact(fraction, ""))];
        cause(Kind::DroppedSamples, None, words, f64::INFINITY, &parameters)
    })
}

/// Joints with single torque values far off.
fn outliers(m: &Measurement) -> Vec<Cause> {
    (0..m.torque_nm.joints())
        .filter_map(|j| {
            let count = far_off(m.torque_nm.joint(j)).len();
            (count >= 3).then(|| {
                let parameters =
                    [("fraction", exact(count as f64 / m.torque_nm.samples() as f64, ""))];
                let words = "single values of torque that are far off";
                cause(Kind::Outliers, Some(j), words, FAR, &parameters)
            })
        })
        .collect()
}

/// Samples far off the median of five, which follows a step, and that median.
fn far_off(y: &[f64]) -> Vec<(usize, f64)> {
    let steps: Vec<f64> = y.windows(2).map(|w| w[1] - w[0]).collect();
    let limit = FAR * robust_sigma(&steps);
    y.windows(5)
        .enumerate()
        .map(|(k, window)| (k + 2, median(&mut window.to_vec())))
        .filter(|&(k, middle)| (y[k] - middle).abs() > limit)
        .collect()
}

/// The torques of `m` with the outliers named in `faults` replaced by what is beside them.
pub fn without_outliers(m: &Measurement, faults: &[Cause]) -> JointSignals {
    let mut out = m.torque_nm.clone();
    for j in faults.iter().filter(|f| f.kind == Kind::Outliers).filter_map(|f| f.joint) {
        for (k, middle) in far_off(m.torque_nm.joint(j - 1)) {
            out.joint_mut(j - 1)[k] = middle;
        }
    }
    out
}

/// Joints (0-based) whose torque is too coarse to say more than that.
pub fn coarse_joints(faults: &[Cause]) -> Vec<usize> {
    let coarse = |f: &&Cause| f.kind == Kind::Quantisation && f.strength > TOO_COARSE;
    faults.iter().filter(coarse).filter_map(|f| f.joint).map(|j| j - 1).collect()
}

/// Torques that are whole multiples of a step that is coarse against what changes between samples.
fn quantisation(m: &Measurement) -> Vec<Cause> {
    (0..m.torque_nm.joints())
        .filter_map(|j| {
            let y = m.torque_nm.joint(j);
            let mut values = y.to_vec();
            values.sort_by(f64::total_cmp);
            values.dedup();
            let gap = |w: &[f64]| w[1] - w[0];
            let step = values.windows(2).map(gap).filter(|g| *g > 0.0).fold(f64::NAN, f64::min);
            let scale = values.last()?.abs().max(values.first()?.abs());
            // Rounding of a decimal fraction may stand in the last digits of every value.
            let off_grid = |v: &f64| {
                let steps = (v - values[0]) / step;
                (steps - steps.round()).abs() * step > 1e-9 * scale
            };
            if values.len() < 3 || step.is_nan() || values.iter().any(off_grid) {
                return None;
            }
            let changes: Vec<f64> = y.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
            let rms = (changes.iter().map(|c| c * c).sum::<f64>() / changes.len() as f64).sqrt();
            (step > COARSE * rms).then(|| {
                let parameters = [("step", exact(step, "Nm"))];
                let words = "torque in coarse steps";
                cause(Kind::Quantisation, Some(j), words, step / rms, &parameters)
            })
        })
        .collect()
}

fn median_step(time_s: &[f64]) -> f64 {
    median(&mut time_s.windows(2).map(|t| t[1] - t[0]).collect::<Vec<f64>>())
}

fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Standard deviation of Gaussian values from the median of their sizes, 1/0.6745.
fn robust_sigma(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|v| v.abs()).filter(|v| *v > 0.0).collect();
    if sizes.is_empty() { 0.0 } else { 1.4826 * median(&mut sizes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 125.0;

    /// Two joints in a slow dance; the velocity channel is late by `lag_s`, and the clock loses 20 ms
    /// every `stall` rows.
    fn record(lag_s: f64, stall: Option<usize>) -> (Vec<f64>, [JointSignals; 3]) {
        let n = 4000;
        let time: Vec<f64> = (0..n).map(|k| k as f64 / RATE_HZ).collect();
        let true_time = |k: usize| time[k] + stall.map_or(0.0, |s| 0.02 * (k / s) as f64);
        let w = |j: usize| 1.1 + 0.7 * j as f64;
        let noise = |k: usize, j: usize| ((k * 7919 + j * 104_729) % 1009) as f64 / 1009.0 - 0.5;
        let q =
            JointSignals::from_fn(2, n, |j, k| (w(j) * true_time(k)).sin() + 1e-5 * noise(k, j));
        let qd = JointSignals::from_fn(2, n, |j, k| {
            w(j) * (w(j) * (true_time(k) - lag_s)).cos() + 1e-3 * noise(k, j + 2)
        });
        let torque = JointSignals::from_fn(2, n, |j, k| 10.0 * q.joint(j)[k] + noise(k, j + 4));
        (time, [q, qd, torque])
    }

    fn found(lag_s: f64, stall: Option<usize>) -> Vec<Cause> {
        let (time_s, [q_rad, qd_rad_s, torque_nm]) = record(lag_s, stall);
        find(&Measurement {
            source: "test",
            time_s: &time_s,
            q_rad: &q_rad,
            qd_rad_s: &qd_rad_s,
            torque_nm: &torque_nm,
        })
    }

    #[test]
    fn a_good_record_has_no_fault() {
        assert_eq!(found(0.0, None), []);
    }

    #[test]
    fn coarse_torque_is_found_with_its_step_and_fine_torque_is_not() {
        let (time_s, [q_rad, qd_rad_s, torque_nm]) = record(0.0, None);
        let rounded = |step: f64| {
            let torque_nm =
                torque_nm.map_joints(|_, y| y.iter().map(|v| (v / step).round() * step).collect());
            find(&Measurement {
                source: "test",
                time_s: &time_s,
                q_rad: &q_rad,
                qd_rad_s: &qd_rad_s,
                torque_nm: &torque_nm,
            })
        };
        let coarse = rounded(0.8);
        assert_eq!(coarse.len(), 2, "both joints");
        for cause in coarse {
            assert_eq!(cause.kind, Kind::Quantisation);
            assert!((cause.parameters["step"].value - 0.8).abs() < 1e-9);
        }
        assert_eq!(rounded(0.01), []);
    }

    #[test]
    fn a_late_velocity_is_found_to_a_tenth_of_a_millisecond() {
        let faults = found(0.004, None);
        assert_eq!(faults.len(), 1);
        assert_eq!((faults[0].kind, faults[0].joint), (Kind::VelocityLag, None));
        assert!((faults[0].parameters["delay_s"].value - 0.004).abs() < 1e-4);
    }

    #[test]
    fn a_clock_that_stalls_is_found_with_its_rhythm() {
        let faults = found(0.0, Some(250));
        let clock = faults.iter().find(|c| c.kind == Kind::ClockFault).unwrap();
        assert!((clock.parameters["lost_s"].value - 0.02).abs() < 1e-3);
        assert_eq!(clock.parameters["every_rows"].value, 250.0);
    }
}
