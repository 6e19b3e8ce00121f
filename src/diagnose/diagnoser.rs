//! The whole procedure from a log to a diagnosis.

use super::against::{self, Nominal};
use super::candidates::{self, Candidate};
use super::cleaned::Cleaned;
use super::common_motion::{move_to_common_motion, noise_of_mean};
use super::detection_limits::detection_limits;
use super::error::DiagnoseError;
use super::explanation::Explanation;
use super::extended::Extended;
use super::finding::Finding;
use super::form_error::{OnJoint, error_of_form};
use super::held::add_held;
use super::held_out::{Models, Validation, held_out_gain};
use super::image::{Image, Span};
use super::intervals;
use super::kind::Kind;
use super::misfit::{self, KnownOfJoints, Left};
use super::modesty::{make_modest, make_modest_along_moves, make_modest_beside_unknown};
use super::payload::{self, PayloadFinding};
use super::record::{Record, is_torn};
use super::remarks::{
    coarse_remark, contact_remark, drift_remark, held_remark, limited_drives, rest_remark,
    slow_remark, tear_remark,
};
use super::replay::measured_nm;
use super::rests::rests;
use super::rms::rms_where;
use super::sentences::Besides;
use super::settled::{beside_model, residual};
use super::setup::Setup;
use super::study::Study;
use super::verdict::{Cause, Diagnosis, HeldOut, Rms, Verdict};
use crate::base::BaseSet;
use crate::dynamics::Model;
use crate::identify::{
    HeldAtRest, Identifier, Measurement, Misreading, Options, Regression, drive_limit_remark,
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
        // The log, without the faults of its record, and the model without causes.
        let log = Cleaned::of(m, &self.options)?;
        let m = &log.measurement(m.source);
        let mut regression = log.regression(&mut self.identifier, m.source)?;
        let mut identification = self.identifier.identify_regression(&regression)?;
        self.refuse_misread(&regression, m.source)?;
        let held = self.sticking(&regression, &identification, (&log, m.source))?;
        let is_more = held.len() > identification.held_at_rest.len();
        regression.prepared.held_at_rest = held;
        if is_more {
            identification = self.identifier.identify_regression(&regression)?;
        }
        let measured_nm = measured_nm(&regression);
        let coarse =
            move_to_common_motion(&mut regression, (self.arm, self.set), &identification.fit.theta);

        // What explains it.
        let setup = Setup { arm: self.arm, set: self.set, options: &self.options };
        let explanation =
            Explanation::of(&self.families, setup, &regression, &identification, &log, m.source)?;
        let Explanation { study, null, selected, gains, .. } = &explanation;
        let mut model = self.extended(study, &explanation.kept(), selected.clone(), gains);
        let laws = OnJoint::of(study, &model.selected, &model.extension.effects);
        let touches = touches(&log, study, &model.after_nm)?;
        if let Some(simulation) = simulation {
            self.compare(study, simulation, &mut model);
        }
        let Extended { mut causes, extension, mut after_nm, accepted, rest, .. } = model;
        let faults = [log.faults.clone(), touches].concat();
        let rms = |e: &JointSignals| -> Vec<f64> {
            let of = |j: usize| rms_where(e.joint(j), |k| study.whitening.counts(j, k));
            (0..e.joints()).map(of).collect()
        };
        let before_nm = residual(study, null);
        let noise_of_mean_nm = noise_of_mean(&regression).as_ref().map(rms);
        let noise_nm = noise_of_mean_nm.as_deref();
        let with_model = (&extension, &mut after_nm);
        add_held((study, self.set), with_model, (&before_nm, noise_nm), &mut causes);
        let mut causes = in_order(faults, causes, study.scene.periodic);
        let tears = take_out_tears(&mut causes, m);
        make_modest(&mut causes, simulation.is_some());
        if (0..study.scene.joints()).any(|j| !rests(&study.scene, j).is_empty()) {
            make_modest_along_moves(&mut causes);
        }

        // What is left, and how sure the causes are beside it.
        let [before_rms_nm, after_rms_nm] = [&before_nm, &after_nm].map(rms);
        let lack = misfit::lack_of_fit(study, &accepted, &rest);
        let form = error_of_form(&laws, &causes, study.scene.joints());
        let left = left(study, (&accepted, &rest), lack.as_ref(), (&causes, &form), &log);
        let Left { unexplained, form_error } = left.at_most(&after_rms_nm);
        if let Some(unknown) = &unexplained {
            let joints = study.scene.joints();
            make_modest_beside_unknown(&mut causes, unknown.site(), (joints, study.scene.periodic));
        }

        // What it is worth elsewhere.
        let base = intervals::base(study, self.set, &extension);
        let models = Models { null, extension: &extension };
        let gain = |log| {
            let parts = (&mut self.identifier, &*self.families);
            let currents = self.drive_gain_nm_a.as_deref();
            gain_along(parts, setup, currents, log, &models, &causes)
        };
        let held_out = held_out.iter().map(gain).collect::<Result<Vec<_>, _>>()?;

        let besides = Besides {
            doubt: simulation.and_then(|simulation| simulation.doubt),
            limited: limited_drives(self.arm, m.torque_nm, &causes, unexplained.as_ref()),
            drift: drift_remark(study, &causes),
            slow: slow_remark(study, &measured_nm, &after_nm)
                .filter(|_| causes.is_empty() && unexplained.is_none()),
        };
        let not_tested: &[HeldAtRest] =
            if study.scene.periodic { &[] } else { &identification.held_at_rest };
        let friction = (self.arm.friction_epsilon_rad_s, &study.scene.coulomb_nm[..]);
        let warnings = [
            log.warnings.clone(),
            identification.warnings.clone(),
            contact_remark(study, &log).into_iter().collect(),
            rest_remark(&regression.prepared.motion.qd_rad_s).into_iter().collect(),
            held_remark(not_tested).into_iter().collect(),
            drive_limit_remark(self.arm, m.torque_nm).into_iter().collect(),
            coarse_remark(&coarse, &regression.prepared.angle_resolution_rad, friction)
                .into_iter()
                .collect(),
            of_held_out(&held_out),
            tear_remark(tears).into_iter().collect(),
        ];
        let mut diagnosis = Diagnosis {
            log: m.source.to_owned(),
            noise_floor_nm: identification.replicates.as_ref().map(|r| r.sigma.clone()),
            noise_of_mean_nm,
            before: Rms { rms_nm: before_rms_nm },
            verdict: Verdict::of(&causes, unexplained.is_some()),
            causes,
            unexplained,
            form_error,
            after: Rms { rms_nm: after_rms_nm },
            moved_parameters: simulation.map_or(Vec::new(), |s| against::moved(s, &base)),
            moved_together: simulation.and_then(|s| against::moved_together(study, s, &base)),
            base_parameters: base.parameters,
            held_out,
            payload: None,
            replay: None,
            detection_limits: detection_limits(study, &accepted),
            lack_of_fit_probability: lack.map(|lack| lack.probability),
            doubt: None,
            sentences: Vec::new(),
            behind_the_overview: Vec::new(),
            warnings: warnings.concat(),
        };
        let q_rad = &regression.prepared.motion.q_rad;
        self.question_the_arm(&mut diagnosis, &extension, &identification, q_rad);
        let laws: Vec<Option<usize>> =
            extension.effects.iter().map(|effect| effect.site.map(|j| j + 1)).collect();
        diagnosis.sentences = diagnosis.in_sentences(&laws, besides);
        diagnosis.behind_the_overview = diagnosis.about_each_of_many();
        let samples = (0..regression.problem.samples).map(|row| regression.sample(row)).collect();
        let scene = explanation.study.scene;
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
            setup: Setup { arm: self.arm, set: self.set, options: &self.options },
            families: &self.families,
            extension: &finding.extension,
        };
        let names = [reference.source, loaded.source];
        let found = payload::between(&shared, &reference_rows, &loaded_rows, names, known_mass_kg)?;
        Ok(PayloadFinding { was_touched: touched, ..found })
    }
}

/// Orders the causes; `faults` are those of the record and contacts. For a repeating motion: faults of the record, then
/// contacts, then physics by strength. For a single run: contacts, then physics by gain, then faults of the record.
fn in_order(mut faults: Vec<Cause>, mut physics: Vec<Cause>, periodic: bool) -> Vec<Cause> {
    physics.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    if !periodic {
        let gain = |cause: &Cause| cause.gain_fraction.unwrap_or(0.0);
        physics.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        physics.extend(faults.extract_if(.., |fault| fault.kind.is_of_the_record()));
    }
    faults.into_iter().chain(physics).collect()
}

/// Contacts with the arm: those that the comparison of repetitions shows, or those in what the model leaves along a
/// single run.
fn touches(
    log: &Cleaned,
    study: &Study,
    after_nm: &JointSignals,
) -> Result<Vec<Cause>, DiagnoseError> {
    match log.touched() {
        Some(touched) => Ok(touched.causes.clone()),
        // Every stall is given back the mean lost time of all stalls. The remaining error shifts torque and motion
        // against each other for a moment and stands out of the noise as far as a touch does, so no confidence in a
        // touch would be justified.
        None if log.is_mended => Ok(Vec::new()),
        None => Ok(beside_model(study, after_nm)?.causes),
    }
}

/// Gain of the extended model over the null model along another `log`.
fn gain_along(
    (identifier, families): (&mut Identifier, &[Box<dyn Candidate>]),
    setup: Setup,
    drive_gain_nm_a: Option<&[f64]>,
    log: &Validation,
    models: &Models,
    causes: &[Cause],
) -> Result<HeldOut, DiagnoseError> {
    log.measurement.require_rows()?;
    // The recorder has the same lags on other days.
    let mut record = Record::without_rows(&log.measurement, &[]);
    record.undo_lags(causes, 0.0);
    let measurement = record.measurement(log.measurement.source);
    let log = &Validation { measurement, manufacturer_nm: log.manufacturer_nm };
    held_out_gain(identifier, setup, drive_gain_nm_a, families, log, models)
}

/// The remarks on held-out logs, each with the name of its log.
fn of_held_out(held_out: &[HeldOut]) -> Vec<String> {
    let with_name = |log: &HeldOut| -> Vec<String> {
        log.warnings.iter().map(|warning| format!("{}: {warning}", log.log)).collect()
    };
    held_out.iter().flat_map(with_name).collect()
}

/// Removes contacts at which the angles jump as no arm can, and returns their number.
fn take_out_tears(causes: &mut Vec<Cause>, m: &Measurement) -> usize {
    causes.extract_if(.., |cause| is_a_tear(cause, m)).count()
}

fn is_a_tear(cause: &Cause, m: &Measurement) -> bool {
    let at = |name| cause.parameters.get(name).map_or(f64::NAN, |e| e.value);
    cause.kind == Kind::Contact && is_torn(m, [at("start_s"), at("end_s")])
}

/// What the residual `rest` shows that the `accepted` causes leave; their laws may leave λ of `form` on each joint
/// because they are not exact.
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
    misfit::left(study, accepted, rest, lack, &KnownOfJoints { has_law, can_differ, form })
}
