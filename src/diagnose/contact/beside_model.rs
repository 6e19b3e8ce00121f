//! Contacts along a single run: torque far off the extended model's.
//!
//! Samples near a joint's own reversals do not count, where errors of the model's friction are largest. A
//! contact is where the deviation passes [`FAR_OF_MODEL`] robust standard deviations; it lasts while the
//! deviation stays above [`NEAR`] of that.

use std::ops::Range;

use super::Touch;
use crate::diagnose::verdict::{Cause, Estimate};
use crate::median::robust_sigma;
use crate::robot::JointSignals;

/// Deviations of this many robust σ belong to a contact: most of them are errors of the model.
const FAR_OF_MODEL: f64 = 12.0;
/// A contact lasts while the deviation is above this share of the threshold.
const NEAR: f64 = 0.5;
/// Low-pass of the residuals, Hz.
const CUTOFF_HZ: f64 = 10.0;
/// Parts closer than this are one contact, s.
const TOGETHER_S: f64 = 0.3;
/// A joint slower than this, rad/s, or so shortly before or behind, s, may be held by friction.
const SLOW_RAD_S: f64 = 0.05;
const REVERSAL_S: f64 = 0.25;

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
            // Per joint that felt it: joint, sample where most, score there.
            let felt: Vec<(usize, usize, f64)> = joints
                .clone()
                .filter_map(|j| {
                    let scores = samples.clone().map(|k| (j, k, score(j, k)));
                    scores.max_by(|a, b| a.2.total_cmp(&b.2)).filter(|(.., score)| *score >= 1.0)
                })
                .collect();
            touch(samples, &felt, error_nm, &sigma_nm, time_s)
        })
        .collect();
    BesideModel {
        causes: touches.iter().map(Touch::cause).collect(),
        samples: touches.iter().map(|touch| touch.disturbed(rate_hz, n)).collect(),
    }
}

/// Stretches of `0..n` that begin and end with a sample that `is_far` and have no more than `gap` others in a
/// row.
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

/// The contact that the joints `felt` (joint, sample where most, score there) in `samples`.
fn touch(
    samples: Range<usize>,
    felt: &[(usize, usize, f64)],
    error_nm: &JointSignals,
    sigma_nm: &[f64],
    time_s: &[f64],
) -> Option<Touch> {
    let height_nm = |&(j, k, _): &(usize, usize, f64)| error_nm.joint(j)[k];
    let most = felt.iter().max_by(|a, b| height_nm(a).abs().total_cmp(&height_nm(b).abs()))?;
    let (peak_nm, sigma_nm) = (height_nm(most), sigma_nm[most.0]);
    let score = felt.iter().map(|(.., score)| *score).fold(1.0, f64::max);
    // A low-pass moves an edge by up to a quarter of its shortest period.
    let blur_s = 0.25 / CUTOFF_HZ;
    let (first, last) = (time_s[samples.start], time_s[samples.end - 1]);
    // What rises and falls as sin² is above the share NEAR/score of its peak for 1 − f of its time only.
    let unseen = (NEAR / score).sqrt().asin() / std::f64::consts::FRAC_PI_2;
    let foot_s = 0.5 * (last - first) * unseen / (1.0 - unseen);
    let estimate = |value: f64, below: f64, above: f64, unit: &'static str| Estimate {
        value,
        unit,
        ci95: [value - below, value + above],
    };
    let reach_nm = 1.96 * sigma_nm;
    Some(Touch {
        samples,
        start_s: estimate(first, blur_s + foot_s, blur_s, "s"),
        end_s: estimate(last, blur_s, blur_s + foot_s, "s"),
        peak_nm: estimate(peak_nm, reach_nm, reach_nm, "Nm"),
        felt: felt.iter().map(|touch| (touch.0 + 1, height_nm(touch))).collect(),
        strength: peak_nm.abs() / sigma_nm.max(f64::MIN_POSITIVE),
        moved_others: false,
    })
}
