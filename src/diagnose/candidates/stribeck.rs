//! Friction that falls with speed near rest: τ = F e^{−(|q̇|/v_s)ⁿ} sign q̇, n = 2 or 1 (Stribeck 1902; Armstrong-Hélouvry,
//! Dupont and Canudas de Wit 1994).
//!
//! Where it turns round, a joint does not move as its samples say ([`Scene::turning_rad_s`]): what bends its velocity there is
//! this friction beside the joint's own. How much of it there is is not known before the fit; the columns are those of a usual
//! share, divided by it.

use super::*;
use crate::dynamics::Real;

/// See the module.
pub struct Stribeck;

/// Friction near rest beside the joint's own, F/F_c, with which its turn is followed. A few tenths to once that are
/// usual; between 0.2 and 0.8 the turn moves estimates of F by 4 %, between none and 0.2 by more than their σ.
const USUAL_SHARE: f64 = 0.5;

/// How the drive answers while friction turns round: by its feedback alone. What its answer to reversals tells is no better a
/// guess on joints 3 to 6, and on joints 1 and 2, which turn round within few samples, made F 1.8 to 2.6 times as large in six of 84
/// logs (`reports/blind_history.md`).
const FED: Option<f64> = Some(0.0);

/// Standard error of F and v_s over their value, for both: with it the intervals hold 77 and 79 truths of those 84 logs.
const TURN_ERROR: f64 = 0.04;

/// A curve that falls over more than so many times the width of the regularised sign is no matter of slow motion.
const WIDEST: f64 = 25.0;
/// The narrowest that is looked for; slower than the sign turns round it would be a part of that.
const NARROWEST: f64 = 1.2;
/// What is best explained by a curve no wider than this is narrower than any: another way in which friction turns round.
const AT_THE_END: f64 = 1.25;

/// Friction over Coulomb's with [`USUAL_SHARE`] more of it near rest, which falls with the speed `v`, rad/s.
#[inline(always)]
fn usual(shape: Shape, epsilon_rad_s: f64, v: f64) -> f64 {
    let x = v.abs() / shape.value;
    let more = Real::exp(-if shape.variant == 0 { x * x } else { x });
    Real::tanh(v / epsilon_rad_s) * (1.0 + USUAL_SHARE * more)
}

impl Candidate for Stribeck {
    fn kind(&self) -> Kind {
        Kind::Stribeck
    }

    fn shapes(&self, scene: &Scene, _: Option<usize>) -> Vec<Shape> {
        // Up to twice the widest, to see where it would end.
        let epsilon = scene.arm.friction_epsilon_rad_s;
        (0..2)
            .flat_map(|variant| {
                geometric(NARROWEST * epsilon, 2.0 * WIDEST * epsilon, 8)
                    .map(move |value| Shape { variant, value })
            })
            .collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let epsilon = scene.arm.friction_epsilon_rad_s;
        let velocity = scene.turning_rad_s(
            j,
            FED,
            epsilon,
            #[inline(always)]
            |v| usual(shape, epsilon, v),
        );
        let beside = of_pairs(
            velocity,
            &scene.instants(j).sign,
            #[inline(always)]
            |v, sign| (usual(shape, epsilon, v) - sign) / USUAL_SHARE,
        );
        vec![Column::on(j, scene.as_logged(beside))]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("extra_nm", b[0], "Nm"), quantity("vs_rad_s", shape.value, "rad/s")]
    }

    fn least(&self) -> f64 {
        0.0
    }

    fn form_error(&self, scene: &Scene, _: Shape) -> f64 {
        if scene.periodic { TURN_ERROR } else { 0.0 }
    }

    fn separating_experiment(&self) -> &'static str {
        "constant speeds in a slow staircase down to 0.005 rad/s, both directions"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    /// Friction that falls over the whole range of speeds has another law, and so has what falls while the sign turns round.
    fn is_its_own(&self, scene: &Scene, _: Option<usize>, shape: Shape, _: &[f64]) -> bool {
        let widths = shape.value / scene.arm.friction_epsilon_rad_s;
        widths > AT_THE_END && widths <= WIDEST
    }

    fn in_words(&self) -> &'static str {
        "friction that is larger near rest and falls with speed (Stribeck)"
    }

    fn form(&self, _: &Scene, shape: Shape) -> Option<&'static str> {
        Some(if shape.variant == 0 { "extra exp(-(v/vs)^2)" } else { "extra exp(-v/vs)" })
    }
}
