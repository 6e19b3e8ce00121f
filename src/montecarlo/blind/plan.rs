//! Plan of a blind benchmark: the `[blind]` table of a scenario, from which cases are drawn.

use serde::Deserialize;

use super::family::{FAMILIES, Family, JOINTS, Judged, ON_REQUEST};
use crate::diagnose::{Kind, candidates};
use crate::excitation::Excitation;
use crate::montecarlo::scenario::{MotionEntry, Scenario, ScenarioError, Source, fingerprint};
use crate::plant::{SensorConfig, Sensors};

/// A blind benchmark that has been read and checked.
#[derive(Debug, Clone)]
pub struct BlindPlan {
    /// Arm, plant, processing, seed and number of trials, and the first motion and sensors.
    pub base: Scenario,
    /// Motions, drawn with equal chances.
    pub motions: Vec<Motion>,
    /// Sensors, drawn with equal chances.
    pub sensors: Vec<SensorConfig>,
    /// Shares of the kinds of cases.
    pub shares: Shares,
    /// Range of √λ (or √λ_sim) of single effects, drawn uniformly on a logarithmic scale.
    pub sqrt_lambda: [f64; 2],
    /// The same for each of two effects, and for a change (√λ_sim) and the law beside it (√λ).
    pub sqrt_lambda_of_two: [f64; 2],
    /// The same for strong effects, as far as the physics of an effect allows.
    pub sqrt_lambda_of_strong: [f64; 2],
    /// Families from which hidden effects are drawn.
    pub families: Vec<Family>,
    /// Share of logs without effects that are compared with the nominal simulation.
    pub against_simulation: f64,
    /// Share of cases with one effect for which the gain is measured along another motion.
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

/// Shares of the kinds of cases; in the remaining cases nothing is hidden.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shares {
    /// One effect.
    pub one: f64,
    /// Two effects.
    pub two: f64,
    /// One effect whose family the diagnosis does not know.
    pub withheld: f64,
    /// A change that the null model absorbs and a law beside it, compared with the nominal simulation.
    #[serde(default)]
    pub beside: f64,
    /// One effect that is far stronger than the noise: what is named beside it comes from the model, not from chance.
    #[serde(default)]
    pub strong: f64,
}

/// The table as it is written in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::montecarlo) struct BlindEntry {
    shares: Shares,
    sqrt_lambda: [f64; 2],
    sqrt_lambda_of_two: [f64; 2],
    #[serde(default = "strong")]
    sqrt_lambda_of_strong: [f64; 2],
    against_simulation: f64,
    held_out: f64,
    /// Families to be hidden; if left out, all of [`FAMILIES`].
    families: Option<Vec<Kind>>,
    #[serde(default)]
    motion: Vec<MotionEntry>,
    #[serde(default)]
    sensors: Vec<SensorConfig>,
}

/// √λ of strong effects if a scenario says nothing else.
fn strong() -> [f64; 2] {
    [60.0, 500.0]
}

/// Round-off by which the sum of the shares may exceed 1: 0.33, 0.56 and 0.11 add up to 1.0000000000000002.
const ROUND_OFF: f64 = 1e-9;

impl Shares {
    pub(super) fn sum(self) -> f64 {
        self.one + self.two + self.withheld + self.beside + self.strong
    }

    /// Refuses a positive share of a kind of case that cannot be drawn from `families`.
    fn check(self, families: &[Family], source: &Source) -> Result<(), ScenarioError> {
        let known: Vec<Kind> = candidates::all().iter().map(|family| family.kind()).collect();
        let places = |wanted: &dyn Fn(&Family) -> bool| -> usize {
            families.iter().filter(|family| wanted(family)).map(|family| family.sites.len()).sum()
        };
        let laws = places(&|family| family.can_be_withheld(&known));
        let changes = places(&|family| family.judged == Judged::Simulation);
        let sized = places(&|family| family.judged != Judged::Record);
        let shares = [
            (
                "blind.shares.one",
                self.one,
                places(&|_| true) > 0,
                "needs a family in blind.families that can be hidden",
            ),
            (
                "blind.shares.two",
                self.two,
                laws > 1,
                "needs two places for effects of blind.families that the model does not absorb",
            ),
            (
                "blind.shares.withheld",
                self.withheld,
                laws > 0,
                "needs a family in blind.families that the model does not absorb",
            ),
            (
                "blind.shares.beside",
                self.beside,
                laws > 0 && changes > 0,
                "needs a family in blind.families that the model absorbs, and one that it does not",
            ),
            (
                "blind.shares.strong",
                self.strong,
                sized > 0,
                "needs a family in blind.families that is no fault of the record",
            ),
        ];
        for (key, share, can_be_drawn, requirement) in shares {
            source.check(share == 0.0 || can_be_drawn, key, share, requirement)?;
        }
        Ok(())
    }
}

impl BlindPlan {
    /// Checks `entry` and makes the plan. Its motions and sensors are those of `base` followed by those of `entry`.
    pub(in crate::montecarlo) fn new(
        mut base: Scenario,
        entry: BlindEntry,
        source: &Source,
    ) -> Result<Self, ScenarioError> {
        let Shares { one, two, withheld, beside, strong } = entry.shares;
        let shares = [
            ("blind.shares.one", one),
            ("blind.shares.two", two),
            ("blind.shares.withheld", withheld),
            ("blind.shares.beside", beside),
            ("blind.shares.strong", strong),
            ("blind.against_simulation", entry.against_simulation),
            ("blind.held_out", entry.held_out),
        ];
        for (key, value) in shares {
            source.check((0.0..=1.0).contains(&value), key, value, "must be between 0 and 1")?;
        }
        let sum = entry.shares.sum();
        let key = "blind.shares, their sum";
        source.check(sum <= 1.0 + ROUND_OFF, key, sum, "must not be above 1")?;
        let ranges = [
            ("blind.sqrt_lambda", entry.sqrt_lambda),
            ("blind.sqrt_lambda_of_two", entry.sqrt_lambda_of_two),
            ("blind.sqrt_lambda_of_strong", entry.sqrt_lambda_of_strong),
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
        entry.shares.check(&families, source)?;
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
        source.check(
            entry.held_out == 0.0 || motions.len() > 1,
            "blind.held_out",
            entry.held_out,
            "needs a [[blind.motion]]: gains are measured along another motion than the log's",
        )?;
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
            sqrt_lambda_of_strong: entry.sqrt_lambda_of_strong,
            families,
            against_simulation: entry.against_simulation,
            held_out: entry.held_out,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::montecarlo::Job;

    /// The error, if any, for a plan with this `[blind]` table.
    fn complaint(shares: &str, more: &str) -> Option<String> {
        let text = format!(
            r#"
            name = "plan"
            robot = "ur5"
            seed = 7
            trials = 1
            [motion]
            trajectory = "ur5_identification"
            periods = 4
            [sensors]
            torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]
            q_sd_rad = 2e-5
            qd_sd_rad_s = 1e-3
            [blind]
            shares = {{ {shares} }}
            sqrt_lambda = [10.0, 15.0]
            sqrt_lambda_of_two = [15.0, 25.0]
            against_simulation = 0.5
            {more}
            "#
        );
        Job::from_toml(&text, "plan").err().map(|error| error.to_string())
    }

    const OTHER: &str = "[[blind.motion]]\ntrajectory = \"ur5_validation\"\nperiods = 4";

    #[test]
    fn shares_add_up_to_one_but_for_round_off() {
        let of = |two: &str| {
            let shares = format!("one = 0.33, two = {two}, withheld = 0.11");
            complaint(&shares, "held_out = 0.0")
        };
        assert_eq!(of("0.56"), None);
        assert!(of("0.5601").unwrap().contains("their sum"));
    }

    #[test]
    fn what_cannot_be_drawn_is_told_when_the_plan_is_read() {
        let of = |shares: &str, families: &str| {
            complaint(shares, &format!("held_out = 0.0\nfamilies = [{families}]"))
        };
        let (one, two) = ("one = 1.0, two = 0.0", "one = 0.5, two = 0.5");
        let with = |shares: &str, more: &str| format!("{shares}, {more}");
        let none = "withheld = 0.0";
        assert_eq!(of(&with(one, none), "\"payload\""), None);
        assert_eq!(of(&with(two, none), "\"stribeck\""), None);
        // A tilted base can be hidden at one site only; a payload is absorbed by the null model.
        for family in ["\"base_tilt\"", "\"payload\""] {
            assert!(of(&with(two, none), family).unwrap().contains("blind.shares.two"));
        }
        let withheld = of("one = 0.5, two = 0.0, withheld = 0.5", "\"payload\"").unwrap();
        assert!(withheld.contains("blind.shares.withheld"), "{withheld}");
        let beside = with("one = 0.5, two = 0.0", "withheld = 0.0, beside = 0.5");
        assert!(of(&beside, "\"payload\"").unwrap().contains("blind.shares.beside"));
        assert_eq!(of(&beside, "\"payload\", \"stribeck\""), None);
        // Outliers have no size in units of the torque noise.
        let strong = with("one = 0.5, two = 0.0", "withheld = 0.0, strong = 0.5");
        assert!(of(&strong, "\"outliers\"").unwrap().contains("blind.shares.strong"));
        assert_eq!(of(&strong, "\"payload\""), None);
        assert!(of(&with(one, none), "").unwrap().contains("blind.shares.one"));
    }

    #[test]
    fn gains_need_another_motion() {
        let shares = "one = 1.0, two = 0.0, withheld = 0.0";
        let error = complaint(shares, "held_out = 0.5").unwrap();
        assert!(error.contains("needs a [[blind.motion]]"), "{error}");
        assert_eq!(complaint(shares, &format!("held_out = 0.5\n{OTHER}")), None);
    }
}
