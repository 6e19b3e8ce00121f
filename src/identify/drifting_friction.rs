//! Finds friction that drifts along a log whose motion repeats, and takes the drift out of its torque.
//!
//! Friction falls while an arm warms up, and its change between the periods would count as noise: it would widen σ, and
//! hide what the model lacks behind a scatter that is none. Friction that drifts as [`FrictionDrift`] describes is
//! tested joint by joint. On rows whitened as for the estimate ([`noise_of_rows`]), but without those of the periods'
//! means, with d the deviations from the mean of P periods, the four columns explain E of ‖d‖², and
//!
//! F = (E/4)/((‖d‖² − E)/ν), ν = rows (P − 1) − 4
//!
//! is compared with F(4, ν). Where nothing drifts, the log stays as it is, bit for bit.
//!
//! Otherwise the exponential gets the time constant, of a few ([`TIME_CONSTANTS`]), with which F is largest, and the
//! torque loses φ (f(t) − f̄), where f̄ is the mean over the whole log. What is left has the mean friction in every
//! period and throughout each of them, as the model has it. (Without the part of the drift that all periods share, the
//! change of f within a period, inertias of an arm that warms up by a quarter were off by 5 σ.) The coefficients of φ
//! and f come from the deviations alone. Their noise enters the mean period by that change, a P-th of the whole change
//! of f, and is not counted in σ. The scatter that the fit of the four columns takes is made up for, harmonic by
//! harmonic ([`FrictionDrift::kept`]); the degrees of freedom stay those of P periods.

use fourier::{Forward, Inverse};
use nalgebra::{Complex, SMatrix, SVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::friction_drift::{COLUMNS, FrictionDrift};
use super::prediction::resting_joints;
use super::problem::{Domain, Panel, Problem};
use super::whiten::{ROWS_END, Spectrum, noise_of_rows};
use crate::base::BaseSet;
use crate::dynamics::Parameter;
use crate::robot::JointSignals;
use crate::signal::{Replicates, mean_period, rms, subtract_mean_period};

/// Friction of one joint that drifts along a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftingFriction {
    /// The log, from 0.
    pub log: usize,
    /// The joint, from 0.
    pub joint: usize,
    /// Friction in the first and in the last period, each a mean while the joint moves, Nm.
    pub ends_nm: [f64; 2],
    /// Root mean square of the torque by which friction differs from its mean over the log, Nm.
    pub rms_nm: f64,
    /// F statistic of the drift.
    pub statistic: f64,
    /// Degrees of freedom of its F distribution.
    pub degrees_of_freedom: [f64; 2],
    /// Probability that noise alone gives a larger statistic.
    pub p_value: f64,
}

impl DriftingFriction {
    /// A drift is told below this probability that noise gives as much.
    ///
    /// Noise is whitened by its own scatter, which makes large statistics more likely than F says. Of 2000 clean series
    /// of eight periods each (white noise, and noise with a memory of up to a fifth of a period), up to 0.3 % were
    /// below 1e-3; of 3000 with four periods, 0.6 % where the memory was a twentieth of a period, and 0.1 % of these
    /// below 1e-4. Extrapolated, a clean log of six joints has a false drift with a probability of 2e-5, and of 2e-4 in
    /// the worst of these cases. A drift of eight periods that is missed makes up to about a fifth of the scatter in the
    /// twelve slowest harmonics.
    pub const REJECT_BELOW: f64 = 1e-6;
}

/// A drift below this share of the torque of its joint (rms) stays in it: a clock that drifts by 60 ppm along eight
/// periods of 10 s makes the torques of a UR10e differ by 0.8e-3 of it, in the shape of viscous friction.
const LEAST_SHARE: f64 = 1e-3;

/// Time constants of the exponential beside the straight line, as shares of the log. Drifts are looked for with a
/// quarter of it, which leaves 4 % of a drift with half of it as its time constant, and half of one with a twentieth.
/// The nearest of these shares leaves at most 1 %, and 9 % of a drift that is over within a period.
const TIME_CONSTANTS: [f64; 6] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0];

/// Drifting friction that was taken out of the torque of one joint.
pub(super) struct TakenOut {
    joint: usize,
    test: Test,
    /// The torque as recorded minus what is left, in all periods, Nm.
    removed_nm: Vec<f64>,
    /// Parts against the motion: of the drift in the first and the last period, Nm, and of the velocity, rad/s.
    ends_nm: [f64; 2],
    against_rad_s: f64,
    rms_nm: f64,
}

impl TakenOut {
    /// Takes all friction that drifts out of the torque of `problem`, a motion that repeats with the velocities
    /// `qd_rad_s` of one period.
    pub(super) fn of(
        problem: &mut Problem,
        qd_rad_s: &JointSignals,
        spectrum: &mut Spectrum,
    ) -> Vec<Self> {
        let (n, periods) = (problem.samples, problem.periods);
        let drift = FrictionDrift::beside_mean(qd_rad_s, periods);
        let rows = rows(problem, &drift, spectrum);
        let growth = drift.growth(n);
        let resting = resting_joints(qd_rad_s);
        let test = |j: usize| {
            let test = Test::of(&rows.panels[j], rows.samples, &growth)?;
            let is_told = !resting.contains(&j) && test.p_value < DriftingFriction::REJECT_BELOW;
            is_told.then_some((j, test))
        };
        let told: Vec<(usize, Test)> = (0..problem.joints()).filter_map(test).collect();
        if told.is_empty() {
            return Vec::new();
        }
        let fading = TIME_CONSTANTS.map(|fades| Fading::of(problem, qd_rad_s, fades, spectrum));
        let (forward, inverse) = (fourier::forward(n), fourier::inverse(n));
        let take_out = |(joint, test): (usize, Test)| {
            let by_statistic =
                |a: &&Fading, b: &&Fading| a.statistics[joint].total_cmp(&b.statistics[joint]);
            let Fading { drift, average, .. } = fading.iter().max_by(by_statistic)?;
            let y = &mut problem.panels[joint].y;
            let drift_nm = average.sum(joint, &drift.coefficients(joint, y, |_| true)?);
            let rms_nm = rms(&drift_nm);
            if rms_nm < LEAST_SHARE * rms(y) {
                return None;
            }
            let recorded = y.clone();
            y.iter_mut().zip(&drift_nm).for_each(|(y, drift)| *y -= drift);
            let kept = drift.kept(joint, n, |period| coefficients(period, &forward));
            make_up(y, &kept, &forward, &inverse);
            let removed_nm = recorded.iter().zip(&*y).map(|(all, left)| all - left).collect();
            let [first, last] = [0, n * (periods - 1)];
            let against = |torque: &[f64]| drift.against_motion(joint, torque);
            Some(Self {
                joint,
                test,
                removed_nm,
                ends_nm: [first, last].map(|k| against(&drift_nm[k..k + n])),
                against_rad_s: against(qd_rad_s.joint(joint)),
                rms_nm,
            })
        };
        told.into_iter().filter_map(take_out).collect()
    }

    /// Takes the drift out of the scatter of the torque as well, with the torque that is left in `problem`. Filled-in
    /// rows leave the share `kept` of the scatter ([`Prepared::kept`](super::Prepared::kept)).
    pub(super) fn leave(&self, replicates: &mut Replicates, problem: &Problem, kept: f64) {
        let (n, periods) = (problem.samples, problem.periods);
        let y = &problem.panels[self.joint].y;
        replicates.mean.joint_mut(self.joint).copy_from_slice(&mean_period(y, n));
        let deviations = replicates.deviations.joint_mut(self.joint);
        deviations.copy_from_slice(y);
        subtract_mean_period(deviations, n);
        let square = deviations.iter().map(|d| d * d).sum::<f64>();
        replicates.sigma[self.joint] = (square / ((n * (periods - 1)) as f64 * kept)).sqrt();
    }

    /// Puts the drift back into `problem`.
    pub(super) fn put_back(&self, problem: &mut Problem) {
        let y = problem.panels[self.joint].y.iter_mut();
        y.zip(&self.removed_nm).for_each(|(y, removed)| *y += removed);
    }

    /// What is told of the drift beside the friction in the base parameters `theta`, which is the mean over the log.
    pub(super) fn finding(&self, set: &BaseSet, theta: &[f64]) -> DriftingFriction {
        let value = |parameter: Parameter| set.index_of(parameter).map_or(0.0, |k| theta[k]);
        let mean_nm = value(Parameter::Coulomb(self.joint))
            + value(Parameter::Viscous(self.joint)) * self.against_rad_s;
        let Test { statistic, degrees_of_freedom, p_value } = self.test;
        DriftingFriction {
            log: 0,
            joint: self.joint,
            ends_nm: self.ends_nm.map(|end| mean_nm + end),
            rms_nm: self.rms_nm,
            statistic,
            degrees_of_freedom,
            p_value,
        }
    }
}

/// Drifts with one time constant.
struct Fading {
    /// Beside the mean over the periods.
    drift: FrictionDrift,
    /// Beside friction at its average.
    average: FrictionDrift,
    /// F statistic per joint, or zero.
    statistics: Vec<f64>,
}

impl Fading {
    /// Drifts whose exponential fades within the share `fades` of the log; the rest as for [`TakenOut::of`].
    fn of(problem: &Problem, qd_rad_s: &JointSignals, fades: f64, spectrum: &mut Spectrum) -> Self {
        let (n, periods) = (problem.samples, problem.periods);
        let drift = FrictionDrift::fading_beside_mean(qd_rad_s, periods, fades);
        let rows = rows(problem, &drift, spectrum);
        let growth = drift.growth(n);
        let statistic = |panel: &Panel| {
            Test::of(panel, rows.samples, &growth).map_or(0.0, |test| test.statistic)
        };
        let statistics = rows.panels.iter().map(statistic).collect();
        let average = FrictionDrift::fading_beside_average(qd_rad_s, periods, fades);
        Self { drift, average, statistics }
    }
}

/// The columns of `drift` over the first period and the torque of all periods, for every joint, as mean and harmonics.
/// The columns are no base parameters: the plan of the rows has no meaning.
fn rows(problem: &Problem, drift: &FrictionDrift, spectrum: &mut Spectrum) -> Problem {
    let n = problem.samples;
    let panel =
        |(j, panel): (usize, &Panel)| Panel { x: drift.first_period(j, n), y: panel.y.clone() };
    let in_time = Problem {
        plan: problem.plan.clone(),
        samples: n,
        periods: problem.periods,
        rate_hz: problem.rate_hz,
        domain: Domain::Time,
        panels: problem.panels.iter().enumerate().map(panel).collect(),
    };
    let mut rows = Problem::new(problem.plan.clone(), problem.rate_hz);
    spectrum.transform(&in_time, (ROWS_END * n as f64) as usize, &mut rows);
    rows
}

/// The F test of one joint.
#[derive(Debug, Clone, Copy)]
struct Test {
    statistic: f64,
    degrees_of_freedom: [f64; 2],
    p_value: f64,
}

impl Test {
    /// Tests the `n` rows of every period in `panel`, whose columns are those of the first period and have the factor
    /// `growth` in each. `None` for a joint that stands still or whose torque does not scatter.
    ///
    /// The first row, the mean of a period, is left out. Where the zero of a torque creeps, the means differ far more than
    /// the rows beside them, from which their noise is taken, and even friction that is nearly the same in both directions
    /// has a small mean: a zero that crept by one σ of single samples along eight periods was told as friction of joint 6
    /// of a UR5 (p = 5e-9, and 0.3 without that row), whose sign has a mean of 0.014. Of friction that drifts, the means
    /// tell hardly anything: F was 401 with them, and 399 without.
    fn of(panel: &Panel, n: usize, growth: &[SVector<f64, COLUMNS>]) -> Option<Self> {
        let mut deviations = panel.y.clone();
        subtract_mean_period(&mut deviations, n);
        let variances = noise_of_rows(&deviations, n);
        let used: Vec<usize> = (1..n).filter(|k| variances[*k] > 0.0).collect();
        let column = |k: usize| SVector::<f64, COLUMNS>::from_fn(|c, _| panel.x[c * n + k]);
        let mut overlap = SMatrix::<f64, COLUMNS, COLUMNS>::zeros();
        for k in &used {
            let x = column(*k);
            overlap += x * x.transpose() / variances[*k];
        }
        let mut right = SVector::<f64, COLUMNS>::zeros();
        let mut all = 0.0;
        for (deviations, growth) in deviations.chunks_exact(n).zip(growth) {
            let mut along = SVector::<f64, COLUMNS>::zeros();
            for k in &used {
                let weighted = deviations[*k] / variances[*k];
                along += column(*k) * weighted;
                all += deviations[*k] * weighted;
            }
            right += along.component_mul(growth);
        }
        let grown = growth
            .iter()
            .fold(SMatrix::<f64, COLUMNS, COLUMNS>::zeros(), |sum, g| sum + g * g.transpose());
        let gram = overlap.component_mul(&grown).cholesky()?;
        let explained = right.dot(&gram.solve(&right));
        let first = COLUMNS as f64;
        let second = (used.len() * (growth.len() - 1)) as f64 - first;
        // Without any noise beside the drift, rounding is left.
        let left = (all - explained).max(f64::EPSILON * all);
        let statistic = explained / first / (left / second);
        let p_value = FisherSnedecor::new(first, second).ok()?.sf(statistic);
        Some(Self { statistic, degrees_of_freedom: [first, second], p_value })
    }
}

/// Unitary Fourier coefficients of one period.
fn coefficients(period: &[f64], forward: &Forward) -> Vec<Complex<f64>> {
    let mut time = period.to_vec();
    let mut out = forward.make_output_vec();
    // The lengths are those of the plan, so that the transform succeeds.
    let _ = forward.process(&mut time, &mut out);
    let scale = 1.0 / (period.len() as f64).sqrt();
    out.iter_mut().for_each(|c| *c *= scale);
    out
}

/// Divides every harmonic of the deviations between the periods of `y` by the share of it that is `kept`.
fn make_up(y: &mut [f64], kept: &[f64], forward: &Forward, inverse: &Inverse) {
    let n = forward.len();
    let mean = mean_period(y, n);
    subtract_mean_period(y, n);
    let scale = 1.0 / (n as f64).sqrt();
    for period in y.chunks_exact_mut(n) {
        let mut spectrum = coefficients(period, forward);
        spectrum.iter_mut().zip(kept).for_each(|(c, kept)| *c *= scale / kept);
        spectrum[0].im = 0.0;
        if n.is_multiple_of(2) {
            spectrum[n / 2].im = 0.0;
        }
        // The lengths are those of the plan, so that the transform succeeds.
        let _ = inverse.process(&mut spectrum, period);
        period.iter_mut().zip(&mean).for_each(|(y, mean)| *y += mean);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{ColumnPlan, Parameterisation};
    use crate::robot::Arm;
    use crate::signal::replicate_noise;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const N: usize = 500;
    const PERIODS: usize = 8;
    /// Coulomb friction, Nm, and viscous friction, Nm s/rad.
    const FRICTION: [f64; 2] = [10.0, 5.0];

    /// Velocities of two joints, rad/s.
    fn velocities() -> JointSignals {
        let omega = std::f64::consts::TAU / N as f64;
        JointSignals::from_fn(2, N, |j, k| {
            let phase = omega * k as f64;
            (phase + j as f64).sin() + 0.5 * ((2 + j) as f64 * phase).cos()
        })
    }

    fn friction(qd: f64) -> f64 {
        FRICTION[0] * (qd / 0.02).tanh() + FRICTION[1] * qd
    }

    /// Share by which friction has fallen at sample `k`.
    fn fallen(k: usize) -> f64 {
        1.0 - (-(k as f64) / 3000.0).exp()
    }

    /// The torque of both joints under noise of 1 Nm; the friction of the second one falls by `fraction`.
    fn problem(seed: u64, fraction: f64) -> Problem {
        let qd = velocities();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let panel = |j: usize| Panel {
            x: Vec::new(),
            y: (0..N * PERIODS)
                .map(|k| {
                    let repeats = 30.0 * (0.04 * (k % N) as f64).cos();
                    let factor = 1.0 - if j == 1 { fraction * fallen(k) } else { 0.0 };
                    repeats + factor * friction(qd.joint(j)[k % N]) + noise()
                })
                .collect(),
        };
        let panels: Vec<Panel> = (0..2).map(panel).collect();
        Problem {
            samples: N,
            periods: PERIODS,
            panels,
            ..Problem::new(ColumnPlan::explicit(&[vec![0], vec![0]], 1), 100.0)
        }
    }

    fn torque(problem: &Problem) -> JointSignals {
        JointSignals::from_fn(2, N * PERIODS, |j, k| problem.panels[j].y[k])
    }

    /// Friction of some 13 Nm falls by 2.2 Nm between the first and the last period. The noise moves that change by 0.055
    /// Nm (standard deviation), of which five are allowed. The scatter of 3500 degrees of freedom is known to 1.2 %, of
    /// which five are allowed; with the drift it was 1.25 Nm.
    #[test]
    fn falling_friction_is_told_and_leaves_the_noise() {
        let (qd, mut problem) = (velocities(), problem(1, 0.25));
        let recorded = torque(&problem);
        let mut replicates = replicate_noise(&recorded, N).unwrap();
        assert!(replicates.sigma[1] > 1.15, "{}", replicates.sigma[1]);
        let found = TakenOut::of(&mut problem, &qd, &mut Spectrum::default());
        let [found] = &found[..] else { panic!("{} joints", found.len()) };
        found.leave(&mut replicates, &problem, 1.0);
        assert!((replicates.sigma[1] - 1.0).abs() < 0.06, "{}", replicates.sigma[1]);
        let left = replicate_noise(&torque(&problem), N).unwrap();
        assert!((replicates.sigma[1] / left.sigma[1] - 1.0).abs() < 1e-12, "{}", left.sigma[1]);

        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        let mut theta = vec![0.0; set.rank()];
        theta[set.index_of(Parameter::Coulomb(1)).unwrap()] = FRICTION[0];
        theta[set.index_of(Parameter::Viscous(1)).unwrap()] = FRICTION[1];
        let DriftingFriction { joint, ends_nm: [first, last], rms_nm, p_value, .. } =
            found.finding(&set, &theta);
        let qd = qd.joint(1);
        let sign = |k: usize| (qd[k % N] / 0.02).tanh();
        let squares: f64 = (0..N).map(|k| sign(k).powi(2)).sum();
        let against = |from: usize, share: fn(usize) -> f64| {
            let samples = from..from + N;
            samples.map(|k| sign(k) * share(k) * friction(qd[k % N])).sum::<f64>() / squares
        };
        let fall = 0.25 * (against(N * (PERIODS - 1), fallen) - against(0, fallen));
        assert!((first - last - fall).abs() < 0.28, "{first} {last} {fall}");
        // The friction in the parameters is that of the mean, which lies between the ends.
        let own = against(0, |_| 1.0);
        assert!(last < own && own < first, "{first} {own} {last}");
        assert!(joint == 1 && p_value < 1e-30 && rms_nm > 0.5, "{joint} {p_value:e} {rms_nm}");

        found.put_back(&mut problem);
        let off = torque(&problem)
            .joint(1)
            .iter()
            .zip(recorded.joint(1))
            .map(|(a, b)| a - b)
            .fold(0.0, |largest: f64, off| largest.max(off.abs()));
        // Torques of up to 60 Nm, rounded.
        assert!(off < 1e-12, "{off:e}");
    }

    /// One of forty joints is told by chance once in 10⁴ seeds.
    #[test]
    fn friction_that_stays_is_left_as_it_is() {
        for seed in 0..20 {
            let mut problem = problem(seed, 0.0);
            let before = torque(&problem);
            let found = TakenOut::of(&mut problem, &velocities(), &mut Spectrum::default());
            assert!(found.is_empty(), "seed {seed}");
            assert_eq!(torque(&problem), before);
        }
    }

    /// The zero of both torques creeps by five times the noise. Told by the means of the periods as well, that was
    /// friction, with a probability below 1e-22 in each of these.
    #[test]
    fn a_zero_that_creeps_is_no_friction() {
        for seed in 0..4 {
            let mut problem = problem(seed, 0.0);
            for panel in &mut problem.panels {
                let samples = panel.y.len() as f64;
                panel.y.iter_mut().enumerate().for_each(|(k, y)| *y += 5.0 * k as f64 / samples);
            }
            let found = TakenOut::of(&mut problem, &velocities(), &mut Spectrum::default());
            assert!(found.is_empty(), "seed {seed}");
        }
    }

    /// Two periods that differ by their first harmonic, of which half is kept: it is doubled, and nothing else changes.
    #[test]
    fn what_was_lost_is_made_up_for() {
        let n = 20;
        let wave = |k: usize| (std::f64::consts::TAU * k as f64 / n as f64).cos();
        let repeats = |k: usize| 3.0 + (k % n) as f64;
        let sign = |k: usize| if k < n { 1.0 } else { -1.0 };
        let mut y: Vec<f64> = (0..2 * n).map(|k| repeats(k) + sign(k) * (wave(k) + 0.1)).collect();
        let mut kept = vec![1.0; n / 2 + 1];
        kept[1] = 0.5;
        make_up(&mut y, &kept, &fourier::forward(n), &fourier::inverse(n));
        for (k, y) in y.iter().enumerate() {
            let expected = repeats(k) + sign(k) * (2.0 * wave(k) + 0.1);
            assert!((y - expected).abs() < 1e-12, "{k}: {y} {expected}");
        }
    }
}
