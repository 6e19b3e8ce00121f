//! A constant torque: the zero of the current sensor, or Coulomb friction of different size in the two directions.

use super::*;

/// See the module.
pub struct CurrentOffset;

impl Candidate for CurrentOffset {
    fn kind(&self) -> Kind {
        Kind::CurrentOffset
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        vec![Column::on(joint(site), vec![1.0; scene.samples()])]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("offset_nm", b[0], "Nm")]
    }

    fn separating_experiment(&self) -> &'static str {
        "the current with brakes closed: what is left there is an offset, not friction"
    }

    fn in_words(&self) -> &'static str {
        "a constant torque (offset of the current sensor, or unequal Coulomb friction)"
    }
}
