//! Torques of the drives around the reversals of their joints, in harmonics in which the motion does not tell them.

use fourier::Complex64;
use rayon::prelude::*;

use super::Periods;
use super::harmonics::{Harmonics, Known};
use crate::diagnose::reversal_answer::{FASTEST_HZ, ReversalAnswer};
use crate::dynamics::Motion;
use crate::robot::{Arm, JointSignals};
use crate::signal::FineClock;

/// The recorded torques of the drives, and the friction that they answer.
pub(super) struct DriveTorques<'a> {
    periods: &'a Periods<'a>,
    /// Harmonics of the recorded torque, by joint.
    recorded: Vec<Harmonics>,
    /// Sign of the velocity at every tick, by joint.
    sign: Vec<Vec<f64>>,
    /// Coulomb friction by joint, Nm.
    coulomb_nm: Vec<f64>,
}

impl<'a> DriveTorques<'a> {
    /// Those of `arm` along the `mean` of the `periods`.
    pub(super) fn along(arm: &Arm, mean: &Motion, periods: &'a Periods<'a>) -> Self {
        let Periods { torque_nm, clock, .. } = *periods;
        let sign = |j: usize| -> Vec<f64> {
            let sign = |qd: f64| arm.friction_sign(qd);
            clock.refined(mean.qd_rad_s.joint(j)).into_iter().map(sign).collect()
        };
        Self {
            periods,
            recorded: Harmonics::of_joints(clock, torque_nm),
            sign: (0..mean.joints()).map(sign).collect(),
            coulomb_nm: arm.joints.iter().map(|joint| joint.drive.coulomb_nm).collect(),
        }
    }

    /// The drives' answers to reversals, fitted to the harmonics in which the load is not known to `level`.
    pub(super) fn answers(&self, of_loads: &[Known], level: f64) -> Vec<ReversalAnswer> {
        let Periods { clock, rate_hz, .. } = *self.periods;
        let last = fastest(self.periods);
        let of_joint = |j: usize| {
            let torque = self.recorded[j].beyond(&of_loads[j], level, last);
            ReversalAnswer::new((clock, rate_hz), self.sign[j].clone(), self.coulomb_nm[j], torque)
        };
        (0..self.sign.len()).into_par_iter().map(of_joint).collect()
    }

    /// What the drives deliver according to these `answers`, at every tick, Nm.
    pub(super) fn given_nm(&self, answers: &[ReversalAnswer]) -> Vec<Vec<f64>> {
        answers.iter().map(|answer| answer.given_nm(self.periods.clock)).collect()
    }

    /// The part of the torques `given_nm`, beyond friction, in the harmonics in which the torque of the links is not
    /// known to `level`, at the samples, Nm.
    pub(super) fn jolts_nm(
        &self,
        of_links: &[Known],
        given_nm: &[Vec<f64>],
        level: f64,
    ) -> JointSignals {
        let of_joint = |j: usize| -> Vec<f64> {
            let coulomb_nm = self.coulomb_nm[j];
            let given = given_nm[j].iter().zip(&self.sign[j]);
            let beside: Vec<f64> = given.map(|(given, sign)| given - coulomb_nm * sign).collect();
            jolts(self.periods, &of_links[j], level, &beside)
        };
        let joints: Vec<Vec<f64>> = (0..self.sign.len()).into_par_iter().map(of_joint).collect();
        let samples = self.periods.clock.samples();
        JointSignals::from_fn(joints.len(), samples, |j, k| joints[j][k])
    }
}

/// The last harmonic in which the drives' answers are fitted.
fn fastest(periods: &Periods) -> usize {
    let Periods { clock, rate_hz, highest, .. } = *periods;
    highest.min((FASTEST_HZ * clock.samples() as f64 / rate_hz) as usize)
}

/// The part of a drive's torque beyond friction in the harmonics in which the torque of its links is not known to
/// `level`, at the samples, Nm. `beside_friction_nm` is the torque at every tick.
fn jolts(periods: &Periods, links: &Known, level: f64, beside_friction_nm: &[f64]) -> Vec<f64> {
    let last = fastest(periods);
    let every_tick = FineClock::new(beside_friction_nm.len(), 1);
    let fast = every_tick.filtered(beside_friction_nm, |h| {
        if h <= last && !links.holds(h, level) { Complex64::ONE } else { Complex64::ZERO }
    });
    fast.into_iter().step_by(periods.clock.ticks()).collect()
}

#[cfg(test)]
mod tests {
    use super::super::harmonics::WELL_KNOWN;
    use super::*;

    const N: usize = 500;
    const TICKS: usize = 16;
    const RATE_HZ: f64 = 125.0;

    /// A drive that feeds 90 % of the friction forward, 3 ms late: the jolts of its joint are found as they should be,
    /// up to the noise of six coefficients and the inability of steps of 8 ms to follow a delay of 3 ms.
    #[test]
    fn reversals_tell_the_jolts_of_a_drive() {
        let (fine, coulomb_nm, late) = (N * TICKS, 8.0, 6);
        let velocity = |k: usize| {
            let phase = std::f64::consts::TAU * k as f64 / fine as f64;
            (3.0 * phase + 0.4).sin() + 0.6 * (5.0 * phase + 1.0).cos() + 0.3 * (8.0 * phase).sin()
        };
        let sign: Vec<f64> = (0..fine).map(|k| (velocity(k) / 0.02).tanh()).collect();
        let fed = |k: usize| 0.9 * coulomb_nm * sign[(k + fine - late) % fine];
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        let torque: Vec<f64> = (0..8 * N)
            .map(|k| fed(k % N * TICKS) + 20.0 * velocity(k % N * TICKS) + noise())
            .collect();
        let load: Vec<f64> =
            (0..8 * N).map(|k| 20.0 * velocity(k % N * TICKS) + 4.0 * noise()).collect();
        let clock = FineClock::new(N, TICKS);
        let still = Motion {
            q_rad: JointSignals::zeros(1, N),
            qd_rad_s: JointSignals::zeros(1, N),
            qdd_rad_s2: JointSignals::zeros(1, N),
        };
        let periods = Periods {
            each: &still,
            torque_nm: &JointSignals::zeros(1, N),
            clock: &clock,
            rate_hz: RATE_HZ,
            highest: 200,
        };
        let of_load = Harmonics::of(&clock, &load).known;
        assert!(of_load.holds(8, WELL_KNOWN) && !of_load.holds(50, WELL_KNOWN));
        let of_torque = Harmonics::of(&clock, &torque);
        let torque = of_torque.beyond(&of_load, WELL_KNOWN, fastest(&periods));
        let answer = ReversalAnswer::new((&clock, RATE_HZ), sign.clone(), coulomb_nm, torque);
        let given = answer.given_nm(&clock);
        let beside: Vec<f64> =
            given.iter().zip(&sign).map(|(given, s)| given - coulomb_nm * s).collect();
        let known = jolts(&periods, &of_load, WELL_KNOWN, &beside);
        let true_nm: Vec<f64> = (0..fine).map(|k| fed(k) - coulomb_nm * sign[k]).collect();
        let band = FineClock::new(fine, 1).filtered(&true_nm, |h| {
            if h <= 200 && !of_load.holds(h, WELL_KNOWN) { Complex64::ONE } else { Complex64::ZERO }
        });
        let truth: Vec<f64> = band.into_iter().step_by(TICKS).collect();
        let square = |y: &[f64]| y.iter().map(|y| y * y).sum::<f64>();
        let off: Vec<f64> = truth.iter().zip(&known).map(|(t, k)| t - k).collect();
        // Six coefficients of unit noise, relative to what they explain, and the error of the steps, which is 0.03
        // without noise.
        let share = square(&off) / square(&truth);
        assert!(share < 0.1, "{share}");
    }
}
