//! Moments of a joint's friction columns under velocity noise, by quadrature.

use nalgebra::DMatrix;

use crate::base::BaseSet;
use crate::dynamics::Parameter;

/// Moments of a joint's friction columns q̇ + v and tanh((q̇ + v)/ε) under velocity noise v.
pub(super) struct NoisyFriction {
    /// Base index of the viscous friction rv.
    viscous: Option<usize>,
    /// Base index of the Coulomb friction rc.
    pub(super) coulomb: Option<usize>,
    /// E tanh((q̇ + v)/ε) at every sample.
    pub(super) mean_sign: Vec<f64>,
    /// Mean slope of the friction torque over the velocity at every sample, rv + rc E[1 − tanh²]/ε.
    pub(super) slope_nm_s_rad: Vec<f64>,
    /// Sums over the period of var(q̇ + v), cov(q̇ + v, tanh((q̇ + v)/ε)) and var(tanh((q̇ + v)/ε)).
    covariance: [f64; 3],
}

impl NoisyFriction {
    /// Computes the moments for joint `joint` (from 0) with the base parameters `theta` of `set`, along `qd_rad_s`.
    pub(super) fn new(
        set: &BaseSet,
        theta: &[f64],
        joint: usize,
        qd_rad_s: &[f64],
        epsilon_rad_s: f64,
        velocity_sd_rad_s: f64,
    ) -> Self {
        let viscous = set.index_of(Parameter::Viscous(joint));
        let coulomb = set.index_of(Parameter::Coulomb(joint));
        let value = |k: Option<usize>| k.map_or(0.0, |k| theta[k]);
        let (rv, rc) = (value(viscous), value(coulomb));
        let mut out = Self {
            viscous,
            coulomb,
            mean_sign: Vec::with_capacity(qd_rad_s.len()),
            slope_nm_s_rad: Vec::with_capacity(qd_rad_s.len()),
            covariance: [0.0; 3],
        };
        for qd in qd_rad_s {
            let [mut mean, mut square, mut cross, mut steep] = [0.0; 4];
            for (node, weight) in normal_nodes() {
                let v = velocity_sd_rad_s * node;
                let sign = ((qd + v) / epsilon_rad_s).tanh();
                mean += weight * sign;
                square += weight * sign * sign;
                cross += weight * v * sign;
                steep += weight * (1.0 - sign * sign);
            }
            out.mean_sign.push(mean);
            out.slope_nm_s_rad.push(rv + rc * steep / epsilon_rad_s);
            let [vv, vs, ss] = &mut out.covariance;
            *vv += velocity_sd_rad_s.powi(2);
            *vs += cross;
            *ss += square - mean * mean;
        }
        out
    }

    /// Adds `scale` times the columns' covariance to the `information` of all parameters.
    pub(super) fn add_covariance(&self, information: &mut DMatrix<f64>, scale: f64) {
        let (Some(v), Some(s)) = (self.viscous, self.coulomb) else { return };
        let [vv, vs, ss] = self.covariance.map(|c| c * scale);
        information[(v, v)] += vv;
        information[(v, s)] += vs;
        information[(s, v)] += vs;
        information[(s, s)] += ss;
    }
}

/// Nodes and weights of a quadrature over the standard normal distribution.
fn normal_nodes() -> impl Iterator<Item = (f64, f64)> {
    const STEP: f64 = 0.25;
    let density = |x: f64| STEP * (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
    // The trapezoidal rule converges faster than any power of the step. The tails beyond ±6 hold about 1e-9.
    (-24..=24).map(move |k| (STEP * f64::from(k), density(STEP * f64::from(k))))
}
