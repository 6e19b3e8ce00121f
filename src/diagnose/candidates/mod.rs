//! Catalogue of model errors that the diagnosis looks for, one family per file.
//!
//! A family turns the processed motion of a log into the torque that the effect would add to it, per unit of its
//! coefficients. Adding a family takes one file and one line in [`all`]. The families share no code with the plant,
//! which produces the same effects by integrating the physics.
//!
//! Enters: the [`Scene`] of a log, a joint, and a [`Shape`], the parameters in which the law is not linear. Leaves:
//! columns of torque, the physical parameters with units that follow from their coefficients, and the experiment that
//! separates the family from effects it is confounded with.

mod asymmetric_friction;
mod backlash;
mod base_tilt;
mod current_offset;
pub(super) mod elasticity;
mod encoder_offset;
mod feed_forward;
mod gravity;
mod link_length;
pub(super) mod load_friction;
mod nonlinear_viscous;
mod position_friction;
pub(super) mod presliding;
mod reversal_width;
pub(super) mod ripple;
mod saturation;
mod spring;
pub(super) mod stribeck;
mod thermal_drift;
pub(super) mod time_skew;
mod torque_gain;

use super::bristles::Bristles;
use super::image::Column;
use super::kind::Kind;
use super::scene::{Instants, Scene};
use crate::dynamics::{of_pairs, with_widest_registers};
use crate::robot::Arm;

/// A point in the space of a family's nonlinear parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Form of the law, for families that have several.
    pub variant: usize,
    /// The nonlinear parameter in SI units; 0 for laws without one.
    pub value: f64,
}

/// How the nonlinear parameter is refined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Search {
    /// The law has no nonlinear parameter.
    None,
    /// Between neighbours on a logarithmic scale.
    Logarithmic,
    /// Between neighbours on a straight scale.
    Straight,
}

/// A physical parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Name with its unit, as in scenarios.
    pub name: &'static str,
    /// SI value.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
}

/// Shorthand for a [`Quantity`].
fn quantity(name: &'static str, value: f64, unit: &'static str) -> Quantity {
    Quantity { name, value, unit }
}

/// Coefficient of a family's second column. Zero where the null model absorbs that column: on a joint that hardly
/// moves, it looks like the first.
fn second(b: &[f64]) -> f64 {
    b.get(1).copied().unwrap_or(0.0)
}

/// One family of effects.
pub trait Candidate: Sync {
    /// Kind of the effect, by which it is named.
    fn kind(&self) -> Kind;

    /// Sites at which the effect may occur: a joint (0-based), or `None` for the arm as a whole.
    fn sites(&self, joints: usize) -> Vec<Option<usize>> {
        (0..joints).map(Some).collect()
    }

    /// Whether what the arm as a whole adds is the sum of what its joints add, shape by shape.
    fn is_sum_of_joints(&self) -> bool {
        false
    }

    /// Prior odds of the effect at this site relative to the family's other sites. Only their ratios matter.
    fn prior_odds(&self, _site: Option<usize>) -> f64 {
        1.0
    }

    /// Starting shapes for the search: so closely spaced that there is only one optimum between two neighbours.
    fn shapes(&self, _scene: &Scene, _site: Option<usize>) -> Vec<Shape> {
        vec![Shape { variant: 0, value: 0.0 }]
    }

    /// Shapes of further variants, for parts of the law that few logs show. They take no part in the search and are tried
    /// only where the law was found.
    fn richer_shapes(&self, _scene: &Scene) -> Vec<Shape> {
        Vec::new()
    }

    /// Shapes near `shape` in variants between those of the search, which are tried only where the law was found.
    fn finer_shapes(&self, _scene: &Scene, _site: Option<usize>, _shape: Shape) -> Vec<Shape> {
        Vec::new()
    }

    /// How the shape is refined.
    fn search(&self) -> Search {
        Search::None
    }

    /// Half the width of the bracket around a starting shape in which the optimum lies, for families whose starting
    /// shapes form no grid. `None`: the neighbours on the grid are the bracket.
    fn half_width(&self, _scene: &Scene, _site: Option<usize>) -> Option<f64> {
        None
    }

    /// Whether shape and coefficient are the same parameter, so that once the coefficient is known there is hardly a
    /// shape left to choose.
    fn shape_is_coefficient(&self) -> bool {
        false
    }

    /// Number of shapes that were available when this one was chosen, where it is larger than the number of starting
    /// shapes; `None`: the starting shapes were all.
    fn alternatives(&self, _scene: &Scene, _site: Option<usize>, _shape: Shape) -> Option<f64> {
        None
    }

    /// Whether one joint may have several effects of this family, with different shapes.
    fn is_repeatable(&self) -> bool {
        false
    }

    /// Whether a motion tells effects with these shapes on one joint from each other, for repeatable families.
    fn are_apart(&self, _scene: &Scene, _site: Option<usize>, _one: Shape, _other: Shape) -> bool {
        true
    }

    /// Whether the effect changes how reversals of its joint look in the log. Beside such an effect, the log no longer
    /// tells which share of its friction the drive feeds forward.
    fn blurs_reversals(&self) -> bool {
        false
    }

    /// Torque per unit of each coefficient: one column per coefficient.
    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column>;

    /// Change of the width over which dry friction turns round, rad/s, and the share of it that the drive feeds forward,
    /// for the law that says so.
    fn turning(&self, _shape: Shape, _b: &[f64]) -> Option<(f64, f64)> {
        None
    }

    /// Bristles of the joint, for the law that has them.
    fn bristles(&self, _shape: Shape, _b: &[f64]) -> Option<Bristles> {
        None
    }

    /// Friction near rest, Nm, that bristles of the joint hold, for the law that adds it.
    fn near_rest_nm(&self, _b: &[f64]) -> Option<f64> {
        None
    }

    /// Mean over the log of the factor by which the joint's friction has changed since it began, for the law that says so.
    fn warm(&self, _scene: &Scene, _shape: Shape, _b: &[f64]) -> Option<f64> {
        None
    }

    /// Directions of torque along which the law may be wrong at this shape, because it takes something for granted that
    /// the log does not tell. A residual along them is not evidence for another cause.
    fn loose(&self, _scene: &Scene, _site: Option<usize>, _shape: Shape) -> Vec<Column> {
        Vec::new()
    }

    /// Whether [`Self::loose`] is fitted and carried along to another motion. A law that predicts other motions well
    /// without would only carry noise.
    fn carries_loose(&self) -> bool {
        false
    }

    /// Number of shapes that [`Self::bank`] computes at hardly more than the price of one.
    fn abreast(&self) -> usize {
        1
    }

    /// [`Self::columns`] of several shapes at once, where computing them together is cheaper.
    fn bank(&self, scene: &Scene, site: Option<usize>, shapes: &[Shape]) -> Vec<Vec<Column>> {
        shapes.iter().map(|shape| self.columns(scene, site, *shape)).collect()
    }

    /// Physical parameters that belong to the coefficients `b`.
    fn quantities(
        &self,
        scene: &Scene,
        site: Option<usize>,
        shape: Shape,
        b: &[f64],
    ) -> Vec<Quantity>;

    /// The physical parameter that the shape determines in addition to the coefficients, for laws that fix one
    /// parameter twice (play by how far the links lag, and by how long a flight lasts). Where the two values disagree,
    /// the law is not quite that of the arm, and the parameter is known no better than they differ.
    fn in_shape(&self, _shape: Shape) -> Option<Quantity> {
        None
    }

    /// Value of the physical parameters when nothing is wrong.
    fn without_effect(&self, _scene: &Scene) -> f64 {
        0.0
    }

    /// Standard error of the physical parameters beyond that from noise, relative to their distance from
    /// [`Self::without_effect`]. It covers what the law takes for granted and the log does not tell.
    fn form_error(&self, _scene: &Scene, _shape: Shape) -> f64 {
        0.0
    }

    /// The columns for an effect with the coefficients `b`: its torque over its size, where the torque of a large effect
    /// is not proportional to its size; `None` where it is. [`Self::columns`] are those of a small effect.
    fn secants(&self, _scene: &Scene, _site: Option<usize>, _b: &[f64]) -> Option<Vec<Column>> {
        None
    }

    /// Lower bound of the physical parameters: estimates below it are due to noise.
    fn least(&self) -> f64 {
        f64::NEG_INFINITY
    }

    /// Ranges in which the physical parameters may lie where the null model absorbs a column, so that the log
    /// determines only the coefficients `b` of the columns before it.
    fn left_open(
        &self,
        _scene: &Scene,
        _site: Option<usize>,
        _shape: Shape,
        _b: &[f64],
    ) -> Vec<(&'static str, [f64; 2])> {
        Vec::new()
    }

    /// Shape with which the law predicts another log, after it has been fitted to one log with `shape` and the
    /// coefficients `b`.
    fn elsewhere(&self, shape: Shape, _b: &[f64]) -> Shape {
        shape
    }

    /// How many of the coefficients, from the first one on, hold along another motion too; the others say what happened
    /// along the motion of their log. All, unless the law says otherwise.
    fn carried(&self, _shape: Shape) -> usize {
        usize::MAX
    }

    /// The shape nearest to `shape` that is consistent with the coefficients `b`, for laws whose coefficients also
    /// determine the shape. An effect that is explained only with an inconsistent shape is not quite the law's own.
    fn agreeing(&self, shape: Shape, _b: &[f64]) -> Shape {
        shape
    }

    /// The quantity that measures the size of the effect, for detection limits.
    fn size(&self, quantities: &[Quantity]) -> Option<Quantity> {
        quantities.first().copied()
    }

    /// Whether an effect of this [`Self::size`] is physically possible.
    fn can_be(&self, _scene: &Scene, _site: Option<usize>, _size: f64) -> bool {
        true
    }

    /// First coefficient of an effect of this `shape`, for laws whose shape determines the size of the effect.
    fn whole(&self, _shape: Shape) -> Option<f64> {
        None
    }

    /// The experiment that separates the effect from those it resembles.
    fn separating_experiment(&self) -> &'static str;

    /// Whether the coefficients `b` are physically possible for this family and shape.
    fn is_possible(&self, _shape: Shape, _b: &[f64]) -> bool {
        true
    }

    /// Whether the law, at its best shape and coefficients, really is this family's effect. Where it is not, the law
    /// only stands in for an effect that resembles it at that end of its range: the data show something, but not this.
    fn is_its_own(&self, _scene: &Scene, _site: Option<usize>, _shape: Shape, _b: &[f64]) -> bool {
        true
    }

    /// Whether laws that are not in the dictionary may look just like this one at this shape, so that its name is never
    /// certain.
    fn is_commonplace(&self, _scene: &Scene, _site: Option<usize>, _shape: Shape) -> bool {
        false
    }

    /// The effect in words, to which its parameters are appended: "friction that grows with load".
    fn in_words(&self) -> &'static str;

    /// [`Self::in_words`] of the effect with this `shape` and the coefficients `b`, where these change what it is called.
    fn in_words_of(&self, _shape: Shape, _b: &[f64]) -> &'static str {
        self.in_words()
    }

    /// Name of the form of the law that this shape selects, for families with several forms that the parameters do not
    /// distinguish; `None`: the usual form.
    fn form(&self, _scene: &Scene, _shape: Shape) -> Option<&'static str> {
        None
    }
}

/// All families of the catalogue.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![
        Box::new(stribeck::Stribeck),
        Box::new(nonlinear_viscous::NonlinearViscous),
        Box::new(load_friction::LoadFriction),
        Box::new(presliding::Presliding),
        Box::new(reversal_width::ReversalWidth),
        Box::new(position_friction::PositionFriction),
        Box::new(asymmetric_friction::AsymmetricFriction),
        Box::new(current_offset::CurrentOffset),
        Box::new(thermal_drift::ThermalDrift),
        Box::new(ripple::Ripple),
        Box::new(elasticity::Elasticity),
        Box::new(backlash::Backlash),
        Box::new(torque_gain::TorqueGain),
        Box::new(saturation::Saturation),
        Box::new(feed_forward::FeedForward),
        Box::new(time_skew::TimeSkew),
        Box::new(encoder_offset::EncoderOffset),
        Box::new(base_tilt::BaseTilt),
        Box::new(spring::Spring),
        Box::new(link_length::LinkLength),
        Box::new(gravity::Gravity),
    ]
}

/// Lowest and highest angle of joint `j`, rad.
fn range_rad(scene: &Scene, j: usize) -> [f64; 2] {
    let ends = |[low, high]: [f64; 2], q: &f64| [low.min(*q), high.max(*q)];
    scene.motion.q_rad.joint(j).iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends)
}

/// `f(k)` at every sample k of the scene.
fn samples(scene: &Scene, f: impl Fn(usize) -> f64) -> Vec<f64> {
    (0..scene.samples()).map(f).collect()
}

/// Dry friction of joint `j` as logged: `level(instants, k)` times the sign of q̇.
fn dry_friction(scene: &Scene, j: usize, level: impl Fn(&Instants, usize) -> f64) -> Column {
    let at = scene.turned(j);
    let friction = (0..at.sign.len()).map(|k| at.sign[k] * level(at, k)).collect();
    Column::on(j, scene.as_logged(friction))
}

/// The size `b` of a change, or `least` where the change is smaller.
fn large(b: f64, least: f64) -> f64 {
    if b.abs() > least { b } else { least }
}

/// Torque per unit of a `change` of the arm, of size `step`, along the motion.
fn of_changed_arm(scene: &Scene, step: f64, change: impl Fn(&mut Arm)) -> Column {
    let mut arm = scene.arm.clone();
    change(&mut arm);
    Column::everywhere(&scene.torque_change(&arm, &scene.motion)).scaled(1.0 / step)
}

/// The joint at `site`, for families that always sit on a joint.
fn joint(site: Option<usize>) -> usize {
    site.unwrap_or_default()
}

/// Sites of a family that may affect the arm as a whole or a single joint. For an arm with one joint, only that joint.
fn arm_and_joints(joints: usize) -> Vec<Option<usize>> {
    let arm = (joints > 1).then_some(None);
    arm.into_iter().chain((0..joints).map(Some)).collect()
}

/// The joints that a site of [`arm_and_joints`] affects.
fn joints_at(scene: &Scene, site: Option<usize>) -> std::ops::Range<usize> {
    site.map_or(0..scene.joints(), |j| j..j + 1)
}

/// `count` values from `low` to `high` in geometric progression.
fn geometric(low: f64, high: f64, count: usize) -> impl Iterator<Item = f64> {
    let ratio = (high / low).powf(1.0 / (count - 1) as f64);
    (0..count).map(move |k| low * ratio.powi(k as i32))
}
