//! Something touched the arm: torque that comes once and goes.
//!
//! A motion that repeats needs no model: at every phase the torque is compared with the median over the
//! periods, which one contact cannot move. A single run is compared with the extended model, in samples
//! far from the joint's own reversals, where friction is known best. Both behind a low-pass; a contact is
//! where the deviation passes [`FAR`] robust standard deviations, and lasts while it stays above
//! [`NEAR`].

use std::ops::Range;

use super::kind::Kind;
use super::verdict::{Cause, Estimate};
use crate::identify::Measurement;
use crate::robot::JointSignals;
use crate::signal::{Resampler, Scratch, SignalError, ZeroPhase, find_period, natural_rate_hz};

/// Deviations of this many robust σ belong to a contact. Between repetitions of a real arm without
/// contacts they stay below 6; Gaussian noise passes 6.5 once in 10¹⁰ samples.
const FAR: f64 = 6.5;
/// The same for a single run, whose deviations are mostly errors of the model.
const FAR_OF_MODEL: f64 = 12.0;
/// A contact lasts while the deviation is above this share of the threshold.
const NEAR: f64 = 0.5;
/// Low-passes on the deviations, Hz: a collision lasts a tenth of a second, a hand that leans on the arm a
/// few seconds, and is seen deepest in the noise where the low-pass is as long as it is.
const CUTOFFS_HZ: [f64; 4] = [10.0, 4.0, 1.6, 0.7];
const ORDER: usize = 2;
/// Parts closer than this are one contact, s.
const TOGETHER_S: f64 = 0.3;
/// Torque around a contact that is set aside with it, s.
const MARGIN_S: f64 = 0.2;
/// The median over fewer periods is moved by one contact.
const FEWEST_PERIODS: usize = 3;
/// Stretches of a period that are compared as wholes.
const STRETCHES: usize = 10;
/// Joints that differ by less than this share of their rms amplitude, in the median, move alike.
const SAME_MOTION: f64 = 0.02;
/// The same, at every instant of a stretch: more than a weak contact moves the arm, less than a run-in.
const NO_CONTACT: f64 = 2e-3;
/// σ over the median of |x| for Gaussian x.
const ROBUST: f64 = 1.4826;
/// Gaps up to this many steps are bridged.
const LONGEST_GAP_STEPS: f64 = 10.0;
/// A joint slower than this, rad/s, or so shortly before or behind, s, may be held by friction.
const SLOW_RAD_S: f64 = 0.05;
const REVERSAL_S: f64 = 0.25;

/// One contact.
#[derive(Debug, Clone, PartialEq)]
struct Touch {
    samples: Range<usize>,
    /// Low-pass behind which it was seen, Hz.
    cutoff_hz: f64,
    /// Largest deviation over the threshold of a contact.
    height: f64,
    /// Per joint: largest deviation and its σ, Nm; `None` where the joint did not feel it.
    peaks: Vec<Option<(f64, f64)>>,
}

/// Contacts in a log whose motion repeats, and the torque as it would be without them.
pub struct Repeated {
    /// One cause per contact.
    pub causes: Vec<Cause>,
    /// Torque with the median over the periods in place of the contacts, Nm.
    pub torque_nm: JointSignals,
}

/// Looks for contacts by comparing repetitions, not on the joints `left_out` (0-based); `None` if the
/// motion does not repeat often enough or nothing touched the arm.
pub fn between_periods(
    m: &Measurement,
    left_out: &[usize],
) -> Result<Option<Repeated>, SignalError> {
    let rate_hz = natural_rate_hz(m.time_s)?;
    let grid = Resampler::new(m.time_s, rate_hz, LONGEST_GAP_STEPS / rate_hz)?;
    let whole = 0..grid.samples();
    if grid.segments() != [whole] {
        return Ok(None);
    }
    let q_rad = grid.angles(m.q_rad, m.qd_rad_s)?;
    let Some(period) = find_period(&q_rad)? else { return Ok(None) };
    let refined = period.refined_samples;
    let window = with_disturbed_periods(&q_rad, refined, period.window);
    let periods = (window.len() as f64 / refined + 0.01) as usize;
    if periods < FEWEST_PERIODS {
        return Ok(None);
    }
    let torque = grid.straight(m.torque_nm)?;
    let (joints, n) = (torque.joints(), torque.samples());
    let mut found: Vec<Touch> = Vec::new();
    for cutoff_hz in CUTOFFS_HZ {
        let filter = ZeroPhase::new(cutoff_hz.min(0.2 * rate_hz), ORDER, rate_hz)?;
        let mut smooth = JointSignals::zeros(joints, n);
        let mut counts = vec![vec![false; n]; joints];
        let mut sigma = vec![0.0; joints];
        // Behind the low-pass the window's ends feel what lies outside it: a run-in, or nothing.
        let edge = ((rate_hz / cutoff_hz) as usize).min(window.len() / 2);
        let inner = window.start + edge..window.end - edge;
        for j in (0..joints).filter(|j| !left_out.contains(j)) {
            let mut values = torque.joint(j).to_vec();
            filter.filter_in_place(&mut values, &mut Scratch::default())?;
            for k in window.clone() {
                smooth.joint_mut(j)[k] = deviation(&values, k, refined, &window);
                counts[j][k] = inner.contains(&k);
            }
            // Far apart, so that a drift counts as scatter.
            let lag = ((periods / 2) as f64 * refined) as usize;
            let pairs =
                (window.start..window.end - lag).map(|k| (values[k + lag] - values[k]).abs());
            sigma[j] = ROBUST * median(&mut pairs.collect::<Vec<_>>()) / std::f64::consts::SQRT_2;
        }
        for touch in touches(&smooth, &counts, &sigma, rate_hz, cutoff_hz, FAR) {
            // What lasts for half a period is no contact: friction that drifts, or another motion.
            let is_short = (touch.samples.len() as f64) < 0.5 * refined;
            if is_short && found.iter().all(|known| !known.overlaps(&touch)) {
                found.push(touch);
            }
        }
    }
    let mut touches = found;
    touches.sort_by_key(|touch| touch.samples.start);
    if touches.is_empty() {
        return Ok(None);
    }
    let mut aside = vec![false; n];
    for touch in &touches {
        aside[touch.disturbed(rate_hz, n)].fill(true);
    }
    let time_s = grid.time_s();
    let mut torque_nm = m.torque_nm.clone();
    for j in 0..joints {
        for (value, &t) in torque_nm.joint_mut(j).iter_mut().zip(m.time_s) {
            let k = time_s.partition_point(|g| *g < t).min(n - 1);
            if aside[k] && window.contains(&k) {
                *value -= deviation(torque.joint(j), k, refined, &window);
            }
        }
    }
    let causes = touches.iter().map(|touch| touch.cause(&time_s)).collect();
    Ok(Some(Repeated { causes, torque_nm }))
}

/// Contacts beside a model along a single run.
#[derive(Default)]
pub struct BesideModel {
    /// One cause per contact.
    pub causes: Vec<Cause>,
    /// The samples that they disturb.
    pub samples: Vec<Range<usize>>,
}

/// Contacts in the residual `error_nm` of a model along a single run with joint velocities `qd_rad_s`,
/// sample by sample on the evenly spaced clock `time_s`.
pub fn beside_model(
    error_nm: &JointSignals,
    qd_rad_s: &JointSignals,
    time_s: &[f64],
) -> BesideModel {
    let n = time_s.len();
    if n < 2 {
        return BesideModel::default();
    }
    let rate_hz = (n - 1) as f64 / (time_s[n - 1] - time_s[0]);
    let reach = (REVERSAL_S * rate_hz) as usize;
    let counts: Vec<Vec<bool>> = (0..error_nm.joints())
        .map(|j| {
            let mut counts = vec![true; n];
            for k in (0..n).filter(|&k| qd_rad_s.joint(j)[k].abs() < SLOW_RAD_S) {
                counts[k.saturating_sub(reach)..(k + reach).min(n)].fill(false);
            }
            counts
        })
        .collect();
    let sigma: Vec<f64> = counts
        .iter()
        .enumerate()
        .map(|(j, counts)| {
            let values = error_nm.joint(j).iter().zip(counts);
            let mut sizes: Vec<f64> = values.filter(|(_, c)| **c).map(|(e, _)| e.abs()).collect();
            ROBUST * median(&mut sizes)
        })
        .collect();
    let touches = touches(error_nm, &counts, &sigma, rate_hz, CUTOFFS_HZ[0], FAR_OF_MODEL);
    BesideModel {
        causes: touches.iter().map(|touch| touch.cause(time_s)).collect(),
        samples: touches.iter().map(|touch| touch.disturbed(rate_hz, n)).collect(),
    }
}

/// `window`, longer by whole periods in which most of the motion repeats (a contact moves the arm for a
/// moment, and that period is then not among those that repeat throughout), and by stretches in which all of
/// it nearly does.
fn with_disturbed_periods(q_rad: &JointSignals, period: f64, window: Range<usize>) -> Range<usize> {
    let step = period.round() as usize;
    let amplitude = |q: &[f64]| {
        let mean = q.iter().sum::<f64>() / q.len() as f64;
        (q.iter().map(|q| (q - mean).powi(2)).sum::<f64>() / q.len() as f64).sqrt()
    };
    let amplitudes: Vec<f64> =
        (0..q_rad.joints()).map(|j| amplitude(q_rad.joint(j)) + 1e-6).collect();
    // Whether `length` samples from `from` on are like those from `to` on.
    let repeats = |from: usize, to: usize, length: usize| {
        amplitudes.iter().enumerate().all(|(j, amplitude)| {
            let q = q_rad.joint(j);
            let differences = (0..length).map(|k| (q[from + k] - q[to + k]).abs() / amplitude);
            let mut differences: Vec<f64> = differences.collect();
            let largest = differences.iter().copied().fold(0.0, f64::max);
            largest < NO_CONTACT || (length == step && median(&mut differences) < SAME_MOTION)
        })
    };
    let Range { mut start, mut end } = window.clone();
    let stretch = (step / STRETCHES).max(1);
    for length in [step, stretch] {
        while start >= length && repeats(start - length, start - length + step, length) {
            start -= length;
        }
        while end + length <= q_rad.samples() && end >= step && repeats(end, end - step, length) {
            end += length;
        }
        // A period most of which repeats may begin with the run-in, or end with the arm stopping.
        while start < window.start && !repeats(start, start + step, stretch) {
            start = (start + stretch).min(window.start);
        }
        while end > window.end && !repeats(end - stretch, end - stretch - step, stretch) {
            end = (end - stretch).max(window.end);
        }
    }
    start..end
}

/// y(k) minus the median of y at the same phase in all periods.
fn deviation(y: &[f64], k: usize, period: f64, window: &Range<usize>) -> f64 {
    let first = ((k - window.start) as f64 / period).floor();
    let phase = (k - window.start) as f64 - first * period;
    let mut same: Vec<f64> = (0..)
        .map(|p| window.start as f64 + phase + f64::from(p) * period)
        .take_while(|at| *at <= (window.end - 1) as f64)
        .map(|at| {
            let left = (at.floor() as usize).min(y.len() - 2);
            let u = at - left as f64;
            y[left] * (1.0 - u) + y[left + 1] * u
        })
        .collect();
    y[k] - median(&mut same)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { 0.0 } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

/// Where deviations are far, joints together.
fn touches(
    deviation_nm: &JointSignals,
    counts: &[Vec<bool>],
    sigma: &[f64],
    rate_hz: f64,
    cutoff_hz: f64,
    far: f64,
) -> Vec<Touch> {
    let (joints, n) = (deviation_nm.joints(), deviation_nm.samples());
    let gap = (TOGETHER_S * rate_hz) as usize;
    let mut out: Vec<Touch> = Vec::new();
    let score = |j: usize, k: usize| {
        let is_known = counts[j][k] && sigma[j] > 0.0;
        if is_known { deviation_nm.joint(j)[k].abs() / (far * sigma[j]) } else { 0.0 }
    };
    let mut k = 0;
    while k < n {
        if (0..joints).all(|j| score(j, k) < NEAR) {
            k += 1;
            continue;
        }
        let start = k;
        let mut last = k;
        while k < n && k - last <= gap {
            if (0..joints).any(|j| score(j, k) >= NEAR) {
                last = k;
            }
            k += 1;
        }
        let samples = start..last + 1;
        let peaks: Vec<Option<(f64, f64)>> = (0..joints)
            .map(|j| {
                let highest =
                    samples.clone().max_by(|&a, &b| score(j, a).total_cmp(&score(j, b)))?;
                let peak = (deviation_nm.joint(j)[highest], sigma[j]);
                (score(j, highest) >= 1.0).then_some(peak)
            })
            .collect();
        if peaks.iter().any(Option::is_some) {
            let scores = (0..joints).flat_map(|j| samples.clone().map(move |k| (j, k)));
            let height = scores.map(|(j, k)| score(j, k)).fold(1.0, f64::max);
            out.push(Touch { samples, cutoff_hz, height, peaks });
        }
    }
    out
}

impl Touch {
    fn overlaps(&self, other: &Self) -> bool {
        self.samples.start < other.samples.end && other.samples.start < self.samples.end
    }

    /// Its samples and those beside it, of `n` in all.
    fn disturbed(&self, rate_hz: f64, n: usize) -> Range<usize> {
        let margin = (MARGIN_S * rate_hz) as usize;
        self.samples.start.saturating_sub(margin)..(self.samples.end + margin).min(n)
    }

    fn cause(&self, time_s: &[f64]) -> Cause {
        let felt: Vec<(usize, f64, f64)> = self
            .peaks
            .iter()
            .enumerate()
            .filter_map(|(j, peak)| peak.map(|(nm, sigma)| (j + 1, nm, sigma)))
            .collect();
        let (_, peak_nm, sigma) =
            felt.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or_default();
        // A low-pass moves an edge by up to a quarter of its shortest period.
        let blur_s = 0.25 / self.cutoff_hz;
        let (first, last) = (time_s[self.samples.start], time_s[self.samples.end - 1]);
        // What rises and falls as sin² is above the share NEAR/height of its peak for 1 − f of its time only.
        let unseen = (NEAR / self.height).sqrt().asin() / std::f64::consts::FRAC_PI_2;
        let foot_s = 0.5 * (last - first) * unseen / (1.0 - unseen);
        let estimate = |value: f64, before_s: f64, behind_s: f64| Estimate {
            value,
            unit: "s",
            ci95: [value - before_s, value + behind_s],
        };
        // A bump as long as the low-pass loses up to a third of its height.
        let shrunk = if self.cutoff_hz < CUTOFFS_HZ[0] { 1.5 } else { 1.0 };
        let reach = (1.96 * sigma).copysign(peak_nm);
        let (near, far) = (peak_nm - reach, shrunk * (peak_nm + reach));
        let ci95 = [near.min(far), near.max(far)];
        let peak = Estimate { value: peak_nm, unit: "Nm", ci95 };
        let joints: Vec<String> =
            felt.iter().map(|(j, nm, _)| format!("joint {j} by {nm:+.1} Nm")).collect();
        Cause {
            kind: Kind::Contact,
            joint: if felt.len() == 1 { Some(felt[0].0) } else { None },
            class: Vec::new(),
            confidence: 1.0,
            parameters: [
                ("start_s", estimate(first, blur_s + foot_s, blur_s)),
                ("end_s", estimate(last, blur_s, blur_s + foot_s)),
                ("peak_nm", peak),
            ]
            .into(),
            gain_fraction: None,
            separating_experiment: None,
            strength: peak_nm.abs() / sigma.max(f64::MIN_POSITIVE),
            in_words: format!("something touched the arm: {}", joints.join(", ")),
            rivals: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four periods of 10 s at 100 Hz with noise of 0.5 Nm, and a push of 6 Nm on joint 1 in the third.
    fn log(push_nm: f64) -> (Vec<f64>, [JointSignals; 3]) {
        let n = 4000;
        let time_s: Vec<f64> = (0..n).map(|k| 0.01 * k as f64).collect();
        let omega = std::f64::consts::TAU / 10.0;
        let noise = |j: usize, k: usize| {
            let word = (k as u64 + 7919 * j as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((word ^ (word >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / 2f64.powi(24)
                - 0.5
        };
        let q = JointSignals::from_fn(2, n, |j, k| (omega * time_s[k] + j as f64).sin());
        let qd = JointSignals::from_fn(2, n, |j, k| omega * (omega * time_s[k] + j as f64).cos());
        let torque = JointSignals::from_fn(2, n, |j, k| {
            let t = time_s[k];
            let phase = ((t - 24.0) / 0.4).clamp(0.0, 1.0);
            let push =
                if j == 0 { push_nm * (std::f64::consts::PI * phase).sin().powi(2) } else { 0.0 };
            20.0 * (omega * t).cos() + 1.7 * noise(j, k) + push
        });
        (time_s, [q, qd, torque])
    }

    fn found(push_nm: f64) -> Option<Repeated> {
        let (time_s, [q_rad, qd_rad_s, torque_nm]) = log(push_nm);
        let m = Measurement {
            source: "test",
            time_s: &time_s,
            q_rad: &q_rad,
            qd_rad_s: &qd_rad_s,
            torque_nm: &torque_nm,
        };
        between_periods(&m, &[]).unwrap()
    }

    #[test]
    fn repetitions_without_a_contact_have_none() {
        assert!(found(0.0).is_none());
    }

    #[test]
    fn a_push_in_one_period_is_found_where_and_when_it_was() {
        let repeated = found(6.0).unwrap();
        assert_eq!(repeated.causes.len(), 1);
        let cause = &repeated.causes[0];
        assert_eq!(cause.joint, Some(1));
        // The push is above half its threshold inside 24.0 … 24.4 s, and peaks at 6 Nm.
        assert!((24.0..24.2).contains(&cause.parameters["start_s"].value));
        assert!((24.2..24.4).contains(&cause.parameters["end_s"].value));
        assert!((cause.parameters["peak_nm"].value - 6.0).abs() < 1.0);
        // What is left in its place is the torque of the other periods.
        let (_, [.., torque]) = log(0.0);
        let left = repeated.torque_nm.joint(0)[2420] - torque.joint(0)[2420];
        assert!(left.abs() < 2.0, "{left}");
    }
}
