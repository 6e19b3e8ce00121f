//! Torque of every period as it would have been along one common motion.
//!
//! A model can only be as good as the motion that is put into it. The averaged acceleration is a short
//! Fourier series: beyond its last harmonic the torque still holds what the corners of friction do to the
//! acceleration, and every period's own motion differs a little. Both are accounted for by the rigid model
//! itself, which is good enough for small differences:
//!
//! y*_p = y_p − [τ̂_rigid(q_p, q̇_p, q̈_p) − τ̂_rigid(q̄, q̇̄, q̈)]
//!
//! with period p's own motion, all its harmonics and all its encoder noise, in the first term; in the
//! second the mean angles and velocities with all their harmonics, at which friction is looked at, and the
//! short series of the acceleration. What is left is regressed on that motion, whose columns are almost
//! free of noise, while the scatter of y* between the periods is that of the equations: noise of the torque
//! and of the acceleration together. Whitened by it, noisy harmonics count for what they are worth (errors
//! in variables, to first order).

use super::extension::mean_period;
use super::scene::{equivalent_arm, load_along};
use crate::base::BaseSet;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, Regression};
use crate::robot::Arm;

/// Moves the torque of `regression` to the mean of its periods' motion, by the base parameters `theta`,
/// and its columns with it.
///
/// Nothing changes for a single run: there is no motion but its own.
pub fn move_to_common_motion(regression: &mut Regression, arm: &Arm, set: &BaseSet, theta: &[f64]) {
    let Some(each_period) = &regression.prepared.each_period else { return };
    let n = regression.problem.samples;
    let common = Motion {
        q_rad: each_period.q_rad.map_joints(|_, q| mean_period(q, n)),
        qd_rad_s: each_period.qd_rad_s.map_joints(|_, qd| mean_period(qd, n)),
        qdd_rad_s2: regression.prepared.motion.qdd_rad_s2.clone(),
    };
    let (arm, _) = equivalent_arm(arm, set, theta);
    let model = Model::new(&arm);
    let own_nm = load_along(&model, &arm, each_period);
    let common_nm = load_along(&model, &arm, &common);
    let torque_nm = regression.prepared.torque_nm.map_joints(|j, y| {
        let moved = own_nm.joint(j).iter().zip(common_nm.joint(j).iter().cycle());
        y.iter().zip(moved).map(|(y, (own, common))| y - (own - common)).collect()
    });
    Assembler::new(&model).assemble(&mut regression.problem, &model, &common, &torque_nm);
    regression.prepared.motion = common;
}
