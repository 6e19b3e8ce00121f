//! Friction that joints hold in their pauses, which are left out of all equations.
//!
//! An identification tells most joints that stick ([`HeldAtRest`]). Beside another error of the model that is as large, it
//! only tells that a joint may stick. Then the causes of the log are searched for without the pauses: if the joint does not
//! stick, the model with these causes also predicts its torque there.

use super::candidates::presliding::{HELD_AT_REST, HELD_ERROR, IN_WORDS_AT_REST};
use super::cleaned::Cleaned;
use super::common_motion::move_to_common_motion;
use super::diagnoser::Diagnoser;
use super::error::DiagnoseError;
use super::explanation::Explanation;
use super::extension::Extension;
use super::kind::Kind;
use super::rms::rms_where;
use super::settled::residual;
use super::setup::Setup;
use super::study::{Entry, Study};
use super::verdict::{Cause, Estimate};
use crate::base::BaseSet;
use crate::dynamics::Parameter;
use crate::identify::{HeldAtRest, Identification, Regression};
use crate::robot::JointSignals;

/// Half the width of a 95 % interval in standard errors of a normal distribution.
const QUANTILE_95: f64 = 1.96;

impl Diagnoser<'_> {
    /// The joints that stick along the cleaned `log`, laid out in `regression` and named `source`. `identification` knows
    /// the model without causes. None if no family could name what they hold: it has to be seen as unexplained.
    pub(super) fn sticking(
        &mut self,
        regression: &Regression,
        identification: &Identification,
        (log, source): (&Cleaned, &str),
    ) -> Result<Vec<HeldAtRest>, DiagnoseError> {
        let can_be_named = self.families.iter().any(|family| family.kind() == Kind::Presliding);
        // Of a single run, the tests count no row in which a joint rests, whether it sticks or not.
        if !can_be_named || regression.prepared.replicates.is_none() {
            return Ok(Vec::new());
        }
        let Identification { held_at_rest: mut held, may_be_held, .. } = identification.clone();
        if may_be_held.is_empty() {
            return Ok(held);
        }
        let mut moving = regression.clone();
        moving.prepared.held_at_rest = [held.clone(), may_be_held.clone()].concat();
        let Ok(identification) = self.identifier.identify_regression(&moving) else {
            return Ok(held);
        };
        let theta = &identification.fit.theta;
        move_to_common_motion(&mut moving, (self.arm, self.set), theta);
        let setup = Setup { arm: self.arm, set: self.set, options: &self.options };
        let explained =
            Explanation::of(&self.families, setup, &moving, &identification, log, source);
        let explanation = match explained {
            // Pauses without which the motion does not excite all parameters are all that is known of some.
            Err(DiagnoseError::NotExcited { .. }) => return Ok(held),
            explained => explained?,
        };
        let study = &explanation.study;
        let kept = explanation.kept();
        let entries: Vec<&Entry> = kept.causes.iter().map(|cause| &cause.entry).collect();
        let model = Extension::fit(study, &entries, &study.torque);
        let left_nm = residual(study, &model);
        let sticks = |own: HeldAtRest| {
            let j = own.joint;
            let coulomb_nm = self.set.index_of(Parameter::Coulomb(j)).map_or(0.0, |k| theta[k]);
            let bare = model.without_dry_friction(j..j + 1, self.set, study.families);
            let bare = residual(study, &bare);
            let frictionless_nm = bare.joint(j);
            // Other laws than Coulomb's have not been tested at rest.
            let mut left_nm = left_nm.joint(j).to_vec();
            for k in own.pauses.iter().flatten() {
                left_nm[*k] = frictionless_nm[*k] - coulomb_nm * study.scene.sign.joint(j)[*k];
            }
            own.beside(&left_nm, frictionless_nm, coulomb_nm, &moving.problem)
        };
        held.extend(may_be_held.into_iter().filter_map(sticks).filter(|held| held.sticks));
        held.sort_by_key(|held| held.joint);
        Ok(held)
    }
}

/// Adds what joints hold in their pauses to the `causes`: to the presliding of the joint, or as a cause of its own. It is
/// what the extended `model` leaves there on average, pause by pause, if the joint has no dry friction, and is taken out
/// of its residual `after_nm`. The null model leaves `before_nm`; the noise of the mean period has the rms `noise_nm` per
/// joint.
pub(super) fn add_held(
    (study, set): (&Study, &BaseSet),
    (model, after_nm): (&Extension, &mut JointSignals),
    (before_nm, noise_nm): (&JointSignals, Option<&[f64]>),
    causes: &mut Vec<Cause>,
) {
    let problem = &study.regression.problem;
    for held in &study.scene.held_at_rest {
        let j = held.joint;
        let left = residual(study, &model.without_dry_friction(j..j + 1, set, study.families));
        let levels = held.levels(left.joint(j));
        let mut removed = 0.0;
        for (at, level) in held.pauses.iter().zip(&levels) {
            at.iter().for_each(|k| after_nm.joint_mut(j)[*k] = left.joint(j)[*k] - level);
            removed += at.len() as f64 * level * level;
        }
        let all: f64 = before_nm.joint(j).iter().map(|e| e * e).sum();
        let noise = noise_nm.map_or(0.0, |nm| nm[j]);
        let explainable = (all - problem.samples as f64 * noise * noise).max(removed);
        let gain = removed / explainable;

        let scatter = held.errors_of_levels(&problem.panels[j].y, problem.samples);
        let white = |at: &Vec<usize>| {
            study.scene.noise_nm[j] / ((at.len() * problem.periods) as f64).sqrt()
        };
        // Coarse readings may be the same in all periods.
        let errors: Vec<f64> =
            scatter.iter().zip(&held.pauses).map(|(own, at)| own.max(white(at))).collect();
        let held_nm = rms_where(&levels, |_| true);
        let off = QUANTILE_95 * (HELD_ERROR * held_nm).hypot(rms_where(&errors, |_| true));
        let estimate =
            Estimate { value: held_nm, unit: "Nm", ci95: [held_nm - off, held_nm + off] };
        let is_presliding =
            |cause: &&mut Cause| cause.kind == Kind::Presliding && cause.joint == Some(j + 1);
        if let Some(cause) = causes.iter_mut().find(is_presliding) {
            cause.parameters.insert("held_nm", estimate);
            cause.form = Some(HELD_AT_REST);
            cause.gain_fraction.get_or_insert(gain);
            continue;
        }
        let square: f64 =
            levels.iter().zip(&errors).map(|(level, error)| (level / error).powi(2)).sum();
        let held = [("held_nm", estimate)];
        let mut cause =
            Cause::certain(Kind::Presliding, Some(j), IN_WORDS_AT_REST, square.sqrt(), &held);
        cause.form = Some(HELD_AT_REST);
        cause.gain_fraction = Some(gain);
        cause.make_provisional();
        causes.push(cause);
    }
}
