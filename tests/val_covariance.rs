//! Covariances against statsmodels (`golden/covariance.py`): ordinary and weighted least squares,
//! Newey–West with the joints of one instant added up, generalised least squares with autoregressive noise (GLSAR),
//! instrumental variables (IV2SLS), and blocks of time: corrected in row space, and without that statsmodels' clusters.

use armid::base::{BaseSet, Parameterisation};
use armid::identify::covariance::{
    BlockCluster, Covariance, CovarianceKind, CovarianceMethod, NeweyWest, OrdinaryLeastSquares,
};
use armid::identify::{
    ColumnPlan, Estimation, Estimator, Fit, Fitter, MotionAids, Options, Problem, Weighting,
};
use armid::robot::Arm;
use serde::Deserialize;

const SAMPLES: usize = 240;
const COLUMNS: usize = 3;
const LAGS: usize = 9;
/// Blocks of 5 s are then 40 samples.
const RATE_HZ: f64 = 8.0;
/// Both sides solve a well-conditioned problem in double precision.
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
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("golden/covariance.json")).unwrap()
}

/// The problem of the script, every joint's equation times its weight.
fn problem(weights: [f64; 2]) -> Problem {
    let bases: Vec<usize> = (0..COLUMNS).collect();
    let plan = ColumnPlan::explicit(&[bases.clone(), bases], COLUMNS);
    let mut problem = Problem::new(plan, RATE_HZ);
    problem.samples = SAMPLES;
    problem.periods = 1;
    for (j, panel) in problem.panels.iter_mut().enumerate() {
        let column = |c: usize, t: usize| {
            let rate = 0.013 * (j + 1) as f64 * (2 * c + 1) as f64;
            (rate * t as f64 + 0.4 * c as f64).cos()
        };
        let mut e = 0.0;
        for c in 0..COLUMNS {
            panel.x.extend((0..SAMPLES).map(|t| weights[j] * column(c, t)));
        }
        for t in 0..SAMPLES {
            e = (0.7 * (j + 1) as f64 * (t * t) as f64 + j as f64).sin() + 0.6 * e;
            let torque = column(0, t) - 2.0 * column(1, t) + 0.5 * column(2, t);
            panel.y.push(weights[j] * (torque + (0.5 + j as f64) * e));
        }
    }
    problem
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
    // statsmodels without its small-sample factor; ours is T/(T − b).
    let lost = SAMPLES as f64 / (SAMPLES - COLUMNS) as f64;
    assert_close(&hac, lost, &golden.hac);
    let blocks = BlockCluster.covariance(&problem, &fit).unwrap();
    assert_close(&blocks, 1.0, &golden.blocks);
    let freedom = blocks.degrees_of_freedom;
    assert!((freedom / golden.blocks_freedom - 1.0).abs() < TOLERANCE, "{freedom}");
}

/// The first joint alone by `estimator`.
fn first_joint(
    estimator: Estimator,
    kind: CovarianceKind,
    instruments: Option<&Problem>,
) -> (Vec<f64>, Covariance) {
    let problem = without_second_joint(problem([1.0, 1.0]));
    let aids = MotionAids { instruments, ..MotionAids::default() };
    let options = Options::default();
    let mut estimate = Estimation::new(&problem)
        .estimate(&problem, &base_set(), estimator, &[kind], aids, &options)
        .unwrap();
    (estimate.fit.theta, estimate.covariances.swap_remove(0).unwrap())
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
