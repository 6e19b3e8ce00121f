//! Validation: how well base parameters predict a motion from which they were not identified.

use nalgebra::DVector;

use crate::excitation::{Excitation, FourierSeries, Requirements};
use crate::identify::{Identifier, Options, Problem, Repetition, Triangle};
use crate::montecarlo::experiment::TrialError;
use crate::montecarlo::scenario::{Scenario, ScenarioError};
use crate::montecarlo::simulation::Simulation;
use crate::plant::SensorConfig;

/// Prediction error on another, noise-free motion of the same arm, reduced to a triangular system: the mean over the
/// joints of ‖e_j‖²/‖τ_j‖² equals ‖R θ − ρ‖² plus the square of the part that no θ explains.
#[derive(Debug, Clone)]
pub struct Validation {
    triangle: Triangle,
}

impl Validation {
    /// Runs the arm of `scenario`, including its hidden effects, along `trajectory`.
    pub fn run(scenario: &Scenario, trajectory: &str) -> Result<Self, CaseError> {
        let series = FourierSeries::built_in(trajectory).map_err(ScenarioError::from)?;
        let arm = &scenario.arm;
        let excitation = Excitation::fitted(arm, &Requirements::default(), series, 1, false)
            .map_err(ScenarioError::from)?;
        let quiet = Scenario { excitation, sensors: SensorConfig::default(), ..scenario.clone() };
        let simulation = Simulation::run(quiet).map_err(TrialError::from)?;
        let log = simulation.log(0).map_err(TrialError::from)?;
        let options = Options { repetition: Repetition::Never, ..scenario.processing.clone() };
        let model = crate::dynamics::Model::new(arm);
        let mut identifier = Identifier::new(&model, &scenario.set, options);
        let regression =
            identifier.regression(&log.measurement(trajectory)).map_err(TrialError::from)?;
        Ok(Self { triangle: reduced(&regression.problem) })
    }

    /// R θ − ρ for the base parameters `theta`.
    pub fn error(&self, theta: &[f64]) -> DVector<f64> {
        let b = theta.len();
        let row = |i: usize| (i..b).map(|k| self.triangle.r(i, k) * theta[k]).sum::<f64>();
        DVector::from_iterator(b, self.triangle.rhs(0).iter().enumerate().map(|(i, z)| row(i) - z))
    }

    /// Square of the part of the error that no θ explains.
    pub fn unexplained(&self) -> f64 {
        self.triangle.outside(0)
    }
}

/// Triangular factor of all joints' equations, each joint's equations divided by the norm of its torque and by √N for N
/// joints.
fn reduced(problem: &Problem) -> Triangle {
    let (b, n) = (problem.parameters(), problem.samples);
    let mut triangle = Triangle::new(b, 1);
    for (joint, panel) in problem.panels.iter().enumerate() {
        let size = panel.y.iter().map(|y| y * y).sum::<f64>().sqrt();
        let weight = 1.0 / (size * (problem.joints() as f64).sqrt());
        let mut block = vec![0.0; (b + 1) * n];
        for (base, column) in problem.plan.base_indices(joint).zip(panel.x.chunks_exact(n)) {
            block[base * n..][..n].copy_from_slice(column);
        }
        block[b * n..].copy_from_slice(&panel.y);
        block.iter_mut().for_each(|x| *x *= weight);
        triangle.append(&mut block, n);
    }
    triangle
}

/// Why a case could not be run.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// The scenario or the validation motion is not possible.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The plant, or the pilot log on which all trials are modelled, failed.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// The constraints of the arm could not be set up.
    #[error(transparent)]
    Physical(#[from] crate::identify::physical::PhysicalError),
}
