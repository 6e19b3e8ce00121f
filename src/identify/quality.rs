//! How well a log determines the parameters: condition numbers, and the parameters it leaves undetermined.

use nalgebra::DMatrix;
use serde::Serialize;

use super::covariance::Covariance;
use super::fit::{FitError, Fitter, Weighting};
use super::problem::Problem;
use super::triangle::Triangle;
use crate::base::BaseSet;
use crate::dynamics::{Parameter, ParameterLayout};
use crate::robot::Arm;

/// Condition numbers of the base regressor along a motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Condition {
    /// cond(Θ_B), unweighted, parameters in SI units.
    pub regressor: f64,
    /// cond(Θ_BᵀΘ_B), the paper's (22): the square of the above.
    pub information: f64,
    /// cond(Θ_B) with every column scaled to unit length: free of units.
    pub scaled: f64,
}

impl Condition {
    /// Computes the condition numbers of the regressor in `problem`.
    pub fn of(problem: &Problem, set: &BaseSet) -> Result<Self, FitError> {
        let triangle = Fitter::new(problem).fit(problem, set, Weighting::Equal)?.triangle;
        let regressor = condition_number(&triangle, |_| 1.0);
        Ok(Self {
            regressor,
            information: regressor * regressor,
            scaled: condition_number(&triangle, |k| 1.0 / triangle.column_length(k)),
        })
    }
}

fn condition_number(triangle: &Triangle, scale: impl Fn(usize) -> f64) -> f64 {
    let b = triangle.columns();
    let r = DMatrix::from_fn(b, b, |i, k| triangle.r(i, k) * scale(k));
    let singular = r.singular_values();
    singular.max() / singular.min()
}

/// The largest plausible magnitude of a base parameter on this arm: a wider interval carries no information.
///
/// M is the mass and ℓ the reach of everything from the parameter's body outward. The magnitude is M for masses, M ℓ
/// for first moments, and M ℓ² for moments of inertia. It is the drive's torque limit for Coulomb friction and
/// offsets, that limit over the speed limit for viscous friction, and over the acceleration limit for rotor inertias.
/// Where the torque limit is not known, the torque that holds and accelerates the whole outstretched arm takes its
/// place.
pub fn plausible_size(arm: &Arm, set: &BaseSet, k: usize) -> f64 {
    let layout = ParameterLayout::new(arm.dof());
    let (standard, _) = set.column(k)[0];
    let outward = |body: usize| {
        let mass: f64 = arm.joints[body..].iter().map(|j| j.link.mass_kg()).sum();
        let later = arm.joints[body + 1..].iter().map(|j| j.placement.translation_m.norm());
        // The last link has no next joint to show its length; its centre of mass takes that place.
        let last = arm.joints.last().and_then(|j| j.link.com_m()).map_or(0.0, |c| c.norm());
        (mass, later.sum::<f64>() + last + HAND_M)
    };
    let torque_nm = |j: usize| {
        let limits = &arm.joints[j].limits;
        let (mass_kg, reach_m) = outward(0);
        let holding = arm.gravity_m_s2.norm() + limits.acceleration_rad_s2 * reach_m;
        if limits.torque_nm.is_finite() { limits.torque_nm } else { mass_kg * reach_m * holding }
    };
    match layout.parameter(standard) {
        Parameter::Body(body, 0) => outward(body).0,
        Parameter::Body(body, 1..=3) => outward(body).0 * outward(body).1,
        Parameter::Body(body, _) => outward(body).0 * outward(body).1.powi(2),
        Parameter::RotorInertia(j) => torque_nm(j) / arm.joints[j].limits.acceleration_rad_s2,
        Parameter::Viscous(j) => torque_nm(j) / arm.joints[j].limits.velocity_rad_s,
        Parameter::Coulomb(j) | Parameter::Offset(j) => torque_nm(j),
    }
}

/// Length added to every reach, m: even a wrist is not a point.
const HAND_M: f64 = 0.05;

/// Whether a log that leaves the parameters `open` still identifies the arm. Moments of inertia of a light wrist may
/// stay open, because hardly any torque depends on them. Gravity, friction and rotors may not, nor may more than a
/// quarter of all parameters.
pub fn identifies_the_arm(arm: &Arm, set: &BaseSet, open: &[usize]) -> bool {
    let layout = ParameterLayout::new(arm.dof());
    let is_moment_of_inertia =
        |&k: &usize| matches!(layout.parameter(set.column(k)[0].0), Parameter::Body(_, 4..));
    open.iter().all(is_moment_of_inertia) && 4 * open.len() <= set.rank()
}

/// Whether a log that tells the base parameters with this `covariance` identifies the arm.
pub(super) fn tells_the_arm(arm: &Arm, set: &BaseSet, covariance: &Covariance) -> bool {
    let quantile = covariance.quantile_95();
    let half_width: Vec<f64> = covariance.sigma().iter().map(|s| quantile * s).collect();
    identifies_the_arm(arm, set, &not_identified(arm, set, &half_width))
}

/// Base parameters whose 95 % interval (half-width `half_width[k]`) is wider than
/// [`plausible_size`]: the log does not identify them.
pub fn not_identified(arm: &Arm, set: &BaseSet, half_width: &[f64]) -> Vec<usize> {
    let open = |&k: &usize| half_width[k].is_nan() || half_width[k] > plausible_size(arm, set, k);
    (0..set.rank()).filter(open).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;

    /// Even with a URDF without torque limits an interval can be wider than the plausible size.
    #[test]
    fn what_has_no_torque_limit_can_still_be_open() {
        let mut arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), true)).unwrap();
        let limited: Vec<f64> = (0..set.rank()).map(|k| plausible_size(&arm, &set, k)).collect();
        arm.joints.iter_mut().for_each(|joint| joint.limits.torque_nm = f64::INFINITY);
        for (k, limited) in limited.iter().enumerate() {
            let unlimited = plausible_size(&arm, &set, k);
            assert!(unlimited.is_finite() && unlimited >= *limited, "{}", set.name(k));
        }
        let hopeless = vec![1e9; set.rank()];
        assert_eq!(not_identified(&arm, &set, &hopeless).len(), set.rank());
    }
}
