//! From the part of a residual that a family explains to a statistic and a probability.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::image::{Image, Span, dot};
use super::noise_power::NoiseKnowledge;
use super::whitening::{RunWhitening, Whitening};
use crate::identify::covariance::{LEAST_BLOCKS, by_chance, enlarged_scatter, quantile_95};

/// How evidence is counted.
pub enum Statistic {
    /// A motion that repeats: rows are independent with variance one, as far as the periods tell the noise.
    Periods(NoiseKnowledge),
    /// A single run: the residual is correlated in time and holds what the model gets wrong.
    Blocks {
        /// Block of time of every row.
        block_of: Vec<usize>,
        /// Number of blocks.
        blocks: usize,
        /// Number B of blocks with rows that count.
        used: usize,
        /// Number of blocks that make one for the covariance.
        together: usize,
        /// Rows per joint.
        rows: usize,
        /// Per joint, number n of rows that count.
        counting: Vec<usize>,
        /// Autocorrelation of the residual per joint at lags 1, 2, … up to its first zero, at most over one block.
        memory: Vec<Vec<f64>>,
    },
}

/// A stretch of time that holds all but this share of the square of a direction gains nothing by it in
/// cross-validation: what is left of the direction elsewhere is rounding.
const LEAST_SHARE_ELSEWHERE: f64 = 1e-6;

/// What an entry explains.
#[derive(Debug, Clone, Copy)]
pub struct Score {
    /// Twice the gain in log-likelihood.
    pub gain: f64,
    /// λ̂, see [`Statistic::score`].
    pub lambda: f64,
}

/// λ of an effect of usual strength, √λ about 30. Schwarz's ln n takes n for λ: an effect as large as the noise in
/// every sample.
const USUAL_LAMBDA: f64 = 1000.0;
/// Share of the square of the block that tells most of an effect from which on a block counts as telling of it.
const TELLS: f64 = 0.01;
/// Stretches of time in the cross-validation.
const FOLDS: usize = 10;
/// If less than this share of an effect's square lies on a joint, the joint does not count for it.
const TRACE: f64 = 1e-3;

impl Statistic {
    /// For the rows of `whitening`, with the null model's `residual`.
    pub fn new(whitening: &Whitening, residual: &Image, joints: usize) -> Self {
        match whitening {
            Whitening::Periods(periods) => Self::Periods(periods.knowledge()),
            Whitening::Run(run) => Self::of_blocks(
                run.blocks(),
                &run.counting(),
                RunWhitening::TOGETHER,
                residual,
                joints,
            ),
        }
    }

    /// For rows in blocks of time; rows that do not count are zero.
    fn of_blocks(
        block_of: Vec<usize>,
        counts: &[bool],
        longest: usize,
        residual: &Image,
        joints: usize,
    ) -> Self {
        let rows = block_of.len() / joints;
        let block_rows = block_of.iter().take_while(|block| **block == 0).count();
        let memory =
            residual.mean.chunks_exact(rows).map(|r| autocorrelation(r, block_rows)).collect();
        let of_joint = |counts: &[bool]| counts.iter().filter(|counts| **counts).count();
        let counting = counts.chunks_exact(rows).map(of_joint).collect();
        let blocks = block_of[rows - 1] + 1;
        let mut is_used = vec![false; blocks];
        block_of.iter().zip(counts).for_each(|(block, counts)| is_used[*block] |= counts);
        let used = is_used.iter().filter(|used| **used).count();
        let together = longest.min(used / LEAST_BLOCKS).max(1);
        Self::Blocks { block_of, blocks, used, together, rows, counting, memory }
    }

    /// Twice the gain in log-likelihood when the part of `residual` that `span` explains is removed.
    ///
    /// Periods: ‖P r‖², or less where noise is not well known ([`NoiseKnowledge::gain`]).
    ///
    /// Blocks: T = −Σ_j n_j ln(1 − (2⟨u, r⟩ − ‖u‖²)/‖r‖²) over the joints, with u = P r and n_j the number of rows that
    /// are independent along u. The variance of ⟨u, r⟩ is ‖r‖²/n ‖u‖² (1 + 2 Σ ρ_r ρ_u) for the n rows that count
    /// (Bartlett 1946), so that n_j = n/(1 + 2 Σ ρ_r ρ_u). This tells ripple, whose own correlation ρ_u changes its
    /// sign, from slow errors.
    pub fn gain(&self, span: &Span, residual: &Image) -> f64 {
        self.gain_along(span, residual, &span.coordinates(residual))
    }

    /// [`Self::gain`] for a residual with these coordinates along the span.
    fn gain_along(&self, span: &Span, residual: &Image, coordinates: &[f64]) -> f64 {
        let (rows, counting, memory) = match self {
            Self::Periods(knowledge) => return knowledge.gain(span, residual, coordinates),
            Self::Blocks { rows, counting, memory, .. } => (*rows, counting, memory),
        };
        let signal = span.combination(coordinates);
        let whole = signal.square();
        let panels = signal.mean.chunks_exact(rows).zip(residual.mean.chunks_exact(rows));
        panels
            .zip(counting.iter().zip(memory))
            .map(|((u, r), (counting, memory))| {
                let square = dot(r, r);
                // Projecting out the null model leaves a trace of every effect on every joint.
                if square == 0.0 || dot(u, u) < TRACE * whole {
                    return 0.0;
                }
                let explained = (2.0 * dot(u, r) - dot(u, u)) / square;
                -independent(u, *counting, memory) * (1.0 - explained).max(1e-6).ln()
            })
            .sum()
    }

    /// [`Self::gain`], and λ̂ of what `span` explains: its squared length in units of the noise; for a single run,
    /// whose noise is not known, the gain.
    pub fn score(&self, span: &Span, residual: &Image, coordinates: &[f64]) -> Score {
        let gain = self.gain_along(span, residual, coordinates);
        let lambda = match self {
            Self::Periods(_) => coordinates.iter().map(|along| along * along).sum(),
            Self::Blocks { .. } => gain,
        };
        Score { gain, lambda }
    }

    /// Price of `count` free coefficients of one effect, in 2 ln of the evidence.
    ///
    /// Periods: k ln(1 + λ₀/k), from a Gaussian prior under which the mean λ of the effect is [`USUAL_LAMBDA`], however
    /// many coefficients it has (Zellner 1986). Blocks: k ln n (Schwarz 1978), with n the number of rows that see the
    /// site.
    pub fn coefficients_price(&self, count: usize, site: Option<usize>) -> f64 {
        let k = count as f64;
        let rows: usize = match (self, site) {
            (Self::Periods(_), _) => return k * (USUAL_LAMBDA / k.max(1.0)).ln_1p(),
            (Self::Blocks { counting, .. }, Some(j)) => counting[j],
            (Self::Blocks { counting, .. }, None) => counting.iter().sum(),
        };
        k * (rows.max(1) as f64).ln()
    }

    /// Probability that chance alone explains at least as much, in a single test.
    ///
    /// Periods: F(k, ν) with the degrees of freedom of [`NoiseKnowledge::freedom`]. Blocks: the Wald statistic bᵀV⁻¹b,
    /// with V from the scatter of block sums, as F(k, B − k).
    pub fn probability(&self, span: &Span, residual: &Image) -> f64 {
        let k = span.len();
        match self {
            Self::Periods(knowledge) => {
                let (explained, freedom) =
                    (span.explained(residual), knowledge.freedom(span, residual));
                if k == 0 {
                    return upper_chi_squared(explained, k);
                }
                upper_fisher(explained / k as f64, k, freedom)
            }
            Self::Blocks { .. } => {
                let coordinates = DVector::from_vec(span.coordinates(residual));
                let scatter = self.scatter(span, residual);
                scatter.map_or(1.0, |(scatter, blocks)| by_chance(&coordinates, scatter, blocks))
            }
        }
    }

    /// Square that `span` removes from `residual` in stretches left out of the fit, by blocked cross-validation over
    /// [`FOLDS`] stretches of time. `None` where noise is known.
    ///
    /// With s_f = Uᵀr and G_f = UᵀU over stretch f, the coefficients fitted without it are b₋f = (I − G_f)⁻¹ (Uᵀr −
    /// s_f), and the gain is Σ_f 2 b₋fᵀ s_f − b₋fᵀ G_f b₋f.
    pub fn left_out_gain(&self, span: &Span, residual: &Image) -> Option<f64> {
        let Self::Blocks { block_of, blocks, .. } = self else { return None };
        let k = span.len();
        let whole = DVector::from_vec(span.coordinates(residual));
        let mut along = vec![DVector::<f64>::zeros(k); FOLDS];
        let mut gram = vec![DMatrix::<f64>::zeros(k, k); FOLDS];
        let directions: Vec<&[f64]> = span.directions().map(|d| d.mean).collect();
        for (row, (r, &block)) in residual.mean.iter().zip(block_of).enumerate() {
            let fold = block * FOLDS / blocks;
            for i in 0..k {
                along[fold][i] += directions[i][row] * r;
                for j in 0..k {
                    gram[fold][(i, j)] += directions[i][row] * directions[j][row];
                }
            }
        }
        let mut gain = 0.0;
        for (s, g) in along.iter().zip(&gram) {
            let rest = DMatrix::identity(k, k) - g;
            // A direction that lies in one stretch alone cannot be fitted without it, so the stretch gains nothing.
            let Some(rest) = rest.cholesky() else { continue };
            let is_fitted_elsewhere =
                |i: usize| rest.l_dirty()[(i, i)].powi(2) > LEAST_SHARE_ELSEWHERE;
            if !(0..k).all(is_fitted_elsewhere) {
                continue;
            }
            let b = rest.solve(&(&whole - s));
            gain += 2.0 * b.dot(s) - b.dot(&(g * &b));
        }
        Some(gain)
    }

    /// Covariance of the coordinates on `span`, from the scatter of the block sums of what `span` leaves of `residual`;
    /// and the number B of blocks. `None` where noise is known.
    fn scatter(&self, span: &Span, residual: &Image) -> Option<(DMatrix<f64>, usize)> {
        let Self::Blocks { block_of, blocks, used, .. } = self else { return None };
        let mut scatter = DMatrix::zeros(span.len(), span.len());
        for sum in block_sums(span, residual, |row| block_of[row], *blocks) {
            scatter += &sum * sum.transpose();
        }
        Some((scatter * (*used as f64 / used.saturating_sub(1).max(1) as f64), *used))
    }

    /// Covariance of the least-squares coefficients of `residual` on the columns of `span`. In a single run it is that
    /// of identification's [`BlockCluster`](crate::identify::covariance::BlockCluster), from the scatter of blocks that
    /// are longer than the memory of the noise, with each score enlarged because the fit adapted to its block.
    pub fn covariance(&self, span: &Span, residual: &Image) -> DMatrix<f64> {
        let Self::Blocks { block_of, blocks, .. } = self else { return span.inverse_gram() };
        let directions: Vec<&[f64]> = span.directions().map(|d| d.mean).collect();
        let together = self.joined(&directions);
        let longer = |row: usize| block_of[row] / together;
        let sums = block_sums(span, residual, longer, blocks.div_ceil(together));
        let mut shares = vec![DMatrix::<f64>::zeros(span.len(), span.len()); sums.len()];
        for row in 0..block_of.len() {
            let along = DVector::from_iterator(span.len(), directions.iter().map(|d| d[row]));
            shares[longer(row)].ger(1.0, &along, &along, 1.0);
        }
        let inverse = span.inverse_triangle();
        &inverse * enlarged_scatter(&shares, &sums) * inverse.transpose()
    }

    /// Half-width, in σ, of a 95 % interval along `span`: the quantile of Student's t with the degrees of freedom of
    /// [`Self::freedom`].
    pub fn quantile_95(&self, span: &Span, residual: &Image) -> f64 {
        quantile_95(self.freedom(span, residual))
    }

    /// Degrees of freedom of the noise along the part of `residual` that `span` explains: those of
    /// [`NoiseKnowledge::freedom`], or one less than the number of blocks of the covariance.
    pub fn freedom(&self, span: &Span, residual: &Image) -> f64 {
        match self {
            Self::Periods(knowledge) => knowledge.freedom(span, residual),
            Self::Blocks { .. } => {
                let directions: Vec<&[f64]> = span.directions().map(|d| d.mean).collect();
                self.freedom_of_blocks(&directions, self.joined(&directions))
            }
        }
    }

    /// How many blocks make one for the covariance along `directions`. Where they are felt in few long blocks, the
    /// short ones stay as they are.
    fn joined(&self, directions: &[&[f64]]) -> usize {
        match self {
            Self::Blocks { together, .. }
                if self.telling(directions, *together) >= LEAST_BLOCKS =>
            {
                *together
            }
            _ => 1,
        }
    }

    /// Number of blocks, each of `together` short ones, that hold a share of the square of `directions`.
    fn telling(&self, directions: &[&[f64]], together: usize) -> usize {
        let Self::Blocks { block_of, blocks, .. } = self else { return 0 };
        let mut squares = vec![0.0; blocks.div_ceil(together)];
        for direction in directions {
            let rows = direction.iter().zip(block_of);
            rows.for_each(|(d, block)| squares[block / together] += d * d);
        }
        let most = squares.iter().fold(0.0f64, |a, b| a.max(*b));
        squares.iter().filter(|square| **square > TELLS * most).count()
    }

    /// One less than the number of blocks that tell of `directions`; at least 1.
    fn freedom_of_blocks(&self, directions: &[&[f64]], together: usize) -> f64 {
        (self.telling(directions, together).max(2) - 1) as f64
    }

    /// Degrees of freedom of the noise along each coefficient of `span`; the coefficients are R⁻¹ times the coordinates
    /// on its directions.
    pub fn freedom_of_coefficients(&self, span: &Span) -> Vec<f64> {
        let directions: Vec<&[f64]> = span.directions().map(|d| d.mean).collect();
        // The blocks are those of the covariance of all coefficients.
        let together = self.joined(&directions);
        let inverse = span.inverse_triangle();
        let along = |k: usize| {
            let row: Vec<f64> = inverse.row(k).iter().copied().collect();
            let image = span.combination(&row);
            match self {
                Self::Periods(knowledge) => knowledge.freedom_along(&image),
                Self::Blocks { .. } => self.freedom_of_blocks(&[&image.mean], together),
            }
        };
        (0..span.len()).map(along).collect()
    }
}

/// Sums of directions times residual, after what `span` explains is removed, over each of `count` blocks.
fn block_sums(
    span: &Span,
    residual: &Image,
    block_of: impl Fn(usize) -> usize,
    count: usize,
) -> Vec<DVector<f64>> {
    let mut left = residual.clone();
    span.residualise(&mut left);
    let mut sums = vec![DVector::<f64>::zeros(span.len()); count];
    for (i, direction) in span.directions().enumerate() {
        for (row, (d, r)) in direction.mean.iter().zip(&left.mean).enumerate() {
            sums[block_of(row)][i] += d * r;
        }
    }
    sums
}

/// P(F_{k,ν} > x), or P(χ²_k/k > x) where ν is large enough for the noise to count as known.
pub fn upper_fisher(x: f64, k: usize, freedom: f64) -> f64 {
    if NoiseKnowledge::is_known(freedom) {
        return upper_chi_squared(x * k as f64, k);
    }
    FisherSnedecor::new(k as f64, freedom).map_or(1.0, |f| f.sf(x.max(0.0)))
}

/// P(χ²_k > x).
pub fn upper_chi_squared(x: f64, k: usize) -> f64 {
    ChiSquared::new(k as f64).map_or(1.0, |d| d.sf(x.max(0.0)))
}

/// Autocorrelation of a series at lags 1, 2, … `longest`, up to the first that is not positive.
fn autocorrelation(r: &[f64], longest: usize) -> Vec<f64> {
    let square = dot(r, r).max(f64::MIN_POSITIVE);
    let at = |lag: usize| dot(&r[lag..], &r[..r.len() - lag]) / square;
    (1..=longest.min(r.len() - 1)).map(at).take_while(|rho| *rho > 0.0).collect()
}

/// How many of the `counting` rows of a residual with autocorrelation `memory` are independent along `signal`.
fn independent(signal: &[f64], counting: usize, memory: &[f64]) -> f64 {
    let rows = signal.len();
    let square = dot(signal, signal).max(f64::MIN_POSITIVE);
    let sum: f64 = (1..)
        .zip(memory)
        .map(|(lag, rho)| rho * dot(&signal[lag..], &signal[..rows - lag]) / square)
        .sum();
    counting as f64 / (1.0 + 2.0 * sum).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS_PER_BLOCK: usize = 8;
    const BLOCKS: usize = 40;

    /// Statistics of a wave in a correlated residual along a run of one joint, which then rests for `rest_blocks`
    /// blocks.
    fn told(rest_blocks: usize) -> [f64; 5] {
        let (moving, all) = (ROWS_PER_BLOCK * BLOCKS, ROWS_PER_BLOCK * (BLOCKS + rest_blocks));
        let while_moving = |y: &dyn Fn(usize) -> f64| Image {
            mean: (0..all).map(|k| if k < moving { y(k) } else { 0.0 }).collect(),
            contrast: Vec::new(),
        };
        let wave = |k: usize| (0.3 * k as f64).sin();
        let noise = |k: usize| ((k * 7919) % 1009) as f64 / 1009.0 - 0.5;
        let residual = while_moving(&|k| noise(k) + noise(k + 1) + 0.05 * wave(k));
        let mut span = Span::default();
        span.push(&while_moving(&wave));
        let block_of = (0..all).map(|k| k / ROWS_PER_BLOCK).collect();
        let counts: Vec<bool> = (0..all).map(|k| k < moving).collect();
        let statistic = Statistic::of_blocks(block_of, &counts, 4, &residual, 1);
        [
            statistic.gain(&span, &residual),
            statistic.probability(&span, &residual),
            statistic.covariance(&span, &residual)[(0, 0)],
            statistic.freedom(&span, &residual),
            statistic.coefficients_price(1, Some(0)),
        ]
    }

    /// σ of a constant and of a trend in noise with a memory τ of a second: of blocks of a second, the scatter shows
    /// about 1 − (1 − e^{−1}) = 37 % of the variance of the slow part, of blocks of five seconds
    /// 1 − (1 − e⁻⁵)/5 = 80 %. That is 38 % and 78 % of the whole variance: the white noise, a twenty-first of it,
    /// shows in all blocks, and the fit of the two parameters takes a little of the slow part.
    ///
    /// Over 200 runs, `predicted` is known to 1 % and 2 %, but `found`, a mean of 200 squares, only to √(2/200) = 10 %.
    /// The ratios have therefore standard errors of 0.04 and 0.08. The bounds are 2.2 and 4.3 of these away from 0.38,
    /// and 1.7 and 2.7 from 0.78: some four of a hundred seeds would fall outside of them.
    #[test]
    fn slow_noise_needs_longer_blocks() {
        use rand::{SeedableRng, rngs::ChaCha8Rng};
        use rand_distr::{Distribution, StandardNormal};
        let (rows_per_s, seconds) = (10, 80);
        let all = rows_per_s * seconds;
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let image = |y: Vec<f64>| Image { mean: y, contrast: Vec::new() };
        let mut span = Span::default();
        span.push(&image(vec![1.0; all]));
        span.push(&image((0..all).map(|k| k as f64 / all as f64 - 0.5).collect()));
        let (mut predicted, mut found) = ([0.0; 2], 0.0);
        let runs = 200;
        for _ in 0..runs {
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let a = (-1.0 / rows_per_s as f64).exp();
            let mut slow = normal();
            let noise = (0..all).map(|_| {
                slow = a * slow + (1.0 - a * a).sqrt() * normal();
                0.5f64.sqrt() * (slow + normal())
            });
            let residual = image(noise.collect());
            let coefficients =
                span.inverse_triangle() * DVector::from_vec(span.coordinates(&residual));
            found += coefficients[0].powi(2) / f64::from(runs);
            for (predicted, together) in predicted.iter_mut().zip([1, 5]) {
                let block_of = (0..all).map(|k| k / rows_per_s).collect();
                let counts = vec![true; all];
                let statistic = Statistic::of_blocks(block_of, &counts, together, &residual, 1);
                *predicted += statistic.covariance(&span, &residual)[(0, 0)] / f64::from(runs);
            }
        }
        let [short, long] = predicted.map(|variance| variance / found);
        assert!((0.3..0.55).contains(&short), "{short}");
        assert!((0.65..1.0).contains(&long), "{long}");
    }

    /// What lies in one stretch cannot be fitted without it, whatever the rounding of its length.
    #[test]
    fn a_direction_within_one_stretch_gains_nothing_left_out() {
        let all = ROWS_PER_BLOCK * BLOCKS;
        let image = |y: &dyn Fn(usize) -> f64| Image {
            mean: (0..all).map(y).collect(),
            contrast: Vec::new(),
        };
        let residual = image(&|k| ((k * 7919) % 1009) as f64 / 1009.0 - 0.5);
        let block_of = (0..all).map(|k| k / ROWS_PER_BLOCK).collect();
        let statistic = Statistic::of_blocks(block_of, &vec![true; all], 4, &residual, 1);
        for turn in 1..20 {
            let wave = |k: usize| (0.1 * (turn * k) as f64).cos();
            let mut span = Span::default();
            span.push(&image(&|k| if k < ROWS_PER_BLOCK { wave(k) } else { 0.0 }));
            assert_eq!(statistic.left_out_gain(&span, &residual), Some(0.0), "{turn}");
        }
    }

    /// The rows in which a joint rests change no statistic.
    #[test]
    fn rows_that_do_not_count_tell_nothing() {
        let (moving, resting) = (told(0), told(25));
        assert!(moving.iter().all(|value| *value > 0.0), "{moving:?}");
        for (with, without) in resting.iter().zip(moving) {
            assert!((with / without - 1.0).abs() < 1e-9, "{resting:?} {moving:?}");
        }
    }
}
