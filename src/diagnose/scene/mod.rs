//! Input of every candidate: the motion of a log, and the torques that the current estimate predicts along it.
//!
//! Enters: the prepared log and base parameters. Leaves: motion, loads, sign of friction and inertias at every sample
//! and, where the motion repeats, between the samples.

mod between_samples;
mod other_friction;

pub use between_samples::{FINE, Instants, LONGEST_LEAD_S};
pub use other_friction::{OtherFriction, SHARPEST, Turn};

use fourier::Complex64;

use super::coarse_angles::CoarseAngles;
use super::lateness::Lateness;
use super::load::{Delivered, LinkTorque, Loads, Periods, RigidArm, rigid_torque_along};
use super::reversal_answer::shifted;
use crate::base::BaseSet;
use crate::dynamics::{Model, Motion, Parameter, ParameterLayout};
use crate::identify::{HeldAtRest, Prepared};
use crate::robot::{Arm, Joint, JointSignals};
use crate::signal::{FineClock, central_4, linear_at, mean_period};
use between_samples::BetweenSamples;

/// The processed motion of one log and the torques that the estimate predicts along it.
///
/// A periodic motion is stored as one period of n samples, `periods` of which follow each other in the log. A single
/// run is stored as its n samples.
pub struct Scene {
    /// The arm with parameters that are equivalent to the estimate.
    pub arm: Arm,
    /// The motion.
    pub motion: Motion,
    /// Samples per second.
    pub rate_hz: f64,
    /// Repetitions P.
    pub periods: usize,
    /// Time from the beginning of the log to the first sample, s.
    pub lead_in_s: f64,
    /// Whether the motion closes on itself.
    pub periodic: bool,
    /// Mean over the periods of the recorded angles and velocities, rad and rad/s.
    recorded: Option<[JointSignals; 2]>,
    /// Torque that moves the links along the recorded motion, Nm.
    recorded_nm: JointSignals,
    /// Torque that moves the links, Nm; in a periodic motion, only in the harmonics in which it is well known.
    pub link_nm: JointSignals,
    /// Torque on the gear: links and rotors, Nm.
    pub load_nm: JointSignals,
    /// Torque that the links take in addition to `link_nm` where joints reverse, Nm.
    jolt_nm: JointSignals,
    /// Torque that moves the links of compliant gears.
    bending: LinkTorque,
    /// Torque that would move the links if no gear had play.
    rigid: LinkTorque,
    /// Torque that the drives deliver, where several periods reveal it.
    delivered: Option<Delivered>,
    /// Rotor inertia I_a of every joint, kg m², no less than a small share of the inertia of its links: compliant gears
    /// need something to swing against.
    pub rotor_kg_m2: Vec<f64>,
    /// Per joint, whether the description of the arm has an inertia of the rotor.
    pub has_described_rotor: Vec<bool>,
    /// Per joint, whether the inertia of the rotor is a base parameter, and not one sum with those of the links.
    pub tells_rotor: Vec<bool>,
    /// Relative acceleration of links and rotor per torque that presses them apart, 1/(kg m²).
    pub mobility_per_kg_m2: JointSignals,
    /// Predicted drive torque: load, friction and offset, Nm.
    pub torque_nm: JointSignals,
    /// tanh(q̇/ε).
    pub sign: JointSignals,
    /// Noise of one sample of torque, Nm; zero for a single run, which has no repetitions to show it.
    pub noise_nm: Vec<f64>,
    /// Estimated Coulomb friction, Nm.
    pub coulomb_nm: Vec<f64>,
    /// Error of the velocity of every joint where it reverses, rad/s, as far as coarse angles make it; zero where angles
    /// are fine.
    pub velocity_error_rad_s: Vec<f64>,
    /// What is known of the friction of every joint beside Coulomb and viscous friction.
    other_friction: Vec<OtherFriction>,
    /// Mass matrix of the links along the motion, kg m², column by column.
    pub mass_kg_m2: Vec<JointSignals>,
    /// Half-width of the interval around each recorded angle in which the true one lies, rad; zero for a periodic
    /// motion, whose angles are averaged.
    pub angle_doubt_rad: Vec<f64>,
    /// Magnitude at which torque readings are cut off, Nm; `None` where they are not.
    pub torque_limit_nm: Vec<Option<f64>>,
    /// Joints that hold friction in their pauses, which are left out of all equations.
    pub held_at_rest: Vec<HeldAtRest>,
    /// What has been computed between the samples.
    between: BetweenSamples,
    /// Fine clock between the samples of a periodic motion.
    clock: Option<FineClock>,
    /// Highest harmonic, below n/2, up to which the accelerations of the periods are known.
    pub highest: usize,
}

/// A reading whose mean is this many σ below its limit is not cut off.
const FREE: f64 = 3.0;

/// Noise of one sample of the torque of joint `j`, Nm, where no limit cuts it off; zero for a single run.
fn noise_of_a_free_reading(prepared: &Prepared, j: usize) -> f64 {
    let Some(replicates) = &prepared.replicates else { return 0.0 };
    let all = replicates.sigma[j];
    let free = |limit_nm: f64| {
        replicates.sigma_where(j, |mean| mean.abs() < limit_nm - FREE * all).unwrap_or(all)
    };
    prepared.torque_limit_nm[j].map_or(all, free)
}

/// Highest harmonic, below n/2, up to which the accelerations of the periods of `prepared` are known.
fn highest(prepared: &Prepared) -> usize {
    (prepared.highest * prepared.motion.samples() as f64) as usize
}

/// The loads of `rigid_arm` along `prepared`. A periodic motion has a `clock` between its samples.
fn loads(
    (model, arm): (&Model, &Arm),
    rigid_arm: &RigidArm,
    prepared: &Prepared,
    clock: Option<&FineClock>,
) -> Loads {
    let rate_hz = prepared.processing.rate_hz;
    match (&prepared.each_period, clock) {
        (Some(each), Some(clock)) => {
            let (torque_nm, highest) = (&prepared.torque_nm, highest(prepared));
            let periods = Periods { each, torque_nm, clock, rate_hz, highest };
            Loads::agreed((model, arm), &prepared.motion, rigid_arm, &periods)
        }
        _ => {
            let noise = prepared.velocity_noise.as_deref().unwrap_or_default();
            Loads::as_recorded(arm, &prepared.motion, rigid_arm, (noise, rate_hz))
        }
    }
}

impl Scene {
    /// The scene along `prepared`, for the arm with the base parameters `theta`.
    pub fn new(nominal: &Arm, set: &BaseSet, theta: &[f64], prepared: &Prepared) -> Self {
        let periodic = prepared.replicates.is_some();
        let motion = prepared.motion.clone();
        let (joints, n) = (motion.joints(), motion.samples());
        let mean_of = |y: &JointSignals| y.map_joints(|_, y| mean_period(y, n));
        let recorded =
            prepared.recorded.as_ref().map(|both| [both.q_rad(), both.qd_rad_s()].map(mean_of));
        let (arm, offset_nm) = equivalent_arm(nominal, set, theta);
        let model = Model::new(&arm);
        let clock = periodic.then(|| FineClock::new(n, FINE));
        let rigid_arm = RigidArm::along(&model, &arm, &motion);
        let Loads { link, bending, rigid, delivered, load_nm, mobility_per_kg_m2 } =
            loads((&model, &arm), &rigid_arm, prepared, clock.as_ref());
        let sign =
            motion.qd_rad_s.map_joints(|_, v| v.iter().map(|v| arm.friction_sign(*v)).collect());
        let drive = |j: usize| &arm.joints[j].drive;
        let torque_nm = JointSignals::from_fn(joints, n, |j, k| {
            load_nm.joint(j)[k]
                + drive(j).viscous_nm_s_rad * motion.qd_rad_s.joint(j)[k]
                + drive(j).coulomb_nm * sign.joint(j)[k]
                + offset_nm[j]
        });
        // Rounded to a resolution Δ, the true angle lies within ±Δ/2.
        let doubt = |resolution: &f64| if periodic { 0.0 } else { 0.5 * resolution };
        let is_described = |joint: &Joint| joint.drive.rotor_inertia_kg_m2 > 0.0;
        let velocity_error = |j: usize| {
            let coarse = CoarseAngles::of(prepared, j, nominal.friction_epsilon_rad_s);
            coarse.map_or(0.0, |angles| angles.error_rad_s)
        };
        let is_told = |j: usize| set.index_of(Parameter::RotorInertia(j)).is_some();
        Self {
            noise_nm: (0..joints).map(|j| noise_of_a_free_reading(prepared, j)).collect(),
            angle_doubt_rad: prepared.angle_resolution_rad.iter().map(doubt).collect(),
            torque_limit_nm: prepared.torque_limit_nm.clone(),
            held_at_rest: prepared.held_at_rest.clone(),
            coulomb_nm: (0..joints).map(|j| drive(j).coulomb_nm).collect(),
            velocity_error_rad_s: (0..joints).map(velocity_error).collect(),
            other_friction: vec![OtherFriction::default(); joints],
            has_described_rotor: nominal.joints.iter().map(is_described).collect(),
            tells_rotor: (0..joints).map(is_told).collect(),
            rate_hz: prepared.processing.rate_hz,
            periods: prepared.processing.periods,
            lead_in_s: prepared.lead_in_s,
            highest: highest(prepared),
            recorded_nm: rigid_arm.link_nm,
            mass_kg_m2: rigid_arm.mass_kg_m2,
            rotor_kg_m2: rigid_arm.rotor_kg_m2,
            link_nm: link.told_nm,
            jolt_nm: link.jolt_nm,
            between: BetweenSamples::of(joints),
            arm,
            motion,
            periodic,
            recorded,
            load_nm,
            bending,
            rigid,
            delivered,
            mobility_per_kg_m2,
            torque_nm,
            sign,
            clock,
        }
    }

    /// What joint `j` holds in its pauses, if it sticks.
    pub fn held_at_rest(&self, j: usize) -> Option<&HeldAtRest> {
        self.held_at_rest.iter().find(|held| held.joint == j)
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.motion.joints()
    }

    /// What is known of the friction of joint `j` beside Coulomb and viscous friction.
    pub fn other_friction(&self, j: usize) -> &OtherFriction {
        &self.other_friction[j]
    }

    /// Sets [`Self::other_friction`].
    pub fn set_other_friction(&mut self, j: usize, other: OtherFriction) {
        self.between.forget_turned(j);
        self.other_friction[j] = other;
    }

    /// Sets the torque that other laws add to joint `j`, Nm at the samples.
    pub fn set_torque_of_others(&mut self, j: usize, torque_nm: Vec<f64>) {
        self.other_friction[j].torque_nm = torque_nm;
    }

    /// Whether laws are known of a joint that change the friction of others, or that are parts of one law.
    pub fn has_products(&self) -> bool {
        let is_product =
            |other: &OtherFriction| other.turn.is_some() || !other.torque_nm.is_empty();
        self.other_friction.iter().any(is_product)
    }

    /// Speed over which the dry friction of joint `j` turns round, rad/s.
    pub fn width_rad_s(&self, j: usize) -> f64 {
        let turn = self.other_friction[j].turn;
        turn.map_or(self.arm.friction_epsilon_rad_s, |turn| turn.width_rad_s)
    }

    /// Number of samples n of the motion.
    pub fn samples(&self) -> usize {
        self.motion.samples()
    }

    /// Duration of the whole record, s.
    pub fn duration_s(&self) -> f64 {
        (self.samples() * self.periods) as f64 / self.rate_hz
    }

    /// Indices of the samples in order of time. For a periodic motion, they start `before_s` before the beginning of
    /// the period.
    pub fn entered(&self, before_s: f64) -> impl Iterator<Item = usize> + use<> {
        let n = self.samples();
        let before = if self.periodic { (before_s * self.rate_hz).ceil() as usize } else { 0 };
        (0..before + n).map(move |k| (k + n - before % n) % n)
    }

    /// Time derivative of a signal of n samples.
    pub fn derivative(&self, y: &[f64]) -> Vec<f64> {
        if let Some(clock) = &self.clock {
            return clock.derivative(y, self.rate_hz);
        }
        let mut out = vec![0.0; y.len()];
        // Fewer than five samples never reach this point; a derivative of zero is harmless.
        let _ = central_4(y, self.rate_hz, &mut out);
        out
    }

    /// Accelerations (rad/s²) of the velocities `qd_rad_s` at the samples, limited to what is known of the log's own:
    /// in a periodic motion, to harmonics up to [`Self::highest`].
    pub fn accelerations(&self, qd_rad_s: &[f64]) -> Vec<f64> {
        match &self.clock {
            Some(clock) => clock.derivative_up_to(qd_rad_s, self.rate_hz, self.highest),
            None => self.derivative(qd_rad_s),
        }
    }

    /// Torque on the links of a compliant gear at joint `j`, Nm, as far as the motion determines it.
    pub fn bending_nm(&self, j: usize) -> &[f64] {
        self.bending.told_nm.joint(j)
    }

    /// Change of the predicted drive torque of joint `j` where its record is late: its value behind `lateness`, in
    /// seconds, less that at the sample, Nm. In a single run, a low-pass counts as a delay.
    ///
    /// Dry friction reverses between two samples, so that the exact instant counts. A drive that is slow to answer it
    /// lets the joint accelerate instead; load and friction then change together, and their sum hardly does. In
    /// harmonics where the load drowns in noise, the reversals tell what the drive delivers.
    pub fn change_nm(&self, j: usize, lateness: Lateness) -> Vec<f64> {
        let less = |late: Vec<f64>, now: &[f64]| -> Vec<f64> {
            late.iter().zip(now).map(|(late, now)| late - now).collect()
        };
        let (Some(clock), Some(delivered)) = (&self.clock, &self.delivered) else {
            let now = self.torque_nm.joint(j);
            return less(self.late(now, lateness), now);
        };
        let part = |y: &[f64], wanted: bool| {
            clock.filtered(y, |h| match delivered.known[j].get(h) {
                Some(known) if *known == wanted => Complex64::ONE,
                _ => Complex64::ZERO,
            })
        };
        let in_ticks = lateness.scaled(1.0 / self.instant_s());
        let (coulomb, viscous) = (self.coulomb_nm[j], self.arm.joints[j].drive.viscous_nm_s_rad);
        let load = delivered.load_nm.joint(j);
        // In the other harmonics, the differentiated noise of the velocity is that of the acceleration, which the
        // residual holds as well.
        let qd = part(self.motion.qd_rad_s.joint(j), true);
        let smooth: Vec<f64> = load.iter().zip(&qd).map(|(load, qd)| load + viscous * qd).collect();
        let smooth = less(self.late(&smooth, lateness), &smooth);
        let sign = &self.instants(j).sign;
        let now = sign.iter().step_by(FINE).copied().collect::<Vec<_>>();
        let (smoothed, late_ticks) = in_ticks.parts(sign);
        let dry = part(&less(shifted(&smoothed, late_ticks, FINE), &now), true);
        let beyond = part(&delivered.answers[j].change_nm(clock, in_ticks), false);
        let sum = |((s, d), b): ((&f64, &f64), &f64)| s + coulomb * d + b;
        smooth.iter().zip(&dry).zip(&beyond).map(sum).collect()
    }

    /// Rate of the predicted drive torque of joint `j`, Nm/s: minus its change by a delay of one sample, per unit of
    /// time.
    pub fn torque_rate_nm_s(&self, j: usize) -> Vec<f64> {
        let change_nm = self.change_nm(j, Lateness::Delay(1.0 / self.rate_hz));
        change_nm.into_iter().map(|nm| -nm * self.rate_hz).collect()
    }

    /// The part of a signal of n samples below `highest_hz` in a periodic motion; the signal itself in a single run.
    pub fn slow_part(&self, y: &[f64], highest_hz: f64) -> Vec<f64> {
        let Some(clock) = &self.clock else { return y.to_vec() };
        let last = (highest_hz * y.len() as f64 / self.rate_hz) as usize;
        clock.filtered(y, |h| if h <= last { Complex64::ONE } else { Complex64::ZERO })
    }

    /// y behind `lateness`, in seconds, on the grid of y; in a single run, a low-pass counts as a delay.
    fn late(&self, y: &[f64], lateness: Lateness) -> Vec<f64> {
        if self.clock.is_some() {
            return self.filtered(y, |omega| lateness.response(omega));
        }
        let value = |k: usize| {
            linear_at(
                y,
                (k as f64 - lateness.time() * self.rate_hz).clamp(0.0, (y.len() - 1) as f64),
            )
        };
        (0..y.len()).map(value).collect()
    }

    /// y filtered with the response `response(ω)`, ω in rad/s. In a single run, y times the response at ω = 0.
    pub fn filtered(&self, y: &[f64], response: impl Fn(f64) -> Complex64) -> Vec<f64> {
        let Some(clock) = &self.clock else {
            let at_rest = response(0.0).re;
            return y.iter().map(|v| at_rest * v).collect();
        };
        let omega = std::f64::consts::TAU * self.rate_hz / y.len() as f64;
        clock.filtered(y, |h| response(h as f64 * omega))
    }

    /// Change of the link torques, Nm, when `arm` moves as `motion` instead of as recorded.
    pub fn torque_change(&self, arm: &Arm, motion: &Motion) -> JointSignals {
        let mut changed = rigid_torque_along(&Model::new(arm), motion);
        for j in 0..self.joints() {
            changed
                .joint_mut(j)
                .iter_mut()
                .zip(self.recorded_nm.joint(j))
                .for_each(|(c, l)| *c -= l);
        }
        changed
    }
}

/// An arm with the base parameters `theta`, and the constant torques that belong to it, Nm.
///
/// Base parameters are combinations of standard parameters, shared by many arms. This arm is the one that differs from
/// `nominal` only in the kept parameters. Its torques along every motion are those of the estimate, although a single
/// body may come out unphysical.
pub fn equivalent_arm(nominal: &Arm, set: &BaseSet, theta: &[f64]) -> (Arm, Vec<f64>) {
    let layout = ParameterLayout::new(nominal.dof());
    let full = set.parameterisation.count() >= layout.count_without_offsets();
    let mut standard = vec![0.0; layout.count()];
    if full {
        standard = Model::new(nominal).standard_parameters();
    }
    let start = set.values(&standard);
    for (k, (theta, start)) in theta.iter().zip(&start).enumerate() {
        for &(index, coefficient) in set.column(k) {
            standard[index] += coefficient * (theta - start);
        }
    }
    let mut arm = nominal.clone();
    let mut offset_nm = vec![0.0; nominal.dof()];
    for (index, &value) in standard.iter().enumerate() {
        match layout.parameter(index) {
            Parameter::Body(body, k) => arm.joints[body].link.parameters[k] = value,
            Parameter::RotorInertia(j) => arm.joints[j].drive.rotor_inertia_kg_m2 = value,
            Parameter::Viscous(j) => arm.joints[j].drive.viscous_nm_s_rad = value,
            Parameter::Coulomb(j) => arm.joints[j].drive.coulomb_nm = value,
            Parameter::Offset(j) => offset_nm[j] = value,
        }
    }
    (arm, offset_nm)
}
