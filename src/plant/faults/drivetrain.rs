//! The joint mechanics of an arm with hidden effects.

use nalgebra::Vector3;

use super::assembly::{Assembly, JointMechanics};
use super::gear::EncoderSide;
use super::surroundings::Contact;
use crate::excitation::Reference;
use crate::plant::{Drivetrain, RapierArm, Stage};
use crate::robot::Placement;

/// Joints with any combination of effects between the current of their motors and their links.
///
/// The drivetrain's own states, joint by joint, are the bristle of presliding (z, dimensionless), the rotor behind an
/// elastic gear or one with play (angle, rad; speed, rad/s), and the warmth Θ (dimensionless); only the states that the
/// effects need exist. Without effects, every operation is the same as in
/// [`RigidDrivetrain`](crate::plant::RigidDrivetrain), to the last bit.
#[derive(Debug, Clone)]
pub struct HiddenDrivetrain {
    joints: Vec<JointMechanics>,
    slots: Vec<Slots>,
    states: usize,
    course: Course,
    /// Largest drive torques, which bound the loads of the gears, Nm.
    limit_nm: Vec<f64>,
    flange: Flange,
    /// Torques at the outputs of the gears for which load-dependent friction was last computed, Nm.
    load_nm: Vec<f64>,
    motor: Vec<Motor>,
    resistance_nm: Vec<f64>,
    link_torque_nm: Vec<f64>,
    /// Working memory: increase of the link torques over their previous values, Nm.
    more_nm: Vec<f64>,
}

/// Indices of a joint's own states.
#[derive(Debug, Clone, Copy, Default)]
struct Slots {
    bristle: Option<usize>,
    /// Index of the rotor's angle; the speed is at the next index.
    rotor: Option<usize>,
    warmth: Option<usize>,
}

/// The motor side of one joint during one stage.
#[derive(Debug, Clone, Copy, Default)]
struct Motor {
    q_rad: f64,
    qd_rad_s: f64,
    /// Torque that the drive delivers, minus the ripple, Nm.
    drive_nm: f64,
}

/// Properties of a motion that are known before it is run.
#[derive(Debug, Clone)]
struct Course {
    /// Largest speed of each joint, with a margin for tracking errors, rad/s.
    largest_speed_rad_s: Vec<f64>,
    /// Bound of each joint's acceleration, rad/s²: twice the largest acceleration of the motion, plus 1 rad/s², plus
    /// the acceleration that contacts would give to the rotor alone.
    largest_acceleration_rad_s2: Vec<f64>,
    /// Mean power lost in nominal friction, W.
    mean_friction_power_w: Vec<f64>,
}

/// Rate at which the motion is sampled for its [`Course`], Hz.
const COURSE_RATE_HZ: f64 = 100.0;
/// Accuracy to which the loads of the gears are found, Nm; the integrator's own error is a thousand times larger.
const LOAD_ACCURACY_NM: f64 = 1e-9;
/// Limit of the iterations for gear loads. The error falls by at least the factor of warm load-dependent friction, at
/// most 0.65, per iteration; from 1000 Nm the accuracy is reached after 65.
const LOAD_ITERATIONS: usize = 72;
/// Largest number of parts into which a step may be divided.
const MOST_SUBSTEPS: usize = 64;

impl Course {
    fn of(reference: &dyn Reference, assembly: &Assembly) -> Self {
        let joints = &assembly.joints;
        let n = joints.len();
        let samples = (reference.duration_s() * COURSE_RATE_HZ).ceil().max(1.0) as usize;
        let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let (mut largest, mut power) = (vec![0.0_f64; n], vec![0.0; n]);
        let mut acceleration = vec![0.0_f64; n];
        for k in 0..samples {
            reference.sample(k as f64 / COURSE_RATE_HZ, &mut q, &mut qd, &mut qdd);
            for (j, joint) in joints.iter().enumerate() {
                largest[j] = largest[j].max(qd[j].abs());
                acceleration[j] = acceleration[j].max(qdd[j].abs());
                power[j] += joint.friction.nominal_power_w(qd[j]) / samples as f64;
            }
        }
        Self {
            largest_speed_rad_s: largest.iter().map(|v| 1.2 * v + 0.1).collect(),
            largest_acceleration_rad_s2: acceleration
                .iter()
                .zip(joints)
                .map(|(a, joint)| {
                    let pushes = joint.contacts.iter().chain(&assembly.flange_contacts);
                    let push_nm: f64 = pushes.map(|c| c.peak_nm.abs()).sum();
                    2.0 * a + 1.0 + push_nm / joint.rotor_inertia_kg_m2.max(f64::MIN_POSITIVE)
                })
                .collect(),
            mean_friction_power_w: power,
        }
    }
}

impl HiddenDrivetrain {
    /// The mechanics of `assembly` for a run along `reference`.
    pub(super) fn new(assembly: &Assembly, reference: &dyn Reference) -> Self {
        let mut states = 0;
        let mut take = |needed: bool, count: usize| {
            let slot = needed.then_some(states);
            states += if needed { count } else { 0 };
            slot
        };
        let slots = assembly
            .joints
            .iter()
            .map(|joint| Slots {
                bristle: take(joint.friction.presliding.is_some(), 1),
                rotor: take(joint.transmission.is_some(), 2),
                warmth: take(joint.friction.thermal.is_some(), 1),
            })
            .collect();
        let n = assembly.joints.len();
        Self {
            course: Course::of(reference, assembly),
            joints: assembly.joints.clone(),
            slots,
            states,
            limit_nm: assembly.arm.joints.iter().map(|j| j.limits.torque_nm).collect(),
            flange: Flange::new(assembly),
            load_nm: vec![0.0; n],
            motor: vec![Motor::default(); n],
            resistance_nm: vec![0.0; n],
            link_torque_nm: vec![0.0; n],
            more_nm: vec![0.0; n],
        }
    }

    /// Computes the torques of the surroundings against positive motion of the links, Nm.
    fn find_resistance(&mut self, time_s: f64, q_rad: &[f64]) {
        for (j, joint) in self.joints.iter().enumerate() {
            let springs = joint.springs.iter().map(|s| s.resistance_nm(q_rad[j]));
            let contacts = joint.contacts.iter().map(|c| c.push_nm(time_s));
            self.resistance_nm[j] = springs.sum::<f64>() + contacts.sum::<f64>();
        }
        self.flange.add_resistance(time_s, q_rad, &mut self.resistance_nm);
    }

    /// Friction of joint `j`, Nm; the joint's own states are taken from `states`.
    fn friction_nm(&self, j: usize, states: &[f64]) -> f64 {
        let (slots, motor) = (&self.slots[j], &self.motor[j]);
        let bristle = slots.bristle.map(|s| states[s]);
        let warmth = slots.warmth.map_or(0.0, |s| states[s]);
        let friction = &self.joints[j].friction;
        friction.torque_nm(motor.q_rad, motor.qd_rad_s, bristle, warmth, self.load_nm[j])
    }

    /// Computes the link torques of all joints with a rigid gear, and their increase over the previous values.
    fn find_link_torques(&mut self, stage: &Stage<'_>) {
        for j in 0..self.joints.len() {
            self.more_nm[j] = 0.0;
            if self.slots[j].rotor.is_none() {
                let friction = self.friction_nm(j, stage.states);
                let gear = self.motor[j].drive_nm - friction;
                let before = self.link_torque_nm[j];
                self.link_torque_nm[j] = gear - self.resistance_nm[j];
                self.more_nm[j] = self.link_torque_nm[j] - before;
            }
        }
    }

    /// Solves for the loads L of rigid gears with load-dependent friction and for the corresponding accelerations: L =
    /// τ_drive − τ_f(L) − Ia q̈(τ_f(L)). The iteration starts from the load of the last stage. It converges, because a
    /// change of L changes the right-hand side by at most μ times as much.
    fn settle_loads(&mut self, arm: &mut RapierArm, stage: &Stage<'_>, qdd_rad_s2: &mut [f64]) {
        for _ in 0..LOAD_ITERATIONS {
            let mut change: f64 = 0.0;
            for (j, joint) in self.joints.iter().enumerate() {
                if joint.friction.mu > 0.0 && self.slots[j].rotor.is_none() {
                    let gear = self.link_torque_nm[j] + self.resistance_nm[j];
                    let load = gear - joint.rotor_inertia_kg_m2 * qdd_rad_s2[j];
                    change = change.max((load - self.load_nm[j]).abs());
                    self.load_nm[j] = load;
                }
            }
            if change < LOAD_ACCURACY_NM {
                return;
            }
            self.find_link_torques(stage);
            arm.add_response(&self.more_nm, qdd_rad_s2);
        }
    }
}

impl Drivetrain for HiddenDrivetrain {
    fn states(&self) -> usize {
        self.states
    }

    fn most_substeps(&self) -> usize {
        MOST_SUBSTEPS
    }

    fn start(
        &mut self,
        arm: &mut RapierArm,
        q_rad: &mut [f64],
        qd_rad_s: &mut [f64],
        states: &mut [f64],
    ) {
        states.fill(0.0);
        self.load_nm.fill(0.0);
        for (j, joint) in self.joints.iter().enumerate() {
            let rotor = if joint.transmission.is_some() { 0.0 } else { joint.rotor_inertia_kg_m2 };
            arm.set_rotor_inertia(j, rotor);
            q_rad[j] -= joint.encoder_offset_rad;
        }
        if self.joints.iter().all(|joint| joint.transmission.is_none()) {
            return;
        }
        // Elastic gears start with the deflection that holds the links against gravity and the surroundings.
        self.find_resistance(0.0, q_rad);
        let holding_nm = arm.holding_torque(q_rad);
        for (j, joint) in self.joints.iter().enumerate() {
            let (Some(gear), Some(rotor)) = (&joint.transmission, self.slots[j].rotor) else {
                continue;
            };
            let deflection = gear.deflection_rad(holding_nm[j] + self.resistance_nm[j]);
            states[rotor] = q_rad[j];
            states[rotor + 1] = qd_rad_s[j];
            match joint.encoder {
                EncoderSide::Motor => q_rad[j] -= deflection,
                EncoderSide::Link => states[rotor] += deflection,
            }
        }
    }

    fn encoder_side(&self, states: &[f64], q_rad: &mut [f64], qd_rad_s: &mut [f64]) {
        for (j, joint) in self.joints.iter().enumerate() {
            if let (Some(rotor), EncoderSide::Motor) = (self.slots[j].rotor, joint.encoder) {
                q_rad[j] = states[rotor];
                qd_rad_s[j] = states[rotor + 1];
            }
            q_rad[j] += joint.encoder_offset_rad;
        }
    }

    fn encoder_acceleration(&self, states_rate: &[f64], qdd_rad_s2: &mut [f64]) {
        for (j, joint) in self.joints.iter().enumerate() {
            if let (Some(rotor), EncoderSide::Motor) = (self.slots[j].rotor, joint.encoder) {
                qdd_rad_s2[j] = states_rate[rotor + 1];
            }
        }
    }

    /// The largest of these rates: the decay by friction and gear damping of the inertias on which they act, the
    /// oscillation of bristles and gears, the reversal of bristles, and the ripple at the largest speed of the motion.
    /// An oscillation of frequency ω counts as 2 ω, because a step with ω h = 1 resolves it.
    fn fastest_decay_per_s(&self, inverse_inertia_per_kg_m2: &[f64]) -> f64 {
        let mut fastest: f64 = 0.0;
        for (j, joint) in self.joints.iter().enumerate() {
            let link = inverse_inertia_per_kg_m2[j];
            let speed = self.course.largest_speed_rad_s[j];
            let (mut inverse, rotor) = (link, 1.0 / joint.rotor_inertia_kg_m2);
            if let Some(gear) = &joint.transmission {
                inverse = rotor;
                let both = link + rotor;
                let swing = 2.0 * (gear.stiffness_nm_rad * both).sqrt();
                fastest = fastest.max(swing).max(gear.damping_nm_s_rad * both);
            }
            let (viscous, bristles) = joint.friction.slopes(speed, self.limit_nm[j]);
            fastest = fastest.max(viscous * inverse).max(2.0 * (bristles * inverse).sqrt());
            let acceleration = self.course.largest_acceleration_rad_s2[j];
            let [turning, passing] = joint.friction.bristle_decays_per_s(acceleration, speed);
            // The factor 2 allows for the kink of the decay where the joint reverses within a step.
            fastest = fastest.max(2.0 * turning.min(passing));
            for ripple in &joint.ripples {
                fastest = fastest.max(2.0 * ripple.order_per_turn * speed);
            }
        }
        fastest
    }

    fn rates(
        &mut self,
        arm: &mut RapierArm,
        stage: &Stage<'_>,
        qdd_rad_s2: &mut [f64],
        states_rate: &mut [f64],
    ) {
        self.find_resistance(stage.time_s, stage.q_rad);
        for (j, joint) in self.joints.iter().enumerate() {
            let rotor = self.slots[j].rotor;
            let q_rad = rotor.map_or(stage.q_rad[j], |s| stage.states[s]);
            let qd_rad_s = rotor.map_or(stage.qd_rad_s[j], |s| stage.states[s + 1]);
            let delivered = (stage.drive_torque_nm[j] - joint.offset_nm) / (1.0 + joint.gain_error);
            let ripple = joint
                .ripples
                .iter()
                .map(|r| r.amplitude_nm * (r.order_per_turn * q_rad + r.phase_rad).cos());
            let drive_nm = delivered - ripple.sum::<f64>();
            self.motor[j] = Motor { q_rad, qd_rad_s, drive_nm };
            if let (Some(gear), Some(s)) = (&joint.transmission, rotor) {
                let deflection = q_rad - stage.q_rad[j];
                let torque = gear.torque_nm(deflection, qd_rad_s - stage.qd_rad_s[j]);
                self.load_nm[j] = torque;
                self.link_torque_nm[j] = torque - self.resistance_nm[j];
                let friction = self.friction_nm(j, stage.states);
                states_rate[s] = qd_rad_s;
                states_rate[s + 1] = (drive_nm - friction - torque) / joint.rotor_inertia_kg_m2;
            }
        }
        self.find_link_torques(stage);
        arm.forward_dynamics(stage.q_rad, stage.qd_rad_s, &self.link_torque_nm, qdd_rad_s2);
        self.settle_loads(arm, stage, qdd_rad_s2);
        for (j, joint) in self.joints.iter().enumerate() {
            let speed = self.motor[j].qd_rad_s;
            if let Some(s) = self.slots[j].bristle {
                let acceleration = self.course.largest_acceleration_rad_s2[j];
                let [turning, _] = joint.friction.bristle_decays_per_s(acceleration, speed);
                states_rate[s] = joint.friction.bristle_rate(speed, turning, stage.states[s]);
            }
            if let (Some(thermal), Some(s)) = (&joint.friction.thermal, self.slots[j].warmth) {
                let mean_w = self.course.mean_friction_power_w[j];
                let power_w = joint.friction.nominal_power_w(speed);
                let heat = if mean_w > 0.0 { power_w / mean_w } else { 0.0 };
                states_rate[s] = (heat - stage.states[s]) / thermal.time_constant_s;
            }
        }
    }
}

/// Contact forces on the flange, with the kinematics for their lever arms.
#[derive(Debug, Clone)]
struct Flange {
    contacts: Vec<Contact>,
    placements: Vec<Placement>,
    /// Working memory: origin and axis of each joint in the base frame.
    axes: Vec<(Vector3<f64>, Vector3<f64>)>,
    reach_m: f64,
}

impl Flange {
    fn new(assembly: &Assembly) -> Self {
        let placements: Vec<_> = assembly.arm.joints.iter().map(|j| j.placement).collect();
        Self {
            contacts: assembly.flange_contacts.clone(),
            axes: vec![Default::default(); placements.len()],
            reach_m: assembly.reach_m(),
            placements,
        }
    }

    /// Adds the resistance −Jᵀ F of the contact force F at `time_s`, Nm: (Jᵀ F)_i = z_i · ((p_flange − p_i) × F).
    fn add_resistance(&mut self, time_s: f64, q_rad: &[f64], resistance_nm: &mut [f64]) {
        let push_nm: f64 = self.contacts.iter().map(|c| c.push_nm(time_s)).sum();
        if push_nm == 0.0 {
            return;
        }
        let mut pose = Placement::identity();
        for ((placement, &q), axis) in self.placements.iter().zip(q_rad).zip(&mut self.axes) {
            pose = pose.compose(placement).turned(q);
            *axis = (pose.translation_m, pose.rotation.column(2).into());
        }
        let flange = pose.translation_m;
        let force = Vector3::repeat(-push_nm / (self.reach_m * 3.0_f64.sqrt()));
        for ((origin, axis), resistance) in self.axes.iter().zip(resistance_nm) {
            *resistance -= axis.dot(&(flange - origin).cross(&force));
        }
    }
}
