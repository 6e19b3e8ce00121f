//! Bristles behind the reversals of a joint: how far they are bent along a motion, and what the samples of a log show
//! of it.
//!
//! A bristle that is bent by z gives the friction F z, dz/dq = k (1 − z sign q̇/γ). It comes to rest at z = ±γ. With
//! γ = 1 it is Dahl's (1968), with the Stribeck curve γ(q̇) = 1 + e s(|q̇|) that of the LuGre model (Canudas de Wit et
//! al. 1995); damping adds F T dz/dt.
//!
//! z is propagated exactly along the motion. Over a stretch of length Δ in one direction s,
//! z ← γ s + (z − γ s) e^{−kΔ/γ}, with γ at the mean speed of the stretch; a step within which the velocity reverses
//! consists of two such stretches. Over a periodic motion, z is carried round until it repeats as well.

use super::candidates::Shape;
use super::candidates::stribeck::near_rest;
use super::image::Column;
use super::scene::{Instants, Scene};
use crate::dynamics::{Real, of_pairs};

/// How the drive of the joint reacts to friction that turns round, by variant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drive {
    /// It feeds forward a share of friction by the sign of the joint's velocity, or nothing.
    BySign,
    /// It feeds forward a share of friction by the sign of the commanded velocity, and has feedback of this bandwidth,
    /// rad/s.
    ByWantedVelocity(f64),
    /// It gives exactly what the bristles take: the joint moves as commanded.
    Bristles,
}

/// The drives that are tried. A bandwidth that is wrong by a factor of 1.7 moves 1/k by 2 % at most.
pub const DRIVES: [Drive; 4] =
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

/// Friction near rest that bristles hold beside Coulomb friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve {
    /// Its height e, relative to Coulomb friction.
    pub share: f64,
    /// How it falls with speed: a shape of [`Stribeck`](super::candidates::stribeck::Stribeck).
    pub shape: Shape,
}

impl Curve {
    /// γ at the speed `qd_rad_s`.
    #[inline(always)]
    fn rest(&self, qd_rad_s: f64) -> f64 {
        1.0 + self.share * near_rest(self.shape, qd_rad_s)
    }
}

/// Bristles that were found on a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bristles {
    /// k, 1/rad.
    pub stiffness_per_rad: f64,
    /// T, s.
    pub damping_s: f64,
    /// Coulomb friction F, Nm.
    pub coulomb_nm: f64,
    /// The drive behind which they were found.
    pub drive: Drive,
    /// The Stribeck curve that was found with them.
    pub curve: Option<Curve>,
}

impl Bristles {
    /// Torque, relative to F, that each of the `curves` adds to these bristles on joint `j`, as logged.
    pub fn more_with(
        &self,
        scene: &Scene,
        j: usize,
        way: &Way,
        curves: impl Iterator<Item = Curve>,
    ) -> Vec<Column> {
        let with = |curve: Option<Curve>| {
            let z = way.deflection(self.stiffness_per_rad, curve);
            let damped = way.damped(&z, self.stiffness_per_rad, curve, self.damping_s);
            column(scene, j, way, &damped, self.drive)
        };
        let without = with(None);
        curves.map(|curve| with(Some(curve)).minus(&without)).collect()
    }
}

/// Path of a joint from each of its instants to the next, rad.
pub struct Way {
    /// Path to the instant, or to the point before it where the joint turns round.
    there: Vec<f64>,
    /// Path from that turning point to the instant; 0 without one.
    back: Vec<f64>,
    /// Velocities at the instants, rad/s. For a periodic motion, they are differences of the angles between the
    /// samples: the velocities of [`Instants`] are bent by the model's friction, not by bristles.
    qd_rad_s: Vec<f64>,
    /// Mean velocity on the path `there`, rad/s.
    mean_rad_s: Vec<f64>,
    /// Direction in which the joint moves at the first instant.
    first: f64,
    is_periodic: bool,
}

impl Way {
    /// The path of joint `j`.
    pub fn new(scene: &Scene, j: usize) -> Self {
        let Instants { q_rad, qd_rad_s, step_s, sign } = scene.instants(j);
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
        let mean = |(k, now): (usize, usize)| {
            let (v0, v1) = (qd_rad_s[k], qd_rad_s[now]);
            if v0 * v1 >= 0.0 { 0.5 * (v0 + v1) } else { 0.5 * v0 }
        };
        let mean_rad_s = before.clone().zip(0..n).map(mean).collect();
        let way = |(k, now): (usize, usize)| {
            // An angle known only to its resolution allows no turning point between two instants.
            if doubt_rad > 0.0 {
                (q[now] - q[k], 0.0)
            } else {
                legs((q[k], qd_rad_s[k]), (q[now], qd_rad_s[now]), *step_s)
            }
        };
        let (there, back) = before.zip(0..n).map(way).unzip();
        Self { there, back, qd_rad_s, mean_rad_s, first: sign[0], is_periodic: scene.periodic }
    }

    /// z at the instants, for bristles of the stiffness k that hold `curve`, if any.
    pub fn deflection(&self, stiffness_per_rad: f64, curve: Option<Curve>) -> Vec<f64> {
        self.deflection_but(stiffness_per_rad, curve, &[])
    }

    /// [`Self::deflection`] of bristles that are free at the instants that belong to a rest ([`Self::held`]).
    pub fn deflection_but(
        &self,
        stiffness_per_rad: f64,
        curve: Option<Curve>,
        rest_of: &[Option<usize>],
    ) -> Vec<f64> {
        let rest = |qd_rad_s: f64| curve.map_or(1.0, |curve| curve.rest(qd_rad_s));
        let rests = self.rests(&self.mean_rad_s, curve);
        let lefts = of_pairs(
            self.there.clone(),
            &rests,
            #[inline(always)]
            |leg, rest| left_behind(leg, stiffness_per_rad / rest),
        );
        let towards = |state: f64, leg: f64, rest: f64, left: f64| {
            let limit = if leg >= 0.0 { rest } else { -rest };
            limit + (state - limit) * left
        };
        let mut state = self.first * rest(self.mean_rad_s[0]);
        let mut z = vec![0.0; self.there.len()];
        // One lap forgets the initial state if the joint travels a few times 1/k; two are plenty.
        let laps = if self.is_periodic { 2 } else { 1 };
        for _ in 0..laps {
            for (k, z) in z.iter_mut().enumerate() {
                state = towards(state, self.there[k], rests[k], lefts[k]);
                let back = self.back[k];
                if back != 0.0 {
                    let rest = rest(0.5 * self.qd_rad_s[k]);
                    state = towards(state, back, rest, left_behind(back, stiffness_per_rad / rest));
                }
                if rest_of.get(k).is_some_and(Option::is_some) {
                    state = 0.0;
                }
                *z = state;
            }
        }
        z
    }

    /// For each of `rests` rests, what its deflection of one makes of undamped bristles at the instants: one in the rest
    /// itself, and what is left of it from there to the next rest. `rest_of` says to which rest an instant belongs.
    pub fn held(
        &self,
        stiffness_per_rad: f64,
        rest_of: &[Option<usize>],
        rests: usize,
    ) -> Vec<Vec<f64>> {
        let n = rest_of.len();
        let mut out = vec![vec![0.0; n]; rests];
        let first = rest_of.iter().position(Option::is_some).unwrap_or(0);
        let (mut last, mut left) = (None, 0.0);
        for k in (first..first + n).map(|k| k % n) {
            match rest_of[k] {
                Some(rest) => (last, left) = (Some(rest), 1.0),
                None => {
                    let path = self.there[k].abs() + self.back[k].abs();
                    left *= left_behind(path, stiffness_per_rad);
                }
            }
            if let Some(rest) = last {
                out[rest][k] = left;
            }
        }
        out
    }

    /// z + T dz/dt of bristles whose deflection along the way is z: their friction relative to F.
    pub fn damped(
        &self,
        z: &[f64],
        stiffness_per_rad: f64,
        curve: Option<Curve>,
        damping_s: f64,
    ) -> Vec<f64> {
        let rests = self.rests(&self.qd_rad_s, curve);
        let damped = |((qd, rest), z): ((&f64, f64), &f64)| {
            let rate = stiffness_per_rad * (qd - qd.abs() * (z / rest));
            z + damping_s * rate
        };
        self.qd_rad_s.iter().zip(rests).zip(z).map(damped).collect()
    }

    /// γ at the speeds `qd_rad_s`.
    fn rests(&self, qd_rad_s: &[f64], curve: Option<Curve>) -> Vec<f64> {
        match curve {
            None => vec![1.0; qd_rad_s.len()],
            Some(curve) => of_pairs(
                qd_rad_s.to_vec(),
                qd_rad_s,
                #[inline(always)]
                |qd, _| curve.rest(qd),
            ),
        }
    }
}

/// Factor by which a leg of the path reduces the distance of a deflection from its limit.
#[inline(always)]
pub fn left_behind(leg: f64, stiffness_per_rad: f64) -> f64 {
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
    // Initial state: as if the joint had always moved in one direction. The second lap begins where the first one ends.
    let lacking = z[0] - FED * way.first;
    let at_rest = lacking * kicks[0] / (omega * omega * step_s);
    let (mut lag, mut behind) = (0.0, at_rest);
    let mut out = vec![0.0; z.len()];
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

/// What the samples show of friction z on joint `j` behind this `drive`, less that of the model, relative to F.
pub fn column(scene: &Scene, j: usize, way: &Way, z: &[f64], drive: Drive) -> Column {
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

/// Whether joint `j` has friction, and a positive inertia in all of its poses: estimated inertias may be non-positive
/// in some.
fn moves_alike(scene: &Scene, j: usize) -> bool {
    let ends = |(least, most): (f64, f64), kick: &f64| (least.min(*kick), most.max(*kick));
    let (least, most) = scene.kick_rad_s(j).iter().fold((f64::INFINITY, 0.0), ends);
    scene.coulomb_nm[j] > 0.0 && least > LEAST_MOBILITY * most
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint that sets off from two rests, reverses and rests again. Bristles that held z₀ at a rest go from there as
    /// bristles that held nothing do, plus z₀ times what is left of it, until the next rest.
    #[test]
    fn what_a_rest_held_adds_to_what_free_bristles_do() {
        const STIFFNESS_PER_RAD: f64 = 100.0;
        let there = vec![0.0, 0.0, 3e-3, 5e-3, -2e-3, -6e-3, 0.0, 0.0, -1e-3, -4e-3, 2e-3, 0.0];
        let back = vec![0.0, 0.0, 0.0, -1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 2e-3, 0.0, 0.0];
        let n = there.len();
        let rest_of: Vec<Option<usize>> = (0..n)
            .map(|k| match k {
                0 | 1 | 11 => Some(0),
                6 | 7 => Some(1),
                _ => None,
            })
            .collect();
        let held = [0.6, -0.3];
        let legs: Vec<[f64; 2]> = there.iter().zip(&back).map(|(t, b)| [*t, *b]).collect();
        let way = Way {
            there,
            back,
            qd_rad_s: vec![0.0; n],
            mean_rad_s: vec![0.0; n],
            first: 1.0,
            is_periodic: true,
        };
        let free = way.deflection_but(STIFFNESS_PER_RAD, None, &rest_of);
        let left = way.held(STIFFNESS_PER_RAD, &rest_of, held.len());
        let mut z = held[0];
        for k in 0..n {
            match rest_of[k] {
                Some(rest) => z = held[rest],
                None => {
                    for leg in legs[k].into_iter().filter(|leg| *leg != 0.0) {
                        let limit = leg.signum();
                        z = limit + (z - limit) * (-STIFFNESS_PER_RAD * leg.abs()).exp();
                    }
                }
            }
            let sum = free[k] + held[0] * left[0][k] + held[1] * left[1][k];
            assert!((z - sum).abs() < 1e-14, "{k}: {z} {sum}");
        }
    }
}
