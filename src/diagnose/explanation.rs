//! The search for what explains a log, from the first look at it to the causes that are kept.

use super::candidates::Candidate;
use super::cleaned::Cleaned;
use super::contenders::Contender;
use super::error::DiagnoseError;
use super::extension::Extension;
use super::judgement::Selected;
use super::selection::{Kept, select};
use super::settled::{as_told, is_told_of_others, settled, without_contacts};
use super::setup::Setup;
use super::study::Study;
use crate::identify::{Identification, Regression, resting_joints};

/// What explains a log.
pub(super) struct Explanation<'a> {
    /// The log along the motion of the arm as it was estimated last.
    pub study: Study<'a>,
    causes: Vec<Contender>,
    /// The causes with their alternatives.
    pub selected: Vec<Selected>,
    /// What each cause gains on periods that were left out of its fit ([`Kept::drop_idle`]).
    pub gains: Vec<Option<f64>>,
    /// The model without causes.
    pub null: Extension,
}

impl<'a> Explanation<'a> {
    /// Prepares the study of the log in `regression`, finds its causes, and drops those that gain nothing on other
    /// periods.
    pub fn of(
        families: &'a [Box<dyn Candidate>],
        setup: Setup,
        regression: &'a Regression,
        identification: &Identification,
        log: &Cleaned,
        source: &str,
    ) -> Result<Self, DiagnoseError> {
        let (mut study, found) =
            causes_of(families, setup, regression, identification, log, source)?;
        let null = Extension::fit(&study, &[], &study.torque);
        let mut kept = match study.scene.periodic {
            true => Kept::of(&study, found),
            false => Kept::of_a_single_run(&study, found),
        };
        let (mut selected, mut gains) = kept.likely();
        let mut causes = kept.causes;
        if study.scene.periodic && is_told_of_others(&study, &causes) {
            causes = as_told(&mut study, causes);
            study.look_everywhere();
            let mut kept = Kept::of(&study, causes);
            (selected, gains) = kept.likely();
            causes = kept.causes;
        }
        Ok(Self { study, causes, selected, gains, null })
    }

    /// The causes that are kept.
    pub fn kept(&self) -> Kept<'_, 'a> {
        Kept::of(&self.study, self.causes.clone())
    }
}

/// The study of a log, and the causes that settle with the estimate of its arm.
fn causes_of<'a>(
    families: &'a [Box<dyn Candidate>],
    setup: Setup,
    regression: &'a Regression,
    identification: &Identification,
    log: &Cleaned,
    source: &str,
) -> Result<(Study<'a>, Vec<Contender>), DiagnoseError> {
    let Setup { arm, set, .. } = setup;
    let estimate = (&identification.fit.theta[..], &identification.fit.joint_sigma_nm[..]);
    let mut first = Study::new(families, setup, regression, estimate, source)?;
    first.leave_out(log.unreadable.clone());
    first.resting = resting_joints(&regression.prepared.motion.qd_rad_s);
    let null = Extension::fit(&first, &[], &first.torque);
    let mut first = without_contacts(first, set, &null, source)?;
    first.look_everywhere();
    let found = select(&first);
    let (mut study, found) = if found.causes.is_empty() && first.scene.periodic {
        (first, found.causes)
    } else {
        settled(first, found, (arm, set), source)?
    };
    if !study.scene.periodic {
        // A single run is judged by the residual that the causes leave, which is known only at this point.
        let (_, rest) = Kept::taken_over(&study, found.clone()).without(None);
        study.judge_by(&rest);
    }
    Ok((study, found))
}
