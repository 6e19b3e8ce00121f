//! A body on the flange in terms of base parameters.

use super::super::image::{Image, Span};
use crate::base::BaseSet;
use crate::dynamics::{Parameter, ParameterLayout};

/// Number of inertial parameters of a body.
pub(super) const BODY: usize = 10;
/// How many of them are mass and first moments, which no body is without.
pub(super) const STATIC: usize = 4;

/// The ten inertial parameters of a body on the last link, as they show in the base parameters.
pub(super) struct Body {
    /// Each parameter in terms of base parameters; zero where the joints do not feel it, or where parameters before it
    /// have the same effect together.
    pub(super) terms: Vec<Vec<f64>>,
    /// Whether the joints tell each parameter from all others.
    pub(super) told: [bool; BODY],
}

impl Body {
    pub(super) fn new(set: &BaseSet, joints: usize) -> Self {
        let layout = ParameterLayout::new(joints);
        let of = |k: usize| {
            let mut standard = vec![0.0; layout.count()];
            standard[layout.index(Parameter::Body(joints - 1, k))] = 1.0;
            set.values(&standard)
        };
        Self::felt((0..BODY).map(of).collect())
    }

    /// Keeps those of `all` terms that are linearly independent of the ones before them, and sets the others to zero.
    fn felt(all: Vec<Vec<f64>>) -> Self {
        let image = |terms: &Vec<f64>| Image { mean: terms.clone(), contrast: Vec::new() };
        let images: Vec<Image> = all.iter().map(image).collect();
        let (_, taken) = Span::telling(&Span::default(), &images);
        let mut terms: Vec<Vec<f64>> = all.iter().map(|terms| vec![0.0; terms.len()]).collect();
        let mut told = [false; BODY];
        for (k, is_told) in taken {
            terms[k].clone_from(&all[k]);
            told[k] = is_told;
        }
        Self { terms, told }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::robot::Arm;

    fn told(joints: usize) -> [bool; BODY] {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints.truncate(joints);
        let set = BaseSet::find(&arm, Parameterisation::full(joints, false)).unwrap();
        Body::new(&set, joints).told
    }

    /// A vertical joint feels an inertia alone. A second joint across it, on the same point, also feels the moments in
    /// its plane, but no mass. Six joints feel all ten parameters.
    #[test]
    fn an_arm_tells_what_its_joints_feel_of_a_body() {
        assert_eq!(told(1)[..STATIC], [false; STATIC]);
        assert_eq!(told(2)[..STATIC], [false, true, true, false]);
        assert_eq!(told(6), [true; BODY]);
    }

    /// Of two parameters that the joints feel alike, neither is told, and the second is left out.
    #[test]
    fn what_adds_up_to_the_same_is_not_told() {
        let mut all = vec![vec![0.0; 3]; BODY];
        (all[0], all[1], all[2]) = (vec![1.0, 0.0, 0.5], vec![0.0, 2.0, 0.0], vec![0.0, -1.0, 0.0]);
        let Body { terms, told } = Body::felt(all.clone());
        assert_eq!(told[..3], [true, false, false]);
        assert_eq!(terms[..3], [all[0].clone(), all[1].clone(), vec![0.0; 3]]);
    }
}
