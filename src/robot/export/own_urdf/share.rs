//! How the links of a body share what was identified for the body as a whole.

use std::fmt;

use crate::robot::export::xml::about_com;
use crate::robot::inertia::principal_moments;
use crate::robot::{Joint, LinkInertia, UrdfLink};

/// What is left of a body is round-off below this share of it.
const ROUND_OFF: f64 = 1e-9;

/// The link of a body that is given what was identified.
pub(super) struct Share<'a> {
    /// That link.
    pub bearer: &'a UrdfLink,
    /// What it is given, about its own frame.
    pub inertia: LinkInertia,
    /// Where the other links cannot keep what they have.
    pub takeover: Option<Takeover>,
}

/// A body from which the links that are fixed to it cannot keep what the file gives them: one link
/// has all of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Takeover {
    /// The joint that moves the body.
    pub joint: String,
    /// The mass that was identified.
    pub body_kg: f64,
    /// The link that has all of it.
    pub link: String,
    /// The links whose `<inertial>` is taken out, with the mass that they had.
    pub emptied: Vec<(String, f64)>,
    /// Why.
    pub why: Unfit,
}

/// Why no body has the inertia that is left over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unfit {
    /// Its mass is not positive.
    Mass {
        /// The mass.
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
    /// For the body of `joint`, whose `links` these are; `None` without any.
    ///
    /// The link right behind the joint bears what was identified less what the file gives to the
    /// others. Where it has no inertia in the file (a frame by name), the next one that has does.
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

/// What keeps a body of `body_kg` from leaving this; `None` where nothing does.
fn unfit(rest: &LinkInertia, body_kg: f64) -> Option<Unfit> {
    let mass_kg = rest.mass_kg();
    if mass_kg <= ROUND_OFF * body_kg {
        return Some(Unfit::Mass { mass_kg });
    }
    // As it is judged when the file is read again.
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
