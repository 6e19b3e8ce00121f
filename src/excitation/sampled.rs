//! A recorded motion, used as a reference.

use super::reference::Reference;
use crate::dynamics::Motion;

/// Samples of a motion joined by polynomials of fifth degree, each of which matches angle, velocity and acceleration of
/// the two samples at its ends.
///
/// With u ∈ [0, 1] between two samples that are h apart, let d, e, f be the differences between the second sample and
/// the parabola from the first one, in q, h q̇ and h² q̈:
///
/// ```text
/// q(u) = q₀ + h q̇₀ u + ½ h² q̈₀ u² + (10 d − 4 e + f/2) u³ − (15 d − 7 e + f) u⁴ + (6 d − 3 e + f/2) u⁵
/// ```
///
/// so that the velocity is the derivative of the angle everywhere, and the acceleration is that of the velocity,
/// without jumps.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledMotion {
    motion: Motion,
    rate_hz: f64,
    /// Whether the motion repeats, so that the first sample follows the last.
    repeats: bool,
    /// Sample at which the reference starts; negative: before the first one.
    first: f64,
    duration_s: f64,
}

impl SampledMotion {
    /// Repeats one period of a motion for `duration_s`, starting `lead_s` before its first sample.
    pub fn repeating(motion: Motion, rate_hz: f64, lead_s: f64, duration_s: f64) -> Self {
        Self { motion, rate_hz, repeats: true, first: -lead_s * rate_hz, duration_s }
    }

    /// Plays a motion once, from its first sample to its last.
    pub fn once(motion: Motion, rate_hz: f64) -> Self {
        let duration_s = motion.samples().saturating_sub(1) as f64 / rate_hz;
        Self { motion, rate_hz, repeats: false, first: 0.0, duration_s }
    }

    /// The samples before and after position `x` on the grid, and the fraction of the way between them. Beyond the ends
    /// of a motion that does not repeat, the state at the end is held.
    fn stretch(&self, x: f64) -> (usize, usize, f64) {
        let n = self.motion.samples();
        if self.repeats {
            let x = x.rem_euclid(n as f64);
            let left = (x.floor() as usize).min(n - 1);
            return (left, (left + 1) % n, x - left as f64);
        }
        let x = x.clamp(0.0, (n - 1) as f64);
        let left = (x.floor() as usize).min(n.saturating_sub(2));
        (left, (left + 1).min(n - 1), x - left as f64)
    }
}

impl Reference for SampledMotion {
    fn joints(&self) -> usize {
        self.motion.joints()
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        // Without samples there is no motion.
        if self.motion.samples() == 0 {
            [q_rad, qd_rad_s, qdd_rad_s2].into_iter().for_each(|out| out.fill(0.0));
            return;
        }
        let (left, right, u) = self.stretch(self.first + t_s * self.rate_hz);
        let h = 1.0 / self.rate_hz;
        for j in 0..q_rad.len() {
            let [q, v, a] = [&self.motion.q_rad, &self.motion.qd_rad_s, &self.motion.qdd_rad_s2]
                .map(|signals| signals.joint(j));
            let (v0, a0) = (h * v[left], h * h * a[left]);
            let d = q[right] - q[left] - v0 - 0.5 * a0;
            let e = h * v[right] - v0 - a0;
            let f = h * h * a[right] - a0;
            let c3 = 10.0 * d - 4.0 * e + 0.5 * f;
            let c4 = -15.0 * d + 7.0 * e - f;
            let c5 = 6.0 * d - 3.0 * e + 0.5 * f;
            q_rad[j] = q[left] + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))));
            qd_rad_s[j] = (v0 + u * (a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h;
            qdd_rad_s2[j] = (a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (h * h);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::FourierSeries;
    use crate::robot::JointSignals;

    fn at(r: &impl Reference, t: f64) -> [Vec<f64>; 3] {
        let [mut q, mut qd, mut qdd] = std::array::from_fn(|_| vec![0.0; r.joints()]);
        r.sample(t, &mut q, &mut qd, &mut qdd);
        [q, qd, qdd]
    }

    fn sampled(series: &FourierSeries, rate_hz: f64) -> Motion {
        let n = (series.period_s * rate_hz).round() as usize;
        let pick = |d: usize| {
            JointSignals::from_fn(series.joints(), n, |j, k| at(series, k as f64 / rate_hz)[d][j])
        };
        Motion { q_rad: pick(0), qd_rad_s: pick(1), qdd_rad_s2: pick(2) }
    }

    /// Between samples the error of q is at most max|q⁽⁶⁾| h⁶ / 46080 (Hermite's remainder): with
    /// ω L ≤ 6 rad/s, |q̇| < 4 rad/s and h = 8 ms below 1e-13 rad; that of q̈ is larger by about 1e3/h².
    #[test]
    fn a_smooth_motion_comes_back_between_its_samples() {
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        let rate_hz = 125.0;
        let lead_s = 2.0;
        let again = SampledMotion::repeating(sampled(&series, rate_hz), rate_hz, lead_s, 20.0);
        for k in 0..500 {
            let t = 0.0371 * k as f64;
            let (truth, found) = (at(&series, t), at(&again, t + lead_s));
            for (d, tolerance) in [(0, 1e-12), (1, 1e-9), (2, 1e-6)] {
                for (x, y) in truth[d].iter().zip(&found[d]) {
                    assert!((x - y).abs() < tolerance, "t = {t}, derivative {d}: {x} {y}");
                }
            }
        }
    }

    #[test]
    fn a_single_run_ends_where_it_ends() {
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        let once = SampledMotion::once(sampled(&series, 125.0), 125.0);
        assert_eq!(once.duration_s(), series.period_s - 0.008);
        let (end, truth) = (at(&once, once.duration_s()), at(&series, once.duration_s()));
        for (x, y) in end.iter().flatten().zip(truth.iter().flatten()) {
            assert!((x - y).abs() < 1e-9, "{x} {y}");
        }
        // The motion stays there, as it stays at its beginning.
        assert_eq!(at(&once, once.duration_s() + 1.0), end);
        assert_eq!(at(&once, -1.0), at(&once, 0.0));
    }

    #[test]
    fn a_motion_of_one_sample_or_none_stands_still() {
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        let all = sampled(&series, 125.0);
        let first = |n: usize| Motion {
            q_rad: all.q_rad.slice(0..n),
            qd_rad_s: all.qd_rad_s.slice(0..n),
            qdd_rad_s2: all.qdd_rad_s2.slice(0..n),
        };
        let one = SampledMotion::once(first(1), 125.0);
        assert_eq!(at(&one, 0.5), at(&one, 0.0));
        let repeated = SampledMotion::repeating(first(0), 125.0, 0.0, 1.0);
        for none in [SampledMotion::once(first(0), 125.0), repeated] {
            assert_eq!(at(&none, 0.5), [[0.0; 6]; 3].map(|zeros| zeros.to_vec()));
        }
    }
}
