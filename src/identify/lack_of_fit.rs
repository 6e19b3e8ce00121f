//! Tests whether the model explains everything that repeats in the torque.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::problem::Problem;

/// Test of the model against the scatter between periods, below which no model can get.
///
/// On whitened rows (noise of unit variance) the mean period leaves LoF = P‖ȳ − Xθ̂‖²/ν₁ with ν₁ = rows − b, and the
/// periods scatter by PE = Σ_p‖y_p − ȳ‖²/ν₂ with ν₂ = rows (P − 1). If the model holds, LoF/PE follows F(ν₁, ν₂)
/// (Draper and Smith, Applied Regression Analysis). The test is made on Fourier coefficients, because these are
/// independent for noise of any colour. Friction that drifts is no scatter, and is taken out before
/// ([`DriftingFriction`](super::DriftingFriction)).
///
/// The torque's own scatter comes first, and a model that passes against it passes. The noise of the motion that
/// remains in the regressor is contained in ȳ − Xθ̂ but not in that scatter. A model that fails is therefore tested
/// again against the scatter of torque and motion together ([`Floor::TorqueAndMotion`]), with rows whitened by that
/// scatter, and the second result counts. Only a model that fails twice is rejected, so that a true model is rejected
/// with at most the probability of the second test.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LackOfFit {
    /// LoF/PE: about 1 where the model explains everything but noise.
    pub statistic: f64,
    /// ν₁ and ν₂.
    pub degrees_of_freedom: [f64; 2],
    /// Probability of a larger statistic if the model holds.
    pub p_value: f64,
    /// The scatter that PE measures.
    pub floor: Floor,
}

/// The quantity whose scatter between periods is the floor of the test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Floor {
    /// The torque as recorded.
    Torque,
    /// The torque minus the model's torque for each period's own motion.
    TorqueAndMotion,
}

impl LackOfFit {
    /// Below this probability the model does not fit, and a σ that covers noise alone says nothing about the distance
    /// to the truth.
    pub const REJECT_BELOW: f64 = 1e-3;

    /// Tests the whitened rows `problem` in the frequency domain, with two periods or more, whose torque scatters as
    /// `floor` says.
    pub(super) fn of(problem: &Problem, theta: &[f64], floor: Floor) -> Self {
        let n = problem.samples;
        let periods = problem.periods as f64;
        let mut predicted = vec![0.0; n];
        let (mut lack, mut scatter, mut rows) = (0.0, 0.0, 0.0);
        for (j, panel) in problem.panels.iter().enumerate() {
            problem.predict(j, theta, &mut predicted);
            for (k, predicted) in predicted.iter().enumerate() {
                let values = panel.y[k..].iter().step_by(n);
                let mean = values.clone().sum::<f64>() / periods;
                lack += periods * (mean - predicted).powi(2);
                let own = values.map(|y| (y - mean).powi(2)).sum::<f64>();
                scatter += own;
                // Unused rows are zero and do not count.
                rows += f64::from(u8::from(own > 0.0));
            }
        }
        let first = (rows - theta.len() as f64).max(1.0);
        let second = rows * (periods - 1.0);
        Self::new(lack / first / (scatter / second), [first, second], floor)
    }

    fn new(statistic: f64, degrees_of_freedom: [f64; 2], floor: Floor) -> Self {
        let [first, second] = degrees_of_freedom;
        let p_value = FisherSnedecor::new(first, second).map_or(f64::NAN, |f| f.sf(statistic));
        Self { statistic, degrees_of_freedom, p_value, floor }
    }

    /// The test with `factor` times the statistic.
    pub(super) fn scaled(self, factor: f64) -> Self {
        if factor == 1.0 {
            return self;
        }
        Self::new(factor * self.statistic, self.degrees_of_freedom, self.floor)
    }

    /// Whether the model explains everything that repeats.
    pub fn fits(&self) -> bool {
        self.p_value >= Self::REJECT_BELOW
    }

    /// A warning where the model does not fit.
    pub fn warning(&self) -> Option<String> {
        let (statistic, by_noise) = (self.statistic, by_noise_in_words(self.p_value));
        (!self.fits()).then(|| {
            format!(
                "the model does not explain all that repeats in the torque (lack of fit {statistic:.2}; {by_noise}): \
                 σ covers the noise, not the error of the model"
            )
        })
    }
}

/// States in words the p-value of a test whether noise explains a difference.
pub fn by_noise_in_words(p_value: f64) -> String {
    format!("probability that noise alone gives as much: {}", chance_in_words(p_value))
}

/// A probability in words.
fn chance_in_words(p_value: f64) -> String {
    match p_value {
        p if p < f64::MIN_POSITIVE => "below 1e-300".to_owned(),
        p if p < 0.01 => format!("{p:.1e}"),
        p => format!("{p:.2}"),
    }
}
