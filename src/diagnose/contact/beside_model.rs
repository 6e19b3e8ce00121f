//! Contacts in a single run: torque that deviates far from the extended model.
//!
//! A contact is where the deviation exceeds [`FAR_OF_MODEL`] robust standard deviations; it lasts while the deviation
//! stays above the share [`NEAR`] of that. Errors of the model's friction are largest near a joint's own reversals, and
//! most at a few of these: there the standard deviation is that of the larger errors near reversals.

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
/// Share of the samples near reversals whose deviation is called usual. Beyond it may be those of one contact.
const USUAL: f64 = 0.9;
/// σ of Gaussian deviations of which the share [`USUAL`] is smaller: 1/1.645.
const SIGMA_PER_USUAL: f64 = 0.608;
/// Least number of samples near reversals of which the usual deviation is taken, over the number that one contact of a
/// second disturbs.
const SEVERAL: usize = 10;

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
    let scales: Vec<Scales> = (0..error_nm.joints())
        .map(|j| Scales::of(error_nm.joint(j), qd_rad_s.joint(j), rate_hz))
        .collect();
    let score = |j: usize, k: usize| error_nm.joint(j)[k].abs() / (FAR_OF_MODEL * scales[j].at(k));
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
            touch(samples, &felt, error_nm, &scales, time_s, low_pass).transpose()
        })
        .collect::<Result<_, _>>()?;
    Ok(BesideModel {
        causes: touches.iter().map(Touch::cause).collect(),
        samples: touches.iter().map(|touch| touch.disturbed(rate_hz, n)).collect(),
    })
}

/// Usual deviations of one joint's torque from the model.
struct Scales {
    /// Whether each sample is near a reversal of the joint, or one of its rests.
    is_near: Vec<bool>,
    /// Robust σ far from reversals, and near them, Nm; infinite where it is not known.
    sigma_nm: [f64; 2],
}

impl Scales {
    /// The scales of the deviations `error_nm` of a joint with the velocities `qd_rad_s`.
    fn of(error_nm: &[f64], qd_rad_s: &[f64], rate_hz: f64) -> Self {
        let n = error_nm.len();
        let reach = (REVERSAL_S * rate_hz) as usize;
        let mut is_near = vec![false; n];
        for k in (0..n).filter(|&k| qd_rad_s[k].abs() < SLOW_RAD_S) {
            is_near[k.saturating_sub(reach)..=(k + reach).min(n - 1)].fill(true);
        }
        let sizes = |near: bool| -> Vec<f64> {
            let there = error_nm.iter().zip(&is_near).filter(|(_, is_near)| **is_near == near);
            there.map(|(error, _)| error.abs()).collect()
        };
        let known = |sigma: f64| if sigma > 0.0 { sigma } else { f64::INFINITY };
        let far_nm = known(robust_sigma(&mut sizes(false)));
        let mut near = sizes(true);
        near.sort_by(f64::total_cmp);
        let is_enough = near.len() as f64 > SEVERAL as f64 * rate_hz;
        let usual = near.get((USUAL * near.len() as f64) as usize).filter(|_| is_enough);
        let near_nm = known(usual.map_or(0.0, |usual| SIGMA_PER_USUAL * usual)).max(far_nm);
        Self { is_near, sigma_nm: [far_nm, near_nm] }
    }

    /// Robust σ of the deviation at sample `k`, Nm.
    fn at(&self, k: usize) -> f64 {
        self.sigma_nm[usize::from(self.is_near[k])]
    }
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
    scales: &[Scales],
    time_s: &[f64],
    low_pass: &ZeroPhase,
) -> Result<Option<Touch>, SignalError> {
    let height_nm = |&(j, k, _): &(usize, usize, f64)| error_nm.joint(j)[k];
    let size = |touch: &&(usize, usize, f64)| height_nm(touch).abs();
    let Some(most) = felt.iter().max_by(|a, b| size(a).total_cmp(&size(b))) else {
        return Ok(None);
    };
    let (peak_nm, sigma_nm) = (height_nm(most), scales[most.0].at(most.1));
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

    /// A joint that reverses twice in 5 s, with an error of 0.1 Nm, and of up to 1.5 Nm for 0.2 s at each reversal. A push
    /// of 0.6 s by 20 Nm around a reversal is a contact of its time and height, and the errors alone are none. σ near
    /// reversals is 0.9 Nm at most (the errors of 1.5 Nm fill 0.2 s of every 0.5 s there), of which 12 are 11 Nm.
    #[test]
    fn a_push_at_a_reversal_is_found() {
        let (rate_hz, samples) = (125.0, 60 * 125);
        let low_pass = ZeroPhase::new(10.0, 4, rate_hz).unwrap();
        let time_s: Vec<f64> = (0..samples).map(|k| k as f64 / rate_hz).collect();
        let phase = |k: usize| std::f64::consts::TAU * time_s[k] / 5.0;
        let qd_rad_s = JointSignals::from_fn(1, samples, |_, k| phase(k).sin());
        let usual = |k: usize| {
            let since = (time_s[k] % 2.5).min(2.5 - time_s[k] % 2.5);
            let ripple = 0.1 * (7.3 * k as f64).sin();
            if since < 0.1 { 1.5 * (1.0 - since / 0.1) + ripple } else { ripple }
        };
        let pushed = |k: usize| {
            let u = (time_s[k] - 29.7) / 0.6;
            let is_on = (0.0..1.0).contains(&u);
            if is_on { 20.0 * (std::f64::consts::PI * u).sin().powi(2) } else { 0.0 }
        };
        let found = |error: &dyn Fn(usize) -> f64| {
            let error_nm = JointSignals::from_fn(1, samples, |_, k| error(k));
            beside_model(&error_nm, &qd_rad_s, &time_s, &low_pass).unwrap().causes
        };
        assert!(found(&usual).is_empty());
        let causes = found(&|k| usual(k) + pushed(k));
        let [touch] = &causes[..] else { panic!("{causes:?}") };
        let value = |name: &str| touch.parameters[name].value;
        // The threshold of 6 σ cuts the feet of the push off; beside them is what the model leaves of the reversal.
        assert!((29.6..29.95).contains(&value("start_s")), "{touch:?}");
        assert!((30.05..30.4).contains(&value("end_s")), "{touch:?}");
        assert!((value("peak_nm") - 20.0).abs() < 3.0, "{touch:?}");
    }

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
