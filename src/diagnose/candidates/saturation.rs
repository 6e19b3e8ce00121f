//! A drive at its limit: torque beyond ±c is cut off.

use super::*;

/// See the module.
pub struct Saturation;

impl Candidate for Saturation {
    fn kind(&self) -> Kind {
        Kind::Saturation
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        let peak = scene.torque_nm.joint(joint(site)).iter().fold(0.0, |m: f64, t| m.max(t.abs()));
        [0.6, 0.7, 0.8, 0.9, 0.97].map(|share| Shape { variant: 0, value: share * peak }).to_vec()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let torque = scene.torque_nm.joint(j);
        let cut = |t: f64| t.clamp(-shape.value, shape.value) - t;
        vec![Column::on(j, samples(scene, |k| cut(torque[k])))]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("limit_nm", shape.value, "Nm"), quantity("share_cut", b[0], "")]
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion at half the speed: no torque reaches the limit"
    }

    fn is_possible(&self, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    fn in_words(&self) -> &'static str {
        "a drive at its limit"
    }
}
