//! The power of the noise between periods by harmonic, and how well it is known.
//!
//! P periods tell the noise of one harmonic of one joint with P − 1 complex degrees of freedom. Neighbouring harmonics
//! are pooled, and so are joints whose noise is of one kind ([`noise_trends`](crate::signal::noise_trends)). But at the
//! slow end, where the motion and the torques of gravity and springs live, there are few harmonics to pool: a test that
//! took the noise for known would find springs in every hundredth log. Two corrections follow:
//!
//! - in every slow harmonic of every joint, the gain of a family is that of Student's distribution,
//!   (ν + 2) ln(1 + |r|²/ν) in place of |r|² (the likelihood with the noise's scale integrated out);
//! - the probability of a family is that of F(k, ν), with ν from the share of every harmonic in the explained square
//!   (Satterthwaite 1946).

use std::ops::Range;

use super::image::{Image, Span};
use crate::signal::{pooled, pooled_level};

/// How well the noise of whitened rows is known.
#[derive(Debug, Clone)]
pub struct NoiseKnowledge {
    /// By harmonic, from 0.
    harmonics: Vec<Uncertainty>,
}

/// Relative variance of the estimated noise power at one harmonic, in three parts.
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// Of the power that all joints share; one error over the harmonics within [`pooled`].
    pub shared: f64,
    /// Of the level of each joint's noise; one error over the harmonics within [`pooled_level`].
    pub level: f64,
    /// Mean squared coherence of the joints' noise: the share of the error of `level` that any two joints have in
    /// common.
    pub likeness: f64,
    /// By joint, of the colour of its noise beside both; one error over the harmonics within [`pooled`].
    pub colour: Vec<f64>,
}

impl Uncertainty {
    /// The sum of the three parts for one joint.
    pub fn of(&self, joint: usize) -> f64 {
        self.shared + self.level + self.colour[joint]
    }
}

/// From this many degrees of freedom on, the noise of a harmonic counts as known in the gain of a family.
const WELL_KNOWN: f64 = 200.0;
/// Degrees of freedom from which on F(k, ν) is taken as χ²ₖ/k.
const MANY: f64 = 1e5;

/// Rows of (harmonic, joint) among the whitened rows of a period, which are ordered by harmonic and then by joint: one
/// row for harmonic 0 (the mean), two (real and imaginary part) for each other. The highest harmonic in use lies below
/// half the sampling rate.
pub fn rows_of(joints: usize, harmonic: usize, joint: usize) -> Range<usize> {
    if harmonic == 0 {
        return joint..joint + 1;
    }
    let first = joints * (2 * harmonic - 1) + 2 * joint;
    first..first + 2
}

impl NoiseKnowledge {
    /// From the uncertainty of every harmonic, from 0.
    pub fn new(harmonics: Vec<Uncertainty>) -> Self {
        Self { harmonics }
    }

    fn joints(&self) -> usize {
        self.harmonics.first().map_or(0, |known| known.colour.len())
    }

    /// [`rows_of`] (harmonic, joint) for this number of joints.
    pub fn rows(&self, harmonic: usize, joint: usize) -> Range<usize> {
        rows_of(self.joints(), harmonic, joint)
    }

    /// Twice the gain in log-likelihood when the part of `residual` that `span` explains is removed from it;
    /// `coordinates` are those of the residual along the span. Rows of the mean period in harmonics whose noise power
    /// is not well known gain what Student's t gains. What differs between the periods, which only drifts do, gains its
    /// full square.
    pub fn gain(&self, span: &Span, residual: &Image, coordinates: &[f64]) -> f64 {
        let mut gain: f64 = coordinates.iter().map(|c| c * c).sum();
        let explained = |row: usize| -> f64 {
            span.directions().zip(coordinates).map(|(d, along)| along * d.mean[row]).sum()
        };
        let joints = self.joints();
        for (harmonic, unknown) in self.harmonics.iter().enumerate() {
            if (0..joints).all(|joint| 2.0 / unknown.of(joint) >= WELL_KNOWN) {
                continue;
            }
            for joint in 0..joints {
                let (mut before, mut after, mut count) = (0.0, 0.0, 0.0);
                for row in self.rows(harmonic, joint) {
                    let r = residual.mean[row];
                    let left = r - explained(row);
                    before += r * r;
                    after += left * left;
                    count += 1.0;
                }
                let freedom = 2.0 / unknown.of(joint);
                let student = |square: f64| (freedom + count) * (square / freedom).ln_1p();
                gain += student(before) - student(after) - (before - after);
            }
        }
        gain
    }

    /// Degrees of freedom ν of the noise along the part of `residual` that `span` explains. 2/ν is the relative
    /// variance of the noise power there, Σ w w' C over harmonics and joints, with w their shares of the explained
    /// square and C the relative covariances ([`Uncertainty`]).
    pub fn freedom(&self, span: &Span, residual: &Image) -> f64 {
        if span.is_empty() {
            return MANY;
        }
        self.freedom_along(&span.combination(&span.coordinates(residual)))
    }

    /// Degrees of freedom ν of the noise along one `direction`, as in [`Self::freedom`].
    pub fn freedom_along(&self, direction: &Image) -> f64 {
        let harmonics = self.harmonics();
        let mut share = vec![vec![0.0; harmonics]; self.joints()];
        let periods = direction.contrast.chunks_exact(direction.mean.len());
        let mut all = 0.0;
        for rows in periods.chain([&direction.mean[..]]) {
            for (joint, share) in share.iter_mut().enumerate() {
                for (harmonic, share) in share.iter_mut().enumerate() {
                    let square =
                        rows[self.rows(harmonic, joint)].iter().map(|v| v * v).sum::<f64>();
                    *share += square;
                    all += square;
                }
            }
        }
        (2.0 * all * all / self.variance(&share)).min(MANY)
    }

    /// Degrees of freedom of the noise's power in a band of harmonics of one joint.
    pub fn freedom_of_band(&self, band: Range<usize>, joint: usize) -> f64 {
        let mut share = vec![vec![0.0; self.harmonics()]; self.joints()];
        let harmonics = band.len() as f64;
        share[joint][band].fill(1.0 / harmonics);
        (2.0 / self.variance(&share)).min(MANY)
    }

    /// Number of harmonics whose rows are used, from 0 on.
    pub fn harmonics(&self) -> usize {
        self.harmonics.len()
    }

    /// Σ w w' C over harmonics and joints, with `share` holding w by joint and harmonic.
    fn variance(&self, share: &[Vec<f64>]) -> f64 {
        let together: Vec<f64> =
            (0..self.harmonics()).map(|h| share.iter().map(|share| share[h]).sum()).collect();
        let at = |h: usize| &self.harmonics[h];
        let own = share.iter().enumerate().map(|(joint, share)| {
            let level = of_alike(share, pooled_level, |h| at(h).level * (1.0 - at(h).likeness));
            level + of_alike(share, pooled, |h| at(h).colour[joint])
        });
        own.sum::<f64>()
            + of_alike(&together, pooled_level, |h| at(h).level * at(h).likeness)
            + of_alike(&together, pooled, |h| at(h).shared)
    }

    /// Whether ν is so large that the noise counts as known.
    pub fn is_known(freedom: f64) -> bool {
        freedom >= MANY
    }
}

/// Σ w_h w_h' v_h over all harmonics h and all harmonics h' within `reach` of h.
fn of_alike(share: &[f64], reach: fn(usize) -> usize, variance: impl Fn(usize) -> f64) -> f64 {
    // Cumulative sums of the shares: entry h is the sum over all harmonics below h.
    let mut below = Vec::with_capacity(share.len() + 1);
    below.push(0.0);
    below.extend(share.iter().scan(0.0, |sum, share| {
        *sum += share;
        Some(*sum)
    }));
    let term = |(harmonic, own): (usize, &f64)| {
        let end = (harmonic + reach(harmonic) + 1).min(share.len());
        let near = below[end] - below[harmonic.saturating_sub(reach(harmonic))];
        own * near * variance(harmonic)
    };
    share.iter().enumerate().map(term).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    fn one_joint(relative_variance: f64) -> NoiseKnowledge {
        let unknown =
            Uncertainty { shared: 0.0, level: 0.0, likeness: 0.0, colour: vec![relative_variance] };
        NoiseKnowledge::new(vec![unknown; 3])
    }

    /// A direction in one slow harmonic, with the scale of its noise estimated from ν degrees of freedom. A chance of
    /// 10⁻⁷ would need ten million logs to be seen; a chance of 1/200 is seen in 20 000.
    #[test]
    fn chance_along_one_harmonic_is_that_of_student() {
        const TRIALS: usize = 20_000;
        let relative_variance = 0.13;
        let knowledge = one_joint(relative_variance);
        let mut span = Span::default();
        let mut direction = Image { mean: vec![0.0; 5], contrast: Vec::new() };
        direction.mean[1] = 1.0;
        span.push(&direction);
        let freedom = knowledge.freedom(&span, &direction);
        assert!((freedom - 2.0 / relative_variance).abs() < 1e-9, "{freedom}");
        let limit = statrs::distribution::FisherSnedecor::new(1.0, freedom).unwrap();
        let limit = statrs::distribution::ContinuousCDF::inverse_cdf(&limit, 0.995);
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let whole = freedom.round() as usize;
        let beyond = (0..TRIALS).filter(|_| {
            let scale: f64 = (0..whole).map(|_| normal().powi(2)).sum::<f64>() / whole as f64;
            normal().powi(2) / scale > limit
        });
        // Binomial, 100 ± 10, so the limit is six standard deviations: it also covers that 15.4 degrees of freedom are
        // rounded to 15.
        assert!((beyond.count() as f64 - 100.0).abs() < 60.0);
    }

    /// Where noise is well known, the gain is the explained square; where it is not, the gain is less.
    #[test]
    fn what_lies_in_poorly_known_noise_counts_less() {
        let residual = Image { mean: vec![0.5, 6.0, 1.0, -0.5, 1.0], contrast: Vec::new() };
        let mut span = Span::default();
        let mut direction = Image { mean: vec![0.0; 5], contrast: Vec::new() };
        direction.mean[1] = 1.0;
        span.push(&direction);
        let coordinates = span.coordinates(&residual);
        let known = one_joint(1e-9);
        assert!((known.gain(&span, &residual, &coordinates) - 36.0).abs() < 1e-9);
        let poorly = one_joint(0.13);
        // (ν + 2) ln((1 + 37/ν)/(1 + 1/ν)) by hand, ν = 2/0.13.
        let nu: f64 = 2.0 / 0.13;
        let expected = (nu + 2.0) * ((1.0 + 37.0 / nu) / (1.0 + 1.0 / nu)).ln();
        assert!((poorly.gain(&span, &residual, &coordinates) - expected).abs() < 1e-9);
    }

    /// Two joints, with all of the explained square in one harmonic, half on each. The shared and the coherent variance
    /// count in full, the rest by half.
    #[test]
    fn what_joints_share_is_no_better_known_on_two() {
        let unknown =
            Uncertainty { shared: 0.01, level: 0.02, likeness: 0.25, colour: vec![0.04; 2] };
        let knowledge = NoiseKnowledge::new(vec![unknown; 3]);
        let mut direction = Image { mean: vec![0.0; 10], contrast: Vec::new() };
        for joint in 0..2 {
            direction.mean[knowledge.rows(1, joint).start] = 0.5_f64.sqrt();
        }
        let mut span = Span::default();
        span.push(&direction);
        let expected = 0.01 + 0.25 * 0.02 + 0.5 * (0.75 * 0.02 + 0.04);
        let freedom = knowledge.freedom(&span, &direction);
        assert!((2.0 / freedom / expected - 1.0).abs() < 1e-9, "{freedom}");
    }
}
