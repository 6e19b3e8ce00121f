//! What a diagnosis says, in numbers and in words.

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
    /// `value ± half unit`, or with both ends where they are far from even.
    fn in_words(&self) -> String {
        let [low, high] = self.ci95;
        let (below, above) = (self.value - low, high - self.value);
        if self.says_nothing() {
            let [low, high] = [low, high].map(|v| digits(v, 2));
            return format!("hardly known (between {low} and {high}) {}", self.unit)
                .trim_end()
                .to_owned();
        }
        if above > UNEVEN * below || below > UNEVEN * above {
            let [value, low, high] = [self.value, low, high].map(|v| digits(v, 2));
            return format!("{value} (between {low} and {high}) {}", self.unit)
                .trim_end()
                .to_owned();
        }
        pair(self.value, 0.5 * (high - low), self.unit)
    }

    /// Whether the interval spans a whole turn, or a factor of a thousand.
    fn says_nothing(&self) -> bool {
        let [low, high] = self.ci95;
        self.unit == "rad" && high - low > std::f64::consts::TAU || low > 0.0 && high > VAST * low
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

/// Ends of an interval between which nothing is known.
const VAST: f64 = 1000.0;

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
    /// The families that came next, and by how much evidence (2 ln) they lost.
    pub rivals: Vec<Rival>,
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
    /// the effect.
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
    /// Difference over σ.
    pub z: f64,
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
}

impl Diagnosis {
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

    /// The first screen; `laws` are the sites of the extended model's effects: joint (1-based), or the arm as a whole.
    pub(super) fn in_sentences(&self, laws: &[Option<usize>]) -> Vec<String> {
        let mut out: Vec<String> =
            self.causes.iter().map(|c| c.sentence(self.noise_floor_nm.is_some())).collect();
        if let Some(unexplained) = &self.unexplained {
            out.push(format!(
                "Joint {} shows {} Nm (rms) that no known effect explains; it depends most clearly on the {}.",
                unexplained.joint,
                digits(unexplained.rms_nm, 2),
                unexplained.axis
            ));
        }
        if out.is_empty() {
            out.push(self.nothing_found().into());
        }
        out.extend(self.moved());
        let along =
            |held_out| self.does_not_carry_over(held_out).or_else(|| gain_along(held_out, laws));
        out.extend(self.held_out.iter().filter_map(along));
        out
    }
}

/// An interval that reaches so much farther to one side than to the other is told by its ends.
const UNEVEN: f64 = 1.2;
/// What is less sure than this is said with a "may".
const EVEN_ODDS: f64 = 0.5;
/// σ beyond which a parameter differs from a simulation: noise shows one in 300 comparisons of fifty parameters.
const MOVED: f64 = 4.0;
/// Times the error along the log from which on the error along another one is none of the same arm.
const OF_ANOTHER_ARM: f64 = 3.0;

impl Diagnosis {
    /// The sentence where nothing is named.
    fn nothing_found(&self) -> &'static str {
        match self.noise_floor_nm {
            Some(_) => {
                "Nothing found: what the model leaves is noise, as the scatter between periods shows; the detection \
                 limits say what would have been seen. What only moves the parameters (a body on the flange, gravity, \
                 a longer link) shows beside a simulation (--sim) or a second log."
            }
            None => {
                "Nothing found above what a single run can show; the motion does not repeat, so that the noise is \
                 judged from the residual itself."
            }
        }
    }

    /// The sentence about the parameters beside those of a simulation.
    fn moved(&self) -> Option<String> {
        let far = |a: &&Moved, b: &&Moved| a.z.abs().total_cmp(&b.z.abs());
        let farthest = self.moved_parameters.iter().max_by(far)?;
        let moved = self.moved_parameters.iter().filter(|m| m.z.abs() > MOVED).count();
        Some(format!(
            "Beside the simulation {moved} of {} base parameters differ by more than {MOVED} σ; {} differs most, by {} σ.",
            self.moved_parameters.len(),
            farthest.name,
            digits(farthest.z.abs(), 2),
        ))
    }

    /// The sentence about a log along which the model errs far more, friction at standstill left open.
    fn does_not_carry_over(&self, held_out: &HeldOut) -> Option<String> {
        let noise = |j: usize| self.noise_floor_nm.as_ref().map_or(0.0, |noise| noise[j]);
        let expected = self.after.rms_nm.iter().enumerate().map(|(j, rms)| rms.hypot(noise(j)));
        let (j, times) = held_out
            .after_standstill_free_rms_nm
            .iter()
            .zip(expected)
            .map(|(found, expected)| found / expected)
            .enumerate()
            .filter(|(_, times)| *times > OF_ANOTHER_ARM)
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(format!(
            "The model does not carry over to {}: on joint {} it errs {times:.0} times as much there. Another load, \
             another gain, or a motion that shows what this log does not.",
            held_out.log,
            j + 1
        ))
    }
}

/// The sentence about what `laws` at these sites change along another log while joints move, on the joint with one of which
/// they change most. What only moved the parameters is in both models, and what happened once in none.
fn gain_along(held_out: &HeldOut, laws: &[Option<usize>]) -> Option<String> {
    let has_law = |j: usize| laws.iter().any(|joint| joint.is_none_or(|joint| joint == j + 1));
    let HeldOut { before_moving_rms_nm, after_moving_rms_nm, .. } = held_out;
    let both = before_moving_rms_nm.iter().zip(after_moving_rms_nm).enumerate();
    let told = both.filter(|(j, (before, after))| has_law(*j) && **before > 0.0 && **after > 0.0);
    let (j, (before, after)) = told.max_by(|(_, a), (_, b)| {
        let change = |(before, after): (&f64, &f64)| (before / after).ln().abs();
        change(*a).total_cmp(&change(*b))
    })?;
    Some(format!(
        "Along {} the error of joint {} while it moves, noise included, is {} Nm rms with what is named and {} Nm \
         without.",
        held_out.log,
        j + 1,
        digits(*after, 3),
        digits(*before, 3)
    ))
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

impl Cause {
    fn sentence(&self, noise_is_known: bool) -> String {
        match self.kind {
            Kind::Contact => return self.contact_sentence(),
            Kind::Payload => return self.payload_sentence(),
            _ => {}
        }
        let place = self.joint.map_or("The model".to_owned(), |j| format!("Joint {j}'s model"));
        let what = format!("{}{}", self.in_words, self.numbers());
        let mut text = match (self.kind.is_of_the_record(), self.joint) {
            (true, None) => format!("The record has {what}."),
            (true, Some(j)) => format!("Joint {j}'s record has {what}."),
            (false, _) if self.confidence < EVEN_ODDS => {
                format!("{place} may miss {what}; other causes fit as well.")
            }
            (false, _) => format!("{place} misses {what}."),
        };
        if let Some(gain) = self.gain_fraction {
            let of = if noise_is_known {
                "of what the noise floor leaves to explain, in other periods of this log than its size is fitted to"
            } else {
                "of the error's mean square, in stretches of time left out of its fit"
            };
            text += &format!(" Adding it removes {:.0} % {of}.", 100.0 * gain.clamp(0.0, 1.0));
        }
        if !self.class.is_empty() {
            let class = self.class.join(", ");
            text += &format!(" These data cannot tell it from {class}");
            if let Some(experiment) = self.separating_experiment {
                text += &format!("; this would: {experiment}");
            }
            text.push('.');
        }
        text
    }
}

impl Cause {
    fn contact_sentence(&self) -> String {
        let value = |name: &str| self.parameters.get(name).map_or(f64::NAN, |e| e.value);
        format!("From {:.2} s to {:.2} s {}.", value("start_s"), value("end_s"), self.in_words)
    }

    /// The parameters in brackets, with a blank before; nothing where none is told.
    fn numbers(&self) -> String {
        let number = |(name, e): (&&str, &Estimate)| {
            let name = name.trim_end_matches(&unit_suffix(e.unit)).replace('_', " ");
            format!("{name} {}", e.in_words())
        };
        match self.parameters.iter().map(number).collect::<Vec<_>>().join(", ") {
            numbers if numbers.is_empty() => numbers,
            numbers => format!(" ({numbers})"),
        }
    }

    fn payload_sentence(&self) -> String {
        let pair = |name: &str| {
            let estimate = self.parameters.get(name)?;
            Some((estimate.value, 0.25 * (estimate.ci95[1] - estimate.ci95[0])))
        };
        let Some((mass, mass_sigma)) = pair("mass_kg") else {
            let numbers = self.numbers();
            return format!(
                "The flange carries something else{numbers}; these motions cannot tell its mass."
            );
        };
        let which = if mass < 0.0 { "missing from" } else { "on" };
        let mass = mass.abs();
        let com = ["com_x_m", "com_y_m", "com_z_m"].map(pair);
        let four = |told: Option<f64>| told.map_or("?".to_owned(), |value| format!("{value:.4}"));
        let place = com.map(|com| four(com.map(|(value, _)| value))).join(", ");
        let sigma = com.map(|com| four(com.map(|(_, sigma)| sigma))).join(", ");
        format!(
            "A body of {mass:.3} ± {mass_sigma:.3} kg at ({place}) ± ({sigma}) m {which} the flange (± one σ, last \
             joint's frame)."
        )
    }
}

/// The unit as parameter names carry it, such as `_nm`.
fn unit_suffix(unit: &str) -> String {
    format!("_{}", unit.to_lowercase().replace(['/', ' '], "_").replace("1_", "per_"))
}

/// With so many digits, or more before the point.
fn digits(value: f64, count: usize) -> String {
    if value.abs() >= 1e6 {
        return format!("{value:.1e}");
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals =
        (count as f64 - 1.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// `value ± half unit`, digits by the uncertainty.
fn pair(value: f64, half: f64, unit: &str) -> String {
    if !value.is_finite() || !half.is_finite() || half <= 0.0 {
        return format!("{value:.3} {unit}").trim_end().to_owned();
    }
    let decimals = (1.0 - half.log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$} ± {half:.decimals$} {unit}").trim_end().to_owned()
}
