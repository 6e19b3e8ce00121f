//! Confidence intervals: how well the numbers of an extended model are known.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::DMatrix;
use rayon::prelude::*;

#[cfg(doc)]
use super::candidates::Candidate;
use super::candidates::{Quantity, Search, Shape};
use super::delta_method::with_reach;
use super::extension::{Effect, Extension, torque_per_reading, width_of_arm};
use super::image::{Image, Span};
use super::kind::Kind;
use super::selection::Kept;
use super::study::{Entry, Study};
use super::verdict::{BaseParameter, Estimate};
use crate::base::BaseSet;

/// Relative step of the numerical derivative with respect to a nonlinear parameter.
const STEP: f64 = 1e-3;

/// Derivatives of `effect` in the whitened equations with respect to its coefficients, and with respect to its
/// nonlinear parameter if it has one.
pub(super) fn tangents(study: &Study, effect: &Effect) -> Vec<Image> {
    let Effect { site, shape, .. } = *effect;
    let family = &study.families[effect.family];
    let step = STEP * shape.value.abs();
    let has_slope = has_nonlinear_parameter(study, effect);
    let around = [0.0, step, -step].map(|off| Shape { value: shape.value + off, ..shape });
    let shapes = if has_slope { &around[..] } else { &around[..1] };
    let banks = family.bank(&study.scene, site, shapes).into_iter();
    let mut images = banks.map(|columns| -> Vec<Image> {
        study.whitening.images(columns.iter().take(effect.coefficients.len()))
    });
    let mut out = images.next().unwrap_or_default();
    if let (Some(above), Some(below)) = (images.next(), images.next()) {
        let mut slope = Image::default();
        for ((mut above, below), b) in above.into_iter().zip(below).zip(&effect.coefficients) {
            above.add(-1.0, &below);
            above.scale(0.5 * b / step);
            if slope.mean.is_empty() {
                slope = above;
            } else {
                slope.add(1.0, &above);
            }
        }
        out.push(slope);
    }
    out
}

/// Whether the law of `effect` has a nonlinear parameter. Where it is zero, the law is the one without it.
fn has_nonlinear_parameter(study: &Study, effect: &Effect) -> bool {
    study.families[effect.family].search() != Search::None && effect.shape.value != 0.0
}

/// Base parameters beside the effects of `extension`, with their σ when the numbers of the effects are unknown as well.
/// Their covariance is the corresponding block of (XᵀX)⁻¹, where X also contains the tangents of the effects. It is NaN
/// for a parameter whose column the effects absorb.
pub fn base(study: &Study, set: &BaseSet, extension: &Extension) -> Base {
    let effects = extension.effects.iter().flat_map(|effect| tangents(study, effect));
    let mut span = Span::default();
    effects.for_each(|image| {
        span.push(&image);
    });
    // Index of each parameter in the span; `None` if the effects absorb its column.
    let place = |column| {
        let next = span.len();
        span.push(column).then_some(next)
    };
    let places: Vec<Option<usize>> = study.null_columns.iter().map(place).collect();
    let of_all = study.statistic.covariance(&span, &study.torque);
    let covariance =
        DMatrix::from_fn(set.rank(), set.rank(), |i, k| match (places[i], places[k]) {
            (Some(i), Some(k)) => of_all[(i, k)],
            _ => f64::NAN,
        });
    let parameter = |k: usize| BaseParameter {
        name: set.name(k).to_owned(),
        value: extension.theta[k],
        // `clamp` preserves NaN.
        sigma: covariance[(k, k)].clamp(0.0, f64::INFINITY).sqrt(),
    };
    let of_span = study.statistic.freedom_of_coefficients(&span);
    let freedom = places.iter().map(|place| place.map_or(f64::NAN, |place| of_span[place]));
    Base {
        parameters: (0..set.rank()).map(parameter).collect(),
        freedom: freedom.take(set.rank()).collect(),
        covariance,
    }
}

/// Base parameters beside the effects that were found.
pub struct Base {
    /// The parameters with their σ.
    pub parameters: Vec<BaseParameter>,
    /// Covariance of the parameters, b × b.
    pub covariance: DMatrix<f64>,
    /// Degrees of freedom to which each σ is known.
    pub freedom: Vec<f64>,
}

/// Physical parameters of a cause, with 95 % intervals.
///
/// For a motion that repeats, the nonlinear parameter is varied value by value: its interval is that of the profile
/// likelihood (Venzon and Moolgavkar 1988), which need not be symmetric. The coefficients of the other causes are free
/// then, and so is the shape of the curve that bristles hold, or of the bristles. Where the family has several forms (Stribeck's
/// exponent, the stiffness of a gear's flanks), the interval covers all forms that the log allows. With D = 2 ln of the
/// odds against a form and q the 95 % quantile, the interval of that form is shrunk by √(1 − D/q²); it ends where the
/// likelihood is below that of the best form by q².
///
/// The interval also reaches to the value that the shape gives for the same parameter ([`Candidate::in_shape`]), and
/// over the range that an absorbed column leaves open ([`Candidate::left_open`]). It is widened by the error of the law
/// itself ([`Candidate::form_error`]), and holds no impossible values ([`Candidate::least`]).
pub fn physical(
    study: &Study,
    kept: &Kept,
    effects: &[Effect],
    index: usize,
) -> BTreeMap<&'static str, Estimate> {
    let effect = &effects[index];
    let (mut others, mut residual) = kept.without(Some(index));
    for other in effects.iter().filter(|other| are_of_one_law(study, effect, other)) {
        for tangent in tangents_outside_null(study, other) {
            others.push(&tangent);
        }
    }
    others.residualise(&mut residual);
    let tangents = Tangents::outside(study, &others, effect);
    let quantile = study.statistic.quantile_95(&tangents.span, &residual);
    let has_profile = study.scene.periodic && has_nonlinear_parameter(study, effect);
    let per_reading = torque_per_reading(effects, effect, study.families);
    let profile =
        Profile { study, effect, per_reading, others: &others, residual: &residual, quantile };
    let mut out =
        has_profile.then(|| profile.intervals(&tangents)).flatten().unwrap_or_else(|| {
            of_one_form(study, (effect, per_reading), (&tangents, &residual), quantile)
        });
    for form in kept.other_forms(index, (&others, &residual)) {
        let left = 1.0 - form.behind / quantile.powi(2);
        if left <= 0.0 {
            continue;
        }
        let tangents = Tangents::outside(study, &others, &form.effect);
        let half = left.sqrt() * quantile;
        let form = (&form.effect, per_reading);
        let other = of_one_form(study, form, (&tangents, &residual), half);
        // A form with the opposite sign bends the other way where this matters less; it is a different statement. The
        // sign of a phase states nothing.
        let is_opposite = |(name, own): (&&str, &Estimate)| {
            *name != PHASE && other.get(name).is_some_and(|other| own.value * other.value < 0.0)
        };
        if out.iter().any(is_opposite) {
            continue;
        }
        reach_over(&mut out, &other);
    }
    let family = &study.families[effect.family];
    if let Some(again) = family.in_shape(effect.shape)
        && let Some(own) = out.get_mut(again.name)
    {
        own.reach(again.value);
    }
    let Effect { site, shape, coefficients, .. } = effect;
    let of_drive: Vec<f64> = coefficients.iter().map(|b| per_reading * b).collect();
    for (name, ends) in family.left_open(&study.scene, *site, *shape, &of_drive) {
        let own = out.get_mut(name).into_iter();
        own.for_each(|own| ends.into_iter().for_each(|end| own.reach(end)));
    }
    // The columns are those of cold friction, while the log shows warm friction.
    let warm = match site {
        Some(j) if family.kind().adds_friction() => study.scene.other_friction(*j).warm,
        _ => 1.0,
    };
    let form_error = family.form_error(&study.scene, effect.shape);
    let nothing = family.without_effect(&study.scene);
    // A joint's width beside that of the arm is known better than the difference of the two, whose interval this is.
    let of_arm = width_of_arm(effects, effect, study.families).unwrap_or(0.0);
    for own in out.values_mut() {
        own.stretch(1.0 / warm.clamp(LEAST_WARM, 1.0));
        own.widen(quantile * form_error * (own.value - nothing).abs());
        own.shift(of_arm);
        own.keep_above(family.least());
    }
    out
}

/// Least factor of warm friction for which intervals are stretched.
const LEAST_WARM: f64 = 0.2;

/// The parameter that wraps: values a whole turn apart are the same.
const PHASE: &str = "phase_rad";

/// Extends the intervals `own` to cover those of `other`; phases are first shifted by whole turns to be near each
/// other.
fn reach_over(own: &mut BTreeMap<&'static str, Estimate>, other: &BTreeMap<&str, Estimate>) {
    for (name, own) in own {
        let Some(other) = other.get(name) else { continue };
        let turns = if *name == PHASE { ((own.value - other.value) / TAU).round() } else { 0.0 };
        other.ci95.into_iter().for_each(|end| own.reach(end + turns * TAU));
    }
}

/// The profile likelihood along the nonlinear parameter of a cause: all other parameters are at their best.
struct Profile<'a> {
    study: &'a Study<'a>,
    effect: &'a Effect,
    /// [`torque_per_reading`] of the effect.
    per_reading: f64,
    others: &'a Span,
    residual: &'a Image,
    quantile: f64,
}

/// Number of points at which the profile is evaluated on the way to each end of the interval.
const PARTS: usize = 4;
/// Number of steps outward in search of an end, and of bisection steps afterwards.
const STEPS_OUT: usize = 4;
const HALVINGS: usize = 4;

impl Profile<'_> {
    /// Intervals from the profile. The search for the ends starts from σ of the nonlinear parameter; there is no search
    /// where the `tangents` do not tell it. `None` if the columns at the best value depend linearly on those of the other
    /// causes.
    fn intervals(&self, tangents: &Tangents) -> Option<BTreeMap<&'static str, Estimate>> {
        let covariance = self.study.statistic.covariance(&tangents.span, self.residual);
        let of_shape = tangents.free.iter().position(|k| *k == self.effect.coefficients.len());
        let sigma = of_shape.map_or(0.0, |at| covariance[(at, at)].max(0.0).sqrt());
        let centre = self.entry(self.effect.shape.value)?;
        let best = self.gain(&centre)?;
        let mut out = self.estimates(&centre, self.quantile);
        let on_the_way = |(end, part): (f64, usize)| {
            let entry = self.entry(self.moved(end * part as f64 / PARTS as f64))?;
            let left = self.quantile.powi(2) - (best - self.gain(&entry)?).max(0.0);
            Some(self.estimates(&entry, left.max(0.0).sqrt()))
        };
        let on_side = |side: f64| {
            let end = self.end(side * self.quantile * sigma, best);
            (1..=PARTS).into_par_iter().filter_map(move |part| on_the_way((end, part)))
        };
        let others: Vec<_> = [-1.0, 1.0].into_par_iter().flat_map(on_side).collect();
        others.iter().for_each(|other| reach_over(&mut out, other));
        Some(out)
    }

    /// Distance from the best value, in the direction of `step` and in its unit, at which the gain has fallen by the
    /// square of the quantile.
    fn end(&self, step: f64, best: f64) -> f64 {
        let is_allowed = |way: f64| {
            let gain = self.entry(self.moved(way)).and_then(|entry| self.gain(&entry));
            gain.is_some_and(|gain| best - gain < self.quantile.powi(2))
        };
        let (mut inside, mut outside) = (0.0, step);
        for _ in 0..STEPS_OUT {
            if !is_allowed(outside) {
                break;
            }
            (inside, outside) = (outside, 1.5 * outside);
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            if is_allowed(middle) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    /// The nonlinear parameter at the distance `way` from its best value; on a logarithmic scale the value is
    /// multiplied.
    fn moved(&self, way: f64) -> f64 {
        let value = self.effect.shape.value;
        match self.study.families[self.effect.family].search() {
            Search::Logarithmic => value * (way / value).exp(),
            Search::Straight | Search::None => value + way,
        }
    }

    fn entry(&self, value: f64) -> Option<Entry> {
        let Effect { family, site, shape, .. } = *self.effect;
        let entry = self.study.entry(family, site, Shape { value, ..shape })?;
        (entry.images.len() == self.effect.coefficients.len()).then_some(entry)
    }

    fn gain(&self, entry: &Entry) -> Option<f64> {
        self.study.score(entry, self.others, self.residual).map(|score| score.gain)
    }

    /// The parameters with the shape of `entry`, with intervals of ± `half` σ of the coefficients alone.
    fn estimates(&self, entry: &Entry, half: f64) -> BTreeMap<&'static str, Estimate> {
        let span = self.study.span(entry, self.others);
        let effect = Effect {
            coefficients: span.solve(self.residual),
            shape: entry.shape,
            ..self.effect.clone()
        };
        let free = (0..span.len()).collect();
        let tangents = Tangents { span, free };
        let effect = (&effect, self.per_reading);
        of_one_form(self.study, effect, (&tangents, self.residual), half)
    }
}

/// Whether one of two effects is a curve that the bristles of the other hold.
fn are_of_one_law(study: &Study, one: &Effect, other: &Effect) -> bool {
    let kinds = [one, other].map(|effect| study.families[effect.family].kind());
    let is_law = [Kind::Presliding, Kind::Stribeck].iter().all(|kind| kinds.contains(kind));
    study.scene.periodic && is_law && one.site == other.site
}

/// The [`tangents`] of `effect`, with the null model projected out.
fn tangents_outside_null(study: &Study, effect: &Effect) -> Vec<Image> {
    let mut tangents = tangents(study, effect);
    study.null.residualise_all(&mut tangents);
    tangents
}

/// The [`tangents`] of an effect, and which of its numbers they belong to.
struct Tangents {
    /// Their span outside the null model and the other causes.
    span: Span,
    /// For each column of the span the index of its number: the coefficients, and the shape behind them. The others are
    /// those whose columns depend linearly on these.
    free: Vec<usize>,
}

impl Tangents {
    /// Those of `effect` outside the null model and outside `others`.
    fn outside(study: &Study, others: &Span, effect: &Effect) -> Self {
        let mut tangents = tangents_outside_null(study, effect);
        others.residualise_all(&mut tangents);
        let mut span = Span::default();
        let free = (0..tangents.len()).filter(|k| span.push(&tangents[*k])).collect();
        Self { span, free }
    }
}

/// Parameters of one form by the [delta method](with_reach), with intervals of ± `half` σ, where the coefficients of the
/// other causes are free. The effect has its [`torque_per_reading`], whose own error is a small part of any interval.
fn of_one_form(
    study: &Study,
    (effect, per_reading): (&Effect, f64),
    (tangents, residual): (&Tangents, &Image),
    half: f64,
) -> BTreeMap<&'static str, Estimate> {
    let family = &study.families[effect.family];
    let covariance = study.statistic.covariance(&tangents.span, residual);
    let k = effect.coefficients.len();
    let at = |numbers: &[f64]| -> Vec<Quantity> {
        let shape = Shape { value: numbers[k], ..effect.shape };
        let of_drive: Vec<f64> = numbers[..k].iter().map(|b| per_reading * b).collect();
        family.quantities(&study.scene, effect.site, shape, &of_drive)
    };
    let numbers = [&effect.coefficients[..], &[effect.shape.value]].concat();
    let estimate = |(quantity, reach): (Quantity, f64)| {
        let value = quantity.value;
        // A parameter that is searched on a logarithmic scale is positive; a single run determines it to within a
        // factor.
        let by_factor = !study.scene.periodic
            && family.search() == Search::Logarithmic
            && value == effect.shape.value;
        let ci95 = if by_factor {
            [value * (-reach / value).exp(), value * (reach / value).exp()]
        } else {
            [value - reach, value + reach]
        };
        (quantity.name, Estimate { value, unit: quantity.unit, ci95 })
    };
    with_reach(at, &numbers, (&tangents.free, &covariance), half)
        .into_iter()
        .map(estimate)
        .collect()
}
