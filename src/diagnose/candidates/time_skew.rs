//! Torque recorded later than the motion by a delay d: τ(t − d) − τ(t), of one joint or of all.

use super::*;

/// See the module.
pub struct TimeSkew;

impl Candidate for TimeSkew {
    fn kind(&self) -> Kind {
        Kind::TimeSkew
    }

    fn sites(&self, joints: usize) -> Vec<Option<usize>> {
        arm_and_joints(joints)
    }

    fn prior_odds(&self, site: Option<usize>) -> f64 {
        // Joints are recorded together: one of them alone is rarely late.
        if site.is_some() { 0.1 } else { 1.0 }
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        // A row is recorded at one time. Where joints repeat nothing, one joint's torque that seems late
        // is friction that builds up behind its reversals.
        if site.is_some() && !scene.periodic {
            return Vec::new();
        }
        let sample_s = 1.0 / scene.rate_hz;
        [-3.0, -1.0, -0.2, 0.2, 1.0, 3.0]
            .map(|d| Shape { variant: 0, value: d * sample_s })
            .to_vec()
    }

    fn search(&self) -> Search {
        Search::Straight
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let change = |j: usize| {
            let change = scene.change_by_delay_nm(j, shape.value);
            change.into_iter().map(|change| change / shape.value).collect()
        };
        vec![Column { parts: joints_at(scene, site).map(|j| (j, change(j))).collect() }]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("delay_s", b[0], "s")]
    }

    fn separating_experiment(&self) -> &'static str {
        "a sharp tap on the standing arm: both channels must show it in the same sample"
    }

    fn in_words(&self) -> &'static str {
        "torque that is recorded later than the motion"
    }
}
