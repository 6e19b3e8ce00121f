//! Estimates and covariances against statsmodels (`golden/covariance.py`): ordinary and weighted least squares,
//! Newey–West with the scores of all joints summed at each instant, generalised least squares with autoregressive noise
//! (GLSAR), instrumental variables (IV2SLS), rows thinned after a low-pass (SciPy's), and blocks of time: corrected in
//! row space, and without that correction statsmodels' clusters. Seemingly unrelated equations and resampled blocks are
//! tested against their formulas.

use armid::base::{BaseSet, ColumnPlan, Parameterisation};
use armid::identify::covariance::{
    BlockBootstrap, BlockCluster, Covariance, CovarianceKind, CovarianceMethod, NeweyWest,
    OrdinaryLeastSquares,
};
use armid::identify::{
    Estimation, Estimator, Fit, Fitter, MotionAids, Options, Problem, Weighting,
};
use armid::robot::Arm;
use armid::signal::ZeroPhase;
use nalgebra::{Cholesky, Matrix2};
use serde::Deserialize;

const SAMPLES: usize = 240;
const COLUMNS: usize = 3;
const LAGS: usize = 9;
/// At this rate, blocks of 5 s have 40 samples.
const RATE_HZ: f64 = 8.0;
/// Both programs solve a well-conditioned problem in double precision.
const TOLERANCE: f64 = 1e-10;

#[derive(Deserialize)]
struct Golden {
    ols_theta: Vec<f64>,
    ols: Vec<Vec<f64>>,
    wls_theta: Vec<f64>,
    hac: Vec<Vec<f64>>,
    blocks: Vec<Vec<f64>>,
    blocks_freedom: f64,
    glsar_theta: Vec<f64>,
    glsar: Vec<Vec<f64>>,
    iv_theta: Vec<f64>,
    iv: Vec<Vec<f64>>,
    sur_shared: Unrelated,
    sur_own: Unrelated,
    decimated_theta: Vec<f64>,
    decimated: Vec<Vec<f64>>,
    /// Upper triangle of each joint's covariance, row by row.
    bootstrap: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
struct Unrelated {
    theta: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    variance: f64,
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("golden/covariance.json")).unwrap()
}

/// The problem of the script, with the equation of each joint multiplied by its weight.
fn problem(weights: [f64; 2]) -> Problem {
    let bases: Vec<usize> = (0..COLUMNS).collect();
    let mut problem = single_run(&[bases.clone(), bases], COLUMNS);
    for (j, panel) in problem.panels.iter_mut().enumerate() {
        for c in 0..COLUMNS {
            panel.x.extend((0..SAMPLES).map(|t| weights[j] * column(j, c, t)));
        }
        let torque = |t: usize| column(j, 0, t) - 2.0 * column(j, 1, t) + 0.5 * column(j, 2, t);
        let noise = noise(j).into_iter().enumerate();
        panel.y.extend(noise.map(|(t, e)| weights[j] * (torque(t) + e)));
    }
    problem
}

/// A problem without rows; `bases` lists the parameters in the equation of each joint, out of `count`.
fn single_run(bases: &[Vec<usize>], count: usize) -> Problem {
    let mut problem = Problem::new(ColumnPlan::explicit(bases, count), RATE_HZ);
    problem.samples = SAMPLES;
    problem.periods = 1;
    problem
}

fn column(j: usize, c: usize, t: usize) -> f64 {
    let rate = 0.013 * (j + 1) as f64 * (2 * c + 1) as f64;
    (rate * t as f64 + 0.4 * c as f64).cos()
}

/// Noise that is correlated in time.
fn noise(j: usize) -> Vec<f64> {
    let white = |t: usize| (0.7 * (j + 1) as f64 * (t * t) as f64 + j as f64).sin();
    let mut e = 0.0;
    let next = |t: usize| {
        e = white(t) + 0.6 * e;
        (0.5 + j as f64) * e
    };
    (0..SAMPLES).map(next).collect()
}

fn base_set() -> BaseSet {
    BaseSet::find(&Arm::built_in("ur5").unwrap(), Parameterisation::full(6, false)).unwrap()
}

fn fit(problem: &Problem) -> Fit {
    Fitter::new(problem).fit(problem, &base_set(), Weighting::Equal).unwrap()
}

fn assert_close(found: &Covariance, factor: f64, expected: &[Vec<f64>]) {
    let scale = expected[0][0];
    for (i, row) in expected.iter().enumerate() {
        for (k, value) in row.iter().enumerate() {
            let found = found.matrix[(i, k)] / factor;
            assert!((found - value).abs() < TOLERANCE * scale, "{i} {k}: {found} {value}");
        }
    }
}

#[test]
fn ordinary_least_squares() {
    let (golden, problem) = (golden(), problem([1.0, 1.0]));
    let fit = fit(&problem);
    for (found, expected) in fit.theta.iter().zip(&golden.ols_theta) {
        assert!((found - expected).abs() < TOLERANCE);
    }
    assert_close(&OrdinaryLeastSquares.covariance(&problem, &fit).unwrap(), 1.0, &golden.ols);
}

#[test]
fn scores_in_lags_and_in_blocks_of_time() {
    let (golden, problem) = (golden(), problem([2.0, 0.5]));
    let fit = fit(&problem);
    for (found, expected) in fit.theta.iter().zip(&golden.wls_theta) {
        assert!((found - expected).abs() < TOLERANCE);
    }
    let hac = NeweyWest { lags: Some(LAGS) }.covariance(&problem, &fit).unwrap();
    // statsmodels without its small-sample factor; the factor of this library is T/(T − b).
    let lost = SAMPLES as f64 / (SAMPLES - COLUMNS) as f64;
    assert_close(&hac, lost, &golden.hac);
    let blocks = BlockCluster.covariance(&problem, &fit).unwrap();
    assert_close(&blocks, 1.0, &golden.blocks);
    let freedom = blocks.degrees_of_freedom;
    assert!((freedom / golden.blocks_freedom - 1.0).abs() < TOLERANCE, "{freedom}");
}

/// Estimate and covariance for the first joint alone by `estimator`.
fn first_joint(
    estimator: Estimator,
    kind: CovarianceKind,
    instruments: Option<&Problem>,
) -> (Vec<f64>, Covariance) {
    let problem = without_second_joint(problem([1.0, 1.0]));
    let aids = MotionAids { instruments, ..MotionAids::default() };
    // The cut-off is an eighth of the rate: thinning keeps every fourth row.
    let options = Options { cutoff_hz: 1.0, ..Options::default() };
    let (theta, [covariance]) = estimate(&problem, estimator, [kind], aids, &options);
    (theta, covariance)
}

/// θ̂ by `estimator`, and its covariances.
fn estimate<const N: usize>(
    problem: &Problem,
    estimator: Estimator,
    kinds: [CovarianceKind; N],
    aids: MotionAids,
    options: &Options,
) -> (Vec<f64>, [Covariance; N]) {
    let estimate = Estimation::new(problem)
        .estimate(problem, &base_set(), estimator, &kinds, aids, options)
        .unwrap();
    let mut covariances = estimate.covariances.into_iter();
    (estimate.fit.theta, kinds.map(|_| covariances.next().unwrap().unwrap()))
}

fn without_second_joint(mut problem: Problem) -> Problem {
    problem.plan = ColumnPlan::explicit(&[(0..COLUMNS).collect()], COLUMNS);
    problem.panels.truncate(1);
    problem
}

fn assert_estimate(found: &[f64], expected: &[f64]) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < TOLERANCE, "{found} {expected}");
    }
}

#[test]
fn autoregressive_noise() {
    let golden = golden();
    let (theta, covariance) = first_joint(Estimator::Gls, CovarianceKind::Wls, None);
    assert_estimate(&theta, &golden.glsar_theta);
    assert_close(&covariance, 1.0, &golden.glsar);
}

#[test]
fn instrumental_variables() {
    let golden = golden();
    let mut instruments = without_second_joint(problem([1.0, 1.0]));
    for (c, column) in instruments.panels[0].x.chunks_exact_mut(SAMPLES).enumerate() {
        for (t, z) in column.iter_mut().enumerate() {
            *z += 0.2 * (0.11 * t as f64 + c as f64).sin();
        }
    }
    let (theta, covariance) = first_joint(Estimator::Iv, CovarianceKind::Ols, Some(&instruments));
    assert_estimate(&theta, &golden.iv_theta);
    assert_close(&covariance, 1.0, &golden.iv);
}

/// With joints that share their parameters, as in an arm, and with joints that have their own parameters, as in
/// Zellner's paper.
#[test]
fn seemingly_unrelated_equations() {
    let golden = golden();
    let all: Vec<usize> = (0..COLUMNS).collect();
    let later: Vec<usize> = (COLUMNS..2 * COLUMNS).collect();
    for (second, count, expected) in
        [(all.clone(), COLUMNS, golden.sur_shared), (later, 2 * COLUMNS, golden.sur_own)]
    {
        let mut rows = single_run(&[all.clone(), second], count);
        rows.panels = problem([1.0, 1.0]).panels;
        let shared = noise(0);
        rows.panels[1].y.iter_mut().zip(shared).for_each(|(y, e)| *y += 0.8 * e);
        // The first covariance leaves out the variance of the mixed rows, which is one except for what the weights do
        // not know.
        let kinds = [CovarianceKind::Paper, CovarianceKind::Ols];
        let (aids, options) = (MotionAids::default(), Options::default());
        let (theta, [bare, scaled]) = estimate(&rows, Estimator::Sur, kinds, aids, &options);
        assert_eq!(theta.len(), count);
        assert_estimate(&theta, &expected.theta);
        assert_close(&bare, 1.0, &expected.covariance);
        assert_close(&scaled, expected.variance, &expected.covariance);
    }
}

#[test]
fn rows_thinned_behind_a_low_pass() {
    let golden = golden();
    let (theta, covariance) = first_joint(Estimator::Decimated, CovarianceKind::Wls, None);
    assert_estimate(&theta, &golden.decimated_theta);
    assert_close(&covariance, 1.0, &golden.decimated);
}

/// Number of rows of a problem that vanishes towards its ends.
const SLOW: usize = 962;

/// Torque and columns that vary slowly, with first and last rows of 1e-14 of their height: a low-pass that lets them
/// pass changes them only by rounding errors.
fn slow_problem(periods: usize) -> Problem {
    let bases: Vec<usize> = (0..COLUMNS).collect();
    let mut problem = single_run(&[bases.clone(), bases], COLUMNS);
    (problem.samples, problem.periods) = (SLOW, periods);
    let bell = |t: usize| (-0.5 * ((t as f64 - 0.5 * SLOW as f64) / 60.0).powi(2)).exp();
    for (j, panel) in problem.panels.iter_mut().enumerate() {
        for c in 0..COLUMNS {
            panel.x.extend((0..SLOW).map(|t| bell(t) * column(j, c, t)));
        }
        for period in 0..periods {
            let rate = 0.05 + 0.03 * j as f64 + 0.017 * period as f64;
            let noise = |t: usize| (0.3 + j as f64) * (rate * t as f64).cos();
            let torque = |t: usize| column(j, 0, t) - 2.0 * column(j, 1, t) + noise(t);
            panel.y.extend((0..SLOW).map(|t| bell(t) * torque(t)));
        }
    }
    problem
}

/// The thinned estimate is weighted least squares on the rows that are kept: for a single run all but those near its
/// ends, for periods all rows. Of 962 rows, every second is kept, because every fourth, as asked, would select other
/// rows in the next period.
#[test]
fn thinned_rows_are_weighted_like_others() {
    for (periods, asked, every) in [(1, 1, 1), (1, 4, 4), (3, 1, 1), (3, 4, 2)] {
        let cutoff_hz = RATE_HZ / (2.0 * f64::from(asked) + 0.8);
        let options = Options { cutoff_hz, order: 10, ..Options::default() };
        let filter = ZeroPhase::new(options.cutoff_hz, options.order, RATE_HZ).unwrap();
        let edge = if periods == 1 { filter.edge_samples().min(SLOW / 8) } else { 0 };
        let thin = |series: &[f64]| -> Vec<f64> {
            let inside = series.chunks_exact(SLOW).map(|rows| &rows[edge..SLOW - edge]);
            inside.flat_map(|rows| rows.iter().step_by(every)).copied().collect()
        };
        let all = slow_problem(periods);
        let mut kept = all.clone();
        kept.samples = (SLOW - 2 * edge).div_ceil(every);
        for panel in &mut kept.panels {
            (panel.x, panel.y) = (thin(&panel.x), thin(&panel.y));
        }
        let by = |problem: &Problem, estimator: Estimator| {
            let kinds = [CovarianceKind::Wls];
            estimate(problem, estimator, kinds, MotionAids::default(), &options)
        };
        let (theta, [covariance]) = by(&all, Estimator::Decimated);
        let (expected, [of_kept]) = by(&kept, Estimator::Wls);
        assert_estimate(&theta, &expected);
        let apart = (covariance.matrix - &of_kept.matrix).amax() / of_kept.matrix.amax();
        assert!(apart < TOLERANCE, "{periods} periods, every {every}: {apart}");
    }
}

/// 24 joints, each with its own noise and parameters, and 200 series of residuals. With L Lᵀ = V over all series that
/// can be drawn, L⁻¹ V̂ L⁻ᵀ is one on average, with a standard error of √(2/(200 · 24)) = 2.0 %. The bound is four of
/// these.
#[test]
fn resampled_blocks_scatter_as_all_that_can_be_drawn() {
    let expected = golden().bootstrap;
    let joints = expected.len();
    let bases: Vec<Vec<usize>> = (0..joints).map(|j| vec![2 * j, 2 * j + 1]).collect();
    let mut problem = single_run(&bases, 2 * joints);
    (problem.samples, problem.periods) = (125, 2);
    for (j, panel) in problem.panels.iter_mut().enumerate() {
        for c in 0..2 {
            let rate = 0.05 * (j + 1) as f64 * (2 * c + 1) as f64;
            panel.x.extend((0..125).map(|t| (rate * f64::from(t) + 0.4 * c as f64).cos()));
        }
        let mut e = 0.0;
        panel.y.extend((0..250).map(|t| {
            e = ((0.37 + 0.11 * j as f64) * f64::from(t * t) + j as f64).sin() + 0.6 * e;
            e
        }));
    }
    let found = BlockBootstrap.covariance(&problem, &fit(&problem)).unwrap();
    // There are fifteen whole blocks of 2 s.
    assert_eq!(found.degrees_of_freedom, 14.0);
    let mut mean = Matrix2::zeros();
    for (j, [first, both, second]) in expected.into_iter().enumerate() {
        let expected = Matrix2::new(first, both, both, second);
        let inverse = Cholesky::new(expected).unwrap().l().try_inverse().unwrap();
        let own = found.matrix.fixed_view::<2, 2>(2 * j, 2 * j);
        mean += inverse * own * inverse.transpose() / joints as f64;
    }
    assert!((mean - Matrix2::identity()).amax() < 0.08, "{mean}");
}
