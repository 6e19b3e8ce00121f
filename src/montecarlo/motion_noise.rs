//! Noise that the encoders contribute to the equations of motion.

use nalgebra::DMatrix;

use crate::dynamics::{Model, Workspace, mass_matrix};
use crate::plant::{PlantError, SensorConfig, Whitening};
use crate::robot::JointSignals;

/// The mass matrix is evaluated at every 25th sample of the motion.
const EVERY: usize = 25;

/// Noise of the inertial torque M q̈ in equations whose torque noise has been whitened to variance one.
///
/// Positions with noise of variance σ_q² per sample and velocities with σ_q̇² together determine the acceleration of
/// a joint at the frequency ω with the variance
///
/// s(ω) = 1/(1/(ω⁴ σ_q²) + 1/(ω² σ_q̇²)),
///
/// independently for each joint. Let A be the whitening of the torque across the joints and γ(ω) the relative power
/// of its spectrum. Then the noise of the whitened equations has the covariance 1 + Σ_l s_l(ω)/γ(ω) ⟨a_l a_lᵀ⟩, with
/// a_l = A M e_l and ⟨ ⟩ the mean over the motion.
pub(super) struct MotionNoise {
    q_sd_rad: Vec<f64>,
    qd_sd_rad_s: Vec<f64>,
    /// ⟨a_l a_lᵀ⟩ of every joint l.
    products: Vec<DMatrix<f64>>,
}

impl MotionNoise {
    /// Averages over the configurations `q_rad`.
    ///
    /// # Errors
    /// [`PlantError`] if the sensor settings do not fit the number of joints of the arm.
    pub fn new(
        sensors: &SensorConfig,
        model: &Model,
        q_rad: &JointSignals,
        whitening: &Whitening,
    ) -> Result<Self, PlantError> {
        let n = model.dof();
        let across = DMatrix::from_fn(n, n, |i, k| whitening.across(i)[k]);
        let mut products = vec![DMatrix::zeros(n, n); n];
        let (mut mass, mut workspace) = (DMatrix::zeros(n, n), Workspace::new(model));
        let looked_at = (0..q_rad.samples()).step_by(EVERY);
        let weight = 1.0 / looked_at.len() as f64;
        for k in looked_at {
            let q: Vec<f64> = (0..n).map(|j| q_rad.joint(j)[k]).collect();
            mass_matrix(model, &mut workspace, &q, &mut mass);
            let whitened = &across * &mass;
            for (product, a) in products.iter_mut().zip(whitened.column_iter()) {
                product.ger(weight, &a, &a, 1.0);
            }
        }
        let q_sd_rad = sensors.q_sd_per_joint_rad(n)?;
        let qd_sd_rad_s = sensors.qd_sd_per_joint_rad_s(n)?;
        Ok(Self { q_sd_rad, qd_sd_rad_s, products })
    }

    /// L⁻¹, where L Lᵀ is the covariance at `frequency_hz`. `torque_power` is γ, the relative power of the torque noise
    /// there.
    pub fn whitening(&self, frequency_hz: f64, torque_power: f64) -> DMatrix<f64> {
        let n = self.products.len();
        let omega = std::f64::consts::TAU * frequency_hz;
        let mut covariance = DMatrix::identity(n, n);
        for (l, product) in self.products.iter().enumerate() {
            let by_position = (omega * omega * self.q_sd_rad[l]).powi(2);
            let by_velocity = (omega * self.qd_sd_rad_s[l]).powi(2);
            let power = by_position * by_velocity / (by_position + by_velocity);
            // Readings without noise determine the acceleration exactly, and so does its mean (ω = 0) in any case.
            if power > 0.0 {
                covariance += product * (power / torque_power);
            }
        }
        let mut inverse = DMatrix::identity(n, n);
        let factor = covariance.cholesky().expect("one plus squares is positive definite");
        factor.l().solve_lower_triangular_mut(&mut inverse);
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::PerJoint;
    use crate::robot::Arm;
    use nalgebra::DVector;

    const RATE_HZ: f64 = 125.0;

    fn noise(sensors: &SensorConfig) -> (MotionNoise, DVector<f64>) {
        let model = Model::new(&Arm::built_in("ur5").unwrap());
        let sd = vec![1.0; 6];
        let whitening = Whitening::new(&sensors.torque_noise, &sd, RATE_HZ).unwrap();
        let q = JointSignals::from_fn(6, 1, |j, _| 0.3 * j as f64 - 0.7);
        let noise = MotionNoise::new(sensors, &model, &q, &whitening).unwrap();
        let mut mass = DMatrix::zeros(6, 6);
        let at: Vec<f64> = (0..6).map(|j| q.joint(j)[0]).collect();
        mass_matrix(&model, &mut Workspace::new(&model), &at, &mut mass);
        (noise, mass.column(1).into_owned())
    }

    /// One encoder alone is noisy, and the torque noise is white with 1 Nm. By hand, the covariance is 1 + s m mᵀ, with
    /// m the second column of the mass matrix; its inverse is 1 − s m mᵀ/(1 + s m²).
    #[test]
    fn one_noisy_encoder() {
        let mut each = vec![0.0; 6];
        each[1] = 2e-5;
        let q_sd_rad = PerJoint::Each(each.clone());
        each[1] = 1e-3;
        let sensors =
            SensorConfig { q_sd_rad, qd_sd_rad_s: PerJoint::Each(each), ..SensorConfig::default() };
        let (noise, m) = noise(&sensors);
        let omega: f64 = 40.0 * std::f64::consts::PI;
        let s = 1.0 / (1.0 / (omega.powi(2) * 2e-5).powi(2) + 1.0 / (omega * 1e-3).powi(2));
        let w = noise.whitening(20.0, 1.0);
        let wanted =
            DMatrix::identity(6, 6) - &m * m.transpose() * (s / (1.0 + s * m.norm_squared()));
        assert!((w.transpose() * w - wanted).amax() < 1e-12);
    }

    /// At frequency zero, and if the encoders have no noise, the noise of the torque readings is the only noise.
    #[test]
    fn what_has_no_noise_adds_none() {
        let (quiet, _) = noise(&SensorConfig::default());
        assert_eq!(quiet.whitening(20.0, 0.1), DMatrix::identity(6, 6));
        let sensors = SensorConfig {
            q_sd_rad: PerJoint::All(2e-5),
            qd_sd_rad_s: PerJoint::All(1e-3),
            ..SensorConfig::default()
        };
        assert_eq!(noise(&sensors).0.whitening(0.0, 1.0), DMatrix::identity(6, 6));
    }
}
