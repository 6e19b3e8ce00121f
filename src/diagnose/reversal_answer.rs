//! What the drive of a joint delivers where its friction reverses, as the recorded torque tells it.
//!
//! In the harmonics in which the load of a joint is below the noise, the drive's torque is small harmonic by harmonic,
//! but it is no accident: whatever a drive does at one reversal it does at every other. With s the sign of the
//! velocity, its torque is Σ_i c_i s(t − iΔ), with the c fitted to the recorded torque of these harmonics. Six delays,
//! from two before to three behind the reversal, cover what a drive does within some twenty milliseconds.
//!
//! A torque that is recorded late shows the same sum later. Between two samples this is not the same sum with other c,
//! so for a delay d the c are fitted to Σ_i c_i s(t − iΔ − d), and for a low-pass to the sum with s behind it.

use fourier::Complex64;
use nalgebra::{Cholesky, DMatrix, DVector};

use super::lateness::Lateness;
use crate::signal::FineClock;

/// Step Δ between two delays, s; never less than the time between two samples.
const DELAY_S: f64 = 0.008;
/// The delays i, in steps of Δ.
const DELAYS: std::ops::Range<i64> = -2..4;
/// Highest frequency at which drives are looked at, Hz: delays of 8 ms tell nothing beyond half their rate.
pub const FASTEST_HZ: f64 = 60.0;
/// Least ratio of what the reversals explain of the torque to what they would explain of noise. The noise of the c also
/// enters the residual of the log; at this ratio, all six shift a score by less than √(6/(6·10)) = 0.3 of its σ.
const TOLD: f64 = 10.0;

/// A harmonic of the recorded torque.
pub struct TorqueHarmonic {
    /// Its number, 1 for once per period.
    pub number: usize,
    /// Its coefficient in the mean period.
    pub mean: Complex64,
    /// Mean square of its noise.
    pub noise: f64,
}

/// What the recorded torque tells of one drive's answer to reversals; see the module.
pub struct ReversalAnswer {
    /// s, the sign of the velocity, at every tick.
    sign: Vec<f64>,
    /// Coulomb friction, Nm: a drive of which the torque tells nothing is taken to deliver it all.
    coulomb_nm: f64,
    /// The harmonics to which the c are fitted.
    torque: Vec<TorqueHarmonic>,
    /// Δ in ticks.
    delay: f64,
}

impl ReversalAnswer {
    /// For a joint whose velocity has the `sign` at every tick of `clock`, in a log of `rate_hz` samples per second.
    pub fn new(
        (clock, rate_hz): (&FineClock, f64),
        sign: Vec<f64>,
        coulomb_nm: f64,
        torque: Vec<TorqueHarmonic>,
    ) -> Self {
        let delay = (DELAY_S.max(1.0 / rate_hz) * rate_hz * clock.ticks() as f64).round();
        Self { sign, coulomb_nm, torque, delay }
    }

    /// What the drive delivers, Nm at every tick, if the torque was recorded on time.
    pub fn given_nm(&self, clock: &FineClock) -> Vec<f64> {
        let on_time = (&*self.sign, 0.0);
        let c = self.coefficients(clock, on_time);
        self.sum_nm(c.as_deref(), on_time, 1)
    }

    /// Change of what the drive delivers by the `lateness` of its record, in ticks; Nm at every sample of `clock`.
    pub fn change_nm(&self, clock: &FineClock, lateness: Lateness) -> Vec<f64> {
        let (sign, late_ticks) = lateness.parts(&self.sign);
        let c = self.coefficients(clock, (&sign, late_ticks));
        let [mut late, now] = [(&*sign, late_ticks), (&self.sign, 0.0)]
            .map(|of| self.sum_nm(c.as_deref(), of, clock.ticks()));
        late.iter_mut().zip(now).for_each(|(late, now)| *late -= now);
        late
    }

    /// Σ_i c_i s(t − iΔ − d) with s = `sign` and d = `late_ticks`, Nm, at every `every`-th tick; without `c`, all
    /// friction of t − d.
    fn sum_nm(
        &self,
        c: Option<&[f64]>,
        (sign, late_ticks): (&[f64], f64),
        every: usize,
    ) -> Vec<f64> {
        let Some(c) = c else {
            let sign = shifted(sign, late_ticks, every);
            return sign.iter().map(|s| self.coulomb_nm * s).collect();
        };
        let mut sum_nm = vec![0.0; sign.len().div_ceil(every)];
        for (sign, c) in self.delayed((sign, late_ticks), every).zip(c) {
            sum_nm.iter_mut().zip(sign).for_each(|(sum, sign)| *sum += c * sign);
        }
        sum_nm
    }

    /// The c, Nm; `None` where noise drowns the answer, or where the joint hardly reverses.
    fn coefficients(&self, clock: &FineClock, late: (&[f64], f64)) -> Option<Vec<f64>> {
        let spectra: Vec<Vec<Complex64>> =
            self.delayed(late, clock.ticks()).map(|s| clock.spectrum(&s)).collect();
        let count = spectra.len();
        let weighted = |i: usize, y: &dyn Fn(&TorqueHarmonic) -> Complex64| -> f64 {
            let product = |h: &TorqueHarmonic| (spectra[i][h.number].conj() * y(h)).re / h.noise;
            self.torque.iter().map(product).sum()
        };
        let normal = DMatrix::from_fn(count, count, |i, k| weighted(i, &|h| spectra[k][h.number]));
        let score = DVector::from_fn(count, |i, _| weighted(i, &|h| h.mean));
        let c = Cholesky::new(normal)?.solve(&score);
        // Noise alone would make this ratio one: the mean square of a complex coefficient has two parts.
        let told = 2.0 * c.dot(&score) / count as f64;
        (told > TOLD).then(|| c.as_slice().to_vec())
    }

    /// s(t − iΔ − d) for every delay i, at every `every`-th tick.
    fn delayed<'s>(
        &self,
        (sign, late_ticks): (&'s [f64], f64),
        every: usize,
    ) -> impl Iterator<Item = Vec<f64>> + use<'s> {
        let delay = self.delay;
        DELAYS.map(move |i| shifted(sign, i as f64 * delay + late_ticks, every))
    }
}

/// y(t − `ticks`) of a periodic series, interpolated linearly between ticks, at every `every`-th tick.
pub fn shifted(y: &[f64], ticks: f64, every: usize) -> Vec<f64> {
    let n = y.len();
    let (whole, u) = (ticks.floor() as i64, ticks - ticks.floor());
    let first = (-whole).rem_euclid(n as i64) as usize;
    let at = |k: usize| {
        let right = if first + k < n { first + k } else { first + k - n };
        let left = if right == 0 { n - 1 } else { right - 1 };
        y[right] + u * (y[left] - y[right])
    };
    (0..n).step_by(every).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 500;
    const TICKS: usize = 16;

    /// A joint that reverses within two samples under a friction of 8 Nm. Its drive delivers `shares` (share, delay in
    /// ticks) of that around the reversal, and its torque is recorded `late_ticks` late.
    fn answer(shares: &[(f64, f64)], late_ticks: f64) -> (FineClock, ReversalAnswer, Vec<f64>) {
        let clock = FineClock::new(N, TICKS);
        let velocity = |k: usize| {
            let phase = std::f64::consts::TAU * k as f64 / (N * TICKS) as f64;
            2.0 * (4.0 * phase + 0.3).sin() + 0.5 * phase.cos()
        };
        let sign: Vec<f64> = (0..N * TICKS).map(|k| (velocity(k) / 0.03).tanh()).collect();
        let mut given = vec![0.0; N * TICKS];
        for &(share, ticks) in shares {
            let part = shifted(&sign, ticks, 1);
            given.iter_mut().zip(part).for_each(|(sum, s)| *sum += 8.0 * share * s);
        }
        let recorded = shifted(&given, late_ticks, TICKS);
        let mean = clock.spectrum(&recorded);
        let torque = (20..200)
            .map(|number| TorqueHarmonic { number, mean: mean[number], noise: 1e-4 })
            .collect();
        let answer = ReversalAnswer::new((&clock, 125.0), sign, 8.0, torque);
        (clock, answer, given)
    }

    fn off(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// By whatever fraction of a sample the torque is late, the answer tells how its record differs from one on time.
    #[test]
    fn a_late_torque_tells_what_the_drive_gave() {
        for late in [0.0, 3.0, 5.5, -7.25, 20.0] {
            let (clock, answer, truth) = answer(&[(0.7, 0.0), (0.2, -16.0)], late);
            let [delayed, now] = [late, 0.0].map(|ticks| shifted(&truth, ticks, TICKS));
            let change: Vec<f64> = delayed.iter().zip(now).map(|(a, b)| a - b).collect();
            assert!(
                off(&answer.change_nm(&clock, Lateness::Delay(late)), &change) < 1e-9,
                "{late}"
            );
        }
    }

    /// A torque recorded on time tells what the drive gave between the samples as well. A late one that is taken for
    /// one on time tells another course there.
    #[test]
    fn a_torque_on_time_tells_the_course_between_samples() {
        let off_truth = |shares: &[(f64, f64)], late: f64| {
            let (clock, answer, truth) = answer(shares, late);
            off(&answer.given_nm(&clock), &truth)
        };
        assert!(off_truth(&[(0.7, 0.0), (0.2, -16.0)], 0.0) < 1e-9);
        assert!(off_truth(&[(1.0, 0.0)], 8.0) > 1.0);
    }

    #[test]
    fn a_drive_of_which_nothing_is_told_gives_friction_what_it_takes() {
        let (clock, answer, _) = answer(&[], 0.0);
        let dry: Vec<f64> = answer.sign.iter().map(|s| 8.0 * s).collect();
        assert_eq!(answer.given_nm(&clock), dry);
        let change: Vec<f64> = shifted(&dry, 8.0, TICKS)
            .iter()
            .zip(dry.iter().step_by(TICKS))
            .map(|(late, now)| late - now)
            .collect();
        assert!(off(&answer.change_nm(&clock, Lateness::Delay(8.0)), &change) < 1e-12);
        // Nor does the torque of a joint that does not reverse tell anything.
        let still = ReversalAnswer { sign: vec![1.0; N * TICKS], ..answer };
        assert_eq!(still.given_nm(&clock), vec![8.0; N * TICKS]);
    }

    #[test]
    fn a_series_is_shifted_by_parts_of_a_tick() {
        let y = [0.0, 1.0, 4.0, 9.0];
        assert_eq!(shifted(&y, 1.0, 1), [9.0, 0.0, 1.0, 4.0]);
        assert_eq!(shifted(&y, -1.0, 1), [1.0, 4.0, 9.0, 0.0]);
        assert_eq!(shifted(&y, 0.25, 1), [2.25, 0.75, 3.25, 7.75]);
        assert_eq!(shifted(&y, 0.25, 2), [2.25, 3.25]);
    }
}
