//! `armid diagnose`: what the model of an arm gets wrong, from its log.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};

use super::identify::{LoadedLog, ProcessingArgs, SourceArgs};
use super::robot::SavedRobot;
use super::{CommandResult, Outcome};
use crate::base::{BaseSet, Parameterisation};
use crate::diagnose::{DIAGNOSE_SCHEMA, Diagnoser, Diagnosis, Validation};
use crate::dynamics::Model;
use crate::montecarlo::Scenario;
use crate::output::check_writable;
use crate::report::diagnose::{cause_table, held_out_table, limit_table, page};
use crate::report::identify::IDENTIFY_SCHEMA;
use crate::report::json::{Document, Input, Program};
use crate::report::replay::table as replay_table;
use crate::report::rows::{Rows, log_warnings};
use crate::report::saved::{SavedFault, load};
use crate::robot::{Arm, Kinematics};

/// Say what the rigid model with linear friction gets wrong along a log, and what explains it.
#[derive(Debug, Args)]
pub struct DiagnoseArgs {
    /// The log; with a second one: what that has on its flange that the first has not.
    #[arg(required = true, num_args = 1..=2)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    processing: ProcessingArgs,
    /// Logs on which the gain is measured: nothing is fitted to them or chosen by them.
    #[arg(long, num_args = 1..)]
    held_out: Vec<PathBuf>,
    /// A simulation to compare with: a scenario (.toml) or a result of `armid identify` (.json).
    #[arg(long, value_name = "SCENARIO|RESULT")]
    sim: Option<PathBuf>,
    /// Mass of the body that the second log was recorded with, kg: tells the scale of the drive gains.
    #[arg(long = "known-payload", value_name = "KG", value_parser = mass)]
    known_payload_kg: Option<f64>,
    /// Put what was found back into the simulation, and let it replay the log and the held-out ones: seconds
    /// per log, minutes where stiff effects need short steps.
    #[arg(long)]
    replay: bool,
    /// Write the simulation with what was found as a scenario for `simulate` and `montecarlo`, with
    /// its robot file and trajectory beside it.
    #[arg(long, value_name = "FILE.toml")]
    extended_scenario: Option<PathBuf>,
    /// Write the result as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the report as one HTML page.
    #[arg(long)]
    report: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &DiagnoseArgs) -> CommandResult {
    for path in [&args.json, &args.report].into_iter().flatten() {
        check_writable(path)?;
    }
    for path in args.extended_scenario.iter().flat_map(|path| Scenario::files_of(path)) {
        check_writable(&path)?;
    }
    if args.known_payload_kg.is_some() && args.logs.len() < 2 {
        return Err("--known-payload needs two logs: without the body, and with it".into());
    }
    let options = args.processing.options()?;
    let (arm, mut inputs) = args.source.arm()?;
    let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), arm.torque_offsets))?;
    let model = Model::new(&arm);
    let logs = args.source.read(&arm, &args.logs)?;
    let held_out = args.source.read(&arm, &args.held_out)?;
    if let Some(same) =
        held_out.iter().find(|h| logs.iter().any(|l| l.input.sha256 == h.input.sha256))
    {
        let file = same.input.path.display();
        return Err(format!("{file} is held out, but it is also the log that is diagnosed").into());
    }
    let manufacturer =
        held_out.iter().map(|log| log.log.target_torque_nm(&arm)).collect::<Result<Vec<_>, _>>()?;
    let validations: Vec<Validation> = held_out
        .iter()
        .zip(&manufacturer)
        .map(|(log, manufacturer_nm)| Validation {
            measurement: log.measurement(),
            manufacturer_nm: manufacturer_nm.as_ref(),
        })
        .collect();
    let simulation =
        args.sim.as_deref().map(|file| simulated_parameters(file, (&arm, &set))).transpose()?;
    let mut diagnoser = Diagnoser::new(&arm, &model, &set, options.clone());
    let Some(log) = logs.first() else { return Ok(Outcome::Done) };
    let mut finding =
        diagnoser.diagnose(&log.measurement(), &validations, simulation.as_deref())?;
    // What fails behind the diagnosis must not take it along: it is told when all else is printed and written.
    let mut failed = None;
    if let Some(loaded) = logs.get(1) {
        let measurements = (&log.measurement(), &loaded.measurement());
        let payload =
            diagnoser.payload(&finding, measurements.0, measurements.1, args.known_payload_kg);
        match payload {
            Ok(payload) => finding.diagnosis.add_payload(payload),
            Err(error) => failed = Some(error),
        }
    }
    if args.replay {
        let logs = 1 + validations.len();
        eprintln!("replaying {logs} log(s), without and with what was found");
        let replay = diagnoser.replay(&finding, &validations);
        finding.diagnosis.add_replay(replay);
    }
    let of_the_logs = logs.iter().chain(&held_out).flat_map(|log| log_warnings(&log.log));
    finding.diagnosis.warnings.extend(of_the_logs);
    let diagnosis = &finding.diagnosis;
    for sentence in &diagnosis.sentences {
        say!("{sentence}");
    }
    say!("");
    if !diagnosis.causes.is_empty() {
        say!("{}", cause_table(diagnosis).to_text());
    }
    if !diagnosis.held_out.is_empty() {
        say!("{}", held_out_table(diagnosis).to_text());
    }
    if let Some(replay) = &diagnosis.replay {
        say!("{}", replay_table(replay).to_text());
    }
    if !diagnosis.detection_limits.is_empty() {
        say!("{}", limit_table(diagnosis).to_text());
    }
    for warning in &diagnosis.warnings {
        say!("note: {warning}");
    }
    for file in args.sim.iter() {
        inputs.push(Input::of(file)?);
    }
    inputs.extend(logs.iter().chain(&held_out).map(|l: &LoadedLog| l.input.clone()));
    let program = Program::new(std::env::args(), None, inputs);
    if let Some(path) = &args.json {
        let body = WithRows { diagnosis, rows: Rows::of(&[&log.log]) };
        Document { schema: DIAGNOSE_SCHEMA, program: &program, body: &body }.write(path)?;
    }
    if let Some(path) = &args.report {
        page(&finding, &arm, program)?.write(path)?;
        say!("report: {}", path.display());
    }
    if let Some(path) = &args.extended_scenario {
        let simulation = diagnoser.extended_simulation(&finding)?;
        let measurement = log.measurement();
        Scenario::of_diagnosis(&simulation, &finding, &measurement, &set, &options)?.save(path)?;
        // What was written has to be what a scenario may be.
        Scenario::load(Some(path))?;
        say!("scenario: {}", path.display());
    }
    match failed {
        Some(error) => Err(error.into()),
        None => Ok(Outcome::Done),
    }
}

/// A mass in kg.
fn mass(text: &str) -> Result<f64, String> {
    let mass: f64 = text.parse().map_err(|e| format!("{e}"))?;
    let is_mass = mass > 0.0 && mass.is_finite();
    if is_mass { Ok(mass) } else { Err("must be a positive number".into()) }
}

/// Base parameters of the simulation of `arm` that `file` describes, in the order of `set`.
fn simulated_parameters(
    file: &Path,
    (arm, set): (&Arm, &BaseSet),
) -> Result<Vec<f64>, Box<dyn std::error::Error>> {
    if file.extension().is_some_and(|e| e == "toml") {
        let scenario = Scenario::load(Some(file))?;
        if let Some(difference) = Kinematics::of(&scenario.arm).difference(arm) {
            let (file, name) = (file.display(), &arm.name);
            let message = format!("{file}: it simulates another arm than \"{name}\": {difference}");
            return Err(message.into());
        }
        if !scenario.effects.is_empty() {
            let file = file.display();
            eprintln!("note: {file}: its arm alone is compared with, not its [[effect]] tables");
        }
        return Ok(set.values(&Model::new(&scenario.arm).standard_parameters()));
    }
    let result: IdentifiedParameters =
        load(file, IDENTIFY_SCHEMA).map_err(|error| match error.fault {
            SavedFault::Read(_) => error.to_string(),
            fault => not_a_simulation(file, &fault),
        })?;
    result.about.check(arm).map_err(|other| format!("{}: {other}", file.display()))?;
    if result.intervals.trusted == Some(false) {
        let file = file.display();
        eprintln!(
            "note: {file}: the model is wrong along the log that this result is of, so that what differs from it here may have been wrong there; `armid diagnose` of that log names its cause"
        );
    }
    (0..set.rank())
        .map(|k| {
            let name = set.name(k);
            let found = result.base_parameters.iter().find(|p| p.name == name);
            let missing = || format!("{}: no base parameter {name}", file.display()).into();
            found.map(|p| p.value).ok_or_else(missing)
        })
        .collect()
}

/// Why `file` cannot be compared with.
fn not_a_simulation(file: &Path, why: &dyn std::fmt::Display) -> String {
    let file = file.display();
    format!(
        "{file}: neither a scenario (.toml) nor a result of `armid identify --json` ({why}); a second log goes \
         behind the first, without --sim"
    )
}

/// What is needed of an identification's JSON.
#[derive(Deserialize)]
struct IdentifiedParameters {
    #[serde(flatten)]
    about: SavedRobot,
    base_parameters: Vec<IdentifiedParameter>,
    #[serde(default)]
    intervals: Intervals,
}

#[derive(Default, Deserialize)]
struct Intervals {
    trusted: Option<bool>,
}

#[derive(Deserialize)]
struct IdentifiedParameter {
    name: String,
    value: f64,
}

/// The diagnosis with what became of the log's rows.
#[derive(Serialize)]
struct WithRows<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    rows: Rows,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The JSON of a diagnosis has base parameters as well, but no simulation is described by what is left beside its causes.
    #[test]
    fn a_diagnosis_is_no_simulation() {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), true)).unwrap();
        let file = tempfile::Builder::new().suffix(".json").tempfile().unwrap();
        let diagnosis = r#"{"schema": "armid.diagnose/1", "base_parameters": []}"#;
        std::fs::write(file.path(), diagnosis).unwrap();
        let error = simulated_parameters(file.path(), (&arm, &set)).unwrap_err().to_string();
        assert!(error.contains("its schema is \"armid.diagnose/1\""), "{error}");
    }
}
