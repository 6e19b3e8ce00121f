//! Whether the intervals can be trusted: noise and misfit apart.

use serde::Serialize;

use crate::identify::{Floor, Identification, LackOfFit, MANY_PERIODS, Processing};

/// Whether the 95 % intervals may claim to hold the truth.
#[derive(Debug, Clone, Serialize)]
pub struct Intervals {
    /// False where the model leaves more than noise; null where that could not be tested.
    pub trusted: Option<bool>,
    /// Why, in a sentence.
    pub reason: String,
    /// The test behind it.
    pub lack_of_fit: Option<TestResult>,
}

/// The lack-of-fit test and its answer.
#[derive(Debug, Clone, Serialize)]
pub struct TestResult {
    /// Statistic, degrees of freedom, chance.
    #[serde(flatten)]
    pub test: LackOfFit,
    /// Chance below which the model is rejected.
    pub level: f64,
}

impl Intervals {
    /// Of what a log said.
    pub fn of(identification: &Identification) -> Self {
        let Some(test) = identification.lack_of_fit else {
            let asked_for = identification.estimator;
            let Processing { logs, periods, .. } = identification.processing;
            let reason = if logs > 1 {
                "Whether the intervals hold cannot be tested: several logs as one do not tell noise from what the model \
                 lacks. Identify from one that repeats its motion four times or more."
                    .to_owned()
            } else if periods >= MANY_PERIODS {
                format!(
                    "Whether the intervals hold was not tested: lack of fit is measured with the weights of the \
                     spectral estimator, and {asked_for} was asked for."
                )
            } else {
                let too_few = match periods {
                    1 => "a single run does not".to_owned(),
                    few => format!("{few} periods do not"),
                };
                format!(
                    "Whether the intervals hold cannot be tested: {too_few} tell noise from what the model lacks. \
                     Repeat the motion {MANY_PERIODS} times or more."
                )
            };
            return Self { trusted: None, reason, lack_of_fit: None };
        };
        let LackOfFit { statistic, p_value, floor, .. } = test;
        let scatter = match floor {
            Floor::Torque => "the scatter of the torque between periods",
            Floor::TorqueAndMotion => "the scatter of torque and motion between periods",
        };
        let chance =
            if p_value < 0.01 { format!("{p_value:.1e}") } else { format!("{p_value:.2}") };
        let reason = if test.fits() {
            format!(
                "The model explains what repeats in the torque: what it leaves is {statistic:.2} times what \
                 {scatter} leads to expect (chance {chance})."
            )
        } else {
            format!(
                "The 95 % intervals are not to be trusted: what repeats in the torque and is not explained is \
                 {statistic:.2} times what {scatter} would leave (chance {chance}). They cover the noise, not the \
                 error of the model; armid diagnose looks for its cause."
            )
        };
        let level = LackOfFit::REJECT_BELOW;
        Self { trusted: Some(test.fits()), reason, lack_of_fit: Some(TestResult { test, level }) }
    }
}
