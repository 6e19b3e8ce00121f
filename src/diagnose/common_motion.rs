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
use super::load::load_along;
use super::scene::equivalent_arm;
use crate::base::BaseSet;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, BetweenRows, Regression};
use crate::robot::{Arm, JointSignals};
use crate::signal::{Bracket, cubic_at};

/// Moves the torque of `regression` to the mean of its periods' motion, by the base parameters
/// `theta`, and its columns with it.
///
/// Where the log was put on an even clock, its torque is a straight line between rows: corners of friction are
/// cut off there, which looks like friction that builds up behind reversals and like a delay. What the model
/// says of straight lines and of the true course is put in their place.
///
/// Nothing changes for a single run: there is no motion but its own.
pub fn move_to_common_motion(
    regression: &mut Regression,
    (arm, set): (&Arm, &BaseSet),
    theta: &[f64],
) {
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
    let mut torque_nm = regression.prepared.torque_nm.map_joints(|j, y| {
        let moved = own_nm.joint(j).iter().zip(common_nm.joint(j).iter().cycle());
        y.iter().zip(moved).map(|(y, (own, common))| y - (own - common)).collect()
    });
    if let Some(between) = &regression.prepared.between {
        let processing = &regression.prepared.processing;
        let (start_s, rate_hz) = (processing.window_s[0], processing.rate_hz);
        let rows = Rows { between, start_s, rate_hz };
        for j in 0..torque_nm.joints() {
            let lost = rows.lost_to_straight_lines(&arm, j, &own_nm, each_period);
            torque_nm.joint_mut(j).iter_mut().zip(lost).for_each(|(y, lost)| *y += lost);
        }
    }
    Assembler::new(&model).assemble(&mut regression.problem, &model, &common, &torque_nm);
    regression.prepared.motion = common;
}

/// The rows of a log beside an even clock.
struct Rows<'a> {
    between: &'a BetweenRows,
    start_s: f64,
    rate_hz: f64,
}

impl Rows<'_> {
    /// Predicted torque of joint `j` minus a straight line through its predictions at the rows, Nm, at every
    /// sample of all periods. `load_nm` and `motion` are those of the periods.
    fn lost_to_straight_lines(
        &self,
        arm: &Arm,
        j: usize,
        load_nm: &JointSignals,
        motion: &Motion,
    ) -> Vec<f64> {
        let drive = &arm.joints[j].drive;
        let dry = |qd: f64| drive.coulomb_nm * (qd / arm.friction_epsilon_rad_s).tanh();
        let qd_rad_s = motion.qd_rad_s.joint(j);
        let pairs = load_nm.joint(j).iter().zip(qd_rad_s);
        // All that is smooth: rows lie between its samples.
        let smooth: Vec<f64> = pairs.map(|(load, qd)| load + drive.viscous_nm_s_rad * qd).collect();
        let at_row = |row: usize| {
            let at = (self.between.time_s[row] - self.start_s) * self.rate_hz;
            cubic_at(&smooth, at) + dry(self.between.qd_rad_s.joint(j)[row])
        };
        let samples = smooth.iter().zip(qd_rad_s).zip(&self.between.places);
        samples
            .map(|((smooth, qd), &Bracket { left, u })| {
                if u == 0.0 {
                    return 0.0;
                }
                smooth + dry(*qd) - (1.0 - u) * at_row(left) - u * at_row(left + 1)
            })
            .collect()
    }
}
