//! Stretches of a repeated motion in which a joint rests or creeps, and its motion there without noise.
//!
//! Friction changes its sign with the noise of a velocity that is near zero, and this error is in the equations with the
//! opposite sign. It repeats in every period as far as the mean of the periods does, so that the scatter between the
//! periods does not show it. (Cycles of moves with pauses between them, without any fault, showed torque that was late by
//! 0.5 to 3 ms, and something unexplained in half of the logs.) There, a motion
//!
//! 1. keeps only the bands of harmonics in which its velocity stands out of its noise, and
//! 2. is averaged over a window around each sample. The window grows as long as all means of the velocity so far agree
//!    within [`AGREES`] standard deviations each (intersection of confidence intervals: Goldenshluger & Nemirovski 1997),
//!    so that it is long in the middle of a pause and ends where the joint sets off. The last window that agrees may
//!    already hold a part of the way up that is not clear of the noise, and would turn friction away from rest at the end
//!    of every pause; the one before it is therefore taken.
//!
//! A joint that reverses keeps all its harmonics, sample by sample, because they make the kink at the reversal: friction
//! that turns round too softly looks like friction that comes late.

use crate::signal::{mean_period, subtract_mean_period};

/// A joint is at rest while its velocity stays below this many σ of the noise in the rejected bands, for [`NEAR_S`]
/// before and after: a joint that reverses is faster by then.
const AT_REST: f64 = 15.0;
const NEAR_S: f64 = 0.04;
/// A joint creeps while its velocity stays below this many widths ε over which friction turns round, for [`CREEPS_S`]
/// before and after, and the rejected bands hold no more than [`LIKE_NOISE`] times the σ of their noise there, in which a
/// kink would stand out. From three widths on, friction is flat, and noise of the velocity does nothing to it.
const CREEPING: f64 = 3.0;
const CREEPS_S: f64 = 0.08;
const LIKE_NOISE: f64 = 1.5;

/// Means over windows of two lengths agree if they differ by less than this many standard deviations of the one and of
/// the other together.
const AGREES: f64 = 3.0;
/// Each window reaches this much further than the one before, and the longest reaches over an eighth of the period to
/// either side.
const LONGER: f64 = 1.5;
const LONGEST: usize = 8;

/// How a log was sampled, and over which velocities friction turns round.
pub struct Sampled {
    /// Samples per second.
    pub rate_hz: f64,
    /// The width ε, rad/s.
    pub width_rad_s: f64,
}

/// Where a joint rests or creeps, and over which window its motion may be averaged there.
pub struct SlowStretches {
    /// For each sample of a period, how many samples before and after it belong to the window; `None` where the joint
    /// is faster.
    reach: Vec<Option<usize>>,
}

impl SlowStretches {
    /// Finds them from the velocities `own` (rad/s) of all periods of a joint, and from the same velocities reduced to
    /// the bands in which they stand out, `told`. A period has `n` samples.
    pub fn of(own: &[f64], told: &[f64], n: usize, sampled: &Sampled) -> Self {
        let mut reach: Vec<Option<usize>> =
            is_slow(own, told, n, sampled).into_iter().map(|slow| slow.then_some(0)).collect();
        widen(&mut reach, told, n);
        Self { reach }
    }

    /// The periods of `fast`, with the means over the windows of the periods of `slow` in place of it where the joint
    /// rests or creeps.
    pub fn averaged(&self, fast: &[f64], slow: &[f64]) -> Vec<f64> {
        let n = self.reach.len();
        let each = fast.chunks_exact(n).zip(slow.chunks_exact(n));
        each.flat_map(|(fast, slow)| {
            let sums = Sums::of(slow);
            let mean = |(k, fast): (usize, &f64)| match self.reach[k] {
                Some(reach) => sums.mean_around(k, reach),
                None => *fast,
            };
            fast.iter().enumerate().map(mean).collect::<Vec<f64>>()
        })
        .collect()
    }
}

/// Whether the joint rests or creeps at each sample of a period.
fn is_slow(own: &[f64], told: &[f64], n: usize, sampled: &Sampled) -> Vec<bool> {
    let mean = mean_period(told, n);
    let mut rejected: Vec<f64> = own.iter().zip(told).map(|(own, told)| own - told).collect();
    let off: Vec<f64> = mean_period(&rejected, n).iter().map(|off| off * off).collect();
    subtract_mean_period(&mut rejected, n);
    let noise = square_of_mean(&rejected, n);
    let slow = AT_REST * (off.iter().sum::<f64>() / n as f64).sqrt();
    let [near, long] =
        [NEAR_S, CREEPS_S].map(|s| ((s * sampled.rate_hz).ceil() as usize).min(n / 2));
    // The motion is periodic: the first sample follows the last.
    let around = |k: usize, reach: usize| (n + k - reach..=n + k + reach).map(|at| at % n);
    let stays_below = |k: usize, reach: usize, limit_rad_s: f64| {
        around(k, reach).all(|at| mean[at].abs() < limit_rad_s)
    };
    let is_like_noise = |k: usize| {
        let squares = around(k, long).map(|at| off[at]).sum::<f64>();
        squares < LIKE_NOISE * LIKE_NOISE * noise * (2 * long + 1) as f64
    };
    let is_slow = |k: usize| {
        stays_below(k, near, slow)
            || stays_below(k, long, CREEPING * sampled.width_rad_s) && is_like_noise(k)
    };
    (0..n).map(is_slow).collect()
}

/// Sets `reach`, where it is not `None`, to that of the longest window but one within which the mean over the periods of
/// the velocities `told` is constant or rises evenly.
fn widen(reach: &mut [Option<usize>], told: &[f64], n: usize) {
    let slow: Vec<usize> = (0..n).filter(|k| reach[*k].is_some()).collect();
    if slow.is_empty() {
        return;
    }
    let of_mean = Sums::of(&mean_period(told, n));
    let mut off = told.to_vec();
    subtract_mean_period(&mut off, n);
    let of_scatter: Vec<Sums> = off.chunks_exact(n).map(Sums::of).collect();
    let periods = of_scatter.len();
    // Interval in which all means so far agree, at each sample; empty from the first that does not.
    let mut agreed = vec![[f64::NEG_INFINITY, f64::INFINITY]; n];
    let (mut shorter, mut longer) = (0, 0);
    while longer <= n / LONGEST {
        let square = |k: &usize| -> f64 {
            of_scatter.iter().map(|sums| sums.mean_around(*k, longer).powi(2)).sum()
        };
        let squares = slow.iter().map(square).sum::<f64>();
        let within = AGREES * (squares / (slow.len() * periods * (periods - 1)) as f64).sqrt();
        for &k in &slow {
            let mean = of_mean.mean_around(k, longer);
            let [low, high] = &mut agreed[k];
            (*low, *high) = (low.max(mean - within), high.min(mean + within));
            if low <= high {
                reach[k] = Some(shorter);
            }
        }
        shorter = longer;
        longer = (longer + 1).max((LONGER * longer as f64) as usize);
    }
}

/// Mean square of the error of the mean over the periods, from what `off` from that mean each period is.
fn square_of_mean(off: &[f64], n: usize) -> f64 {
    let periods = off.len() / n;
    off.iter().map(|off| off * off).sum::<f64>() / (n * periods * (periods - 1)) as f64
}

/// Sums over windows of a periodic signal.
struct Sums {
    /// Sum of all samples before each one, over three periods: a window may reach beyond either end of the middle one.
    before: Vec<f64>,
    n: usize,
}

impl Sums {
    fn of(period: &[f64]) -> Self {
        let mut before = Vec::with_capacity(3 * period.len() + 1);
        let mut sum = 0.0;
        before.push(sum);
        for y in period.iter().cycle().take(3 * period.len()) {
            sum += y;
            before.push(sum);
        }
        Self { before, n: period.len() }
    }

    /// Mean over the samples up to `reach` ≤ n before and after sample `k`.
    fn mean_around(&self, k: usize, reach: usize) -> f64 {
        let middle = self.n + k;
        let sum = self.before[middle + reach + 1] - self.before[middle - reach];
        sum / (2 * reach + 1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::kept_bands::KeptBands;
    use crate::diagnose::noisy_periods::{PERIODS, SAMPLES, periods, rms};
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 100.0;

    /// The velocities `own` without their noise where their joint rests or creeps.
    fn without_noise(own: &[f64], width_rad_s: f64) -> Vec<f64> {
        let bands = KeptBands::that_stand_out(own, SAMPLES);
        let told: Vec<f64> = own.chunks_exact(SAMPLES).flat_map(|y| bands.of(y)).collect();
        let sampled = Sampled { rate_hz: RATE_HZ, width_rad_s };
        SlowStretches::of(own, &told, SAMPLES, &sampled).averaged(own, &told)
    }

    /// The velocity of a joint that moves for half a period and rests for the other half. Its harmonics fall as 1/h³
    /// and drop below the noise of their mean at h = 28. With these bands, and a few kept by chance, less than half of
    /// the noise remains at rest; the windows leave less than a fifth. Where the joint moves nothing changes.
    #[test]
    fn velocity_loses_its_noise_at_rest_alone() {
        let moves = SAMPLES / 2;
        let phase = |k: usize| TAU * k as f64 / moves as f64;
        let speed = |k: usize| if k < moves { 0.5 - 0.5 * phase(k).cos() } else { 0.0 };
        let y = periods(speed, 1e-3);
        let told = without_noise(&y, 1e-6);
        let rest = moves + 100..SAMPLES - 100;
        assert!(rms(told[rest.clone()].iter().copied()) < 0.2 * rms(y[rest].iter().copied()));
        assert_eq!(told[100..moves - 100], y[100..moves - 100]);
    }

    /// A joint that creeps at 0.1 rad/s, faster than fifteen σ of the noise of its mean, while friction turns round over
    /// 0.1 rad/s. Of a kink of fifteen σ of that noise, all is kept within 80 ms.
    #[test]
    fn velocity_loses_its_noise_where_a_joint_creeps_without_a_kink() {
        let noise = 1e-3;
        let kink = |k: usize| if k == 700 { 15.0 * noise / (PERIODS as f64).sqrt() } else { 0.0 };
        let y = periods(|k| 0.1 + kink(k), noise);
        let told = without_noise(&y, 0.1);
        let left = |y: &[f64]| rms(y[..600].iter().map(|qd| qd - 0.1));
        assert!(left(&told) < 0.5 * left(&y));
        assert_eq!(told[692..=708], y[692..=708]);
        // Where friction is flat at that speed, nothing changes.
        assert_eq!(without_noise(&y, 0.03), y);
    }

    /// A joint that rests for half a period and then sets off by ten σ of the noise of the mean per sample. The longest
    /// window that is taken has 127 samples and leaves √(1/127) of the noise; chance ends some windows earlier.
    #[test]
    fn a_window_ends_where_the_joint_sets_off() {
        let noise = 1e-3;
        let of_mean = noise / (PERIODS as f64).sqrt();
        let rises = |k: usize| (k as f64 - 500.0).max(0.0) * 10.0 * of_mean;
        let y = periods(rises, noise);
        let mut reach = vec![Some(0); SAMPLES];
        widen(&mut reach, &y, SAMPLES);
        let calm = mean_period(&SlowStretches { reach }.averaged(&y, &y), SAMPLES);
        assert!(rms(calm[200..400].iter().copied()) < 0.2 * of_mean);
        // A window that would hold a sample of ten σ or more is not taken: only the noise of the mean is added.
        assert!((490..510).all(|k| (calm[k] - rises(k)).abs() < 4.0 * of_mean));
    }

    /// Windows reach beyond the ends of a period into its neighbours.
    #[test]
    fn means_of_a_periodic_signal() {
        let sums = Sums::of(&[1.0, 2.0, 6.0, 7.0]);
        assert_eq!([0, 3].map(|k| sums.mean_around(k, 0)), [1.0, 7.0]);
        assert_eq!(sums.mean_around(0, 1), 10.0 / 3.0);
        assert_eq!(sums.mean_around(3, 2), 18.0 / 5.0);
    }
}
