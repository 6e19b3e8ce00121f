//! Distribution of the identified inertia of a body among its links.

use std::fmt;

use nalgebra::Matrix4;

use crate::number::significant;
use crate::robot::export::xml::about_com;
use crate::robot::inertia::principal_moments;
use crate::robot::{Joint, LinkInertia, UrdfLink};

/// A remaining mass below this fraction of the body's mass counts as round-off.
const ROUND_OFF: f64 = 1e-9;
/// Fraction s of the body that its bearer has at least where the other links are scaled. With t* the largest possible
/// factor of these, P that of the body and K that of the links (pseudo-inertias), P − (1 − s) t* K = s P + (1 − s)(P −
/// t* K), and the last term is positive semidefinite: the bearer is as far from impossible as s times the body.
const LEAST_OF_BEARER: f64 = 0.01;

/// The links of a body with the shares of its identified inertia that differ from the file.
pub(super) struct Share<'a> {
    /// The bearer: the link that gets what the others leave.
    pub bearer: &'a UrdfLink,
    /// The inertia it is given, about its own frame.
    pub inertia: LinkInertia,
    /// The other links with the inertia that each is given, about its own frame; empty where they keep theirs.
    pub scaled: Vec<(&'a UrdfLink, LinkInertia)>,
    /// Set where the other links cannot keep their inertia.
    pub rescaling: Option<Rescaling>,
}

/// A body whose identified inertia does not allow the links fixed to it to keep what the file gives them: theirs is
/// multiplied by one factor. None of them loses its mass, since a link that is fixed (or locked) for this arm may move
/// in another program.
#[derive(Debug, Clone, PartialEq)]
pub struct Rescaling {
    /// The joint that moves the body.
    pub joint: String,
    /// The identified mass, kg.
    pub body_kg: f64,
    /// The link that gets what the others leave.
    pub link: String,
    /// The other links, with the mass that the file gives to each, kg.
    pub others: Vec<(String, f64)>,
    /// The factor of their inertia (mass and moments), above 0 and below 1: 99 % of the largest one that leaves an
    /// inertia that a body can have.
    pub factor: f64,
    /// Why the other links cannot keep theirs.
    pub why: Unfit,
}

/// Reason why no body can have the remaining inertia.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unfit {
    /// Its mass is not positive.
    Mass {
        /// The mass, kg.
        mass_kg: f64,
    },
    /// A principal moment of inertia is not positive, or not less than the sum of the others.
    Moments {
        /// Its mass.
        mass_kg: f64,
        /// Principal moments about the centre of mass, ascending.
        principal_kg_m2: [f64; 3],
    },
}

impl<'a> Share<'a> {
    /// The share for the body of `joint`, which consists of `links`; `None` without any.
    ///
    /// The bearer is the link directly behind the joint. It gets the identified inertia less what the file gives to the
    /// other links. If it has no inertia in the file (a mere named frame), the next link that has one is the bearer.
    pub(super) fn of(joint: &Joint, links: &[&'a UrdfLink]) -> Option<Self> {
        let first = links.iter().copied().find(|link| link.is_first)?;
        let bearer = if first.inertia.is_some() {
            first
        } else {
            links.iter().copied().find(|link| link.inertia.is_some()).unwrap_or(first)
        };
        let others: Vec<(&UrdfLink, LinkInertia)> = links
            .iter()
            .filter(|link| link.name != bearer.name)
            .filter_map(|link| Some((*link, link.inertia?)))
            .collect();
        let kept = others.iter().fold(LinkInertia::zero(), |sum, (link, inertia)| {
            sum.plus(&inertia.transformed(&link.placement))
        });
        let to_bearer = bearer.placement.inverse();
        let body_kg = joint.link.mass_kg();
        let rest = joint.link.minus(&kept).transformed(&to_bearer);
        let Some(why) = unfit(&rest, body_kg).filter(|_| !others.is_empty()) else {
            return Some(Self { bearer, inertia: rest, scaled: Vec::new(), rescaling: None });
        };
        let factor = (1.0 - LEAST_OF_BEARER) * largest_factor(&joint.link, &kept).min(1.0);
        let rescaling = Rescaling {
            joint: joint.name.clone(),
            body_kg,
            link: bearer.name.clone(),
            others: others.iter().map(|(link, i)| (link.name.clone(), i.mass_kg())).collect(),
            factor,
            why,
        };
        Some(Self {
            bearer,
            inertia: joint.link.minus(&kept.scaled(factor)).transformed(&to_bearer),
            scaled: others.into_iter().map(|(link, i)| (link, i.scaled(factor))).collect(),
            rescaling: Some(rescaling),
        })
    }
}

/// Reason why no body can have the inertia `rest` that is left of a body of `body_kg`; `None` where one can.
fn unfit(rest: &LinkInertia, body_kg: f64) -> Option<Unfit> {
    let mass_kg = rest.mass_kg();
    if mass_kg <= ROUND_OFF * body_kg {
        return Some(Unfit::Mass { mass_kg });
    }
    // The same test as when the file is read again.
    let (_, _, central) = about_com(rest);
    let principal_kg_m2 = principal_moments(&central);
    let [small, middle, large] = principal_kg_m2;
    let is_possible = small > 0.0 && small + middle > large;
    (!is_possible).then_some(Unfit::Moments { mass_kg, principal_kg_m2 })
}

/// The least upper bound of the factors t for which some body can have the inertia `body` − t · `kept`, both about the
/// same frame. `body` must be possible itself.
///
/// It is 1/λ with the largest generalised eigenvalue λ of their pseudo-inertias, K v = λ P v. With P = V D Vᵀ, which is
/// positive definite, λ is the largest eigenvalue of D^(−½) Vᵀ K V D^(−½).
fn largest_factor(body: &LinkInertia, kept: &LinkInertia) -> f64 {
    let own = body.pseudo_inertia().symmetric_eigen();
    let scales = own.eigenvalues.map(|value| value.sqrt().recip());
    let to_unit = own.eigenvectors * Matrix4::from_diagonal(&scales);
    let relative = to_unit.transpose() * kept.pseudo_inertia() * to_unit;
    relative.symmetric_eigenvalues().max().recip()
}

impl fmt::Display for Rescaling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { joint, body_kg, link, others, factor, why } = self;
        let others: Vec<String> =
            others.iter().map(|(name, mass_kg)| format!("\"{name}\" ({mass_kg:.4} kg)")).collect();
        write!(
            f,
            "the body of joint \"{joint}\" was identified with {body_kg:.4} kg; without {}, as the file has them, {why}: \
             mass and moments of these are multiplied by {}, and link \"{link}\" has the rest",
            others.join(", "),
            significant(*factor, 4)
        )
    }
}

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mass { mass_kg } => write!(f, "{mass_kg:.4} kg would be left"),
            Self::Moments { mass_kg, principal_kg_m2: [small, middle, large] } => write!(
                f,
                "{mass_kg:.4} kg would be left with principal moments of inertia {small:.3e}, {middle:.3e}, {large:.3e} kg m2, \
                 which no body has"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};
    use proptest::prelude::*;

    use super::*;

    /// Four particles of `masses_kg` at the ends of three axes of `lengths_m` and at their origin, which is at `at_m`:
    /// a body, as they do not lie in a plane.
    fn particles(masses_kg: [f64; 4], lengths_m: [f64; 3], at_m: [f64; 3]) -> LinkInertia {
        let offsets = Matrix3::from_diagonal(&Vector3::from(lengths_m));
        let ends = offsets.column_iter().map(|column| column.into_owned());
        let places = ends.chain([Vector3::zeros()]).map(|offset| offset + Vector3::from(at_m));
        places.zip(masses_kg).fold(LinkInertia::zero(), |sum, (place_m, mass_kg)| {
            sum.plus(&LinkInertia::from_com(mass_kg, place_m, Matrix3::zeros()))
        })
    }

    /// The eigenvalues are those of a 4 × 4 matrix with entries of order 1: a few roundings.
    #[test]
    fn of_a_body_that_is_a_part_of_the_kept_ones_the_factor_is_that_part() {
        let body = particles([1.0, 2.0, 0.5, 1.5], [0.5, 0.7, 0.6], [0.1, -0.2, 0.3]);
        for part in [0.25, 0.9, 4.0] {
            let factor = largest_factor(&body, &body.scaled(1.0 / part));
            assert!((factor - part).abs() < 1e-12 * part, "{factor} {part}");
        }
    }

    /// Of particles at the same places, the body can give away all of the one that is scarcest: that factor is the
    /// smallest ratio of masses, whatever the others are.
    #[test]
    fn of_particles_at_the_same_places_the_scarcest_one_decides() {
        let at = |masses_kg| particles(masses_kg, [0.5, 0.7, 0.6], [0.1, -0.2, 0.3]);
        let factor = largest_factor(&at([1.0, 2.0, 0.5, 1.5]), &at([3.0, 2.0, 2.5, 0.1]));
        assert!((factor - 0.5 / 2.5).abs() < 1e-12, "{factor}");
    }

    proptest! {
        /// With the share of the bearer that is kept, the rest is a body; a factor that is 0.1 % too large leaves none.
        /// Rounding, a few 1e-16 times the ratio of the largest eigenvalue of these bodies to the smallest (1e5), is far
        /// below that.
        #[test]
        fn the_factor_is_the_largest_that_leaves_a_body(
            masses_kg in prop::array::uniform4(0.1..3.0f64),
            lengths_m in prop::array::uniform3(0.1..0.5f64),
            kept_kg in prop::array::uniform4(0.1..3.0f64),
            kept_m in prop::array::uniform3(0.1..0.5f64),
            at_m in prop::array::uniform3(-0.5..0.5f64),
        ) {
            let body = particles(masses_kg, lengths_m, [0.0; 3]);
            let kept = particles(kept_kg, kept_m, at_m);
            let largest = largest_factor(&body, &kept);
            let rest = |factor: f64| body.minus(&kept.scaled(factor));
            let left = rest((1.0 - LEAST_OF_BEARER) * largest);
            prop_assert_eq!(unfit(&left, body.mass_kg()), None);
            let beyond_least = left.minus(&body.scaled(0.999 * LEAST_OF_BEARER));
            prop_assert!(beyond_least.consistency_margin() > 0.0);
            prop_assert!(rest(1.001 * largest).consistency_margin() < 0.0);
        }
    }
}
