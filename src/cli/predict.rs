//! `armid predict`: the torque that an identified arm takes along a log or a planned motion.

use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::DMatrix;

use super::earlier::{Doubt, EarlierResult};
use super::identify::{SourceArgs, checked};
use super::loaded_log::LoadedLog;
use super::{CommandResult, Outcome};
use crate::base::{BaseSet, Parameterisation};
use crate::dot::dot;
use crate::dynamics::Model;
use crate::excitation::PlannedMotion;
use crate::identify::{
    Forecast, Identifier, Misreading, Options, Prediction, Repetition, prediction_sd,
};
use crate::log::{Layout, write_columns};
use crate::number::significant;
use crate::output::check_outputs;
use crate::report::identify::Validation;
use crate::report::{Column, Status, Table};
use crate::robot::{Arm, JointSignals};

/// Write the torque of an identified arm along a log or a planned motion, with its σ.
#[derive(Debug, Args)]
pub struct PredictArgs {
    /// A log, which is processed as a single run, or a planned motion: a file with exactly the columns of
    /// `armid excite --csv`. The torque of a planned motion is that of every row, without any filter.
    log: PathBuf,
    #[command(flatten)]
    source: SourceArgs,
    /// Result of `armid identify --json` for this robot.
    #[arg(long, value_name = "RESULT.json")]
    result: PathBuf,
    /// CSV file for the torque.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// Cut-off of the low-pass on the measured and the predicted torque of a log, Hz [default: 10].
    #[arg(long = "cutoff", value_name = "HZ", allow_negative_numbers = true)]
    cutoff_hz: Option<f64>,
    /// Rate to which a log is resampled, Hz. Default: its own, but logs above 300 Hz are decimated to 150 to 300 Hz.
    #[arg(long = "rate", value_name = "HZ", allow_negative_numbers = true)]
    rate_hz: Option<f64>,
}

impl PredictArgs {
    /// Checks the options and converts them to those of the library.
    fn options(&self) -> Result<Options, String> {
        let default = Options::default();
        checked(Options {
            cutoff_hz: self.cutoff_hz.unwrap_or(default.cutoff_hz),
            rate_hz: self.rate_hz,
            repetition: Repetition::Never,
            ..default
        })
    }
}

/// Runs the command.
pub fn run(args: &PredictArgs) -> CommandResult {
    let options = args.options()?;
    let (arm, layout, inputs) = args.source.load()?;
    check_outputs(
        [&args.out],
        inputs.iter().map(|input| &input.path).chain([&args.log, &args.result]),
    )?;
    let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), arm.torque_offsets))?;
    let known = Known::load(&args.result, &arm, &set)?;
    match PlannedMotion::read(&args.log, arm.dof())? {
        Some(planned) => along_motion(args, &planned, (&arm, &set), &known)?,
        None => along_log(args, options, (&arm, &layout, &set), &known)?,
    }
    for note in &known.notes {
        say!("note: {note}");
    }
    Ok(Outcome::Done)
}

/// Base parameters of an earlier result, in the order of a base set.
struct Known {
    theta: Vec<f64>,
    /// `None` where the result does not tell it.
    covariance: Option<DMatrix<f64>>,
    /// Remarks for the user.
    notes: Vec<String>,
}

impl Known {
    /// Reads the result in `path`. Refuses one of another arm, of a reduced set, or of another set of base parameters.
    fn load(path: &Path, arm: &Arm, set: &BaseSet) -> Result<Self, Box<dyn std::error::Error>> {
        let name = path.display();
        let result = EarlierResult::load(path)?;
        result.check(arm).map_err(|other| format!("{name}: {other}"))?;
        let (found, expected) = (result.parameters().len(), set.rank());
        if found == 0 {
            return Err(format!("{name}: no base parameters were identified").into());
        }
        if found != expected {
            return Err(format!(
                "{name}: it has {found} base parameters, and {} has {expected}: give the robot as it was identified (torque_offsets decides \
                 whether it has constant torques)",
                arm.name
            )
            .into());
        }
        let places = result.places(set).map_err(|fault| format!("{name}: {fault}"))?;
        let covariance = match result.lacks_covariance() {
            true => Err("it has no covariance of the base parameters".to_owned()),
            false => result.covariance(&places),
        };
        let unknown = covariance.as_ref().err().map(|why| {
            format!("{name}: {why}: how uncertain the parameters leave the torque is not written")
        });
        let doubt = result.doubt().map(|doubt| match doubt {
            Doubt::Contradicted => {
                format!("{name}: its log contradicts the arm: its parameters do not hold, nor do these torques and their σ")
            }
            Doubt::WrongModel => format!(
                "{name}: the model was wrong along its log: the predicted torque lacks what the model lacks, of which its σ says nothing"
            ),
        });
        let open = result.is_not_identified().then(|| {
            format!("{name}: its log does not tell all parameters: torques along other motions may be wrong by more than their σ")
        });
        Ok(Self {
            theta: result.values(&places),
            covariance: covariance.ok(),
            notes: unknown.into_iter().chain(doubt).chain(open).collect(),
        })
    }
}

/// Predicts the torque along a log, beside the measured one, with the processing of `armid identify --validate`.
fn along_log(
    args: &PredictArgs,
    options: Options,
    (arm, layout, set): (&Arm, &Layout, &BaseSet),
    known: &Known,
) -> Result<(), Box<dyn std::error::Error>> {
    let mut log = LoadedLog::read(&args.log, arm, layout)?;
    log.mend();
    let model = Model::new(arm);
    let mut identifier = Identifier::new(&model, set, options);
    let regression = identifier.regression(&log.measurement())?;
    let misreading = log.misreading(arm, &regression, identifier.options());
    let Validation { prediction, processing, warnings, .. } =
        Validation::new(&log.log, &regression, None, &known.theta);
    let problem = &regression.problem;
    let sd_nm = known.covariance.as_ref().map(|covariance| prediction_sd(problem, covariance));
    let Prediction { time_s, measured_nm, predicted_nm, .. } = &prediction;
    let measured = [("actual_torque", measured_nm), ("predicted_torque", predicted_nm)];
    let blocks = measured.into_iter().chain(of_sd(sd_nm.as_ref()));
    write_columns(&args.out, &columns(time_s, blocks), |_| {})?;

    let residual = prediction.residual();
    let mut table = Table::new([
        Column::number("joint", ""),
        Column::number("measured, rms", "Nm"),
        Column::number("error, rms", "Nm"),
        Column::number("of the torque", "%"),
        Column::number("σ by the parameters, rms", "Nm"),
    ]);
    for j in 0..arm.dof() {
        let cells = [
            residual.torque_rms_nm[j],
            residual.rms_nm[j],
            residual.relative_percent[j],
            rms_of(sd_nm.as_ref(), j),
        ];
        let cells = cells.map(|value| significant(value, 3));
        table.push(std::iter::once((j + 1).to_string()).chain(cells));
    }
    say!("{}", table.to_text());
    let misreading = misreading.iter().map(Misreading::sentence);
    let misreading = misreading.map(|sentence| format!("{}: {sentence}", log.log.source));
    for warning in warnings.into_iter().chain(misreading).chain(log.mended.iter().cloned()) {
        say!("note: {warning}");
    }
    let percent = residual.relative_percent.iter();
    let (low, high) = percent.fold((f64::INFINITY, 0f64), |(l, h), &p| (l.min(p), h.max(p)));
    say!(
        "The error of the torque predicted along {} is {low:.1} to {high:.1} % of the torque per joint ({} samples at {} Hz, both torques \
         low-passed at {} Hz).",
        args.log.display(),
        prediction.samples(),
        significant(problem.rate_hz, 4),
        significant(processing.cutoff_hz.unwrap_or(f64::NAN), 3)
    );
    Ok(())
}

/// Predicts the torque of every row of a planned motion.
fn along_motion(
    args: &PredictArgs,
    planned: &PlannedMotion,
    (arm, set): (&Arm, &BaseSet),
    known: &Known,
) -> Result<(), Box<dyn std::error::Error>> {
    let PlannedMotion { time_s, motion } = planned;
    let (model, covariance) = (Model::new(arm), known.covariance.as_ref());
    let Forecast { torque_nm, sd_nm } =
        Forecast::along(motion, &model, set, &known.theta, covariance);
    let is_finite = |j: usize| torque_nm.joint(j).iter().all(|nm| nm.is_finite());
    if let Some(j) = (0..arm.dof()).find(|j| !is_finite(*j)) {
        let file = args.log.display();
        return Err(format!(
            "{file}: its motion is none of an arm: the torque of joint {} is infinite",
            j + 1
        )
        .into());
    }
    let blocks = std::iter::once(("predicted_torque", &torque_nm)).chain(of_sd(sd_nm.as_ref()));
    write_columns(&args.out, &columns(time_s, blocks), |_| {})?;

    let mut table = Table::new([
        Column::number("joint", ""),
        Column::number("peak torque", "Nm"),
        Column::number("at", "s"),
        Column::number("of the drive's limit", "%"),
        Column::number("torque, rms", "Nm"),
        Column::number("σ by the parameters, rms", "Nm"),
    ]);
    let mut beyond = Vec::new();
    for (j, joint) in arm.joints.iter().enumerate() {
        let torque = torque_nm.joint(j);
        let (peak_nm, at_s) = peak(torque, time_s);
        let limit_nm = joint.limits.torque_nm;
        let share = if limit_nm.is_finite() { peak_nm / limit_nm } else { f64::NAN };
        if share > 1.0 {
            let peak_nm = significant(peak_nm, 4);
            let joint = j + 1;
            beyond.push(format!(
                "joint {joint} needs {peak_nm} Nm at {at_s:.3} s, and its drive gives {limit_nm} Nm"
            ));
        }
        let cells = [
            significant(peak_nm, 3),
            format!("{at_s:.3}"),
            significant(100.0 * share, 3),
            significant(rms(torque), 3),
            significant(rms_of(sd_nm.as_ref(), j), 3),
        ];
        let status = (share > 1.0).then_some(Status::Bad);
        table.push_judged(status, std::iter::once((j + 1).to_string()).chain(cells));
    }
    say!("{}", table.to_text());
    for warning in &beyond {
        say!("note: {warning}");
    }
    if args.cutoff_hz.is_some() || args.rate_hz.is_some() {
        say!("note: --cutoff and --rate are not used: nothing is filtered along a planned motion");
    }
    let are_unknown = arm.joints.iter().all(|joint| joint.limits.torque_nm.is_infinite());
    let limits = match beyond.len() {
        _ if are_unknown => "the torque limits of its drives are not known".to_owned(),
        0 => "no drive is asked for more than its limit".to_owned(),
        n => format!("{n} of {} drives are asked for more than their limits", arm.dof()),
    };
    say!(
        "Predicted the torque along the planned motion {} in {} rows: {limits}.",
        args.log.display(),
        time_s.len()
    );
    Ok(())
}

/// The largest magnitude of `torque`, which has at least one sample, and its time in `time_s`.
fn peak(torque: &[f64], time_s: &[f64]) -> (f64, f64) {
    let magnitude = |k: &usize| torque[*k].abs();
    let largest = (0..torque.len()).max_by(|a, b| magnitude(a).total_cmp(&magnitude(b)));
    let k = largest.unwrap_or_default();
    (torque[k].abs(), time_s[k])
}

/// Root mean square of `values`.
fn rms(values: &[f64]) -> f64 {
    (dot(values, values) / values.len() as f64).sqrt()
}

/// Root mean square over the samples of joint `j`; NaN where there are no signals.
fn rms_of(signals: Option<&JointSignals>, j: usize) -> f64 {
    signals.map_or(f64::NAN, |signals| rms(signals.joint(j)))
}

/// The block of σ, where it is known.
fn of_sd(sd_nm: Option<&JointSignals>) -> Option<(&'static str, &JointSignals)> {
    sd_nm.map(|sd_nm| ("predicted_sd", sd_nm))
}

/// The columns of a file: `time_s`, then for each block of signals one column per joint, with joints counted from 0.
fn columns<'a>(
    time_s: &'a [f64],
    blocks: impl IntoIterator<Item = (&'static str, &'a JointSignals)>,
) -> Vec<(String, &'a [f64])> {
    let of_joints = |(name, signals): (&'static str, &'a JointSignals)| {
        (0..signals.joints()).map(move |j| (format!("{name}_{j}"), signals.joint(j)))
    };
    let time = std::iter::once(("timestamp".to_owned(), time_s));
    time.chain(blocks.into_iter().flat_map(of_joints)).collect()
}
