//! What a diagnosis says, in numbers.

use serde::Serialize;

use super::kind::Kind;
use super::payload::PayloadFinding;
use super::replay::Replay;

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
    /// Whether the interval holds `value`.
    pub(super) fn holds(&self, value: f64) -> bool {
        self.ci95[0] <= value && value <= self.ci95[1]
    }

    /// Makes the interval hold `value`.
    pub(super) fn reach(&mut self, value: f64) {
        let [low, high] = self.ci95;
        self.ci95 = [low.min(value), high.max(value)];
    }

    /// Both halves of the interval made longer by an error of their own kind, of which `half` is 95 %.
    pub(super) fn widen(&mut self, half: f64) {
        let [low, high] = self.ci95.map(|end| (end - self.value).hypot(half));
        self.ci95 = [self.value - low, self.value + high];
    }

    /// What lies below `least` is taken for `least`.
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
    /// What these data cannot tell from it, itself left out: kind, with `@joint` where the joint differs.
    pub class: Vec<String>,
    /// Posterior probability of the class.
    pub confidence: f64,
    /// Physical parameters.
    pub parameters: std::collections::BTreeMap<&'static str, Estimate>,
    /// Joint (1-based) of which `peak_nm` of a contact is: the one that feels it most clearly; null for all else.
    pub peak_joint: Option<usize>,
    /// Share of the explainable mean square that it removes, in other periods than its size is fitted to; along a single
    /// run of the joint's whole mean square beside the other causes, in stretches of time left out of its
    /// fit. Null where no data were left for that.
    pub gain_fraction: Option<f64>,
    /// What would separate it from its class; null where nothing has to be separated.
    pub separating_experiment: Option<&'static str>,
    /// √λ̂: size in standard deviations of the noise.
    pub strength: f64,
    /// The effect in words.
    pub in_words: String,
    /// Which form of the family's law fits best; null for the usual one, and where parameters say it.
    pub form: Option<&'static str>,
    /// Whether it is a law of one coefficient whose size may be none by its interval: said with a "may".
    pub may_be_none: bool,
    /// The families that came next, and by how much evidence (2 ln) they lost.
    pub rivals: Vec<Rival>,
}

/// Names less likely than this are no answer.
const UNLIKELY: f64 = 1e-3;

impl Cause {
    /// Whether it is less likely than one in a thousand: something else explains the log better, and is no cause that could be named.
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

/// Something is there and no family explains it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    /// Quantity on which it depends most clearly.
    pub axis: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Joint (1-based).
    pub joint: usize,
    /// Size of that dependence, Nm.
    pub rms_nm: f64,
    /// Axis value and torque, Nm, of the curve.
    pub curve: Vec<[f64; 2]>,
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
    /// Value that is found with probability `power`; null where the null model, or a cause that was named, absorbs
    /// the effect, or where no effect is that large.
    pub value: Option<f64>,
    /// SI unit.
    pub unit: &'static str,
    /// The effect's other parameters, SI, for which this holds.
    pub given: std::collections::BTreeMap<&'static str, f64>,
    /// √λ of the effect at that value: what it does to the torque, in units of the noise and outside the model.
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

/// How much is gained on a log that was not used.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldOut {
    /// The log.
    pub log: String,
    /// What was made of it that the user should know.
    pub warnings: Vec<String>,
    /// What noise of torque and motion leaves of any model's error, all samples; null where nothing repeats.
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
    /// Without the causes, samples in which the joint moves, had its Coulomb and viscous friction been
    /// fitted to this log: shows what friction of another day costs, and is no gain.
    pub before_own_friction_rms_nm: Vec<f64>,
    /// With the causes, likewise.
    pub after_own_friction_rms_nm: Vec<f64>,
    /// Share of samples in which the joint stands still.
    pub standstill_fraction: Vec<f64>,
}

/// A parameter of the simulation against the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    /// Base parameter.
    pub name: String,
    /// In the simulation.
    pub simulation: f64,
    /// In the data.
    pub data: f64,
    /// Of the difference.
    pub sigma: f64,
    /// Difference over σ, as the Gaussian deviate that is as improbable: σ is known with the degrees of freedom that the log gives it.
    pub z: f64,
}

/// All parameters of the simulation together against the data.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MovedTogether {
    /// dᵀV⁻¹d of the differences d with their covariance V: as many as there are parameters on average where nothing moved.
    pub squared_distance: f64,
    /// b and ν: over b, the number of parameters, it is compared with F(b, ν), ν what the noise is known with.
    pub degrees_of_freedom: [f64; 2],
    /// Probability that noise alone carries them so far.
    pub p_value: f64,
}

/// A base parameter beside the causes that were found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BaseParameter {
    /// Name, as in identification.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// σ; NaN (null) where the causes leave nothing to tell it by.
    pub sigma: f64,
}

/// The result of a diagnosis: the body of the JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The log.
    pub log: String,
    /// Rms noise of one sample per joint from the scatter between periods, Nm; null for a single run.
    pub noise_floor_nm: Option<Vec<f64>>,
    /// What noise of torque and motion leaves of any model's residual, which is that of the mean of the periods, Nm; null for a
    /// single run.
    pub noise_of_mean_nm: Option<Vec<f64>>,
    /// Residual of the model without causes.
    pub before: Rms,
    /// What was found.
    pub causes: Vec<Cause>,
    /// What is there but not explained.
    pub unexplained: Option<Unexplained>,
    /// Residual of the extended model.
    pub after: Rms,
    /// Base parameters of the extended model.
    pub base_parameters: Vec<BaseParameter>,
    /// Gains on other logs.
    pub held_out: Vec<HeldOut>,
    /// Parameters against the simulation.
    pub moved_parameters: Vec<Moved>,
    /// All of them together; null for a single run, and without a simulation.
    pub moved_together: Option<MovedTogether>,
    /// A second log against this one.
    pub payload: Option<PayloadFinding>,
    /// The simulation against the logs, without and with the causes; null where it was not asked for or
    /// does not run.
    pub replay: Option<Replay>,
    /// What would not be seen.
    pub detection_limits: Vec<DetectionLimit>,
    /// Probability that noise alone leaves this much behind the last cause; null for a single run.
    pub lack_of_fit_probability: Option<f64>,
    /// In one word.
    pub verdict: Verdict,
    /// In sentences.
    pub sentences: Vec<String>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// In one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing that the log could show.
    NothingFound,
    /// Causes named, nothing left over.
    CauseNamed,
    /// Something is left that no family explains.
    Unexplained,
    /// No arm has the base parameters that were identified.
    Contradicted,
}

impl Diagnosis {
    /// Whether no arm has what was identified.
    pub fn is_contradicted(&self) -> bool {
        self.verdict == Verdict::Contradicted
    }

    /// Takes in what the simulation says, or why it says nothing.
    pub fn add_replay<E: std::fmt::Display>(&mut self, replay: Result<Replay, E>) {
        match replay {
            Ok(replay) => {
                self.sentences.extend(replay.sentences());
                self.replay = Some(replay);
            }
            Err(error) => self.warnings.push(format!("nothing is replayed: {error}")),
        }
    }

    /// Takes in what a second log says about a body on the flange.
    pub fn add_payload(&mut self, payload: PayloadFinding) {
        let cause = payload.cause();
        if let (Verdict::NothingFound, Some(_)) = (self.verdict, &cause) {
            self.verdict = Verdict::CauseNamed;
            let nothing_found = self.nothing_found();
            self.sentences.retain(|sentence| sentence != nothing_found);
        }
        let noise_is_known = self.noise_floor_nm.is_some();
        self.sentences.extend(cause.iter().map(|c| c.sentence(noise_is_known)));
        self.sentences.extend(payload.sentences());
        self.causes.extend(cause);
        self.payload = Some(payload);
    }
}

/// Whether a `class` (of a cause at `site`) holds `kind` at `joint`: kinds at another joint than the cause's have it behind
/// an @.
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
