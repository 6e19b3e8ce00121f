//! Friction that falls with speed near rest: τ = F e^{−(|q̇|/v_s)ⁿ} sign q̇, n = 2 or 1 (Stribeck 1902; Armstrong-Hélouvry,
//! Dupont and Canudas de Wit 1994).

use super::*;

/// See the module.
pub struct Stribeck;

/// A curve that falls over more than this speed, rad/s, is no matter of slow motion.
fn widest(scene: &Scene) -> f64 {
    25.0 * scene.arm.friction_epsilon_rad_s
}

impl Candidate for Stribeck {
    fn kind(&self) -> Kind {
        Kind::Stribeck
    }

    fn shapes(&self, scene: &Scene, _: Option<usize>) -> Vec<Shape> {
        // Up to twice the widest, to see where it would end. Slower than the width of the regularised sign it is a
        // part of that sign.
        let slowest = scene.arm.friction_epsilon_rad_s;
        (0..2)
            .flat_map(|variant| {
                geometric(1.2 * slowest, 2.0 * widest(scene), 8)
                    .map(move |value| Shape { variant, value })
            })
            .collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let exponent = if shape.variant == 0 { 2 } else { 1 };
        let law = |v: f64| (-(v.abs() / shape.value).powi(exponent)).exp();
        vec![dry_friction(scene, j, |at, k| law(at.qd_rad_s[k]))]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("extra_nm", b[0], "Nm"), quantity("vs_rad_s", shape.value, "rad/s")]
    }

    fn separating_experiment(&self) -> &'static str {
        "constant speeds in a slow staircase down to 0.005 rad/s, both directions"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    /// Friction that falls over the whole range of speeds has another law.
    fn is_its_own(&self, scene: &Scene, _: Option<usize>, shape: Shape, _: &[f64]) -> bool {
        shape.value <= widest(scene)
    }

    fn in_words(&self) -> &'static str {
        "friction that is larger near rest and falls with speed (Stribeck)"
    }
}
