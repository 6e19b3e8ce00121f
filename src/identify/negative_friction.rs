//! Remarks on identified Coulomb friction that is negative.

use super::doubt::CERTAIN;
use crate::base::BaseSet;
use crate::dynamics::{Parameter, ParameterLayout};
use crate::robot::Arm;

/// Share of a joint's torque (rms) below which negative friction is ignored, however well it is known: the steps of
/// an integrator, and half a sample between torque and velocity, cause as much in simulated logs without noise.
const NOTHING: f64 = 0.01;

/// A remark where identified Coulomb friction, known to `sigma`, is negative, which no drive has. Values that are
/// next to nothing compared with the torque that the joints need (`torque_nm`, rms) are ignored; `None` where no
/// friction is negative. Nearly always the torque of that joint has the other sign, or is that of another joint.
pub fn negative_friction_remark(
    arm: &Arm,
    set: &BaseSet,
    theta: &[f64],
    sigma: &[f64],
    torque_nm: &[f64],
) -> Option<String> {
    let layout = ParameterLayout::new(arm.dof());
    let of_parameter = |k: usize| {
        let Parameter::Coulomb(j) = layout.parameter(set.column(k)[0].0) else { return None };
        let pushes = theta[k] < -CERTAIN * sigma[k] && -theta[k] > NOTHING * torque_nm[j];
        pushes.then(|| format!("joint {} ({:.3} Nm)", j + 1, theta[k]))
    };
    let joints: Vec<String> = (0..set.rank()).filter_map(of_parameter).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "Coulomb friction is negative, which no drive has: {}. Is the torque there logged with the other sign, late, or in \
             the column of another joint?",
            joints.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::dynamics::Model;

    #[test]
    fn friction_that_pushes_is_named() {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(6, true)).unwrap();
        let mut theta = set.values(&Model::new(&arm).standard_parameters());
        let certain = vec![1e-3; set.rank()];
        assert_eq!(negative_friction_remark(&arm, &set, &theta, &certain, &[1.0; 6]), None);
        let third = (0..set.rank()).find(|k| set.name(*k) == "rc3").unwrap();
        theta[third] *= -1.0;
        let remark = negative_friction_remark(&arm, &set, &theta, &certain, &[1.0; 6]).unwrap();
        assert!(remark.contains("joint 3 (-"), "{remark}");
        assert!(!remark.contains("joint 2"), "{remark}");
        // The same value is ignored where the joint needs a thousand times as much torque.
        let torque_nm = [1e3 * theta[third].abs(); 6];
        assert_eq!(negative_friction_remark(&arm, &set, &theta, &certain, &torque_nm), None);
        // Friction that is hardly known may be negative.
        assert_eq!(
            negative_friction_remark(&arm, &set, &theta, &vec![1e2; set.rank()], &[1.0; 6]),
            None
        );
    }
}
