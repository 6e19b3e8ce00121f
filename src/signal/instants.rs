//! Interpolates signals between the time stamps of a log.

use super::error::{SignalError, same};
use super::resample::check_time;
use crate::robot::JointSignals;

/// The position of an instant: the row before it, and the fraction of the way to the next row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bracket {
    /// Row at or before the instant.
    pub left: usize,
    /// Fraction of the way to the next row: 0 at `left`, always below 1.
    pub u: f64,
}

/// Instants between the time stamps of a log, at which any number of signals can be interpolated.
#[derive(Debug, Clone, PartialEq)]
pub struct Instants {
    source_s: Vec<f64>,
    places: Vec<Bracket>,
}

impl Instants {
    /// Locates `instants` among the strictly increasing `time_s`; instants outside are moved to the nearest end.
    pub fn new(time_s: &[f64], instants: impl Iterator<Item = f64>) -> Result<Self, SignalError> {
        check_time(time_s)?;
        let last = time_s.len() - 1;
        let place = |t: f64| match time_s.partition_point(|s| *s <= t) {
            0 => Bracket { left: 0, u: 0.0 },
            right if right > last => Bracket { left: last, u: 0.0 },
            right => {
                let step_s = time_s[right] - time_s[right - 1];
                Bracket { left: right - 1, u: (t - time_s[right - 1]) / step_s }
            }
        };
        Ok(Self { places: instants.map(place).collect(), source_s: time_s.to_vec() })
    }

    /// From positions that are already known.
    pub(super) fn of(source_s: Vec<f64>, places: Vec<Bracket>) -> Self {
        Self { source_s, places }
    }

    /// Positions of the instants among the time stamps.
    pub fn places(&self) -> &[Bracket] {
        &self.places
    }

    /// Linear interpolation: for signals that jump, such as currents.
    pub fn linear(&self, y: &[f64]) -> Result<Vec<f64>, SignalError> {
        self.check(y)?;
        Ok(self.places.iter().map(|p| lerp(y, p)).collect())
    }

    /// Piecewise cubic interpolation with the known slope at every time stamp: for angles with their velocity.
    ///
    /// Error for a smooth y: at most step⁴/384 · max|y⁗|.
    pub fn hermite(&self, y: &[f64], slope_per_s: &[f64]) -> Result<Vec<f64>, SignalError> {
        self.check(y)?;
        self.check(slope_per_s)?;
        Ok(self.places.iter().map(|p| self.cubic(y, slope_per_s, p)).collect())
    }

    /// Piecewise cubic interpolation that never overshoots the samples: for smooth signals without known slope.
    ///
    /// The slopes are weighted harmonic means of the neighbouring difference quotients, and zero at extrema (F. Fritsch
    /// and J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300–304).
    pub fn monotone(&self, y: &[f64]) -> Result<Vec<f64>, SignalError> {
        self.check(y)?;
        let slopes = monotone_slopes(&self.source_s, y);
        Ok(self.places.iter().map(|p| self.cubic(y, &slopes, p)).collect())
    }

    /// Interpolates angles by [`Self::hermite`], with their velocities as slopes.
    pub fn angles(
        &self,
        q_rad: &JointSignals,
        qd_rad_s: &JointSignals,
    ) -> Result<JointSignals, SignalError> {
        same("joints of angle and velocity", q_rad.joints(), qd_rad_s.joints())?;
        self.all_joints(q_rad, |j, q| self.hermite(q, qd_rad_s.joint(j)))
    }

    /// Interpolates every joint by [`Self::monotone`].
    pub fn smooth(&self, y: &JointSignals) -> Result<JointSignals, SignalError> {
        self.all_joints(y, |_, series| self.monotone(series))
    }

    /// Interpolates every joint by [`Self::linear`].
    pub fn straight(&self, y: &JointSignals) -> Result<JointSignals, SignalError> {
        self.all_joints(y, |_, series| self.linear(series))
    }

    fn all_joints(
        &self,
        y: &JointSignals,
        f: impl Fn(usize, &[f64]) -> Result<Vec<f64>, SignalError>,
    ) -> Result<JointSignals, SignalError> {
        let mut out = JointSignals::zeros(y.joints(), self.places.len());
        for j in 0..y.joints() {
            out.joint_mut(j).copy_from_slice(&f(j, y.joint(j))?);
        }
        Ok(out)
    }

    fn check(&self, y: &[f64]) -> Result<(), SignalError> {
        same("values for the time stamps", self.source_s.len(), y.len())
    }

    fn cubic(&self, y: &[f64], slope: &[f64], p: &Bracket) -> f64 {
        if p.u == 0.0 {
            return y[p.left];
        }
        let (i, u) = (p.left, p.u);
        let h = self.source_s[i + 1] - self.source_s[i];
        let rise = y[i + 1] - y[i];
        let (bend_0, bend_1) = (h * slope[i] - rise, h * slope[i + 1] - rise);
        lerp(y, p) + u * (1.0 - u) * ((1.0 - u) * bend_0 - u * bend_1)
    }
}

/// Linear interpolation of y at the fractional sample `at`.
pub fn linear_at(y: &[f64], at: f64) -> f64 {
    let left = (at.floor() as usize).min(y.len() - 2);
    lerp(y, &Bracket { left, u: at - left as f64 })
}

/// Cubic interpolation of y at the fractional sample `at`, from two samples on either side (Catmull and Rom 1974);
/// linear if one of them is missing.
pub fn cubic_at(y: &[f64], at: f64) -> f64 {
    let left = at.floor() as usize;
    if left == 0 || left + 2 >= y.len() {
        return linear_at(y, at);
    }
    let u = at - left as f64;
    let [a, b, c, d] = [y[left - 1], y[left], y[left + 1], y[left + 2]];
    b + 0.5 * u * (c - a + u * (2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a)))
}

fn lerp(y: &[f64], p: &Bracket) -> f64 {
    if p.u == 0.0 { y[p.left] } else { y[p.left] + p.u * (y[p.left + 1] - y[p.left]) }
}

fn monotone_slopes(t: &[f64], y: &[f64]) -> Vec<f64> {
    let n = y.len();
    let step = |i: usize| t[i + 1] - t[i];
    let secant = |i: usize| (y[i + 1] - y[i]) / step(i);
    if n == 2 {
        return vec![secant(0); 2];
    }
    let inner = |i: usize| {
        let (left, right) = (secant(i - 1), secant(i));
        if left * right <= 0.0 {
            return 0.0;
        }
        let (w1, w2) = (2.0 * step(i) + step(i - 1), step(i) + 2.0 * step(i - 1));
        (w1 + w2) / (w1 / left + w2 / right)
    };
    // Three-point formula at the ends, limited so that the curve does not leave the range of the samples.
    let end = |h0: f64, h1: f64, d0: f64, d1: f64| {
        let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
        if slope * d0 <= 0.0 {
            0.0
        } else if d0 * d1 <= 0.0 && slope.abs() > 3.0 * d0.abs() {
            3.0 * d0
        } else {
            slope
        }
    };
    let mut slopes = Vec::with_capacity(n);
    slopes.push(end(step(0), step(1), secant(0), secant(1)));
    slopes.extend((1..n - 1).map(inner));
    slopes.push(end(step(n - 2), step(n - 3), secant(n - 2), secant(n - 3)));
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_itself_between_its_samples() {
        let parabola = |x: f64| 2.0 - 3.0 * x + 0.5 * x * x;
        let y: Vec<f64> = (0..9).map(|k| parabola(k as f64)).collect();
        for at in [1.0, 2.25, 4.5, 6.875] {
            assert!((cubic_at(&y, at) - parabola(at)).abs() < 1e-12, "{at}");
        }
        for (at, by_hand) in [(0.5, 0.5 * (y[0] + y[1])), (7.25, 0.75 * y[7] + 0.25 * y[8])] {
            assert!((cubic_at(&y, at) - by_hand).abs() < 1e-12, "{at}");
            assert!((linear_at(&y, at) - by_hand).abs() < 1e-12, "{at}");
        }
        assert_eq!([cubic_at(&y, 8.0), linear_at(&y, 8.0)], [y[8]; 2]);
    }
}
