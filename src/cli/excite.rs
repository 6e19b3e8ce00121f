//! `armid excite`: designs an excitation and writes it for people, programs and the robot.

mod clearance;
mod record;

use std::error::Error;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clap::{ArgGroup, Args};
use thiserror::Error as ThisError;

use clearance::{cell_box, say_what_helps, say_what_is_watched};
use record::Record;

use super::count::at_least;
use super::prior::Prior;
use super::robot::{inputs, load_robot};
use super::{CommandResult, Outcome, Progress, interrupt_flag, threads_or_all};
use crate::base::{BaseSet, Parameterisation};
use crate::excitation::design::{
    self, Budget, Criterion, Design, DesignError, Experiment, Specification, Variables,
};
use crate::excitation::export::{Playback, Slowed, Speed, urscript, write_csv};
use crate::excitation::{Requirements, TRAJECTORY_SCHEMA};
use crate::output::{check_outputs, write_atomically, write_text};
use crate::report::excitation::{at_full_speed, page, precision_in_words};
use crate::report::json::{Document, Program};
use crate::robot::{Arm, Joint, LoadedArm};

/// Design the motion that tells most about the parameters, inside all limits.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("played").args(["csv", "urscript"]).multiple(true))]
pub struct ExciteArgs {
    /// Robot: ur5, ur10e, ur3e, ur5e, or a .toml, .urdf or .xml (MJCF) file (FILE.urdf#LINK: the arm
    /// up to that link).
    #[arg(long)]
    robot: String,
    /// d: volume of the confidence ellipsoid; a: mean relative variance; e: worst combination;
    /// cond: condition of the information matrix (the paper's); scaled: the same, columns of unit length.
    #[arg(long, value_enum, default_value = "d")]
    criterion: CriterionName,
    /// Order of the Fourier series.
    #[arg(long, default_value_t = 5, allow_negative_numbers = true, value_parser = at_least(1_usize))]
    order: usize,
    /// Period, s.
    #[arg(
        long = "period",
        value_name = "S",
        default_value_t = 10.0,
        allow_negative_numbers = true
    )]
    period_s: f64,
    /// Let the base frequency be free, with periods between these, s: LOW,HIGH.
    #[arg(
        long,
        value_name = "LOW,HIGH",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true
    )]
    period_range: Option<Vec<f64>>,
    /// Centres of the joints' motions (the constant terms of their series), rad: `free`, which is the default, or a
    /// number for each joint, such as 0,-1.5708,0,0,0,free.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    offsets: Option<String>,
    /// Start and end every period at rest.
    #[arg(long)]
    rest_start: bool,
    /// Smallest distance of the arm from itself, the floor and boxes, m.
    #[arg(
        long = "clearance",
        value_name = "M",
        default_value_t = 0.02,
        allow_negative_numbers = true
    )]
    clearance_m: f64,
    /// A box in the cell to stay clear of: two corners in the base frame, m. May be given several times.
    #[arg(long = "box", value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true)]
    boxes: Vec<String>,
    /// Share of the speed limits that the motion may use. Below 1 it leaves room for drives that overshoot, because
    /// controllers stop the arm at its speed limit.
    #[arg(long, value_name = "0…1", default_value_t = 1.0, allow_negative_numbers = true)]
    velocity_share: f64,
    /// Share of the torque limits the nominal model may need.
    #[arg(long, value_name = "0…1", default_value_t = 0.9, allow_negative_numbers = true)]
    torque_share: f64,
    /// Torque noise, Nm: one number for all joints or one for each. Default: 0.6 % of the torque limits.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true
    )]
    noise_nm: Option<Vec<f64>>,
    /// Length of the periodic part of the motion, s, in whole periods that cover it. Run-in and run-out are added.
    #[arg(long = "data", value_name = "S", default_value_t = 80.0, allow_negative_numbers = true)]
    data_s: f64,
    /// Rate of the data and of the CSV, Hz. The URScript has a set point every 8 ms at any rate.
    #[arg(
        long = "rate",
        value_name = "HZ",
        default_value_t = 125.0,
        allow_negative_numbers = true
    )]
    rate_hz: f64,
    /// Result of an earlier identification. The motion is designed for the parameters that are still poorly known.
    #[arg(long, value_name = "RESULT.json")]
    prior: Option<PathBuf>,
    /// Random motions from which the search starts.
    #[arg(long, default_value_t = 48, allow_negative_numbers = true, value_parser = at_least(1_usize))]
    starts: usize,
    /// How many of the best starts are optimised to the end.
    #[arg(long, default_value_t = 4, allow_negative_numbers = true, value_parser = at_least(1_usize))]
    finalists: usize,
    /// Seed of the random starts.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true, value_parser = at_least(0_u64))]
    seed: u64,
    /// Stop after this time and keep the best design so far, s.
    #[arg(
        long = "seconds",
        value_name = "S",
        default_value_t = 120.0,
        allow_negative_numbers = true
    )]
    seconds: f64,
    /// Threads, at most four per core; default: all cores. The result does not depend on it.
    #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Trajectory file; a scenario for `simulate` and `montecarlo` names it as `[motion] trajectory`.
    #[arg(long, value_name = "FILE.json")]
    out: PathBuf,
    /// Samples of the whole motion.
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Program for a Universal Robots controller.
    #[arg(long, value_name = "FILE.script")]
    urscript: Option<PathBuf>,
    /// Speed of what --csv and --urscript write, as a fraction of the designed one: the same path, played more slowly.
    /// In the URScript it is the line `speed = …`.
    #[arg(
        long,
        value_name = "0.01…1",
        default_value_t = 1.0,
        requires = "played",
        allow_negative_numbers = true
    )]
    speed: f64,
    /// Report page.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
}

/// Criteria by their names on the command line.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum CriterionName {
    D,
    A,
    E,
    Cond,
    Scaled,
}

impl From<CriterionName> for Criterion {
    fn from(name: CriterionName) -> Self {
        match name {
            CriterionName::D => Self::D,
            CriterionName::A => Self::A,
            CriterionName::E => Self::E,
            CriterionName::Cond => Self::Cond,
            CriterionName::Scaled => Self::Scaled,
        }
    }
}

/// An option with an invalid value.
#[derive(Debug, ThisError)]
#[error("--{option} {value}: {message}")]
struct BadOption {
    option: &'static str,
    value: String,
    message: String,
}

impl BadOption {
    fn new(option: &'static str, value: impl ToString, message: impl Into<String>) -> Self {
        Self { option, value: value.to_string(), message: message.into() }
    }
}

/// Designs a motion, prints the result and writes the outputs.
pub fn run(args: &ExciteArgs) -> CommandResult {
    let LoadedArm { mut arm, files, notices, .. } = load_robot(&args.robot)?;
    for corners in &args.boxes {
        arm.clearance.boxes.push(cell_box(corners)?);
    }
    if !(args.velocity_share > 0.0 && args.velocity_share <= 1.0) {
        let message = "must be in (0, 1]";
        return Err(BadOption::new("velocity-share", args.velocity_share, message).into());
    }
    for joint in &mut arm.joints {
        joint.limits.velocity_rad_s *= args.velocity_share;
    }
    let speed = Speed::new(args.speed)
        .map_err(|error| BadOption::new("speed", args.speed, error.to_string()))?;
    let arm = arm;
    say_what_is_watched(&args.robot, &arm, &notices, &args.boxes)?;
    let playback = playback(args, &arm, speed)?;
    let base = BaseSet::find(&arm, Parameterisation::full(arm.dof(), arm.torque_offsets))?;
    let spec = specification(args, &arm, &base)?;
    let outputs =
        [Some(&args.out), args.csv.as_ref(), args.urscript.as_ref(), args.report.as_ref()];
    check_outputs(outputs.into_iter().flatten(), files.iter().chain(&args.prior))?;
    let inputs = inputs(files.iter().chain(&args.prior))?;
    let program = Program::started(Some(args.seed), inputs);

    let begun = Instant::now();
    let budget = Budget {
        // A time that overflows the clock means no deadline.
        deadline: Duration::try_from_secs_f64(args.seconds)
            .ok()
            .and_then(|time| begun.checked_add(time)),
        stop: interrupt_flag(),
    };
    let rounds = Rounds { criterion: spec.criterion, current: Mutex::new(None) };
    let threads = threads_or_all(args.threads);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let found = pool.install(|| design::design(&arm, &base, &spec, &budget, &|p| rounds.report(p)));
    if let Err(fault) = &found {
        say_what_helps(&args.robot, &notices, fault);
        let has_fixed_offsets = spec.variables.fixed_offsets_rad.iter().any(Option::is_some);
        if matches!(fault, DesignError::Infeasible { .. }) && has_fixed_offsets {
            eprintln!("note: an offset that --offsets fixes leaves less room than a free one");
        }
    }
    let interrupted = budget.stop.load(Ordering::Relaxed);
    let found = match found {
        Err(DesignError::OutOfTime { tried, starts }) if interrupted => {
            eprintln!(
                "interrupted after {tried} of {starts} starts, none of which is a motion inside the \
                 limits: nothing was written"
            );
            return Ok(Outcome::Interrupted);
        }
        Err(
            e @ (DesignError::Infeasible { .. }
            | DesignError::NeverClear { .. }
            | DesignError::FixedPose { .. }
            | DesignError::OutOfTime { .. }
            | DesignError::CheckFailed { .. }),
        ) => {
            eprintln!("no design: {e}; nothing was written");
            return Ok(Outcome::Negative);
        }
        other => other?,
    };
    let seconds = begun.elapsed().as_secs_f64();
    print_summary((&arm, &base, &spec), &found, speed, seconds);
    write_outputs(args, (&arm, &base, &spec), &found, (&program, speed, playback.as_ref()))?;
    if interrupted && found.cut_short {
        eprintln!("interrupted: what was written is the best motion found until then");
        return Ok(Outcome::Interrupted);
    }
    Ok(Outcome::Done)
}

/// How the requested URScript plays the motion; `None` if none is requested.
fn playback(args: &ExciteArgs, arm: &Arm, speed: Speed) -> Result<Option<Playback>, BadOption> {
    let Some(path) = &args.urscript else { return Ok(None) };
    let playback = Playback::new(arm.dof(), speed)
        .map_err(|fault| BadOption::new("urscript", path.display(), fault.to_string()))?;
    Ok(Some(playback))
}

fn specification(
    args: &ExciteArgs,
    arm: &Arm,
    base: &BaseSet,
) -> Result<Specification, Box<dyn Error>> {
    if !(args.seconds > 0.0 && args.seconds.is_finite()) {
        return Err(BadOption::new("seconds", args.seconds, "must be positive").into());
    }
    let period_range_s = match args.period_range.as_deref() {
        None => None,
        Some([low, high]) => Some([*low, *high]),
        Some(other) => {
            let message = "two numbers LOW,HIGH are expected";
            return Err(BadOption::new("period-range", format!("{other:?}"), message).into());
        }
    };
    let noise_of_limit = |j: &Joint| 0.006 * j.limits.torque_nm;
    let unlimited = arm.joints.iter().find(|joint| joint.limits.torque_nm.is_infinite());
    if let (None, Some(joint)) = (&args.noise_nm, unlimited) {
        let message = format!(
            "joint \"{}\" has no torque limit to guess the noise from: give it, one number for all joints or one for each",
            joint.name
        );
        return Err(BadOption::new("noise-nm", "(not given)", message).into());
    }
    let spec = Specification {
        criterion: args.criterion.into(),
        variables: Variables {
            order: args.order,
            period_s: args.period_s,
            period_range_s,
            fixed_offsets_rad: offsets(args.offsets.as_deref(), arm.dof())?,
            rest_start: args.rest_start,
        },
        requirements: Requirements {
            clearance_m: args.clearance_m,
            torque_share: args.torque_share,
            ..Requirements::default()
        },
        experiment: Experiment {
            data_s: args.data_s,
            rate_hz: args.rate_hz,
            torque_noise_nm: match &args.noise_nm {
                Some(list) if list.len() == 1 => vec![list[0]; arm.dof()],
                Some(list) => list.clone(),
                None => arm.joints.iter().map(noise_of_limit).collect(),
            },
        },
        prior: match &args.prior {
            Some(path) => {
                let Prior { information, notes } = Prior::load(path, arm, base)?;
                notes.iter().for_each(|note| eprintln!("note: {note}"));
                Some(information)
            }
            None => None,
        },
        starts: args.starts,
        finalists: args.finalists,
        seed: args.seed,
    };
    Ok(spec)
}

/// Parses `free` or a number for every joint; without a list, all offsets are free.
fn offsets(list: Option<&str>, dof: usize) -> Result<Vec<Option<f64>>, BadOption> {
    let Some(list) = list else { return Ok(vec![None; dof]) };
    list.split(',')
        .map(|word| match word.trim() {
            "free" => Ok(None),
            number => number.parse().map(Some).map_err(|_| {
                let message = format!("\"{number}\" is neither a number nor `free`");
                BadOption::new("offsets", list, message)
            }),
        })
        .collect()
}

/// Shows one progress bar per round, and the best design when a round ends.
struct Rounds {
    criterion: Criterion,
    current: Mutex<Option<(usize, Progress)>>,
}

impl Rounds {
    fn report(&self, p: design::Progress) {
        let mut current = self.current.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if current.as_ref().is_none_or(|(round, _)| *round != p.round) {
            *current = Some((p.round, Progress::new("designs", p.of as u64)));
        }
        let Some((round, bar)) = current.as_ref() else { return };
        bar.reached(p.done as u64);
        if p.done == p.of {
            bar.finish();
            if p.best.is_finite() {
                eprintln!("round {round}: best {}", self.criterion.in_words(p.best));
            }
        }
    }
}

fn print_summary(
    (arm, base, spec): (&Arm, &BaseSet, &Specification),
    found: &Design,
    speed: Speed,
    seconds: f64,
) {
    let p = &found.prediction;
    say!(
        "cond(ΘᵀΘ) {:.1}, columns scaled {:.2}; predicted from {} periods, {:.1} s: geometric mean σ {:.6}; {}",
        p.condition,
        p.scaled_condition,
        found.excitation.periods(),
        found.experiment.data_s,
        p.geometric_mean_sigma(),
        precision_in_words(arm, base, p),
    );
    if let Some(remark) = at_full_speed(found, speed) {
        say!("{remark}");
    }
    say!(
        "{} base parameters; margins, the smallest share of a limit first (of clearance: what is left beyond {} m, over 0.1 m; a tool \
         that the robot's description lacks is not kept clear):",
        base.rank(),
        spec.requirements.clearance_m
    );
    for margin in found.margins.least_first() {
        say!(
            "  {:<38} {:>5.1} %  {:>16}  at {:8.3} s",
            margin.limit.to_string(),
            100.0 * margin.share,
            margin.in_words(),
            margin.time_s
        );
    }
    say!(
        "{} of {} starts feasible, {} evaluations, {seconds:.1} s{}",
        found.feasible_starts,
        found.starts,
        found.evaluations,
        if found.cut_short { ", cut short: another run may end elsewhere" } else { "" }
    );
}

fn write_outputs(
    args: &ExciteArgs,
    (arm, base, spec): (&Arm, &BaseSet, &Specification),
    found: &Design,
    (program, speed, playback): (&Program, Speed, Option<&Playback>),
) -> Result<(), Box<dyn Error>> {
    let record = Record::of(arm, base, spec, found);
    Document { schema: TRAJECTORY_SCHEMA, program, body: &record }.write(&args.out)?;
    if let Some(path) = &args.csv {
        let motion = Slowed::new(&found.excitation, speed);
        write_atomically(path, |out| write_csv(out, &motion, args.rate_hz))?;
    }
    if let Some((path, playback)) = args.urscript.as_ref().zip(playback) {
        write_text(path, &urscript(&found.excitation, playback))?;
    }
    if let Some(path) = &args.report {
        page(arm, base, spec, found, speed, program.clone())?.write(path)?;
    }
    Ok(())
}
