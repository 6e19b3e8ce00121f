//! Whether what was identified is the arm that it is said to be, or any.

use super::covariance::Covariance;
use super::gravity::gravity_remark;
use super::negative_friction::negative_friction_remark;
use crate::base::BaseSet;
use crate::robot::Arm;

/// σ from none from which on noise is no excuse for a sign: of all joints of a hundred thousand arms it turns one.
pub(super) const CERTAIN: f64 = 5.0;

/// A reason not to take what was identified for what it is said to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubt {
    /// Whether no arm at all has it, or none that is mounted as described: drives that push, or gravity that pulls the other way. Else
    /// it may be another arm, or another load.
    pub is_contradiction: bool,
    /// What is doubted and why, to be said before anything that rests on it.
    pub sentence: String,
}

impl Doubt {
    /// Of base parameters `theta` of `arm`, which are `nominal` by its description, known to `sigma` and with the `covariance` that
    /// they have among each other, from a log in which joints need `torque_nm` (rms). (Of a parameter that says nothing by itself, σ is
    /// infinite.)
    pub fn of(
        arm: &Arm,
        set: &BaseSet,
        nominal: &[f64],
        theta: &[f64],
        sigma: &[f64],
        covariance: &Covariance,
        torque_nm: &[f64],
    ) -> Option<Self> {
        let gravity = gravity_remark(arm, set, nominal, theta, covariance);
        let pushing = negative_friction_remark(arm, set, theta, sigma, torque_nm);
        let is_reversed = gravity.as_ref().is_some_and(|g| g.is_reversed);
        let head = match (&pushing, is_reversed) {
            (Some(_), _) => Some("What was identified is physically impossible."),
            (None, true) => {
                Some("What was identified is impossible for an arm mounted as described.")
            }
            (None, false) => None,
        };
        let head = head.map(str::to_owned);
        let is_contradiction = head.is_some();
        let question =
            gravity.map(|gravity| format!("Is this log of {}? The {}.", arm.name, gravity.text));
        let parts: Vec<String> = head.into_iter().chain(pushing).chain(question).collect();
        (!parts.is_empty()).then(|| Self { is_contradiction, sentence: parts.join(" ") })
    }

    /// Of a log of which the model leaves so much that there is a `remark` about it, what else is asked about parameters means nothing; what
    /// no arm has stays said.
    pub fn or_unlike(doubt: Option<Self>, remark: Option<String>) -> Option<Self> {
        match (doubt, remark) {
            (Some(doubt), _) if doubt.is_contradiction => Some(doubt),
            (_, Some(sentence)) => Some(Self { is_contradiction: false, sentence }),
            (doubt, None) => doubt,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::dynamics::Model;
    use crate::identify::covariance::CovarianceKind;
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
            Doubt::of(&arm, &set, &nominal, theta, &sigma, &covariance, &[1.0; 6])
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
        assert!(!larger.is_contradiction && larger.sentence.starts_with("Is this log of ur5?"));
        let hanging = doubt(&scaled("m", -1.0)).unwrap();
        assert!(
            hanging
                .sentence
                .starts_with("What was identified is impossible for an arm mounted as described")
        );
        assert!(hanging.is_contradiction && hanging.sentence.contains("the other sign"));
        let pushing = doubt(&scaled("rc3", -1.0)).unwrap();
        assert!(pushing.is_contradiction && pushing.sentence.contains("joint 3 (-"));
        assert!(!pushing.sentence.contains("Is this log"), "{pushing:?}");
    }
}
