//! From a log to a diagnosis: the procedure as a whole.

use super::against::{self, Found, Nominal};
use super::candidates::{self, Candidate};
use super::cleaned::Cleaned;
use super::common_motion::{move_to_common_motion, noise_of_mean};
use super::contact::Compared;
use super::detection_limits::detection_limits;
use super::error::DiagnoseError;
use super::extension::{Effect, Extension};
use super::held_out::{Models, Validation, held_out_gain};
use super::image::{Image, Span};
use super::intervals;
use super::judgement::Selected;
use super::kind::Kind;
use super::misfit;
use super::modesty::{make_modest, make_modest_beside_unknown};
use super::payload::{self, PayloadFinding};
use super::record::{Record, is_torn};
use super::replay::measured_nm;
use super::rms::rms_where;
use super::scene::Scene;
use super::selection::{Contender, Kept, select};
use super::settled::{beside_model, residual, settled, without_contacts};
use super::study::{Entry, Study};
use super::verdict::{Cause, Diagnosis, HeldOut, Rival, Rms, Unexplained, Verdict};
use crate::base::BaseSet;
use crate::dynamics::Model;
use crate::identify::{
    Doubt, Identification, Identifier, Measurement, Misreading, Options, Regression,
    drive_limit_remark, unlike_remark,
};
use crate::robot::{Arm, JointSignals};

/// Everything that stays the same from log to log.
pub struct Diagnoser<'a> {
    pub(super) arm: &'a Arm,
    pub(super) set: &'a BaseSet,
    pub(super) options: Options,
    /// Gains of drives whose currents were logged, Nm/A.
    drive_gain_nm_a: Option<Vec<f64>>,
    pub(super) identifier: Identifier<'a>,
    pub(super) families: Vec<Box<dyn Candidate>>,
}

/// A diagnosis with what it was made from, for pictures.
pub struct Finding {
    /// What is said.
    pub diagnosis: Diagnosis,
    /// The null model's identification.
    pub identification: Identification,
    /// Motion and predictions along the log.
    pub scene: Scene,
    /// The extended model.
    pub extension: Extension,
    /// Residual of the null model, one period or the run, Nm.
    pub before_nm: JointSignals,
    /// Residual of the extended model, Nm.
    pub after_nm: JointSignals,
    /// Logged torque: the mean period, or the run behind its low-pass, Nm.
    pub measured_nm: JointSignals,
    /// Sample of the scene behind each residual.
    pub samples: Vec<usize>,
}

impl<'a> Diagnoser<'a> {
    /// For logs of `arm`, with all families.
    pub fn new(arm: &'a Arm, model: &'a Model, set: &'a BaseSet, options: Options) -> Self {
        Self::with_families(arm, model, set, options, candidates::all())
    }

    /// With these families only.
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

    /// For logs whose torques are currents times these gains of the joints, Nm/A; `None`: torques were logged.
    pub fn of_currents(self, drive_gain_nm_a: Option<Vec<f64>>) -> Self {
        Self { drive_gain_nm_a, ..self }
    }

    /// Says what the model gets wrong along `m`; `held_out` logs measure the gain;
    /// a `simulation` of the arm is compared with what the log says.
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
        let (study, found) =
            causes_of(&self.families, sources, &regression, &identification, &log, m.source)?;
        let mut kept = match study.scene.periodic {
            true => Kept::settled(&study, found),
            false => Kept::of_a_single_run(&study, found),
        };
        let null = Extension::fit(&study, &[], &study.torque);
        let gains = kept.drop_idle();
        let selected = kept.selected();
        let before_nm = residual(&study, &null);
        let mut model = self.extended(&study, &kept, &selected, &gains);
        let touches = match log.touched() {
            Some(touched) => touched.causes.clone(),
            // Each stall is given back the mean of all. What that is off by sets torque and motion apart for a moment, as far out of the noise
            // as a touch does: no confidence would be right for what can be either.
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
        make_modest(&mut causes);
        let lack = misfit::lack_of_fit(&study, &accepted, &rest);
        let unexplained = unexplained(&study, (&accepted, &rest), lack, &causes, &log);
        if let Some(unknown) = &unexplained {
            make_modest_beside_unknown(&mut causes, unknown.joint, study.scene.periodic);
        }
        let models = Models { null: &null, extension: &extension };
        let gain = |log| {
            let parts = (&mut self.identifier, &*self.families);
            let currents = self.drive_gain_nm_a.as_deref();
            gain_along(parts, sources, currents, log, &models, &causes)
        };
        let held_out = held_out.iter().map(gain).collect::<Result<Vec<_>, _>>()?;
        let mut warnings: Vec<String> =
            log.warning.iter().chain(&identification.warnings).cloned().collect();
        warnings.extend(contact_remark(&study, &log));
        let drift = drift_remark(&study, &causes);
        warnings.extend(drive_limit_remark(self.arm, m.torque_nm));
        for held_out in &held_out {
            let with_name = |warning: &String| format!("{}: {warning}", held_out.log);
            warnings.extend(held_out.warnings.iter().map(with_name));
        }
        if tears > 0 {
            let warning = "the angles jump as no arm can; what looks like a touch there is none";
            warnings.push(warning.into());
        }
        let rms = |e: &JointSignals| -> Vec<f64> {
            let of = |j: usize| rms_where(e.joint(j), |k| study.whitening.counts(j, k));
            (0..e.joints()).map(of).collect()
        };
        let mut diagnosis = Diagnosis {
            log: m.source.to_owned(),
            noise_floor_nm: identification.replicates.as_ref().map(|r| r.sigma.clone()),
            noise_of_mean_nm: noise_nm.as_ref().map(rms),
            before: Rms { rms_nm: rms(&before_nm) },
            verdict: match (&unexplained, causes.is_empty()) {
                (Some(_), _) => Verdict::Unexplained,
                (None, true) => Verdict::NothingFound,
                (None, false) => Verdict::CauseNamed,
            },
            causes,
            unexplained,
            after: Rms { rms_nm: rms(&after_nm) },
            base_parameters: base.parameters,
            held_out,
            moved_parameters,
            moved_together,
            payload: None,
            replay: None,
            detection_limits: detection_limits(&study, &accepted),
            lack_of_fit_probability: lack.map(|lack| lack.probability),
            sentences: Vec::new(),
            warnings,
        };
        let laws: Vec<Option<usize>> =
            extension.effects.iter().map(|effect| effect.site.map(|j| j + 1)).collect();
        diagnosis.sentences = diagnosis.in_sentences(&laws);
        // Before all else where nothing else is said: it repeats in no period, and counts as noise in what follows.
        let place = if diagnosis.causes.is_empty() { 0 } else { diagnosis.sentences.len() };
        drift.into_iter().for_each(|drift| diagnosis.sentences.insert(place, drift));
        if let Some(doubt) = simulation.and_then(|simulation| simulation.doubt) {
            // Whatever is said next rests on it.
            diagnosis.sentences.insert(0, doubt.to_owned());
        }
        self.question_the_arm(&mut diagnosis, &extension, &identification);
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

    /// Refuses the log `source` where it fits the arm when it is read otherwise.
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

    /// Says first that the log may be that of another robot, or that no arm has these parameters.
    fn question_the_arm(
        &self,
        diagnosis: &mut Diagnosis,
        extension: &Extension,
        identification: &Identification,
    ) {
        let nominal = self.set.values(&Model::new(self.arm).standard_parameters());
        let sigma = sigma_of_friction_alone(diagnosis, self.set);
        // What touched the arm, and friction that the null model lacks, bend the null model's gravity.
        let (theta, covariance) = (&extension.theta, &identification.covariance);
        let left = share_left(diagnosis, identification);
        let torque_nm = identification.residual().torque_nm();
        let doubt = Doubt::of(self.arm, self.set, &nominal, theta, &sigma, covariance, &torque_nm);
        if let Some(doubt) = Doubt::or_unlike(doubt, unlike_remark(self.arm, &left)) {
            diagnosis.sentences.insert(0, doubt.sentence);
            if doubt.is_contradiction {
                diagnosis.verdict = Verdict::Contradicted;
            }
        }
    }

    /// The model of `study` with the causes `selected` of those `kept`, whose `gains` on other periods are these.
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
        let causes = selected.iter().enumerate().map(cause).collect();
        let (accepted, rest) = kept.without(None);
        Extended { causes, after_nm: residual(study, &extension), extension, accepted, rest }
    }

    /// Judges what differs from a `simulation` in place of what any fit would absorb.
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
        let explained = against::explain(study, self.set, simulation, &found);
        model.causes.retain(|c| !explained.judged.contains(&(c.kind, c.joint)));
        model.causes.extend(explained.causes);
        if simulation.doubt.is_some() {
            // The laws as well: they are what is needed beside the changes.
            let judged = model.causes.iter_mut().filter(|cause| cause.kind.is_a_law());
            judged.for_each(Cause::make_provisional);
        }
        model.rest = study.residual.clone();
        explained.span.residualise(&mut model.rest);
        model.accepted = explained.span;
        // What is not found again beside the simulation is not a part of the model either.
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

    /// Says whether `loaded` was recorded with a body on the flange that `reference`, diagnosed as
    /// `finding`, did not have; a known mass also tells the drives' gains.
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
        let parameters = intervals::physical(study, kept, effect, index);
        let Effect { site, shape, coefficients, .. } = effect;
        // Of several coefficients one may be none beside the others.
        let size = (coefficients.len() == 1)
            .then(|| family.size(&family.quantities(&study.scene, *site, *shape, coefficients)))
            .flatten()
            .and_then(|size| parameters.get(size.name));
        let nothing = family.without_effect(&study.scene);
        let may_be_none = size.is_some_and(|size| size.holds(nothing));
        Cause {
            kind: family.kind(),
            joint: entry.site.map(|j| j + 1),
            confidence: selected.confidence,
            parameters,
            peak_joint: None,
            gain_fraction,
            separating_experiment: (!class.is_empty()).then(|| family.separating_experiment()),
            class,
            strength: selected.contender.score.lambda.sqrt(),
            in_words: family.in_words().to_owned(),
            form: family.form(&study.scene, *shape),
            may_be_none,
            rivals: rivals.collect(),
        }
    }
}

/// The model with causes, and what is said of these.
struct Extended {
    causes: Vec<Cause>,
    extension: Extension,
    /// Its residual, Nm.
    after_nm: JointSignals,
    /// What the causes span outside the null model, and what they leave of its residual.
    accepted: Span,
    rest: Image,
}

/// Share of each joint's torque (rms) that is left beside the causes, without noise as far as the log tells it.
fn share_left(diagnosis: &Diagnosis, identification: &Identification) -> Vec<f64> {
    let torque_nm = identification.residual().torque_nm();
    let share = |j: usize| {
        let noise_nm = diagnosis.noise_of_mean_nm.as_ref().map_or(0.0, |nm| nm[j]);
        (diagnosis.after.rms_nm[j].powi(2) - noise_nm.powi(2)).max(0.0).sqrt() / torque_nm[j]
    };
    (0..torque_nm.len()).map(share).collect()
}

/// σ of the base parameters beside the causes; ∞ of the Coulomb friction of joints that have another law of friction beside it, so that
/// it may be negative where all friction is not.
fn sigma_of_friction_alone(diagnosis: &Diagnosis, set: &BaseSet) -> Vec<f64> {
    let has_law = |name: &str| {
        let laws = diagnosis.causes.iter().filter(|cause| cause.kind.is_friction());
        let mut joints = laws.map(|cause| cause.joint);
        joints.any(|joint| joint.is_none_or(|joint| name == format!("rc{joint}")))
    };
    let known = diagnosis.base_parameters.iter().enumerate();
    known.map(|(k, p)| if has_law(set.name(k)) { f64::INFINITY } else { p.sigma }).collect()
}

/// Faults of the record before physics, the strongest first, of a motion that repeats. Of a single run what matters most is said first,
/// what only concerns the recording last.
fn in_order(mut faults: Vec<Cause>, mut physics: Vec<Cause>, periodic: bool) -> Vec<Cause> {
    physics.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    if !periodic {
        let gain = |cause: &Cause| cause.gain_fraction.unwrap_or(0.0);
        physics.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        physics.extend(faults.extract_if(.., |fault| fault.kind.is_of_the_record()));
    }
    faults.into_iter().chain(physics).collect()
}

/// The study of a log laid out in `regression`, and the causes that were found.
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
    let null = Extension::fit(&first, &[], &first.torque);
    let first = without_contacts(first, set, &null, source)?;
    let found = select(&first);
    let (mut study, found) = if found.causes.is_empty() && first.scene.periodic {
        (first, found.causes)
    } else {
        settled(first, found, (arm, set), source)?
    };
    if !study.scene.periodic {
        // A single run is judged by its own residual, which is known only now.
        let (_, rest) = Kept::taken_over(&study, found.clone()).without(None);
        study.judge_by(&rest);
    }
    Ok((study, found))
}

/// What one of `models` gains over the other along another `log`.
fn gain_along(
    (identifier, families): (&mut Identifier, &[Box<dyn Candidate>]),
    sources: (&Arm, &BaseSet, &Options),
    drive_gain_nm_a: Option<&[f64]>,
    log: &Validation,
    models: &Models,
    causes: &[Cause],
) -> Result<HeldOut, DiagnoseError> {
    // The recorder lags on other days as it does here.
    let mut record = Record::without_rows(&log.measurement, &[]);
    record.undo_lags(causes);
    let measurement = record.measurement(log.measurement.source);
    let log = &Validation { measurement, manufacturer_nm: log.manufacturer_nm };
    held_out_gain(identifier, sources, drive_gain_nm_a, families, log, models)
}

/// Takes out contacts at which the angles jump as no arm can; how many.
fn take_out_tears(causes: &mut Vec<Cause>, m: &Measurement) -> usize {
    causes.extract_if(.., |cause| is_a_tear(cause, m)).count()
}

fn is_a_tear(cause: &Cause, m: &Measurement) -> bool {
    let at = |name| cause.parameters.get(name).map_or(f64::NAN, |e| e.value);
    cause.kind == Kind::Contact && is_torn(m, [at("start_s"), at("end_s")])
}

/// What no cause explains of what the `accepted` ones leave, `rest`.
fn unexplained(
    study: &Study,
    (accepted, rest): (&Span, &Image),
    lack: Option<misfit::LackOfFit>,
    causes: &[Cause],
    log: &Cleaned,
) -> Option<Unexplained> {
    // What is left of a law of drift is another form of it.
    let drifts =
        |j: usize| causes.iter().any(|c| c.kind == Kind::ThermalDrift && c.joint == Some(j + 1));
    let can_differ = |j: usize| !log.is_mended && !drifts(j);
    let has_law = |j: usize| {
        let is_there = |cause: &Cause| cause.joint.is_none_or(|own| own == j + 1);
        causes.iter().any(|cause| cause.kind.is_a_law() && is_there(cause))
    };
    misfit::unexplained(study, accepted, rest, lack, has_law, can_differ)
}

/// Why contacts were not looked for.
fn contact_remark(study: &Study, log: &Cleaned) -> Option<String> {
    if log.is_mended {
        let remark = "the clock was mended: contacts are not looked for, because what is left of its error looks like one, and causes named \
                      beside it are less sure";
        return Some(remark.to_owned());
    }
    (study.scene.periodic && matches!(log.compared, Compared::TooFew)).then(|| {
        "contacts are not looked for: too few periods follow each other without a gap to be compared; repeat the motion three \
         times or more"
            .to_owned()
    })
}

/// What a user should know of mean torques that drift, but for those of joints whose friction is said to.
fn drift_remark(study: &Study, causes: &[Cause]) -> Option<String> {
    let is_said = |joint: usize| {
        causes.iter().any(|c| c.kind == Kind::ThermalDrift && c.joint == Some(joint))
    };
    let drifting = study.whitening.drifting().iter().map(|&(j, sd_nm)| (j + 1, sd_nm));
    let own: Vec<String> = drifting
        .filter(|(joint, _)| !is_said(*joint))
        .map(|(joint, sd_nm)| format!("joint {joint} by {sd_nm:.3} Nm rms"))
        .collect();
    (!own.is_empty()).then(|| {
        format!(
            "The mean torque drifts: from period to period it changes by more than the noise beside it ({}). A current sensor whose zero \
             drifts does that, or a load that changes; what is constant there, offsets and gravity, is less well known, as its intervals say.",
            own.join(", ")
        )
    })
}
