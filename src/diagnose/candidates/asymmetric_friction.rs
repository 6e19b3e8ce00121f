//! Friction of different size in the two directions: τ = c + v |q̇|, with c and v half the differences of Coulomb and
//! viscous friction.

use super::*;

/// See the module.
pub struct AsymmetricFriction;

impl Candidate for AsymmetricFriction {
    fn kind(&self) -> Kind {
        Kind::AsymmetricFriction
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        let j = joint(site);
        let qd = scene.motion.qd_rad_s.joint(j);
        let constant = Column::on(j, vec![1.0; scene.samples()]);
        vec![Column::on(j, samples(scene, |k| qd[k].abs())), constant]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        // Where the null model fits offsets, the constant is one of them, and does not reveal friction.
        let constant = b.get(1).map(|constant| quantity("coulomb_nm", *constant, "Nm"));
        constant.into_iter().chain([quantity("viscous_nm_s_rad", b[0], "Nm s/rad")]).collect()
    }

    /// The viscous part. The Coulomb part alone is an offset except at reversals, and the null model absorbs offsets.
    fn size(&self, quantities: &[Quantity]) -> Option<Quantity> {
        quantities.last().copied()
    }

    fn separating_experiment(&self) -> &'static str {
        "the current with brakes closed: what is left there is an offset, not friction"
    }

    fn in_words(&self) -> &'static str {
        "friction of different size in the two directions"
    }
}
