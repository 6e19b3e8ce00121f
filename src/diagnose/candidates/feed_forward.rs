//! A drive that feeds forward another share of its friction than the others: τ = F Δ (s̃ − s). F is the drive's dry
//! friction, s the sign of q̇, s̃ the sign as logged, and Δ the share by which this drive feeds forward less than the
//! others ([`Scene::answers`]).

use super::*;
use crate::diagnose::drives;

/// See the module.
pub struct FeedForward;

/// Bound on Δ: a drive feeds forward no more than twice its friction, and no less than nothing.
const MOST_LESS: f64 = 2.0;
/// Largest Δ that a real drive can have: beside drives that feed all of their friction forward, no more than all can be
/// missing.
const ALL: f64 = 1.0;

impl Candidate for FeedForward {
    fn kind(&self) -> Kind {
        Kind::FeedForward
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        let is_there = scene.periodic && scene.coulomb_nm[joint(site)] > 0.0;
        is_there.then_some(Shape { variant: 0, value: 0.0 }).into_iter().collect()
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        drives::share(scene, joint(site)).into_iter().collect()
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("share_less", b[0], "")]
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion with the friction feed-forward of that drive switched off"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0].abs() < MOST_LESS
    }

    fn can_be(&self, _: &Scene, _: Option<usize>, share_less: f64) -> bool {
        share_less.abs() < ALL
    }

    /// Beyond [`ALL`], the law stands in for something else about reversals.
    fn is_its_own(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> bool {
        b[0].abs() <= ALL
    }

    fn in_words(&self) -> &'static str {
        "a drive that feeds another share of its friction forward than the others"
    }
}
