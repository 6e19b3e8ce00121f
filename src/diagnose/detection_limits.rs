//! How small an effect this log would still show.

use super::chance;
use super::image::Span;
use super::significance::LEAST_EVIDENCE;
use super::study::{Entry, Study};
use super::verdict::DetectionLimit;
use crate::identify::covariance::student_quantile;

/// How often an effect of the size of the limit is found.
const POWER: f64 = 0.9;
/// A column that keeps less than this share of its square beside the causes that were named is one of them.
const ABSORBED_BESIDE: f64 = 0.04 * 0.04;
/// No effect has a coefficient (Nm, Nm/rad, rad, 1 … in SI) as large as this: its column is rounding.
const BEYOND_PHYSICS: f64 = 1e4;
/// √λ beyond which nothing is looked for, and how well the least is told.
const LARGEST: f64 = 1000.0;
const TOLD_TO: f64 = 0.01;

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
            let spans: Vec<(&Entry, Span)> = here
                .map(|entry| (entry, study.span(entry, accepted)))
                .filter(|(_, span)| span.first_length() > 0.0)
                .collect();
            let Some(middle) = spans.get(spans.len() / 2) else { continue };
            let about = needed(study, middle.0, &middle.1);
            // A shape in which an effect of that size may be; √λ of a coefficient b on column 1 alone is b ‖d⊥‖.
            let may_be = |(entry, span): &&(&Entry, Span)| {
                candidate.is_possible(entry.shape, &first_alone(entry, about / span.first_length()))
            };
            let possible: Vec<&(&Entry, Span)> = spans.iter().filter(may_be).collect();
            let (entry, span) = possible.get(possible.len() / 2).copied().unwrap_or(middle);
            let needed = needed(study, entry, span);
            let length = span.first_length();
            let quantities = |coefficient: f64| {
                let b = first_alone(entry, coefficient);
                candidate.quantities(&study.scene, site, entry.shape, &b)
            };
            let of = quantities(needed / length);
            let Some(quantity) = candidate.size(&of) else { continue };
            // What the coefficient does not change, the shape has given.
            let given = of
                .iter()
                .zip(quantities(2.0 * needed / length))
                .filter(|(one, two)| one.value == two.value && one.value != 0.0)
                .map(|(one, _)| (one.name, one.value));
            let is_told = needed < LARGEST
                && length * length > ABSORBED_BESIDE * entry.images[0].square()
                && needed / length < BEYOND_PHYSICS;
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

/// √λ of an effect along the first column of `entry`, whose `span` that is, from which on it is found with the probability
/// [`POWER`]; no less than [`LARGEST`] where none is.
///
/// An effect is found where what is seen of it is worth its price and rarer by chance than allowed. What is seen is what is there
/// and noise of Student's law, of which the log knows how strong it is with ν degrees of freedom.
fn needed(study: &Study, entry: &Entry, span: &Span) -> f64 {
    let of_one = span.inside(&entry.images[0]);
    let worth = study.price(entry) + LEAST_EVIDENCE;
    let rare = chance::LAW / study.tests(entry);
    let statistic = &study.statistic;
    let is_found = |sqrt_lambda: f64| {
        let mut seen = of_one.clone();
        seen.scale(sqrt_lambda / span.first_length());
        statistic.gain(span, &seen) > worth && statistic.probability(span, &seen) < rare
    };
    let [mut silent, mut found] = [0.0, LARGEST];
    while found - silent > TOLD_TO {
        let between = 0.5 * (silent + found);
        if is_found(between) { found = between } else { silent = between }
    }
    found + student_quantile(POWER, statistic.freedom(span, &of_one))
}

/// Coefficients of `entry` of which only the first is not zero.
fn first_alone(entry: &Entry, coefficient: f64) -> Vec<f64> {
    let mut b = vec![0.0; entry.images.len()];
    b[0] = coefficient;
    b
}
