//! Contacts in a single run: torque that deviates far from the extended model.
//!
//! Samples near a joint's own reversals do not count, because errors of the model's friction are largest there. A
//! contact is where the deviation exceeds [`FAR_OF_MODEL`] robust standard deviations; it lasts while the deviation
//! stays above the share [`NEAR`] of that.

use std::ops::Range;

use super::Touch;
use super::repeats::SHORTEST_S;
use crate::diagnose::verdict::{Cause, Estimate};
use crate::median::robust_sigma;
use crate::robot::JointSignals;
use crate::signal::{Scratch, SignalError, ZeroPhase};

/// Deviations of this many robust σ belong to a contact. The threshold is high because most deviations are errors of
/// the model.
const FAR_OF_MODEL: f64 = 12.0;
/// A contact lasts while the deviation is above this share of the threshold.
const NEAR: f64 = 0.5;
/// Parts closer than this are one contact, s.
const TOGETHER_S: f64 = 0.3;
/// A joint slower than `SLOW_RAD_S`, rad/s, or one that was so within `REVERSAL_S` before or after, s, may be held by
/// friction.
const SLOW_RAD_S: f64 = 0.05;
const REVERSAL_S: f64 = 0.25;

/// Contacts found beside a model in a single run.
#[derive(Default)]
pub struct BesideModel {
    /// One cause per contact.
    pub causes: Vec<Cause>,
    /// Samples that they disturb.
    pub samples: Vec<Range<usize>>,
}

/// Finds contacts in the residual `error_nm` of a model along a single run with joint velocities `qd_rad_s`, both
/// sampled on the evenly spaced clock `time_s` and filtered by `low_pass`.
pub fn beside_model(
    error_nm: &JointSignals,
    qd_rad_s: &JointSignals,
    time_s: &[f64],
    low_pass: &ZeroPhase,
) -> Result<BesideModel, SignalError> {
    let n = time_s.len();
    if n < 2 {
        return Ok(BesideModel::default());
    }
    let rate_hz = (n - 1) as f64 / (time_s[n - 1] - time_s[0]);
    let reach = (REVERSAL_S * rate_hz) as usize;
    let counts: Vec<Vec<bool>> = (0..error_nm.joints())
        .map(|j| {
            let mut counts = vec![true; n];
            for k in (0..n).filter(|&k| qd_rad_s.joint(j)[k].abs() < SLOW_RAD_S) {
                counts[k.saturating_sub(reach)..=(k + reach).min(n - 1)].fill(false);
            }
            counts
        })
        .collect();
    let sigma_nm: Vec<f64> = counts
        .iter()
        .enumerate()
        .map(|(j, counts)| {
            let values = error_nm.joint(j).iter().zip(counts);
            let mut sizes: Vec<f64> = values.filter(|(_, c)| **c).map(|(e, _)| e.abs()).collect();
            robust_sigma(&mut sizes)
        })
        .collect();
    let score = |j: usize, k: usize| {
        let is_known = counts[j][k] && sigma_nm[j] > 0.0;
        if is_known { error_nm.joint(j)[k].abs() / (FAR_OF_MODEL * sigma_nm[j]) } else { 0.0 }
    };
    let joints = 0..error_nm.joints();
    let highest = |k: usize| joints.clone().map(|j| score(j, k)).fold(0.0, f64::max);
    let gap = (TOGETHER_S * rate_hz) as usize;
    let touches: Vec<Touch> = stretches(n, gap, |k| highest(k) >= NEAR)
        .into_iter()
        .filter_map(|samples| {
            // For each joint that felt it: joint, sample of the largest score, that score.
            let felt: Vec<(usize, usize, f64)> = joints
                .clone()
                .filter_map(|j| {
                    let scores = samples.clone().map(|k| (j, k, score(j, k)));
                    scores.max_by(|a, b| a.2.total_cmp(&b.2)).filter(|(.., score)| *score >= 1.0)
                })
                .collect();
            touch(samples, &felt, error_nm, &sigma_nm, time_s, low_pass).transpose()
        })
        .collect::<Result<_, _>>()?;
    Ok(BesideModel {
        causes: touches.iter().map(Touch::cause).collect(),
        samples: touches.iter().map(|touch| touch.disturbed(rate_hz, n)).collect(),
    })
}

/// Stretches of `0..n` that begin and end with a sample that `is_far`, with fewer than `gap` other samples in a row in
/// between.
fn stretches(n: usize, gap: usize, is_far: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for k in (0..n).filter(|&k| is_far(k)) {
        match out.last_mut() {
            Some(last) if k - last.end < gap => last.end = k + 1,
            _ => out.push(k..k + 1),
        }
    }
    out
}

/// The contact that the joints `felt` (joint, sample of the largest score, that score) in `samples`.
fn touch(
    samples: Range<usize>,
    felt: &[(usize, usize, f64)],
    error_nm: &JointSignals,
    sigma_nm: &[f64],
    time_s: &[f64],
    low_pass: &ZeroPhase,
) -> Result<Option<Touch>, SignalError> {
    let height_nm = |&(j, k, _): &(usize, usize, f64)| error_nm.joint(j)[k];
    let size = |touch: &&(usize, usize, f64)| height_nm(touch).abs();
    let Some(most) = felt.iter().max_by(|a, b| size(a).total_cmp(&size(b))) else {
        return Ok(None);
    };
    let (peak_nm, sigma_nm) = (height_nm(most), sigma_nm[most.0]);
    let score = felt.iter().map(|(.., score)| *score).fold(1.0, f64::max);
    // A low-pass moves an edge by up to a quarter of its shortest period.
    let blur_s = 0.25 / low_pass.cutoff_hz();
    let (first, last) = (time_s[samples.start], time_s[samples.end - 1]);
    // A push that rises and falls as sin² is above the share NEAR/score of its peak for only 1 − f of its duration,
    // with f = `unseen`.
    let unseen = (NEAR / score).sqrt().asin() / std::f64::consts::FRAC_PI_2;
    let foot_s = 0.5 * (last - first) * unseen / (1.0 - unseen);
    let estimate = |value: f64, below: f64, above: f64, unit: &'static str| Estimate {
        value,
        unit,
        ci95: [value - below, value + above],
    };
    // The low-pass lowers the peak, the more the shorter the push is.
    let [likely, at_least] = [last - first + 2.0 * foot_s, last - first - 2.0 * blur_s]
        .map(|length_s| kept_of_peak(low_pass, length_s.max(SHORTEST_S)));
    let likely = likely?;
    let pushed_nm = peak_nm / likely;
    let [weakest_nm, hardest_nm] = [
        peak_nm - 1.96 * sigma_nm * peak_nm.signum(),
        peak_nm / at_least? + 1.96 * sigma_nm * peak_nm.signum(),
    ];
    let peak = Estimate {
        value: pushed_nm,
        unit: "Nm",
        ci95: [weakest_nm.min(hardest_nm), weakest_nm.max(hardest_nm)],
    };
    Ok(Some(Touch {
        samples,
        start_s: estimate(first, blur_s + foot_s, blur_s, "s"),
        end_s: estimate(last, blur_s, blur_s + foot_s, "s"),
        peak_nm: peak,
        peak_joint: most.0 + 1,
        felt: felt.iter().map(|touch| (touch.0 + 1, height_nm(touch) / likely)).collect(),
        strength: peak_nm.abs() / sigma_nm.max(f64::MIN_POSITIVE),
        moved_others: false,
        confidence: 1.0,
    }))
}

/// Share of its peak that a push keeps behind `low_pass`, if it rises and falls as sin² within `length_s`.
fn kept_of_peak(low_pass: &ZeroPhase, length_s: f64) -> Result<f64, SignalError> {
    let (rate_hz, edge) = (low_pass.rate_hz(), low_pass.edge_samples());
    let samples = (length_s * rate_hz).ceil() as usize;
    let mut push = vec![0.0; samples + 2 * edge + 1];
    for (k, y) in push[edge..=edge + samples].iter_mut().enumerate() {
        *y = (std::f64::consts::PI * k as f64 / (length_s * rate_hz))
            .min(std::f64::consts::PI)
            .sin()
            .powi(2);
    }
    low_pass.filter_in_place(&mut push, &mut Scratch::default())?;
    Ok(push.iter().fold(0.0, |most, y| y.max(most)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ P(f)/(1 + (√2 − 1)(f/f_c)⁸) df by hand, with P the spectrum of sin². At 125 Hz, a push of a tenth of a second
    /// has its peak a quarter of a sample from the nearest sample, whose value is (π/50)² = 0.004 lower.
    #[test]
    fn short_pushes_lose_some_of_their_peak() {
        for (cutoff_hz, length_s, kept) in
            [(10.0, 0.1, 0.8571), (3.0, 0.2, 0.6135), (10.0, 2.0, 1.0)]
        {
            let low_pass = ZeroPhase::new(cutoff_hz, 4, 125.0).unwrap();
            let found = kept_of_peak(&low_pass, length_s).unwrap();
            assert!((found - kept).abs() < 0.005, "{cutoff_hz} Hz, {length_s} s: {found}");
        }
    }
}
