//! The whole procedure from a log to a diagnosis.

use rayon::prelude::*;

use super::against::{self, Found, Nominal};
use super::candidates::{self, Candidate};
use super::cleaned::Cleaned;
use super::common_motion::{move_to_common_motion, noise_of_mean};
use super::contenders::Contender;
use super::detection_limits::detection_limits;
use super::error::DiagnoseError;
use super::extension::{Effect, Extension};
use super::finding::Finding;
use super::form_error::{OnJoint, error_of_form};
use super::held_out::{Models, Validation, held_out_gain};
use super::image::{Image, Span};
use super::intervals;
use super::judgement::Selected;
use super::kind::Kind;
use super::misfit::{self, Known, Left};
use super::modesty::{make_modest, make_modest_beside_unknown};
use super::payload::{self, PayloadFinding};
use super::record::{Record, is_torn};
use super::remarks::{contact_remark, drift_remark, limited_drives, rest_remark};
use super::replay::measured_nm;
use super::rms::rms_where;
use super::selection::{Kept, select};
use super::sentences::Besides;
use super::settled::{
    as_told, beside_model, fitted, is_told_of_others, residual, settled, without_contacts,
};
use super::study::{Entry, Study};
use super::verdict::{Cause, Diagnosis, HeldOut, Rival, Rms, Verdict};
use crate::base::BaseSet;
use crate::dynamics::Model;
use crate::identify::{
    Identification, Identifier, Measurement, Misreading, Options, Regression, drive_limit_remark,
    resting_joints,
};
use crate::robot::{Arm, JointSignals};

/// Diagnoses logs of one arm; holds everything that does not change from log to log.
pub struct Diagnoser<'a> {
    pub(super) arm: &'a Arm,
    pub(super) set: &'a BaseSet,
    pub(super) options: Options,
    /// Gains of the drives if currents were logged instead of torques, Nm/A.
    drive_gain_nm_a: Option<Vec<f64>>,
    pub(super) identifier: Identifier<'a>,
    pub(super) families: Vec<Box<dyn Candidate>>,
}

impl<'a> Diagnoser<'a> {
    /// A diagnoser for logs of `arm`, with all families.
    pub fn new(arm: &'a Arm, model: &'a Model, set: &'a BaseSet, options: Options) -> Self {
        Self::with_families(arm, model, set, options, candidates::all())
    }

    /// Like [`Self::new`], with these families only.
    pub fn with_families(
        arm: &'a Arm,
        model: &'a Model,
        set: &'a BaseSet,
        options: Options,
        families: Vec<Box<dyn Candidate>>,
    ) -> Self {
        let identifier = Identifier::new(model, set, options.clone());
        Self { arm, set, options, drive_gain_nm_a: None, identifier, families }
    }

    /// Declares that the torques of the logs are currents times these gains of the joints, Nm/A; `None`: torques were
    /// logged.
    pub fn of_currents(self, drive_gain_nm_a: Option<Vec<f64>>) -> Self {
        Self { drive_gain_nm_a, ..self }
    }

    /// Diagnoses the log `m`: says what the model gets wrong along it. The gain is measured on the `held_out` logs. A
    /// `simulation` of the arm, if given, is compared with the log.
    pub fn diagnose(
        &mut self,
        m: &Measurement,
        held_out: &[Validation],
        simulation: Option<Nominal>,
    ) -> Result<Finding, DiagnoseError> {
        let log = Cleaned::of(m, &self.options)?;
        let m = &log.measurement(m.source);
        let mut regression = log.regression(&mut self.identifier, m.source)?;
        let identification = self.identifier.identify_regression(&regression)?;
        self.refuse_misread(&regression, m.source)?;
        let measured_nm = measured_nm(&regression);
        move_to_common_motion(&mut regression, (self.arm, self.set), &identification.fit.theta);
        let noise_nm = noise_of_mean(&regression);
        let sources = (self.arm, self.set, &self.options);
        let (mut study, found) =
            causes_of(&self.families, sources, &regression, &identification, &log, m.source)?;
        let mut kept = match study.scene.periodic {
            true => Kept::of(&study, found),
            false => Kept::of_a_single_run(&study, found),
        };
        let null = Extension::fit(&study, &[], &study.torque);
        let mut gains = kept.drop_idle();
        if study.scene.periodic && is_told_of_others(&study, &kept.causes) {
            let left = kept.causes;
            let causes = as_told(&mut study, left);
            study.look_everywhere();
            kept = Kept::of(&study, causes);
            gains = kept.drop_idle();
        }
        let selected = kept.selected();
        let before_nm = residual(&study, &null);
        let mut model = self.extended(&study, &kept, &selected, &gains);
        let laws = OnJoint::of(&study, &selected, &model.extension.effects);
        let touches = match log.touched() {
            Some(touched) => touched.causes.clone(),
            // Every stall is given back the mean lost time of all stalls. The remaining error shifts torque and motion
            // against each other for a moment and stands out of the noise as far as a touch does, so no confidence in a
            // touch would be justified.
            None if log.is_mended => Vec::new(),
            None => beside_model(&study, &model.after_nm)?.causes,
        };
        if let Some(simulation) = simulation {
            self.compare(&study, &selected, simulation, &mut model);
        }
        let faults = [log.faults.clone(), touches].concat();
        model.causes = in_order(faults, model.causes, study.scene.periodic);
        let Extended { mut causes, extension, after_nm, accepted, rest } = model;
        let base = intervals::base(&study, self.set, &extension);
        let moved_parameters = simulation.map_or(Vec::new(), |s| against::moved(s, &base));
        let moved_together = simulation.and_then(|s| against::moved_together(&study, s, &base));
        let tears = take_out_tears(&mut causes, m);
        make_modest(&mut causes, simulation.is_some());
        let lack = misfit::lack_of_fit(&study, &accepted, &rest);
        let rms = |e: &JointSignals| -> Vec<f64> {
            let of = |j: usize| rms_where(e.joint(j), |k| study.whitening.counts(j, k));
            (0..e.joints()).map(of).collect()
        };
        let [before_rms_nm, after_rms_nm] = [&before_nm, &after_nm].map(rms);
        let form = error_of_form(&laws, &causes, study.scene.joints());
        let left = left(&study, (&accepted, &rest), lack.as_ref(), (&causes, &form), &log);
        let Left { unexplained, form_error } = left.at_most(&after_rms_nm);
        if let Some(unknown) = &unexplained {
            make_modest_beside_unknown(&mut causes, unknown.site(), study.scene.periodic);
        }
        let models = Models { null: &null, extension: &extension };
        let gain = |log| {
            let parts = (&mut self.identifier, &*self.families);
            let currents = self.drive_gain_nm_a.as_deref();
            gain_along(parts, sources, currents, log, &models, &causes)
        };
        let held_out = held_out.iter().map(gain).collect::<Result<Vec<_>, _>>()?;
        let mut warnings: Vec<String> =
            log.warnings.iter().chain(&identification.warnings).cloned().collect();
        warnings.extend(contact_remark(&study, &log));
        warnings.extend(rest_remark(&regression.prepared.motion.qd_rad_s));
        let drift = drift_remark(&study, &causes);
        let limited = limited_drives(self.arm, m.torque_nm, &causes, unexplained.as_ref());
        warnings.extend(drive_limit_remark(self.arm, m.torque_nm));
        for held_out in &held_out {
            let with_name = |warning: &String| format!("{}: {warning}", held_out.log);
            warnings.extend(held_out.warnings.iter().map(with_name));
        }
        if tears > 0 {
            let warning = "the angles jump as no arm can; what looks like a touch there is none";
            warnings.push(warning.into());
        }
        let mut diagnosis = Diagnosis {
            log: m.source.to_owned(),
            noise_floor_nm: identification.replicates.as_ref().map(|r| r.sigma.clone()),
            noise_of_mean_nm: noise_nm.as_ref().map(rms),
            before: Rms { rms_nm: before_rms_nm },
            verdict: match (&unexplained, causes.is_empty()) {
                (Some(_), _) => Verdict::Unexplained,
                (None, true) => Verdict::NothingFound,
                (None, false) => Verdict::CauseNamed,
            },
            causes,
            unexplained,
            form_error,
            after: Rms { rms_nm: after_rms_nm },
            base_parameters: base.parameters,
            held_out,
            moved_parameters,
            moved_together,
            payload: None,
            replay: None,
            detection_limits: detection_limits(&study, &accepted),
            lack_of_fit_probability: lack.map(|lack| lack.probability),
            doubt: None,
            sentences: Vec::new(),
            warnings,
        };
        self.question_the_arm(&mut diagnosis, &extension, &identification);
        let laws: Vec<Option<usize>> =
            extension.effects.iter().map(|effect| effect.site.map(|j| j + 1)).collect();
        let doubt = simulation.and_then(|simulation| simulation.doubt);
        diagnosis.sentences = diagnosis.in_sentences(&laws, Besides { doubt, limited, drift });
        let samples = (0..regression.problem.samples).map(|row| regression.sample(row)).collect();
        let scene = study.scene;
        Ok(Finding {
            diagnosis,
            identification,
            scene,
            extension,
            before_nm,
            after_nm,
            measured_nm,
            samples,
        })
    }

    /// Refuses the log `source` if it fits the arm once it is read differently.
    fn refuse_misread(&self, regression: &Regression, source: &str) -> Result<(), DiagnoseError> {
        let gain = self.drive_gain_nm_a.as_deref();
        match Misreading::of(self.arm, regression, &self.options, gain) {
            Some(misreading) => Err(DiagnoseError::Misread {
                log: source.to_owned(),
                misreading: Box::new(misreading),
            }),
            None => Ok(()),
        }
    }

    /// Fits the model of `study` with the causes `selected` from those `kept`; `gains` are their gains on other
    /// periods.
    fn extended(
        &self,
        study: &Study,
        kept: &Kept,
        selected: &[Selected],
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
        Extended { causes, after_nm: residual(study, &extension), extension, accepted, rest }
    }

    /// Compares the log with a `simulation`. A kind of cause that can be a change against the simulation is judged by
    /// this comparison alone, in which effects that any fit would absorb stand out too. Effects that the changes make
    /// needless are dropped.
    fn compare(
        &self,
        study: &Study,
        selected: &[Selected],
        simulation: Nominal,
        model: &mut Extended,
    ) {
        let found = selected.iter().zip(&model.extension.effects).map(|(selected, effect)| Found {
            entry: &selected.contender.entry,
            effect,
            alike: selected.alike(),
        });
        let found: Vec<Found> = found.collect();
        let fitted_nm = fitted(study, &model.extension);
        let sources = (self.arm, self.set);
        let explained = against::explain(study, sources, simulation, &found, &fitted_nm);
        model.causes.retain(|c| !explained.judged.contains(&(c.kind, c.joint)));
        model.causes.extend(explained.causes);
        if simulation.doubt.is_some() {
            // The laws become provisional as well, because they were found beside the changes.
            let judged = model.causes.iter_mut().filter(|cause| cause.kind.is_a_law());
            judged.for_each(Cause::make_provisional);
        }
        model.rest = study.residual.clone();
        explained.span.residualise(&mut model.rest);
        model.accepted = explained.span;
        // An effect that is not found again beside the simulation leaves the model.
        let is_named = |entry: &&Entry| {
            let place = (self.families[entry.family].kind(), entry.site.map(|j| j + 1));
            model.causes.iter().any(|cause| (cause.kind, cause.joint) == place)
        };
        let entries = selected.iter().map(|s| &s.contender.entry);
        let named: Vec<&Entry> = entries.filter(is_named).collect();
        if named.len() < selected.len() {
            model.extension = Extension::fit(study, &named, &study.torque);
            model.after_nm = residual(study, &model.extension);
        }
    }

    /// Says whether `loaded` was recorded with a body on the flange that was not there in `reference`, whose diagnosis
    /// is `finding`. A known mass also determines the gains of the drives.
    pub fn payload(
        &mut self,
        finding: &Finding,
        reference: &Measurement,
        loaded: &Measurement,
        known_mass_kg: Option<f64>,
    ) -> Result<PayloadFinding, DiagnoseError> {
        let mut cleaned = |m: &Measurement| -> Result<(Regression, bool), DiagnoseError> {
            let log = Cleaned::of(m, &self.options)?;
            let cleaned = log.measurement(m.source);
            let is_touch = |cause: &Cause| !is_a_tear(cause, &cleaned);
            let touched = log.touched().is_some_and(|t| t.causes.iter().any(is_touch));
            Ok((log.regression(&mut self.identifier, m.source)?, touched))
        };
        let [(reference_rows, _), (loaded_rows, touched)] = [cleaned(reference)?, cleaned(loaded)?];
        self.refuse_misread(&loaded_rows, loaded.source)?;
        let shared = payload::Shared {
            arm: self.arm,
            set: self.set,
            options: &self.options,
            families: &self.families,
            extension: &finding.extension,
        };
        let names = [reference.source, loaded.source];
        let found = payload::between(&shared, &reference_rows, &loaded_rows, names, known_mass_kg)?;
        Ok(PayloadFinding { was_touched: touched, ..found })
    }

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
        let nothing = family.without_effect(&study.scene);
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
            in_words: family.in_words().to_owned(),
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

/// The extended model, and the causes to report.
struct Extended {
    causes: Vec<Cause>,
    extension: Extension,
    /// Residual of the extended model, Nm.
    after_nm: JointSignals,
    /// Span of the causes outside the null model, and the residual of the null model without its part in this span.
    accepted: Span,
    rest: Image,
}

/// Orders the causes. For a repeating motion: faults of the record before physics, physics by strength. For a single
/// run the cause with the largest gain comes first, and faults that concern only the recording come last.
fn in_order(mut faults: Vec<Cause>, mut physics: Vec<Cause>, periodic: bool) -> Vec<Cause> {
    physics.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    if !periodic {
        let gain = |cause: &Cause| cause.gain_fraction.unwrap_or(0.0);
        physics.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        physics.extend(faults.extract_if(.., |fault| fault.kind.is_of_the_record()));
    }
    faults.into_iter().chain(physics).collect()
}

/// Prepares the study of the log in `regression` and finds its causes.
fn causes_of<'a>(
    families: &'a [Box<dyn Candidate>],
    sources: (&Arm, &BaseSet, &Options),
    regression: &'a Regression,
    identification: &Identification,
    log: &Cleaned,
    source: &str,
) -> Result<(Study<'a>, Vec<Contender>), DiagnoseError> {
    let (arm, set, _) = sources;
    let estimate = (&identification.fit.theta[..], &identification.fit.joint_sigma_nm[..]);
    let mut first = Study::new(families, sources, regression, estimate, source)?;
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

/// Gain of the extended model over the null model along another `log`.
fn gain_along(
    (identifier, families): (&mut Identifier, &[Box<dyn Candidate>]),
    sources: (&Arm, &BaseSet, &Options),
    drive_gain_nm_a: Option<&[f64]>,
    log: &Validation,
    models: &Models,
    causes: &[Cause],
) -> Result<HeldOut, DiagnoseError> {
    // The recorder has the same lags on other days.
    let mut record = Record::without_rows(&log.measurement, &[]);
    record.undo_lags(causes);
    let measurement = record.measurement(log.measurement.source);
    let log = &Validation { measurement, manufacturer_nm: log.manufacturer_nm };
    held_out_gain(identifier, sources, drive_gain_nm_a, families, log, models)
}

/// Removes contacts at which the angles jump as no arm can, and returns their number.
fn take_out_tears(causes: &mut Vec<Cause>, m: &Measurement) -> usize {
    causes.extract_if(.., |cause| is_a_tear(cause, m)).count()
}

fn is_a_tear(cause: &Cause, m: &Measurement) -> bool {
    let at = |name| cause.parameters.get(name).map_or(f64::NAN, |e| e.value);
    cause.kind == Kind::Contact && is_torn(m, [at("start_s"), at("end_s")])
}

/// What the residual `rest` shows that the `accepted` causes leave; their laws may leave λ of `form` on each joint because
/// they are not exact.
fn left(
    study: &Study,
    (accepted, rest): (&Span, &Image),
    lack: Option<&misfit::LackOfFit>,
    (causes, form): (&[Cause], &[f64]),
    log: &Cleaned,
) -> Left {
    // A residual that drifts beside a thermal drift is another form of the same law.
    let drifts =
        |j: usize| causes.iter().any(|c| c.kind == Kind::ThermalDrift && c.joint == Some(j + 1));
    let can_differ = |j: usize| !log.is_mended && !drifts(j);
    let has_law = |j: usize| {
        let is_there = |cause: &Cause| cause.joint.is_none_or(|own| own == j + 1);
        causes.iter().any(|cause| cause.kind.is_a_law() && is_there(cause))
    };
    misfit::left(study, accepted, rest, lack, &Known { has_law, can_differ, form })
}
