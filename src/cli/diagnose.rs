//! `armid diagnose`: finds what the model of an arm gets wrong along a log.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::identify::{ProcessingArgs, SourceArgs};
use super::loaded_log::{LoadedLog, RowsOf, read_logs};
use super::simulated::Simulated;
use super::{CommandResult, Outcome};
use crate::base::{BaseSet, Parameterisation};
use crate::diagnose::{DIAGNOSE_SCHEMA, Diagnoser, Diagnosis, Validation};
use crate::dynamics::Model;
use crate::identify::{Identifier, nothing_moves};
use crate::log::Log;
use crate::montecarlo::Scenario;
use crate::output::{OutputError, check_outputs};
use crate::report::diagnose::{cause_table, held_out_table, limit_table, page};
use crate::report::identify::NOTHING_MOVES;
use crate::report::json::{Document, Program};
use crate::report::misread::MisreadLog;
use crate::report::replay::table as replay_table;
use crate::report::rows::{Rows, log_warnings};
use crate::report::{Page, Status, Verdict};

/// Say what the rigid model with linear friction gets wrong along a log, and what explains it.
#[derive(Debug, Args)]
pub struct DiagnoseArgs {
    /// The log. With a second log, of the same arm with a body on its flange, that body is weighed.
    #[arg(required = true, num_args = 1..=2)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    processing: ProcessingArgs,
    /// Other logs of the arm, on which the gain is measured. Nothing is fitted to them or chosen by them. (The log to
    /// diagnose goes before this option.)
    #[arg(long, num_args = 1..)]
    held_out: Vec<PathBuf>,
    /// A simulation to compare with: a scenario (.toml) or a result of `armid identify` (.json).
    #[arg(long, value_name = "SCENARIO|RESULT")]
    sim: Option<PathBuf>,
    /// Known mass, kg, of the body in the second log; it determines the scale of the drive gains.
    #[arg(long = "known-payload", value_name = "KG", value_parser = mass, allow_negative_numbers = true)]
    known_payload_kg: Option<f64>,
    /// Put the causes back into the simulation and let it replay the log and the held-out ones. Takes seconds per
    /// log, or minutes where stiff effects need short steps.
    #[arg(long)]
    replay: bool,
    /// Write the simulation with the causes as a scenario for `simulate` and `montecarlo`, with its robot file and
    /// trajectory beside it.
    #[arg(long, value_name = "FILE.toml")]
    extended_scenario: Option<PathBuf>,
    /// Write the result as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the report as one HTML page.
    #[arg(long)]
    report: Option<PathBuf>,
}

impl DiagnoseArgs {
    /// Says what two logs are for, and refuses a known mass without the second one.
    fn check_logs(&self) -> Result<(), String> {
        match (&self.logs[..], self.known_payload_kg) {
            ([first, second], _) => {
                eprintln!(
                    "note: {} is compared with {} for what its flange carries; several logs of one arm are for `armid identify`",
                    second.display(),
                    first.display()
                );
                Ok(())
            }
            (_, Some(mass_kg)) => Err(format!(
                "--known-payload {mass_kg}: it tells what the second of two logs was recorded with, and there is one"
            )),
            (_, None) => Ok(()),
        }
    }

    /// Refuses outputs that cannot be written or that would overwrite one of the `inputs`.
    fn check_outputs<'a>(
        &self,
        inputs: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<(), OutputError> {
        let extended = self.extended_scenario.iter().flat_map(|path| Scenario::files_of(path));
        let outputs = [&self.json, &self.report].into_iter().flatten().cloned().chain(extended);
        check_outputs(outputs, inputs)
    }
}

/// Runs the command.
pub fn run(args: &DiagnoseArgs) -> CommandResult {
    args.check_logs()?;
    let options = args.processing.options()?;
    let (arm, layout, mut inputs) = args.source.load()?;
    let logs = args.logs.iter().chain(&args.held_out).chain(&args.sim);
    args.check_outputs(inputs.iter().map(|input| &input.path).chain(logs))?;
    let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), arm.torque_offsets))?;
    let model = Model::new(&arm);
    let logs = read_logs(&args.logs, &arm, &layout)?;
    let held_out = read_logs(&args.held_out, &arm, &layout)?;
    refuse_same(&logs, &held_out)?;
    let Some(log) = logs.first() else { return Ok(Outcome::Done) };
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
    let simulation = args
        .sim
        .as_deref()
        .map(|file| Simulated::load(file, (&arm, &set), &log.input.sha256))
        .transpose()?;
    if let Some(Simulated { files, .. }) = &simulation {
        args.check_outputs(files)?;
        inputs.extend(super::robot::inputs(files)?);
    }
    inputs.extend(logs.iter().chain(&held_out).map(|log| log.input.clone()));
    let program = Program::started(None, inputs);

    let mut diagnoser = Diagnoser::new(&arm, &model, &set, options.clone())
        .of_currents(log.log.drive_gain_nm_a(&arm));
    let nominal = simulation.as_ref().map(Simulated::nominal);
    let mut finding = match diagnoser.diagnose(&log.measurement(), &validations, nominal) {
        Err(error) if error.is_declined() => {
            let at_rest = error.misreading().is_none()
                && nothing_moves(&mut Identifier::new(&model, &set, options), &log.measurement());
            let sentence = match at_rest {
                true => format!("{}: declined, {NOTHING_MOVES}", log.log.source),
                false => error.declined(&log.log.source),
            };
            let misreading = error.misreading().cloned();
            let misread = misreading
                .map(|misreading| MisreadLog::new(log.log.source.clone(), misreading, &layout));
            return decline(args, &log.log, sentence, misread, program);
        }
        finding => finding?,
    };
    // An error in a later step must not discard the diagnosis: it is reported after everything else is printed and
    // written.
    let mut failed = None;
    if let Some(loaded) = logs.get(1) {
        let [reference, loaded] = [log, loaded].map(LoadedLog::measurement);
        match diagnoser.payload(&finding, &reference, &loaded, args.known_payload_kg) {
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
    let of_the_options = simulation.and_then(|simulation| simulation.warning).into_iter();
    let unused = args.processing.unused(&finding.identification.processing);
    let of_the_logs = logs.iter().chain(&held_out).flat_map(|log| log_warnings(&log.log));
    finding.diagnosis.warnings.extend(of_the_options.chain(unused).chain(of_the_logs));

    print(&finding.diagnosis);
    if let Some(path) = &args.json {
        let body = WithRows { diagnosis: &finding.diagnosis, rows: Rows::of(&[&log.log]) };
        Document { schema: DIAGNOSE_SCHEMA, program: &program, body: &body }.write(path)?;
    }
    if let Some(path) = &args.report {
        page(&finding, &arm, program)?.write(path)?;
        say!("report: {}", path.display());
    }
    if let Some(path) = &args.extended_scenario {
        let extended = || -> CommandResult {
            let simulation = diagnoser.extended_simulation(&finding)?;
            let m = log.measurement();
            Scenario::of_diagnosis(&simulation, &finding, &m, &set, &options)?.save(path)?;
            // Loading checks that the written file is a valid scenario.
            Scenario::load(Some(path))?;
            Ok(Outcome::Done)
        };
        match (extended(), &failed) {
            (Ok(_), _) => say!("scenario: {}", path.display()),
            (Err(error), None) => return Err(error),
            (Err(error), Some(_)) => say!("note: no scenario: {error}"),
        }
    }
    match failed {
        Some(error) => Err(error.into()),
        None if finding.diagnosis.is_contradicted() => Ok(Outcome::Negative),
        None => Ok(Outcome::Done),
    }
}

/// Refuses a log that is held out from itself, and two logs that are one.
fn refuse_same(logs: &[LoadedLog], held_out: &[LoadedLog]) -> Result<(), String> {
    let known: Vec<RowsOf> = logs.iter().map(LoadedLog::rows).collect();
    let is_known = |log: &&LoadedLog| {
        let rows = log.rows();
        known.iter().any(|other| rows.are_of(other))
    };
    if let Some(same) = held_out.iter().find(is_known) {
        let file = same.input.path.display();
        return Err(format!("{file} is held out, but it is also the log that is diagnosed"));
    }
    match &known[..] {
        [one, other] if one.are_of(other) => {
            let [one, other] = [one, other].map(|rows| rows.log.input.path.display());
            Err(format!("{one} and {other} are the same log, or parts of it: they tell of no load"))
        }
        _ => Ok(()),
    }
}

/// Prints the sentences, the tables that have rows, and the remarks.
fn print(diagnosis: &Diagnosis) {
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
}

/// Parses a mass in kg.
fn mass(text: &str) -> Result<f64, String> {
    let mass: f64 = text.parse().map_err(|e| format!("{e}"))?;
    let is_mass = mass > 0.0 && mass.is_finite();
    if is_mass { Ok(mass) } else { Err("must be a positive number".into()) }
}

/// Reports on a log that cannot be diagnosed, for the reason in `sentence`: its motion does not identify the model, or
/// its channels have to be read differently.
fn decline(
    args: &DiagnoseArgs,
    log: &Log,
    sentence: String,
    misread: Option<MisreadLog>,
    program: Program,
) -> CommandResult {
    say!("{sentence}");
    if let Some(advice) = misread.as_ref().and_then(MisreadLog::advice) {
        say!("\n{advice}\n");
    }
    let warnings: Vec<String> = log_warnings(log).collect();
    for warning in &warnings {
        say!("note: {warning}");
    }
    let rows = Rows::of(&[log]);
    if let Some(path) = &args.json {
        let body = Declined {
            log: &log.source,
            verdict: "declined",
            causes: [],
            misreading: misread.as_ref(),
            sentences: [&sentence],
            warnings: &warnings,
            rows: &rows,
        };
        Document { schema: DIAGNOSE_SCHEMA, program: &program, body: &body }.write(path)?;
    }
    if let Some(path) = &args.report {
        let facts = vec![rows.in_words()];
        let verdict = Verdict { status: Status::Bad, sentence, facts };
        let mut page = Page::new("Diagnosis", log.source.clone(), verdict, program);
        page.extend(misread.as_ref().and_then(MisreadLog::section));
        page.with_warnings(&warnings).write(path)?;
        say!("report: {}", path.display());
    }
    Ok(Outcome::Negative)
}

/// The JSON for a log without a diagnosis.
#[derive(Serialize)]
struct Declined<'a> {
    log: &'a str,
    verdict: &'static str,
    causes: [(); 0],
    misreading: Option<&'a MisreadLog>,
    sentences: [&'a str; 1],
    warnings: &'a [String],
    rows: &'a Rows,
}

/// The diagnosis with the numbers of rows read, used and set aside.
#[derive(Serialize)]
struct WithRows<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    rows: Rows,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use clap::error::ErrorKind;

    #[derive(Debug, Parser)]
    struct Command {
        #[command(flatten)]
        args: DiagnoseArgs,
    }

    /// A diagnosis weights by the noise it measures in the log, so there is no covariance to choose.
    #[test]
    fn no_covariance_can_be_chosen() {
        let of = |more: &[&str]| {
            let mut words = vec!["armid", "log.csv", "--robot", "ur5"];
            words.extend(more);
            Command::try_parse_from(words)
        };
        let error = of(&["--covariance", "ols"]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::UnknownArgument);
        assert!(of(&["--estimator", "ols"]).unwrap().args.sim.is_none());
    }
}
