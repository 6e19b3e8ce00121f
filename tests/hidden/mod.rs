//! A drivetrain with one hidden effect, and logs of the arm with it.

use std::ops::Range;

use armid::base::{BaseSet, Parameterisation};
use armid::diagnose::{Diagnoser, Finding};
use armid::dynamics::Model;
use armid::excitation::{Excitation, FourierSeries};
use armid::identify::{Measurement, Options};
use armid::plant::{
    Drivetrain, Measured, PerJoint, Plant, PlantConfig, RapierArm, Recording, SensorConfig,
    Sensors, Stage, run_repeating,
};
use armid::random::TrialStreams;
use armid::robot::{Arm, JointSignals};

/// The hidden effect.
#[derive(Debug, Clone, Copy)]
pub enum Law {
    /// Friction under the torque that the gear transmits.
    Load {
        mu: f64,
    },
    /// Friction under the torque on the motor's side of the gear.
    MotorLoad {
        mu: f64,
    },
    Dahl {
        stiffness_per_rad: f64,
    },
    /// Bristles with dz/dq = k (1 − z sign q̇)ⁱ, i = `exponent`.
    DahlOfExponent {
        stiffness_per_rad: f64,
        exponent: f64,
    },
    /// Bristles that are damped as well (σ₁/σ₀ is `damping_s`), and hold a Stribeck curve if `extra_nm` is not zero.
    LuGre {
        stiffness_per_rad: f64,
        damping_s: f64,
        extra_nm: f64,
        vs_rad_s: f64,
    },
    /// A reading that saturates at this share of the largest torque; noise is added afterwards.
    CutBeforeNoise {
        share: f64,
    },
    /// A current that zigzags between plus and minus this height as the motor turns, without moving anything.
    ZigzagOfTheCurrent {
        height_nm: f64,
        per_turn: f64,
    },
    /// Torque that is read this many milliseconds before the rest of its row.
    Late {
        ms: usize,
    },
    /// Torque that goes through a low-pass of first order with this time constant before it is recorded.
    LowPass {
        ms: f64,
    },
}

/// A hidden effect, its joint, and the way the log is recorded.
pub struct Hidden {
    joint: usize,
    law: Law,
    periods: usize,
    log_rate_hz: f64,
    lost_rows: Vec<Range<usize>>,
    noise: f64,
    fed_forward: f64,
    velocity_offset_rad_s: f64,
    rotor_in_the_file: f64,
}

impl Hidden {
    pub fn on(joint: usize, law: Law) -> Self {
        Self {
            joint,
            law,
            periods: 8,
            log_rate_hz: 125.0,
            lost_rows: Vec::new(),
            noise: 1.0,
            fed_forward: PlantConfig::default().friction_feedforward,
            velocity_offset_rad_s: 0.0,
            rotor_in_the_file: 1.0,
        }
    }

    /// The recorder drops these rows.
    pub fn without_rows(self, lost_rows: &[Range<usize>]) -> Self {
        Self { lost_rows: lost_rows.to_vec(), ..self }
    }

    /// Scales the usual noise by this factor.
    pub fn with_noise(self, noise: f64) -> Self {
        Self { noise, ..self }
    }

    /// Uses drives that feed this share of friction forward.
    pub fn fed_forward(self, share: f64) -> Self {
        Self { fed_forward: share, ..self }
    }

    /// Adds this offset to all velocities.
    pub fn with_velocity_offset(self, rad_s: f64) -> Self {
        Self { velocity_offset_rad_s: rad_s, ..self }
    }

    /// Diagnoses with a robot's file whose rotor of this joint has this share of its true inertia.
    pub fn with_rotor_in_the_file(self, share: f64) -> Self {
        Self { rotor_in_the_file: share, ..self }
    }

    pub fn logged_at(self, log_rate_hz: f64) -> Self {
        Self { log_rate_hz, ..self }
    }

    /// Simulates a log with noise of `seed` and diagnoses it.
    pub fn diagnose(&self, seed: u64) -> Finding {
        self.diagnose_run(&self.run(), seed)
    }

    /// Simulates the arm and its recorder without noise.
    pub fn run(&self) -> Recording {
        let arm = Arm::built_in("ur5").unwrap();
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        let excitation = Excitation::new(series, 2.0, self.periods).unwrap();
        // Stiff bristles need short integration steps.
        let step_s = match self.law {
            Law::Dahl { stiffness_per_rad } | Law::LuGre { stiffness_per_rad, .. }
                if stiffness_per_rad > 800.0 =>
            {
                0.00025
            }
            _ => PlantConfig::default().step_s,
        };
        // A delay is a whole number of rows in a log at 1 kHz.
        let log_rate_hz = if matches!(self.law, Law::Late { .. } | Law::LowPass { .. }) {
            1000.0
        } else {
            self.log_rate_hz
        };
        let config = PlantConfig { log_rate_hz, step_s, ..PlantConfig::default() };
        let law = HiddenLaw::new(&arm, self.joint, self.law);
        let mut plant =
            Plant::with_drivetrain(&arm, &arm, &[self.fed_forward; 6], Box::new(law), &config)
                .unwrap();
        let mut recording =
            run_repeating(&excitation, &config, |begin| plant.run(begin, None)).unwrap();
        if let Law::CutBeforeNoise { share } = self.law {
            let torque = recording.torque_nm.joint_mut(self.joint);
            let limit = share * torque.iter().fold(0.0f64, |most, t| most.max(t.abs()));
            torque.iter_mut().for_each(|t| *t = t.clamp(-limit, limit));
        }
        if let Law::ZigzagOfTheCurrent { height_nm, per_turn } = self.law {
            let q_rad = recording.q_rad.joint(self.joint).to_vec();
            let torque = recording.torque_nm.joint_mut(self.joint);
            for (t, q) in torque.iter_mut().zip(q_rad) {
                let turn = (q * per_turn / std::f64::consts::TAU + 0.1).rem_euclid(1.0);
                *t += height_nm * (1.0 - 4.0 * (turn - 0.5).abs());
            }
        }
        if let Law::Late { ms } = self.law {
            let torque = recording.torque_nm.joint_mut(self.joint);
            torque.copy_within(..torque.len() - ms, ms);
        }
        if let Law::LowPass { ms } = self.law {
            let torque = recording.torque_nm.joint_mut(self.joint);
            let (mut out, mut before) = (torque[0], torque[0]);
            for t in torque {
                let mean = 0.5 * (*t + before);
                before = *t;
                out += (mean - out) * (1.0 - (-1.0 / ms).exp());
                *t = out;
            }
        }
        if let Law::Late { .. } | Law::LowPass { .. } = self.law {
            let every = (1000.0 / self.log_rate_hz) as usize;
            recording = only_rows(recording, |k| k % every == 0);
        }
        only_rows(recording, |k| !self.lost_rows.iter().any(|lost| lost.contains(&k)))
    }

    /// Diagnoses a `recording` of this arm, read with noise of `seed`.
    pub fn diagnose_run(&self, recording: &Recording, seed: u64) -> Finding {
        let arm = Arm::built_in("ur5").unwrap();
        let sensors = SensorConfig {
            torque_sd_nm: PerJoint::Each(
                crate::simulated::SIGMA_NM.map(|sd| self.noise * sd).to_vec(),
            ),
            q_sd_rad: PerJoint::All(self.noise * 2e-5),
            qd_sd_rad_s: PerJoint::All(self.noise * 1e-3),
            ..SensorConfig::default()
        };
        let sensors = Sensors::new(&sensors, &arm, self.log_rate_hz).unwrap();
        let mut measured = Measured::like(recording);
        sensors.measure(recording, &TrialStreams::new(seed, b"hidden", 0), &mut measured);
        for j in 0..arm.dof() {
            let velocities = measured.qd_rad_s.joint_mut(j).iter_mut();
            velocities.for_each(|qd| *qd += self.velocity_offset_rad_s);
        }
        let mut arm = arm;
        arm.joints[self.joint].drive.rotor_inertia_kg_m2 *= self.rotor_in_the_file;
        let model = Model::new(&arm);
        let full = Parameterisation::full(arm.dof(), arm.torque_offsets);
        let set = BaseSet::find(&arm, full).unwrap();
        let mut diagnoser = Diagnoser::new(&arm, &model, &set, Options::default());
        let measurement = Measurement {
            source: "hidden",
            time_s: &recording.time_s,
            q_rad: &measured.q_rad,
            qd_rad_s: &measured.qd_rad_s,
            torque_nm: &measured.torque_nm,
        };
        diagnoser.diagnose(&measurement, &[], None).unwrap()
    }
}

/// The rows of `recording` for which `kept` is true.
fn only_rows(recording: Recording, kept: impl Fn(usize) -> bool) -> Recording {
    let rows: Vec<usize> = (0..recording.time_s.len()).filter(|k| kept(*k)).collect();
    let of = |signals: &JointSignals| {
        JointSignals::from_fn(signals.joints(), rows.len(), |j, k| signals.joint(j)[rows[k]])
    };
    Recording {
        time_s: rows.iter().map(|k| recording.time_s[*k]).collect(),
        q_rad: of(&recording.q_rad),
        qd_rad_s: of(&recording.qd_rad_s),
        torque_nm: of(&recording.torque_nm),
        ..recording
    }
}

struct HiddenLaw {
    arm: Arm,
    joint: usize,
    law: Law,
    link_nm: Vec<f64>,
}

impl HiddenLaw {
    fn new(arm: &Arm, joint: usize, law: Law) -> Self {
        Self { arm: arm.clone(), joint, law, link_nm: vec![0.0; arm.dof()] }
    }
}

impl Drivetrain for HiddenLaw {
    fn states(&self) -> usize {
        match self.law {
            Law::Dahl { .. } | Law::DahlOfExponent { .. } | Law::LuGre { .. } => 1,
            _ => 0,
        }
    }

    fn start(&mut self, arm: &mut RapierArm, _: &mut [f64], _: &mut [f64], _: &mut [f64]) {
        for (j, joint) in self.arm.joints.iter().enumerate() {
            arm.set_rotor_inertia(j, joint.drive.rotor_inertia_kg_m2);
        }
    }

    fn fastest_decay_per_s(&self, inverse: &[f64]) -> f64 {
        let slope = |d: &armid::robot::Drive| {
            d.viscous_nm_s_rad + d.coulomb_nm / self.arm.friction_epsilon_rad_s
        };
        self.arm
            .joints
            .iter()
            .enumerate()
            .map(|(j, joint)| slope(&joint.drive) * inverse[j])
            .fold(0.0, f64::max)
    }

    fn rates(
        &mut self,
        arm: &mut RapierArm,
        stage: &Stage<'_>,
        qdd: &mut [f64],
        states_rate: &mut [f64],
    ) {
        let h = self.joint;
        for (j, joint) in self.arm.joints.iter().enumerate() {
            let v = stage.qd_rad_s[j];
            let sign = (v / self.arm.friction_epsilon_rad_s).tanh();
            let friction = joint.drive.viscous_nm_s_rad * v + joint.drive.coulomb_nm * sign;
            self.link_nm[j] = stage.drive_torque_nm[j] - friction;
        }
        let drive = self.arm.joints[h].drive;
        let v = stage.qd_rad_s[h];
        let sign = (v / self.arm.friction_epsilon_rad_s).tanh();
        match self.law {
            Law::Load { mu } => {
                // The torque transmitted by the gear: the drive torque minus rotor inertia and friction, where the
                // rotor's share depends on the acceleration. The iteration converges as μ^k.
                let before = self.link_nm[h];
                arm.forward_dynamics(stage.q_rad, stage.qd_rad_s, &self.link_nm, qdd);
                for _ in 0..5 {
                    let transmitted = self.link_nm[h] - drive.rotor_inertia_kg_m2 * qdd[h];
                    let now = before - mu * transmitted.abs() * sign;
                    let mut more = vec![0.0; qdd.len()];
                    more[h] = now - self.link_nm[h];
                    self.link_nm[h] = now;
                    arm.add_response(&more, qdd);
                }
                return;
            }
            Law::MotorLoad { mu } => {
                // The load L that remains of the drive torque, which also overcomes this friction μ|L|.
                let carried = self.link_nm[h] / (1.0 + mu * sign * self.link_nm[h].signum());
                self.link_nm[h] = carried;
            }
            Law::CutBeforeNoise { .. }
            | Law::ZigzagOfTheCurrent { .. }
            | Law::Late { .. }
            | Law::LowPass { .. } => {}
            Law::Dahl { stiffness_per_rad } => {
                let z = stage.states[0];
                states_rate[0] = stiffness_per_rad * (v - v.abs() * z);
                self.link_nm[h] += drive.coulomb_nm * (sign - z);
            }
            Law::DahlOfExponent { stiffness_per_rad, exponent } => {
                let z = stage.states[0];
                let left = (1.0 - v.signum() * z).max(0.0);
                states_rate[0] = stiffness_per_rad * v * left.powf(exponent);
                self.link_nm[h] += drive.coulomb_nm * (sign - z);
            }
            Law::LuGre { stiffness_per_rad, damping_s, extra_nm, vs_rad_s } => {
                // In the symbols of the model: σ₀, σ₁, g(v), and the mean deflection z of its bristles.
                let sigma0 = stiffness_per_rad * drive.coulomb_nm;
                let sigma1 = sigma0 * damping_s;
                let g = drive.coulomb_nm + extra_nm * (-(v / vs_rad_s).powi(2)).exp();
                let z = stage.states[0];
                let rate = v - sigma0 * v.abs() / g * z;
                states_rate[0] = rate;
                self.link_nm[h] += drive.coulomb_nm * sign - sigma0 * z - sigma1 * rate;
            }
        }
        arm.forward_dynamics(stage.q_rad, stage.qd_rad_s, &self.link_nm, qdd);
    }
}
