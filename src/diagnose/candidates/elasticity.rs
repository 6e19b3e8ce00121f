//! A compliant gear: link angle q_L, motor angle q_M, k (q_M − q_L) = τ_L.
//!
//! Where the log has the motor's angle, the links move by δ less than it says. The torques on all joints change by τ(q
//! − δ, q̇ − δ̇, q̈ − δ̈) − τ(q, q̇, q̈). The link swings on its spring,
//!
//! ```text
//! M_jj(q) δ̈ + d δ̇ + k δ = τ_L
//! ```
//!
//! with τ_L the load along the motor's motion, as far as the log determines it. The slow part of τ_L bends the gear by
//! τ_L/k. Where joints reverse, the drive jolts the gear too fast for the log to show how the motor responds. The
//! links' share τ_J of these jolts is known ([`Scene::fine_jolt_nm`]), and makes rotor and links swing against each
//! other:
//!
//! ```text
//! δ̈ = (τ_J − k δ − (d + d_M) δ̇) (I_a⁻¹ + [(M + I_a')⁻¹]_jj)
//! ```
//!
//! This swing reveals stiff gears that hardly bend. The drives damp it by d_M ([`held_nm_s_rad`]), with torques of which
//! the samples of a log show less than they do ([`Lag::column`]).
//!
//! Where the log has the link's angle, the rotor and its friction move more: I_a δ̈ + F_v δ̇ + F_c [tanh((q̇ + δ̇)/ε) −
//! tanh(q̇/ε)] on the joint itself, with δ = τ_L/(k + i d ω) (further variants; the friction reverses where the motor
//! does). Here τ_L is differentiated twice, and its noise is in the residual as well. With a load known only ten times
//! better than its noise, the two correlate and produce stiff gears in clean logs. Such a load is therefore used for
//! soft gears only ([`stiffest_nm_rad`]), and a load known a hundred times better for all gears. The stiffness is in
//! the coefficient 1/k; the shape only says how fast the gear swings.

use std::f64::consts::TAU;
use std::ops::Range;

use super::*;
use crate::diagnose::scene::FINE;
use crate::dynamics::Motion;
use crate::identify::FEEDBACK_RAD_S;
use fourier::Complex64;

/// See the module.
pub struct Elasticity;

/// Damping d of the gear relative to the critical damping of the rotor on the spring, 2 √(k Ia): a few percent in
/// strain-wave gears.
const DAMPING_RATIO: f64 = 0.05;

/// How a gear responds to the jolts of its drive, relative to the assumptions of the law: how much of the friction the
/// drive does not feed forward, how strongly it damps, and on how stiff a spring the gear swings.
#[derive(Clone, Copy)]
pub(super) struct Jolts {
    pub(super) height: f64,
    pub(super) damping: f64,
    pub(super) stiffness: f64,
}

impl Jolts {
    /// The assumptions of the law.
    pub(super) const USUAL: Self = Self { height: 1.0, damping: 1.0, stiffness: 1.0 };
    /// Responses with other drives. Only the direction of each difference matters, and deviations both ways are listed
    /// where they are not proportional.
    pub(super) const OF_OTHER_DRIVES: [Self; 3] = [
        Self { height: 0.7, ..Self::USUAL },
        Self { damping: 0.4, ..Self::USUAL },
        Self { damping: 2.5, ..Self::USUAL },
    ];
    /// Responses where a gear swings faster or slower than its static stiffness implies.
    const OF_OTHER_SWINGS: [Self; 2] =
        [Self { stiffness: 0.85, ..Self::USUAL }, Self { stiffness: 1.2, ..Self::USUAL }];
}

/// Number of variants with the encoder on the motor. In the first, the links are driven by the part of the motion that
/// is known a hundred times better than its noise, and by jolts beyond it; gears that swing faster than that part need
/// these. In the second, they are driven by what is known ten times better, for gears that swing within it.
pub const ON_MOTOR: usize = 2;
/// Damping ratios of the further variants, with the encoder on the link: a loop closed over the gear needs damping.
const LINK_DAMPING_RATIO: [f64; 2] = [0.05, 0.3];
/// First variant with the encoder on the link whose load is known a hundred times better than its noise. The variants
/// before it use a load known ten times better.
const WELL_KNOWN_ON_LINK: usize = ON_MOTOR + LINK_DAMPING_RATIO.len();
/// The range of stiffnesses, Nm/rad.
const SOFTEST_NM_RAD: f64 = 2e3;
/// See [`SOFTEST_NM_RAD`].
const STIFFEST_NM_RAD: f64 = 2e5;
/// Number of starting stiffnesses where the links' resonance tells neighbours apart.
const STIFFNESSES: usize = 14;
/// The same where only the static deflection of the gear tells them apart.
const BENT_STIFFNESSES: usize = 3;
/// Largest plausible twist of a gear, rad: beyond it, the teeth would no longer mesh.
const MOST_TWIST_RAD: f64 = 0.1;
/// Run-in of a simulated swing, in multiples of the time in which it decays to 1/e: 1 % of its initial state is left.
const FORGOTTEN: f64 = 4.6;
/// Longest run-in, s.
const LONGEST_RUN_IN_S: f64 = 30.0;

/// How far the links of a joint lag behind its encoder.
pub(super) struct Lag {
    /// δ at the samples, rad.
    pub(super) angle_rad: Vec<f64>,
    /// δ̇, rad/s.
    pub(super) rate_rad_s: Vec<f64>,
    /// δ̈, rad/s².
    pub(super) acceleration_rad_s2: Vec<f64>,
}

impl Lag {
    /// The lag `angle_rad`, with rates derived from its samples.
    pub(super) fn slow(scene: &Scene, angle_rad: Vec<f64>) -> Self {
        let rate_rad_s = scene.derivative(&angle_rad);
        Self::logged(scene, angle_rad, rate_rad_s)
    }

    /// The lag with a given δ̇, which may hold more than the derivative of δ, and which the log has at its samples
    /// only.
    pub(super) fn logged(scene: &Scene, angle_rad: Vec<f64>, rate_rad_s: Vec<f64>) -> Self {
        Self { acceleration_rad_s2: scene.accelerations(&rate_rad_s), angle_rad, rate_rad_s }
    }

    /// Change of the torques on all joints when joint `j` has this lag, per unit of `scale`.
    ///
    /// The drives answer the lag with −ω M_ij δ̇ on joint i ([`held_nm_s_rad`]). The log has this torque at its samples,
    /// and what it does in the derivative of the sampled velocities. For swings faster than half the rate the two are
    /// different: what remains is −ω M_ij (δ̇ − D δ), where D δ is the derivative of the sampled δ
    /// ([`FineClock::as_logged_but`](crate::signal::FineClock::as_logged_but)).
    pub(super) fn column(&self, scene: &Scene, j: usize, scale: f64) -> Column {
        let mut column = give_way(scene, &self.of(scene, j), scale);
        if !scene.periodic {
            return column;
        }
        let known_rad_s = scene.accelerations(&self.angle_rad);
        let unseen: Vec<f64> =
            self.rate_rad_s.iter().zip(known_rad_s).map(|(rate, known)| rate - known).collect();
        for (i, torque_nm) in &mut column.parts {
            let mass = scene.mass_kg_m2[j].joint(*i);
            for ((nm, mass), unseen) in torque_nm.iter_mut().zip(mass).zip(&unseen) {
                *nm -= FEEDBACK_RAD_S * mass * unseen / scale;
            }
        }
        column
    }

    /// Motion of the links when joint `j` has this lag.
    pub(super) fn of(&self, scene: &Scene, j: usize) -> Motion {
        let mut motion: Motion = scene.motion.clone();
        for k in 0..scene.samples() {
            motion.q_rad.joint_mut(j)[k] -= self.angle_rad[k];
            motion.qd_rad_s.joint_mut(j)[k] -= self.rate_rad_s[k];
            motion.qdd_rad_s2.joint_mut(j)[k] -= self.acceleration_rad_s2[k];
        }
        motion
    }
}

/// Lag of the links on joint `j`, which swing behind a motor that moves as recorded, and against a motor that jolts
/// where joints reverse.
///
/// In a single run, whose accelerations come from its low-pass, only the bending by the known part of the load is used.
/// Without this restriction, noise of the velocities produced gears of 20 σ in clean logs.
fn swing(scene: &Scene, j: usize, variant: usize, stiffness_nm_rad: f64, made: Jolts) -> Lag {
    if !scene.periodic {
        let bent = |load: &f64| load / stiffness_nm_rad;
        return Lag::slow(scene, scene.bending_nm(j).iter().map(bent).collect());
    }
    let n = scene.samples();
    let [load, jolts] = match variant {
        0 => [scene.fine_link_nm(j), scene.fine_jolt_nm(j)],
        _ => scene.fine_bending_nm(j),
    };
    let inertia = scene.mass_kg_m2[j].joint(j);
    let mobility = scene.mobility_per_kg_m2.joint(j);
    let step_s = scene.instant_s();
    let rotor = scene.rotor_kg_m2[j];
    let critical = 2.0 * (stiffness_nm_rad * rotor).sqrt();
    let heaviest = inertia.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let fades_in_s = 2.0 * heaviest / (DAMPING_RATIO * critical);
    let mut entered = scene.entered((FORGOTTEN * fades_in_s).min(LONGEST_RUN_IN_S)).peekable();
    let start_nm = entered.peek().map_or(0.0, |k| load[FINE * k]);
    let mut bent = Swing::bent(stiffness_nm_rad, DAMPING_RATIO * critical, start_nm);
    let mut jolted = Swing::bent(made.stiffness * stiffness_nm_rad, 0.0, 0.0);
    let mut lag = Lag {
        angle_rad: vec![0.0; n],
        rate_rad_s: vec![0.0; n],
        acceleration_rad_s2: vec![0.0; n],
    };
    for k in entered {
        lag.angle_rad[k] = bent.angle_rad + jolted.angle_rad;
        lag.rate_rad_s[k] = bent.rate_rad_s + jolted.rate_rad_s;
        lag.acceleration_rad_s2[k] = bent.acceleration_rad_s2 + jolted.acceleration_rad_s2;
        jolted.damping_nm_s_rad =
            made.damping * (DAMPING_RATIO * critical + held_nm_s_rad(scene, j, k));
        for tick in FINE * k + 1..=FINE * (k + 1) {
            let tick = tick % load.len();
            bent.step(load[tick], inertia[k].max(f64::MIN_POSITIVE), step_s);
            jolted.step(made.height * jolts[tick], 1.0 / mobility[k], step_s);
        }
    }
    lag
}

/// Relative standard error of stiffnesses and gaps that are inferred from a swing: how the drive damps is not in the
/// log.
///
/// Of 97 causes named in simulated arms with drives of 2 ζ ω = 100 rad/s, these values are off by 0 to 20 % in the
/// median of a joint. Half or twice [`FEEDBACK_RAD_S`] moves single ones by up to a fifth. With drives of 50, 100 and
/// 400 rad/s, the resulting intervals held 86 of 91, 92 of 97 and 89 of 90 true values.
pub(super) const HELD_ERROR: f64 = 0.15;

/// Damping d_M of δ̇ by the drives at sample `k`, Nm s/rad, with ω = [`FEEDBACK_RAD_S`].
///
/// What presses links and rotor of joint j apart also moves the other joints: per unit of δ̇ the motors move by v = e_j −
/// (M + I_a')⁻¹ e_j/m, with m the mobility and I_a' the rotors but that of joint j. The drives answer with the torques
/// −ω (M + I_a) v = −ω M e_j, which dissipate the power of d_M = ω vᵀ (M + I_a) v = ω (M_jj − 1/m). The motor of the
/// joint alone would dissipate a half to a ninth of that at the elbow of a UR5.
pub(super) fn held_nm_s_rad(scene: &Scene, j: usize, k: usize) -> f64 {
    let mobility = scene.mobility_per_kg_m2.joint(j)[k];
    FEEDBACK_RAD_S * swung_kg_m2(scene.mass_kg_m2[j].joint(j)[k], mobility)
}

/// M_jj − 1/m, kg m²; not negative in any real arm.
fn swung_kg_m2(own_kg_m2: f64, mobility_per_kg_m2: f64) -> f64 {
    (own_kg_m2 - 1.0 / mobility_per_kg_m2).max(0.0)
}

/// An inertia on the spring of a gear.
struct Swing {
    stiffness_nm_rad: f64,
    damping_nm_s_rad: f64,
    angle_rad: f64,
    rate_rad_s: f64,
    acceleration_rad_s2: f64,
}

impl Swing {
    /// At rest under `load_nm`.
    fn bent(stiffness_nm_rad: f64, damping_nm_s_rad: f64, load_nm: f64) -> Self {
        let angle_rad = load_nm / stiffness_nm_rad;
        let (rate_rad_s, acceleration_rad_s2) = (0.0, 0.0);
        Self { stiffness_nm_rad, damping_nm_s_rad, angle_rad, rate_rad_s, acceleration_rad_s2 }
    }

    /// Advances by `step_s`, to a load of `load_nm` (Newmark 1959, average acceleration: stable for springs of any
    /// stiffness, and neither adds energy to a swing nor takes any).
    fn step(&mut self, load_nm: f64, inertia_kg_m2: f64, step_s: f64) {
        let (k, d) = (self.stiffness_nm_rad, self.damping_nm_s_rad);
        let half = 0.5 * step_s;
        let rate = self.rate_rad_s + half * self.acceleration_rad_s2;
        let angle = self.angle_rad + half * (self.rate_rad_s + rate);
        let acceleration =
            (load_nm - d * rate - k * angle) / (inertia_kg_m2 + half * (d + half * k));
        self.rate_rad_s = rate + half * acceleration;
        self.angle_rad = angle + half * half * acceleration;
        self.acceleration_rad_s2 = acceleration;
    }
}

/// The stiffest gear for which a load known ten times better than its noise may be used, where the encoder sits on the
/// link: the rotor swings on it within half the harmonics that a log can have. In clean logs, noise produced gears four
/// to sixteen times as stiff.
fn stiffest_nm_rad(scene: &Scene, j: usize) -> f64 {
    scene.rotor_kg_m2[j] * (0.25 * TAU * scene.rate_hz).powi(2)
}

/// Damping of the gear relative to the critical damping of the rotor on its spring, by variant of the law.
pub fn damping_ratio(variant: usize) -> f64 {
    match variant.checked_sub(ON_MOTOR) {
        Some(on_link) => LINK_DAMPING_RATIO[on_link % LINK_DAMPING_RATIO.len()],
        None => DAMPING_RATIO,
    }
}

/// Change of the torques on all joints when the links move as `motion`, per unit of `scale`.
pub(super) fn give_way(scene: &Scene, motion: &Motion, scale: f64) -> Column {
    Column::everywhere(&scene.torque_change(&scene.arm, motion)).scaled(1.0 / scale)
}

impl Candidate for Elasticity {
    fn kind(&self) -> Kind {
        Kind::Elasticity
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        let on_motor = 0..ON_MOTOR;
        let on_link = ON_MOTOR..WELL_KNOWN_ON_LINK;
        let well_known_on_link = WELL_KNOWN_ON_LINK..WELL_KNOWN_ON_LINK + LINK_DAMPING_RATIO.len();
        let of = |(variants, stiffest, count): (Range<usize>, f64, usize)| {
            variants.flat_map(move |variant| {
                geometric(SOFTEST_NM_RAD, stiffest, count)
                    .map(move |value| Shape { variant, value })
            })
        };
        if !scene.periodic {
            // In a single run, the log's own motion is all there is.
            let parts = [0..1, well_known_on_link].map(|v| (v, STIFFEST_NM_RAD, BENT_STIFFNESSES));
            return parts.into_iter().flat_map(of).collect();
        }
        let stiffest = stiffest_nm_rad(scene, joint(site)).min(STIFFEST_NM_RAD);
        // Noise would make all of them behind a rotor that is light.
        let on_link = (stiffest > SOFTEST_NM_RAD).then_some((on_link, stiffest, BENT_STIFFNESSES));
        let parts = [
            Some((on_motor, STIFFEST_NM_RAD, STIFFNESSES)),
            on_link,
            Some((well_known_on_link, STIFFEST_NM_RAD, BENT_STIFFNESSES)),
        ];
        parts.into_iter().flatten().flat_map(of).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        if shape.variant < ON_MOTOR {
            let stiffness = shape.value;
            let lag = swing(scene, j, shape.variant, stiffness, Jolts::USUAL);
            return vec![lag.column(scene, j, 1.0 / stiffness)];
        }
        let (stiffness, ratio) = (shape.value, damping_ratio(shape.variant));
        let damping = 2.0 * ratio * (stiffness * scene.rotor_kg_m2[j]).sqrt();
        let is_single = !scene.periodic;
        let load_nm = match is_single || shape.variant < WELL_KNOWN_ON_LINK {
            true => scene.bending_nm(j),
            false => scene.link_nm.joint(j),
        };
        let delta =
            scene.filtered(load_nm, |omega| Complex64::new(stiffness, damping * omega).inv());
        let rate = scene.derivative(&delta);
        let acceleration = scene.accelerations(&rate);
        let (qd, sign) = (scene.motion.qd_rad_s.joint(j), scene.sign.joint(j));
        let drive = &scene.arm.joints[j].drive;
        let extra = samples(scene, |k| {
            let motor_sign = scene.arm.friction_sign(qd[k] + rate[k]);
            let more = drive.rotor_inertia_kg_m2 * acceleration[k]
                + drive.viscous_nm_s_rad * rate[k]
                + drive.coulomb_nm * (motor_sign - sign[k]);
            stiffness * more
        });
        vec![Column::on(j, extra)]
    }

    /// Directions in which the response to the drive's jolts may be wrong, for gears with the encoder on the motor.
    fn loose(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        if !scene.periodic || shape.variant >= ON_MOTOR {
            return Vec::new();
        }
        let j = joint(site);
        let jolted = |made: Jolts| {
            swing(scene, j, shape.variant, shape.value, made).column(scene, j, 1.0 / shape.value)
        };
        let usual = jolted(Jolts::USUAL);
        let others = Jolts::OF_OTHER_DRIVES.into_iter().chain(Jolts::OF_OTHER_SWINGS);
        others.map(|other| jolted(other).minus(&usual)).collect()
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("stiffness_nm_rad", 1.0 / b[0], "Nm/rad")]
    }

    fn form_error(&self, scene: &Scene, shape: Shape) -> f64 {
        if scene.periodic && shape.variant < ON_MOTOR { HELD_ERROR } else { 0.0 }
    }

    /// The coefficient, from the bending of the gear, gives k. The shape, from its swing after jolts, also depends on
    /// the drive that holds the rotor and can be several times stiffer. In another log, the gear is predicted to swing
    /// by its own k.
    fn elsewhere(&self, shape: Shape, b: &[f64]) -> Shape {
        match b {
            [compliance] if shape.variant < ON_MOTOR && *compliance > 0.0 => {
                Shape { value: 1.0 / compliance, ..shape }
            }
            _ => shape,
        }
    }

    fn separating_experiment(&self) -> &'static str {
        "motor and link encoder in one log, or a tap on the link: the resonance tells the stiffness"
    }

    fn is_possible(&self, shape: Shape, b: &[f64]) -> bool {
        let may_be_stiffer = !(ON_MOTOR..WELL_KNOWN_ON_LINK).contains(&shape.variant);
        b[0] > 0.0 && (may_be_stiffer || 1.0 / b[0] <= shape.value)
    }

    fn can_be(&self, scene: &Scene, site: Option<usize>, stiffness_nm_rad: f64) -> bool {
        let load =
            scene.bending_nm(joint(site)).iter().fold(0.0, |most: f64, nm| most.max(nm.abs()));
        stiffness_nm_rad * MOST_TWIST_RAD > load
    }

    fn in_words(&self) -> &'static str {
        "a gear that gives way under load"
    }

    fn form(&self, _: &Scene, shape: Shape) -> Option<&'static str> {
        Some(if shape.variant < ON_MOTOR { "encoder on the motor" } else { "encoder on the link" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At rest, k δ equals the load. Without damping, a swing keeps its height, and its period is 2π √(M/k) up to the
    /// relative error (ω Δt)²/12 of the integrator.
    #[test]
    fn a_link_swings_on_its_gear() {
        let (stiffness, inertia, step_s) = (2e4, 2.0, 5e-4);
        let mut damped = Swing::bent(stiffness, 100.0, 0.0);
        for _ in 0..20_000 {
            damped.step(30.0, inertia, step_s);
        }
        // exp(−100/(2·2) · 10 s)
        assert!((damped.angle_rad - 30.0 / stiffness).abs() < 1e-12);
        let mut free = Swing::bent(stiffness, 0.0, 30.0);
        free.acceleration_rad_s2 = -30.0 / inertia;
        let (mut crossings, mut last, mut highest) = (Vec::new(), free.angle_rad, 0.0_f64);
        for k in 1..=20_000 {
            free.step(0.0, inertia, step_s);
            if last < 0.0 && free.angle_rad >= 0.0 {
                crossings.push(f64::from(k) - free.angle_rad / (free.angle_rad - last));
            }
            highest = if k > 19_000 { highest.max(free.angle_rad) } else { 0.0 };
            last = free.angle_rad;
        }
        let periods = (crossings.len() - 1) as f64;
        let period_s = (crossings[crossings.len() - 1] - crossings[0]) / periods * step_s;
        let omega = (stiffness / inertia).sqrt();
        let longer = period_s * omega / std::f64::consts::TAU - 1.0;
        let expected = (omega * step_s).powi(2) / 12.0;
        assert!((longer / expected - 1.0).abs() < 0.01, "{longer} {expected}");
        // Between two samples a swing is higher by up to (ω Δt)²/8.
        let height = highest * stiffness / 30.0;
        assert!((1.0 - height).abs() < (omega * step_s).powi(2) / 8.0, "{height}");
    }

    /// Of two joints whose links are coupled, the motors move by v while the second gear gives way by one: the drives'
    /// torques (M + I_a) v are M e_j, and dissipate vᵀ (M + I_a) v.
    #[test]
    fn drives_of_all_joints_damp_a_gear() {
        use nalgebra::{Matrix2, Vector2};
        let mass = Matrix2::new(3.0, 1.2, 1.2, 0.8);
        let rotors = Vector2::new(1.6, 0.5);
        let but_own = mass + Matrix2::from_diagonal(&Vector2::new(rotors[0], 0.0));
        let own = Vector2::new(0.0, 1.0);
        let answer = but_own.try_inverse().unwrap() * own;
        let mobility = 1.0 / rotors[1] + answer[1];
        let motors = own - answer / mobility;
        let torques = (mass + Matrix2::from_diagonal(&rotors)) * motors;
        // A handful of operations on numbers of order one.
        assert!((torques - mass * own).norm() < 1e-14);
        assert!((motors.dot(&torques) - swung_kg_m2(mass[(1, 1)], mobility)).abs() < 1e-14);
    }

    /// Two inertias on a spring, with the rotor's speed answered by ω (M + I_a) q̇_M with a small ω: their swing fades
    /// as exp(−d_M t/(2 μ)), where 1/μ is the mobility.
    #[test]
    fn a_drive_damps_by_its_share_of_the_swing() {
        let (rotor, links, stiffness, omega, step_s) = (1.6, 3.0, 2e4, 1.0, 1e-6);
        let (mut motor, mut link) = ([1e-3, 0.0], [0.0, 0.0]);
        let energy = |motor: &[f64; 2], link: &[f64; 2]| {
            let relative = motor[1] - link[1];
            stiffness * (motor[0] - link[0]).powi(2)
                + rotor * links / (rotor + links) * relative.powi(2)
        };
        let before = energy(&motor, &link);
        let count = 1_000_000;
        for _ in 0..count {
            let spring = stiffness * (motor[0] - link[0]);
            motor[1] += step_s * (-spring - omega * (rotor + links) * motor[1]) / rotor;
            link[1] += step_s * spring / links;
            motor[0] += step_s * motor[1];
            link[0] += step_s * link[1];
        }
        let mobility = 1.0 / rotor + 1.0 / links;
        let held = omega * swung_kg_m2(links, mobility);
        let faded = (energy(&motor, &link) / before).ln();
        let expected = -held * mobility * f64::from(count) * step_s;
        // The energy falls in waves, each of relative height up to d_M/(μ ω_0).
        let wave = held * mobility / (stiffness * mobility).sqrt();
        assert!((faded - expected).abs() < 2.0 * wave, "{faded} {expected}");
    }
}
