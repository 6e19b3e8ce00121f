//! Where a push begins, how high it is and where it ends, whatever its shape.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::diagnose::verdict::Estimate;
use crate::signal::{Heights, MatchedFilter};

/// Exponents p of (1 − u²)^p, |u| < 1: from a push that sets in at once to one that swells softly.
const SHAPES: [f64; 4] = [0.5, 1.0, 2.0, 3.0];
/// The shape by which bumps are looked for.
pub(super) const ORDINARY: f64 = 1.0;
/// Lengths around the first guess for which a bump is weighed: steps of ln, and how many to either side.
const STEP: f64 = 0.07;
const STEPS: i32 = 9;
/// A joint feels a push that was weighed on it if it shows so many σ of it, which noise does once in 370 joints, and
/// this share of as many as the joint that feels it most: the arm that gives way moves the other joints a little.
const FELT: f64 = 3.0;
pub(super) const FELT_SHARE: f64 = 0.1;
/// Heights count for the correlation between joints up to so many σ.
const CLIPPED: f64 = 3.0;
/// 95 % quantile of χ² with one degree of freedom.
const CHI2_95: f64 = 3.841_458_820_694_1;
/// Its 99.5 % quantile: a shape that far behind the best one is excluded, …
const EXCLUDED: f64 = 7.88;
/// … and behind it by this share of what the best one explains: none of them is the push's own as the log has it, behind a drive that
/// answers and links that yield. The begin of a strong push was told to 3 ms where it was off by 120.
const UNLIKE: f64 = 0.1;

/// The bump of length `length_s` at the distance `t_s` from its middle; 1 there.
pub(super) fn bump(shape: f64, length_s: f64, t_s: f64) -> f64 {
    let u = 2.0 * t_s / length_s;
    (1.0 - u * u).max(0.0).powf(shape)
}

/// What noise does to the heights of bumps in several joints.
pub(super) struct Noise {
    /// Of each joint, what [`MatchedFilter`]'s σ = 1/√N has to be multiplied by.
    scale: Vec<f64>,
    /// How well it is known: degrees of freedom.
    freedom: Vec<f64>,
    /// Between the joints.
    correlation: DMatrix<f64>,
    /// Its inverse.
    precision: DMatrix<f64>,
}

impl Noise {
    /// From the heights of bumps of one length, of which few hold any.
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

    /// Heights at one sample over their σ.
    pub(super) fn scores(&self, heights: &Heights, sample: usize) -> Vec<f64> {
        let score = |(j, scale): (usize, &f64)| {
            let height = heights.height.joint(j)[sample];
            if *scale > 0.0 { height * heights.information[j].sqrt() / scale } else { 0.0 }
        };
        self.scale.iter().enumerate().map(score).collect()
    }

    /// zᵀ C⁻¹ z: twice what a bump in all signals gains in log-likelihood, and no less than one in some of them.
    pub(super) fn gain(&self, z: &[f64]) -> f64 {
        let n = z.len();
        (0..n).map(|i| (0..n).map(|j| z[i] * self.precision[(i, j)] * z[j]).sum::<f64>()).sum()
    }

    /// Bumps that the signals `felt` feel and the signals `quiet` do not.
    pub(super) fn felt_by(&self, felt: &[usize], quiet: &[usize]) -> Felt<'_> {
        let signals = [felt, quiet].concat();
        let correlation = self.correlation.select_rows(&signals).select_columns(&signals);
        let precision = inverse(correlation).rows(0, felt.len()).into_owned();
        let covariance = inverse(precision.columns(0, felt.len()).into_owned());
        Felt { noise: self, signals, precision, covariance }
    }
}

/// The inverse of a correlation, or of a part of one; of one that has none the identity.
fn inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    matrix.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n))
}

/// Noise beside a bump that some signals feel, F, and others do not. With their scores z, their correlation C and P = C⁻¹ the
/// heights on F are b = P_FF⁻¹ (P z)_F in their σ, the noise taken out that the others show, their covariance is P_FF⁻¹, and
/// twice the gain in log-likelihood is (P z)_Fᵀ b.
pub(super) struct Felt<'a> {
    noise: &'a Noise,
    /// F, and behind it the others.
    signals: Vec<usize>,
    /// Rows F of P.
    precision: DMatrix<f64>,
    /// P_FF⁻¹.
    covariance: DMatrix<f64>,
}

impl Felt<'_> {
    /// F.
    pub(super) fn felt(&self) -> &[usize] {
        &self.signals[..self.count()]
    }

    /// How many signals feel the bump.
    pub(super) fn count(&self) -> usize {
        self.covariance.nrows()
    }

    /// (P z) of the a-th signal that feels the bump.
    fn weighed(&self, a: usize, z: &[f64]) -> f64 {
        self.signals.iter().enumerate().map(|(b, j)| self.precision[(a, b)] * z[*j]).sum()
    }

    /// Twice what the bump gains in log-likelihood.
    pub(super) fn gain(&self, z: &[f64]) -> f64 {
        (0..self.count()).map(|a| self.weighed(a, z) * self.score(a, z)).sum()
    }

    /// The gain that would be as rare if noise were known: with k signals and ν degrees of freedom of the noise of the least
    /// known one (ν + k/2 − 1) ln(1 + gain/ν) is χ²ₖ (Bartlett 1938).
    pub(super) fn of_known_noise(&self, gain: f64) -> f64 {
        let k = self.count() as f64;
        let freedom = self.felt().iter().map(|j| self.noise.freedom[*j]).fold(f64::MAX, f64::min);
        (freedom + 0.5 * k - 1.0) * (gain / freedom).ln_1p()
    }

    /// Height on the a-th signal that feels the bump, over what σ would be there without the others.
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

/// A push as the log knows it.
pub(super) struct Push {
    /// Seconds from the first sample.
    pub(super) start_s: Estimate,
    pub(super) end_s: Estimate,
    /// Of the joint that feels it most, Nm, and that joint (0-based).
    pub(super) peak_nm: Estimate,
    pub(super) peak_joint: usize,
    /// Joints (0-based) on which it was weighed, and how much they feel it and its σ, Nm.
    heights_nm: Vec<(usize, [f64; 2])>,
    /// Those that feel it.
    pub(super) felt: Vec<usize>,
    /// Twice what it gains in log-likelihood.
    pub(super) gain: f64,
    /// How sure it is that something pushed.
    pub(super) confidence: f64,
    shape: f64,
}

impl Push {
    /// Makes the intervals of begin and end hold those of `other`.
    pub(super) fn reach_over(&mut self, other: &Self) {
        for bound in other.start_s.ci95 {
            self.start_s.reach(bound);
        }
        for bound in other.end_s.ci95 {
            self.end_s.reach(bound);
        }
    }

    /// Whether joint `joint` (0-based) feels it.
    pub(super) fn is_felt_on(&self, joint: usize) -> bool {
        self.felt.contains(&joint)
    }

    /// The joints (0-based) that feel it, in their order, and how much, Nm.
    pub(super) fn felt_nm(&self) -> impl Iterator<Item = (usize, f64)> {
        let felt = self.heights_nm.iter().filter(|(j, _)| self.is_felt_on(*j));
        felt.map(|(j, [height, _])| (*j, *height))
    }

    /// The joint that shows most of it of those that do not feel it.
    pub(super) fn next_to_feel(&self) -> Option<usize> {
        let others = self.heights_nm.iter().filter(|(j, _)| !self.is_felt_on(*j));
        others.max_by(|a, b| sigmas(a.1).total_cmp(&sigmas(b.1))).map(|(j, _)| *j)
    }

    /// On joint `joint` (0-based), Nm.
    pub(super) fn torque_nm(&self, joint: usize, t_s: f64) -> f64 {
        let on_joint = self.heights_nm.iter().find(|(j, _)| *j == joint);
        let height = on_joint.map_or(0.0, |(_, [height, _])| *height);
        let [start_s, end_s] = [self.start_s.value, self.end_s.value];
        height * bump(self.shape, end_s - start_s, t_s - 0.5 * (start_s + end_s))
    }
}

/// Size of a height over its σ; none of a joint without noise, whose heights are none either.
fn sigmas([height, sigma]: [f64; 2]) -> f64 {
    if sigma > 0.0 { (height / sigma).abs() } else { 0.0 }
}

/// A bump that explains what is seen.
struct Fit {
    shape: f64,
    gain: f64,
    /// Value and σ, seconds from the first sample.
    start_s: [f64; 2],
    end_s: [f64; 2],
    /// Height on each joint and its σ.
    heights_nm: Vec<[f64; 2]>,
}

/// Weighs bumps of all shapes that are `felt` around one of the ordinary shape and `length_s` whose centre is among
/// `centres`; `joints` are those of the signals of `filter`.
///
/// What the log knows of begin, end and height of a push of one shape is where they stay within χ²₁ of the best
/// such bump. The shape itself is unknown: intervals reach over all that are not excluded.
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

/// The best bumps of one shape: of each length, and of all lengths together.
fn fits(
    filter: &MatchedFilter,
    felt: &Felt,
    centres: Range<usize>,
    length_s: f64,
    shape: f64,
) -> Option<Vec<Fit>> {
    // (1 − u²)^p has the standard deviation 1/√(2p + 3) along u.
    let guess_s = length_s * ((2.0 * shape + 3.0) / (2.0 * ORDINARY + 3.0)).sqrt();
    let mut fits: Vec<Fit> = (-STEPS..=STEPS)
        .map(|step| guess_s * (STEP * f64::from(step)).exp())
        .map(|length_s| of_length(filter, felt, centres.clone(), length_s, shape))
        .collect::<Option<_>>()?;
    let top = (0..fits.len()).max_by(|&a, &b| fits[a].gain.total_cmp(&fits[b].gain))?;
    let top = top.clamp(1, fits.len() - 2);
    let around = [top - 1, top, top + 1].map(|i| &fits[i]);
    let Summit { at, value, sigma } = summit(around.map(|fit| fit.gain));
    // σ of a length known is widened by what the length's own σ moves.
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

/// The top of a parabola through three values a step apart: where, from the middle one, in steps; how high;
/// and the σ that twice a log-likelihood of this curvature stands for.
struct Summit {
    at: f64,
    value: f64,
    sigma: f64,
}

fn summit([before, middle, behind]: [f64; 3]) -> Summit {
    let slope = 0.5 * (behind - before);
    let curvature = before - 2.0 * middle + behind;
    if curvature >= 0.0 {
        // No top here: all that is known is the step.
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

    /// Of known noise a gain is what it is; of noise known with ν degrees of freedom it is as rare as one of F(k, ν), to a few
    /// percent of a σ down to once in 10⁸.
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

    /// Noise that two signals share, seen in the one that nothing touched, is taken out of the other: with the correlation c
    /// what is left of it has σ √(1 − c²).
    #[test]
    fn a_quiet_signal_tells_the_noise_of_another() {
        let correlation = DMatrix::from_row_slice(2, 2, &[1.0, 0.6, 0.6, 1.0]);
        let precision = inverse(correlation.clone());
        let noise = Noise { scale: vec![1.0; 2], freedom: vec![1e9; 2], correlation, precision };
        let z = [5.0, -1.0];
        let beside = noise.felt_by(&[0], &[1]);
        // 5 + 0.6, over 0.8.
        assert!((beside.gain(&z).sqrt() - 7.0).abs() < 1e-12);
        assert!((beside.score(0, &z) - 5.6).abs() < 1e-12);
        assert!((noise.felt_by(&[0], &[]).gain(&z).sqrt() - 5.0).abs() < 1e-12);
        let both = noise.felt_by(&[0, 1], &[]);
        assert!((both.gain(&z) - noise.gain(&z)).abs() < 1e-12);
    }
}
