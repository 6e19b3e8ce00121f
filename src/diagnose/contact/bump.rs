//! Begin, height and end of a push of unknown shape.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::diagnose::verdict::Estimate;
use crate::signal::{Heights, MatchedFilter};

/// Exponents p of (1 − u²)^p, |u| < 1: from a push with an abrupt onset to one that swells softly.
const SHAPES: [f64; 4] = [0.5, 1.0, 2.0, 3.0];
/// The shape with which bumps are searched for.
pub(super) const ORDINARY: f64 = 1.0;
/// Lengths at which a bump is evaluated around the first guess: steps in ln, and number of steps to either side.
const STEP: f64 = 0.07;
const STEPS: i32 = 9;
/// Number of further steps to longer bumps, as long as the longest is the best. The chance of noise whose power is not
/// known limits how significant a bump can be, and the more so the longer it is: a strong push is found as a bump of a
/// third of its length.
const FURTHER: i32 = 20;
/// A joint on which a push was evaluated feels it if it shows this many σ of it, which noise does in one of 370 joints,
/// and the share `FELT_SHARE` of the σ of the joint that feels it most: an arm that yields moves the other joints a
/// little.
const FELT: f64 = 3.0;
pub(super) const FELT_SHARE: f64 = 0.1;
/// Heights are clipped at this many σ for the correlation between joints.
const CLIPPED: f64 = 3.0;
/// 95 % quantile of χ² with one degree of freedom.
const CHI2_95: f64 = 3.841_458_820_694_1;
/// Its 99.5 % quantile: a shape is excluded if it is that far behind the best one, …
const EXCLUDED: f64 = 7.88;
/// … and if it is behind by this share of what the best one explains. The second condition is needed because no shape
/// is exactly that of the push in the log, after the drive has answered and the links have yielded: without it, the
/// begin of a strong push was stated to 3 ms where it was off by 120 ms.
const UNLIKE: f64 = 0.1;

/// Value of a bump of length `length_s` at the distance `t_s` from its centre, where it is 1.
pub(super) fn bump(shape: f64, length_s: f64, t_s: f64) -> f64 {
    let u = 2.0 * t_s / length_s;
    (1.0 - u * u).max(0.0).powf(shape)
}

/// Noise of the heights of bumps in several joints.
pub(super) struct Noise {
    /// Factor of each joint by which the σ = 1/√N of [`MatchedFilter`] has to be multiplied.
    scale: Vec<f64>,
    /// Degrees of freedom with which this factor is known.
    freedom: Vec<f64>,
    /// Correlation between the joints.
    correlation: DMatrix<f64>,
    /// Its inverse.
    precision: DMatrix<f64>,
}

impl Noise {
    /// Estimates the noise from the heights of bumps of one length at all samples, few of which contain a bump.
    pub(super) fn of(heights: &Heights) -> Self {
        let joints = heights.height.joints();
        let scale: Vec<f64> = (0..joints).map(|j| heights.scale(j)).collect();
        let clipped: Vec<Vec<f64>> = (0..joints)
            .map(|j| {
                let sigma = scale[j] / heights.information[j].sqrt();
                let z = |h: &f64| if sigma > 0.0 { h / sigma } else { 0.0 };
                heights.height.joint(j).iter().map(|h| z(h).clamp(-CLIPPED, CLIPPED)).collect()
            })
            .collect();
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let size: Vec<f64> = clipped.iter().map(|z| product(z, z).sqrt()).collect();
        let correlation = DMatrix::from_fn(joints, joints, |i, j| match size[i] * size[j] {
            _ if i == j => 1.0,
            0.0 => 0.0,
            both => product(&clipped[i], &clipped[j]) / both,
        });
        let freedom = heights.freedom.clone();
        Self { scale, freedom, precision: inverse(correlation.clone()), correlation }
    }

    /// Heights at one sample in units of their σ.
    pub(super) fn scores(&self, heights: &Heights, sample: usize) -> Vec<f64> {
        let score = |(j, scale): (usize, &f64)| {
            let height = heights.height.joint(j)[sample];
            if *scale > 0.0 { height * heights.information[j].sqrt() / scale } else { 0.0 }
        };
        self.scale.iter().enumerate().map(score).collect()
    }

    /// zᵀ C⁻¹ z: twice the gain in log-likelihood of a bump in all signals, and an upper bound for bumps in some of
    /// them.
    pub(super) fn gain(&self, z: &[f64]) -> f64 {
        let n = z.len();
        (0..n).map(|i| (0..n).map(|j| z[i] * self.precision[(i, j)] * z[j]).sum::<f64>()).sum()
    }

    /// Noise model for bumps that the signals `felt` feel and the signals `quiet` do not.
    pub(super) fn felt_by(&self, felt: &[usize], quiet: &[usize]) -> Felt<'_> {
        let signals = [felt, quiet].concat();
        let correlation = self.correlation.select_rows(&signals).select_columns(&signals);
        let precision = inverse(correlation).rows(0, felt.len()).into_owned();
        let covariance = inverse(precision.columns(0, felt.len()).into_owned());
        Felt { noise: self, signals, precision, covariance }
    }
}

/// Inverse of a correlation matrix or of a part of it; the identity where it is singular.
fn inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    matrix.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n))
}

/// Noise model for a bump that some signals feel, F, and others do not. With their scores z, their correlation C and
/// P = C⁻¹, the heights on F, in units of their σ, are b = P_FF⁻¹ (P z)_F: the noise that is predicted from the other
/// signals is removed. Their covariance is P_FF⁻¹, and twice the gain in log-likelihood is (P z)_Fᵀ b.
pub(super) struct Felt<'a> {
    noise: &'a Noise,
    /// F, followed by the other signals.
    signals: Vec<usize>,
    /// Rows F of P.
    precision: DMatrix<f64>,
    /// P_FF⁻¹.
    covariance: DMatrix<f64>,
}

impl Felt<'_> {
    /// The signals F that feel the bump.
    pub(super) fn felt(&self) -> &[usize] {
        &self.signals[..self.count()]
    }

    /// Number of signals that feel the bump.
    pub(super) fn count(&self) -> usize {
        self.covariance.nrows()
    }

    /// Element of P z for the a-th signal that feels the bump.
    fn weighed(&self, a: usize, z: &[f64]) -> f64 {
        self.signals.iter().enumerate().map(|(b, j)| self.precision[(a, b)] * z[*j]).sum()
    }

    /// Twice the gain in log-likelihood by the bump.
    pub(super) fn gain(&self, z: &[f64]) -> f64 {
        (0..self.count()).map(|a| self.weighed(a, z) * self.score(a, z)).sum()
    }

    /// The equally improbable gain if the noise were known. With k signals, and ν degrees of freedom for the noise of
    /// the least known one, (ν + k/2 − 1) ln(1 + gain/ν) is χ²ₖ (Bartlett 1938).
    pub(super) fn of_known_noise(&self, gain: f64) -> f64 {
        let k = self.count() as f64;
        let freedom = self.felt().iter().map(|j| self.noise.freedom[*j]).fold(f64::MAX, f64::min);
        (freedom + 0.5 * k - 1.0) * (gain / freedom).ln_1p()
    }

    /// Height on the a-th signal that feels the bump, in units of the σ that it would have without the other signals.
    fn score(&self, a: usize, z: &[f64]) -> f64 {
        (0..self.count()).map(|b| self.covariance[(a, b)] * self.weighed(b, z)).sum()
    }

    /// Heights on the signals that feel the bump, and their σ.
    fn heights(&self, heights: &Heights, sample: usize) -> Vec<[f64; 2]> {
        let z = self.noise.scores(heights, sample);
        let height = |(a, j): (usize, &usize)| {
            let unit = self.noise.scale[*j] / heights.information[*j].sqrt();
            [self.score(a, &z) * unit, self.covariance[(a, a)].sqrt() * unit]
        };
        self.felt().iter().enumerate().map(height).collect()
    }
}

/// A push as far as the log determines it.
pub(super) struct Push {
    /// Seconds from the first sample.
    pub(super) start_s: Estimate,
    pub(super) end_s: Estimate,
    /// Peak torque of the joint that feels it most, Nm, and that joint (0-based).
    pub(super) peak_nm: Estimate,
    pub(super) peak_joint: usize,
    /// Joints (0-based) on which it was evaluated, with its height and the σ of that, Nm.
    heights_nm: Vec<(usize, [f64; 2])>,
    /// Joints (0-based) that feel it.
    pub(super) felt: Vec<usize>,
    /// Twice its gain in log-likelihood.
    pub(super) gain: f64,
    /// Confidence that something pushed.
    pub(super) confidence: f64,
    shape: f64,
}

impl Push {
    /// Extends the intervals of begin and end to contain those of `other`.
    pub(super) fn reach_over(&mut self, other: &Self) {
        for bound in other.start_s.ci95 {
            self.start_s.reach(bound);
        }
        for bound in other.end_s.ci95 {
            self.end_s.reach(bound);
        }
    }

    /// Whether joint `joint` (0-based) feels the push.
    pub(super) fn is_felt_on(&self, joint: usize) -> bool {
        self.felt.contains(&joint)
    }

    /// Joints (0-based) that feel the push, in order, with its height, Nm.
    pub(super) fn felt_nm(&self) -> impl Iterator<Item = (usize, f64)> {
        let felt = self.heights_nm.iter().filter(|(j, _)| self.is_felt_on(*j));
        felt.map(|(j, [height, _])| (*j, *height))
    }

    /// Among the joints that do not feel the push, the one that shows most of it.
    pub(super) fn next_to_feel(&self) -> Option<usize> {
        let others = self.heights_nm.iter().filter(|(j, _)| !self.is_felt_on(*j));
        others.max_by(|a, b| sigmas(a.1).total_cmp(&sigmas(b.1))).map(|(j, _)| *j)
    }

    /// Torque of the push on joint `joint` (0-based), Nm.
    pub(super) fn torque_nm(&self, joint: usize, t_s: f64) -> f64 {
        let on_joint = self.heights_nm.iter().find(|(j, _)| *j == joint);
        let height = on_joint.map_or(0.0, |(_, [height, _])| *height);
        let [start_s, end_s] = [self.start_s.value, self.end_s.value];
        height * bump(self.shape, end_s - start_s, t_s - 0.5 * (start_s + end_s))
    }
}

/// Magnitude of a height in units of its σ; zero for a joint without noise, whose heights are zero as well.
fn sigmas([height, sigma]: [f64; 2]) -> f64 {
    if sigma > 0.0 { (height / sigma).abs() } else { 0.0 }
}

/// A bump fitted to the deviations.
struct Fit {
    shape: f64,
    gain: f64,
    /// Value and σ, seconds from the first sample.
    start_s: [f64; 2],
    end_s: [f64; 2],
    /// Height on each joint and its σ, Nm.
    heights_nm: Vec<[f64; 2]>,
}

/// Fits bumps of all shapes that are `felt`, near one of the ordinary shape and `length_s` whose centre is among
/// `centres`; `joints` are the joints of the signals of `filter`.
///
/// For a given shape, the intervals of begin, end and height are those within χ²₁ of its best bump. The shape itself is
/// unknown: the intervals cover all shapes that are not excluded.
pub(super) fn weigh(
    filter: &MatchedFilter,
    felt: &Felt,
    joints: &[usize],
    centres: Range<usize>,
    length_s: f64,
) -> Option<Push> {
    let of_shapes: Vec<Vec<Fit>> = SHAPES
        .iter()
        .filter_map(|&shape| fits(filter, felt, centres.clone(), length_s, shape))
        .collect();
    let tops: Vec<&Fit> = of_shapes.iter().filter_map(|fits| top(fits.iter())).collect();
    let best = top(tops.iter().copied())?;
    let over_sigma = |a: usize| sigmas(best.heights_nm[a]);
    let on = |a: usize| joints[felt.felt()[a]];
    let main = (0..felt.count()).max_by(|a, b| over_sigma(*a).total_cmp(&over_sigma(*b)))?;
    let least = FELT.max(FELT_SHARE * over_sigma(main)).min(over_sigma(main));
    let unlike = EXCLUDED.max(UNLIKE * best.gain);
    let reach = |of: &dyn Fn(&Fit) -> [f64; 2], unit: &'static str| {
        let mut ci95 = [f64::INFINITY, f64::NEG_INFINITY];
        let possible = of_shapes.iter().zip(&tops).filter(|(_, top)| best.gain - top.gain < unlike);
        for (fit, top) in possible.flat_map(|(fits, top)| fits.iter().map(move |fit| (fit, top))) {
            let left = CHI2_95 - (top.gain - fit.gain);
            if left > 0.0 {
                let [value, sigma] = of(fit);
                ci95[0] = ci95[0].min(value - left.sqrt() * sigma);
                ci95[1] = ci95[1].max(value + left.sqrt() * sigma);
            }
        }
        Estimate { value: of(best)[0], unit, ci95 }
    };
    Some(Push {
        start_s: reach(&|fit| fit.start_s, "s"),
        end_s: reach(&|fit| fit.end_s, "s"),
        peak_nm: reach(&|fit| fit.heights_nm[main], "Nm"),
        peak_joint: on(main),
        felt: (0..felt.count()).filter(|a| over_sigma(*a) >= least).map(on).collect(),
        heights_nm: (0..felt.count()).map(on).zip(best.heights_nm.clone()).collect(),
        gain: best.gain,
        confidence: 1.0,
        shape: best.shape,
    })
}

fn top<'a>(fits: impl Iterator<Item = &'a Fit>) -> Option<&'a Fit> {
    fits.max_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// The best bumps of one shape: for each length, and over all lengths.
fn fits(
    filter: &MatchedFilter,
    felt: &Felt,
    centres: Range<usize>,
    length_s: f64,
    shape: f64,
) -> Option<Vec<Fit>> {
    // (1 − u²)^p has the standard deviation 1/√(2p + 3) along u.
    let guess_s = length_s * ((2.0 * shape + 3.0) / (2.0 * ORDINARY + 3.0)).sqrt();
    let of_step = |step: i32| {
        let length_s = guess_s * (STEP * f64::from(step)).exp();
        of_length(filter, felt, centres.clone(), length_s, shape)
    };
    let mut fits: Vec<Fit> = (-STEPS..=STEPS).map(of_step).collect::<Option<_>>()?;
    let best =
        |fits: &[Fit]| (0..fits.len()).max_by(|&a, &b| fits[a].gain.total_cmp(&fits[b].gain));
    for step in STEPS + 1..=STEPS + FURTHER {
        if best(&fits)? + 1 < fits.len() {
            break;
        }
        let Some(fit) = of_step(step) else { break };
        fits.push(fit);
    }
    let top = best(&fits)?.clamp(1, fits.len() - 2);
    let around = [top - 1, top, top + 1].map(|i| &fits[i]);
    let Summit { at, value, sigma } = summit(around.map(|fit| fit.gain));
    // σ at a known length, widened by the effect of the length's own σ.
    let between = |of: &dyn Fn(&Fit) -> [f64; 2]| {
        let [before, middle, behind] = around.map(of);
        let slope = 0.5 * (behind[0] - before[0]);
        [middle[0] + at * slope, middle[1].hypot(sigma * slope)]
    };
    let all = Fit {
        shape,
        gain: value,
        start_s: between(&|fit| fit.start_s),
        end_s: between(&|fit| fit.end_s),
        heights_nm: (0..around[1].heights_nm.len())
            .map(|j| between(&|fit| fit.heights_nm[j]))
            .collect(),
    };
    fits.push(all);
    Some(fits)
}

/// The best bump of one shape and length.
fn of_length(
    filter: &MatchedFilter,
    felt: &Felt,
    centres: Range<usize>,
    length_s: f64,
    shape: f64,
) -> Option<Fit> {
    let heights = filter.heights(|t_s| bump(shape, length_s, t_s));
    let gain = |k: usize| felt.gain(&felt.noise.scores(&heights, k));
    let top = centres.max_by(|&a, &b| gain(a).total_cmp(&gain(b)))?;
    let top = top.clamp(1, heights.height.samples().checked_sub(2)?);
    let Summit { at, value, sigma } = summit([top - 1, top, top + 1].map(gain));
    let rate_hz = filter.rate_hz();
    let (centre_s, sigma_s) = ((top as f64 + at) / rate_hz, sigma / rate_hz);
    Some(Fit {
        shape,
        gain: value,
        start_s: [centre_s - 0.5 * length_s, sigma_s],
        end_s: [centre_s + 0.5 * length_s, sigma_s],
        heights_nm: felt.heights(&heights, top),
    })
}

/// Summit of a parabola through three values a step apart: its position relative to the middle one, in steps; its
/// height; and the σ for which its curvature is that of twice a log-likelihood.
struct Summit {
    at: f64,
    value: f64,
    sigma: f64,
}

fn summit([before, middle, behind]: [f64; 3]) -> Summit {
    let slope = 0.5 * (behind - before);
    let curvature = before - 2.0 * middle + behind;
    if curvature >= 0.0 {
        // No maximum here: the position is known only to the step.
        return Summit { at: 0.0, value: middle, sigma: 1.0 };
    }
    let at = (-slope / curvature).clamp(-1.0, 1.0);
    Summit { at, value: middle + 0.5 * slope * at, sigma: (-2.0 / curvature).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

    #[test]
    fn a_parabola_has_its_summit() {
        // 9 − 2 (x − 0.3)²: σ² = 2/4.
        let y = |x: f64| 9.0 - 2.0 * (x - 0.3) * (x - 0.3);
        let found = summit([y(-1.0), y(0.0), y(1.0)]);
        assert!((found.at - 0.3).abs() < 1e-12 && (found.value - 9.0).abs() < 1e-12);
        assert!((found.sigma - 0.5f64.sqrt()).abs() < 1e-12);
    }

    /// With known noise, a gain keeps its value. With noise known with ν degrees of freedom, it is as rare as one of
    /// F(k, ν), up to a few percent of a σ, down to once in 10⁸.
    #[test]
    fn gains_of_poorly_known_noise_are_less_rare() {
        let noise = |freedom: f64| Noise {
            scale: vec![1.0; 3],
            freedom: vec![freedom; 3],
            correlation: DMatrix::identity(3, 3),
            precision: DMatrix::identity(3, 3),
        };
        for felt in [&[1][..], &[0, 1, 2]] {
            let k = felt.len() as f64;
            let of_known = |freedom, gain| noise(freedom).felt_by(felt, &[]).of_known_noise(gain);
            assert!((of_known(1e9, 40.0) - 40.0).abs() < 1e-4);
            for freedom in [20.0, 100.0, 1000.0] {
                let f = FisherSnedecor::new(k, freedom).unwrap();
                let gain = k * f.inverse_cdf(1.0 - 1e-8);
                let known = ChiSquared::new(k).unwrap().inverse_cdf(1.0 - 1e-8);
                let off = of_known(freedom, gain).sqrt() - known.sqrt();
                assert!(off.abs() < 0.05, "{k} {freedom}: {off}");
            }
        }
    }

    /// Noise shared by two signals is removed from one of them if it shows in the other, which nothing touched. With
    /// the correlation c, the σ of the remaining noise is √(1 − c²).
    #[test]
    fn a_quiet_signal_tells_the_noise_of_another() {
        let correlation = DMatrix::from_row_slice(2, 2, &[1.0, 0.6, 0.6, 1.0]);
        let precision = inverse(correlation.clone());
        let noise = Noise { scale: vec![1.0; 2], freedom: vec![1e9; 2], correlation, precision };
        let z = [5.0, -1.0];
        let beside = noise.felt_by(&[0], &[1]);
        // (5 + 0.6)/0.8.
        assert!((beside.gain(&z).sqrt() - 7.0).abs() < 1e-12);
        assert!((beside.score(0, &z) - 5.6).abs() < 1e-12);
        assert!((noise.felt_by(&[0], &[]).gain(&z).sqrt() - 5.0).abs() < 1e-12);
        let both = noise.felt_by(&[0, 1], &[]);
        assert!((both.gain(&z) - noise.gain(&z)).abs() < 1e-12);
    }
}
