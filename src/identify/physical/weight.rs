//! The pull to the prior: its metric, and its weight, given or chosen by cross-validation.

use std::str::FromStr;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::error::PhysicalError;
use super::estimate::{ROUGH_GAP, Solver};
use super::information::Information;

/// How a deviation from the prior is measured. Both metrics are ½ tr(P₀⁻¹ΔP P₀⁻¹ΔP) for small deviations and
/// independent of the choice of frames and units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub enum PriorMetric {
    /// ½ tr(P₀⁻¹ΔP P₀⁻¹ΔP): half the squared distance in the tangent space at the prior.
    #[default]
    PullBack,
    /// tr(P₀⁻¹P) − ln det(P₀⁻¹P) − 4: up to a factor the relative entropy of Gaussian mass densities; infinite where
    /// a body ceases to be possible.
    Entropic,
}

impl std::fmt::Display for PriorMetric {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::PullBack => "constant pull-back",
            Self::Entropic => "entropic",
        })
    }
}

/// A pull to the prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulling {
    /// How deviations are measured.
    pub metric: PriorMetric,
    /// γ.
    pub weight: f64,
}

impl Pulling {
    /// The constant pull-back with weight γ.
    pub fn squared(weight: f64) -> Self {
        Self { metric: PriorMetric::PullBack, weight }
    }

    /// The relative entropy with weight γ.
    pub fn entropic(weight: f64) -> Self {
        Self { metric: PriorMetric::Entropic, weight }
    }
}

/// The weight γ: with γ = 1/s², a relative deviation of s from the prior costs as much as one σ of noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PriorWeight {
    /// This weight.
    Fixed(f64),
    /// The weight that predicts left-out periods best.
    CrossValidated,
}

impl PriorWeight {
    /// With this weight a deviation of 100 % from the prior costs one σ: the prior decides what the data know less
    /// well than that. A weaker pull leaves parameters that the data hardly determine to their noise, and links of a
    /// thousandth of their mass result.
    pub const WEAK: f64 = 1.0;
}

impl Default for PriorWeight {
    fn default() -> Self {
        Self::Fixed(Self::WEAK)
    }
}

impl std::fmt::Display for PriorWeight {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Fixed(weight) => write!(f, "{weight}"),
            Self::CrossValidated => f.write_str(AUTO),
        }
    }
}

/// The word that asks for cross-validation.
const AUTO: &str = "auto";

impl FromStr for PriorWeight {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.parse()) {
            (AUTO, _) => Ok(Self::CrossValidated),
            (_, Ok(weight)) if weight > 0.0 && f64::is_finite(weight) => Ok(Self::Fixed(weight)),
            _ => Err(format!("expected a positive number or {AUTO}")),
        }
    }
}

/// The weights tried and their prediction errors.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossValidation {
    /// The best of them.
    pub weight: f64,
    /// (γ, mean squared prediction error of a left-out period per base parameter, in units of that period's noise).
    /// Noise alone leaves 1 + 1/(P − 1).
    pub tried: Vec<(f64, f64)>,
}

/// Weights from "the prior decides nothing" to "a deviation of 10 % is one σ".
const CANDIDATES: [f64; 7] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2];

/// Chooses the weight by leaving out one period after the other.
pub(super) fn cross_validate(
    solver: &Solver,
    information: &Information,
    periods: &[Vec<f64>],
    metric: PriorMetric,
) -> Result<CrossValidation, PhysicalError> {
    let count = periods.len();
    if count < 3 {
        return Err(PhysicalError::TooFewPeriods { periods: count });
    }
    let p = count as f64;
    // R contains the information of all P periods. P − 1 periods contain less, a single one 1/P.
    let kept_root = &information.root * ((p - 1.0) / p).sqrt();
    let single_root = &information.root / p.sqrt();
    let kept_information = Information { root: kept_root, theta: information.theta.clone() };
    let mut tried = Vec::with_capacity(CANDIDATES.len());
    for weight in CANDIDATES {
        let data = solver.data(&kept_information, Pulling { metric, weight });
        let mut error = 0.0;
        for left_out in periods {
            let left_out = DVector::from_column_slice(left_out);
            // Mean of the other periods minus the mean of all.
            let away = (&information.theta - &left_out) / (p - 1.0);
            let constrained = solver.solve(&data, &(&kept_information.root * away), ROUGH_GAP)?;
            let predicted = &solver.structure().base_map * &constrained.y;
            error += (&single_root * (predicted - left_out)).norm_squared();
        }
        tried.push((weight, error / (p * information.theta.len() as f64)));
    }
    let best = tried.iter().fold(tried[0], |best, next| if next.1 < best.1 { *next } else { best });
    Ok(CrossValidation { weight: best.0, tried })
}
