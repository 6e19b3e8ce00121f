//! Checks whether the identified parameters are those of the stated arm, or of any arm at all.

use serde::{Serialize, Serializer};

use super::covariance::Covariance;
use super::gravity::gravity_remark;
use super::negative_friction::negative_friction_remark;
use super::negative_inertia::negative_inertia_remark;
use crate::base::BaseSet;
use crate::robot::{Arm, JointSignals};

/// Distance from zero, in σ, beyond which noise does not explain the sign of a parameter: noise alone turns a sign
/// with a probability of 3e-7.
pub(super) const CERTAIN: f64 = 5.0;

/// A reason to doubt that the identified parameters are those of the stated arm; in JSON, its sentence.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Doubt {
    /// Why they are those of no arm, or of no arm mounted as described.
    contradiction: Option<String>,
    /// What makes it likely that the log is of another arm, or of another load.
    question: Option<String>,
}

impl Serialize for Doubt {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.sentence())
    }
}

impl Doubt {
    /// A `sentence` that rules out that the parameters are those of the arm.
    pub fn contradiction(sentence: String) -> Self {
        Self { contradiction: Some(sentence), question: None }
    }

    /// A `sentence` that asks whether they are.
    pub(super) fn question(sentence: String) -> Self {
        Self { contradiction: None, question: Some(sentence) }
    }

    /// Whether no arm, or no arm mounted as described, has such parameters: drives that push, inertia that is negative,
    /// gravity that pulls the other way, or torque that has little to do with the motion. Otherwise the log may be of
    /// another arm, or of another load.
    pub fn is_contradiction(&self) -> bool {
        self.contradiction.is_some()
    }

    /// The doubt and its reason; to be stated before any result that depends on the parameters.
    pub fn sentence(&self) -> String {
        let parts: Vec<&str> = [&self.contradiction, &self.question]
            .into_iter()
            .flatten()
            .map(String::as_str)
            .collect();
        parts.join(" ")
    }

    /// Examines base parameters `theta` of `arm`, whose values by its description are `nominal`. `sigma` and
    /// `covariance` tell how well they are known; σ is infinite for a parameter that says nothing by itself. `q_rad`
    /// and `torque_nm` are the angles of the joints along the log and their torques (rms).
    pub fn of(
        (arm, set): (&Arm, &BaseSet),
        nominal: &[f64],
        theta: &[f64],
        sigma: &[f64],
        covariance: &Covariance,
        q_rad: &JointSignals,
        torque_nm: &[f64],
    ) -> Option<Self> {
        let gravity = gravity_remark(arm, set, nominal, theta, covariance);
        let pushing = negative_friction_remark(arm, set, theta, sigma, torque_nm);
        let is_reversed = gravity.as_ref().is_some_and(|g| g.is_reversed);
        // A model that has gravity the wrong way round cannot tell inertia.
        let inertia = negative_inertia_remark((arm, set), nominal, theta, sigma, covariance, q_rad)
            .filter(|_| !is_reversed);
        let impossible: Vec<String> = pushing.into_iter().chain(inertia).collect();
        let head = match (impossible.is_empty(), is_reversed) {
            (false, _) => Some("What was identified is physically impossible."),
            (true, true) => {
                Some("What was identified is impossible for an arm mounted as described.")
            }
            (true, false) => None,
        };
        let contradiction = head.map(|head| [vec![head.to_owned()], impossible].concat().join(" "));
        let question =
            gravity.map(|gravity| format!("Is this log of {}? The {}.", arm.name, gravity.text));
        let doubt = Self { contradiction, question };
        (doubt != Self::default()).then_some(doubt)
    }

    /// Combines a `doubt` about parameters with that of a log which is [`unlike`](super::unlike) the arm's. The latter
    /// comes first and replaces questions about parameters, which then mean nothing; a contradiction stays.
    pub fn or_unlike(doubt: Option<Self>, unlike: Option<Self>) -> Option<Self> {
        let Some(unlike) = unlike else { return doubt };
        let Some(own) = doubt.and_then(|doubt| doubt.contradiction) else { return Some(unlike) };
        let contradiction = match unlike.contradiction {
            Some(first) => format!("{first} {own}"),
            None => own,
        };
        Some(Self { contradiction: Some(contradiction), ..unlike })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::dynamics::Model;
    use crate::identify::covariance::CovarianceKind;
    use crate::identify::unlike;
    use nalgebra::DMatrix;

    #[test]
    fn another_arm_is_a_question_and_no_arm_a_contradiction() {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(6, true)).unwrap();
        let nominal = set.values(&Model::new(&arm).standard_parameters());
        let covariance = Covariance {
            kind: CovarianceKind::Spectral,
            matrix: DMatrix::identity(set.rank(), set.rank()) * 1e-6,
            degrees_of_freedom: f64::INFINITY,
        };
        let doubt = |theta: &[f64]| {
            let sigma = covariance.sigma();
            let q_rad = JointSignals::from_fn(6, 100, |j, k| (0.1 * ((j + 1) * k) as f64).sin());
            Doubt::of((&arm, &set), &nominal, theta, &sigma, &covariance, &q_rad, &[1.0; 6])
        };
        assert_eq!(doubt(&nominal), None);
        let scaled = |prefix: &str, factor: f64| -> Vec<f64> {
            let value = |k: usize| match set.name(k).starts_with(prefix) {
                true => factor * nominal[k],
                false => nominal[k],
            };
            (0..set.rank()).map(value).collect()
        };
        let larger = doubt(&scaled("m", 2.0)).unwrap();
        assert!(!larger.is_contradiction() && larger.sentence().starts_with("Is this log of ur5?"));
        let hanging = doubt(&scaled("m", -1.0)).unwrap();
        assert!(
            hanging
                .sentence()
                .starts_with("What was identified is impossible for an arm mounted as described")
        );
        assert!(hanging.is_contradiction() && hanging.sentence().contains("the other sign"));
        let pushing = doubt(&scaled("rc3", -1.0)).unwrap();
        assert!(pushing.is_contradiction() && pushing.sentence().contains("joint 3 (-"));
        assert!(!pushing.sentence().contains("Is this log"), "{pushing:?}");
        let light = doubt(&scaled("Ia3", -1.0)).unwrap();
        assert!(light.is_contradiction() && light.sentence().contains("which no arm has: joint 3"));

        // Of a log that is unlike the arm's, only contradictions by parameters are told as well.
        let much = unlike(&arm, &[0.3; 6]);
        assert_eq!(Doubt::or_unlike(Some(larger), much.clone()), much);
        let both = Doubt::or_unlike(Some(pushing.clone()), much.clone()).unwrap();
        assert!(both.is_contradiction(), "{both:?}");
        assert_eq!(
            both.sentence(),
            format!("{} {}", pushing.sentence(), much.clone().unwrap().sentence())
        );
        let most = unlike(&arm, &[0.6; 6]).unwrap();
        let both = Doubt::or_unlike(Some(pushing.clone()), Some(most.clone())).unwrap();
        assert_eq!(both.sentence(), format!("{} {}", most.sentence(), pushing.sentence()));
        assert_eq!(Doubt::or_unlike(Some(pushing.clone()), None), Some(pushing));
    }
}
