//! Friction that changes slowly between repetitions: neither noise nor contact, however large it is.
//!
//! If the friction φ of a joint is multiplied by f(t) at time t, a sample differs by φ (f(t) − f̄) from what the
//! repetitions have in common at its phase, which is their mean or the trimmed mean of the other periods. φ is a
//! combination of sign q̇ and q̇, and f a combination of a straight line and an exponential with a quarter of the
//! record as its time constant. The coefficients of the four products are found by least squares. They hardly fit a
//! push, which comes once and has one direction. They take four of the thousands of degrees of freedom of the noise;
//! but of eight periods they take 5 to 15 % of those in the slow harmonics, where the velocity lives
//! ([`FrictionDrift::kept`]).

use nalgebra::{Cholesky, Complex, Const, SMatrix, SVector};

use crate::median::trimmed_mean;
use crate::robot::JointSignals;
use crate::signal::other_periods;

/// Velocity over which dry friction builds up, rad/s.
const STANDSTILL_RAD_S: f64 = 0.02;
/// Time constant of the exponential, as a share of the record.
const FADES: f64 = 0.25;
/// Number of friction laws times the number of courses in time.
pub(super) const COLUMNS: usize = 4;
/// Least share of the scatter that counts as kept when drifting friction is removed. With two periods, the removal may
/// take most of what a slow harmonic says of noise; with eight, 5 to 15 %. The remaining scatter is divided by the
/// share that would remain of white noise. For noise that rises as the sum of two colours, the result is 0.96 to 1.08
/// of the true power.
const LEAST_KEPT: f64 = 0.25;

/// Deviations that drifting friction may cause, for every joint.
pub struct FrictionDrift {
    qd_rad_s: JointSignals,
    /// f(t) − f̄ at every sample, for the exponential and the straight line.
    courses: [Vec<f64>; 2],
}

impl FrictionDrift {
    /// For deviations from the trimmed mean of the other periods; `qd_rad_s` are the velocities of the whole record,
    /// whose motion repeats every `period` samples.
    pub fn beside_others(qd_rad_s: JointSignals, period: f64) -> Self {
        let samples = qd_rad_s.samples();
        let mut same = Vec::new();
        Self::new(qd_rad_s, FADES, |f, k| {
            same.clear();
            same.extend(other_periods(k, period, samples).map(f));
            trimmed_mean(&mut same).unwrap_or(f(k as f64))
        })
    }

    /// For deviations from the mean over all `periods`, each with the velocities `qd_rad_s`.
    pub fn beside_mean(qd_rad_s: &JointSignals, periods: usize) -> Self {
        Self::fading_beside_mean(qd_rad_s, periods, FADES)
    }

    /// The same with an exponential that fades within the share `fades` of the record.
    pub(super) fn fading_beside_mean(qd_rad_s: &JointSignals, periods: usize, fades: f64) -> Self {
        let n = qd_rad_s.samples();
        let all = qd_rad_s.map_joints(|_, qd| qd.repeat(periods));
        // The mean is the same in all periods: the samples of the first one come first and compute it.
        let mut means = vec![0.0; n];
        Self::new(all, fades, |f, k| {
            if k < n {
                let sum = (0..periods).map(|p| f((k + p * n) as f64)).sum::<f64>();
                means[k] = sum / periods as f64;
            }
            means[k % n]
        })
    }

    /// For deviations from friction that is multiplied by the mean of f over the whole record, with `periods` of the
    /// velocities `qd_rad_s` and an exponential that fades within the share `fades` of the record. The mean over the
    /// periods is no such friction: f, and the mean with it, changes within a period.
    pub(super) fn fading_beside_average(
        qd_rad_s: &JointSignals,
        periods: usize,
        fades: f64,
    ) -> Self {
        let all = qd_rad_s.map_joints(|_, qd| qd.repeat(periods));
        let samples = all.samples();
        // The first sample comes first and computes the average of its course.
        let mut average = 0.0;
        Self::new(all, fades, |f, k| {
            if k == 0 {
                average = (0..samples).map(|k| f(k as f64)).sum::<f64>() / samples as f64;
            }
            average
        })
    }

    /// `common(f, k)` is what the repetitions of the course `f` have in common at the phase of sample `k`.
    fn new(
        qd_rad_s: JointSignals,
        fades: f64,
        mut common: impl FnMut(&dyn Fn(f64) -> f64, usize) -> f64,
    ) -> Self {
        let n = qd_rad_s.samples();
        let fade = |t: f64| (-t / (fades * n as f64)).exp();
        let line = |t: f64| t / n as f64;
        let mut course =
            |f: &dyn Fn(f64) -> f64| (0..n).map(|k| f(k as f64) - common(f, k)).collect();
        Self { courses: [course(&fade), course(&line)], qd_rad_s }
    }

    /// Subtracts the drift from the deviations `y` of joint `j`, as fitted to the samples that are `used`.
    pub fn remove(&self, j: usize, y: &mut [f64], used: impl Fn(usize) -> bool) {
        let Some(b) = self.coefficients(j, y, used) else { return };
        for (k, y) in y.iter_mut().enumerate() {
            *y -= self.row(j, k).dot(&b);
        }
    }

    /// Coefficients of the four columns of joint `j`, as fitted to the samples of `y` that are `used`; `None` for a
    /// joint that stands still.
    pub(super) fn coefficients(
        &self,
        j: usize,
        y: &[f64],
        used: impl Fn(usize) -> bool,
    ) -> Option<SVector<f64, COLUMNS>> {
        let gram = self.gram(j, &used)?;
        let mut right = SVector::<f64, COLUMNS>::zeros();
        for (k, y) in y.iter().enumerate().filter(|(k, _)| used(*k)) {
            right += self.row(j, k) * *y;
        }
        Some(gram.solve(&right))
    }

    /// The sum of the four columns of joint `j` with the coefficients `b`, at every sample.
    pub(super) fn sum(&self, j: usize, b: &SVector<f64, COLUMNS>) -> Vec<f64> {
        (0..self.qd_rad_s.samples()).map(|k| self.row(j, k).dot(b)).collect()
    }

    /// The four columns of joint `j` over the first period of `n` samples, one after the other.
    pub(super) fn first_period(&self, j: usize, n: usize) -> Vec<f64> {
        let rows: Vec<SVector<f64, COLUMNS>> = (0..n).map(|k| self.row(j, k)).collect();
        (0..COLUMNS).flat_map(|c| rows.iter().map(move |row| row[c])).collect()
    }

    /// Factors from the columns of the first period of `n` samples to those of every period, for deviations from the
    /// mean over the periods. Both courses have them: from period to period, a straight line grows by a constant and
    /// an exponential by a factor.
    pub(super) fn growth(&self, n: usize) -> Vec<SVector<f64, COLUMNS>> {
        let of_period = |k: usize| -> SVector<f64, COLUMNS> {
            let [fade, line] = self.courses.each_ref().map(|course| course[k] / course[0]);
            [fade, fade, line, line].into()
        };
        (0..self.qd_rad_s.samples()).step_by(n).map(of_period).collect()
    }

    /// The part of a torque of joint `j` that acts against its motion, as the mean while it moves. `torque_nm` are
    /// samples from the first one on.
    pub(super) fn against_motion(&self, j: usize, torque_nm: &[f64]) -> f64 {
        let (mut along, mut squares) = (0.0, 0.0);
        for (torque, qd) in torque_nm.iter().zip(self.qd_rad_s.joint(j)) {
            let sign = (qd / STANDSTILL_RAD_S).tanh();
            along += sign * torque;
            squares += sign * sign;
        }
        along / squares
    }

    /// Orthonormal basis of the deviations of joint `j` that [`Self::remove`] removes completely, by sample.
    pub fn directions(&self, j: usize) -> Vec<Vec<f64>> {
        let whitened = self.gram(j, |_| true).and_then(|gram| gram.l().try_inverse());
        let Some(inverse) = whitened else { return Vec::new() };
        let of = |row: SVector<f64, COLUMNS>| -> Vec<f64> {
            (0..self.qd_rad_s.samples()).map(|k| row.dot(&self.row(j, k))).collect()
        };
        inverse.row_iter().map(|row| of(row.transpose())).collect()
    }

    /// Share of the standard deviation of white noise that [`Self::remove`] leaves in the deviations of joint `j`, for
    /// every harmonic of a period of `n` samples. `spectrum` are the unitary Fourier coefficients of one period.
    pub fn kept(
        &self,
        j: usize,
        n: usize,
        spectrum: impl Fn(&[f64]) -> Vec<Complex<f64>>,
    ) -> Vec<f64> {
        let freedom = (self.qd_rad_s.samples() / n - 1) as f64;
        let mut lost = vec![0.0; n / 2 + 1];
        for direction in self.directions(j) {
            for period in direction.chunks_exact(n) {
                let spectrum = spectrum(period);
                lost.iter_mut().zip(&spectrum).for_each(|(lost, c)| *lost += c.norm_sqr());
            }
        }
        let share = |lost: &f64| (1.0 - lost / freedom).max(LEAST_KEPT).sqrt();
        lost.iter().map(share).collect()
    }

    /// The four columns at sample `k` of joint `j`.
    fn row(&self, j: usize, k: usize) -> SVector<f64, COLUMNS> {
        let qd = self.qd_rad_s.joint(j)[k];
        let friction = [(qd / STANDSTILL_RAD_S).tanh(), qd];
        let [fade, line] = [self.courses[0][k], self.courses[1][k]];
        [friction[0] * fade, friction[1] * fade, friction[0] * line, friction[1] * line].into()
    }

    /// Gram matrix of the samples that are `used`; `None` for a joint that stands still, which has no friction that
    /// could drift.
    fn gram(
        &self,
        j: usize,
        used: impl Fn(usize) -> bool,
    ) -> Option<Cholesky<f64, Const<COLUMNS>>> {
        let mut gram = SMatrix::<f64, COLUMNS, COLUMNS>::zeros();
        for k in (0..self.qd_rad_s.samples()).filter(|k| used(*k)) {
            let x = self.row(j, k);
            gram += x * x.transpose();
        }
        gram.cholesky()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A straight course is removed completely: its trimmed mean over the other periods is what the columns assume.
    #[test]
    fn friction_that_grows_evenly_is_taken_out() {
        let (n, period) = (800, 100);
        let omega = std::f64::consts::TAU / period as f64;
        let qd = JointSignals::from_fn(1, n, |_, k| (omega * k as f64).sin());
        let friction = |k: usize| 2.0 * (qd.joint(0)[k] / 0.02).tanh() + 0.5 * qd.joint(0)[k];
        let torque = |k: usize| (1.0 + 1e-3 * k as f64) * friction(k);
        let deviation = |k: usize| {
            let (own, phase) = (k / period, k % period);
            let mut others: Vec<f64> =
                (0..8).filter(|p| *p != own).map(|p| torque(phase + p * period)).collect();
            torque(k) - trimmed_mean(&mut others).unwrap()
        };
        let mut y: Vec<f64> = (0..n).map(deviation).collect();
        let largest = |y: &[f64]| y.iter().fold(0.0f64, |a, y| a.max(y.abs()));
        assert!(largest(&y) > 0.9);
        FrictionDrift::beside_others(qd.clone(), period as f64).remove(0, &mut y, |_| true);
        assert!(largest(&y) < 1e-9, "{}", largest(&y));
        let period_qd = qd.slice(0..period);
        let mut y: Vec<f64> = (0..n).map(torque).collect();
        FrictionDrift::beside_mean(&period_qd, n / period).remove(0, &mut y, |_| true);
        let repeats = |k: usize| (y[k] - y[k % period]).abs();
        assert!((0..n).map(repeats).fold(0.0, f64::max) < 1e-9);
    }

    /// Friction that grows evenly along four periods. Beside its average, what is taken out leaves friction that is the
    /// same throughout; beside the mean over the periods, friction that grows within each of them.
    #[test]
    fn beside_the_average_friction_stays_the_same() {
        let (n, periods) = (200, 4);
        let omega = std::f64::consts::TAU / n as f64;
        let qd = JointSignals::from_fn(1, n, |_, k| (omega * k as f64).sin());
        let friction =
            |k: usize| 2.0 * (qd.joint(0)[k % n] / 0.02).tanh() + 0.5 * qd.joint(0)[k % n];
        let growth = |k: usize| 1.0 + 1e-3 * k as f64;
        let y: Vec<f64> = (0..n * periods).map(|k| growth(k) * friction(k)).collect();
        let mean = FrictionDrift::beside_mean(&qd, periods);
        let average = FrictionDrift::fading_beside_average(&qd, periods, FADES);
        let b = mean.coefficients(0, &y, |_| true).unwrap();
        let drift = average.sum(0, &b);
        // Mean of the growth over the samples 0 to 799.
        let common = 1.0 + 1e-3 * 399.5;
        for (k, drift) in drift.iter().enumerate() {
            assert!((y[k] - drift - common * friction(k)).abs() < 1e-9, "{k}");
        }
        // The last period has 0.6 of the friction at the start more than the first one.
        let [first, last] =
            [0, n * (periods - 1)].map(|k| mean.against_motion(0, &drift[k..k + n]));
        let own = mean.against_motion(0, &y[..n]) - first;
        assert!(((last - first) / own - 0.6 / common).abs() < 1e-9, "{first} {last} {own}");
    }

    /// In the real rows of all harmonics together, four of the degrees of freedom of white noise are lost.
    #[test]
    fn the_lost_shares_add_up_to_the_four_columns() {
        let (n, periods) = (200, 8);
        let omega = std::f64::consts::TAU / n as f64;
        let qd = JointSignals::from_fn(1, n, |_, k| (omega * k as f64).sin());
        let forward = fourier::forward(n);
        let spectrum = |period: &[f64]| {
            let mut out = forward.make_output_vec();
            forward.process(&mut period.to_vec(), &mut out).unwrap();
            out.iter_mut().for_each(|c| *c /= (n as f64).sqrt());
            out
        };
        let kept = FrictionDrift::beside_mean(&qd, periods).kept(0, n, spectrum);
        let lost = |k: usize| (periods - 1) as f64 * (1.0 - kept[k] * kept[k]);
        let ends = lost(0) + lost(n / 2);
        let all = ends + 2.0 * (1..n / 2).map(lost).sum::<f64>();
        assert!((all - COLUMNS as f64).abs() < 1e-9, "{all}");
        // Half of it is in the harmonic of the velocity, which has two rows.
        assert!(lost(1) > 0.9 && lost(2) < 0.1, "{} {}", lost(1), lost(2));
    }

    #[test]
    fn columns_of_all_periods_are_multiples_of_those_of_the_first() {
        let (n, periods) = (50, 5);
        let omega = std::f64::consts::TAU / n as f64;
        let qd = JointSignals::from_fn(2, n, |j, k| (omega * (1 + j) as f64 * k as f64).cos());
        let drift = FrictionDrift::beside_mean(&qd, periods);
        let first = drift.first_period(1, n);
        for (p, growth) in drift.growth(n).iter().enumerate() {
            for (c, growth) in growth.iter().enumerate() {
                for k in 0..n {
                    let direct = drift.row(1, p * n + k)[c];
                    assert!((growth * first[c * n + k] - direct).abs() < 1e-12, "{p} {c} {k}");
                }
            }
        }
    }

    /// The directions are orthonormal, and nothing of them is left after removal.
    #[test]
    fn directions_are_what_is_removed() {
        let (n, periods) = (200, 4);
        let omega = std::f64::consts::TAU / n as f64;
        let qd = JointSignals::from_fn(1, n, |_, k| (omega * k as f64).sin());
        let drift = FrictionDrift::beside_mean(&qd, periods);
        let directions = drift.directions(0);
        assert_eq!(directions.len(), COLUMNS);
        for (i, a) in directions.iter().enumerate() {
            for (k, b) in directions.iter().enumerate() {
                let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                assert!((product - f64::from(u8::from(i == k))).abs() < 1e-9, "{i} {k} {product}");
            }
            let mut left = a.clone();
            drift.remove(0, &mut left, |_| true);
            assert!(left.iter().all(|left| left.abs() < 1e-9));
        }
    }
}
