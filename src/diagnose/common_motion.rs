//! Torque of every period, corrected to what it would have been along one motion common to all periods.
//!
//! A model can only be as good as the motion that is put into it. The averaged acceleration is a short Fourier series.
//! Beyond its last harmonic the torque still contains the effect of friction's corners on the acceleration, and the
//! motion of every period differs a little from the mean. The rigid model corrects for both; it is accurate enough for
//! small differences:
//!
//! y*_p = y_p − [τ̂_rigid(q_p, q̇_p, q̈_p) − τ̂_rigid(q̄, q̇̄, q̈)]
//!
//! The first term takes the motion of period p itself, with all its harmonics and all its encoder noise. The second
//! term takes the mean angles and velocities with all their harmonics, at which friction is evaluated, and the short
//! series of the acceleration. y* is then regressed on this common motion, whose columns are almost free of noise,
//! while the scatter of y* between the periods is that of the equations: noise of torque and motion together. Whitening
//! by this scatter gives noisy harmonics the weight they deserve (errors in variables, to first order). The effect of
//! the noise d_p in the velocity of period p on the friction φ,
//!
//! δ_p = √P [φ(q̇̄ + d_p/√P) − mean over p of the same],
//!
//! is subtracted from y*_p as well. It is evaluated with the step d_p/√P, which is the size of the error of the mean,
//! because friction turns round within a few hundredths of a rad/s, where the noise of a single period is not small.
//! The mean of y* over the periods does not change by δ_p.
//!
//! The acceleration keeps only the harmonics in which it stands out of its noise ([`KeptBands`]), and the motion of a
//! joint that rests or creeps is freed of noise ([`SlowStretches`]). Noise left in them is also in the equations, with the
//! opposite sign, and therefore resembles any effect that depends on them. Only a few percent of the harmonics of an
//! inertia's column are noise, but where the noise of the torque falls steeply with frequency these harmonics have the
//! largest weight; and the friction of a joint at rest changes its sign with the noise of its velocity. Where angles are
//! coarse, friction is evaluated at velocities without their fastest harmonics ([`CoarseAngles`]).

use super::coarse_angles::CoarseAngles;
use super::kept_bands::KeptBands;
use super::load::load_along;
use super::scene::equivalent_arm;
use super::slow_stretches::{Sampled, SlowStretches};
use crate::base::BaseSet;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, BetweenRows, FrictionDrift, Regression};
use crate::robot::{Arm, JointSignals};
use crate::signal::{Bracket, cubic_at, mean_period, subtract_mean_period};

/// Corrects the torque of `regression` to the common motion of its periods, using the base parameters `theta`, and
/// recomputes its columns along this motion.
///
/// Where the log was resampled on an even clock, its torque is a straight line between rows. This cuts off the corners
/// of friction there, which looks like friction that builds up after reversals and like a delay. The difference between
/// the predicted torque and the straight line through the predictions at the rows is therefore added.
///
/// A single run is left unchanged: it has no motion but its own.
///
/// Returns the joints whose velocities lost harmonics because their angles are coarse.
pub fn move_to_common_motion(
    regression: &mut Regression,
    (arm, set): (&Arm, &BaseSet),
    theta: &[f64],
) -> Vec<CoarseAngles> {
    let Some(each_period) = &regression.prepared.each_period else { return Vec::new() };
    let n = regression.problem.samples;
    let sampled =
        Sampled { rate_hz: regression.problem.rate_hz, width_rad_s: arm.friction_epsilon_rad_s };
    let mut own_rad = each_period.q_rad.clone();
    let mut coarse = Vec::new();
    let mut own_rad_s = each_period.qd_rad_s.clone();
    let mut qdd_rad_s2 = regression.prepared.motion.qdd_rad_s2.clone();
    for j in 0..own_rad_s.joints() {
        let own = own_rad_s.joint_mut(j);
        let bands = KeptBands::that_stand_out(own, n);
        let told: Vec<f64> = own.chunks_exact(n).flat_map(|period| bands.of(period)).collect();
        let slow = SlowStretches::of(own, &told, n, &sampled);
        if let Some(angles) = CoarseAngles::of(&regression.prepared, j, sampled.width_rad_s) {
            angles.quieten(own, n);
            coarse.push(angles);
        }
        own.copy_from_slice(&slow.averaged(own, &told));
        let q = own_rad.joint_mut(j);
        q.copy_from_slice(&slow.averaged(q, q));
        let short = bands.of(qdd_rad_s2.joint(j));
        qdd_rad_s2.joint_mut(j).copy_from_slice(&slow.averaged(&short, &short));
    }
    let common = Motion {
        q_rad: own_rad.map_joints(|_, q| mean_period(q, n)),
        qd_rad_s: own_rad_s.map_joints(|_, qd| mean_period(qd, n)),
        qdd_rad_s2,
    };
    let (arm, _) = equivalent_arm(arm, set, theta);
    let model = Model::new(&arm);
    let own_nm = load_along(&model, &arm, each_period);
    let common_nm = load_along(&model, &arm, &common);
    let mut torque_nm = regression.prepared.torque_nm.map_joints(|j, y| {
        let moved = own_nm.joint(j).iter().zip(common_nm.joint(j).iter().cycle());
        y.iter().zip(moved).map(|(y, (own, common))| y - (own - common)).collect()
    });
    for j in 0..torque_nm.joints() {
        let (own, mean) = (own_rad_s.joint(j), common.qd_rad_s.joint(j));
        let noise = friction_noise(&arm, j, own, mean);
        torque_nm.joint_mut(j).iter_mut().zip(noise).for_each(|(y, noise)| *y -= noise);
    }
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
    coarse
}

/// Standard deviation of the mean over the periods at every sample, Nm: the error that noise of torque and motion
/// leaves there, without drift of friction. `None` where nothing repeats. `regression` must have been moved to its
/// common motion.
pub fn noise_of_mean(regression: &Regression) -> Option<JointSignals> {
    let (n, periods) = (regression.problem.samples, regression.problem.periods);
    if periods < 2 {
        return None;
    }
    let [of_mean, of_scatter] = regression.prepared.kept();
    let panels = &regression.problem.panels;
    let drift = FrictionDrift::beside_mean(&regression.prepared.motion.qd_rad_s, periods);
    let scatter = panels.iter().enumerate().map(|(j, panel)| {
        let mut off = panel.y.clone();
        drift.remove(j, &mut off, |_| true);
        subtract_mean_period(&mut off, n);
        off.iter_mut().for_each(|off| *off *= *off);
        mean_period(&off, n)
    });
    let scatter: Vec<Vec<f64>> = scatter.collect();
    let share = 1.0 / ((periods - 1) as f64 * of_scatter * of_mean);
    Some(JointSignals::from_fn(panels.len(), n, |j, k| (scatter[j][k] * share).sqrt()))
}

/// δ_p (see the module) of joint `j`, Nm, at every sample of all periods. `own` are the velocities of all periods,
/// `mean` is their mean.
fn friction_noise(arm: &Arm, j: usize, own: &[f64], mean: &[f64]) -> Vec<f64> {
    let (n, drive) = (mean.len(), &arm.joints[j].drive);
    let periods = own.len() / n;
    let scale = (periods as f64).sqrt();
    let friction = |qd: f64| drive.coulomb_nm * arm.friction_sign(qd) + drive.viscous_nm_s_rad * qd;
    let of_mean = mean.iter().cycle().zip(own);
    let mut noise: Vec<f64> =
        of_mean.map(|(mean, own)| scale * friction(mean + (own - mean) / scale)).collect();
    subtract_mean_period(&mut noise, n);
    noise
}

/// The rows of a log that was resampled on an even clock.
struct Rows<'a> {
    between: &'a BetweenRows,
    start_s: f64,
    rate_hz: f64,
}

impl Rows<'_> {
    /// Predicted torque of joint `j` minus the straight line through the predictions at the neighbouring rows, Nm, at
    /// every sample of all periods. `load_nm` and `motion` are those of the periods.
    fn lost_to_straight_lines(
        &self,
        arm: &Arm,
        j: usize,
        load_nm: &JointSignals,
        motion: &Motion,
    ) -> Vec<f64> {
        let drive = &arm.joints[j].drive;
        let dry = |qd: f64| drive.coulomb_nm * arm.friction_sign(qd);
        let qd_rad_s = motion.qd_rad_s.joint(j);
        let pairs = load_nm.joint(j).iter().zip(qd_rad_s);
        // The smooth part of the torque, which may be interpolated: rows lie between the samples.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noisy_periods::{SAMPLES, periods};

    /// δ_p of a velocity far from rest is the viscous friction of its noise, and its mean over the periods is zero.
    #[test]
    fn noise_of_the_velocity_rubs() {
        let arm = Arm::built_in("ur5").unwrap();
        let own = periods(|_| 1.0, 1e-3);
        let mean = mean_period(&own, SAMPLES);
        let noise = friction_noise(&arm, 1, &own, &mean);
        let viscous = arm.joints[1].drive.viscous_nm_s_rad;
        for (k, noise) in noise.iter().enumerate() {
            let expected = viscous * (own[k] - mean[k % SAMPLES]);
            // tanh(1/ε) is flat to the last bits for the UR5's ε of 0.02 rad/s.
            assert!((noise - expected).abs() < 1e-12, "{noise} {expected}");
        }
        let common = mean_period(&noise, SAMPLES);
        // The mean of eight numbers of about 30 Nm was subtracted from each: zero to their last digits.
        assert!(common.iter().all(|common| common.abs() < 8.0 * 30.0 * f64::EPSILON));
    }
}
