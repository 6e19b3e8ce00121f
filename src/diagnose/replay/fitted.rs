//! The effects of the extended model, with what they are in the plant.

use super::counterpart::{Counterpart, DiagnosedCause};
use crate::diagnose::candidates::Candidate;
use crate::diagnose::extension::{torque_per_reading, width_of_arm};
use crate::diagnose::{Effect, Kind, Scene};

/// A fitted effect and its counterpart.
#[derive(Debug, Clone)]
pub struct Fitted<'e> {
    /// The effect.
    pub effect: &'e Effect,
    /// Its family.
    pub kind: Kind,
    /// Joint, from 1; `None`: the arm as a whole.
    pub joint: Option<usize>,
    /// What it is in the plant.
    pub counterpart: Counterpart,
}

impl<'e> Fitted<'e> {
    /// All `effects` that were fitted along `scene`, in the order in which the plant takes them.
    ///
    /// The model adds what a joint changes of the width over which its friction turns round to what the whole arm
    /// changes. In the plant, the width of a joint replaces that of the arm: it holds both changes and comes behind.
    pub fn all(effects: &'e [Effect], families: &[Box<dyn Candidate>], scene: &Scene) -> Vec<Self> {
        let of_arm = |effect: &Effect| width_of_arm(effects, effect, families);
        let (behind, first): (Vec<&Effect>, Vec<&Effect>) =
            effects.iter().partition(|effect| of_arm(effect).is_some());
        let fitted = |effect: &'e Effect| {
            let added = of_arm(effect).unwrap_or(0.0);
            let per_reading = torque_per_reading(effects, effect, families);
            let b: Vec<f64> =
                effect.coefficients.iter().map(|own| per_reading * own + added).collect();
            Self::new(effect, &b, families, scene)
        };
        first.into_iter().chain(behind).map(fitted).collect()
    }

    /// `effect`, which acts in the plant with the coefficients `b`.
    fn new(effect: &'e Effect, b: &[f64], families: &[Box<dyn Candidate>], scene: &Scene) -> Self {
        let Effect { family, site, shape, .. } = effect;
        let family = &families[*family];
        let quantities = family.quantities(scene, *site, *shape, b);
        let quantities: Vec<_> = quantities.iter().map(|q| (q.name, q.value)).collect();
        let (kind, joint) = (family.kind(), site.map(|j| j + 1));
        let (variant, quantities) = (shape.variant, &quantities);
        let cause = DiagnosedCause { kind, joint, variant, record_fault: None, quantities };
        Self { effect, kind, joint, counterpart: cause.counterpart() }
    }
}
