//! Causes and the estimate of the arm, fitted in turn.
//!
//! Causes are searched for along loads, friction and torques that an estimate of the arm predicts, and unmodelled
//! causes bias that estimate. Once friction is known better, so are the load on a gear, contacts with the arm, and
//! where readings are cut off.

use super::contact::{self, BesideModel};
use super::error::DiagnoseError;
use super::extension::Extension;
use super::selection::{Contender, Found, Kept};
use super::study::{Entry, Study};
use crate::base::BaseSet;
use crate::robot::{Arm, JointSignals};
use crate::signal::{SignalError, ZeroPhase, mean_period};

/// Most rounds of causes and estimate.
const ROUNDS: usize = 4;
/// A round that gains less than this, in 2 ln of the evidence, changes nothing that counts.
const SETTLED: f64 = 4.0;

/// Fits what was `found` in `study` and the estimate of the arm in turn, until neither changes the other.
///
/// For a motion that repeats, a cause that was found only because the estimate was biased is dropped on the way, and
/// the arm is estimated without it. A single run gets one round, because its causes are judged by what they leave
/// ([`Kept::of_a_single_run`]).
pub fn settled<'s>(
    mut study: Study<'s>,
    found: Found,
    (arm, set): (&Arm, &BaseSet),
    log: &str,
) -> Result<(Study<'s>, Vec<Contender>), DiagnoseError> {
    let Found { mut causes, mut evidence } = found;
    for _ in 0..ROUNDS {
        let entries: Vec<&Entry> = causes.iter().map(|c| &c.entry).collect();
        let refined = Extension::fit(&study, &entries, &study.torque);
        study = study.with_estimate(arm, set, &refined.theta, &entries);
        study = without_contacts(study, set, &refined, log)?;
        if !study.scene.periodic {
            break;
        }
        let found = causes.len();
        let mut kept = Kept::taken_over(&study, causes);
        let is_complete = kept.causes.len() == found;
        let dropped = kept.drop_unneeded(|_| true);
        let gained = kept.total_evidence() - evidence;
        evidence += gained;
        causes = kept.causes;
        if is_complete && dropped.is_empty() && gained < SETTLED {
            break;
        }
    }
    study.look_everywhere();
    Ok((study, causes))
}

/// The `study` of a single run without the rows in which something touched the arm according to `model`.
pub fn without_contacts<'s>(
    study: Study<'s>,
    set: &BaseSet,
    model: &Extension,
    log: &str,
) -> Result<Study<'s>, DiagnoseError> {
    if study.scene.periodic {
        return Ok(study);
    }
    let touched = beside_model(&study, &residual(&study, model))?;
    study.without_rows(set, &touched.samples, log)
}

/// Contacts in the residual of a model along a single run. None for a motion that repeats, which shows them better by
/// itself ([`contact::between_periods`]).
pub fn beside_model(study: &Study, after_nm: &JointSignals) -> Result<BesideModel, SignalError> {
    let regression = study.regression;
    let prepared = &regression.prepared;
    let processing = &prepared.processing;
    let (false, Some(cutoff_hz), Some(order)) =
        (study.scene.periodic, processing.cutoff_hz, processing.order)
    else {
        return Ok(BesideModel::default());
    };
    let low_pass = ZeroPhase::new(cutoff_hz, order, processing.rate_hz)?;
    let at = |row: usize| regression.sample(row);
    let qd = &prepared.motion.qd_rad_s;
    let qd = JointSignals::from_fn(qd.joints(), after_nm.samples(), |j, k| qd.joint(j)[at(k)]);
    let (start_s, rate_hz) = (processing.window_s[0], processing.rate_hz);
    let time_s: Vec<f64> =
        (0..after_nm.samples()).map(|k| start_s + at(k) as f64 / rate_hz).collect();
    contact::beside_model(after_nm, &qd, &time_s, &low_pass)
}

/// Torque that `model` predicts along its own log, Nm, at the samples of the regression.
pub fn fitted(study: &Study, model: &Extension) -> JointSignals {
    let problem = &study.regression.problem;
    model.torque_nm(study.families, &study.scene, problem, Some(&study.whitening))
}

/// Residual of `model` over time, Nm: of the mean period, or of the single run.
pub fn residual(study: &Study, model: &Extension) -> JointSignals {
    let problem = &study.regression.problem;
    let predicted = fitted(study, model);
    let mut out = JointSignals::zeros(problem.joints(), problem.samples);
    for (j, panel) in problem.panels.iter().enumerate() {
        let y = mean_period(&panel.y, problem.samples);
        let pairs = y.iter().zip(predicted.joint(j));
        out.joint_mut(j).iter_mut().zip(pairs).for_each(|(o, (y, p))| *o = y - p);
    }
    out
}
