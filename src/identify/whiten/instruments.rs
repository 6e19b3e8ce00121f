//! Instrumental variables: equations free of the bias by noise in the measured motion.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::dot::dot;
use crate::dynamics::Motion;
use crate::identify::fit::FitError;
use crate::identify::problem::Problem;
use crate::robot::JointSignals;
use crate::signal::{Scratch, SignalError, ZeroPhase, central_4};

/// Cut-off of the instruments' motion over that of the regression. The power density of the noise in a differentiated
/// velocity grows as f², its power up to f as f³, so that a quarter of the cut-off leaves 1/64 of the noise that X
/// and Z share.
pub const SMOOTHER: f64 = 0.25;

/// Filters the motion by a zero-phase low-pass at `cutoff_hz` and differentiates the filtered velocity. The
/// instruments Z are evaluated along such a motion, at [`SMOOTHER`] times the cut-off of the regression.
///
/// Janot, Vandanjon and Gautier (IEEE Trans. Control Systems Technology 22 (2014) 132–145) use the motion of the
/// identified arm simulated under its controller. Where the controller is not known, the natural choice is a
/// computed-torque controller made of the identified model itself. The arm and its model are then the same, and the
/// simulation returns the motion that it is commanded to follow, which is this one. A repeating motion is continued
/// periodically beyond its ends.
pub fn smoothed(
    motion: &Motion,
    repeats: bool,
    rate_hz: f64,
    cutoff_hz: f64,
    order: usize,
    scratch: &mut Scratch,
) -> Result<Motion, SignalError> {
    let filter = ZeroPhase::new(cutoff_hz, order, rate_hz)?;
    let n = motion.samples();
    let mut longer = Vec::new();
    let mut slope = Vec::new();
    let mut low_pass = |series: &[f64], out: &mut [f64], derivative: Option<&mut [f64]>| {
        let inside = filter.filter_into(series, repeats, &mut longer, scratch)?;
        out.copy_from_slice(&longer[inside.clone()]);
        if let Some(derivative) = derivative {
            slope.resize(longer.len(), 0.0);
            central_4(&longer, rate_hz, &mut slope)?;
            derivative.copy_from_slice(&slope[inside]);
        }
        Ok::<(), SignalError>(())
    };
    let zeros = || JointSignals::zeros(motion.joints(), n);
    let (mut q_rad, mut qd_rad_s, mut qdd_rad_s2) = (zeros(), zeros(), zeros());
    for j in 0..motion.joints() {
        low_pass(motion.q_rad.joint(j), q_rad.joint_mut(j), None)?;
        let qdd = Some(qdd_rad_s2.joint_mut(j));
        low_pass(motion.qd_rad_s.joint(j), qd_rad_s.joint_mut(j), qdd)?;
    }
    Ok(Motion { q_rad, qd_rad_s, qdd_rad_s2 })
}

/// Writes equations into `out` (every joint with all columns) whose least-squares solution is the
/// instrumental-variables estimate of `problem`, θ̂ = (ZᵀW²X)⁻¹ ZᵀW²ȳ. Z is the regressor in `instruments` (same
/// rows), W one weight per joint.
///
/// The regressor is W X̂ with X̂ = Z Π, Π = (ZᵀW²Z)⁻¹ ZᵀW²X, the part of X that Z explains (two-stage least squares);
/// the torque is W (y − X θ̂) + W X̂ θ̂. The residuals of least squares are then those of the original equations, so
/// that every covariance of least squares becomes that of the instrumental variables: (X̂ᵀW²X̂)⁻¹ = (ZᵀW²X)⁻¹ ZᵀW²Z
/// (XᵀW²Z)⁻¹.
pub fn instrument(
    problem: &Problem,
    instruments: &Problem,
    weights: &[f64],
    out: &mut Problem,
) -> Result<(), FitError> {
    let (n, b, periods) = (problem.samples, problem.parameters(), problem.periods);
    let mut zz = DMatrix::zeros(b, b);
    let mut zx = DMatrix::zeros(b, b);
    let mut zy = DVector::zeros(b);
    let mut mean = vec![0.0; n];
    for (j, weight) in weights.iter().enumerate() {
        let (x, z) = (&problem.panels[j], &instruments.panels[j]);
        mean.fill(0.0);
        for period in x.y.chunks_exact(n) {
            mean.iter_mut().zip(period).for_each(|(m, y)| *m += y / periods as f64);
        }
        for (row, own) in problem.plan.base_indices(j).zip(z.x.chunks_exact(n)) {
            let both = x.x.chunks_exact(n).zip(z.x.chunks_exact(n));
            for (column, (x, z)) in problem.plan.base_indices(j).zip(both) {
                zz[(row, column)] += weight * weight * dot(own, z);
                zx[(row, column)] += weight * weight * dot(own, x);
            }
            zy[row] += weight * weight * dot(own, &mean);
        }
    }
    let projection = Cholesky::new(zz).map(|factor| factor.solve(&zx));
    let theta = zx.lu().solve(&zy);
    let (Some(projection), Some(theta)) = (projection, theta) else {
        return Err(FitError::WeakInstruments);
    };
    out.samples = n;
    out.periods = periods;
    out.rate_hz = problem.rate_hz;
    out.domain = problem.domain;
    let mut explained = vec![0.0; n];
    for (j, (panel, weight)) in out.panels.iter_mut().zip(weights).enumerate() {
        let instruments = instruments.panels[j].x.chunks_exact(n);
        let instruments: Vec<(usize, &[f64])> =
            problem.plan.base_indices(j).zip(instruments).collect();
        panel.x.clear();
        panel.x.resize(b * n, 0.0);
        for (column, target) in panel.x.chunks_exact_mut(n).enumerate() {
            for (row, z) in &instruments {
                let factor = weight * projection[(*row, column)];
                target.iter_mut().zip(*z).for_each(|(t, z)| *t += factor * z);
            }
        }
        problem.predict(j, theta.as_slice(), &mut explained);
        explained.iter_mut().for_each(|e| *e *= -weight);
        for (column, value) in panel.x.chunks_exact(n).zip(theta.iter()) {
            explained.iter_mut().zip(column).for_each(|(e, x)| *e += value * x);
        }
        panel.y.clear();
        let torque = problem.panels[j].y.iter().zip(explained.iter().cycle());
        panel.y.extend(torque.map(|(y, e)| weight * y + e));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::ColumnPlan;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// y = 2 x + noise, with x read under noise a third of its size.
    #[test]
    fn noise_in_the_regressor_does_not_attenuate() {
        let n = 20_000;
        let mut rng = rand::rngs::ChaCha8Rng::seed_from_u64(8);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let truth = |k: usize| (0.01 * k as f64).sin();
        let plan = ColumnPlan::explicit(&[vec![0]], 1);
        let mut problem = Problem::new(plan.clone(), 100.0);
        (problem.samples, problem.periods) = (n, 1);
        problem.panels[0].x = (0..n).map(|k| truth(k) + 0.25 * normal()).collect();
        problem.panels[0].y = (0..n).map(|k| 2.0 * truth(k) + 0.1 * normal()).collect();
        let mut instruments = problem.clone();
        instruments.panels[0].x = (0..n).map(truth).collect();
        let mut out = Problem::new(plan.full(), 100.0);
        instrument(&problem, &instruments, &[1.0], &mut out).unwrap();
        let slope =
            |p: &Problem| dot(&p.panels[0].x, &p.panels[0].y) / dot(&p.panels[0].x, &p.panels[0].x);
        // Least squares is attenuated by 0.5/(0.5 + 0.0625). σ of the slope by instruments is the residual,
        // √(0.1² + 0.5²), over √(n/2): 0.5 %; the bound is 5 σ.
        assert!((slope(&problem) - 1.78).abs() < 0.02, "{}", slope(&problem));
        assert!((slope(&out) - 2.0).abs() < 0.025, "{}", slope(&out));
        // The residual is that of the original equations.
        let theta = slope(&out);
        let original: f64 = problem.residual_squares(&[theta])[0];
        assert!((out.residual_squares(&[theta])[0] / original - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_smoothed_motion_keeps_what_is_slow() {
        let (rate_hz, n) = (125.0, 1250);
        let w = 2.0 * std::f64::consts::PI * 0.5;
        let at = |k: usize| w * k as f64 / rate_hz;
        let motion = Motion {
            q_rad: JointSignals::from_fn(1, n, |_, k| at(k).sin()),
            qd_rad_s: JointSignals::from_fn(1, n, |_, k| w * at(k).cos()),
            qdd_rad_s2: JointSignals::zeros(1, n),
        };
        let smooth = smoothed(&motion, true, rate_hz, 2.5, 4, &mut Scratch::default()).unwrap();
        for k in 0..n {
            // Fourth-order Butterworth, two passes, −3 dB at 2.5 Hz: 1 − (0.2)⁸/2 at 0.5 Hz.
            assert!((smooth.q_rad.joint(0)[k] - at(k).sin()).abs() < 1e-4);
            assert!((smooth.qdd_rad_s2.joint(0)[k] + w * w * at(k).sin()).abs() < 1e-3 * w * w);
        }
    }
}
