//! Friction curved in speed: τ = a |q̇|^p sign q̇, p < 1 concave, p > 1 convex, beside the linear law.

use super::*;

/// See the module.
pub struct NonlinearViscous;

impl Candidate for NonlinearViscous {
    fn kind(&self) -> Kind {
        Kind::NonlinearViscous
    }

    fn shapes(&self, _: &Scene, _: Option<usize>) -> Vec<Shape> {
        // At p = 0 and p = 1 the law is Coulomb's or linear: concave and convex are searched apart.
        let concave = [0.3, 0.5, 0.7].map(|value| Shape { variant: 0, value });
        let convex = [1.4, 1.8, 2.2, 3.0].map(|value| Shape { variant: 1, value });
        concave.into_iter().chain(convex).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let (qd, sign) = (scene.motion.qd_rad_s.joint(j), scene.sign.joint(j));
        vec![Column::on(j, samples(scene, |k| sign[k] * qd[k].abs().powf(shape.value)))]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("amplitude_nm", b[0], "Nm"), quantity("exponent", shape.value, "")]
    }

    fn separating_experiment(&self) -> &'static str {
        "constant speeds over the joint's whole range of speed, both directions, warm"
    }

    fn in_words(&self) -> &'static str {
        "friction that is not a straight line in speed"
    }
}
