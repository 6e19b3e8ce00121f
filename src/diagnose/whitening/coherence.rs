//! Coherence between the noise of different joints.

use nalgebra::{Complex, DMatrix};

/// Mean squared coherence between two joints at every harmonic, from the `scatter` of the harmonics within `reach` of
/// it. Chance alone gives each of them 1/M with M = `freedom` complex degrees of freedom (Carter, Knapp and Nuttall
/// 1973), for which the mean is corrected. `None` where nothing can be concluded: with two periods, every pair is
/// coherent.
pub fn coherence(
    scatter: &[DMatrix<Complex<f64>>],
    freedom: usize,
    reach: impl Fn(usize) -> usize,
) -> Vec<Option<f64>> {
    let mean_of = |s: &DMatrix<Complex<f64>>| {
        let joints = s.nrows();
        let (mut sum, mut count) = (0.0, 0.0);
        for (i, j) in (0..joints).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let power = s[(i, i)].re * s[(j, j)].re;
            if power > 0.0 {
                sum += s[(i, j)].norm_sqr() / power;
                count += 1.0;
            }
        }
        (sum, count)
    };
    let of_harmonic: Vec<(f64, f64)> = scatter.iter().map(mean_of).collect();
    let chance = 1.0 / freedom as f64;
    let at = |k: usize| {
        let first = k.saturating_sub(reach(k)).max(1).min(scatter.len());
        let near = &of_harmonic[first..(k + reach(k) + 1).min(scatter.len())];
        let (sum, count) = near.iter().fold((0.0, 0.0), |(s, c), of| (s + of.0, c + of.1));
        let tells = freedom > 1 && count > 0.0;
        tells.then(|| ((sum / count - chance) / (1.0 - chance)).clamp(0.0, 1.0))
    };
    (0..scatter.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// Scatter of `joints` whose noise shares a part of amplitude `common`, with `freedom` complex degrees of freedom.
    fn scatter(joints: usize, freedom: usize, common: f64) -> Vec<DMatrix<Complex<f64>>> {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut normal = || -> Complex<f64> {
            Complex::new(StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng))
        };
        let of_harmonic = |_| {
            let mut sum = DMatrix::zeros(joints, joints);
            for _ in 0..freedom {
                let shared = normal() * common;
                let own = (1.0 - common * common).sqrt();
                let x = DMatrix::from_fn(joints, 1, |_, _| shared + normal() * own);
                sum += &x * x.adjoint();
            }
            sum
        };
        (0..400).map(of_harmonic).collect()
    }

    /// Independent noise has no coherence. Noise of which 0.3 of the power is common has 0.3², the squared correlation,
    /// apart from the bias of the correction for chance: uncorrected, γ² + (1 − γ²)² (1 + 2 γ²/M)/M is expected, which
    /// is 0.080 when corrected, a tenth too little.
    #[test]
    fn coherence_is_that_of_the_noise() {
        const FREEDOM: usize = 7;
        for (common, expected) in [(0.0f64, 0.0), (0.3f64.sqrt(), 0.09)] {
            let found = coherence(&scatter(6, FREEDOM, common), FREEDOM, |_| 1000);
            let found = found[200].unwrap();
            // Each of 400 harmonics of fifteen pairs scatters by 1/7: 0.002 in the mean; the tolerance is five of
            // these.
            assert!((found - expected).abs() < 0.01 + 0.1 * expected, "{found} {expected}");
        }
    }

    #[test]
    fn two_periods_and_joints_without_noise_tell_nothing() {
        assert!(coherence(&scatter(3, 1, 0.0), 1, |_| 12).iter().all(Option::is_none));
        let silent = vec![DMatrix::zeros(3, 3); 20];
        assert!(coherence(&silent, 7, |_| 12).iter().all(Option::is_none));
    }
}
