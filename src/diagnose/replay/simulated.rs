//! The arms used in the simulation.

use serde::Serialize;

use super::counterpart::{Counterpart, DiagnosedCause};
use super::course::plant_config;
use super::error::ReplayError;
use super::fitted::Fitted;
use crate::base::BaseSet;
use crate::diagnose::candidates::Candidate;
use crate::diagnose::{Finding, Kind};
use crate::dynamics::{Parameter, ParameterLayout};
use crate::identify::Identification;
use crate::identify::physical::{
    Information, PhysicalOptions, PriorWeight, Pulling, Solver, Structure,
};
use crate::plant::faults::{CurrentOffset, Effect, FaultyPlant};
use crate::plant::{PlantConfig, PlantError};
use crate::robot::Arm;

/// An arm that the plant can simulate.
#[derive(Debug, Clone)]
pub struct SimulatedArm {
    /// Bodies and drives.
    pub arm: Arm,
    /// Constant torques, Nm, for which an [`Arm`] has no place: one effect per joint that has one.
    pub offsets: Vec<Effect>,
    /// √(‖R (θ − θ̂)‖²/b): distance of its b base parameters from the identified ones, in standard deviations of what
    /// the log says about them. It is above 0 where no physically possible arm has the identified parameters.
    pub distance: f64,
}

/// A cause that is not simulated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotReplayed {
    /// Kind of the cause.
    pub kind: Kind,
    /// Joint, from 1; null for the arm as a whole.
    pub joint: Option<usize>,
    /// Reason.
    pub reason: String,
}

/// The simulation without and with the causes that were found.
#[derive(Debug, Clone)]
pub struct ExtendedSimulation {
    /// The arm that the null model identifies.
    pub null: SimulatedArm,
    /// The arm that is identified together with the causes.
    pub extended: SimulatedArm,
    /// The causes.
    pub effects: Vec<Effect>,
    /// Faults of the record, which were repaired before the fit.
    pub of_the_record: Vec<Effect>,
    /// Causes without a counterpart; the extended arm is fitted without them as well as it can be.
    pub not_replayed: Vec<NotReplayed>,
    /// Steps and rates: the plant's own controller decides at every step, and the log has the rate of the diagnosed
    /// one.
    pub plant: PlantConfig,
}

/// Why a change of the arm is not replayed.
const HELD: &str = "the arm's parameters, which were identified with it, hold it";
/// Why a fault of the record is not replayed.
const REPAIRED: &str = "a fault of the record, repaired before the model was fitted";

impl ExtendedSimulation {
    /// Builds the simulation from what was found in logs of `nominal`.
    pub(super) fn new(
        nominal: &Arm,
        set: &BaseSet,
        families: &[Box<dyn Candidate>],
        finding: &Finding,
    ) -> Result<Self, ReplayError> {
        let realise = Realise::new(nominal, set, &finding.identification)?;
        let null = realise.arm(&finding.identification.fit.theta)?;
        let mut out = Self {
            plant: plant_config(finding.scene.rate_hz),
            extended: null.clone(),
            null,
            effects: Vec::new(),
            of_the_record: Vec::new(),
            not_replayed: Vec::new(),
        };
        let mut theta = finding.extension.theta.clone();
        let mut fitted = Vec::new();
        // Kind and joint of each of `effects`, and what returns to the parameters if the effect is dropped.
        let mut sources = Vec::new();
        for Fitted { effect, kind, joint, counterpart } in
            Fitted::all(&finding.extension.effects, families, &finding.scene)
        {
            fitted.push((kind, joint));
            if out.take((kind, joint), counterpart, nominal) {
                sources.push((kind, joint, &effect.absorbed));
            } else {
                theta.iter_mut().zip(&effect.absorbed).for_each(|(theta, more)| *theta += more);
            }
        }
        if !fitted.is_empty() {
            out.extended = realise.arm(&theta)?;
        }
        while let Some((index, refusal)) = out.refused(nominal) {
            out.effects.remove(index);
            let (kind, joint, absorbed) = sources.remove(index);
            let reason = in_words(&refusal);
            out.not_replayed.push(NotReplayed { kind, joint, reason });
            theta.iter_mut().zip(absorbed).for_each(|(theta, more)| *theta += more);
            out.extended = realise.arm(&theta)?;
        }
        // Causes that are named in addition to the fitted effects: faults of the record, events, moved parameters.
        for cause in &finding.diagnosis.causes {
            let (kind, joint) = (cause.kind, cause.joint);
            if fitted.contains(&(kind, joint)) {
                continue;
            }
            if !matches!(kind, Kind::Contact) && !kind.is_of_the_record() {
                let reason = HELD.to_owned();
                out.not_replayed.push(NotReplayed { kind, joint, reason });
                continue;
            }
            let quantities: Vec<_> =
                cause.parameters.iter().map(|(name, e)| (*name, e.value)).collect();
            let (record_fault, quantities) = (cause.record_fault.as_ref(), &quantities);
            let diagnosed = DiagnosedCause { kind, joint, variant: 0, record_fault, quantities };
            out.take((kind, joint), diagnosed.counterpart(), nominal);
        }
        Ok(out)
    }

    /// Adds the cause of this kind and joint; returns whether it acts in the simulated arm.
    fn take(
        &mut self,
        (kind, joint): (Kind, Option<usize>),
        counterpart: Counterpart,
        nominal: &Arm,
    ) -> bool {
        let reason = match counterpart {
            Counterpart::InTheModel(effect) => {
                self.effects.push(effect);
                return true;
            }
            Counterpart::OfTheRecord(effect) => {
                match FaultyPlant::new(nominal, std::slice::from_ref(&effect), &self.plant) {
                    Ok(_) => {
                        self.of_the_record.push(effect);
                        REPAIRED.to_owned()
                    }
                    Err(refusal) => format!("{REPAIRED}; {}", in_words(&refusal)),
                }
            }
            Counterpart::None(reason) if kind.is_of_the_record() => format!("{REPAIRED}; {reason}"),
            Counterpart::None(reason) => reason.to_owned(),
        };
        self.not_replayed.push(NotReplayed { kind, joint, reason });
        false
    }

    /// The first effect that the simulated arm cannot have together with those before it, and why.
    fn refused(&self, nominal: &Arm) -> Option<(usize, PlantError)> {
        (0..self.effects.len()).find_map(|last| {
            let effects = &self.effects[..=last];
            let arm = &self.extended.arm;
            let plant = FaultyPlant::with_controller(arm, nominal, effects, &self.plant);
            plant.err().map(|refusal| (last, refusal))
        })
    }
}

/// Why the plant rejects an effect. As the effect stands alone here, its number is omitted.
fn in_words(refusal: &PlantError) -> String {
    match refusal {
        PlantError::Effect { key, value, requirement, .. } => {
            format!("the simulated arm cannot have {key} = {value:.4}, which {requirement}")
        }
        other => format!("the simulated arm cannot have it: {other}"),
    }
}

/// Finds physically possible arms for base parameters of one log.
///
/// Base parameters are combinations, shared by many arms. Among the physically possible arms, the one is chosen that
/// minimises ‖R (θ − θ̂)‖² + γ ‖deviation from the robot file‖², with a γ that decides only what the log leaves open
/// ([`PriorWeight::WEAK`]).
struct Realise<'a> {
    nominal: &'a Arm,
    solver: Solver,
    information: Information,
}

impl<'a> Realise<'a> {
    fn new(
        nominal: &'a Arm,
        set: &BaseSet,
        identification: &Identification,
    ) -> Result<Self, ReplayError> {
        let margin = PhysicalOptions::default().margin;
        let structure = Structure::new(nominal, set, nominal, margin)?;
        let information = Information::of(&identification.fit, &identification.covariance);
        Ok(Self { nominal, solver: Solver::new(structure), information })
    }

    fn arm(&self, theta: &[f64]) -> Result<SimulatedArm, ReplayError> {
        let theta = nalgebra::DVector::from_column_slice(theta);
        let information = Information { theta, ..self.information.clone() };
        let solved = self.solver.constrained(&information, Pulling::squared(PriorWeight::WEAK))?;
        let standard = self.solver.structure().standard(&solved.y);
        let layout = ParameterLayout::new(self.nominal.dof());
        let offsets = (0..self.nominal.dof()).filter_map(|j| {
            let offset_nm = standard[layout.index(Parameter::Offset(j))];
            let offset = CurrentOffset { joint: j + 1, offset_nm };
            (offset_nm != 0.0).then_some(Effect::CurrentOffset(offset))
        });
        Ok(SimulatedArm {
            offsets: offsets.collect(),
            arm: layout.apply(&standard, self.nominal),
            distance: (solved.distance / self.information.theta.len() as f64).sqrt(),
        })
    }
}
