//! Friction that changes while the arm warms up: τ = f F (1 − e^{−t/T}), with F = F_c sign q̇ + F_v q̇ and what other
//! laws add to the friction of the joint. t counts from the start of the record, not of the part that is used: a motion
//! that changes with its friction becomes periodic only later. The effect itself does not repeat, so that the
//! differences between periods show it.

use super::*;

/// See the module.
pub struct ThermalDrift;

/// Time constants within this factor of the fastest are not distinguished from it.
const TOLD: f64 = 1.02;

/// The fastest time constant, s.
fn fastest_s(scene: &Scene) -> f64 {
    scene.duration_s() / if scene.periodic { 20.0 } else { 8.0 }
}

/// 1 − e^{−t/T} at all rows.
fn warmth(scene: &Scene, shape: Shape) -> impl Iterator<Item = f64> {
    (0..scene.samples() * scene.periods).map(move |k| {
        let time_s = scene.lead_in_s + k as f64 / scene.rate_hz;
        1.0 - (-time_s / shape.value).exp()
    })
}

impl Candidate for ThermalDrift {
    fn kind(&self) -> Kind {
        Kind::ThermalDrift
    }

    fn shapes(&self, scene: &Scene, _: Option<usize>) -> Vec<Shape> {
        // A drift much slower than the record is a straight line in time.
        let slowest = 5.0 * scene.duration_s();
        geometric(fastest_s(scene), slowest, 5).map(|value| Shape { variant: 0, value }).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let drive = &scene.arm.joints[j].drive;
        let qd = scene.motion.qd_rad_s.joint(j);
        // The friction that a drive feeds forward does not warm up with the actual friction.
        let sign = scene.as_logged(scene.turned(j).sign.clone());
        let other = scene.other_friction(j);
        let n = scene.samples();
        let friction = warmth(scene, shape).enumerate().map(|(k, warm)| {
            let own = drive.coulomb_nm * sign[k % n] + drive.viscous_nm_s_rad * qd[k % n];
            warm * (own + other.at(k % n))
        });
        vec![Column::on(j, friction.collect())]
    }

    fn warm(&self, scene: &Scene, shape: Shape, b: &[f64]) -> Option<f64> {
        let rows = (scene.samples() * scene.periods) as f64;
        Some(1.0 + b[0] * warmth(scene, shape).sum::<f64>() / rows)
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("fraction", b[0], ""), quantity("time_constant_s", shape.value, "s")]
    }

    /// Friction does not drive a joint, and does not grow fourfold.
    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        (-1.0..3.0).contains(&b[0])
    }

    /// In a single run, an effect that ends early may be anything that happened once.
    fn is_its_own(&self, scene: &Scene, _: Option<usize>, shape: Shape, _: &[f64]) -> bool {
        scene.periodic || shape.value > TOLD * fastest_s(scene)
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion again after half an hour of work, joint temperatures recorded"
    }

    fn in_words(&self) -> &'static str {
        "friction that changes while the arm warms up"
    }
}
