//! The mass matrix implied by identified base parameters.

use nalgebra::{DMatrix, DVector};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use crate::base::BaseSet;
use crate::dynamics::{Model, ParameterLayout, Workspace, regressor};

/// Number of random poses that are examined; they are the same every time.
const POSES: usize = 400;

/// Share of random poses (|q_j| ≤ π) in which the mass matrix M(q) of the base parameters `theta` is not positive
/// definite, and the smallest eigenvalue over all poses, kg m².
///
/// M(q) depends on the base parameters alone: its column i is Θ_B(q, 0, e_i) θ − Θ_B(q, 0, 0) θ.
pub fn indefinite_share(model: &Model, set: &BaseSet, theta: &[f64]) -> (f64, f64) {
    let n = model.dof();
    let mut standard = DVector::zeros(ParameterLayout::new(n).count());
    for (k, value) in theta.iter().enumerate() {
        for &(index, coefficient) in set.column(k) {
            standard[index] += coefficient * value;
        }
    }
    let mut workspace = Workspace::new(model);
    let mut rng = ChaCha8Rng::seed_from_u64(0x00ba_5e5e);
    let rest = vec![0.0; n];
    let (mut indefinite, mut smallest) = (0_usize, f64::INFINITY);
    for _ in 0..POSES {
        let q: Vec<f64> =
            (0..n).map(|_| std::f64::consts::PI * (2.0 * rng.random::<f64>() - 1.0)).collect();
        let mut torque = |qdd: &[f64]| regressor(model, &mut workspace, &q, &rest, qdd) * &standard;
        let gravity = torque(&rest);
        let mut matrix = DMatrix::zeros(n, n);
        for i in 0..n {
            let mut unit = rest.clone();
            unit[i] = 1.0;
            matrix.set_column(i, &(torque(&unit) - &gravity));
        }
        let least = matrix.symmetric_eigenvalues().min();
        indefinite += usize::from(least <= 0.0);
        smallest = smallest.min(least);
    }
    (indefinite as f64 / POSES as f64, smallest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::robot::Arm;

    #[test]
    fn the_true_parameters_give_a_mass_matrix_and_a_negative_rotor_does_not() {
        let arm = Arm::load("ur5").unwrap();
        let model = Model::new(&arm);
        let set = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        let mut theta = set.values(&model.standard_parameters());
        let (share, least) = indefinite_share(&model, &set, &theta);
        assert!(share == 0.0 && least > 0.0, "{share} {least}");
        let wrist = (0..set.rank()).find(|&k| set.name(k) == "Ia6").unwrap();
        theta[wrist] = -0.1;
        let (share, least) = indefinite_share(&model, &set, &theta);
        // The last link's own inertia, 1e-4 kg m², cannot compensate the negative rotor inertia in any pose.
        assert!(share == 1.0 && least < -0.05, "{share} {least}");
    }
}
