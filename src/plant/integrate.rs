//! The classical fourth-order Runge–Kutta method, with the drive torque held constant over each step.

use super::drivetrain::{Drivetrain, Stage};
use super::rapier_arm::RapierArm;

/// State of the plant, which is kept outside the engine: `[q | q̇ | the drivetrain's own states]`.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    dof: usize,
    values: Vec<f64>,
}

impl State {
    /// The state with `dof` joints at rest at angle zero, and `states` states of the drivetrain at zero.
    pub fn zeros(dof: usize, states: usize) -> Self {
        Self { dof, values: vec![0.0; 2 * dof + states] }
    }

    /// Joint angles, rad.
    pub fn q_rad(&self) -> &[f64] {
        &self.values[..self.dof]
    }

    /// Joint velocities, rad/s.
    pub fn qd_rad_s(&self) -> &[f64] {
        &self.values[self.dof..2 * self.dof]
    }

    /// The drivetrain's own states.
    pub fn own(&self) -> &[f64] {
        &self.values[2 * self.dof..]
    }

    /// Mutable angles (rad), velocities (rad/s) and own states of the drivetrain.
    pub fn parts_mut(&mut self) -> (&mut [f64], &mut [f64], &mut [f64]) {
        let (q, rest) = self.values.split_at_mut(self.dof);
        let (qd, states) = rest.split_at_mut(self.dof);
        (q, qd, states)
    }

    /// Index (from 0) of the first joint whose angle or speed is not finite.
    pub fn first_not_finite(&self) -> Option<usize> {
        (0..self.dof).find(|&j| !(self.q_rad()[j] + self.qd_rad_s()[j]).is_finite())
    }
}

/// The classical Runge–Kutta method: y(t+h) = y + h/6 (k₁ + 2k₂ + 2k₃ + k₄), with global error O(h⁴).
///
/// Friction is evaluated in every stage. The term tanh(q̇/ε) is stiff: for a speed that decays at rate λ the method is
/// stable while h λ < 2.78. [`Plant`](super::Plant) refuses or divides steps with h λ above
/// [`Self::LARGEST_STEP_DECAY`].
#[derive(Debug, Clone)]
pub struct RungeKutta4 {
    rates: [Vec<f64>; 4],
    trial: State,
}

impl RungeKutta4 {
    /// Largest product of step and decay rate that is used. It is below the stability limit of 2.78 to leave a margin
    /// for poses in which a joint feels less inertia than at the start of the run. At 2.0 a disturbance shrinks to 0.33
    /// per step instead of e⁻² = 0.14.
    pub const LARGEST_STEP_DECAY: f64 = 2.0;

    /// An integrator with working memory for states of the same size as `state`.
    pub fn new(state: &State) -> Self {
        let zeros = vec![0.0; state.values.len()];
        Self { rates: std::array::from_fn(|_| zeros.clone()), trial: state.clone() }
    }

    /// Advances `state` from `time_s` to `time_s + step_s` under the constant torque `drive_torque_nm`.
    pub fn step(
        &mut self,
        arm: &mut RapierArm,
        drivetrain: &mut dyn Drivetrain,
        state: &mut State,
        time_s: f64,
        step_s: f64,
        drive_torque_nm: &[f64],
    ) {
        const NODES: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
        for (s, node) in NODES.into_iter().enumerate() {
            let reach = node * step_s;
            let (before, from_here) = self.rates.split_at_mut(s);
            self.trial.values.copy_from_slice(&state.values);
            if let Some(k) = before.last() {
                for (y, k) in self.trial.values.iter_mut().zip(k) {
                    *y += reach * k;
                }
            }
            let n = self.trial.dof;
            let stage = Stage {
                time_s: time_s + reach,
                q_rad: self.trial.q_rad(),
                qd_rad_s: self.trial.qd_rad_s(),
                states: self.trial.own(),
                drive_torque_nm,
            };
            let (qd, rest) = from_here[0].split_at_mut(n);
            let (qdd, states_rate) = rest.split_at_mut(n);
            qd.copy_from_slice(stage.qd_rad_s);
            drivetrain.rates(arm, &stage, qdd, states_rate);
        }
        let [k1, k2, k3, k4] = &self.rates;
        for (i, y) in state.values.iter_mut().enumerate() {
            *y += step_s / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
    }
}
