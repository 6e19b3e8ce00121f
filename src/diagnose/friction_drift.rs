//! Friction that changes slowly between repetitions: neither noise nor contact, however large it is.
//!
//! If the friction φ of a joint is multiplied by f(t) at time t, a sample differs by φ (f(t) − f̄) from what the
//! repetitions have in common at its phase, which is their mean or the trimmed mean of the other periods. φ is a
//! combination of sign q̇ and q̇, and f a combination of a straight line and an exponential with a quarter of the
//! record as its time constant. The coefficients of the four products are found by least squares. They hardly fit a
//! push, which comes once and has one direction. They take four of the thousands of degrees of freedom of the noise;
//! but of eight periods they take 5 to 15 % of those in the slow harmonics, where the velocity lives.

use nalgebra::{Cholesky, Const, SMatrix, SVector};

use crate::median::trimmed_mean;
use crate::robot::JointSignals;
use crate::signal::other_periods;

/// Velocity over which dry friction builds up, rad/s.
const STANDSTILL_RAD_S: f64 = 0.02;
/// Time constant of the exponential, as a share of the record.
const FADES: f64 = 0.25;
/// Number of friction laws times the number of courses in time.
const COLUMNS: usize = 4;

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
        Self::new(qd_rad_s, |f, k| {
            same.clear();
            same.extend(other_periods(k, period, samples).map(f));
            trimmed_mean(&mut same).unwrap_or(f(k as f64))
        })
    }

    /// For deviations from the mean over all `periods`, each with the velocities `qd_rad_s`.
    pub fn beside_mean(qd_rad_s: &JointSignals, periods: usize) -> Self {
        let n = qd_rad_s.samples();
        let all = qd_rad_s.map_joints(|_, qd| qd.repeat(periods));
        Self::new(all, |f, k| {
            (0..periods).map(|p| f((k % n + p * n) as f64)).sum::<f64>() / periods as f64
        })
    }

    /// `common(f, k)` is what the repetitions of the course `f` have in common at the phase of sample `k`.
    fn new(
        qd_rad_s: JointSignals,
        mut common: impl FnMut(&dyn Fn(f64) -> f64, usize) -> f64,
    ) -> Self {
        let n = qd_rad_s.samples();
        let fade = |t: f64| (-t / (FADES * n as f64)).exp();
        let line = |t: f64| t / n as f64;
        let mut course =
            |f: &dyn Fn(f64) -> f64| (0..n).map(|k| f(k as f64) - common(f, k)).collect();
        Self { courses: [course(&fade), course(&line)], qd_rad_s }
    }

    /// Subtracts the drift from the deviations `y` of joint `j`, as fitted to the samples that are `used`.
    pub fn remove(&self, j: usize, y: &mut [f64], used: impl Fn(usize) -> bool) {
        let Some(gram) = self.gram(j, &used) else { return };
        let mut right = SVector::<f64, COLUMNS>::zeros();
        for (k, y) in y.iter().enumerate().filter(|(k, _)| used(*k)) {
            right += self.row(j, k) * *y;
        }
        let b = gram.solve(&right);
        for (k, y) in y.iter_mut().enumerate() {
            *y -= self.row(j, k).dot(&b);
        }
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
