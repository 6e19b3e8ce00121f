//! Cases: what a trial hides, drawn from the trial's own random numbers.

use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use rand::seq::IndexedRandom;
use serde::{Deserialize, Serialize};

use super::benchmark::{Benchmark, BlindError};
use super::family::{Family, Judged};
use super::plan::Shares;
use super::recipe::{Recipe, Surroundings, chance, log_uniform};
use crate::diagnose::Kind;
use crate::montecarlo::{EffectSize, Scenario, Simulation};
use crate::plant::NoiseModel;
use crate::plant::faults::Effect;
use crate::random::{Channel, TrialStreams};

/// Kinds of cases: how much is hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Secret {
    /// Nothing.
    Nothing,
    /// One effect.
    One,
    /// Two effects.
    Two,
    /// One effect whose family the diagnosis does not know.
    Withheld,
    /// A change of the arm, which the null model absorbs, and beside it a law, which it does not.
    Beside,
    /// One effect that is far stronger than the noise.
    Strong,
}

impl std::fmt::Display for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Nothing => "clean",
            Self::One => "one effect",
            Self::Two => "two effects",
            Self::Withheld => "family withheld",
            Self::Beside => "a change and a law",
            Self::Strong => "one strong effect",
        })
    }
}

/// One hidden effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hidden {
    /// Family.
    pub kind: Kind,
    /// Joint from 1; `None`: the arm as a whole.
    pub joint: Option<usize>,
    /// By what a diagnosis can see the effect.
    pub judged: Judged,
    /// √λ or √λ_sim (see `judged`) of this effect alone; `None` for faults of the record.
    pub strength: Option<f64>,
    /// The effect with its parameters.
    pub effect: Effect,
}

/// The truth of one trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Kind of the case.
    pub secret: Secret,
    /// Name of the trajectory.
    pub motion: String,
    /// Colour of the torque noise.
    pub noise: String,
    /// Whether the diagnosis is given the nominal simulation.
    pub against_simulation: bool,
    /// The hidden effects.
    pub hidden: Vec<Hidden>,
    /// √λ of all effects together along the log.
    pub sqrt_lambda: f64,
    /// √λ_sim of all effects together along the log.
    pub sqrt_lambda_sim: f64,
    /// For two effects: cosine of the angle between their whitened residuals under the null model.
    pub cosine: Option<f64>,
}

/// A site in words.
pub fn place(joint: Option<usize>) -> String {
    joint.map_or_else(|| "arm".into(), |j| format!("joint {j}"))
}

impl std::fmt::Display for Hidden {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} at {} (", self.kind, place(self.joint))?;
        for (k, (key, value)) in self.effect.parameters().iter().enumerate() {
            f.write_str(if k == 0 { "" } else { ", " })?;
            match value.as_f64() {
                Some(value) => write!(f, "{key} {value:.5}")?,
                None => write!(f, "{key} {value}")?,
            }
        }
        f.write_str(")")?;
        self.strength.map_or(Ok(()), |s| write!(f, ", √λ {s:.1}"))
    }
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let against = if self.against_simulation { ", against the nominal simulation" } else { "" };
        write!(f, "{}, {} noise{against}, {}", self.motion, self.noise, self.secret)?;
        self.hidden.iter().try_for_each(|hidden| write!(f, "\n  hidden: {hidden}"))
    }
}

/// Number of sizes tried for an effect whose √λ is not proportional to its size, before the last one is taken.
const PILOTS: usize = 3;
/// Draws of a law beside a change, which must not be the change itself; more only if a plan has nothing else to hide.
const ATTEMPTS: usize = 100;
/// A pilot whose √λ is within this share of the wanted one is good enough.
const CLOSE: f64 = 0.1;

/// A case with the simulation that makes its log.
pub(super) struct Drawn {
    pub case: Case,
    pub simulation: Simulation,
    pub motion: usize,
    /// Whether the gain is measured along another motion.
    pub measures_gain: bool,
}

/// Draws trial `trial` of `benchmark`.
pub(super) fn draw(benchmark: &Benchmark, trial: u64) -> Result<Drawn, BlindError> {
    let plan = &benchmark.plan;
    let streams = TrialStreams::new(plan.base.seed, plan.base.name.as_bytes(), trial);
    let mut rng = streams.stream(Channel::Case, 0);
    let secret = secret(&mut rng, plan.shares);
    let motion = rng.random_range(0..plan.motions.len());
    let sensors = rng.random_range(0..plan.sensors.len());
    let is_against = chance(&mut rng, plan.against_simulation);
    let measures_gain = chance(&mut rng, plan.held_out) && secret == Secret::One;
    let scenario = Scenario {
        excitation: plan.motions[motion].excitation.clone(),
        sensors: plan.sensors[sensors].clone(),
        ..plan.base.clone()
    };
    let mut case = Case {
        secret,
        motion: plan.motions[motion].name.clone(),
        noise: colour(&scenario.sensors.torque_noise).to_owned(),
        against_simulation: is_against && secret == Secret::Nothing,
        hidden: Vec::new(),
        sqrt_lambda: 0.0,
        sqrt_lambda_sim: 0.0,
        cosine: None,
    };
    if secret == Secret::Nothing {
        let simulation = benchmark.clean_simulation(scenario, motion)?;
        return Ok(Drawn { case, simulation, motion, measures_gain });
    }
    let mut maker = Maker { benchmark, scenario: &scenario, motion, rng: &mut rng };
    case.hidden = match secret {
        Secret::Two => maker.two()?,
        Secret::Beside => maker.beside()?,
        Secret::Strong => vec![maker.strong()?],
        _ => vec![maker.one(secret == Secret::Withheld, plan.sqrt_lambda)?],
    };
    case.against_simulation = case.hidden.iter().any(|h| h.judged == Judged::Simulation);
    let effects = case.hidden.iter().map(|h| h.effect.clone()).collect();
    let scenario = Scenario { effects, ..scenario };
    let simulation = Simulation::run(scenario)?;
    let size = simulation.size_beside(&benchmark.clean[motion])?;
    case.sqrt_lambda = size.lambda.sqrt();
    case.sqrt_lambda_sim = size.lambda_sim.sqrt();
    match &mut case.hidden[..] {
        [only] => only.strength = strength(only.judged, size),
        [a, b] if secret == Secret::Two => {
            if let (Some(a), Some(b)) = (a.strength, b.strength) {
                case.cosine = Some((size.lambda - a * a - b * b) / (2.0 * a * b));
            }
        }
        _ => {}
    }
    Ok(Drawn { case, simulation, motion, measures_gain })
}

fn secret(rng: &mut ChaCha8Rng, shares: Shares) -> Secret {
    let u: f64 = rng.random();
    match u {
        u if u < shares.one => Secret::One,
        u if u < shares.one + shares.two => Secret::Two,
        u if u < shares.one + shares.two + shares.withheld => Secret::Withheld,
        u if u < shares.one + shares.two + shares.withheld + shares.beside => Secret::Beside,
        u if u < shares.sum() => Secret::Strong,
        _ => Secret::Nothing,
    }
}

fn colour(noise: &NoiseModel) -> &'static str {
    if *noise == NoiseModel::white() { "white" } else { "coloured" }
}

/// √λ or √λ_sim, depending on what the effect is judged by.
fn strength(judged: Judged, size: EffectSize) -> Option<f64> {
    match judged {
        Judged::Residual => Some(size.lambda.sqrt()),
        Judged::Simulation => Some(size.lambda_sim.sqrt()),
        Judged::Record => None,
    }
}

/// Draws effects and finds the sizes that give them the wanted strength.
struct Maker<'a> {
    benchmark: &'a Benchmark,
    scenario: &'a Scenario,
    motion: usize,
    rng: &'a mut ChaCha8Rng,
}

impl Maker<'_> {
    /// One effect; if `withheld`, of a family that can be withheld.
    fn one(&mut self, withheld: bool, range: [f64; 2]) -> Result<Hidden, BlindError> {
        let benchmark = self.benchmark;
        self.hidden(&benchmark.open(|f| !withheld || benchmark.can_be_withheld(f)), range)
    }

    /// One strong effect. A fault of the record has no strength.
    fn strong(&mut self) -> Result<Hidden, BlindError> {
        let range = self.benchmark.plan.sqrt_lambda_of_strong;
        self.hidden(&self.benchmark.open(|f| f.judged != Judged::Record), range)
    }

    /// Two effects of different families or at different joints, both visible in the residual.
    fn two(&mut self) -> Result<Vec<Hidden>, BlindError> {
        let benchmark = self.benchmark;
        let range = benchmark.plan.sqrt_lambda_of_two;
        let open = benchmark.open(|f| benchmark.can_be_withheld(f));
        if open.iter().map(|family| family.sites.len()).sum::<usize>() < 2 {
            return Err(BlindError::NothingToHide);
        }
        let first = self.hidden(&open, range)?;
        loop {
            let second = self.hidden(&open, range)?;
            if (second.kind, second.joint) != (first.kind, first.joint) {
                return Ok(vec![first, second]);
            }
        }
    }

    /// A change, visible against a simulation, and a law, visible in the residual.
    fn beside(&mut self) -> Result<Vec<Hidden>, BlindError> {
        let benchmark = self.benchmark;
        let range = benchmark.plan.sqrt_lambda_of_two;
        let change = self.hidden(&benchmark.open(|f| f.judged == Judged::Simulation), range)?;
        for _ in 0..ATTEMPTS {
            let law = self.hidden(&benchmark.open(|f| benchmark.can_be_withheld(f)), range)?;
            if (law.kind, law.joint) != (change.kind, change.joint) {
                return Ok(vec![change, law]);
            }
        }
        Err(BlindError::NothingToHide)
    }

    /// An effect of one of `families` whose strength lies in `range`, as far as its physics allows.
    fn hidden(&mut self, families: &[&Family], range: [f64; 2]) -> Result<Hidden, BlindError> {
        let family = **families.choose(self.rng).ok_or(BlindError::NothingToHide)?;
        let joint = *family.sites.choose(self.rng).ok_or(BlindError::NothingToHide)?;
        let around = Surroundings {
            arm: &self.scenario.arm,
            clean_torque_nm: &self.benchmark.clean[self.motion].torque_nm,
            window_s: self.scenario.excitation.periodic_window_s(),
            sensors: &self.scenario.sensors,
        };
        let recipe = Recipe::draw(family.kind, joint, &around, self.rng);
        let wanted = log_uniform(self.rng, range);
        let (effect, strength) = self.sized(&family, &recipe, wanted)?;
        Ok(Hidden { kind: family.kind, joint, judged: family.judged, strength, effect })
    }

    /// The effect of `recipe` at a size whose strength is about `wanted`, and its strength as a pilot determined it, or
    /// as it follows from one: `None` for faults of the record, which have none.
    fn sized(
        &self,
        family: &Family,
        recipe: &Recipe,
        wanted: f64,
    ) -> Result<(Effect, Option<f64>), BlindError> {
        let mut size = recipe.start;
        for _ in 0..PILOTS {
            let effect = recipe.effect(size);
            let Some(found) = self.pilot(family.judged, effect)? else { break };
            let off = wanted / found;
            if (off - 1.0).abs() < CLOSE {
                return Ok((recipe.effect(size), Some(found)));
            }
            let next = (size * off.powf(1.0 / recipe.power)).clamp(recipe.least, recipe.most);
            if recipe.linear || next == size {
                return Ok((recipe.effect(next), Some(found * next / size)));
            }
            size = next;
        }
        let strength = self.pilot(family.judged, recipe.effect(size))?;
        Ok((recipe.effect(size), strength))
    }

    /// Strength of `effect` along the log. If the effect repeats, one period is run and the strength is multiplied by
    /// √P for P periods.
    fn pilot(&self, judged: Judged, effect: Effect) -> Result<Option<f64>, BlindError> {
        if judged == Judged::Record {
            return Ok(None);
        }
        let excitation = &self.scenario.excitation;
        let (periods, times) = match effect.repeats() {
            true => (1, excitation.periods() as f64),
            false => (excitation.periods(), 1.0),
        };
        let scenario = Scenario {
            excitation: excitation.clone().with_periods(periods),
            effects: vec![effect],
            ..self.scenario.clone()
        };
        let clean = &self.benchmark.clean[self.motion];
        let size = Simulation::run(scenario)?.size_beside(clean)?;
        Ok(strength(judged, size).map(|s| s * times.sqrt()))
    }
}
