//! Torque along a planned motion, and how uncertain the parameters leave a predicted torque.

use nalgebra::DMatrix;

use super::problem::{Assembler, Problem};
use crate::base::{BaseSet, ColumnPlan};
use crate::dynamics::{Model, Motion};
use crate::robot::JointSignals;

/// Torque that a set of base parameters predicts along a planned motion, sample by sample and without any filter.
#[derive(Debug, Clone, PartialEq)]
pub struct Forecast {
    /// τ = X(q, q̇, q̈) θ, Nm.
    pub torque_nm: JointSignals,
    /// σ of this torque from the parameters alone ([`prediction_sd`]), Nm; `None` where their covariance is unknown.
    pub sd_nm: Option<JointSignals>,
}

/// Samples whose regressor is held at a time, so that memory stays bounded.
const PIECE: usize = 4096;

impl Forecast {
    /// The torque along `motion` of an arm with the base parameters `theta`, in the order of `set`, that are known with
    /// the `covariance`.
    pub fn along(
        motion: &Motion,
        model: &Model,
        set: &BaseSet,
        theta: &[f64],
        covariance: Option<&DMatrix<f64>>,
    ) -> Self {
        let (joints, samples) = (motion.joints(), motion.samples());
        let mut problem = Problem::new(ColumnPlan::new(model, set), 0.0);
        let mut assembler = Assembler::new(model);
        let mut torque_nm = JointSignals::zeros(joints, samples);
        let mut sd_nm = covariance.map(|_| JointSignals::zeros(joints, samples));
        let mut scratch = Vec::new();
        for start in (0..samples).step_by(PIECE) {
            let piece = start..(start + PIECE).min(samples);
            let nothing_measured = JointSignals::zeros(joints, piece.len());
            let part = motion.slice(piece.clone());
            assembler.assemble(&mut problem, model, &part, &nothing_measured);
            for j in 0..joints {
                problem.predict(j, theta, &mut torque_nm.joint_mut(j)[piece.clone()]);
                if let (Some(sd_nm), Some(covariance)) = (&mut sd_nm, covariance) {
                    let out = &mut sd_nm.joint_mut(j)[piece.clone()];
                    write_sd(&problem, j, covariance, &mut scratch, out);
                }
            }
        }
        Self { torque_nm, sd_nm }
    }
}

/// σ of the torque X θ of every row x of `problem` (joints × n), from parameters with the `covariance` Σ alone, without
/// the noise of a reading: √(x Σ xᵀ), Nm (JCGM 100:2008, 5.2.2).
pub fn prediction_sd(problem: &Problem, covariance: &DMatrix<f64>) -> JointSignals {
    let mut sd_nm = JointSignals::zeros(problem.joints(), problem.samples);
    let mut scratch = Vec::new();
    for j in 0..problem.joints() {
        write_sd(problem, j, covariance, &mut scratch, sd_nm.joint_mut(j));
    }
    sd_nm
}

/// Writes √(x Σ xᵀ) of joint `joint` into `out` (n values), column by column as X is stored.
fn write_sd(
    problem: &Problem,
    joint: usize,
    covariance: &DMatrix<f64>,
    scratch: &mut Vec<f64>,
    out: &mut [f64],
) {
    let columns = || {
        let columns = problem.panels[joint].x.chunks_exact(problem.samples);
        problem.plan.base_indices(joint).zip(columns)
    };
    out.fill(0.0);
    scratch.resize(out.len(), 0.0);
    for (a, of_a) in columns() {
        // Σ_b Σ_ab x_b of every row.
        scratch.fill(0.0);
        for (b, of_b) in columns() {
            let entry = covariance[(a, b)];
            scratch.iter_mut().zip(of_b).for_each(|(sum, x)| *sum += entry * x);
        }
        out.iter_mut().zip(&*scratch).zip(of_a).for_each(|((square, sum), x)| *square += sum * x);
    }
    // A variance of zero may come out below it by rounding.
    out.iter_mut().for_each(|square| *square = if *square < 0.0 { 0.0 } else { square.sqrt() });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::robot::Arm;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// The UR5, its base parameters with a covariance L Lᵀ, L, and a motion.
    struct Known {
        model: Model,
        set: BaseSet,
        theta: Vec<f64>,
        root: DMatrix<f64>,
        motion: Motion,
    }

    impl Known {
        fn of(samples: usize) -> Self {
            let arm = Arm::built_in("ur5").unwrap();
            let model = Model::new(&arm);
            let set = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
            let theta = set.values(&model.standard_parameters());
            let mut rng = ChaCha8Rng::seed_from_u64(7);
            let mut uniform = |bound: f64| bound * (2.0 * rng.random::<f64>() - 1.0);
            let root = DMatrix::from_fn(theta.len(), theta.len(), |_, _| uniform(0.1));
            let mut signals = |bound| JointSignals::from_fn(6, samples, |_, _| uniform(bound));
            let motion =
                Motion { q_rad: signals(3.0), qd_rad_s: signals(2.0), qdd_rad_s2: signals(8.0) };
            Self { model, set, theta, root, motion }
        }

        fn forecast(&self, motion: &Motion, covariance: Option<&DMatrix<f64>>) -> Forecast {
            Forecast::along(motion, &self.model, &self.set, &self.theta, covariance)
        }
    }

    /// Parameters drawn from their covariance give torques that scatter by σ. The scatter of 4000 draws is known to
    /// 1/√8000 of itself, of which five are allowed.
    #[test]
    fn the_torques_of_drawn_parameters_scatter_by_sigma() {
        const DRAWS: usize = 4000;
        let mut known = Known::of(5);
        let covariance = &known.root * known.root.transpose();
        let Forecast { torque_nm: mean, sd_nm } = known.forecast(&known.motion, Some(&covariance));
        let sd_nm = sd_nm.unwrap();
        let theta = known.theta.clone();
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut squares = JointSignals::zeros(6, 5);
        for _ in 0..DRAWS {
            let normal: Vec<f64> = theta.iter().map(|_| StandardNormal.sample(&mut rng)).collect();
            let shift = &known.root * nalgebra::DVector::from_vec(normal);
            known.theta = theta.iter().zip(&shift).map(|(theta, shift)| theta + shift).collect();
            let drawn = known.forecast(&known.motion, None);
            assert!(drawn.sd_nm.is_none());
            for j in 0..6 {
                let off = drawn.torque_nm.joint(j).iter().zip(mean.joint(j)).map(|(a, b)| a - b);
                squares.joint_mut(j).iter_mut().zip(off).for_each(|(sum, off)| *sum += off * off);
            }
        }
        for j in 0..6 {
            for (square, sd) in squares.joint(j).iter().zip(sd_nm.joint(j)) {
                let scatter = (square / DRAWS as f64).sqrt();
                let tolerance = 5.0 / (2.0 * DRAWS as f64).sqrt();
                assert!((scatter / sd - 1.0).abs() < tolerance, "joint {j}: {scatter} {sd}");
            }
        }
    }

    /// A motion that is laid out in pieces has the torques and σ of its pieces.
    #[test]
    fn pieces_fit_together() {
        let known = Known::of(PIECE + 10);
        let covariance = &known.root * known.root.transpose();
        let whole = known.forecast(&known.motion, Some(&covariance));
        let end = PIECE..PIECE + 10;
        let last = known.forecast(&known.motion.slice(end.clone()), Some(&covariance));
        assert_eq!(whole.torque_nm.slice(end.clone()), last.torque_nm);
        assert_eq!(whole.sd_nm.map(|sd_nm| sd_nm.slice(end)), last.sd_nm);
    }
}
