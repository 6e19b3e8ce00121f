//! Whether the confidence intervals can be trusted: tests that separate noise from misfit.

use serde::Serialize;

use super::Training;
use super::drift;
use crate::identify::{
    Agreement, Floor, Identification, LackOfFit, Lowered, MANY_PERIODS, Processing,
    by_noise_in_words,
};
use crate::signal::Replicates;

/// Whether the 95 % intervals can be claimed to cover the true parameters.
#[derive(Debug, Clone, Serialize)]
pub struct Intervals {
    /// False where the residual exceeds the noise or the logs contradict each other; null where neither could be
    /// tested.
    pub trusted: Option<bool>,
    /// Why, in a sentence.
    pub reason: String,
    /// The lack-of-fit test behind the answer; null where it could not be run.
    pub lack_of_fit: Option<TestResult>,
    /// The test of agreement between logs; null unless several logs each repeat their motion.
    pub agreement: Option<AgreementResult>,
}

/// Result of the test that several logs agree.
#[derive(Debug, Clone, Serialize)]
pub struct AgreementResult {
    /// The F statistic; about 1 where the logs differ only by their noise.
    pub statistic: f64,
    /// Degrees of freedom of its F distribution.
    pub degrees_of_freedom: [f64; 2],
    /// Probability of a larger statistic if all logs come from the same arm.
    pub p_value: f64,
    /// Probability below which the logs are said to contradict each other.
    pub level: f64,
    /// The base parameter whose estimate in one log differs most from the common estimate, in units of its σ.
    pub parameter: String,
    /// The log with this estimate.
    pub log: String,
    /// Its deviation from the common estimate in standard deviations, with sign.
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

    /// How far the estimates of the logs lie apart, in words. The test uses squares; the text states the root, a
    /// distance.
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

/// Result of the lack-of-fit test.
#[derive(Debug, Clone, Serialize)]
pub struct TestResult {
    /// Statistic, degrees of freedom and p-value.
    #[serde(flatten)]
    pub test: LackOfFit,
    /// Probability below which the model is rejected.
    pub level: f64,
}

impl Intervals {
    /// Judges the intervals by the tests of lack of fit and of agreement. These know nothing of friction that drifts,
    /// which is told beside them.
    pub fn of(training: &Training) -> Self {
        let judged = Self::of_tests(training);
        match drift::means_in_words(training) {
            Some(means) => Self { reason: format!("{} {means}", judged.reason), ..judged },
            None => judged,
        }
    }

    fn of_tests(training: &Training) -> Self {
        let alone = Self::of_fit(training.identification, &training.regression.lowered);
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

    /// Judges them by the test of lack of fit alone, where options `lowered` what the log would have without them.
    fn of_fit(identification: &Identification, lowered: &[Lowered]) -> Self {
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
            let whence = match Lowered::in_words(lowered) {
                None => "; armid diagnose looks for its cause.".to_owned(),
                Some(lowered) => format!(
                    ". {lowered}, which can be the whole cause: leave that out before armid diagnose looks for another."
                ),
            };
            format!(
                "The 95 % intervals are not to be trusted: the square of what repeats in the torque and is not explained{along} is \
                 {statistic:.2} times what {scatter} would leave (F test; {by_noise}). They cover the noise, not the \
                 error of the model{whence}"
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
