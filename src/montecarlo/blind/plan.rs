//! What a blind benchmark draws from: the `[blind]` table of a scenario.

use serde::Deserialize;

use super::family::{FAMILIES, Family, JOINTS, ON_REQUEST};
use crate::diagnose::Kind;
use crate::excitation::Excitation;
use crate::montecarlo::scenario::{MotionEntry, Scenario, ScenarioError, Source, fingerprint};
use crate::plant::{SensorConfig, Sensors};

/// A blind benchmark that has been read and checked.
#[derive(Debug, Clone)]
pub struct BlindPlan {
    /// Arm, plant, processing, seed and number of trials; the first motion and the first sensors.
    pub base: Scenario,
    /// Motions, drawn with equal chances.
    pub motions: Vec<Motion>,
    /// Sensors, drawn with equal chances.
    pub sensors: Vec<SensorConfig>,
    /// What is hidden, and how often.
    pub shares: Shares,
    /// Range of √λ of single effects, drawn evenly on a logarithmic scale.
    pub sqrt_lambda: [f64; 2],
    /// The same for each of two effects, and for √λ_sim of a change beside a law.
    pub sqrt_lambda_of_two: [f64; 2],
    /// Families that are hidden.
    pub families: Vec<Family>,
    /// Share of clean logs that are compared with a simulation.
    pub against_simulation: f64,
    /// Share of cases with one effect whose gain is measured along another motion.
    pub held_out: f64,
}

/// A motion with its name.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Name of its trajectory.
    pub name: String,
    /// The motion.
    pub excitation: Excitation,
}

/// How often what is hidden; the rest of 1 is nothing.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shares {
    /// One effect.
    pub one: f64,
    /// Two effects.
    pub two: f64,
    /// One effect whose family the diagnosis does not know.
    pub withheld: f64,
    /// A change that the model absorbs and a law beside it, compared with the nominal simulation.
    #[serde(default)]
    pub beside: f64,
}

/// The table as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::montecarlo) struct BlindEntry {
    shares: Shares,
    sqrt_lambda: [f64; 2],
    sqrt_lambda_of_two: [f64; 2],
    against_simulation: f64,
    held_out: f64,
    /// Only these families are hidden; those that are drawn where left out.
    families: Option<Vec<Kind>>,
    #[serde(default)]
    motion: Vec<MotionEntry>,
    #[serde(default)]
    sensors: Vec<SensorConfig>,
}

impl BlindPlan {
    /// Checks `entry`; its motions and sensors are those of `base` and more.
    pub(in crate::montecarlo) fn new(
        mut base: Scenario,
        entry: BlindEntry,
        source: &Source,
    ) -> Result<Self, ScenarioError> {
        let Shares { one, two, withheld, beside } = entry.shares;
        let shares = [
            ("blind.shares.one", one),
            ("blind.shares.two", two),
            ("blind.shares.withheld", withheld),
            ("blind.shares.beside", beside),
            ("blind.shares, their sum", one + two + withheld + beside),
            ("blind.against_simulation", entry.against_simulation),
            ("blind.held_out", entry.held_out),
        ];
        for (key, value) in shares {
            source.check((0.0..=1.0).contains(&value), key, value, "must be between 0 and 1")?;
        }
        let ranges = [
            ("blind.sqrt_lambda", entry.sqrt_lambda),
            ("blind.sqrt_lambda_of_two", entry.sqrt_lambda_of_two),
        ];
        for (key, [low, high]) in ranges {
            source.check(low > 0.0, key, low, "must begin above 0")?;
            source.check(high > low && high.is_finite(), key, high, "must end above its begin")?;
        }
        let none = base.effects.is_empty();
        let hidden = base.effects.len() as f64;
        source.check(none, "effect", hidden, "tables are what a blind benchmark draws itself")?;
        let families: Vec<Family> = match &entry.families {
            None => FAMILIES.to_vec(),
            Some(kinds) => {
                let all = FAMILIES.iter().chain(&ON_REQUEST);
                all.filter(|family| kinds.contains(&family.kind)).copied().collect()
            }
        };
        let dof = base.arm.dof() as f64;
        let requirement = "is the number of joints of the robot; effects are hidden in arms of 6";
        source.check(base.arm.dof() == JOINTS, "robot", dof, requirement)?;
        let first = Motion { name: base.trajectory.clone(), excitation: base.excitation.clone() };
        let mut motions = vec![first];
        for motion in &entry.motion {
            let excitation = motion.excitation(&base.arm, source)?;
            base.sha256 = fingerprint([&base.sha256, &excitation.series().to_json()]);
            base.files.extend(motion.file(source));
            motions.push(Motion { name: motion.trajectory.clone(), excitation });
        }
        let mut sensors = vec![base.sensors.clone()];
        for config in entry.sensors {
            Sensors::new(&config, &base.arm, base.plant.log_rate_hz)?;
            sensors.push(config);
        }
        for config in &sensors {
            let sd = config.torque_sd_per_joint_nm(base.arm.dof())?;
            let least = sd.iter().copied().fold(f64::INFINITY, f64::min);
            let requirement = "must be positive: without noise nothing is too small to be seen";
            source.check(least > 0.0, "torque_sd_nm", least, requirement)?;
        }
        Ok(Self {
            base,
            motions,
            sensors,
            shares: entry.shares,
            sqrt_lambda: entry.sqrt_lambda,
            sqrt_lambda_of_two: entry.sqrt_lambda_of_two,
            families,
            against_simulation: entry.against_simulation,
            held_out: entry.held_out,
        })
    }
}
