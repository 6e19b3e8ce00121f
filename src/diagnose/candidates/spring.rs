//! A cable or hose that pulls like a spring: the drive has to supply τ = k (q − q₀).

use super::*;

/// See the module.
pub struct Spring;

impl Candidate for Spring {
    fn kind(&self) -> Kind {
        Kind::Spring
    }

    fn shapes(&self, _: &Scene, _: Option<usize>) -> Vec<Shape> {
        // Where the null model absorbs the column of the angle, only the spring's pull at zero is left (variant 1).
        [0, 1].map(|variant| Shape { variant, value: 0.0 }).to_vec()
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let constant = Column::on(j, vec![1.0; scene.samples()]);
        if shape.variant == 1 {
            return vec![constant];
        }
        vec![Column::on(j, scene.motion.q_rad.joint(j).to_vec()), constant]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        if shape.variant == 1 {
            return vec![quantity("pull_at_zero_nm", b[0], "Nm")];
        }
        let mut out = vec![quantity("stiffness_nm_rad", b[0], "Nm/rad")];
        // Where the estimate fits offsets, the constant is absorbed and the rest angle unknown.
        out.extend(b.get(1).map(|constant| quantity("rest_rad", -constant / b[0], "rad")));
        out
    }

    fn separating_experiment(&self) -> &'static str {
        "slow motion over the joint's whole range with the cable on and off"
    }

    /// A torque that drives the joint away from its rest angle is not a cable.
    fn is_possible(&self, shape: Shape, b: &[f64]) -> bool {
        shape.variant == 1 || b[0] > 0.0
    }

    fn in_words(&self) -> &'static str {
        "a cable or hose that pulls like a spring"
    }
}
