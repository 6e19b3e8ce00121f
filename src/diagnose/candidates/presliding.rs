//! Friction that builds up after a reversal (presliding): τ = F (z − sign q̇), dz/dq = k (1 − z sign q̇) (Dahl 1968).
//!
//! Damped bristles, as in the LuGre model (Canudas de Wit et al. 1995), add F T dz/dt with T = σ₁/σ₀. Few logs show the
//! damping, so it does not take part in the search. Where presliding was found, it is a further form of the law, with
//! F T as a second coefficient.
//!
//! z is propagated exactly along the motion. Over a stretch of length Δ in one direction s, z ← s + (z − s) e^{−kΔ}; a
//! step within which the velocity reverses consists of two such stretches. Over a periodic motion, z is carried round
//! until it repeats as well.
//!
//! Stiff bristles turn round within a few samples, and how the samples show it depends on the torque that the drive
//! gives meanwhile. A drive that feeds friction forward does so where the commanded velocity reverses. Real presliding
//! friction gives way only after the joint has reversed, some milliseconds later, and the later the more gently the
//! joint turns. A constant lead, as in the null model, cannot follow that. The torque of the drive is therefore
//! simulated along with the bristles ([`given`]); the kind of drive is a variant of the law.
//!
//! In a single run, the angle is followed with play: it moves only as far as the uncertainty of the recorded angles
//! (their rounding) demands. Without this play, rounding at standstill would shake the friction loose.

use super::*;
use crate::dynamics::Real;

/// See the module.
pub struct Presliding;

/// Standard error of 1/k, rad, for a periodic motion: the noise of the angles between which a joint turns round is in
/// no residual. Over eight periods with angles known to 2e-5 rad (32 arms, `reports/blind_history.md`), estimates then
/// scatter by 0.9 of the error that they claim. The constant does not adapt to the angle noise of other logs.
const TURN_RAD: f64 = 4.5e-6;
/// Upper limit of this standard error relative to 1/k.
const MOST_ERROR: f64 = 0.15;
/// Range of stiffnesses that is searched, 1/rad.
const STIFFNESSES_PER_RAD: [f64; 2] = [20.0, 100_000.0];

/// How the drive of the joint reacts to friction that turns round, by variant.
#[derive(Clone, Copy)]
enum Drive {
    /// It feeds forward a share of friction by the sign of the joint's velocity, or nothing.
    BySign,
    /// It feeds forward a share of friction by the sign of the commanded velocity, and has feedback of this bandwidth,
    /// rad/s.
    ByWantedVelocity(f64),
    /// It gives exactly what the bristles take: the joint moves as commanded.
    Bristles,
}

/// The drives that are tried. A bandwidth that is wrong by a factor of 1.7 moves 1/k by 2 % at most.
const DRIVES: [Drive; 4] =
    [Drive::BySign, Drive::ByWantedVelocity(30.0), Drive::ByWantedVelocity(80.0), Drive::Bristles];

/// Share β of friction that drives feed forward by the commanded velocity, if they do. How much the actual share
/// differs is left to the drive-answer columns of the null model.
const FED: f64 = 0.9;
/// Widths of the model's regularised sign beyond which it is complete up to 3e-7.
const TURNED: f64 = 8.0;
/// Smallest acceleration per torque that a joint may have as the arm moves, relative to its largest. No arm's inertia
/// changes a thousandfold. Where an estimated inertia is not positive, the value that replaces it is off by more than
/// that.
const LEAST_MOBILITY: f64 = 1e-3;

/// Variants from this one on have damped bristles, behind the same drives as [`DRIVES`].
const DAMPED: usize = DRIVES.len();
/// T, s, over which the derivative by T is taken: the torque of a drive that feeds friction forward is not quite linear in
/// T. LuGre models have dampings of some milliseconds.
const DAMPING_STEP_S: f64 = 1e-3;

/// Smallest share of the joint's dry friction that the law must account for. Bristles with dz/dq = k (1 − z sign q̇)^i
/// (Dahl 1968) are best fitted with 1.10 (i = ½), 0.86 (i = 3/2) and 0.72 (i = 2) of their friction.
const LEAST_SHARE: f64 = 0.7;
/// The same for a single run, whose low-pass is slower than most of a reversal. Torques that are recorded 4 ms late
/// give shares of 0.13 to 0.16, a soft gear 0.07.
const LEAST_SHARE_OF_A_RUN: f64 = 0.25;

/// Path of a joint from each of its instants to the next, rad.
struct Way {
    /// Path to the instant, or to the point before it where the joint turns round.
    there: Vec<f64>,
    /// Path from that turning point to the instant; 0 without one.
    back: Vec<f64>,
    /// Velocities at the instants, rad/s. For a periodic motion, they are differences of the angles between the
    /// samples: the velocities of [`Instants`] are bent by the model's friction, not by bristles.
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
            // An angle known only to its resolution allows no turning point between two instants.
            if doubt_rad > 0.0 {
                (q[now] - q[k], 0.0)
            } else {
                legs((q[k], qd_rad_s[k]), (q[now], qd_rad_s[now]), *step_s)
            }
        };
        let (there, back) = before.zip(0..n).map(way).unzip();
        Self { there, back, qd_rad_s }
    }

    /// z at the instants. It begins as `state` where the motion does not repeat.
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
        // One lap forgets the initial state if the joint travels a few times 1/k; two are plenty.
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

/// dz/dt, 1/s, of bristles whose deflection along `way` is z.
fn deflection_rate(way: &Way, z: &[f64], stiffness_per_rad: f64) -> Vec<f64> {
    let rate = |(qd, z): (&f64, &f64)| stiffness_per_rad * (qd - qd.abs() * z);
    way.qd_rad_s.iter().zip(z).map(rate).collect()
}

/// Factor by which a leg of the path reduces the distance of a deflection from its limit.
#[inline(always)]
fn left_behind(leg: f64, stiffness_per_rad: f64) -> f64 {
    Real::exp(-stiffness_per_rad * leg.abs())
}

/// Signed lengths of the path from one (angle, velocity) to the next: there and back, where the linearly interpolated
/// velocity passes through zero.
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

/// Torque, relative to F, that the drive of joint `j` gives at its instants while friction is F z. The drive feeds
/// friction forward by the commanded velocity and has critically damped feedback of bandwidth ω.
///
/// With a the joint's acceleration per torque, the joint lags behind the commanded velocity by v:
///
/// v̇ = a F z − a τ, τ = β F s_ε(q̇ + v) + (2 ω v + ω² ∫ v dt)/a.
fn given(scene: &Scene, j: usize, way: &Way, z: &[f64], omega: f64) -> Vec<f64> {
    let step_s = scene.instant_s();
    let width = scene.arm.friction_epsilon_rad_s;
    let kicks = scene.kick_rad_s(j);
    // Initial state: as if the joint had always moved in one direction.
    let at_rest = (1.0 - FED) * kicks[0] * z[0] / (omega * omega * step_s);
    let (mut lag, mut behind) = (0.0, at_rest);
    let mut out = vec![0.0; z.len()];
    // The second lap begins where the first one ends.
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

/// Column of joint `j` for this `drive` and the deflection z.
fn column(scene: &Scene, j: usize, way: &Way, z: &[f64], drive: Drive) -> Column {
    let sign = &scene.instants(j).sign;
    let less: Vec<f64> = z.iter().zip(sign).map(|(z, sign)| z - sign).collect();
    let column = match drive {
        Drive::ByWantedVelocity(omega) if moves_alike(scene, j) => {
            let given = given(scene, j, way, z, omega);
            // Difference from what the drive gives for friction that follows the sign, as the null model has it.
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

/// Starting stiffnesses of a variant. With the reaction of a drive, there is one optimum between neighbours of a coarser
/// grid as well.
fn grid(variant: usize) -> impl Iterator<Item = Shape> {
    let [softest, stiffest] = STIFFNESSES_PER_RAD;
    let count = if variant.is_multiple_of(DAMPED) { 13 } else { 7 };
    geometric(softest, stiffest, count).map(move |value| Shape { variant, value })
}

/// Whether joint `j` has friction, and a positive inertia in all of its poses: estimated inertias may be non-positive
/// in some.
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

    fn least(&self) -> f64 {
        0.0
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0 && second(b) >= 0.0
    }

    /// All dry friction of a joint builds up after a reversal. Where some of it does not, something else happens there:
    /// a torque recorded late, or another dependence on speed.
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

    /// Share of their friction with which bristles of exponent i are fitted by the law, by least squares over a path of
    /// 100/k after a reversal, with the level of friction free. With w = 1 − z, w' = −wⁱ from w = 2.
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
        // The law itself, between two of the tried stiffnesses, which are 1.2 % apart.
        assert!((fitted_share(|x| 2.0 * (-x).exp()) - 1.0).abs() < 0.01);
        // Tolerance: half of the last digit given at the constant.
        assert!((fitted_share(root) - 1.10).abs() < 0.005);
        assert!((fitted_share(three_halves) - 0.86).abs() < 0.005);
        assert!((fitted_share(square) - 0.72).abs() < 0.005);
        assert!(fitted_share(square) > LEAST_SHARE);
    }
}
