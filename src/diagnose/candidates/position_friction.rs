//! Coulomb friction that depends on the angle: τ = (a sin(q − q₀) + b cos(q − q₀)) sign q̇ = A cos(q + φ) sign q̇.
//!
//! q₀ is the middle of the range of angles. Over a small arc, b is Coulomb friction, which the null model contains, and
//! only a can be seen.

use super::*;

/// Largest variation of friction over a turn, as a share of its level.
const MOST: f64 = 0.75;

/// See the module.
pub struct PositionFriction;

impl Candidate for PositionFriction {
    fn kind(&self) -> Kind {
        Kind::PositionFriction
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        let [low, high] = range_rad(scene, joint(site));
        vec![Shape { variant: 0, value: 0.5 * (low + high) }]
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let middle = shape.value;
        let column =
            |f: fn(f64) -> f64| dry_friction(scene, joint(site), |at, k| f(at.q_rad[k] - middle));
        vec![column(f64::sin), column(f64::cos)]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        let (sin, cos) = ((-b[0]).atan2(second(b)) - shape.value).sin_cos();
        vec![
            quantity("amplitude_nm", b[0].hypot(second(b)), "Nm"),
            quantity("phase_rad", sin.atan2(cos), "rad"),
        ]
    }

    /// Where only the slope a of the law is seen, −A sin(q₀ + φ) = a, A is at least |a|.
    fn left_open(
        &self,
        scene: &Scene,
        site: Option<usize>,
        shape: Shape,
        b: &[f64],
    ) -> Vec<(&'static str, [f64; 2])> {
        let [slope] = b else { return Vec::new() };
        let most = (MOST * scene.coulomb_nm[joint(site)]).max(slope.abs());
        let turn = std::f64::consts::FRAC_PI_2 - (slope.abs() / most).asin();
        let quantities = self.quantities(scene, site, shape, b);
        let reach = |q: &Quantity| match q.name {
            "phase_rad" => (q.name, [q.value - turn, q.value + turn]),
            name => (name, [slope.abs(), most]),
        };
        quantities.iter().map(reach).collect()
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion with another payload or on a tilted base: this friction stays where it was"
    }

    /// A variation of more than [`MOST`] means that the law of something else is curved, seen over a small arc. The
    /// Coulomb friction of the scene may hold the mean of this law along the motion, if it was estimated without it.
    fn is_its_own(&self, scene: &Scene, site: Option<usize>, shape: Shape, b: &[f64]) -> bool {
        let j = joint(site);
        let q_rad = scene.motion.q_rad.joint(j);
        let of_angle = |q: &f64| {
            let (sin, cos) = (q - shape.value).sin_cos();
            b[0] * sin + second(b) * cos
        };
        let mean_nm = q_rad.iter().map(of_angle).sum::<f64>() / q_rad.len() as f64;
        let level_nm = scene.coulomb_nm[j] - mean_nm.min(0.0);
        !scene.periodic || b[0].hypot(second(b)) < MOST * level_nm
    }

    fn in_words(&self) -> &'static str {
        "friction that depends on the angle"
    }
}
