//! How small an effect this log would still show.

use std::borrow::Cow;

use super::candidates::Shape;
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
/// √λ that most families need, beyond which nothing is looked for, and how well the least is told.
const USUAL: f64 = 8.0;
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
            // The law that bears the family's name: the same parameter of another one is another size.
            let Some(law) = here.clone().map(|entry| entry.shape.variant).min() else { continue };
            let visible: Vec<Visible> = here
                .filter(|entry| entry.shape.variant == law)
                .map(|entry| Visible::beside(study, accepted, Cow::Borrowed(entry)))
                .filter(|visible| visible.span.first_length() > 0.0)
                .collect();
            let is_the_shape = visible.iter().any(|v| candidate.whole(v.entry.shape).is_some());
            let least = match is_the_shape {
                true => least_shape(study, accepted, visible),
                false => least_coefficient(study, visible),
            };
            let Some(Least { visible, coefficient, sqrt_lambda }) = least else { continue };
            let Visible { entry, span } = visible;
            let quantities = |coefficient: f64| {
                let b = first_alone(&entry, coefficient);
                candidate.quantities(&study.scene, site, entry.shape, &b)
            };
            let of = quantities(coefficient);
            let Some(quantity) = candidate.size(&of) else { continue };
            // What the coefficient does not change, the shape has given.
            let given = of
                .iter()
                .zip(quantities(2.0 * coefficient))
                .filter(|(one, two)| one.value == two.value && one.value != 0.0)
                .map(|(one, _)| (one.name, one.value));
            let length = span.first_length();
            let is_told = sqrt_lambda < LARGEST
                && length * length > ABSORBED_BESIDE * entry.images[0].square()
                && coefficient < BEYOND_PHYSICS
                && candidate.can_be(&study.scene, site, quantity.value);
            out.push(DetectionLimit {
                kind: candidate.kind(),
                joint: site.map(|j| j + 1),
                parameter: quantity.name,
                value: is_told.then_some(quantity.value),
                unit: quantity.unit,
                given: given.filter(|(name, _)| *name != quantity.name).collect(),
                sqrt_lambda: is_told.then_some(sqrt_lambda),
                power: POWER,
            });
        }
    }
    out
}

/// A law in one shape, and what of it is seen beside the causes that were named.
struct Visible<'e> {
    entry: Cow<'e, Entry>,
    span: Span,
}

impl<'e> Visible<'e> {
    fn beside(study: &Study, accepted: &Span, entry: Cow<'e, Entry>) -> Self {
        let span = study.span(&entry, accepted);
        Self { entry, span }
    }

    /// See [`needed`].
    fn needed(&self, study: &Study) -> f64 {
        needed(study, &self.entry, &self.span)
    }
}

/// The least of a law that is found.
struct Least<'e> {
    visible: Visible<'e>,
    /// Of the first column, which alone is there.
    coefficient: f64,
    sqrt_lambda: f64,
}

/// The least coefficient in the middle one of the shapes in which an effect of about that size may be.
fn least_coefficient<'e>(study: &Study, mut shapes: Vec<Visible<'e>>) -> Option<Least<'e>> {
    let place = shapes.len() / 2;
    let middle = shapes.get(place)?;
    let candidate = &study.families[middle.entry.family];
    let about = middle.needed(study);
    // √λ of a coefficient b on column 1 alone is b ‖d⊥‖.
    let may_be = |Visible { entry, span }: &Visible| {
        candidate.is_possible(entry.shape, &first_alone(entry, about / span.first_length()))
    };
    let possible: Vec<usize> = (0..shapes.len()).filter(|i| may_be(&shapes[*i])).collect();
    let chosen = possible.get(possible.len() / 2).copied().unwrap_or(place);
    let visible = shapes.swap_remove(chosen);
    let sqrt_lambda = if chosen == place { about } else { visible.needed(study) };
    let coefficient = sqrt_lambda / visible.span.first_length();
    Some(Least { visible, coefficient, sqrt_lambda })
}

/// The weakest shape that is found where shapes say how large an effect is: between the weakest of `shapes` that is and the next
/// one.
fn least_shape<'e>(study: &Study, accepted: &Span, shapes: Vec<Visible<'e>>) -> Option<Least<'e>> {
    let whole = |Visible { entry, .. }: &Visible| {
        study.families[entry.family].whole(entry.shape).unwrap_or(0.0)
    };
    let excess =
        |visible: &Visible| whole(visible) * visible.span.first_length() - visible.needed(study);
    let mut by_excess: Vec<(f64, Visible)> =
        shapes.into_iter().map(|visible| (excess(&visible), visible)).collect();
    by_excess.sort_by(|a, b| a.0.total_cmp(&b.0));
    let first = by_excess.partition_point(|(excess, _)| *excess < 0.0);
    let value = |i: usize| by_excess.get(i).map(|(_, visible)| visible.entry.shape.value);
    let found = value(first)?;
    // Weaker than all shapes there are as the weakest is than the one before it.
    let mut silent = match first.checked_sub(1).and_then(value) {
        Some(silent) => silent,
        None => found * found / value(1)?,
    };
    let mut least = by_excess.swap_remove(first).1;
    while (silent / least.entry.shape.value).ln().abs() > TOLD_TO {
        let Entry { family, site, shape, .. } = *least.entry;
        let between = Shape { value: (silent * shape.value).sqrt(), ..shape };
        let seen = study.entry(family, site, between);
        let seen = seen.map(|entry| Visible::beside(study, accepted, Cow::Owned(entry)));
        match seen.filter(|visible| excess(visible) >= 0.0) {
            Some(visible) => least = visible,
            None => silent = between.value,
        }
    }
    let (coefficient, sqrt_lambda) = (whole(&least), least.needed(study));
    Some(Least { visible: least, coefficient, sqrt_lambda })
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
    let [mut silent, mut found] = [0.0, USUAL];
    while found < LARGEST && !is_found(found) {
        [silent, found] = [found, (2.0 * found).min(LARGEST)];
    }
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
