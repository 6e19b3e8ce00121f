//! Slip: what a period that is no whole number of samples adds to the difference between a motion and itself a period
//! later.
//!
//! If a motion repeats after L + ε samples, then q(k + L) − q(k) = −ε q̇, with q̇ per sample and from the middle
//! between both instants. Where a joint moves fast this is far above the noise, and where it rests it is nothing.

use std::ops::Range;

use crate::robot::JointSignals;

/// The ε for which q(k + `lag`) − q(k) + ε q̇ has the smallest sum of squares over the joints and over the samples k of
/// `range`, in samples; NaN for a motion at rest.
pub(super) fn slip(q_rad: &JointSignals, range: &Range<usize>, lag: usize) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for j in 0..q_rad.joints() {
        let q = q_rad.joint(j);
        for k in range.clone() {
            let rate = mean_rate(q, k, lag);
            product -= (q[k + lag] - q[k]) * rate;
            square += rate * rate;
        }
    }
    product / square
}

/// Adds |q(k + `lag`) − q(k) + `slip` q̇|², summed over the joints, to each `sums[k]`, as far as there are any.
pub(super) fn add_squares_without_slip(
    q_rad: &JointSignals,
    lag: usize,
    slip: f64,
    sums: &mut [f64],
) {
    for j in 0..q_rad.joints() {
        let q = q_rad.joint(j);
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += (q[k + lag] - q[k] + slip * mean_rate(q, k, lag)).powi(2);
        }
    }
}

/// Mean of dq/dk at `k` and at `k` + `lag`.
fn mean_rate(q: &[f64], k: usize, lag: usize) -> f64 {
    0.5 * (rate(q, k) + rate(q, k + lag))
}

/// dq/dk from the samples beside `k`.
fn rate(q: &[f64], k: usize) -> f64 {
    let (left, right) = (k.saturating_sub(1), (k + 1).min(q.len() - 1));
    (q[right] - q[left]) / (right - left) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two waves of 100.3 samples. Central differences of a wave of ω per sample are too small by ω²/6 = 6.5e-4 and by
    /// four times that, and so much remains of the slip, and of the differences.
    #[test]
    fn slip_is_found_and_taken_out() {
        let omega = std::f64::consts::TAU / 100.3;
        let q = JointSignals::from_fn(2, 400, |j, k| ((1 + j) as f64 * omega * k as f64).sin());
        let found = slip(&q, &(1..298), 100);
        assert!((found - 0.3).abs() < 0.3 * 4.0 * omega * omega / 6.0, "{found}");
        let squares = |slip: f64| {
            let mut sums = vec![0.0; 300];
            add_squares_without_slip(&q, 100, slip, &mut sums);
            sums[1..298].iter().sum::<f64>()
        };
        let left = (squares(found) / squares(0.0)).sqrt();
        assert!(left < 4.0 * omega * omega / 6.0, "{left}");
    }
}
