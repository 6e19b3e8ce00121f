//! Detection limits: how small an effect the log would still show.

use std::borrow::Cow;

use rayon::prelude::*;

use super::candidates::Shape;
use super::chance;
use super::image::Span;
use super::significance::LEAST_EVIDENCE;
use super::statistic::upper_fisher;
use super::study::{Entry, Study};
use super::verdict::DetectionLimit;
use crate::identify::covariance::student_quantile;

/// Probability with which an effect of the size of the limit is found.
const POWER: f64 = 0.9;
/// A column that keeps less than this share of its square outside the named causes counts as absorbed by them.
const ABSORBED_BESIDE: f64 = 0.04 * 0.04;
/// No effect has a coefficient as large as this (Nm, Nm/rad, rad, 1 … in SI units): the column that needs it is
/// rounding.
const BEYOND_PHYSICS: f64 = 1e4;
/// √λ that most families need; the largest √λ that is tried; and the accuracy of the limit: absolute for √λ, in the
/// logarithm for a shape.
const USUAL: f64 = 8.0;
const LARGEST: f64 = 1000.0;
const TOLD_TO: f64 = 0.01;

/// For every family at every site, the size of effect that would be found with 90 % probability beside the causes
/// `accepted`. Empty for a single run, whose noise is not known.
pub fn detection_limits(study: &Study, accepted: &Span) -> Vec<DetectionLimit> {
    if !study.scene.periodic {
        return Vec::new();
    }
    let sites = |family: usize| {
        let sites = study.families[family].sites(study.scene.joints());
        sites.into_iter().map(move |site| (family, site))
    };
    let places: Vec<_> = (0..study.families.len()).flat_map(sites).collect();
    let each = places.into_par_iter().with_max_len(1);
    each.filter_map(|place| limit_at(study, accepted, place)).collect()
}

/// Detection limit of one family at one site; `None` if the family was not looked for there.
fn limit_at(
    study: &Study,
    accepted: &Span,
    (family, site): (usize, Option<usize>),
) -> Option<DetectionLimit> {
    let candidate = &study.families[family];
    let here = study.entries.iter().filter(|e| e.place() == (family, site));
    // Only the first variant, which bears the family's name: in another law the same parameter means another size.
    let law = here.clone().map(|entry| entry.shape.variant).min()?;
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
    let Least { visible: Visible { entry, span }, coefficient, sqrt_lambda } = least?;
    let quantities = |coefficient: f64| {
        let b = first_alone(&entry, coefficient);
        candidate.quantities(&study.scene, site, entry.shape, &b)
    };
    let of = quantities(coefficient);
    let quantity = candidate.size(&of)?;
    // Quantities that do not change with the coefficient are determined by the shape.
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
    Some(DetectionLimit {
        kind: candidate.kind(),
        joint: site.map(|j| j + 1),
        parameter: quantity.name,
        value: is_told.then_some(quantity.value),
        unit: quantity.unit,
        given: given.filter(|(name, _)| *name != quantity.name).collect(),
        sqrt_lambda: is_told.then_some(sqrt_lambda),
        power: POWER,
    })
}

/// A law with one shape, and its span outside the null model and the named causes.
struct Visible<'e> {
    entry: Cow<'e, Entry>,
    span: Span,
}

impl<'e> Visible<'e> {
    fn beside(study: &Study, accepted: &Span, entry: Cow<'e, Entry>) -> Self {
        let span = study.span(&entry, accepted);
        Self { entry, span }
    }

    /// √λ from which on this law is found, see [`needed`].
    fn needed(&self, study: &Study) -> f64 {
        needed(study, &self.entry, &self.span)
    }
}

/// The smallest effect of a law that is found.
struct Least<'e> {
    visible: Visible<'e>,
    /// Coefficient of the first column; the other coefficients are zero.
    coefficient: f64,
    sqrt_lambda: f64,
}

/// The smallest coefficient that is found, for the middle one of those shapes that an effect of about that size may
/// have.
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

/// For families whose shape determines the size of the effect: the weakest shape that is found. It lies between the
/// weakest one of `shapes` that is found and the next weaker one, and is located by bisection on a logarithmic scale.
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
    // If even the weakest shape is found, the search begins weaker by the ratio of the two weakest shapes.
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

/// √λ from which on an effect along the first column of `entry`, whose span is `span`, is found with probability
/// [`POWER`]; at least [`LARGEST`] if there is none.
///
/// An effect is found if its observed part is worth its price and is rarer by chance than the share of a law in the
/// false-alarm probability allows. The observed part is the true effect plus noise, which is Student-distributed with
/// the ν degrees of freedom to which the log knows its power.
fn needed(study: &Study, entry: &Entry, span: &Span) -> f64 {
    let of_one = span.inside(&entry.images[0]);
    let worth = study.price(entry) + LEAST_EVIDENCE;
    let rare = chance::LAW / study.tests(entry);
    let statistic = &study.statistic;
    // ν does not depend on the size of the effect. Only logs whose noise is known come here.
    let freedom = statistic.freedom(span, &of_one);
    let is_found = |sqrt_lambda: f64| {
        let mut seen = of_one.clone();
        seen.scale(sqrt_lambda / span.first_length());
        let f = span.explained(&seen) / span.len() as f64;
        statistic.gain(span, &seen) > worth && upper_fisher(f, span.len(), freedom) < rare
    };
    let [mut silent, mut found] = [0.0, USUAL];
    while found < LARGEST && !is_found(found) {
        [silent, found] = [found, (2.0 * found).min(LARGEST)];
    }
    while found - silent > TOLD_TO {
        let between = 0.5 * (silent + found);
        if is_found(between) { found = between } else { silent = between }
    }
    found + student_quantile(POWER, freedom)
}

/// Coefficients of `entry`: `coefficient` for the first column, zero for the others.
fn first_alone(entry: &Entry, coefficient: f64) -> Vec<f64> {
    let mut b = vec![0.0; entry.images.len()];
    b[0] = coefficient;
    b
}
