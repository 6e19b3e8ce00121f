//! `armid study real-arm`: the case study of a real UR10e from public logs.

use std::path::PathBuf;

use clap::Args;

use super::loaded_log::LoadedLog;
use super::robot::load_robot;
use super::{CommandResult, Outcome};
use crate::base::{BaseSet, Parameterisation};
use crate::diagnose::{Cause, Diagnoser, Finding, Kind, Validation, repeated};
use crate::dynamics::Model;
use crate::identify::Options;
use crate::log::{Effort, Layout};
use crate::output::{check_outputs, write_text};
use crate::report::json::{Input, Program};
use crate::report::real_arm::{Pair, RealArmStudy, Recorded};
use crate::robot::{Arm, LoadedArm};

#[derive(Debug, Args)]
pub(super) struct RealArmArgs {
    /// Folder with the logs (dataset_ur10e of github.com/shamilmamedov/dynamic_calibration), or one that
    /// holds it as ur10e/.
    #[arg(long)]
    data: PathBuf,
    /// Write the report as Markdown.
    #[arg(long)]
    markdown: Option<PathBuf>,
    /// Write the report as one HTML page.
    #[arg(long)]
    report: Option<PathBuf>,
}

impl RealArmArgs {
    /// The command that reproduces the report, with a placeholder for the folder of the logs.
    fn command(&self) -> Vec<String> {
        let mut words =
            ["armid", "study", "real-arm", "--data", "FOLDER"].map(String::from).to_vec();
        for (option, path) in [("--markdown", &self.markdown), ("--report", &self.report)] {
            if let Some(path) = path {
                words.extend([option.to_owned(), path.display().to_string()]);
            }
        }
        words
    }
}

/// Mass of the body that the authors bolted to the flange, kg.
const KNOWN_KG: f64 = 2.805;
const TRAINING: &str = "ur-20_02_19_14harm50sec.csv";
const HELD_OUT: [&str; 3] = [
    "ur-20_02_10-30sec_12harm.csv",
    "ur-20_02_12-50sec_12harm.csv",
    "ur-20_01_17-ptp_10_points.csv",
];
const LOADED: &str = "ur-20_02_19_14harm50secLoad.csv";
const SECOND_PAIR: [&str; 2] = ["ur-20_01_31-unload.csv", "ur-20_01_31-load.csv"];
const CONTACTS: [&str; 2] = ["collision_2link.csv", "collision_free.csv"];
const LAYOUTS: [&str; 2] = ["ur10e_innopolis", "ur10e_innopolis_author"];

/// Runs the command.
pub(super) fn run(args: &RealArmArgs) -> CommandResult {
    let inside = args.data.join("ur10e");
    let folder = if inside.is_dir() { inside } else { args.data.clone() };
    let logs = HELD_OUT.iter().chain(&SECOND_PAIR).chain(&CONTACTS).chain([&TRAINING, &LOADED]);
    check_outputs(
        [&args.markdown, &args.report].into_iter().flatten(),
        logs.map(|log| folder.join(log)),
    )?;
    let LoadedArm { arm, .. } = load_robot("ur10e")?;
    let [controllers, authors] = [Layout::load(LAYOUTS[0])?, Layout::load(LAYOUTS[1])?];
    let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), arm.torque_offsets))?;
    let model = Model::new(&arm);
    let read = |layout: &Layout, file: &str| LoadedLog::read(&folder.join(file), &arm, layout);
    let mut diagnoser = Diagnoser::new(&arm, &model, &set, Options::default());

    let training = read(&controllers, TRAINING)?;
    let held_out = HELD_OUT.iter().map(|f| read(&controllers, f)).collect::<Result<Vec<_>, _>>()?;
    let manufacturer =
        held_out.iter().map(|l| l.log.target_torque_nm(&arm)).collect::<Result<Vec<_>, _>>()?;
    let validations: Vec<Validation> = held_out
        .iter()
        .zip(&manufacturer)
        .map(|(log, own)| Validation {
            measurement: log.measurement(),
            manufacturer_nm: own.as_ref(),
        })
        .collect();
    let finding = diagnoser.diagnose(&training.measurement(), &validations, None)?;

    let loaded = read(&controllers, LOADED)?;
    let again = diagnoser.diagnose(&loaded.measurement(), &[], None)?;
    let repeated = repeated(&finding, &again);
    let [unload, load] = [read(&controllers, SECOND_PAIR[0])?, read(&controllers, SECOND_PAIR[1])?];
    let second = diagnoser.diagnose(&unload.measurement(), &[], None)?;
    let mut pairs = Vec::new();
    let mut compare = |diagnoser: &mut Diagnoser,
                       finding: &Finding,
                       [first, other]: [&LoadedLog; 2],
                       known_kg: Option<f64>,
                       gains: &'static str|
     -> CommandResult {
        let measurements = (first.measurement(), other.measurement());
        let finding = diagnoser.payload(finding, &measurements.0, &measurements.1, known_kg)?;
        pairs.push(Pair { file: name(other), known_kg, gains, finding });
        Ok(Outcome::Done)
    };
    let (body, bare) = (Some(KNOWN_KG), None);
    compare(&mut diagnoser, &finding, [&training, &loaded], body, "controller's")?;
    compare(&mut diagnoser, &second, [&unload, &load], body, "controller's")?;
    for log in held_out.iter().take(2).chain([&unload]) {
        compare(&mut diagnoser, &finding, [&training, log], bare, "controller's")?;
    }
    let others = [read(&authors, TRAINING)?, read(&authors, LOADED)?];
    let other = diagnoser.diagnose(&others[0].measurement(), &[], None)?;
    compare(&mut diagnoser, &other, [&others[0], &others[1]], body, "authors'")?;

    let touched = CONTACTS.iter().map(|f| read(&controllers, f)).collect::<Result<Vec<_>, _>>()?;
    let mut contacts = Vec::new();
    for log in &touched {
        let finding = diagnoser.diagnose(&log.measurement(), &[], None)?;
        let is_contact = |c: &Cause| c.kind == Kind::Contact;
        let found = finding.diagnosis.causes.into_iter().filter(is_contact).collect();
        contacts.push((name(log), found));
    }

    let roles =
        [(&training, "training: every fit and every choice"), (&loaded, "body on the flange")]
            .into_iter()
            .chain(held_out.iter().map(|l| (l, "held out: gains only")))
            .chain([(&unload, "second pair, bare"), (&load, "second pair, with the body")])
            .chain(touched.iter().map(|l| (l, "contact")));
    let recorded: Vec<Recorded> = roles
        .map(|(log, role)| {
            let rows = &log.log.rows;
            let time_s = &log.log.time_s;
            let seconds = time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0);
            let rows = [rows.used, rows.read - rows.used];
            Recorded { file: name(log), role, rows, seconds }
        })
        .collect();
    let inputs = [&training, &loaded, &unload, &load]
        .into_iter()
        .chain(&held_out)
        .chain(&touched)
        // The logs are not part of the project: the page names them relative to the folder that is given to the
        // command.
        .map(|l| Input { path: name(l).into(), ..l.input.clone() })
        .collect();
    let gains_nm_a = [gains_of(&training, &arm), gains_of(&others[0], &arm)];
    let other_gains = other.diagnosis.causes;
    let study = RealArmStudy {
        arm: arm.clone(),
        recorded,
        finding,
        repeated,
        other_gains,
        gains_nm_a,
        pairs,
        contacts,
    };
    let program = Program::new(args.command(), None, inputs);
    let text = study.markdown(&program.command)?;
    say!("{text}");
    if let Some(path) = &args.markdown {
        write_text(path, &text)?;
    }
    if let Some(path) = &args.report {
        study.page(program)?.write(path)?;
    }
    Ok(Outcome::Done)
}

fn name(log: &LoadedLog) -> String {
    let path = &log.input.path;
    path.file_name()
        .map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned())
}

/// The drive gains that converted the log's currents to torques, Nm/A.
fn gains_of(log: &LoadedLog, arm: &Arm) -> Vec<f64> {
    match &log.log.effort {
        Effort::Current { gain_nm_a: Some(gains), .. } => gains.clone(),
        _ => arm.joints.iter().map(|joint| joint.drive.gain_nm_a()).collect(),
    }
}
