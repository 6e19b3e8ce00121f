//! Distribution of the identified inertia of a body among its links.

use std::fmt;

use crate::robot::export::xml::about_com;
use crate::robot::inertia::principal_moments;
use crate::robot::{Joint, LinkInertia, UrdfLink};

/// A remaining mass below this fraction of the body's mass counts as round-off.
const ROUND_OFF: f64 = 1e-9;

/// The link of a body that bears the identified inertia, and its share.
pub(super) struct Share<'a> {
    /// The bearer.
    pub bearer: &'a UrdfLink,
    /// The inertia it is given, about its own frame.
    pub inertia: LinkInertia,
    /// Set where the other links cannot keep their inertia.
    pub takeover: Option<Takeover>,
}

/// A body whose identified inertia does not allow the links fixed to it to keep what the file gives them: one link gets
/// all of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Takeover {
    /// The joint that moves the body.
    pub joint: String,
    /// The identified mass, kg.
    pub body_kg: f64,
    /// The link that gets all of it.
    pub link: String,
    /// The links whose `<inertial>` is removed, with the mass that each had, kg.
    pub emptied: Vec<(String, f64)>,
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
        let takeover = unfit(&rest, body_kg).filter(|_| !others.is_empty()).map(|why| Takeover {
            joint: joint.name.clone(),
            body_kg,
            link: bearer.name.clone(),
            emptied: others.iter().map(|(link, i)| (link.name.clone(), i.mass_kg())).collect(),
            why,
        });
        let inertia = if takeover.is_some() { joint.link.transformed(&to_bearer) } else { rest };
        Some(Self { bearer, inertia, takeover })
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

impl fmt::Display for Takeover {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { joint, body_kg, link, emptied, why } = self;
        let emptied: Vec<String> =
            emptied.iter().map(|(name, mass_kg)| format!("\"{name}\" ({mass_kg:.4} kg)")).collect();
        write!(
            f,
            "the body of joint \"{joint}\" was identified with {body_kg:.4} kg; without {}, as the file has them, {why}: \
             link \"{link}\" has all of it now, and the <inertial> of the others is taken out",
            emptied.join(", ")
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
