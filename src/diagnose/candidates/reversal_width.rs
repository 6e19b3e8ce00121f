//! Friction that turns round over another range of speeds than the model assumes, on one joint or on all: τ = F
//! (tanh(q̇/w) − tanh(q̇/ε)), with F the joint's dry friction and ε the width in the robot file.
//!
//! Friction that changes sign at once has w = 0. What the samples show of a reversal is the area under the law, which
//! is proportional to w − ε. This difference is both the coefficient and the shape.
//!
//! Where friction turns round within a sample, the joint does not move as the samples say: the friction torque that the
//! drive does not deliver at once bends its velocity ([`Scene::turning_rad_s`]). The answer of the drive to reversals
//! cannot be taken from the log here, because it is inferred with the width of the file. Instead, the drive either
//! feeds dry friction forward with that width or not at all, and its feedback answers the rest; these are the two
//! variants.

use super::*;
use crate::diagnose::scene::SHARPEST;
use crate::dynamics::Real;

/// See the module.
pub struct ReversalWidth;

/// Two widths this close, as a share of ε, count as one: the difference quotient is then the derivative of the law.
const APART: f64 = 1e-3;
/// Starting values of w − ε, as shares of ε.
const CHANGES: [f64; 12] = [-0.9, -0.8, -0.6, -0.35, -0.15, 0.15, 0.4, 0.8, 1.6, 3.2, 6.4, 12.8];
/// Possible ratios of coefficient to shape. All dry friction of a joint turns round, and the ratio of an estimate is
/// off by less than this.
const WHOLE: std::ops::RangeInclusive<f64> = 0.4..=2.5;
/// Upper limit of this ratio where friction turns round and does nothing else. For 85 widths the ratio was 0.4 to 1.5.
/// With five it was larger, but a consistent shape explained as much. Friction that falls while it turns round, fitted
/// with the same law, goes to the end of the possible range.
const MOST_WHOLE: f64 = 1.5;
/// Standard error of widths below the model's, relative to the difference: how the drive answers while friction turns
/// round within a sample is not known. In logs of another simulator, whose drives feed nothing forward, a width of
/// 0.002 rad/s left 0.14 of its strength to late torques of the wrist.
const SHARP_ERROR: f64 = 0.15;

impl Candidate for ReversalWidth {
    fn kind(&self) -> Kind {
        Kind::ReversalWidth
    }

    fn sites(&self, joints: usize) -> Vec<Option<usize>> {
        arm_and_joints(joints)
    }

    fn is_sum_of_joints(&self) -> bool {
        true
    }

    fn shapes(&self, scene: &Scene, _: Option<usize>) -> Vec<Shape> {
        let epsilon = scene.arm.friction_epsilon_rad_s;
        // A sharper reversal is over before the low-pass of a single run shows it. Of a slower one it shows the area.
        let is_sought = |shape: &Shape| match (scene.periodic, shape.value < 0.0) {
            (true, sharper) => shape.variant == 0 || sharper,
            (false, sharper) => shape.variant == 0 && !sharper,
        };
        (0..2)
            .flat_map(|variant| CHANGES.map(|share| Shape { variant, value: share * epsilon }))
            .filter(is_sought)
            .collect()
    }

    fn search(&self) -> Search {
        Search::Straight
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let epsilon = scene.arm.friction_epsilon_rad_s;
        let apart = APART * epsilon;
        let change = if shape.value.abs() < apart { apart } else { shape.value };
        let width = (epsilon + change).max(SHARPEST * epsilon);
        let change = width - epsilon;
        let fed = Some(shape.variant as f64);
        let per_width = |j: usize| {
            let qd = scene.turning_rad_s(
                j,
                fed,
                width,
                #[inline(always)]
                |qd| Real::tanh(qd / width),
            );
            let slope = of_pairs(
                qd,
                &scene.instants(j).sign,
                #[inline(always)]
                |qd, sign| (Real::tanh(qd / width) - sign) / change,
            );
            scene.as_logged(slope).into_iter().map(|u| scene.coulomb_nm[j] * u).collect()
        };
        vec![Column { parts: joints_at(scene, site).map(|j| (j, per_width(j))).collect() }]
    }

    /// The width by these coefficients alone: a joint that is named beside the arm has what the arm adds as well.
    fn quantities(&self, scene: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("width_rad_s", scene.arm.friction_epsilon_rad_s + b[0], "rad/s")]
    }

    fn turning(&self, shape: Shape, b: &[f64]) -> Option<(f64, f64)> {
        Some((b[0], shape.variant as f64))
    }

    fn agreeing(&self, shape: Shape, b: &[f64]) -> Shape {
        if b[0] / shape.value > MOST_WHOLE {
            Shape { value: b[0] / MOST_WHOLE, ..shape }
        } else {
            shape
        }
    }

    fn without_effect(&self, scene: &Scene) -> f64 {
        scene.arm.friction_epsilon_rad_s
    }

    fn least(&self) -> f64 {
        0.0
    }

    fn form_error(&self, _: &Scene, shape: Shape) -> f64 {
        if shape.value < 0.0 { SHARP_ERROR } else { 0.0 }
    }

    fn separating_experiment(&self) -> &'static str {
        "slow triangles of speed through zero, ±0.05 rad/s within 10 s: the torque against the speed shows the width"
    }

    fn is_possible(&self, shape: Shape, b: &[f64]) -> bool {
        WHOLE.contains(&(b[0] / shape.value))
    }

    /// No friction turns round faster than at once. A coefficient beyond that by two standard errors of the law means
    /// that there is more friction, not a narrower reversal.
    fn is_its_own(&self, scene: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> bool {
        let at_once = -scene.arm.friction_epsilon_rad_s;
        b[0] >= (1.0 + 2.0 * SHARP_ERROR) * at_once
    }

    fn in_words(&self) -> &'static str {
        "friction that turns round over another range of speeds"
    }
}
