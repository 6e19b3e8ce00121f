//! A diagnosis in numbers: the body of its JSON.

use serde::Serialize;

use super::kind::Kind;
use super::misfit::SINCE_THE_START;
use super::payload::PayloadFinding;
use super::record_fault::RecordFault;
use super::replay::Replay;
use crate::identify::Doubt;

/// Schema of the diagnosis JSON.
pub const DIAGNOSE_SCHEMA: &str = "armid.diagnose/1";

/// A physical parameter with its interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// SI value.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// 95 % interval.
    pub ci95: [f64; 2],
}

impl Estimate {
    /// A value that is known exactly.
    pub(super) fn exact(value: f64, unit: &'static str) -> Self {
        Self { value, unit, ci95: [value, value] }
    }

    /// Whether the interval holds `value`.
    pub(super) fn holds(&self, value: f64) -> bool {
        self.ci95[0] <= value && value <= self.ci95[1]
    }

    /// Makes the interval hold `value`.
    pub(super) fn reach(&mut self, value: f64) {
        let [low, high] = self.ci95;
        self.ci95 = [low.min(value), high.max(value)];
    }

    /// Widens both halves of the interval by an independent error whose own 95 % half-width is `half`; the halves add
    /// in quadrature.
    pub(super) fn widen(&mut self, half: f64) {
        let [low, high] = self.ci95.map(|end| (end - self.value).hypot(half));
        self.ci95 = [self.value - low, self.value + high];
    }

    /// Makes both halves of the interval `factor` times as long.
    pub(super) fn stretch(&mut self, factor: f64) {
        self.ci95 = self.ci95.map(|end| self.value + factor * (end - self.value));
    }

    /// Multiplies the value and its interval by the positive `factor`.
    pub(super) fn scale(&mut self, factor: f64) {
        self.value *= factor;
        self.ci95 = self.ci95.map(|end| factor * end);
    }

    /// Moves the value and its interval by `change`.
    pub(super) fn shift(&mut self, change: f64) {
        self.value += change;
        self.ci95 = self.ci95.map(|end| end + change);
    }

    /// Raises the value and the ends of the interval to `least` where they lie below it.
    pub(super) fn keep_above(&mut self, least: f64) {
        self.value = self.value.max(least);
        self.ci95 = self.ci95.map(|end| end.max(least));
    }
}

/// A named cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cause {
    /// Family.
    pub kind: Kind,
    /// Joint (1-based); null for the arm as a whole.
    pub joint: Option<usize>,
    /// Names of the other kinds that these data cannot tell from this cause, with `@joint` behind where the joint
    /// differs.
    pub class: Vec<String>,
    /// Posterior probability that this cause or one of its class is there.
    pub confidence: f64,
    /// Physical parameters.
    pub parameters: std::collections::BTreeMap<&'static str, Estimate>,
    /// For a contact, the joint (1-based) that feels it most clearly, to which `peak_nm` refers; null for all other
    /// causes.
    pub peak_joint: Option<usize>,
    /// Share of the explainable mean square that the cause removes in periods to which its size was not fitted. Along a
    /// single run, the share of the joint's whole mean square beside the other causes that it removes in stretches of
    /// time left out of its fit. Null where no data were left for this.
    pub gain_fraction: Option<f64>,
    /// The experiment that would tell it from its class; null if the class is empty.
    pub separating_experiment: Option<&'static str>,
    /// √λ̂, the size of the effect in standard deviations of the noise.
    pub strength: f64,
    /// The effect in words.
    pub in_words: String,
    /// What a fault of the record did to the readings, by which the rest of the program knows it; none for other causes.
    /// The JSON says it in words.
    #[serde(skip)]
    pub record_fault: Option<RecordFault>,
    /// Which form of the family's law fits best; null for the usual form, and where the parameters say it.
    pub form: Option<&'static str>,
    /// Whether the cause is a law of one coefficient whose interval includes no effect at all; it is stated with a
    /// "may".
    pub may_be_none: bool,
    /// The families that came next, and by how much evidence (2 ln) they lost.
    pub rivals: Vec<Rival>,
}

/// A cause less likely than this is no answer.
const UNLIKELY: f64 = 1e-3;

/// Whether there are `causes` and all of them are [unlikely](Cause::is_unlikely). Chance does not explain such a log,
/// and no name is the answer.
pub(super) fn are_unlikely(causes: &[Cause]) -> bool {
    !causes.is_empty() && causes.iter().all(Cause::is_unlikely)
}

impl Cause {
    /// A cause with confidence 1, at joint `site` (from 0 on) or of the arm as a whole, that nothing else resembles.
    pub(super) fn certain(
        kind: Kind,
        site: Option<usize>,
        in_words: &str,
        strength: f64,
        parameters: &[(&'static str, Estimate)],
    ) -> Self {
        Self {
            kind,
            joint: site.map(|j| j + 1),
            class: Vec::new(),
            confidence: 1.0,
            parameters: parameters.iter().cloned().collect(),
            peak_joint: None,
            gain_fraction: None,
            separating_experiment: None,
            strength,
            in_words: in_words.to_owned(),
            record_fault: None,
            form: None,
            may_be_none: false,
            rivals: Vec::new(),
        }
    }

    /// A fault of the record of joint `site` (from 0 on) or of the arm as a whole, which is certain.
    pub(super) fn of_the_record(
        fault: RecordFault,
        site: Option<usize>,
        strength: f64,
        parameters: &[(&'static str, Estimate)],
    ) -> Self {
        let cause = Self::certain(fault.kind(), site, &fault.in_words(), strength, parameters);
        Self { record_fault: Some(fault), ..cause }
    }

    /// Whether the cause is less likely than one in a thousand: something else, which is no cause that could be named,
    /// explains the log better.
    pub fn is_unlikely(&self) -> bool {
        self.confidence < UNLIKELY
    }
}

/// A family that lost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rival {
    /// Family.
    pub kind: Kind,
    /// Joint (1-based).
    pub joint: Option<usize>,
    /// 2 ln of the odds against it.
    pub evidence_behind: f64,
}

/// An effect that the log shows and that no family explains.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    /// Quantity on which the effect depends most clearly.
    pub axis: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Joint (1-based).
    pub joint: usize,
    /// Whether it is told from noise only together with what other joints show; the joint is then the one that shows
    /// most.
    pub of_all_joints: bool,
    /// Rms of that dependence on this joint, Nm.
    pub rms_nm: f64,
    /// Points of the curve: value of the quantity and torque, Nm.
    pub curve: Vec<[f64; 2]>,
}

impl Unexplained {
    /// The joint (1-based) that it belongs to; `None` if it acts on the arm as a whole.
    pub(super) fn site(&self) -> Option<usize> {
        (!self.of_all_joints).then_some(self.joint)
    }

    /// The same with no more than the residual of its joint, whose rms per joint is `residual_nm`: the curve may hold a
    /// part that the parameters absorb. What does not repeat is not in the residual of the mean period.
    pub(super) fn at_most(mut self, residual_nm: &[f64]) -> Self {
        if self.axis != SINCE_THE_START {
            self.rms_nm = self.rms_nm.min(residual_nm[self.joint - 1]);
        }
        self
    }
}

/// Smallest effect of a family that this log would show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DetectionLimit {
    /// Family.
    pub kind: Kind,
    /// Joint (1-based).
    pub joint: Option<usize>,
    /// Name of the parameter.
    pub parameter: &'static str,
    /// Value that is found with probability `power`. Null where the null model or a named cause absorbs the effect, and
    /// where no effect can be that large.
    pub value: Option<f64>,
    /// SI unit.
    pub unit: &'static str,
    /// The effect's other parameters, SI, for which this value holds.
    pub given: std::collections::BTreeMap<&'static str, f64>,
    /// √λ of the effect at that value: its size in the torque outside the model, in standard deviations of the noise.
    pub sqrt_lambda: Option<f64>,
    /// Probability of detection at that value.
    pub power: f64,
}

/// Rms of residuals per joint, Nm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rms {
    /// Per joint, Nm.
    pub rms_nm: Vec<f64>,
}

/// The gain along a log that was not used for the fit; rms errors per joint, Nm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldOut {
    /// The log.
    pub log: String,
    /// What the user should know of how the log was processed.
    pub warnings: Vec<String>,
    /// What the noise of torque and motion contributes to the error of any model, all samples; null for a log that does
    /// not repeat.
    pub noise_rms_nm: Option<Vec<f64>>,
    /// The same, samples in which the joint moves.
    pub noise_moving_rms_nm: Option<Vec<f64>>,
    /// Without the causes, all samples.
    pub before_rms_nm: Vec<f64>,
    /// With the causes, all samples.
    pub after_rms_nm: Vec<f64>,
    /// Without the causes, samples in which the joint moves.
    pub before_moving_rms_nm: Vec<f64>,
    /// With the causes, samples in which the joint moves.
    pub after_moving_rms_nm: Vec<f64>,
    /// Without the causes, all samples, friction at standstill anywhere within ± Coulomb friction.
    pub before_standstill_free_rms_nm: Vec<f64>,
    /// With the causes, all samples, friction at standstill anywhere within ± Coulomb friction.
    pub after_standstill_free_rms_nm: Vec<f64>,
    /// The manufacturer's feed-forward, all samples; null where it is not logged.
    pub manufacturer_rms_nm: Option<Vec<f64>>,
    /// The manufacturer's feed-forward, samples in which the joint moves.
    pub manufacturer_moving_rms_nm: Option<Vec<f64>>,
    /// Without the causes, samples in which the joint moves, with Coulomb and viscous friction refitted to this log. It
    /// shows what the friction of another day costs, and is no gain.
    pub before_own_friction_rms_nm: Vec<f64>,
    /// With the causes, likewise.
    pub after_own_friction_rms_nm: Vec<f64>,
    /// Share of samples in which the joint stands still.
    pub standstill_fraction: Vec<f64>,
}

/// A base parameter of the simulation compared with the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    /// Base parameter.
    pub name: String,
    /// Value in the simulation.
    pub simulation: f64,
    /// Value in the data.
    pub data: f64,
    /// Standard deviation of the difference.
    pub sigma: f64,
    /// Difference over σ, converted from Student's t to the Gaussian deviate of equal probability, because the log
    /// gives σ only finite degrees of freedom.
    pub z: f64,
}

/// All base parameters of the simulation together compared with the data.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MovedTogether {
    /// dᵀV⁻¹d of the differences d with covariance V. Where nothing moved, its mean is the number of parameters.
    pub squared_distance: f64,
    /// b and ν: `squared_distance`/b, with b the number of parameters, is compared with F(b, ν), where ν are the
    /// degrees of freedom with which the noise is known.
    pub degrees_of_freedom: [f64; 2],
    /// Probability that noise alone makes the distance as large.
    pub p_value: f64,
}

/// A base parameter as estimated together with the causes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BaseParameter {
    /// Name, as in identification.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Standard deviation; NaN (null) where the causes leave nothing from which to tell it.
    pub sigma: f64,
}

/// The result of a diagnosis: the body of the JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The log.
    pub log: String,
    /// Rms noise of one sample per joint, from the scatter between periods, Nm; null for a single run.
    pub noise_floor_nm: Option<Vec<f64>>,
    /// What the noise of torque and motion contributes to the residual of any model, which is that of the mean period,
    /// per joint, Nm; null for a single run.
    pub noise_of_mean_nm: Option<Vec<f64>>,
    /// Residual of the model without causes.
    pub before: Rms,
    /// What was found.
    pub causes: Vec<Cause>,
    /// The effect that is there but not explained, if any.
    pub unexplained: Option<Unexplained>,
    /// What the causes of a joint leave because their laws are not exact, if it can be told from noise.
    pub form_error: Option<Unexplained>,
    /// Residual of the extended model.
    pub after: Rms,
    /// Base parameters of the extended model.
    pub base_parameters: Vec<BaseParameter>,
    /// Gains on other logs.
    pub held_out: Vec<HeldOut>,
    /// Base parameters compared with those of the simulation.
    pub moved_parameters: Vec<Moved>,
    /// All of them together; null for a single run, and without a simulation.
    pub moved_together: Option<MovedTogether>,
    /// A second log compared with this one.
    pub payload: Option<PayloadFinding>,
    /// The replay: the simulation compared with the logs, without and with the causes; null where it was not asked for
    /// or does not run.
    pub replay: Option<Replay>,
    /// Limits below which effects would not be seen.
    pub detection_limits: Vec<DetectionLimit>,
    /// Probability that noise alone leaves a residual this large behind the last cause; null for a single run.
    pub lack_of_fit_probability: Option<f64>,
    /// The result in one word.
    pub verdict: Verdict,
    /// Why the log may not be of this arm, or its parameters those of no arm; null if nothing speaks for that. The
    /// sentences begin with it.
    pub doubt: Option<Doubt>,
    /// The result in sentences.
    pub sentences: Vec<String>,
    /// Those of the sentences that are about single causes, if another sentence gives an overview of them; otherwise
    /// none. A page folds them.
    #[serde(skip)]
    pub behind_the_overview: Vec<String>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// The result of a diagnosis in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing was found that this log could show.
    NothingFound,
    /// Causes named; nothing is left but what their laws leave because they are not exact.
    CauseNamed,
    /// Something is left that no family explains, every cause is unlikely, or a second log differs by more than a body
    /// on the flange.
    Unexplained,
    /// No arm has the base parameters that were identified.
    Contradicted,
}

impl Verdict {
    /// The verdict on a log with these `causes`; whether something `is_left` that no family explains.
    pub(super) fn of(causes: &[Cause], is_left: bool) -> Self {
        match causes {
            _ if is_left || are_unlikely(causes) => Self::Unexplained,
            [] => Self::NothingFound,
            _ => Self::CauseNamed,
        }
    }
}

impl Diagnosis {
    /// Whether no arm has the base parameters that were identified.
    pub fn is_contradicted(&self) -> bool {
        self.verdict == Verdict::Contradicted
    }

    /// Adds the result of the replay, or a warning that says why there is none.
    pub fn add_replay<E: std::fmt::Display>(&mut self, replay: Result<Replay, E>) {
        match replay {
            Ok(replay) => {
                self.sentences.extend(replay.sentences());
                self.replay = Some(replay);
            }
            Err(error) => self.warnings.push(format!("nothing is replayed: {error}")),
        }
    }

    /// Adds what a second log says about a body on the flange. A difference comes before what the first log tells of the
    /// arm, behind a doubt whether it is this arm; what chance explains comes behind the causes.
    pub fn add_payload(&mut self, payload: PayloadFinding) {
        let cause = payload.cause();
        if self.verdict == Verdict::NothingFound && payload.differs() {
            self.verdict = if cause.is_some() { Verdict::CauseNamed } else { Verdict::Unexplained };
            let nothing_found = self.nothing_found();
            self.sentences.retain(|sentence| *sentence != nothing_found);
        }
        let noise_is_known = self.noise_floor_nm.is_some();
        let of_the_body = cause.iter().map(|c| c.sentence(noise_is_known));
        let of_the_body: Vec<String> = of_the_body.chain(payload.sentences()).collect();
        let at = match payload.differs() {
            true => usize::from(self.doubt.is_some()),
            false => self.sentences.len(),
        };
        self.sentences.splice(at..at, of_the_body);
        self.causes.extend(cause);
        self.payload = Some(payload);
    }
}

/// Whether the `class` of a cause at `site` holds `kind` at `joint`. Kinds on another joint than the cause's are
/// written with `@joint` behind.
pub fn class_holds(
    class: &[String],
    site: Option<usize>,
    kind: Kind,
    joint: Option<usize>,
) -> bool {
    let here = joint == site || joint.is_none();
    let elsewhere = joint.map(|j| format!("{kind}@{j}"));
    class.iter().any(|c| here && c == kind.name() || Some(c) == elsewhere.as_ref())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cause below one in a thousand is no name, alone or beside others of its like.
    #[test]
    fn what_is_unlikely_is_not_named() {
        let likely = Cause::certain(Kind::Elasticity, Some(0), "a soft gear", 5.9, &[]);
        let unlikely = Cause { confidence: 5e-4, ..likely.clone() };
        assert_eq!(Verdict::of(&[], false), Verdict::NothingFound);
        let alone = [unlikely.clone(), unlikely.clone()];
        assert_eq!(Verdict::of(&alone[..1], false), Verdict::Unexplained);
        assert_eq!(Verdict::of(&alone, false), Verdict::Unexplained);
        let beside = [unlikely, likely];
        assert_eq!(Verdict::of(&beside, false), Verdict::CauseNamed);
        assert_eq!([Verdict::of(&[], true), Verdict::of(&beside, true)], [Verdict::Unexplained; 2]);
    }
}
