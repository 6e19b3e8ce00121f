//! Studies: comparisons of many methods over many scenarios.
//!
//! Input: scenarios. Output: tables of what each method claims and what is true.

mod cutoff;
mod error;
mod mass_matrix;
mod noise;
mod noisy_friction;
mod noisy_regressor;
mod paper;
mod paper_equations;
mod paper_sigma;
mod periodic;
pub mod physical;
mod record_length;

pub use cutoff::{Curve, CutoffStudy, Method, Point, cutoff_study, cutoff_study_trials};
pub use error::StudyError;
pub use mass_matrix::indefinite_share;
pub use noise::{MethodResult, NoiseStudy, ScenarioResult, study};
pub use paper::{
    ErrorResult, Mechanism, MechanismResult, PaperStudy, ParameterResult, StartResult, Trace,
    paper_study, paper_study_runs,
};
pub use paper_equations::{Acceleration, PaperEquations};
pub use paper_sigma::SigmaCase;
pub use record_length::RecordLength;
