//! Torque of every period as it would have been along one common motion.
//!
//! A model can only be as good as the motion that is put into it. The averaged motion is a short Fourier
//! series: beyond its last harmonic the torque still holds what the corners of friction do to the
//! acceleration, and every period's own motion differs a little. Both are accounted for by the model
//! itself, which is good enough for small differences:
//!
//! y*_p = y_p − [τ̂(q_p, q̇_p, q̈_p) − τ̂(q̄, q̇, q̈)]
//!
//! with period p's own motion, all its harmonics and all its encoder noise, in the first term. What is left
//! is regressed on the smooth motion, whose columns are almost free of noise, while the scatter of y*
//! between the periods is that of the equations: noise of the torque and of the acceleration together.
//! Whitened by it, noisy harmonics count for what they are worth (errors in variables, to first order).

use super::scene::{drive_torque_along, equivalent_arm};
use crate::base::BaseSet;
use crate::dynamics::Model;
use crate::identify::Regression;
use crate::robot::Arm;

/// Moves the torque of `regression` to its averaged motion, by the base parameters `theta`.
///
/// Nothing changes for a single run: there is no motion but its own.
pub fn move_to_common_motion(regression: &mut Regression, arm: &Arm, set: &BaseSet, theta: &[f64]) {
    let Some(each_period) = &regression.prepared.each_period else { return };
    let (arm, _) = equivalent_arm(arm, set, theta);
    let model = Model::new(&arm);
    let own = drive_torque_along(&model, each_period);
    let common = drive_torque_along(&model, &regression.prepared.motion);
    for (j, panel) in regression.problem.panels.iter_mut().enumerate() {
        let common = common.joint(j).iter().cycle();
        for ((y, own), common) in panel.y.iter_mut().zip(own.joint(j)).zip(common) {
            *y -= own - common;
        }
    }
}
