//! `armid simulate`: writes one log of the simulated arm, and the truth behind it.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::arm_result::ArmResult;
use super::count::at_least;
use super::robot::inputs;
use super::{CommandResult, Outcome, simulating};
use crate::dynamics::Model;
use crate::dynamics::ParameterLayout;
use crate::excitation::{ExcitationError, LimitKind, Margin, Reference, Requirements, check};
use crate::identify::MOVING_RAD_S;
use crate::log::{Effort, Log, write_log};
use crate::montecarlo::{EffectSize, Scenario, Simulation};
use crate::number;
use crate::output::check_outputs;
use crate::plant::faults::Effect;
use crate::plant::{PlantError, Recording, SensorConfig, tied_to_held_torque};
use crate::report::json::{Document, Program};

/// Simulate one trial of a scenario and write its log.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Scenario file. Default: sims/default.toml, which is built in.
    #[arg(long)]
    scenario: Option<PathBuf>,
    /// Simulate the arm of this result of `armid identify --physical` instead of the scenario's.
    #[arg(long, value_name = "RESULT.json")]
    arm: Option<PathBuf>,
    /// Robot file of the result, if it cannot be found under the name that the result or the scenario has for it.
    #[arg(long, requires = "arm")]
    robot: Option<String>,
    /// CSV file for the log.
    #[arg(long)]
    out: PathBuf,
    /// Trial whose noise is used, counted from 0.
    #[arg(long, default_value_t = 0, allow_negative_numbers = true, value_parser = at_least(0_u64))]
    trial: u64,
    /// Write the true parameters and the hidden effects as JSON.
    #[arg(long)]
    truth: Option<PathBuf>,
}

#[derive(Serialize)]
struct Truth<'a> {
    robot: &'a str,
    standard_parameters: Vec<StandardParameter>,
    effects: Vec<HiddenEffect<'a>>,
    noise: &'a SensorConfig,
    /// Size of all effects together in units of the noise; null where a joint's torque is read without noise.
    lambda: Option<f64>,
    /// Size of the part that moves the parameters of the model.
    lambda_sim: Option<f64>,
}

#[derive(Serialize)]
struct HiddenEffect<'a> {
    kind: &'a str,
    joint: Option<usize>,
    parameters: serde_json::Map<String, serde_json::Value>,
}

#[derive(Serialize)]
struct StandardParameter {
    name: String,
    value: f64,
    unit: &'static str,
}

impl<'a> HiddenEffect<'a> {
    fn of(effect: &'a Effect) -> Self {
        Self { kind: effect.kind(), joint: effect.joint(), parameters: effect.parameters() }
    }
}

/// λ of all effects of the scenario; `None` if a joint's torque has no noise to compare with.
fn size(simulation: &Simulation) -> Result<Option<EffectSize>, PlantError> {
    let sensors = &simulation.scenario.sensors;
    let sd = sensors.torque_sd_per_joint_nm(simulation.scenario.arm.dof())?;
    if sd.contains(&0.0) { Ok(None) } else { simulation.effect_size().map(Some) }
}

/// The joint limit that the motion of a scenario exceeds most, in words. Of all limits the plant enforces only the
/// torque of the drives.
fn passed_limit(scenario: &Scenario) -> Result<Option<String>, ExcitationError> {
    let requirements =
        Requirements { clearance_m: 0.0, torque_share: 1.0, ..Requirements::default() };
    let margins = check(&scenario.arm, &requirements, &scenario.excitation)?;
    let of_a_joint = |margin: &&Margin| !margin.limit.is_distance();
    let worst = margins.least_first().into_iter().find(of_a_joint);
    Ok(worst.filter(|margin| margin.free < 0.0).map(|Margin { limit, free, time_s, .. }| {
        let consequence = match limit {
            LimitKind::Torque { .. } => {
                "the simulated drive gives no more, and the joint falls behind the motion"
            }
            _ => "nothing stops the simulated arm there",
        };
        format!(
            "{limit}: the motion {} passes the limit of {} by {:.3} {} at {time_s:.2} s; {consequence}",
            scenario.trajectory, scenario.arm.name, -free, limit.unit()
        )
    }))
}

/// A remark on joints so light that their logged torque comes early ([`tied_to_held_torque`]).
fn light_joints(scenario: &Scenario) -> Result<Option<String>, PlantError> {
    let mut pose = vec![0.0; scenario.arm.dof()];
    let mut rest = [pose.clone(), pose.clone()];
    let [qd, qdd] = &mut rest;
    scenario.excitation.sample(0.0, &mut pose, qd, qdd);
    let (tied, enough_hz) = tied_to_held_torque(&scenario.arm, &scenario.plant, &pose)?;
    let names: Vec<String> = tied.iter().map(|j| (j + 1).to_string()).collect();
    Ok((!tied.is_empty()).then(|| {
        // A power of two times 1 kHz: its period is a plain number, and a part of the periods of usual logs.
        let rate_hz = 1e3 * (1e-3 * enough_hz).log2().ceil().exp2();
        format!(
            "friction stops joint(s) {} within a third of a period of the controller, as they have hardly any rotor inertia: their logged \
             torque comes up to {} ms early, which a diagnosis may name as a delay. State rotor inertias, or set control_rate_hz = {rate_hz} \
             and step_s = {} in [plant]",
            names.join(", "),
            number::significant(500.0 / scenario.plant.control_rate_hz, 2),
            1.0 / rate_hz
        )
    }))
}

/// Share of a joint's rms velocity from which on it counts as not following its motion. Effects that leave a drive too
/// little torque stay well below it; a joint that swings by itself is far beyond.
const LOST: f64 = 0.5;

/// A remark on joints of `recording` that do not follow the motion.
fn lost_joints(recording: &Recording) -> Option<String> {
    let rms = |y: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = y.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
        (sum / f64::max(count, 1.0)).sqrt()
    };
    let off = |j: usize| {
        let target = recording.target_qd_rad_s.joint(j);
        let pairs = recording.qd_rad_s.joint(j).iter().zip(target);
        let off = rms(&mut pairs.map(|(qd, target)| qd - target));
        let wanted = rms(&mut target.iter().copied());
        // NaN counts as lost.
        (off > f64::max(LOST * wanted, MOVING_RAD_S) || off.is_nan()).then(|| {
            format!("joint {} by {off:.3} rad/s rms ({wanted:.3} of the motion itself)", j + 1)
        })
    };
    let joints: Vec<String> = (0..recording.qd_rad_s.joints()).filter_map(off).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "the arm does not follow its motion, its velocity is off on {}: an effect leaves the drive too little torque, or makes it \
             unstable, as a soft gear does with the encoder on its link",
            joints.join(", ")
        )
    })
}

/// Runs the command.
pub fn run(args: &SimulateArgs) -> CommandResult {
    let mut scenario = Scenario::load(args.scenario.as_deref())?;
    let robot = args.robot.as_ref().map(PathBuf::from);
    let mut robot_files = Vec::new();
    if let Some(path) = &args.arm {
        let ArmResult { arm, offsets_nm, doubt, files, .. } =
            ArmResult::load(path, args.robot.as_deref(), Some(&scenario))?;
        if arm.dof() != scenario.arm.dof() {
            let (found, expected) = (arm.dof(), scenario.arm.dof());
            let file = path.display();
            return Err(format!("{file}: {found} joints, the scenario's arm has {expected}").into());
        }
        if let Some(doubt) = doubt {
            eprintln!("note: {doubt}");
        }
        if offsets_nm.iter().any(|offset| *offset != 0.0) {
            eprintln!("note: the plant has no torque offsets; left out: {offsets_nm:?} Nm");
        }
        scenario = scenario.with_arm(arm)?;
        robot_files = files;
    }
    check_outputs(
        [Some(&args.out), args.truth.as_ref()].into_iter().flatten(),
        robot
            .iter()
            .chain(&args.scenario)
            .chain(&args.arm)
            .chain(&scenario.files)
            .chain(&robot_files),
    )?;
    if let Some(passed) = passed_limit(&scenario)? {
        eprintln!("note: {passed}");
    }
    if let Some(light) = light_joints(&scenario)? {
        eprintln!("note: {light}");
    }
    eprintln!("{}", simulating(&scenario));
    let simulation = Simulation::run(scenario)?;
    if let Some(lost) = lost_joints(&simulation.recording) {
        eprintln!("note: {lost}");
    }
    let measured = simulation.log(args.trial)?;
    let scenario = &simulation.scenario;
    let samples = measured.time_s.len();
    let source = format!("{} trial {}", scenario.name, args.trial);
    let effort = match scenario.sensors.effort {
        crate::plant::Effort::Torque => Effort::Torque(measured.torque_nm),
        crate::plant::Effort::Current => {
            let gain = |j: usize| scenario.arm.joints[j].drive.gain_nm_a();
            let ampere =
                measured.torque_nm.map_joints(|j, t| t.iter().map(|t| t / gain(j)).collect());
            Effort::Current { ampere, gain_nm_a: None }
        }
    };
    let log = Log::new(source, measured.time_s, measured.q_rad, measured.qd_rad_s, effort)?;
    let sha256 = write_log(&args.out, &log)?;
    say!("{}: {samples} samples, sha256 {sha256}", args.out.display());
    if let Some(path) = &args.truth {
        let layout = ParameterLayout::new(scenario.arm.dof());
        let values = Model::new(&scenario.arm).standard_parameters();
        let named = values.iter().enumerate().map(|(k, &value)| StandardParameter {
            name: layout.name(k),
            value,
            unit: layout.unit(k),
        });
        let size = size(&simulation)?;
        let truth = Truth {
            robot: &scenario.arm.name,
            standard_parameters: named.collect(),
            effects: scenario.effects.iter().map(HiddenEffect::of).collect(),
            noise: &scenario.sensors,
            lambda: size.map(|s| s.lambda),
            lambda_sim: size.map(|s| s.lambda_sim),
        };
        let inputs = inputs(
            args.scenario.iter().chain(&args.arm).chain(&scenario.files).chain(&robot_files),
        )?;
        let program = Program::started(Some(scenario.seed), inputs);
        Document { schema: "armid.truth/1", program: &program, body: &truth }.write(path)?;
    }
    Ok(Outcome::Done)
}
