//! Remarks on identified inertias that are negative.
//!
//! The torque of a joint per acceleration of that joint alone, M_jj(q), is positive for every arm, whatever its bodies
//! and its pose q. It is linear in the base parameters, as is each rotor inertia that is a base parameter by itself.

use nalgebra::{DMatrix, DVector};

use super::covariance::{Covariance, correlations};
use super::doubt::CERTAIN;
use super::quality::tells_the_arm;
use crate::base::BaseSet;
use crate::dynamics::{Model, Parameter, Workspace, regressor};
use crate::number::{significant, with_sigma};
use crate::robot::{Arm, JointSignals};

/// Poses of the log, at equal distances, in which M_jj is tested. Elsewhere a model that is a little wrong may be far
/// off. Of an arm without any inertia, noise alone makes one of 64 values for each of six joints, or one of the
/// rotors', negative by [`CERTAIN`] σ in fewer than one in 8000 logs (390 tests at 3e-7), and far more rarely with the
/// inertia that arms have.
const POSES: usize = 64;
/// Share of the inertia that a joint has by the description, in the pose where that is least, below which a negative
/// one is ignored, however well it is known. A torque that comes half a sample late changes the inertia of a joint by
/// half a sample times its viscous friction and about its Coulomb friction per speed: 7 % of that of a UR5's wrist.
const NOTHING: f64 = 0.1;

/// An inertia along a joint that the base parameters state.
struct Inertia {
    /// Its value, kg m².
    value: f64,
    /// σ of the value, kg m².
    sigma: f64,
}

impl Inertia {
    /// The sum of the base parameters `theta` with the `weights`. Each parameter is known to its `sigma`; together they
    /// vary as `correlations` say.
    fn of(
        weights: &DVector<f64>,
        theta: &DVector<f64>,
        sigma: &[f64],
        correlations: &DMatrix<f64>,
    ) -> Self {
        // What has no weight may have any σ, even ∞. A σ that is not known makes that of the sum NaN, and nothing
        // certain.
        let scaled = DVector::from_fn(weights.len(), |k, _| {
            if weights[k] == 0.0 { 0.0 } else { weights[k] * sigma[k] }
        });
        let variance = scaled.dot(&(correlations * &scaled));
        Self { value: weights.dot(theta), sigma: variance.sqrt() }
    }

    /// Whether it is certainly below zero by more than `least`.
    fn is_below(&self, least: f64) -> bool {
        self.value < -CERTAIN * self.sigma && -self.value > least
    }

    fn in_words(&self) -> String {
        format!("{} kg m2", with_sigma(self.value, self.sigma))
    }
}

/// A remark where inertia by the base parameters `theta` is negative, which no arm has: about a joint in one of many
/// poses of the log, whose angles are `q_rad`, or that of a rotor. Every parameter is known to its `sigma`, and they
/// vary together as in `covariance`; by the description of the `arm` they are `nominal`. `None` where no inertia is
/// negative, and where the log does not identify the arm.
pub fn negative_inertia_remark(
    (arm, set): (&Arm, &BaseSet),
    nominal: &[f64],
    theta: &[f64],
    sigma: &[f64],
    covariance: &Covariance,
    q_rad: &JointSignals,
) -> Option<String> {
    if !tells_the_arm(arm, set, covariance) {
        return None;
    }
    let poses = inertias_in_poses(&Model::new(arm), set, q_rad);
    let correlations = correlations(&covariance.matrix);
    let [nominal, theta] = [nominal, theta].map(DVector::from_column_slice);
    let of = |weights: &DVector<f64>| Inertia::of(weights, &theta, sigma, &correlations);
    let of_joint = |j: usize| -> Option<String> {
        let described = poses.iter().map(|weights| weights[j].dot(&nominal));
        let described = described.fold(f64::INFINITY, f64::min);
        let least = NOTHING * described.max(0.0);
        let negative = poses.iter().map(|weights| of(&weights[j])).filter(|m| m.is_below(least));
        if let Some(worst) = negative.min_by(|a, b| a.value.total_cmp(&b.value)) {
            return Some(format!(
                "joint {} in a pose of the log ({}; by the description never below {})",
                j + 1,
                worst.in_words(),
                significant(described, 3)
            ));
        }
        let alone = |k: &usize| set.combinations[*k].len() == 1;
        let k = set.index_of(Parameter::RotorInertia(j)).filter(alone)?;
        let rotor = of(&DVector::from_fn(set.rank(), |row, _| f64::from(row == k)));
        let is_negative = rotor.is_below(least);
        is_negative.then(|| format!("the rotor of joint {} ({})", j + 1, rotor.in_words()))
    };
    let joints: Vec<String> = (0..arm.dof()).filter_map(of_joint).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "Inertia is negative, which no arm has: {}. Is the torque there logged late, in another unit than that of the other \
             joints, or in the column of another joint?",
            joints.join(", ")
        )
    })
}

/// For [`POSES`] of the poses `q_rad` and for each joint j, the weights of the base parameters in M_jj.
fn inertias_in_poses(model: &Model, set: &BaseSet, q_rad: &JointSignals) -> Vec<Vec<DVector<f64>>> {
    let n = model.dof();
    let mut ws = Workspace::new(model);
    let still = vec![0.0; n];
    let mut q = vec![0.0; n];
    let of_pose = |sample: usize| -> Vec<DVector<f64>> {
        q_rad.sample_into(sample, &mut q);
        // Gravity is the same with and without acceleration; at rest there is nothing else.
        let gravity = regressor(model, &mut ws, &q, &still, &still);
        let of_joint = |j: usize| {
            let mut only = still.clone();
            only[j] = 1.0;
            let moved = regressor(model, &mut ws, &q, &still, &only);
            let term = |&(c, factor): &(usize, f64)| factor * (moved[(j, c)] - gravity[(j, c)]);
            DVector::from_fn(set.rank(), |k, _| set.column(k).iter().map(term).sum::<f64>())
        };
        (0..n).map(of_joint).collect()
    };
    let every = q_rad.samples().div_ceil(POSES).max(1);
    (0..q_rad.samples()).step_by(every).map(of_pose).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::dynamics::mass_matrix;
    use crate::identify::covariance::CovarianceKind;

    /// 320 poses all over the range of six joints.
    fn angles() -> JointSignals {
        JointSignals::from_fn(6, 320, |j, k| 3.0 * ((0.3 + 0.1 * j as f64) * k as f64).sin())
    }

    /// The weights are those of the diagonal of the mass matrix, with torque offsets and without.
    #[test]
    fn weights_state_the_diagonal_of_the_mass_matrix() {
        let arm = Arm::built_in("ur5").unwrap();
        let model = Model::new(&arm);
        let standard = model.standard_parameters();
        let (mut ws, mut m, mut q) = (Workspace::new(&model), DMatrix::zeros(6, 6), vec![0.0; 6]);
        for offsets in [true, false] {
            let set = BaseSet::find(&arm, Parameterisation::full(6, offsets)).unwrap();
            let values = DVector::from_vec(set.values(&standard));
            let poses = inertias_in_poses(&model, &set, &angles());
            assert_eq!((poses.len(), poses[0].len()), (POSES, 6));
            for (weights, sample) in poses.iter().zip((0..320).step_by(5)) {
                angles().sample_into(sample, &mut q);
                mass_matrix(&model, &mut ws, &q, &mut m);
                for (j, weights) in weights.iter().enumerate() {
                    // The combinations of parameters, which are below 10, are known to better than 1e-10.
                    let off = weights.dot(&values) - m[(j, j)];
                    assert!(off.abs() < 1e-9, "joint {}: {off}", j + 1);
                }
            }
        }
    }

    #[test]
    fn inertia_that_no_arm_has_is_named() {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(6, true)).unwrap();
        let nominal = set.values(&Model::new(&arm).standard_parameters());
        let remark = |rotor: f64, sigma: f64| {
            let mut theta = nominal.clone();
            theta[set.index_of(Parameter::RotorInertia(2)).unwrap()] = rotor;
            let covariance = Covariance {
                kind: CovarianceKind::Spectral,
                matrix: DMatrix::identity(set.rank(), set.rank()) * sigma.powi(2),
                degrees_of_freedom: f64::INFINITY,
            };
            let sigma = covariance.sigma();
            let arm = (&arm, &set);
            negative_inertia_remark(arm, &nominal, &theta, &sigma, &covariance, &angles())
        };
        // By the description 1.6 kg m² of 2.07 or more that joint 3 has.
        assert_eq!(remark(1.6, 1e-3), None);
        let of_rotor = remark(-0.3, 1e-3).unwrap();
        assert!(
            of_rotor.contains(": the rotor of joint 3 (-0.3000 ± 0.0010 kg m2). "),
            "{of_rotor}"
        );
        let of_joint = remark(-1.0, 1e-3).unwrap();
        assert!(of_joint.contains(": joint 3 in a pose of the log (-0.5"), "{of_joint}");
        assert!(of_joint.contains("never below 2.07). "), "{of_joint}");
        // Less than a tenth of that inertia, and what is hardly known, may be negative.
        assert_eq!(remark(-0.15, 1e-3), None);
        assert_eq!(remark(-0.3, 0.1), None);
    }

    /// The σ of a parameter that is ∞, because it means nothing by itself, leaves the inertias as they are.
    #[test]
    fn a_parameter_without_weight_may_be_unknown() {
        let weights = DVector::from_vec(vec![2.0, 0.0]);
        let theta = DVector::from_vec(vec![-3.0, 7.0]);
        let inertia =
            Inertia::of(&weights, &theta, &[0.5, f64::INFINITY], &DMatrix::identity(2, 2));
        assert_eq!((inertia.value, inertia.sigma), (-6.0, 1.0));
        assert!(inertia.is_below(0.0) && !inertia.is_below(6.5));
    }
}
