//! Finds friction that is held in the pauses of a motion, and leaves these rows out of the fit.
//!
//! The model's friction follows the velocity and is zero at rest. A joint that sticks holds anything between −F and F
//! there, with F its static friction: the controller pushes, and nothing moves. Taken for friction of zero, what it holds
//! has to come from the parameters of the arm. (Of a two-joint arm in another simulator whose joints stick, a first moment
//! came out as 3.0 for 3.75 kg m; without the rows of the pauses, as 3.69.) At rest, a joint that sticks says nothing of
//! the arm.
//!
//! The model is fitted without the pauses of all joints. If a joint does not stick, it also predicts its torque there. If
//! it does, the torque in the pauses is off by far more than while the joint moves, which is what other errors of the
//! model do: these are of one size in moves and pauses, because pauses lie at the ends of moves. Not so a torque that acts
//! only while the joint moves, such as friction that differs between directions: it passes for friction that is held.

use super::fit::{Fitter, Weighting};
use super::pauses::{LONG_S, Pauses};
use super::problem::Problem;
use crate::base::BaseSet;
use crate::dynamics::Parameter;
use crate::number::significant;
use crate::signal::{mean_period, rms};

/// Friction that one joint holds in its pauses.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldAtRest {
    /// The log, from 0.
    pub log: usize,
    /// The joint, from 0.
    pub joint: usize,
    /// Root mean square, over the pauses, of what is held in each of them on average, Nm.
    pub held_nm: f64,
    /// Its pauses in a period, or in the rows of a single run.
    pub pauses: Pauses,
    /// Share of the rows of the joint that are left out for them.
    pub share: f64,
    /// Whether the joint sticks: what else the model lacks would not show in pauses so much more than in motion.
    /// Otherwise it may stick, and its pauses are not left out.
    pub sticks: bool,
}

/// Ratio of rms residuals, in pauses and in motion, from which on a joint sticks. Means of [`LONG_S`] are compared. Where
/// joints stuck in another simulator, this ratio was between 4 and 30.
const STANDS_OUT: f64 = 3.0;
/// Rms of what is held over its scatter between the periods from which on it is no noise.
const CERTAIN: f64 = 10.0;
/// Least number of means, in pauses and in motion, that are compared along a single run, which has no scatter between periods.
/// Two rms values of ten independent means of noise differ by a factor of 3 in one of 1100 logs.
const LEAST_STRETCHES: usize = 10;
/// Smallest friction that is called held, relative to that in motion: a description of friction near rest is not exact.
const LEAST_HELD: f64 = 0.05;
/// Largest friction that a joint may hold at rest, relative to its dry friction while it moves: static friction may be
/// larger (a Stribeck curve), but not by far. Any torque that depends on the pose is constant at rest.
pub const MOST_HELD: f64 = 1.5;

impl HeldAtRest {
    /// Joints that hold friction in their pauses or may do so, along the motion of `problem`, in which they have these
    /// `pauses`. `ready` leaves the rows of pauses out of a problem and makes it ready for a fit.
    pub(super) fn of(
        problem: &Problem,
        set: &BaseSet,
        pauses: &[Pauses],
        ready: impl FnOnce(&mut Problem, &[Self]),
    ) -> Vec<Self> {
        let n = problem.samples;
        let of_joint = |(joint, pauses): (usize, &Pauses)| {
            let pauses = pauses.clone();
            let rows: usize = pauses.iter().map(Vec::len).sum();
            let share = rows as f64 / n as f64;
            (rows > 0).then_some(Self { log: 0, joint, held_nm: 0.0, pauses, share, sticks: false })
        };
        let all: Vec<Self> = pauses.iter().enumerate().filter_map(of_joint).collect();
        if all.is_empty() {
            return Vec::new();
        }
        let mut moving = problem.clone();
        ready(&mut moving, &all);
        // Pauses without which the motion does not excite all parameters are all that is known of some.
        let Ok(fit) = Fitter::new(&moving).fit(&moving, set, Weighting::PerJoint) else {
            return Vec::new();
        };
        all.into_iter().filter_map(|own| own.beside_base(problem, set, &fit.theta)).collect()
    }

    /// What the joint holds in its pauses beside the base parameters `theta`; see [`Self::beside`].
    fn beside_base(self, problem: &Problem, set: &BaseSet, theta: &[f64]) -> Option<Self> {
        let (n, joint) = (problem.samples, self.joint);
        let mean = mean_period(&problem.panels[joint].y, n);
        let left_by = |theta: &[f64]| -> Vec<f64> {
            let mut predicted = vec![0.0; n];
            problem.predict(joint, theta, &mut predicted);
            mean.iter().zip(&predicted).map(|(y, predicted)| y - predicted).collect()
        };
        let mut frictionless = theta.to_vec();
        for parameter in [Parameter::Coulomb(joint), Parameter::Viscous(joint)] {
            set.index_of(parameter).into_iter().for_each(|k| frictionless[k] = 0.0);
        }
        let coulomb_nm = set.index_of(Parameter::Coulomb(joint)).map_or(0.0, |k| theta[k]);
        let left = left_by(theta);
        self.beside(&left, &left_by(&frictionless), coulomb_nm, problem)
    }

    /// What the joint holds in its pauses beside a model of the log in `problem`. In the mean period, the model leaves
    /// `left_nm` of its torque, and `frictionless_nm` if it had no friction: what the model has for friction at rest is held
    /// as well. `coulomb_nm` is its dry friction in motion. `None` if noise alone explains what is left in the pauses.
    pub fn beside(
        self,
        left_nm: &[f64],
        frictionless_nm: &[f64],
        coulomb_nm: f64,
        problem: &Problem,
    ) -> Option<Self> {
        let (n, y) = (problem.samples, &problem.panels[self.joint].y);
        let length = (LONG_S * problem.rate_hz).ceil() as usize;
        let means = |runs: &[Vec<usize>]| -> Vec<f64> {
            let stretches = runs.iter().flat_map(|run| run.chunks_exact(length));
            stretches.map(|at| mean_at(left_nm, at)).collect()
        };
        let [in_pauses, in_motion] = [&self.pauses, &self.runs_between(n)].map(|runs| means(runs));
        let is_certain = if problem.periods > 1 {
            rms(&self.levels(left_nm)) >= CERTAIN * rms(&self.errors_of_levels(y, n))
        } else {
            in_pauses.len().min(in_motion.len()) >= LEAST_STRETCHES
        };
        if !is_certain {
            return None;
        }
        let stands_out = rms(&in_pauses) > STANDS_OUT * rms(&in_motion);
        let held_nm = rms(&self.levels(frictionless_nm));
        let is_of_friction = (LEAST_HELD..MOST_HELD).contains(&(held_nm / coulomb_nm));
        let sticks = stands_out && is_of_friction;
        Some(Self { held_nm, sticks, ..self })
    }

    /// The joint and what it holds.
    pub fn in_words(&self) -> String {
        let Self { joint, held_nm, pauses, share, .. } = self;
        format!(
            "joint {} ({} Nm rms in {} pauses, {:.0} % of its rows)",
            joint + 1,
            significant(*held_nm, 3),
            pauses.len(),
            100.0 * share
        )
    }

    /// Mean of one period of a signal over each pause.
    pub fn levels(&self, period: &[f64]) -> Vec<f64> {
        self.pauses.iter().map(|at| mean_at(period, at)).collect()
    }

    /// Standard error of the mean level of each pause in `y`, periods of `n` samples, by the scatter between them.
    pub fn errors_of_levels(&self, y: &[f64], n: usize) -> Vec<f64> {
        let periods = (y.len() / n) as f64;
        let error = |at: &Vec<usize>| {
            let levels: Vec<f64> = y.chunks_exact(n).map(|y| mean_at(y, at)).collect();
            let mean = levels.iter().sum::<f64>() / periods;
            let square = levels.iter().map(|own| (own - mean).powi(2)).sum::<f64>();
            (square / (periods * (periods - 1.0))).sqrt()
        };
        self.pauses.iter().map(error).collect()
    }

    /// Runs of rows between the pauses, in a period of `n` rows.
    fn runs_between(&self, n: usize) -> Vec<Vec<usize>> {
        let mut is_left_out = vec![false; n];
        self.pauses.iter().flatten().for_each(|k| is_left_out[*k] = true);
        let rows: Vec<usize> = (0..n).collect();
        let runs = rows.split(|k| is_left_out[*k]).filter(|run| !run.is_empty());
        runs.map(<[usize]>::to_vec).collect()
    }

    /// Leaves the rows of the pauses out of `problem`: their regressor and their torque become zero.
    pub fn leave_out(&self, problem: &mut Problem) {
        let n = problem.samples;
        let panel = &mut problem.panels[self.joint];
        let columns = panel.x.chunks_exact_mut(n).chain(panel.y.chunks_exact_mut(n));
        columns.for_each(|column| self.silence(column));
    }

    /// Spreads the scatter between periods, of which nothing is left in the pauses, over all rows: as a share of all, it is
    /// as large as without pauses. If harmonics are weighted by that scatter, σ is then that of the rows that are left.
    pub fn spread_scatter(&self, problem: &mut Problem) {
        let n = problem.samples;
        let y = &mut problem.panels[self.joint].y;
        let mean = mean_period(y, n);
        let growth = 1.0 / (1.0 - self.share).sqrt();
        for period in y.chunks_exact_mut(n) {
            period.iter_mut().zip(&mean).for_each(|(y, mean)| *y = mean + growth * (*y - mean));
        }
    }

    /// Sets one period of a signal to zero in the pauses.
    pub fn silence(&self, period: &mut [f64]) {
        self.pauses.iter().flatten().for_each(|k| period[*k] = 0.0);
    }
}

/// Mean of `y` over the samples `at`.
fn mean_at(y: &[f64], at: &[usize]) -> f64 {
    at.iter().map(|k| y[*k]).sum::<f64>() / at.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::ColumnPlan;
    use crate::identify::pauses::pauses;
    use crate::identify::problem::Panel;
    use crate::robot::JointSignals;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 100.0;
    const PERIODS: usize = 8;
    /// Two moves of a second each, forth and back, with a pause of a second behind each.
    const N: usize = 400;
    const EPSILON_RAD_S: f64 = 0.02;

    /// Velocity at sample `k`, rad/s.
    fn velocity(k: usize) -> f64 {
        let phase = std::f64::consts::TAU * (k % 100) as f64 / 100.0;
        [1.0 - phase.cos(), 0.0, phase.cos() - 1.0, 0.0][k / 100 % 4]
    }

    /// A joint with 1 Nm s/rad of viscous friction under noise of 0.1 Nm, and what `more` adds at each sample, Nm.
    fn problem(more: impl Fn(usize) -> f64) -> Problem {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let torque = (0..N * PERIODS).map(|k| velocity(k % N) + more(k % N) + 0.1 * noise());
        let panel = Panel { y: torque.collect(), x: (0..N).map(velocity).collect() };
        Problem {
            samples: N,
            periods: PERIODS,
            panels: vec![panel],
            ..Problem::new(ColumnPlan::explicit(&[vec![0]], 1), RATE_HZ)
        }
    }

    /// The pauses of the joint.
    fn paused() -> HeldAtRest {
        let qd_rad_s = JointSignals::from_fn(1, N, |_, k| velocity(k));
        let pauses = pauses(&qd_rad_s, 0, RATE_HZ, EPSILON_RAD_S);
        let rows: usize = pauses.iter().map(Vec::len).sum();
        let share = rows as f64 / N as f64;
        HeldAtRest { log: 0, joint: 0, held_nm: 0.0, pauses, share, sticks: false }
    }

    /// What is told of the joint beside its viscous friction and 5 Nm of Coulomb friction.
    fn told(problem: &Problem) -> Option<HeldAtRest> {
        let mean = mean_period(&problem.panels[0].y, N);
        let left: Vec<f64> = mean.iter().enumerate().map(|(k, y)| y - velocity(k)).collect();
        paused().beside(&left, &left, 5.0, problem)
    }

    /// The mean of a pause has a standard error of 0.1/√(100 · 8) = 0.0035 Nm; five of these are allowed.
    #[test]
    fn what_is_held_is_told() {
        let in_pauses = |k: usize| [0.0, 2.0, 0.0, -1.0][k / 100];
        let held = told(&problem(in_pauses)).expect("something is held");
        assert!(held.sticks && held.pauses.len() == 2, "{held:?}");
        // Moves begin and end within 0.25 ε, for 3 samples on either side of a pause.
        assert!((held.share - 0.5).abs() < 0.05, "{}", held.share);
        let levels = held.levels(&mean_period(&problem(in_pauses).panels[0].y, N));
        for (level, held) in levels.iter().zip([2.0, -1.0]) {
            // The samples of the moves hold nothing.
            assert!((level - held).abs() < 0.07 * held.abs() + 5.0 * 0.0035, "{levels:?}");
        }
    }

    /// The scatter of a single run is not known, but the moves between its pauses are. The first two seconds have one pause of
    /// a second, which is five means of 0.2 s: too few.
    #[test]
    fn a_single_run_tells_what_is_held_by_its_moves() {
        let mut run = problem(|k| [0.0, 2.0, 0.0, -1.0][k / 100]);
        let first = paused().pauses;
        let later = |pause: &Vec<usize>| pause.iter().map(|k| k + N).collect();
        let pauses = [first.clone(), first.iter().map(later).collect()].concat();
        run.unfold();
        let told = |samples: usize| {
            let mut run = run.clone();
            run.samples = samples;
            run.panels[0].x.truncate(samples);
            run.panels[0].y.truncate(samples);
            let y = &run.panels[0].y;
            let left: Vec<f64> = (0..samples).map(|k| y[k] - velocity(k % N)).collect();
            let mut held = HeldAtRest { pauses: pauses.clone(), ..paused() };
            held.pauses.retain(|pause| pause.iter().all(|k| *k < samples));
            held.beside(&left, &left, 5.0, &run)
        };
        assert!(told(2 * N).expect("something is held").sticks);
        assert_eq!(told(N / 2), None);
    }

    #[test]
    fn what_is_held_is_told_with_its_rows() {
        let pauses = vec![vec![0]; 5];
        let held = HeldAtRest { joint: 1, held_nm: 2.4431, pauses, share: 0.482, ..paused() };
        assert_eq!(held.in_words(), "joint 2 (2.44 Nm rms in 5 pauses, 48 % of its rows)");
    }

    #[test]
    fn noise_is_not_held() {
        assert_eq!(told(&problem(|_| 0.0)), None);
    }

    /// A torque that depends on the place is as large in motion as in pauses, and more than friction can be held by none.
    #[test]
    fn other_errors_are_no_friction() {
        let by_place =
            |k: usize| [0.01 * (k % 100) as f64, 1.0, 1.0 - 0.01 * (k % 100) as f64, 0.0][k / 100];
        let held = told(&problem(by_place)).expect("something is left");
        assert!(!held.sticks, "{held:?}");
        let held = told(&problem(|k| [0.0, 9.0, 0.0, -9.0][k / 100])).expect("something is left");
        assert!(!held.sticks, "{held:?}");
    }

    /// Without the pauses, nothing is left of what is held, and of the noise as much as in all rows: half of the rows have
    /// twice the square. 1600 of them know the square to √(2/1600) = 3.5 %, of which five are allowed.
    #[test]
    fn rows_that_are_left_out_are_zero() {
        let mut moving = problem(|k| [0.0, 2.0, 0.0, -1.0][k / 100]);
        let paused = paused();
        paused.leave_out(&mut moving);
        paused.spread_scatter(&mut moving);
        let Panel { x, y } = &moving.panels[0];
        for k in paused.pauses.iter().flatten() {
            assert!(x[*k] == 0.0 && y.iter().skip(*k).step_by(N).all(|y| *y == 0.0), "{k}");
        }
        let mean = mean_period(y, N);
        let square: f64 = y.iter().enumerate().map(|(k, y)| (y - mean[k % N]).powi(2)).sum();
        let noise = square / (N * (PERIODS - 1)) as f64;
        assert!((noise / 0.01 - 1.0).abs() < 5.0 * 0.035, "{noise}");
    }
}
