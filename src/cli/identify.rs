//! `armid identify`: estimates parameters and their uncertainty from logs of a real or simulated arm.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::loaded_log::{LoadedLog, RowsOf, read_logs};
use super::robot::{inputs, load_robot};
use super::{CommandResult, Outcome};
use crate::base::{BaseSet, Parameterisation};
use crate::dynamics::Model;
use crate::identify::covariance::CovarianceKind;
use crate::identify::physical::{self, PhysicalError, PhysicalOptions, PriorMetric, PriorWeight};
use crate::identify::{
    Estimator, FitError, Identification, Identifier, IdentifyError, Improper, Measurement,
    Misreading, Options, Processing, Regression, SeveralLogs,
};
use crate::log::{Layout, Log};
use crate::output::check_outputs;
use crate::report::identify::{
    Declined, IDENTIFY_SCHEMA, Result as IdentifyResult, Training, Validation, facts, page,
    parameter_table, residual_table,
};
use crate::report::json::{Document, Input, Program};
use crate::report::misread::MisreadLog;
use crate::report::{Page, ReportError};
use crate::robot::{Arm, LoadedArm};

/// Identify the base parameters of an arm from logs of its motion.
#[derive(Debug, Args)]
pub struct IdentifyArgs {
    /// Logs to identify from.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    source: SourceArgs,
    /// Reduced parameter set instead of the full one: paper (that of Kovincic et al., of a UR5).
    #[arg(long)]
    reduced: Option<String>,
    #[command(flatten)]
    processing: ProcessingArgs,
    /// Method of the covariance. Default: the best one that the log allows.
    #[arg(long, value_enum)]
    covariance: Option<CovarianceKind>,
    /// Logs to validate on. Nothing is fitted to them. (The logs to identify from go before this option.)
    #[arg(long, num_args = 1..)]
    validate: Vec<PathBuf>,
    /// Also estimate physically consistent standard parameters, for simulators.
    #[arg(long)]
    physical: bool,
    /// How deviations from the robot file's values are measured for parameters that the data do not decide.
    #[arg(long, requires = "physical", value_enum, default_value = "pull_back")]
    prior: PriorMetric,
    /// Weight of the robot file's values: 1/s² treats them as known to a relative σ of s (1: to 100 %; 100: to 10 %),
    /// auto takes the weight that predicts left-out periods best.
    #[arg(long, requires = "physical", default_value_t, allow_negative_numbers = true)]
    prior_weight: PriorWeight,
    /// Write the result as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the report as one HTML page.
    #[arg(long)]
    report: Option<PathBuf>,
}

/// Which arm and which kind of log.
#[derive(Debug, Args)]
pub struct SourceArgs {
    /// Robot: ur5, ur10e, ur3e, ur5e, or a .toml, .urdf or .xml (MJCF) file (FILE.urdf#LINK: the arm
    /// up to that link).
    #[arg(long)]
    pub robot: String,
    /// Layout of the logs: armid (RTDE names), ur_torque (RTDE, with actual_current_as_torque), ros2_joint_states,
    /// ur10e_innopolis, ur10e_innopolis_author, or a .toml file (all keys: layouts/example.toml).
    #[arg(long, default_value = "armid")]
    pub layout: String,
}

/// How logs are processed.
#[derive(Debug, Args)]
pub struct ProcessingArgs {
    /// Cut-off of the low-pass on torque and regressor of a single run, Hz [default: 10]. A motion that repeats needs
    /// no low-pass.
    #[arg(long = "cutoff", value_name = "HZ", allow_negative_numbers = true)]
    cutoff_hz: Option<f64>,
    /// Rate to which the log is resampled, Hz. Default: its own, but logs above 300 Hz are decimated to 150 to 300 Hz.
    #[arg(long = "rate", value_name = "HZ", allow_negative_numbers = true)]
    rate_hz: Option<f64>,
    /// Period of the motion, s. Default: found in the log; 0 treats the log as a single run.
    #[arg(long = "period", value_name = "S", allow_negative_numbers = true)]
    period_s: Option<f64>,
    /// Estimator. Default: spectral if at least four periods repeat, otherwise wls.
    #[arg(long, value_enum)]
    estimator: Option<Estimator>,
}

impl ProcessingArgs {
    /// Checks the options and converts them to those of the library.
    pub fn options(&self) -> Result<Options, String> {
        let default = Options::default();
        checked(Options {
            estimator: self.estimator,
            cutoff_hz: self.cutoff_hz.unwrap_or(default.cutoff_hz),
            rate_hz: self.rate_hz,
            repetition: self.period_s.into(),
            ..default
        })
    }

    /// A warning about a given option that the `processing` did not use.
    pub fn unused(&self, processing: &Processing) -> Option<String> {
        (self.cutoff_hz.is_some() && processing.cutoff_hz.is_none()).then(|| {
            "--cutoff is not used: the motion repeats, and is averaged in place of filtered (--period 0 treats it as a single run)"
                .to_owned()
        })
    }
}

/// Refuses options that no log can be processed with, by their names on the command line.
pub fn checked(options: Options) -> Result<Options, String> {
    match options.improper() {
        Some(Improper { key, value, requirement }) => {
            let name = key.trim_end_matches("_hz").trim_end_matches("_s");
            Err(format!("--{name} {value}: {requirement}"))
        }
        None => Ok(options),
    }
}

impl SourceArgs {
    /// The arm, the layout of its logs, and the files that describe both. Prints the assumptions about the arm.
    pub fn load(&self) -> Result<(Arm, Layout, Vec<Input>), Box<dyn std::error::Error>> {
        let LoadedArm { arm, mut files, .. } = load_robot(&self.robot)?;
        let layout = Layout::load(&self.layout)?;
        files.extend(layout.files());
        Ok((arm, layout, inputs(&files)?))
    }
}

/// What the command reads.
struct Sources {
    arm: Arm,
    layout: Layout,
    set: BaseSet,
    logs: Vec<LoadedLog>,
    validation_logs: Vec<LoadedLog>,
}

/// What was identified from the logs.
struct Identified {
    regression: Regression,
    identification: Identification,
    /// The first log that has to be read differently.
    misread: Option<MisreadLog>,
}

/// Runs the command.
pub fn run(args: &IdentifyArgs) -> CommandResult {
    let options = args.options()?;
    let (sources, program) = Sources::read(args)?;
    let Sources { arm, set, .. } = &sources;
    let model = Model::new(arm);
    let mut identifier = Identifier::new(&model, set, options);
    let identified = match sources.identify(args, &mut identifier)? {
        Ok(identified) => identified,
        Err(declined) => return decline(args, &declined, program),
    };
    let training = Training {
        arm,
        robot_source: &args.source.robot,
        set,
        logs: &sources.training_logs(),
        nominal: &set.values(&model.standard_parameters()),
        regression: &identified.regression,
        identification: &identified.identification,
        reduced: args.reduced.as_deref(),
        misread: identified.misread.as_ref(),
    };
    // An error in a later step must not discard the identification.
    let mut failed: Vec<String> = Vec::new();
    let validations = sources.validations(&mut identifier, &training, &mut failed);
    let mut result = IdentifyResult::of(&training, &validations)?;
    if let Err(error) = args.add_physical(&mut result, &training) {
        failed.push(error.to_string());
    }
    print(&result);
    write(args, &result, program, |program| page(&result, &training, &validations, program))?;
    match failed.is_empty() {
        false => Err(failed.join("; ").into()),
        true if result.is_declined() || result.is_contradicted() => Ok(Outcome::Negative),
        true => Ok(Outcome::Done),
    }
}

impl IdentifyArgs {
    /// Checks the options and converts them to those of the library.
    fn options(&self) -> Result<Options, String> {
        let options = Options { covariance: self.covariance, ..self.processing.options()? };
        if self.logs.len() > 1 && self.prior_weight == PriorWeight::CrossValidated {
            let message = "the weight is found by leaving out periods of one log in turn; of several logs give it as a number";
            return Err(format!("--prior-weight auto: {message}"));
        }
        Ok(options)
    }

    /// Adds physically consistent standard parameters to `result`, where they are asked for.
    fn add_physical(
        &self,
        result: &mut IdentifyResult,
        training: &Training,
    ) -> Result<(), PhysicalError> {
        if !self.physical {
            return Ok(());
        }
        let options = PhysicalOptions {
            metric: self.prior,
            prior_weight: self.prior_weight,
            ..PhysicalOptions::default()
        };
        let Training { arm, set, identification, .. } = training;
        let Identification { fit, covariance, .. } = identification;
        let estimate = physical::solve(arm, set, fit, covariance, &options)?;
        result.set_physical(&estimate, training);
        Ok(())
    }
}

impl Sources {
    /// Reads everything that `args` names, and refuses outputs that would overwrite it and logs that are used twice.
    fn read(args: &IdentifyArgs) -> Result<(Self, Program), Box<dyn std::error::Error>> {
        let (arm, layout, mut inputs) = args.source.load()?;
        check_outputs(
            [&args.json, &args.report].into_iter().flatten(),
            inputs.iter().map(|input| &input.path).chain(&args.logs).chain(&args.validate),
        )?;
        let parameterisation = Parameterisation::of(&arm, args.reduced.as_deref())?;
        let set = BaseSet::find(&arm, parameterisation)?;
        let mut logs = read_logs(&args.logs, &arm, &layout)?;
        let mut validation_logs = read_logs(&args.validate, &arm, &layout)?;
        refuse_twice(&logs, &validation_logs)?;
        logs.iter_mut().chain(&mut validation_logs).for_each(LoadedLog::mend);
        inputs.extend(logs.iter().chain(&validation_logs).map(|l| l.input.clone()));
        let sources = Self { arm, layout, set, logs, validation_logs };
        Ok((sources, Program::started(None, inputs)))
    }

    /// The logs to identify from.
    fn training_logs(&self) -> Vec<&Log> {
        self.logs.iter().map(|l| &l.log).collect()
    }

    /// Identifies the arm from all logs, or says why they do not tell its parameters.
    fn identify(
        &self,
        args: &IdentifyArgs,
        identifier: &mut Identifier,
    ) -> Result<Result<Identified, Box<Declined>>, IdentifyError> {
        let Self { arm, set, .. } = self;
        let logs = self.training_logs();
        let all_parameters = || (0..set.rank()).map(|k| set.name(k).to_owned()).collect();
        let measurements: Vec<Measurement> = self.logs.iter().map(LoadedLog::measurement).collect();
        let regressions = match SeveralLogs::each(identifier, &measurements) {
            Err(IdentifyError::NoMotion { .. }) if logs.len() == 1 => {
                return Ok(Err(Box::new(Declined::at_rest(arm, &logs, all_parameters()))));
            }
            regressions => regressions?,
        };
        let misread = self.misread(&regressions, identifier.options());
        let mut all = SeveralLogs::together(identifier, &measurements, regressions)?;
        let unused = args.processing.unused(&all.regression.prepared.processing);
        let remarks = self.logs.iter().flat_map(|log| &log.mended).cloned();
        all.regression.prepared.warnings.extend(unused.into_iter().chain(remarks));
        let parameters = match all.identify(identifier) {
            Err(IdentifyError::Fit(FitError::NotExcited { parameters })) => parameters,
            Err(IdentifyError::Fit(FitError::StandsStill)) => all_parameters(),
            identification => {
                let (regression, identification) = (all.regression, identification?);
                return Ok(Ok(Identified { regression, identification, misread }));
            }
        };
        Ok(Err(Box::new(Declined::new(arm, &logs, &all.regression, parameters))))
    }

    /// The first of the logs, laid out as `regressions`, that has to be read differently.
    fn misread(&self, regressions: &[Regression], options: &Options) -> Option<MisreadLog> {
        regressions.iter().zip(&self.logs).find_map(|(regression, log)| {
            let misreading = log.misreading(&self.arm, regression, options)?;
            Some(MisreadLog::new(log.log.source.clone(), misreading, &self.layout))
        })
    }

    /// Predicts the logs for validation; those that cannot be predicted are added to `failed`.
    fn validations(
        &self,
        identifier: &mut Identifier,
        training: &Training,
        failed: &mut Vec<String>,
    ) -> Vec<Validation> {
        let mut validations = Vec::new();
        for log in &self.validation_logs {
            match validate(&self.arm, identifier, log, &training.identification.fit.theta) {
                Ok(validation) => validations.push(validation),
                Err(error) => failed.push(error.to_string()),
            }
        }
        validations
    }
}

/// Refuses logs that are given twice, or validated on although they are identified from.
fn refuse_twice(logs: &[LoadedLog], validation_logs: &[LoadedLog]) -> Result<(), String> {
    let rows: Vec<RowsOf> = logs.iter().map(LoadedLog::rows).collect();
    for (k, log) in rows.iter().enumerate() {
        if let Some(same) = rows[..k].iter().find(|other| log.are_of(other)) {
            let [one, other] = [same, log].map(|rows| rows.log.input.path.display());
            return Err(format!(
                "{one} and {other} are the same log, or parts of it: counted twice, it would claim to know more than it does"
            ));
        }
    }
    for validation in validation_logs.iter().map(LoadedLog::rows) {
        if let Some(same) = rows.iter().find(|log| validation.are_of(log)) {
            let [validation, log] = [&validation, same].map(|rows| rows.log.input.path.display());
            return Err(format!(
                "{validation} is validated on, but it is the training log {log}, or a part of it: a fit always describes its own data"
            ));
        }
    }
    Ok(())
}

/// Prints the tables, remarks and verdict of `result`.
fn print(result: &IdentifyResult) {
    say!("{}", parameter_table(result).to_text());
    say!("{}", residual_table(result).to_text());
    for warning in result.notes() {
        say!("note: {warning}");
    }
    for fact in facts(result) {
        say!("{fact}");
    }
    say!("\n{}", result.sentence());
    if let Some(advice) = result.misread().and_then(MisreadLog::advice) {
        say!("\n{advice}\n");
    }
    if let Some(trust) = result.trust() {
        say!("{trust}");
    }
    for fact in result.physical().map_or_else(Vec::new, |physical| physical.facts()) {
        say!("{fact}");
    }
}

/// Writes the files that are asked for: `body` as JSON, and the page that `page_of` makes.
fn write(
    args: &IdentifyArgs,
    body: &impl Serialize,
    program: Program,
    page_of: impl FnOnce(Program) -> Result<Page, ReportError>,
) -> Result<(), ReportError> {
    if let Some(path) = &args.json {
        Document { schema: IDENTIFY_SCHEMA, program: &program, body }.write(path)?;
    }
    if let Some(path) = &args.report {
        page_of(program)?.write(path)?;
        say!("report: {}", path.display());
    }
    Ok(())
}

/// Reports on a log whose motion leaves parameters without any effect on the torque.
fn decline(args: &IdentifyArgs, declined: &Declined, program: Program) -> CommandResult {
    for warning in &declined.warnings {
        say!("note: {warning}");
    }
    say!("\n{}", declined.sentence());
    write(args, declined, program, |program| Ok(declined.page(program)))?;
    Ok(Outcome::Negative)
}

/// Predicts a log that was not used for the fit, with the same processing.
fn validate(
    arm: &Arm,
    identifier: &mut Identifier,
    log: &LoadedLog,
    theta: &[f64],
) -> Result<Validation, Box<dyn std::error::Error>> {
    let regression = identifier.regression(&log.measurement())?;
    let misreading = log.misreading(arm, &regression, identifier.options());
    let mut warnings: Vec<String> = misreading.iter().map(Misreading::sentence).collect();
    let manufacturer = match log.log.target_torque_nm(arm)? {
        Some(torque_nm) => {
            let given = Measurement { torque_nm: &torque_nm, ..log.measurement() };
            identifier.feed_forward(&given, &mut warnings)?
        }
        None => None,
    };
    let mut validation = Validation::new(&log.log, &regression, manufacturer.as_ref(), theta);
    let with_name = |warning| format!("{}: {warning}", log.log.source);
    validation.warnings.extend(warnings.into_iter().map(with_name));
    validation.warnings.extend(log.mended.iter().cloned());
    Ok(validation)
}
