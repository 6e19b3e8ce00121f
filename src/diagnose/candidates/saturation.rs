//! A drive at its limit: torque beyond ±c is cut off, and its noise with it. With σ the noise of one sample, the mean
//! of the torque that is cut off above is E max(0, τ + n − c) = x Φ(x/σ) + σ φ(x/σ), x = τ − c. Noise that is added to
//! the reading after the limit is not cut off: max(0, x) (variant 1).

use super::*;
use statrs::function::erf::erfc;

/// See the module.
pub struct Saturation;

/// Variant whose noise is added after the limit.
const BEFORE_NOISE: usize = 1;
/// Starting limits, as shares of the largest torque that the model expects.
const SHARES: [f64; 5] = [0.6, 0.7, 0.8, 0.9, 0.97];

/// Smallest share of the torque beyond the limit that has to be cut off. For two sensors with a curved characteristic,
/// the best-fitting limits cut off 0.02 and 0.06.
const LEAST_CUT: f64 = 0.5;

/// E max(0, x + n), n normal with standard deviation `sigma`.
fn beyond(x: f64, sigma: f64) -> f64 {
    if x.abs() >= 8.0 * sigma {
        return x.max(0.0);
    }
    let u = x / sigma;
    let below = 0.5 * erfc(-u * std::f64::consts::FRAC_1_SQRT_2);
    let density = (-0.5 * u * u).exp() / std::f64::consts::TAU.sqrt();
    x * below + sigma * density
}

impl Candidate for Saturation {
    fn kind(&self) -> Kind {
        Kind::Saturation
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        // Readings that stop at one number reveal the limit.
        if let Some(limit) = scene.torque_limit_nm[joint(site)] {
            return vec![Shape { variant: 0, value: limit }];
        }
        // In a single run, an inaccurate friction law looks like a cut-off peak.
        if !scene.periodic {
            return Vec::new();
        }
        let peak = scene.torque_nm.joint(joint(site)).iter().fold(0.0, |m: f64, t| m.max(t.abs()));
        let shapes = |variant| SHARES.map(|share| Shape { variant, value: share * peak });
        [0, BEFORE_NOISE].into_iter().flat_map(shapes).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let torque = scene.torque_nm.joint(j);
        let noise_nm = if shape.variant == BEFORE_NOISE { 0.0 } else { scene.noise_nm[j] };
        let cut = |t: f64| beyond(-t - shape.value, noise_nm) - beyond(t - shape.value, noise_nm);
        vec![Column::on(j, samples(scene, |k| cut(torque[k])))]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("limit_nm", shape.value, "Nm"), quantity("share_cut", b[0], "")]
    }

    fn whole(&self, _: Shape) -> Option<f64> {
        Some(1.0)
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion at half the speed: no torque reaches the limit"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    /// Beyond a real limit everything is cut off, and even more relative to a model that the limit has biased. A sensor
    /// with a curved characteristic cuts off only a share, and its readings do not stop at a limit.
    fn is_its_own(&self, scene: &Scene, site: Option<usize>, _: Shape, b: &[f64]) -> bool {
        b[0] > LEAST_CUT || scene.torque_limit_nm[joint(site)].is_some()
    }

    fn in_words(&self) -> &'static str {
        "a drive at its limit"
    }

    fn form(&self, _: &Scene, shape: Shape) -> Option<&'static str> {
        let behind = shape.variant == BEFORE_NOISE;
        Some(if behind { "noise is added behind the limit" } else { "noise is cut off with it" })
    }
}
