//! What the drive of a joint gives where its friction turns round, as the recorded torque tells it.
//!
//! Harmonics in which the load of a joint drowns in noise are small one by one, but they are no accident: whatever a drive
//! does at a reversal it does at every other. With s the sign of the velocity it is Σ_i c_i s(t − iΔ), the c fitted to the
//! torque of these harmonics. Six delays, from two before to three behind the reversal, hold what a drive does within some
//! twenty milliseconds.
//!
//! A torque that is recorded late shows the same sum later, which between two samples is not another set of c: under a
//! delay d that is asked for, the c are those of Σ_i c_i s(t − iΔ − d).

use fourier::Complex64;
use nalgebra::{Cholesky, DMatrix, DVector};

use crate::signal::FineClock;

/// Time between two delays, s; not less than that between two samples.
const DELAY_S: f64 = 0.008;
/// In steps of that.
const DELAYS: std::ops::Range<i64> = -2..4;
/// Faster than this, Hz, drives are not looked at: delays of 8 ms tell nothing beyond half their rate.
pub const FASTEST_HZ: f64 = 60.0;
/// What the reversals explain of a torque over what they explain of noise. The noise of the c is in the residual of the
/// log as well; all six shift a score by less than √(6/(6·10)) = 0.3 of its σ.
const TOLD: f64 = 10.0;

/// A harmonic of the recorded torque.
pub struct TorqueHarmonic {
    /// Its number.
    pub number: usize,
    /// Coefficient of the mean period.
    pub mean: Complex64,
    /// Mean square of its noise.
    pub noise: f64,
}

/// See the module.
pub struct ReversalAnswer {
    /// s, at every tick.
    sign: Vec<f64>,
    /// Coulomb friction, Nm: what a drive of which nothing is told gives.
    coulomb_nm: f64,
    /// Harmonics in which drives are looked at.
    torque: Vec<TorqueHarmonic>,
    /// Δ in ticks.
    delay: f64,
}

impl ReversalAnswer {
    /// Of a joint whose velocity has the `sign` at every tick of `clock`, of which there are `rate_hz` samples a second.
    pub fn new(
        (clock, rate_hz): (&FineClock, f64),
        sign: Vec<f64>,
        coulomb_nm: f64,
        torque: Vec<TorqueHarmonic>,
    ) -> Self {
        let delay = (DELAY_S.max(1.0 / rate_hz) * rate_hz * clock.ticks() as f64).round();
        Self { sign, coulomb_nm, torque, delay }
    }

    /// What the drive gives, Nm at every tick, if the torque was recorded `late_ticks` late.
    pub fn given_nm(&self, clock: &FineClock, late_ticks: f64) -> Vec<f64> {
        match self.coefficients(clock, late_ticks) {
            Some(c) => {
                let mut given_nm = vec![0.0; self.sign.len()];
                for (sign, c) in self.delayed(0.0, 1).zip(c) {
                    given_nm.iter_mut().zip(sign).for_each(|(sum, sign)| *sum += c * sign);
                }
                given_nm
            }
            None => self.sign.iter().map(|s| self.coulomb_nm * s).collect(),
        }
    }

    /// The c, Nm; `None` where the answer drowns, or where the joint hardly reverses.
    fn coefficients(&self, clock: &FineClock, late_ticks: f64) -> Option<Vec<f64>> {
        let spectra: Vec<Vec<Complex64>> =
            self.delayed(late_ticks, clock.ticks()).map(|s| clock.spectrum(&s)).collect();
        let count = spectra.len();
        let weighted = |i: usize, y: &dyn Fn(&TorqueHarmonic) -> Complex64| -> f64 {
            let product = |h: &TorqueHarmonic| (spectra[i][h.number].conj() * y(h)).re / h.noise;
            self.torque.iter().map(product).sum()
        };
        let normal = DMatrix::from_fn(count, count, |i, k| weighted(i, &|h| spectra[k][h.number]));
        let score = DVector::from_fn(count, |i, _| weighted(i, &|h| h.mean));
        let c = Cholesky::new(normal)?.solve(&score);
        // Noise alone would make this one: the mean square of a coefficient has two parts.
        let told = 2.0 * c.dot(&score) / count as f64;
        (told > TOLD).then(|| c.as_slice().to_vec())
    }

    /// s(t − iΔ − d) at every so many ticks, by delay.
    fn delayed(&self, late_ticks: f64, every: usize) -> impl Iterator<Item = Vec<f64>> {
        DELAYS.map(move |i| shifted(&self.sign, i as f64 * self.delay + late_ticks, every))
    }
}

/// y(t − `ticks`) of a series that repeats, straight between its ticks, at every so many of them.
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

    /// A joint that reverses within two samples under a friction of 8 Nm, of which its drive gives `shares` a sample or two
    /// around the reversal, and whose torque is recorded `late_ticks` late.
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

    /// Whatever part of a sample the torque is late: the answer is what it is on time.
    #[test]
    fn a_late_torque_tells_what_the_drive_gave() {
        for late in [0.0, 3.0, 5.5, -7.25, 20.0] {
            let (clock, answer, truth) = answer(&[(0.7, 0.0), (0.2, -16.0)], late);
            assert!(off(&answer.given_nm(&clock, late), &truth) < 1e-9, "{late}");
        }
        // Taken for one on time it tells another course between the samples.
        let (clock, answer, truth) = answer(&[(1.0, 0.0)], 8.0);
        assert!(off(&answer.given_nm(&clock, 0.0), &truth) > 1.0);
    }

    #[test]
    fn a_drive_of_which_nothing_is_told_gives_friction_what_it_takes() {
        let (clock, answer, _) = answer(&[], 0.0);
        let dry: Vec<f64> = answer.sign.iter().map(|s| 8.0 * s).collect();
        assert_eq!(answer.given_nm(&clock, 0.0), dry);
        // A joint that does not reverse tells nothing either.
        let still = ReversalAnswer { sign: vec![1.0; N * TICKS], ..answer };
        assert_eq!(still.given_nm(&clock, 0.0), vec![8.0; N * TICKS]);
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
