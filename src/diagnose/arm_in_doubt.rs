//! Whether a log can be one of the arm that the robot file describes.

use super::diagnoser::Diagnoser;
use super::extension::Extension;
use super::verdict::{Diagnosis, Verdict};
use crate::base::BaseSet;
use crate::dynamics::{Model, Parameter};
use crate::identify::{Doubt, Identification, unlike};
use crate::robot::JointSignals;

impl Diagnoser<'_> {
    /// Adds the doubt that the log with the angles `q_rad` may be that of another robot, or that no arm has these
    /// parameters.
    pub(super) fn question_the_arm(
        &self,
        diagnosis: &mut Diagnosis,
        extension: &Extension,
        identification: &Identification,
        q_rad: &JointSignals,
    ) {
        let nominal = self.set.values(&Model::new(self.arm).standard_parameters());
        let sigma = sigma_of_friction_alone(diagnosis, self.set, self.arm.dof());
        // Contacts and friction that the null model lacks distort its estimate of gravity, so θ is that of the extended
        // model.
        let (theta, covariance) = (&extension.theta, &identification.covariance);
        let left = share_left(diagnosis, identification);
        let torque_nm = identification.residual().torque_rms_nm;
        let arm = (self.arm, self.set);
        let doubt = Doubt::of(arm, &nominal, theta, &sigma, covariance, q_rad, &torque_nm);
        diagnosis.doubt = Doubt::or_unlike(doubt, unlike(self.arm, &left));
        if diagnosis.doubt.as_ref().is_some_and(Doubt::is_contradiction) {
            diagnosis.verdict = Verdict::Contradicted;
        }
    }
}

/// Share of each joint's rms torque that is left unexplained beside the causes, with the known noise subtracted. It is
/// no more than the model leaves without them: coarse angles, differentiated at all harmonics, may roughen what is left
/// in the same way in every period.
fn share_left(diagnosis: &Diagnosis, identification: &Identification) -> Vec<f64> {
    let residual = identification.residual();
    let (torque_nm, percent) = (residual.torque_rms_nm, residual.relative_percent);
    let share = |j: usize| {
        let noise_nm = diagnosis.noise_of_mean_nm.as_ref().map_or(0.0, |nm| nm[j]);
        let left_nm = (diagnosis.after.rms_nm[j].powi(2) - noise_nm.powi(2)).max(0.0).sqrt();
        (left_nm / torque_nm[j]).min(0.01 * percent[j])
    };
    (0..torque_nm.len()).map(share).collect()
}

/// σ of the base parameters beside the causes. It is ∞ for the Coulomb friction of a joint that also has another
/// friction law: that parameter may be negative although the friction as a whole is not.
fn sigma_of_friction_alone(diagnosis: &Diagnosis, set: &BaseSet, joints: usize) -> Vec<f64> {
    let mut sigma: Vec<f64> = diagnosis.base_parameters.iter().map(|p| p.sigma).collect();
    for law in diagnosis.causes.iter().filter(|cause| cause.kind.is_friction()) {
        let joints = law.joint.map_or(0..joints, |joint| joint - 1..joint);
        for k in joints.filter_map(|j| set.index_of(Parameter::Coulomb(j))) {
            sigma[k] = f64::INFINITY;
        }
    }
    sigma
}
