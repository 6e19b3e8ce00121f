//! Whether friction came out as something that pushes.

use super::covariance::Covariance;
use crate::base::BaseSet;
use crate::dynamics::{Parameter, ParameterLayout};
use crate::robot::Arm;

/// σ below none from which on noise is no excuse: of all joints of a hundred thousand arms it makes one so.
const CERTAIN: f64 = 5.0;

/// A remark where the Coulomb friction that was identified is negative, which no drive has; `None` where none is. Nearly always
/// the torque of that joint has the other sign, or is that of another one.
pub fn negative_friction_remark(
    arm: &Arm,
    set: &BaseSet,
    theta: &[f64],
    covariance: &Covariance,
) -> Option<String> {
    let layout = ParameterLayout::new(arm.dof());
    let sigma = covariance.sigma();
    let of_parameter = |k: usize| {
        let (Parameter::Coulomb(j), true) =
            (layout.parameter(set.column(k)[0].0), theta[k] < -CERTAIN * sigma[k])
        else {
            return None;
        };
        Some(format!("joint {} ({:.3} Nm)", j + 1, theta[k]))
    };
    let joints: Vec<String> = (0..set.rank()).filter_map(of_parameter).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "Coulomb friction is negative, which no drive has: {}. Is the torque there logged with the other sign, or in the \
             column of another joint?",
            joints.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::dynamics::Model;
    use crate::identify::covariance::CovarianceKind;
    use nalgebra::DMatrix;

    #[test]
    fn friction_that_pushes_is_named() {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(6, true)).unwrap();
        let mut theta = set.values(&Model::new(&arm).standard_parameters());
        let of_variance = |variance: f64| Covariance {
            kind: CovarianceKind::Spectral,
            matrix: DMatrix::identity(set.rank(), set.rank()) * variance,
            degrees_of_freedom: f64::INFINITY,
        };
        let certain = of_variance(1e-6);
        assert_eq!(negative_friction_remark(&arm, &set, &theta, &certain), None);
        let third = (0..set.rank()).find(|k| set.name(*k) == "rc3").unwrap();
        theta[third] *= -1.0;
        let remark = negative_friction_remark(&arm, &set, &theta, &certain).unwrap();
        assert!(remark.contains("joint 3 (-"), "{remark}");
        assert!(!remark.contains("joint 2"), "{remark}");
        // Friction that is hardly known may be negative.
        assert_eq!(negative_friction_remark(&arm, &set, &theta, &of_variance(1e4)), None);
    }
}
