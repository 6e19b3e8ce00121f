//! Friction that falls with speed near rest: τ = F e^{−(|q̇|/v_s)ⁿ} sign q̇, n = 2 or 1 (Stribeck 1902;
//! Armstrong-Hélouvry, Dupont and Canudas de Wit 1994). Where it is found, τ = F/(1 + (q̇/v_s)²) sign q̇ is tried as well
//! (Hess and Soom 1990): it falls from rest as the first does, and more slowly than either farther on.
//!
//! Where the scene was told of bristles on the joint, they hold the curve ([`Bristles::more_with`]), of the size of the
//! round before.
//!
//! Where friction turns round, a joint does not move as its samples say ([`Scene::turning_rad_s`]): this friction,
//! added to the joint's own, bends its velocity. Its size is not known before the fit. The columns are therefore
//! computed for a typical share and divided by it.

use super::*;
use crate::diagnose::bristles::{Bristles, Curve, Way};
use crate::dynamics::Real;

/// See the module.
pub struct Stribeck;

/// Variant with n = 1.
pub const STEEP_AT_REST: usize = 1;
/// Variant that falls with a power of the speed.
pub const RATIONAL: usize = 2;
/// Widths that are tried for the latter, in those of the curve that was found: it has half its height at v_s, the others
/// at 0.83 and 0.69 v_s.
const WIDTHS_OF_RATIONAL: [f64; 3] = [0.4, 0.8, 1.6];

/// Its narrowest, in widths of the regularised sign: a narrower one also looks like a sign that turns round faster.
const NARROWEST_RATIONAL: f64 = 2.5;

/// Assumed ratio F/F_c of the extra friction near rest to the joint's own, for simulating its reversals. A few tenths
/// to one are typical. Between 0.2 and 0.8, the reversal moves estimates of F by 4 %; between zero and 0.2, by more
/// than their σ.
const USUAL_SHARE: f64 = 0.5;

/// How the drive answers while friction turns round: by its feedback alone. The answer inferred from reversals is no
/// better a guess on joints 3 to 6. On joints 1 and 2, which turn round within few samples, it made F 1.8 to 2.6 times
/// as large in six of 84 logs (`reports/blind_history.md`).
const FED: Option<f64> = Some(0.0);

/// Relative standard error of both F and v_s. With it, the intervals hold 77 and 79 of the true values in those 84
/// logs. (For curves that bristles hold it was not measured by itself; the intervals of ten hold 19 of 20.)
const TURN_ERROR: f64 = 0.04;

/// A curve wider than this many widths of the regularised sign is not confined to slow motion.
const WIDEST: f64 = 25.0;
/// A curve wider than this many widths is also what other laws look like that bend over the whole range of speeds:
/// taken out of the dictionary, friction −|q̇|^p with p of 0.41 and 0.57 was best explained by curves of 21 and 24 widths,
/// and nothing was left to explain (√λ of 50 and 36).
const CONFINED: f64 = 15.0;
/// Narrowest curve that is looked for. A narrower one would merely be part of the sign's own reversal.
const NARROWEST: f64 = 1.2;
/// If the best curve is no wider than this, the true one is narrower than any that is tried: friction turns round in
/// another way.
const AT_THE_END: f64 = 1.25;

/// The extra friction at the speed `v`, rad/s, relative to that at rest.
#[inline(always)]
pub fn near_rest(shape: Shape, v: f64) -> f64 {
    let x = v.abs() / shape.value;
    match shape.variant {
        RATIONAL => 1.0 / (1.0 + x * x),
        STEEP_AT_REST => Real::exp(-x),
        _ => Real::exp(-x * x),
    }
}

/// Friction at the speed `v`, rad/s, relative to Coulomb friction, with [`USUAL_SHARE`] of extra friction near rest
/// that falls with speed.
#[inline(always)]
fn usual(shape: Shape, epsilon_rad_s: f64, v: f64) -> f64 {
    Real::tanh(v / epsilon_rad_s) * (1.0 + USUAL_SHARE * near_rest(shape, v))
}

/// Columns of curves of these `shapes` that `bristles` on joint `j` hold.
fn held(scene: &Scene, j: usize, bristles: &Bristles, shapes: &[Shape]) -> Vec<Column> {
    let share = bristles.curve.map_or(USUAL_SHARE, |curve| curve.share);
    let curves = shapes.iter().map(|shape| Curve { share, shape: *shape });
    let columns = bristles.more_with(scene, j, &Way::new(scene, j), curves).into_iter();
    columns.map(|column| column.scaled(1.0 / share)).collect()
}

impl Candidate for Stribeck {
    fn kind(&self) -> Kind {
        Kind::Stribeck
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        // Up to twice the widest, to see where the search would end.
        let epsilon = scene.width_rad_s(joint(site));
        (0..=STEEP_AT_REST)
            .flat_map(|variant| {
                geometric(NARROWEST * epsilon, 2.0 * WIDEST * epsilon, 8)
                    .map(move |value| Shape { variant, value })
            })
            .collect()
    }

    fn finer_shapes(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Shape> {
        let least = NARROWEST_RATIONAL * scene.width_rad_s(joint(site));
        let values = WIDTHS_OF_RATIONAL.map(|width| width * shape.value).into_iter();
        let wide = values.filter(|value| *value >= least);
        wide.map(|value| Shape { variant: RATIONAL, value }).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn bank(&self, scene: &Scene, site: Option<usize>, shapes: &[Shape]) -> Vec<Vec<Column>> {
        let j = joint(site);
        match &scene.other_friction(j).bristles {
            Some(bristles) => {
                held(scene, j, bristles, shapes).into_iter().map(|column| vec![column]).collect()
            }
            None => shapes.iter().map(|shape| self.columns(scene, site, *shape)).collect(),
        }
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        if let Some(bristles) = &scene.other_friction(j).bristles {
            return held(scene, j, bristles, &[shape]);
        }
        let epsilon = scene.width_rad_s(j);
        let velocity = scene.turning_rad_s(
            j,
            FED,
            epsilon,
            #[inline(always)]
            |v| usual(shape, epsilon, v),
        );
        let beside = of_pairs(
            velocity,
            &scene.turned(j).sign,
            #[inline(always)]
            |v, sign| (usual(shape, epsilon, v) - sign) / USUAL_SHARE,
        );
        vec![Column::on(j, scene.as_logged(beside))]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("extra_nm", b[0], "Nm"), quantity("vs_rad_s", shape.value, "rad/s")]
    }

    fn near_rest_nm(&self, b: &[f64]) -> Option<f64> {
        Some(b[0])
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

    /// Friction that falls over the whole range of speeds follows another law, and so does friction that falls while
    /// the sign turns round.
    fn is_its_own(&self, scene: &Scene, site: Option<usize>, shape: Shape, _: &[f64]) -> bool {
        let widths = shape.value / scene.width_rad_s(joint(site));
        widths > AT_THE_END && widths <= WIDEST
    }

    fn is_commonplace(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> bool {
        shape.value > CONFINED * scene.width_rad_s(joint(site))
    }

    fn in_words(&self) -> &'static str {
        "friction that is larger near rest and falls with speed (Stribeck)"
    }

    fn form(&self, _: &Scene, shape: Shape) -> Option<&'static str> {
        Some(match shape.variant {
            RATIONAL => "extra/(1+(v/vs)^2)",
            STEEP_AT_REST => "extra exp(-v/vs)",
            _ => "extra exp(-(v/vs)^2)",
        })
    }
}
