//! Whether the intervals can be trusted: noise and misfit apart.

use serde::Serialize;

use super::Training;
use crate::identify::{
    Agreement, Floor, Identification, LackOfFit, MANY_PERIODS, Processing, by_noise_in_words,
};
use crate::signal::Replicates;

/// Whether the 95 % intervals may claim to hold the truth.
#[derive(Debug, Clone, Serialize)]
pub struct Intervals {
    /// False where the model leaves more than noise, or logs contradict each other; null where that could not be tested.
    pub trusted: Option<bool>,
    /// Why, in a sentence.
    pub reason: String,
    /// The test behind it.
    pub lack_of_fit: Option<TestResult>,
    /// Of several logs that repeat their motions: whether they contradict each other.
    pub agreement: Option<AgreementResult>,
}

/// The test of agreement and its answer.
#[derive(Debug, Clone, Serialize)]
pub struct AgreementResult {
    /// 1 where the logs differ by their noise.
    pub statistic: f64,
    /// Of its F distribution.
    pub degrees_of_freedom: [f64; 2],
    /// Chance of a larger statistic where the arm is the same.
    pub p_value: f64,
    /// Chance below which the logs are said to differ.
    pub level: f64,
    /// The base parameter that differs most in units of its noise.
    pub parameter: String,
    /// The log that does.
    pub log: String,
    /// By how many standard deviations it differs from the common estimate.
    pub sigmas: f64,
}

impl AgreementResult {
    fn of(agreement: &Agreement, training: &Training) -> Self {
        let Agreement { statistic, degrees_of_freedom, p_value, parameter, log, sigmas } =
            *agreement;
        Self {
            statistic,
            degrees_of_freedom,
            p_value,
            level: Agreement::REJECT_BELOW,
            parameter: training.set.name(parameter).to_owned(),
            log: training.logs[log].source.clone(),
            sigmas,
        }
    }

    /// Squares are what is tested; what is told is how far the estimates lie apart.
    fn times(&self) -> String {
        format!(
            "{:.2} times as far as their noise leads to expect ({})",
            self.statistic.sqrt(),
            by_noise_in_words(self.p_value)
        )
    }

    fn contradiction(&self) -> String {
        let Self { parameter, log, sigmas, .. } = self;
        let side = if *sigmas > 0.0 { "above" } else { "below" };
        format!(
            "the logs contradict each other. Their own estimates lie apart {}, farthest in {parameter}, which {log} alone puts \
             {:.1} σ {side} the common estimate",
            self.times(),
            sigmas.abs()
        )
    }
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
    /// Of what the logs said.
    pub fn of(training: &Training) -> Self {
        let alone = Self::of_fit(training.identification);
        let Some(agreement) = &training.identification.agreement else { return alone };
        let result = AgreementResult::of(agreement, training);
        let (trusted, reason) = match (agreement.holds(), alone.trusted) {
            (true, _) => {
                let reason = format!(
                    "{} The logs do not contradict each other: their own estimates lie apart {}.",
                    alone.reason,
                    result.times()
                );
                (alone.trusted, reason)
            }
            (false, Some(false)) => {
                let reason = format!(
                    "{} And {}; the model's own error, which shows otherwise along each motion, may be why.",
                    alone.reason,
                    result.contradiction()
                );
                (Some(false), reason)
            }
            (false, _) => {
                let reason = format!(
                    "The 95 % intervals are not to be trusted: {}. Load, temperature or mounting changed between them, or the \
                     model is wrong in a way that shows along one of the motions: identify each log alone.",
                    result.contradiction()
                );
                (Some(false), reason)
            }
        };
        Self { trusted, reason, agreement: Some(result), ..alone }
    }

    fn of_fit(identification: &Identification) -> Self {
        let Some(test) = identification.lack_of_fit else {
            let asked_for = identification.estimator;
            let Processing { logs, periods, .. } = identification.processing;
            let reason = if logs > 1 {
                "Whether the intervals hold cannot be tested: several logs as one do not tell noise from what the model \
                 lacks. Identify from logs that each repeat their motion four times or more."
                    .to_owned()
            } else if identification.replicates.as_ref().is_some_and(Replicates::are_alike) {
                "Whether the intervals hold cannot be tested: the periods are alike to the last digit, and show no noise."
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
            return Self { trusted: None, reason, lack_of_fit: None, agreement: None };
        };
        let LackOfFit { statistic, p_value, floor, .. } = test;
        let scatter = match floor {
            Floor::Torque => "the scatter of the torque between periods",
            Floor::TorqueAndMotion => "the scatter of torque and motion between periods",
        };
        let (by_noise, level) = (by_noise_in_words(p_value), LackOfFit::REJECT_BELOW);
        let along = match identification.agreement {
            Some(_) => " along the log that fits worst",
            None => "",
        };
        let reason = if test.fits() {
            format!(
                "The model explains what repeats in the torque: the square of what it leaves{along} is {statistic:.2} times what \
                 {scatter} leads to expect (F test; {by_noise}, the model is rejected below {level})."
            )
        } else {
            format!(
                "The 95 % intervals are not to be trusted: the square of what repeats in the torque and is not explained{along} is \
                 {statistic:.2} times what {scatter} would leave (F test; {by_noise}). They cover the noise, not the \
                 error of the model; armid diagnose looks for its cause."
            )
        };
        Self {
            trusted: Some(test.fits()),
            reason,
            lack_of_fit: Some(TestResult { test, level }),
            agreement: None,
        }
    }
}
