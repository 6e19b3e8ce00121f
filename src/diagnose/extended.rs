//! The model extended by the causes that were kept, and the causes as they are reported.

use rayon::prelude::*;

use super::against::{self, AcceptedEffect, Nominal};
use super::diagnoser::Diagnoser;
use super::extension::{Effect, Extension, width_of_arm};
use super::image::{Image, Span};
use super::intervals;
use super::judgement::Selected;
use super::kind::Kind;
use super::selection::Kept;
use super::settled::{fitted, residual};
use super::study::{Entry, Study};
use super::verdict::{Cause, Rival};
use crate::robot::JointSignals;

/// The extended model, and the causes to report.
pub(super) struct Extended {
    /// The causes that were kept, with their alternatives, in the order of the effects of `extension`.
    pub selected: Vec<Selected>,
    pub extension: Extension,
    pub causes: Vec<Cause>,
    /// Residual of the extended model, Nm.
    pub after_nm: JointSignals,
    /// Span of the causes outside the null model, and the residual of the null model without its part in this span.
    pub accepted: Span,
    pub rest: Image,
}

impl Diagnoser<'_> {
    /// Fits the model of `study` with the causes `selected` from those `kept`; `gains` are their gains on other
    /// periods.
    pub(super) fn extended(
        &self,
        study: &Study,
        kept: &Kept,
        selected: Vec<Selected>,
        gains: &[Option<f64>],
    ) -> Extended {
        let entries: Vec<&Entry> = selected.iter().map(|s| &s.contender.entry).collect();
        let extension = Extension::fit(study, &entries, &study.torque);
        let cause = |(c, selected): (usize, &Selected)| {
            let gain = gains[c].or(selected.left_out_gain);
            self.cause(study, kept, selected, c, gain, &extension)
        };
        let causes = selected.par_iter().enumerate().map(cause).collect();
        let (accepted, rest) = kept.without(None);
        let after_nm = residual(study, &extension);
        Extended { selected, extension, causes, after_nm, accepted, rest }
    }

    /// Compares the log with a `simulation`. A kind of cause that can be a change against the simulation is judged by
    /// this comparison alone, in which effects that any fit would absorb stand out too. Effects that the changes make
    /// needless are dropped, and the others judged anew without them.
    pub(super) fn compare(&self, study: &Study, simulation: Nominal, model: &mut Extended) {
        let found =
            model.selected.iter().zip(&model.extension.effects).map(|(selected, effect)| {
                AcceptedEffect { entry: &selected.contender.entry, effect, alike: selected.alike() }
            });
        let found: Vec<AcceptedEffect> = found.collect();
        let fitted_nm = fitted(study, &model.extension);
        let sources = (self.arm, self.set);
        let explained = against::explain(study, sources, simulation, &found, &fitted_nm);
        let judged = |place: (Kind, Option<usize>)| explained.judged.contains(&place);
        // An effect that is not found again beside the simulation leaves the model.
        let stays = |selected: &&Selected| {
            let entry = &selected.contender.entry;
            let place = (self.families[entry.family].kind(), entry.site.map(|j| j + 1));
            let is_a_change = |cause: &Cause| (cause.kind, cause.joint) == place;
            !judged(place) || explained.causes.iter().any(is_a_change)
        };
        if !model.selected.iter().all(|selected| stays(&selected)) {
            let left = model.selected.iter().filter(stays).map(|s| s.contender.clone());
            let kept = Kept::of(study, left.collect());
            *model = self.extended(study, &kept, kept.selected(), &kept.gains());
        }
        model.causes.retain(|c| !judged((c.kind, c.joint)));
        model.causes.extend(explained.causes);
        if simulation.doubt.is_some() {
            // The laws become provisional as well, because they were found beside the changes.
            let judged = model.causes.iter_mut().filter(|cause| cause.kind.is_a_law());
            judged.for_each(Cause::make_provisional);
        }
        model.rest = study.residual.clone();
        explained.span.residualise(&mut model.rest);
        model.accepted = explained.span;
    }

    /// Cause number `index` of those `kept`, as it is reported.
    fn cause(
        &self,
        study: &Study,
        kept: &Kept,
        selected: &Selected,
        index: usize,
        gain_fraction: Option<f64>,
        extension: &Extension,
    ) -> Cause {
        let entry = &selected.contender.entry;
        let family = &self.families[entry.family];
        let name = |&(f, site): &(usize, Option<usize>)| {
            let kind = self.families[f].kind();
            match site.filter(|_| site != entry.site) {
                Some(j) => format!("{kind}@{}", j + 1),
                None => kind.to_string(),
            }
        };
        let class: Vec<String> = selected.class.iter().map(name).collect();
        let rivals = selected.rivals.iter().map(|rival| Rival {
            kind: self.families[rival.entry.family].kind(),
            joint: rival.entry.site.map(|j| j + 1),
            evidence_behind: selected.contender.evidence - rival.evidence,
        });
        let effect = &extension.effects[index];
        let parameters = intervals::physical(study, kept, &extension.effects, index);
        let Effect { site, shape, coefficients, .. } = effect;
        // Only for laws with one coefficient: one of several coefficients may be zero although the others are not.
        let size = (coefficients.len() == 1)
            .then(|| family.size(&family.quantities(&study.scene, *site, *shape, coefficients)))
            .flatten()
            .and_then(|size| parameters.get(size.name));
        let of_arm = width_of_arm(&extension.effects, effect, study.families).unwrap_or(0.0);
        let nothing = family.without_effect(&study.scene) + of_arm;
        let may_be_none = size.is_some_and(|size| size.holds(nothing));
        let mut cause = Cause {
            kind: family.kind(),
            joint: entry.site.map(|j| j + 1),
            confidence: selected.confidence,
            parameters,
            peak_joint: None,
            gain_fraction,
            separating_experiment: (!class.is_empty()).then(|| family.separating_experiment()),
            class,
            strength: selected.contender.score.lambda.max(0.0).sqrt(),
            in_words: family.in_words_of(*shape, coefficients).to_owned(),
            record_fault: None,
            form: family.form(&study.scene, *shape),
            may_be_none,
            rivals: rivals.collect(),
        };
        if family.is_commonplace(&study.scene, *site, *shape) {
            cause.make_provisional();
        }
        cause
    }
}
