//! Friction of different size in the two directions: τ = c s² + v |q̇|, with c and v half the differences of Coulomb and
//! viscous friction, and s the sign of q̇, by which the Coulomb level r_c + c s turns round at a reversal.

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
        // Between the directions there is none; a constant came out 3 % too small. In a single run nothing tells friction
        // near standstill from its noise.
        let dry = match scene.periodic {
            true => dry_friction(scene, j, |at, k| at.sign[k]),
            false => Column::on(j, vec![1.0; scene.samples()]),
        };
        vec![Column::on(j, samples(scene, |k| qd[k].abs())), dry]
    }

    /// Beside a torque offset of the null model, only the course of friction within its reversals would tell the dry part.
    /// That course is assumed: of 0.8 Nm with another one, 0.57 to 0.62 ± 0.07 Nm came out.
    fn quantities(&self, scene: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        let told = b.get(1).filter(|_| !scene.arm.torque_offsets);
        let dry = told.map(|dry| quantity("coulomb_nm", *dry, "Nm"));
        dry.into_iter().chain([quantity("viscous_nm_s_rad", b[0], "Nm s/rad")]).collect()
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
