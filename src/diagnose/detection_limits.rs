//! How small an effect this log would still show.

use super::image::Span;
use super::significance::LEAST_EVIDENCE;
use super::study::{Entry, Study};
use super::verdict::DetectionLimit;

/// √λ at which a family is found with 90 % probability: z of its threshold plus 1.28.
const POWER: f64 = 0.9;
const POWER_Z: f64 = 1.281_551_565_544_6;
/// A column that keeps less than this share of its square beside the causes that were named is one of them.
const ABSORBED_BESIDE: f64 = 0.04 * 0.04;
/// No effect has a coefficient (Nm, Nm/rad, rad, 1 … in SI) as large as this: its column is rounding.
const BEYOND_PHYSICS: f64 = 1e4;

/// Per family and site the size that would be found with 90 % probability beside the causes `accepted`; none for a single
/// run, whose noise is not known.
pub fn detection_limits(study: &Study, accepted: &Span) -> Vec<DetectionLimit> {
    if !study.scene.periodic {
        return Vec::new();
    }
    let mut out = Vec::new();
    for (family, candidate) in study.families.iter().enumerate() {
        for site in candidate.sites(study.scene.joints()) {
            let here = study.entries.iter().filter(|e| (e.family, e.site) == (family, site));
            // √λ of a coefficient b on column 1 alone is b ‖d⊥‖.
            let sized: Vec<(&Entry, f64, f64)> = here
                .map(|entry| {
                    let threshold = (study.price(entry) + LEAST_EVIDENCE).sqrt() + POWER_Z;
                    (entry, study.span(entry, accepted).first_length(), threshold)
                })
                .collect();
            // A shape in which an effect of that size may be.
            let may_be = |&&(entry, length, threshold): &&(&Entry, f64, f64)| {
                length > 0.0
                    && candidate.is_possible(entry.shape, &first_alone(entry, threshold / length))
            };
            let possible: Vec<_> = sized.iter().filter(may_be).copied().collect();
            let sized = if possible.is_empty() { sized } else { possible };
            let Some(&(entry, length, threshold)) = sized.get(sized.len() / 2) else { continue };
            if length == 0.0 {
                continue;
            }
            let quantities = |coefficient: f64| {
                let b = first_alone(entry, coefficient);
                candidate.quantities(&study.scene, site, entry.shape, &b)
            };
            let of = quantities(threshold / length);
            let Some(quantity) = candidate.size(&of) else { continue };
            // What the coefficient does not change, the shape has given.
            let given = of
                .iter()
                .zip(quantities(2.0 * threshold / length))
                .filter(|(one, two)| one.value == two.value && one.value != 0.0)
                .map(|(one, _)| (one.name, one.value));
            let is_told = length * length > ABSORBED_BESIDE * entry.images[0].square()
                && threshold / length < BEYOND_PHYSICS;
            out.push(DetectionLimit {
                kind: candidate.kind(),
                joint: site.map(|j| j + 1),
                parameter: quantity.name,
                value: is_told.then_some(quantity.value),
                unit: quantity.unit,
                given: given.filter(|(name, _)| *name != quantity.name).collect(),
                power: POWER,
            });
        }
    }
    out
}

/// Coefficients of `entry` of which only the first is not zero.
fn first_alone(entry: &Entry, coefficient: f64) -> Vec<f64> {
    let mut b = vec![0.0; entry.images.len()];
    b[0] = coefficient;
    b
}
