//! Replay of one log by one simulated arm.

use super::error::ReplayError;
use super::simulated::SimulatedArm;
use crate::diagnose::Scene;
use crate::diagnose::rms::rms_where;
use crate::dynamics::Motion;
use crate::excitation::SampledMotion;
use crate::identify::{Options, Regression};
use crate::plant::faults::{Effect, FaultyPlant};
use crate::plant::{PlantConfig, PlantError, Recording};
use crate::robot::{Arm, JointSignals};
use crate::signal::{Scratch, SignalError, ZeroPhase, central_4, mean_period};

/// A log prepared for its replay.
pub(super) struct Course<'a> {
    /// Motion of the log.
    pub(super) scene: &'a Scene,
    /// Torque of the log: the mean period, or the low-passed run, Nm.
    pub(super) measured_nm: &'a JointSignals,
    /// Sample of the motion to which each sample of the torque belongs.
    pub(super) samples: &'a [usize],
    /// Processing options of a single run.
    pub(super) options: &'a Options,
}

/// What a simulated arm did along the motion of a log.
pub(super) struct Replayed {
    /// Drive torque, processed as that of the log, Nm.
    pub(super) torque_nm: JointSignals,
    /// Logged minus simulated angle under the controller alone, rms per joint, rad.
    pub(super) tracking_rms_rad: Vec<f64>,
    /// Logged minus simulated angle in the run whose torque is compared, rms per joint, rad.
    pub(super) motion_rms_rad: Vec<f64>,
}

/// Run-in before the period of a periodic motion that counts, s: fifty times as long as the controller takes to forget
/// how it started.
const LEAD_S: f64 = 1.0;
/// Longest step of the integrator, s.
const LONGEST_STEP_S: f64 = 0.001;

/// Torque of a log in the form in which it is compared, Nm: the mean period, or the low-passed run.
pub(in crate::diagnose) fn measured_nm(regression: &Regression) -> JointSignals {
    let Regression { prepared, problem, .. } = regression;
    if prepared.replicates.is_some() {
        let n = prepared.motion.samples();
        return prepared.torque_nm.map_joints(|_, y| mean_period(y, n));
    }
    JointSignals::from_fn(problem.joints(), problem.samples, |j, k| problem.panels[j].y[k])
}

impl Course<'_> {
    /// Replays the log's motion with `simulated` and `effects` in it, under the controller of `nominal`.
    ///
    /// In a first run, the controller gets the logged motion as reference. The arm deviates from it because of effects
    /// that the controller does not know: the tracking error. This deviation, smoothed, is added to the reference, so
    /// that the arm moves as the logged one did. The torque of the second run is compared with that of the log.
    pub(super) fn replay(
        &self,
        simulated: &SimulatedArm,
        effects: &[Effect],
        nominal: &Arm,
    ) -> Result<Replayed, ReplayError> {
        let effects: Vec<Effect> = simulated.offsets.iter().chain(effects).cloned().collect();
        let plant = FaultyPlant::with_controller(
            &simulated.arm,
            nominal,
            &effects,
            &plant_config(self.scene.rate_hz),
        )?;
        let repeats = effects.iter().all(Effect::repeats);
        let mut reference = self.smooth(&self.scene.motion.q_rad)?;
        let (q_rad, _) = self.follow(&plant, reference.clone(), repeats)?;
        let lag_rad = self.behind_log(&q_rad);
        let correction = self.smooth(&lag_rad)?;
        add(&mut reference.q_rad, &correction.q_rad);
        add(&mut reference.qd_rad_s, &correction.qd_rad_s);
        add(&mut reference.qdd_rad_s2, &correction.qdd_rad_s2);
        let (q_rad, torque_nm) = self.follow(&plant, reference, repeats)?;
        Ok(Replayed {
            torque_nm: self.as_compared(torque_nm)?,
            tracking_rms_rad: rms_per_joint(&lag_rad),
            motion_rms_rad: rms_per_joint(&self.behind_log(&q_rad)),
        })
    }

    /// Logged minus simulated angles, rad.
    fn behind_log(&self, q_rad: &JointSignals) -> JointSignals {
        let logged = &self.scene.motion.q_rad;
        JointSignals::from_fn(logged.joints(), logged.samples(), |j, k| {
            logged.joint(j)[k] - q_rad.joint(j)[k]
        })
    }

    /// Angles and torque of one run at the samples of the scene; averaged over the period where the motion repeats.
    fn follow(
        &self,
        plant: &FaultyPlant,
        reference: Motion,
        repeats: bool,
    ) -> Result<(JointSignals, JointSignals), PlantError> {
        let Scene { rate_hz, periodic, periods, .. } = *self.scene;
        let n = self.scene.samples();
        if !periodic {
            let Recording { q_rad, torque_nm, .. } =
                plant.run(&SampledMotion::once(reference, rate_hz), None)?;
            return Ok((q_rad, torque_nm));
        }
        // Effects that do not repeat begin with the record, so that all of it is simulated.
        let (lead, count) =
            if repeats { ((LEAD_S * rate_hz).ceil() as usize, n) } else { (0, n * periods) };
        let (lead_s, duration_s) = (lead as f64 / rate_hz, (lead + count) as f64 / rate_hz);
        let reference = SampledMotion::repeating(reference, rate_hz, lead_s, duration_s);
        let run = plant.run(&reference, None)?;
        let mean = |signals: &JointSignals| {
            signals.map_joints(|_, y| mean_period(&y[lead..lead + count], n))
        };
        Ok((mean(&run.q_rad), mean(&run.torque_nm)))
    }

    /// The angles below the cut-off of the processing, with their derivatives. Above it, and above what the controller
    /// can follow, the accelerations of a log are noise rather than motion, and would be fed forward as torque.
    fn smooth(&self, q_rad: &JointSignals) -> Result<Motion, SignalError> {
        let rate_hz = self.scene.rate_hz;
        let Options { cutoff_hz, order, .. } = *self.options;
        let mut motion = Motion::at_rest(q_rad.joints(), q_rad.samples());
        let mut scratch = Scratch::default();
        for j in 0..q_rad.joints() {
            let (q, qd, qdd);
            if self.scene.periodic {
                q = self.scene.slow_part(q_rad.joint(j), cutoff_hz);
                qd = self.scene.derivative(&q);
                qdd = self.scene.derivative(&qd);
            } else {
                let mut low = q_rad.joint(j).to_vec();
                ZeroPhase::new(cutoff_hz, order, rate_hz)?
                    .filter_in_place(&mut low, &mut scratch)?;
                let mut rates = [vec![0.0; low.len()], vec![0.0; low.len()]];
                central_4(&low, rate_hz, &mut rates[0])?;
                let [first, second] = &mut rates;
                central_4(first, rate_hz, second)?;
                q = low;
                [qd, qdd] = rates;
            }
            motion.q_rad.joint_mut(j).copy_from_slice(&q);
            motion.qd_rad_s.joint_mut(j).copy_from_slice(&qd);
            motion.qdd_rad_s2.joint_mut(j).copy_from_slice(&qdd);
        }
        Ok(motion)
    }

    /// Simulated torque, processed and sampled as that of the log.
    fn as_compared(&self, mut torque_nm: JointSignals) -> Result<JointSignals, SignalError> {
        if self.scene.periodic {
            return Ok(torque_nm);
        }
        let Options { cutoff_hz, order, .. } = *self.options;
        let low_pass = ZeroPhase::new(cutoff_hz, order, self.scene.rate_hz)?;
        let mut scratch = Scratch::default();
        for j in 0..torque_nm.joints() {
            low_pass.filter_in_place(torque_nm.joint_mut(j), &mut scratch)?;
        }
        Ok(torque_nm.map_joints(|_, y| self.samples.iter().map(|&k| y[k]).collect()))
    }
}

fn add(signals: &mut JointSignals, more: &JointSignals) {
    for j in 0..signals.joints() {
        let pairs = signals.joint_mut(j).iter_mut().zip(more.joint(j));
        pairs.for_each(|(signal, more)| *signal += more);
    }
}

fn rms_per_joint(signals: &JointSignals) -> Vec<f64> {
    (0..signals.joints()).map(|j| rms_where(signals.joint(j), |_| true)).collect()
}

/// Inverse of the last significant digit of a rate, s.
const RATE_DIGITS: f64 = 1e6;

/// The plant's own controller, with decisions at every step and a log at the rate of the replayed one.
pub(super) fn plant_config(rate_hz: f64) -> PlantConfig {
    // A rate derived from time stamps carries their round-off.
    let rate_hz = (rate_hz * RATE_DIGITS).round() / RATE_DIGITS;
    let steps = (1.0 / (rate_hz * LONGEST_STEP_S) * (1.0 - 1e-6)).ceil().max(1.0);
    PlantConfig {
        step_s: 1.0 / (rate_hz * steps),
        control_rate_hz: rate_hz * steps,
        log_rate_hz: rate_hz,
        ..PlantConfig::default()
    }
}
