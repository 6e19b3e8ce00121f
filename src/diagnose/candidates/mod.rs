//! What can be wrong, one family per file.
//!
//! A family turns the processed motion of a log into the torque it would add to it, per unit of its
//! coefficients. Adding a family is one file and one line in [`all`]. Nothing here is shared with the
//! plant, which makes the same effects by physics.
//!
//! Enters: the [`Scene`] of a log, a joint, and a [`Shape`]: the numbers that a law is not linear in. Leaves: columns of torque, physical
//! parameters with units from their coefficients, and what the family is confounded with.

mod asymmetric_friction;
mod backlash;
mod base_tilt;
mod current_offset;
pub(super) mod elasticity;
mod encoder_offset;
mod feed_forward;
pub(super) mod load_friction;
mod nonlinear_viscous;
mod position_friction;
mod presliding;
mod reversal_width;
pub(super) mod ripple;
mod saturation;
mod spring;
mod stribeck;
mod thermal_drift;
mod time_skew;
mod torque_gain;

use super::image::Column;
use super::kind::Kind;
use super::scene::{Instants, Scene};
use crate::dynamics::{map_pairs, with_widest_registers};

/// A point in the nonlinear parameters of a family.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Form of the law, where there are several.
    pub variant: usize,
    /// The nonlinear parameter in SI units; 0 where there is none.
    pub value: f64,
}

/// How the nonlinear parameter is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Search {
    /// There is none.
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

/// The coefficient of a family's second column; zero where the null model absorbs that column, which a joint that
/// hardly moves makes like the first.
fn second(b: &[f64]) -> f64 {
    b.get(1).copied().unwrap_or(0.0)
}

/// One family of effects.
pub trait Candidate: Sync {
    /// Its name.
    fn kind(&self) -> Kind;

    /// Where it may sit: a joint (0-based), or `None` for the arm as a whole.
    fn sites(&self, joints: usize) -> Vec<Option<usize>> {
        (0..joints).map(Some).collect()
    }

    /// How common it is there beside its other sites, before the log was seen.
    fn prior_odds(&self, _site: Option<usize>) -> f64 {
        1.0
    }

    /// Shapes to begin with: fine enough that between two neighbours there is only one optimum.
    fn shapes(&self, _scene: &Scene, _site: Option<usize>) -> Vec<Shape> {
        vec![Shape { variant: 0, value: 0.0 }]
    }

    /// Shapes of further variants, for what the law may have beside and few arms show: they are no starting shapes, and looked at
    /// only where the law was found.
    fn richer_shapes(&self, _scene: &Scene) -> Vec<Shape> {
        Vec::new()
    }

    /// How the shape is refined.
    fn search(&self) -> Search {
        Search::None
    }

    /// Half the width of the bracket around a shape in which the optimum lies, where starting shapes
    /// are no grid; `None`: neighbours on the grid are the bracket.
    fn half_width(&self, _scene: &Scene, _site: Option<usize>) -> Option<f64> {
        None
    }

    /// Whether shape and coefficient are one parameter, so that beside the latter there is hardly a shape to choose.
    fn shape_is_coefficient(&self) -> bool {
        false
    }

    /// How many shapes were to choose from when this one was taken, where there were more than the
    /// starting ones.
    fn alternatives(&self, _scene: &Scene, _site: Option<usize>, _shape: Shape) -> Option<f64> {
        None
    }

    /// Whether one joint may have several of it, with different shapes.
    fn is_repeatable(&self) -> bool {
        false
    }

    /// Whether it changes what is seen where its joint reverses, so that beside it the log does not tell which share of its
    /// friction a drive feeds forward.
    fn blurs_reversals(&self) -> bool {
        false
    }

    /// Torque per unit of each coefficient.
    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column>;

    /// Directions of torque along which the law may be off with this shape, by what it takes for granted and the log does not
    /// tell: what is left there is none of another cause's.
    fn loose(&self, _scene: &Scene, _site: Option<usize>, _shape: Shape) -> Vec<Column> {
        Vec::new()
    }

    /// [`Self::columns`] of several shapes, where that is less work at once.
    fn bank(&self, scene: &Scene, site: Option<usize>, shapes: &[Shape]) -> Vec<Vec<Column>> {
        shapes.iter().map(|shape| self.columns(scene, site, *shape)).collect()
    }

    /// Physical parameters of the coefficients.
    fn quantities(
        &self,
        scene: &Scene,
        site: Option<usize>,
        shape: Shape,
        b: &[f64],
    ) -> Vec<Quantity>;

    /// The physical parameter that the shape holds as well as the coefficients, for laws that fix it twice (play
    /// by how far the links lag and by how long a flight lasts). Where the two disagree the law is not quite that
    /// of the arm, and the parameter is no better known than they differ.
    fn in_shape(&self, _shape: Shape) -> Option<Quantity> {
        None
    }

    /// What its physical parameters are where nothing is wrong.
    fn without_effect(&self, _scene: &Scene) -> f64 {
        0.0
    }

    /// Standard error of its physical parameters beside that of the noise, over what they are more or less than
    /// [`Self::without_effect`]: what the law takes for granted and the log does not tell.
    fn form_error(&self, _scene: &Scene, _shape: Shape) -> f64 {
        0.0
    }

    /// What its physical parameters cannot be less than, though noise may say so.
    fn least(&self) -> f64 {
        f64::NEG_INFINITY
    }

    /// Between which values its physical parameters may lie where the null model absorbs a column, so that the log tells
    /// only the coefficients `b` of those before it.
    fn left_open(
        &self,
        _scene: &Scene,
        _site: Option<usize>,
        _shape: Shape,
        _b: &[f64],
    ) -> Vec<(&'static str, [f64; 2])> {
        Vec::new()
    }

    /// The shape with which the law, fitted with `shape` and the coefficients `b` to one log, predicts another.
    fn elsewhere(&self, shape: Shape, _b: &[f64]) -> Shape {
        shape
    }

    /// The shape nearest to `shape` that goes with the coefficients `b`, for laws whose shape is known from them too. What
    /// only another shape explains is not quite the law's own.
    fn agreeing(&self, shape: Shape, _b: &[f64]) -> Shape {
        shape
    }

    /// The quantity that says how large the effect is, for detection limits.
    fn size(&self, quantities: &[Quantity]) -> Option<Quantity> {
        quantities.first().copied()
    }

    /// Whether an effect whose [`Self::size`] has this value can be there.
    fn can_be(&self, _scene: &Scene, _site: Option<usize>, _size: f64) -> bool {
        true
    }

    /// The first coefficient of an effect of this `shape`, where the shape says how large it is.
    fn whole(&self, _shape: Shape) -> Option<f64> {
        None
    }

    /// The experiment that tells it from what it resembles.
    fn separating_experiment(&self) -> &'static str;

    /// Whether coefficients `b` can belong to it at all, in this shape.
    fn is_possible(&self, _shape: Shape, _b: &[f64]) -> bool {
        true
    }

    /// Whether the law, with this shape and these coefficients at their best, is the family's own. Where it is
    /// not, the law only stands in for one that resembles it at that end of its range: the data show
    /// something, and it is not this.
    fn is_its_own(&self, _scene: &Scene, _site: Option<usize>, _shape: Shape, _b: &[f64]) -> bool {
        true
    }

    /// The effect in words, its parameters behind: "friction that grows with load".
    fn in_words(&self) -> &'static str;

    /// Which form of the law this shape is, where there are several and parameters do not say it; `None`: the usual one.
    fn form(&self, _scene: &Scene, _shape: Shape) -> Option<&'static str> {
        None
    }
}

/// Every family.
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
    ]
}

/// The lowest and the highest angle of joint `j`, rad.
fn range_rad(scene: &Scene, j: usize) -> [f64; 2] {
    let ends = |[low, high]: [f64; 2], q: &f64| [low.min(*q), high.max(*q)];
    scene.motion.q_rad.joint(j).iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends)
}

/// Samples of joint `j` made from angle, speed and load by `f(k)`.
fn samples(scene: &Scene, f: impl Fn(usize) -> f64) -> Vec<f64> {
    (0..scene.samples()).map(f).collect()
}

/// Friction of joint `j` that turns with the direction of motion, `level(instants, k)` times the sign of q̇.
fn dry_friction(scene: &Scene, j: usize, level: impl Fn(&Instants, usize) -> f64) -> Column {
    let at = scene.instants(j);
    let friction = (0..at.sign.len()).map(|k| at.sign[k] * level(at, k)).collect();
    Column::on(j, scene.as_logged(friction))
}

/// `f(a, b)` of all pairs, with the widest registers of the machine where `f` is inlined.
fn of_pairs(mut a: Vec<f64>, b: &[f64], f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    with_widest_registers(
        #[inline(always)]
        || map_pairs(&mut a, b, &f),
    );
    a
}

/// The joint of a family that always sits on one.
fn joint(site: Option<usize>) -> usize {
    site.unwrap_or_default()
}

/// Sites of a family that belongs to the arm as a whole or to one joint; an arm of one joint is that joint.
fn arm_and_joints(joints: usize) -> Vec<Option<usize>> {
    let arm = (joints > 1).then_some(None);
    arm.into_iter().chain((0..joints).map(Some)).collect()
}

/// The joints of such a site.
fn joints_at(scene: &Scene, site: Option<usize>) -> std::ops::Range<usize> {
    site.map_or(0..scene.joints(), |j| j..j + 1)
}

/// `count` values from `low` to `high` in equal ratios.
fn geometric(low: f64, high: f64, count: usize) -> impl Iterator<Item = f64> {
    let ratio = (high / low).powf(1.0 / (count - 1) as f64);
    (0..count).map(move |k| low * ratio.powi(k as i32))
}
