//! Repeats the paper's section IV on the simulated arm and studies where negative rotor inertias come from.

use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use super::error::StudyError;
use super::mass_matrix::indefinite_share;
use super::paper_equations::{Acceleration, PaperEquations};
use crate::base::{BaseSet, Parameterisation};
use crate::dynamics::{Model, Parameter};
use crate::excitation::{Excitation, FourierSeries};
use crate::identify::{Fit, Fitter, Problem, Residual, Weighting};
use crate::montecarlo::scenario::Scenario;
use crate::montecarlo::simulation::Simulation;
use crate::plant::Measured;
use crate::plant::faults::{Effect, Presliding, TimeSkew};
use crate::robot::JointSignals;

/// Results of section IV on the simulated arm.
#[derive(Debug, Clone, Serialize)]
pub struct PaperStudy {
    /// Name of the scenario.
    pub scenario: String,
    /// Description of the scenario, in a sentence.
    pub description: String,
    /// Number of time samples m of each trajectory.
    pub samples: usize,
    /// Rate of the log, Hz.
    pub rate_hz: f64,
    /// e_N due to the torque noise alone: √(Σ_j s_j² / m).
    pub noise_e_n: f64,
    /// Prediction errors for every arm, parameter set and processing.
    pub errors: Vec<ErrorResult>,
    /// Number of repetitions with fresh noise from which the scatter of the parameters is computed.
    pub trials: u64,
    /// The paper's parameters (30).
    pub parameters: Vec<ParameterResult>,
    /// Torque errors when the arm leaves rest, with the scenario's hidden effects and without them.
    pub starts: [StartResult; 2],
    /// Candidate mechanisms for negative rotor inertias.
    pub mechanisms: Vec<MechanismResult>,
    /// The series that figures 2, 3, 5–7 and 8–11 show.
    #[serde(skip)]
    pub traces: [Trace; 2],
}

/// Prediction error of one model.
#[derive(Debug, Clone, Serialize)]
pub struct ErrorResult {
    /// Whether the arm has the scenario's hidden effects.
    pub hidden_effects: bool,
    /// Number of parameters of the model.
    pub parameters: usize,
    /// Whether the torque went through the low-pass too.
    pub torque_filtered: bool,
    /// The paper's error measure (21) on the identification and on the validation trajectory.
    pub e_n: [f64; 2],
    /// Rms of the validation error per joint, Nm.
    pub validation_rms_nm: Vec<f64>,
    /// Rms per joint of the difference between the predicted torque and the torque without noise, Nm.
    pub validation_rms_without_noise_nm: Vec<f64>,
}

/// One of the paper's 33 parameters.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterResult {
    /// The linear combination of standard parameters.
    pub formula: String,
    /// Unit.
    pub unit: String,
    /// True value for the simulated arm; standard parameters that the set leaves out are taken as zero.
    pub truth: f64,
    /// Estimate from the first trial.
    pub estimate: f64,
    /// σ of the first trial by (20).
    pub sigma_paper: f64,
    /// Mean of the estimates over the trials.
    pub mean: f64,
    /// Standard deviation of the estimates over the trials.
    pub sigma_empirical: f64,
}

/// Torque error when the motion starts from rest.
#[derive(Debug, Clone, Serialize)]
pub struct StartResult {
    /// Whether the arm has the scenario's hidden effects.
    pub hidden_effects: bool,
    /// Measured minus predicted torque at t = 0 without noise, Nm.
    pub error_at_zero_nm: Vec<f64>,
    /// Rms of measured minus predicted torque over the whole trajectory, Nm.
    pub rms_nm: Vec<f64>,
    /// Identified Coulomb friction, Nm.
    pub coulomb_nm: Vec<f64>,
}

/// Effect of one mechanism on the identified rotor inertias.
#[derive(Debug, Clone, Serialize)]
pub struct MechanismResult {
    /// The mechanism.
    pub mechanism: Mechanism,
    /// Identified i_G² C_M of joints 3 … 6 without noise, kg m².
    pub rotor_inertia_kg_m2: [f64; 4],
    /// e_N on the identification trajectory, with the noise of the first trial.
    pub e_n: f64,
    /// Share of random poses in which the identified mass matrix is not positive definite.
    pub indefinite_share: f64,
    /// Smallest eigenvalue of the mass matrix over these poses, kg m².
    pub smallest_eigenvalue_kg_m2: f64,
}

/// A mechanism that may cause negative rotor inertias.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Mechanism {
    /// No mechanism: the reduced model on the rigid arm.
    Nothing,
    /// All torques are read late.
    Delay {
        /// Delay, s.
        delay_s: f64,
    },
    /// The dry friction of all joints builds up over an angle (presliding).
    Presliding {
        /// Inverse of the angle, 1/rad.
        stiffness_per_rad: f64,
    },
    /// Both a delay and presliding.
    DelayAndPresliding {
        /// See [`Self::Delay`].
        delay_s: f64,
        /// See [`Self::Presliding`].
        stiffness_per_rad: f64,
    },
    /// (33) is used as printed.
    LiteralFilter {
        /// Input of (33).
        acceleration: Acceleration,
    },
}

impl std::fmt::Display for Mechanism {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Nothing => write!(f, "nothing hidden"),
            Self::Delay { delay_s } => write!(f, "torque {:.0} ms late", 1e3 * delay_s),
            Self::Presliding { stiffness_per_rad } => {
                write!(f, "presliding over {:.1} mrad", 1e3 / stiffness_per_rad)
            }
            Self::DelayAndPresliding { delay_s, stiffness_per_rad } => write!(
                f,
                "torque {:.0} ms late and presliding over {:.1} mrad",
                1e3 * delay_s,
                1e3 / stiffness_per_rad
            ),
            Self::LiteralFilter { acceleration: Acceleration::LiteralFromAngle } => {
                write!(f, "(33) taken literally on the angle")
            }
            Self::LiteralFilter { .. } => write!(f, "(33) taken literally on the velocity"),
        }
    }
}

/// Delays that are tried, s: 1 … 12.5 samples at 125 Hz.
const DELAYS_S: [f64; 6] = [0.008, 0.016, 0.024, 0.050, 0.075, 0.100];
/// Presliding stiffnesses that are tried, 1/rad.
const STIFFNESS_PER_RAD: [f64; 4] = [1000.0, 300.0, 100.0, 30.0];

impl Mechanism {
    /// All mechanisms that are tried.
    pub fn all() -> Vec<Self> {
        let delays = DELAYS_S.map(|delay_s| Self::Delay { delay_s });
        let presliding =
            STIFFNESS_PER_RAD.map(|stiffness_per_rad| Self::Presliding { stiffness_per_rad });
        let both = [(0.024, 100.0), (0.050, 300.0)].map(|(delay_s, stiffness_per_rad)| {
            Self::DelayAndPresliding { delay_s, stiffness_per_rad }
        });
        let literal = [Acceleration::LiteralFromVelocity, Acceleration::LiteralFromAngle]
            .map(|acceleration| Self::LiteralFilter { acceleration });
        [Self::Nothing]
            .into_iter()
            .chain(delays)
            .chain(presliding)
            .chain(both)
            .chain(literal)
            .collect()
    }

    fn effects(&self, joints: usize) -> Vec<Effect> {
        let late = |delay_s| Effect::TimeSkew(TimeSkew { joint: None, delay_s });
        let bristles = |stiffness_per_rad| {
            (1..=joints)
                .map(move |joint| Effect::Presliding(Presliding::new(joint, stiffness_per_rad)))
        };
        match *self {
            Self::Nothing | Self::LiteralFilter { .. } => Vec::new(),
            Self::Delay { delay_s } => vec![late(delay_s)],
            Self::Presliding { stiffness_per_rad } => bristles(stiffness_per_rad).collect(),
            Self::DelayAndPresliding { delay_s, stiffness_per_rad } => {
                [late(delay_s)].into_iter().chain(bristles(stiffness_per_rad)).collect()
            }
        }
    }

    fn equations(&self) -> PaperEquations {
        match *self {
            Self::LiteralFilter { acceleration } => {
                PaperEquations { acceleration, ..PaperEquations::PAPER }
            }
            _ => PaperEquations::PAPER,
        }
    }
}

/// Series of one trajectory as the figures show them.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Time from the start, s.
    pub time_s: Vec<f64>,
    /// Measured angles, rad.
    pub q_rad: JointSignals,
    /// Measured motor currents, A.
    pub current_a: JointSignals,
    /// Measured torque, Nm.
    pub measured_nm: JointSignals,
    /// Torque predicted with the parameters from the identification trajectory, Nm.
    pub predicted_nm: JointSignals,
}

/// The first period brings the arm to the start of the motion; the paper's 20 s follow.
const LEAD_PERIODS: usize = 1;

/// A run of the arm along one trajectory, cut to the window that the paper logs.
struct Run {
    simulation: Simulation,
    window: Range<usize>,
}

impl Run {
    fn of(scenario: Scenario) -> Result<Self, StudyError> {
        let found = scenario.excitation.periods();
        if found <= LEAD_PERIODS {
            return Err(StudyError::Periods {
                scenario: scenario.name,
                found,
                needed: LEAD_PERIODS + 1,
                why: "the first one leads to the start",
            });
        }
        let simulation = Simulation::run(scenario)?;
        let scenario = &simulation.scenario;
        let period_s = scenario.excitation.series().period_s;
        let [begin_s, end_s] = scenario.excitation.periodic_window_s();
        let start_s = begin_s + LEAD_PERIODS as f64 * period_s;
        let at = |t: f64| simulation.recording.time_s.partition_point(|s| *s < t - 1e-9);
        let window = at(start_s)..at(end_s);
        Ok(Self { window, simulation })
    }

    fn rate_hz(&self) -> f64 {
        self.simulation.scenario.plant.log_rate_hz
    }

    fn log(&self, trial: u64) -> Result<Measured, StudyError> {
        Ok(self.simulation.log(trial)?)
    }

    fn noise_free(&self) -> Measured {
        Measured::like(&self.simulation.without_noise())
    }

    fn problem(
        &self,
        model: &Model,
        set: &BaseSet,
        equations: &PaperEquations,
        log: &Measured,
    ) -> Result<Problem, StudyError> {
        let rows = 0..self.window.len();
        Ok(equations.assemble(model, set, log, self.rate_hz(), self.window.clone(), rows)?)
    }
}

fn least_squares(problem: &Problem, set: &BaseSet) -> Result<Fit, StudyError> {
    Ok(Fitter::new(problem).fit(problem, set, Weighting::Equal)?)
}

/// e_N and rms of `theta` along `problem`.
fn residual(problem: &Problem, theta: &[f64]) -> Residual {
    let torque: Vec<f64> = problem.panels.iter().map(|p| p.y.iter().map(|v| v * v).sum()).collect();
    Residual::from_squares(&problem.residual_squares(theta), &torque, problem.samples)
}

/// Repeats section IV on `scenario`'s arm. `validation` is the second trajectory and `trials` the number of repetitions
/// with fresh noise. `progress` is called with the number of runs of the arm that are done.
pub fn paper_study(
    scenario: &Scenario,
    validation: FourierSeries,
    trials: u64,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<PaperStudy, StudyError> {
    let second =
        Excitation::new(validation, scenario.excitation.run_in_s(), scenario.excitation.periods())?;
    let done = std::sync::atomic::AtomicU64::new(0);
    let run = |effects: Vec<Effect>, excitation: &Excitation| -> Result<Run, StudyError> {
        let name = if *excitation == scenario.excitation {
            scenario.name.clone()
        } else {
            format!("{} validation", scenario.name)
        };
        let excitation = excitation.clone();
        let run = Run::of(Scenario { name, effects, excitation, ..scenario.clone() })?;
        progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1);
        Ok(run)
    };
    let model = Model::new(&scenario.arm);
    let joints = scenario.arm.dof();
    let paper = &scenario.set;
    let full = BaseSet::find(&scenario.arm, Parameterisation::full(joints, false))?;

    let hidden = &scenario.effects;
    let pairs = [(hidden.clone(), true), (Vec::new(), false)]
        .into_par_iter()
        .map(|(effects, is_hidden)| {
            let first = run(effects.clone(), &scenario.excitation)?;
            Ok((is_hidden, [first, run(effects, &second)?]))
        })
        .collect::<Result<Vec<(bool, [Run; 2])>, StudyError>>()?;

    let mut errors = Vec::new();
    for (hidden_effects, runs) in &pairs {
        for set in [paper, &full] {
            for torque_filtered in [false, true] {
                let equations = PaperEquations { torque_filtered, ..PaperEquations::PAPER };
                let error = prediction_error(&model, set, &equations, runs)?;
                errors.push(ErrorResult { hidden_effects: *hidden_effects, ..error });
            }
        }
    }
    let (_, runs) = &pairs[0];
    let sd = scenario.sensors.torque_sd_per_joint_nm(joints)?;
    let samples = runs[0].window.len();
    let mechanisms = Mechanism::all()
        .into_par_iter()
        .map(|mechanism| {
            let run = run(mechanism.effects(joints), &scenario.excitation)?;
            tried(&model, paper, mechanism, &run)
        })
        .collect::<Result<_, StudyError>>()?;
    let start = |(hidden_effects, runs): &(bool, [Run; 2])| {
        let result = start(&model, paper, &runs[0])?;
        Ok::<_, StudyError>(StartResult { hidden_effects: *hidden_effects, ..result })
    };
    Ok(PaperStudy {
        scenario: scenario.name.clone(),
        description: scenario.description.clone(),
        samples,
        rate_hz: scenario.plant.log_rate_hz,
        noise_e_n: (sd.iter().map(|s| s * s).sum::<f64>() / samples as f64).sqrt(),
        errors,
        trials,
        parameters: parameters(&model, paper, &runs[0], trials)?,
        starts: [start(&pairs[0])?, start(&pairs[1])?],
        mechanisms,
        traces: traces(&model, paper, runs)?,
    })
}

/// Number of runs of the arm in a study, for its progress.
pub fn paper_study_runs() -> u64 {
    4 + Mechanism::all().len() as u64
}

fn prediction_error(
    model: &Model,
    set: &BaseSet,
    equations: &PaperEquations,
    runs: &[Run; 2],
) -> Result<ErrorResult, StudyError> {
    let [first, second] = runs;
    let identification = first.problem(model, set, equations, &first.log(0)?)?;
    let theta = least_squares(&identification, set)?.theta;
    let validation = second.problem(model, set, equations, &second.log(0)?)?;
    let without_noise = second.problem(model, set, equations, &second.noise_free())?;
    let validated = residual(&validation, &theta);
    Ok(ErrorResult {
        hidden_effects: false,
        parameters: set.rank(),
        torque_filtered: equations.torque_filtered,
        e_n: [residual(&identification, &theta).e_n, validated.e_n],
        validation_rms_nm: validated.rms_nm,
        validation_rms_without_noise_nm: residual(&without_noise, &theta).rms_nm,
    })
}

fn parameters(
    model: &Model,
    set: &BaseSet,
    run: &Run,
    trials: u64,
) -> Result<Vec<ParameterResult>, StudyError> {
    let estimate = |trial: u64| -> Result<Fit, StudyError> {
        let problem = run.problem(model, set, &PaperEquations::PAPER, &run.log(trial)?)?;
        least_squares(&problem, set)
    };
    let first = estimate(0)?;
    let all = (0..trials)
        .into_par_iter()
        .map(|trial| Ok(estimate(trial)?.theta))
        .collect::<Result<Vec<Vec<f64>>, StudyError>>()?;
    let truth = set.values(&model.standard_parameters());
    let count = trials as f64;
    Ok((0..set.rank())
        .map(|k| {
            let mean = all.iter().map(|theta| theta[k]).sum::<f64>() / count;
            let square = all.iter().map(|theta| (theta[k] - mean).powi(2)).sum::<f64>();
            ParameterResult {
                formula: set.formula(k),
                unit: set.unit(k).to_owned(),
                truth: truth[k],
                estimate: first.theta[k],
                sigma_paper: first.inverse.row(k).norm(),
                mean,
                sigma_empirical: (square / (count - 1.0)).sqrt(),
            }
        })
        .collect())
}

fn start(model: &Model, set: &BaseSet, run: &Run) -> Result<StartResult, StudyError> {
    let problem = run.problem(model, set, &PaperEquations::PAPER, &run.noise_free())?;
    let theta = least_squares(&problem, set)?.theta;
    let error = problem.residuals(&theta);
    let joints = error.joints();
    let coulomb = (0..joints).map(|j| value_of(set, &theta, Parameter::Coulomb(j)));
    Ok(StartResult {
        hidden_effects: false,
        error_at_zero_nm: (0..joints).map(|j| error.joint(j)[0]).collect(),
        rms_nm: residual(&problem, &theta).rms_nm,
        coulomb_nm: coulomb.collect(),
    })
}

/// Value of the base parameter whose kept column is `parameter`; NaN if there is none.
fn value_of(set: &BaseSet, theta: &[f64], parameter: Parameter) -> f64 {
    set.index_of(parameter).map_or(f64::NAN, |k| theta[k])
}

fn tried(
    model: &Model,
    set: &BaseSet,
    mechanism: Mechanism,
    run: &Run,
) -> Result<MechanismResult, StudyError> {
    let equations = mechanism.equations();
    let exact = run.problem(model, set, &equations, &run.noise_free())?;
    let theta = least_squares(&exact, set)?.theta;
    let noisy = run.problem(model, set, &equations, &run.log(0)?)?;
    let (indefinite_share, smallest_eigenvalue_kg_m2) = indefinite_share(model, set, &theta);
    Ok(MechanismResult {
        mechanism,
        rotor_inertia_kg_m2: [2, 3, 4, 5]
            .map(|j| value_of(set, &theta, Parameter::RotorInertia(j))),
        e_n: residual(&noisy, &least_squares(&noisy, set)?.theta).e_n,
        indefinite_share,
        smallest_eigenvalue_kg_m2,
    })
}

fn traces(model: &Model, set: &BaseSet, runs: &[Run; 2]) -> Result<[Trace; 2], StudyError> {
    let problem = |run: &Run, log: &Measured| run.problem(model, set, &PaperEquations::PAPER, log);
    let logs = [runs[0].log(0)?, runs[1].log(0)?];
    let problems = [problem(&runs[0], &logs[0])?, problem(&runs[1], &logs[1])?];
    let theta = least_squares(&problems[0], set)?.theta;
    let trace = |i: usize| {
        let (run, log, problem) = (&runs[i], &logs[i], &problems[i]);
        let window = run.window.clone();
        let measured_nm = log.torque_nm.slice(window.clone());
        let error = problem.residuals(&theta);
        let gain = |j: usize| run.simulation.scenario.arm.joints[j].drive.gain_nm_a();
        Trace {
            time_s: (0..window.len()).map(|k| k as f64 / run.rate_hz()).collect(),
            q_rad: log.q_rad.slice(window),
            current_a: measured_nm.map_joints(|j, t| t.iter().map(|t| t / gain(j)).collect()),
            predicted_nm: measured_nm
                .map_joints(|j, t| t.iter().zip(error.joint(j)).map(|(t, e)| t - e).collect()),
            measured_nm,
        }
    };
    Ok([trace(0), trace(1)])
}
