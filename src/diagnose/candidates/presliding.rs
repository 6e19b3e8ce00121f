//! Friction that builds up behind a reversal: τ = F (z − sign q̇), dz/dq = k (1 − z sign q̇) (Dahl 1968).
//!
//! Bristles that are damped, as in the LuGre model (Canudas de Wit et al. 1995), add F T dz/dt, T = σ₁/σ₀. Few logs show it, so that
//! nothing is looked for with it; where presliding was found, it is a form of the law with another coefficient, F T.
//!
//! z is propagated exactly along the motion: over a stretch of one direction of length Δ,
//! z ← s + (z − s) e^{−kΔ}; a step within which the velocity reverses has two such stretches. Over a motion
//! that repeats it is carried round until it repeats as well.
//!
//! Stiff bristles turn round within a few samples, and what the samples show of that depends on the torque that the drive
//! gives meanwhile. One that feeds friction forward does so where the velocity that is wanted reverses. Under friction that
//! waits for the joint to reverse before it gives way, that is some milliseconds later, and later the more gently the joint
//! turns: no constant lead, as the null model has it, follows that. What a drive gives is worked out with the bristles
//! ([`given`]); which kind of drive it is, is a variant of the law.
//!
//! The angle of a single run is followed with play: it moves only as far as the doubt about the recorded
//! angles (their rounding) demands. Without, rounding at standstill would shake the friction loose.

use super::*;
use crate::dynamics::Real;

/// See the module.
pub struct Presliding;

/// Standard error of 1/k, rad, of a motion that repeats: the noise of the angles between which a joint turns round is in no
/// residual. Over eight periods with angles known to 2e-5 rad (32 arms, `reports/blind_history.md`) estimates scatter by 0.9
/// of what they claim with it. It does not follow the noise of other logs.
const TURN_RAD: f64 = 4.5e-6;
/// The same over 1/k, at most.
const MOST_ERROR: f64 = 0.15;
/// Stiffnesses that are tried, 1/rad.
const STIFFNESSES_PER_RAD: [f64; 2] = [20.0, 100_000.0];

/// What the drive of the joint gives where friction turns round, by variant.
#[derive(Clone, Copy)]
enum Drive {
    /// A share of friction by the sign of the joint's velocity, or nothing.
    BySign,
    /// A share of friction by the sign of the velocity that is wanted, and feedback of this bandwidth, rad/s.
    ByWantedVelocity(f64),
    /// What the bristles take: the joint moves as it is told.
    Bristles,
}

/// A bandwidth that is wrong by 1.7 moves 1/k by 2 % at most.
const DRIVES: [Drive; 4] =
    [Drive::BySign, Drive::ByWantedVelocity(30.0), Drive::ByWantedVelocity(80.0), Drive::Bristles];

/// Share β of friction that drives feed forward by the velocity that is wanted, if they do. By how much theirs is another is
/// told by the answers of the null model.
const FED: f64 = 0.9;
/// Widths of the model's sign behind which it has turned round but for 3e-7.
const TURNED: f64 = 8.0;
/// Over its largest, the least acceleration per torque that a joint may have as the arm moves. No arm's inertia changes a
/// thousandfold; where an estimate of it is not positive, what stands for it is larger by more.
const LEAST_MOBILITY: f64 = 1e-3;

/// Shapes of variants beyond those of [`DRIVES`] have damped bristles, behind the same drives.
const DAMPED: usize = DRIVES.len();
/// T, s, from which the derivative by it is taken: what a drive that feeds friction forward gives is not quite linear in T. Dampings of
/// LuGre models are some milliseconds.
const DAMPING_STEP_S: f64 = 1e-3;

/// Share of dry friction that the law has at least. Of bristles with dz/dq = k (1 − z sign q̇)^i (Dahl 1968) it is best
/// fitted with 1.10 (i = ½), 0.86 (i = 3/2) and 0.72 (i = 2) of their friction.
const LEAST_SHARE: f64 = 0.7;
/// The same of a single run, whose low-pass is slower than most of a reversal. Torques that are recorded late by 4 ms have 0.13 to
/// 0.16, a soft gear 0.07.
const LEAST_SHARE_OF_A_RUN: f64 = 0.25;

/// The way of a joint to each of its instants from the one before, rad.
struct Way {
    /// To the instant, or to where the joint turns round before it.
    there: Vec<f64>,
    /// From there to the instant.
    back: Vec<f64>,
    /// Velocities at the instants, rad/s. Of a motion that repeats they are those of the angles between its samples: how the
    /// model's friction bends them is not how bristles do.
    qd_rad_s: Vec<f64>,
}

impl Way {
    fn new(scene: &Scene, j: usize) -> Self {
        let Instants { q_rad, qd_rad_s, step_s, .. } = scene.instants(j);
        let doubt_rad = scene.angle_doubt_rad[j];
        let n = q_rad.len();
        let (q, qd_rad_s) = if scene.periodic {
            let rate = |k: usize| (q_rad[(k + 1) % n] - q_rad[(k + n - 1) % n]) / (2.0 * step_s);
            (q_rad.clone(), (0..n).map(rate).collect())
        } else {
            (with_play(q_rad, doubt_rad), qd_rad_s.clone())
        };
        let first = if scene.periodic { n - 1 } else { 0 };
        let before = std::iter::once(first).chain(0..n - 1);
        let way = |(k, now): (usize, usize)| {
            // An angle that is known to its resolution only says itself where it went.
            if doubt_rad > 0.0 {
                (q[now] - q[k], 0.0)
            } else {
                legs((q[k], qd_rad_s[k]), (q[now], qd_rad_s[now]), *step_s)
            }
        };
        let (there, back) = before.zip(0..n).map(way).unzip();
        Self { there, back, qd_rad_s }
    }

    /// z at the instants, which begins as `state` where the motion does not repeat.
    fn deflection(&self, is_periodic: bool, mut state: f64, stiffness_per_rad: f64) -> Vec<f64> {
        let lefts = of_pairs(
            self.there.clone(),
            &self.there,
            #[inline(always)]
            |leg, _| left_behind(leg, stiffness_per_rad),
        );
        let towards = |state: f64, leg: f64, left: f64| {
            let direction = if leg >= 0.0 { 1.0 } else { -1.0 };
            direction + (state - direction) * left
        };
        let mut z = vec![0.0; self.there.len()];
        // One lap forgets where the state began if the joint travels a few times 1/k; two are plenty.
        let laps = if is_periodic { 2 } else { 1 };
        for _ in 0..laps {
            for (((z, there), left), back) in
                z.iter_mut().zip(&self.there).zip(&lefts).zip(&self.back)
            {
                state = towards(state, *there, *left);
                if *back != 0.0 {
                    state = towards(state, *back, left_behind(*back, stiffness_per_rad));
                }
                *z = state;
            }
        }
        z
    }
}

/// dz/dt of the bristles, 1/s, whose deflection along `way` is z.
fn deflection_rate(way: &Way, z: &[f64], stiffness_per_rad: f64) -> Vec<f64> {
    let rate = |(qd, z): (&f64, &f64)| stiffness_per_rad * (qd - qd.abs() * z);
    way.qd_rad_s.iter().zip(z).map(rate).collect()
}

/// What is left of a deflection behind a leg of the way.
#[inline(always)]
fn left_behind(leg: f64, stiffness_per_rad: f64) -> f64 {
    Real::exp(-stiffness_per_rad * leg.abs())
}

/// Signed lengths of the way from one (angle, velocity) to the next: there and back where the velocity,
/// straight between them, passes through zero.
fn legs((q0, v0): (f64, f64), (q1, v1): (f64, f64), step_s: f64) -> (f64, f64) {
    if v0 * v1 >= 0.0 {
        return (q1 - q0, 0.0);
    }
    let turn = q0 + 0.5 * v0 * step_s * v0 / (v0 - v1);
    (turn - q0, q1 - turn)
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

/// What the drive of joint `j` gives at its instants over F, if it feeds friction forward by the velocity that is wanted and
/// its feedback has the bandwidth ω, critically damped, while friction is F z.
///
/// With a the joint's acceleration per torque, it lags behind that velocity by v:
///
/// v̇ = a F z − a τ, τ = β F s_ε(q̇ + v) + (2 ω v + ω² ∫ v dt)/a.
fn given(scene: &Scene, j: usize, way: &Way, z: &[f64], omega: f64) -> Vec<f64> {
    let step_s = scene.instant_s();
    let width = scene.arm.friction_epsilon_rad_s;
    let kicks = scene.kick_rad_s(j);
    // As if it had moved on in one direction.
    let at_rest = (1.0 - FED) * kicks[0] * z[0] / (omega * omega * step_s);
    let (mut lag, mut behind) = (0.0, at_rest);
    let mut out = vec![0.0; z.len()];
    // Where the first lap ends, the second begins.
    for _ in 0..2 {
        for (((out, z), kick), qd) in out.iter_mut().zip(z).zip(kicks).zip(&way.qd_rad_s) {
            let widths = (qd + lag) / width;
            let sign = if widths.abs() < TURNED { Real::tanh(widths) } else { widths.signum() };
            let feedback = (2.0 * omega * lag + omega * omega * behind) * step_s;
            lag += kick * (z - FED * sign) - feedback;
            behind += lag * step_s;
            *out = FED * sign + feedback / kick;
        }
    }
    out
}

/// The column of joint `j` with this `drive`, of a deflection z.
fn column(scene: &Scene, j: usize, way: &Way, z: &[f64], drive: Drive) -> Column {
    let sign = &scene.instants(j).sign;
    let less: Vec<f64> = z.iter().zip(sign).map(|(z, sign)| z - sign).collect();
    let column = match drive {
        Drive::ByWantedVelocity(omega) if moves_alike(scene, j) => {
            let given = given(scene, j, way, z, omega);
            // Beside what it gives for friction that turns round with the sign.
            let by_feedback = scene.answered(sign);
            let by_sign = sign.iter().zip(by_feedback).map(|(s, a)| FED * s + (1.0 - FED) * a);
            let more: Vec<f64> = given.iter().zip(by_sign).map(|(g, own)| g - own).collect();
            scene.as_logged_but(less, &more)
        }
        Drive::Bristles => scene.as_logged_but(less.clone(), &less),
        _ => scene.as_logged(less),
    };
    Column::on(j, column)
}

/// Starting stiffnesses of a variant. What a drive makes of bristles has one optimum between neighbours of a coarser grid.
fn grid(variant: usize) -> impl Iterator<Item = Shape> {
    let [softest, stiffest] = STIFFNESSES_PER_RAD;
    let count = if variant == 0 { 13 } else { 7 };
    geometric(softest, stiffest, count).map(move |value| Shape { variant, value })
}

/// Whether joint `j` has friction, and an inertia, in all of its poses: estimates may come to none in some.
fn moves_alike(scene: &Scene, j: usize) -> bool {
    let ends = |(least, most): (f64, f64), kick: &f64| (least.min(*kick), most.max(*kick));
    let (least, most) = scene.kick_rad_s(j).iter().fold((f64::INFINITY, 0.0), ends);
    scene.coulomb_nm[j] > 0.0 && least > LEAST_MOBILITY * most
}

impl Candidate for Presliding {
    fn kind(&self) -> Kind {
        Kind::Presliding
    }

    fn shapes(&self, scene: &Scene, _: Option<usize>) -> Vec<Shape> {
        let variants = if scene.periodic { DRIVES.len() } else { 1 };
        (0..variants).flat_map(grid).collect()
    }

    fn richer_shapes(&self, scene: &Scene) -> Vec<Shape> {
        let variants = if scene.periodic { DAMPED..2 * DAMPED } else { 0..0 };
        variants.flat_map(grid).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        self.bank(scene, site, &[shape]).remove(0)
    }

    fn bank(&self, scene: &Scene, site: Option<usize>, shapes: &[Shape]) -> Vec<Vec<Column>> {
        let j = joint(site);
        let (way, first) = (Way::new(scene, j), scene.instants(j).sign[0]);
        shapes
            .iter()
            .map(|shape| {
                let z = way.deflection(scene.periodic, first, shape.value);
                let drive = DRIVES[shape.variant % DAMPED];
                let dry = column(scene, j, &way, &z, drive);
                if shape.variant < DAMPED {
                    return vec![dry];
                }
                let rate = deflection_rate(&way, &z, shape.value);
                let damped: Vec<f64> =
                    z.iter().zip(rate).map(|(z, rate)| z + DAMPING_STEP_S * rate).collect();
                let more = column(scene, j, &way, &damped, drive).minus(&dry);
                vec![dry, more.scaled(1.0 / DAMPING_STEP_S)]
            })
            .collect()
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        let mut out = vec![
            quantity("stiffness_per_rad", shape.value, "1/rad"),
            quantity("coulomb_nm", b[0], "Nm"),
        ];
        out.extend(b.get(1).map(|damping| quantity("damping_s", damping / b[0], "s")));
        out
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
        b[0] > 0.0 && second(b) >= 0.0
    }

    /// All dry friction of a joint builds up behind a reversal. Where some of it does not, something else
    /// happens there: a torque recorded late, or another law of speed.
    fn is_its_own(&self, scene: &Scene, site: Option<usize>, _: Shape, b: &[f64]) -> bool {
        let least = if scene.periodic { LEAST_SHARE } else { LEAST_SHARE_OF_A_RUN };
        b[0] > least * scene.coulomb_nm[joint(site)]
    }

    fn form(&self, _: &Scene, shape: Shape) -> Option<&'static str> {
        (shape.variant >= DAMPED).then_some("damped bristles")
    }

    fn in_words(&self) -> &'static str {
        "friction that builds up over a small angle behind every reversal (presliding)"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Share of the friction of bristles with exponent i that the law is fitted with, by least squares over a way of 100/k
    /// behind a reversal, the level of friction being free. With w = 1 − z, w' = −wⁱ from w = 2.
    fn fitted_share(w: impl Fn(f64) -> f64) -> f64 {
        const POINTS: usize = 10_000;
        let ways: Vec<f64> = (0..=POINTS).map(|k| 100.0 * k as f64 / POINTS as f64).collect();
        let w: Vec<f64> = ways.iter().map(|x| w(*x)).collect();
        let mean = |y: &[f64]| y.iter().sum::<f64>() / y.len() as f64;
        let covariance = |a: &[f64], b: &[f64]| {
            let (mean_a, mean_b) = (mean(a), mean(b));
            a.iter().zip(b).map(|(a, b)| (a - mean_a) * (b - mean_b)).sum::<f64>()
        };
        let fit = |stiffness: f64| {
            let law: Vec<f64> = ways.iter().map(|x| 2.0 * left_behind(*x, stiffness)).collect();
            let along = covariance(&law, &w);
            let share = along / covariance(&law, &law);
            (share * along, share)
        };
        let best = geometric(0.1, 10.0, 400).map(fit).max_by(|a, b| a.0.total_cmp(&b.0));
        best.unwrap().1
    }

    #[test]
    fn other_exponents_are_fitted_with_most_of_their_friction() {
        let root = |x: f64| (2f64.sqrt() - 0.5 * x).max(0.0).powi(2);
        let three_halves = |x: f64| (0.5f64.sqrt() + 0.5 * x).powi(-2);
        let square = |x: f64| 1.0 / (0.5 + x);
        // Its own law between two of the stiffnesses, which are 1.2 % apart.
        assert!((fitted_share(|x| 2.0 * (-x).exp()) - 1.0).abs() < 0.01);
        // Half of the last digit that the constant's comment gives.
        assert!((fitted_share(root) - 1.10).abs() < 0.005);
        assert!((fitted_share(three_halves) - 0.86).abs() < 0.005);
        assert!((fitted_share(square) - 0.72).abs() < 0.005);
        assert!(fitted_share(square) > LEAST_SHARE);
    }
}
