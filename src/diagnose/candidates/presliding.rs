//! Friction that builds up behind a reversal: τ = F (z − sign q̇), dz/dq = k (1 − z sign q̇) (Dahl 1968).
//!
//! z is propagated exactly along the motion: over a stretch of one direction of length Δ,
//! z ← s + (z − s) e^{−kΔ}; a step within which the velocity reverses has two such stretches. Over a motion
//! that repeats it is carried round until it repeats as well.
//!
//! The angle of a single run is followed with play: it moves only as far as the doubt about the recorded
//! angles (their rounding) demands. Without, rounding at standstill would shake the friction loose.

use super::*;
use crate::dynamics::Real;

/// See the module.
pub struct Presliding;

/// Standard error of 1/k, rad, of a motion that repeats: how a joint turns round between two samples is not known better.
/// In ten arms simulated almost without noise (all joints but the first, 1/k = 100 µrad) 1/k was off by 4.3 µrad rms, mostly
/// too large. Bends between the
/// samples by the bristles' own friction, solved together with their deflection, changed that by nothing.
const TURN_RAD: f64 = 4.5e-6;
/// The same over 1/k, at most.
const MOST_ERROR: f64 = 0.15;

/// z at the instants of joint `j`, for a stiffness `k` in 1/rad.
fn deflection(scene: &Scene, j: usize, stiffness_per_rad: f64) -> Vec<f64> {
    let Instants { q_rad, qd_rad_s, sign, step_s } = scene.instants(j);
    let (q, qd) = (with_play(q_rad, scene.angle_doubt_rad[j]), qd_rad_s);
    let first = if scene.periodic { q.len() - 1 } else { 0 };
    let before = std::iter::once(first).chain(0..q.len() - 1);
    let way = |(k, now): (usize, usize)| {
        // An angle that is known to a quantum only says itself where it went.
        if scene.angle_doubt_rad[j] > 0.0 {
            [q[now] - q[k], 0.0]
        } else {
            legs((q[k], qd[k]), (q[now], qd[now]), *step_s)
        }
    };
    let (ways, behind): (Vec<f64>, Vec<f64>) =
        before.zip(0..q.len()).map(way).map(|[way, behind]| (way, behind)).unzip();
    let lefts = of_pairs(
        ways.clone(),
        &ways,
        #[inline(always)]
        |leg, _| left_behind(leg, stiffness_per_rad),
    );
    let towards = |state: f64, leg: f64, left: f64| {
        let direction = if leg >= 0.0 { 1.0 } else { -1.0 };
        direction + (state - direction) * left
    };
    let mut z = vec![0.0; q.len()];
    let mut state = sign[0];
    // One lap forgets where the state began if the joint travels a few times 1/k; two are plenty.
    let laps = if scene.periodic { 2 } else { 1 };
    for _ in 0..laps {
        for (((z, way), left_of_way), behind) in z.iter_mut().zip(&ways).zip(&lefts).zip(&behind) {
            state = towards(state, *way, *left_of_way);
            if *behind != 0.0 {
                state = towards(state, *behind, left_behind(*behind, stiffness_per_rad));
            }
            *z = state;
        }
    }
    z
}

/// What is left of a deflection behind a leg of the way.
#[inline(always)]
fn left_behind(leg: f64, stiffness_per_rad: f64) -> f64 {
    Real::exp(-stiffness_per_rad * leg.abs())
}

/// Signed lengths of the way from one (angle, velocity) to the next: there and back where the velocity,
/// straight between them, passes through zero.
fn legs((q0, v0): (f64, f64), (q1, v1): (f64, f64), step_s: f64) -> [f64; 2] {
    if v0 * v1 >= 0.0 {
        return [q1 - q0, 0.0];
    }
    let turn = q0 + 0.5 * v0 * step_s * v0 / (v0 - v1);
    [turn - q0, q1 - turn]
}

/// The angle that stays within ± `half_width` of `q` and moves only when it must.
fn with_play(q: &[f64], half_width: f64) -> Vec<f64> {
    let mut angle = q[0];
    q.iter()
        .map(|q| {
            angle = angle.clamp(q - half_width, q + half_width);
            angle
        })
        .collect()
}

impl Candidate for Presliding {
    fn kind(&self) -> Kind {
        Kind::Presliding
    }

    fn shapes(&self, _: &Scene, _: Option<usize>) -> Vec<Shape> {
        geometric(20.0, 100_000.0, 13).map(|value| Shape { variant: 0, value }).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let z = deflection(scene, j, shape.value);
        let less = z.iter().zip(&scene.instants(j).sign).map(|(z, sign)| z - sign);
        vec![Column::on(j, scene.as_logged(less.collect()))]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![
            quantity("stiffness_per_rad", shape.value, "1/rad"),
            quantity("coulomb_nm", b[0], "Nm"),
        ]
    }

    fn size(&self, quantities: &[Quantity]) -> Option<Quantity> {
        quantities.get(1).copied()
    }

    fn form_error(&self, scene: &Scene, shape: Shape) -> f64 {
        if scene.periodic { (TURN_RAD * shape.value).min(MOST_ERROR) } else { 0.0 }
    }

    fn separating_experiment(&self) -> &'static str {
        "triangular motion of ±2 mrad: the torque follows the angle on a hysteresis loop"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    /// All dry friction of a joint builds up behind a reversal. Where most of it does not, something else
    /// happens there: a torque recorded late, or another law of speed.
    fn is_its_own(&self, scene: &Scene, site: Option<usize>, _: Shape, b: &[f64]) -> bool {
        !scene.periodic || b[0] > 0.5 * scene.coulomb_nm[joint(site)]
    }

    fn in_words(&self) -> &'static str {
        "friction that builds up over a small angle behind every reversal (presliding)"
    }
}
