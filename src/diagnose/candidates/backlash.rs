//! Play in the gear: the link lags half the gap behind in the direction of the load,
//! δ = (gap/2) tanh(τ_L/τ₀).

use super::elasticity::give_way;
use super::*;

/// See the module.
pub struct Backlash;

/// Gap at which the torque change is taken, rad: small, so that it is linear.
const SMALL_RAD: f64 = 1e-6;
/// Load within which the play is crossed, as a share of the joint's rms load.
const CROSSING: f64 = 0.1;

impl Candidate for Backlash {
    fn kind(&self) -> Kind {
        Kind::Backlash
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        let j = joint(site);
        let load = scene.link_nm.joint(j);
        let rms = (load.iter().map(|l| l * l).sum::<f64>() / load.len() as f64).sqrt();
        let crossing = CROSSING * rms.max(f64::MIN_POSITIVE);
        let delta: Vec<f64> =
            load.iter().map(|l| 0.5 * SMALL_RAD * (l / crossing).tanh()).collect();
        vec![give_way(scene, j, &delta, SMALL_RAD)]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("gap_rad", b[0], "rad")]
    }

    fn separating_experiment(&self) -> &'static str {
        "hold the motor and push the link both ways: play gives no torque, a spring does"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    fn in_words(&self) -> &'static str {
        "play in the gear"
    }
}
