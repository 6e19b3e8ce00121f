//! A blind benchmark prepared for its trials, and the trials themselves.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::case::{Case, Drawn, Secret, draw};
use super::family::{Family, Judged, kin};
use super::plan::BlindPlan;
use super::record::{Answer, HeldOutGain, Record, Records};
use crate::diagnose::candidates::Candidate;
use crate::diagnose::{
    DiagnoseError, Diagnoser, Diagnosis, HeldOut, Kind, Nominal, Validation, candidates,
};
use crate::dynamics::Model;
use crate::identify::Measurement;
use crate::montecarlo::trials::{Content, Difference, Trials};
use crate::montecarlo::{Scenario, Simulation};
use crate::plant::faults::{Effect, FaultyPlant};
use crate::plant::{Measured, PlantError, Recording, SensorConfig};

/// A prepared blind benchmark: everything that all trials share.
#[derive(Clone)]
pub struct Benchmark {
    /// The plan from which the cases are drawn.
    pub plan: BlindPlan,
    /// Model of the arm: its equations of motion.
    pub model: Model,
    /// Base parameters of the nominal arm, for comparison with the nominal simulation.
    pub simulation: Vec<f64>,
    /// Families in the dictionary of the diagnosis.
    pub known: Vec<Kind>,
    /// Run of the arm without effects along each motion of the plan.
    pub(super) clean: Vec<Recording>,
}

/// Why a trial has no answer.
#[derive(Debug, Error)]
pub enum BlindError {
    /// The plant did not run.
    #[error("the plant: {0}")]
    Plant(#[from] PlantError),
    /// The diagnosis failed.
    #[error("{source}; the log: {case}")]
    Diagnose {
        /// The truth about the log.
        case: Box<Case>,
        /// Why the diagnosis failed.
        source: DiagnoseError,
    },
    /// The plan has no family for the kind of case that was drawn.
    #[error("no family can be hidden here")]
    NothingToHide,
}

impl Benchmark {
    /// Runs the clean arm along every motion.
    pub fn prepare(plan: BlindPlan) -> Result<Self, PlantError> {
        let model = Model::new(&plan.base.arm);
        let clean = plan
            .motions
            .iter()
            .map(|motion| {
                let excitation = motion.excitation.clone();
                let scenario = Scenario { excitation, ..plan.base.clone() };
                Ok(Simulation::run(scenario)?.recording)
            })
            .collect::<Result<_, PlantError>>()?;
        let simulation = plan.base.set.values(&model.standard_parameters());
        let known = candidates::all().iter().map(|f| f.kind()).collect();
        Ok(Self { plan, model, simulation, known, clean })
    }

    /// See [`Family::can_be_withheld`].
    pub(super) fn can_be_withheld(&self, family: &Family) -> bool {
        family.can_be_withheld(&self.known)
    }

    /// The families of the plan that `wanted` accepts.
    pub(super) fn open(&self, wanted: impl Fn(&Family) -> bool) -> Vec<&Family> {
        self.plan.families.iter().filter(|f| wanted(f)).collect()
    }

    /// Simulation of `scenario` without its effects along motion number `motion`, from the run made beforehand.
    pub(super) fn clean_simulation(
        &self,
        scenario: Scenario,
        motion: usize,
    ) -> Result<Simulation, PlantError> {
        let scenario = Scenario { effects: Vec::new(), ..scenario };
        let plant = FaultyPlant::new(&scenario.arm, &[], &scenario.plant)?;
        Simulation::with_recording(scenario, plant, self.clean[motion].clone())
    }

    /// The dictionary without the families that are withheld in `case`.
    fn dictionary(&self, case: &Case) -> Vec<Box<dyn Candidate>> {
        let mut families = candidates::all();
        if case.secret == Secret::Withheld {
            let is_withheld = |kind: Kind| {
                case.hidden.iter().any(|h| h.kind == kind || kin(h.kind).contains(&kind))
            };
            families.retain(|f| !is_withheld(f.kind()));
        }
        families
    }

    /// Runs one trial: draws a case, makes its log, diagnoses the log, and records the truth with the answer.
    pub fn trial(&self, trial: u64) -> Result<Record, BlindError> {
        let drawn = draw(self, trial)?;
        let log = drawn.simulation.log(trial)?;
        let held_out = self.held_out(&drawn)?;
        let simulation = drawn.case.against_simulation.then(|| Nominal::certain(&self.simulation));
        let diagnosis = self
            .diagnose(&log, self.dictionary(&drawn.case), held_out.as_ref(), simulation)
            .map_err(|source| BlindError::Diagnose {
                case: Box::new(drawn.case.clone()),
                source,
            })?;
        let sensors = &drawn.simulation.scenario.sensors;
        let sd_nm = sensors.torque_sd_per_joint_nm(self.plan.base.arm.dof())?;
        let gain = match diagnosis.held_out.first() {
            None => None,
            Some(hidden) => {
                let clean = self.clean_held_out(&drawn, trial)?;
                clean.map(|clean| HeldOutGain::of(hidden, &clean, &sd_nm))
            }
        };
        let hidden_arm = Model::new(drawn.simulation.plant.true_arm());
        let truth = self.plan.base.set.values(&hidden_arm.standard_parameters());
        Ok(Record { trial, case: drawn.case, answer: Answer::of(&diagnosis, gain, &truth) })
    }

    /// Diagnoses the `log` with a dictionary of these `families`.
    fn diagnose(
        &self,
        log: &Measured,
        families: Vec<Box<dyn Candidate>>,
        held_out: Option<&Recording>,
        simulation: Option<Nominal>,
    ) -> Result<Diagnosis, DiagnoseError> {
        let Self { plan, model, .. } = self;
        let Scenario { arm, set, processing, .. } = &plan.base;
        let mut diagnoser = Diagnoser::with_families(arm, model, set, processing.clone(), families);
        let held_out: Vec<Validation> = held_out
            .iter()
            .map(|run| Validation {
                measurement: Measurement {
                    source: "held out",
                    time_s: &run.time_s,
                    q_rad: &run.q_rad,
                    qd_rad_s: &run.qd_rad_s,
                    torque_nm: &run.torque_nm,
                },
                manufacturer_nm: None,
            })
            .collect();
        Ok(diagnoser.diagnose(&log.measurement("hidden"), &held_out, simulation)?.diagnosis)
    }

    /// The noise-free run of the same arm along the next motion, if the gain is measured for this case. Faults of the
    /// record are excluded, because they add nothing to the model of the arm that another motion could test.
    fn held_out(&self, drawn: &Drawn) -> Result<Option<Recording>, BlindError> {
        let plan = &self.plan;
        let scenario = &drawn.simulation.scenario;
        let measured = drawn.measures_gain
            && scenario.effects.iter().all(Effect::repeats)
            && drawn.case.hidden.iter().all(|h| h.judged == Judged::Residual)
            && !drawn.case.hidden.iter().any(|h| h.kind.is_of_the_record());
        if !measured {
            return Ok(None);
        }
        let next = &plan.motions[self.next_motion(drawn)];
        let excitation = next.excitation.clone();
        let sensors = SensorConfig::default();
        let simulation = Simulation::run(Scenario { excitation, sensors, ..scenario.clone() })?;
        Ok(Some(simulation.without_noise()))
    }

    /// Number of the motion along which the gain is measured: the one after the motion of the log.
    fn next_motion(&self, drawn: &Drawn) -> usize {
        (drawn.motion + 1) % self.plan.motions.len()
    }

    /// Prediction of the next motion for the arm without effects, identified from a log of that arm with the noise of
    /// this trial. Its only error is the noise of the parameters, which the right cause could not remove either. `None`
    /// if the diagnosis of that log, which is not the log of the trial, fails.
    fn clean_held_out(&self, drawn: &Drawn, trial: u64) -> Result<Option<HeldOut>, PlantError> {
        let scenario = drawn.simulation.scenario.clone();
        let log = self.clean_simulation(scenario, drawn.motion)?.log(trial)?;
        let next = &self.clean[self.next_motion(drawn)];
        let diagnosis = self.diagnose(&log, Vec::new(), Some(next), None).ok();
        Ok(diagnosis.and_then(|diagnosis| diagnosis.held_out.into_iter().next()))
    }
}

/// What all trials of a blind benchmark have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlindContent {
    /// Families in the dictionary of the diagnosis.
    pub known: Vec<Kind>,
}

impl Content for BlindContent {
    type Gathered = Records;
    const SCHEMA: &'static str = "armid.blind-shard/3";

    fn nothing(&self) -> Records {
        Records::default()
    }

    fn difference(&self, expected: &Self) -> Option<Difference> {
        let known = |content: &Self| format!("{:?}", content.known);
        Difference::between("dictionary", known(self), known(expected))
    }
}

impl Trials for Benchmark {
    type Content = BlindContent;
    type Worker<'a> = &'a Self;
    type Error = BlindError;

    fn scenario(&self) -> &Scenario {
        &self.plan.base
    }

    fn content(&self) -> BlindContent {
        BlindContent { known: self.known.clone() }
    }

    fn worker(&self) -> &Self {
        self
    }

    fn trial(worker: &mut &Self, trial: u64) -> Result<Record, BlindError> {
        (*worker).trial(trial)
    }
}
