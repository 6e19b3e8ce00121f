//! Converts noise of the motion into noise of the torque.
//!
//! The regressor is evaluated along the averaged motion, and thus contains the remaining noise of the encoders. The
//! measurement of period p deviates by d_p from the average (Σ d_p = 0, in the harmonics that the average keeps), so
//! that d_p/√P is one draw of the error of the average itself. Through the model it becomes a torque,
//!
//! δ_p = √P [X(m̄ + d_p/√P) θ̂ − mean over p of the same], y*_p = y_p − δ_p
//!
//! The mean of y* over the periods is that of y. Its scatter is that of the equations, y − X(m)θ, for encoders and
//! torque together, whatever the correlation between them: no model with this motion leaves less. The step is d_p/√P
//! because friction reverses within ε of velocity; the noise of one period would not be small there, but that of the
//! average is.

use super::problem::{Assembler, Problem};
use crate::dynamics::{Model, Motion};
use crate::robot::JointSignals;

/// Returns `problem` (one period along `mean` with P periods of torque) with its torque moved to `mean`: y* by the
/// parameters `theta`, with d = `deviations` (joints × P·n).
pub fn moved_to_mean(
    problem: &Problem,
    assembler: &mut Assembler,
    model: &Model,
    mean: &Motion,
    deviations: &Motion,
    theta: &[f64],
) -> Problem {
    let (n, periods) = (problem.samples, problem.periods);
    let share = 1.0 / (periods as f64).sqrt();
    let mut along = Problem::new(problem.plan.clone(), problem.rate_hz);
    let mut predicted: Vec<Vec<f64>> = vec![vec![0.0; n * periods]; problem.joints()];
    let no_torque = JointSignals::zeros(problem.joints(), n);
    for p in 0..periods {
        let moved = |mean: &JointSignals, off: &JointSignals| {
            mean.map_joints(|j, mean| {
                let off = &off.joint(j)[p * n..(p + 1) * n];
                mean.iter().zip(off).map(|(mean, off)| mean + share * off).collect()
            })
        };
        let motion = Motion {
            q_rad: moved(&mean.q_rad, &deviations.q_rad),
            qd_rad_s: moved(&mean.qd_rad_s, &deviations.qd_rad_s),
            qdd_rad_s2: moved(&mean.qdd_rad_s2, &deviations.qdd_rad_s2),
        };
        assembler.assemble(&mut along, model, &motion, &no_torque);
        for (j, predicted) in predicted.iter_mut().enumerate() {
            along.predict(j, theta, &mut predicted[p * n..(p + 1) * n]);
        }
    }
    let mut out = problem.clone();
    for (panel, predicted) in out.panels.iter_mut().zip(&predicted) {
        for k in 0..n {
            let own = || predicted.iter().skip(k).step_by(n);
            let common = own().sum::<f64>() / periods as f64;
            for (y, own) in panel.y.iter_mut().skip(k).step_by(n).zip(own()) {
                *y -= (own - common) / share;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::ColumnPlan;
    use crate::base::{BaseSet, Parameterisation};
    use crate::robot::Arm;

    /// Four runs whose true motions differ a little, read without noise: moved to the mean motion, their torques are
    /// the same.
    #[test]
    fn what_the_motion_scatters_is_taken_out_of_the_torque() {
        const PERIODS: usize = 4;
        const OFF_RAD_S: f64 = 1e-4;
        let (n, w) = (250, std::f64::consts::TAU);
        let arm = Arm::load("ur5").unwrap();
        let model = Model::new(&arm);
        let set = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        let theta = set.values(&model.standard_parameters());
        // Angle, velocity, acceleration of joint j at sample k of one period of a second.
        let wave = |size: f64, j: usize, k: usize| {
            let (s, c) = (w * k as f64 / n as f64 + j as f64).sin_cos();
            [size * s / w, size * c, -size * w * s]
        };
        let motion = |samples: usize, size: &dyn Fn(usize) -> f64, later: usize| {
            let [q_rad, qd_rad_s, qdd_rad_s2] = [0, 1, 2].map(|d| {
                JointSignals::from_fn(6, samples, |j, k| wave(size(k / n), j + later, k % n)[d])
            });
            Motion { q_rad, qd_rad_s, qdd_rad_s2 }
        };
        let mean = motion(n, &|_| 1.0, 0);
        // Signs + − + − sum to zero.
        let deviations = motion(n * PERIODS, &|p| OFF_RAD_S * [1.0, -1.0][p % 2], 1);
        let mut assembler = Assembler::new(&model);
        let mut along = Problem::new(ColumnPlan::new(&model, &set), n as f64);
        let mut torque_nm = JointSignals::zeros(6, n * PERIODS);
        let sum = |a: &JointSignals, b: &JointSignals, p: usize| {
            JointSignals::from_fn(6, n, |j, k| a.joint(j)[k] + b.joint(j)[p * n + k])
        };
        for p in 0..PERIODS {
            let own = Motion {
                q_rad: sum(&mean.q_rad, &deviations.q_rad, p),
                qd_rad_s: sum(&mean.qd_rad_s, &deviations.qd_rad_s, p),
                qdd_rad_s2: sum(&mean.qdd_rad_s2, &deviations.qdd_rad_s2, p),
            };
            assembler.assemble(&mut along, &model, &own, &JointSignals::zeros(6, n));
            for j in 0..6 {
                along.predict(j, &theta, &mut torque_nm.joint_mut(j)[p * n..(p + 1) * n]);
            }
        }
        let mut problem = along;
        assembler.assemble(&mut problem, &model, &mean, &torque_nm);
        let moved = moved_to_mean(&problem, &mut assembler, &model, &mean, &deviations, &theta);
        for (j, (before, after)) in problem.panels.iter().zip(&moved.panels).enumerate() {
            let (mut scatter, mut largest) = ([0.0; 2], 0.0f64);
            for k in 0..n {
                let means = [before, after]
                    .map(|panel| panel.y[k..].iter().step_by(n).sum::<f64>() / PERIODS as f64);
                largest = largest.max((means[0] - means[1]).abs());
                for (scatter, (panel, mean)) in
                    scatter.iter_mut().zip([before, after].into_iter().zip(means))
                {
                    let off = panel.y[k..].iter().step_by(n).map(|y| (y - mean).powi(2));
                    *scatter += off.sum::<f64>();
                }
            }
            // Torques of up to 100 Nm, rounded.
            assert!(largest < 1e-12, "joint {}: the mean moved by {largest:e}", j + 1);
            // The rest is of second order: for friction ½ max|tanh''| d/ε = 0.4 · 1e-4/0.02 = 2e-3 of the first
            // order, and less in rms.
            let left = (scatter[1] / scatter[0]).sqrt();
            assert!(left < 4e-3, "joint {}: {left:e} of the scatter is left", j + 1);
        }
    }
}
