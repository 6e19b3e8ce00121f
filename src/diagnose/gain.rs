//! Gain of a cause: how much of the explainable residual it removes on periods that were not used for the fit.
//!
//! Everything is computed in whitened rows, where the noise of the mean over all P periods has variance one, and that
//! of the mean over P_h periods has v_h = P/P_h. P_S is the projection on the span of the null model and all causes,
//! P_R that without cause c. Models are fitted to one half of the periods (y₁) and judged on the other half (y₂), and
//! the other way round:
//!
//! explainable = ‖y₂ − P_R y₁‖² − m v₂ − v₁ tr P_R,
//! removed = explainable − (‖y₂ − P_S y₁‖² − m v₂ − v₁ tr P_S).
//!
//! Both extend over the m rows that contain 95 % of the square of the cause, as fitted to y₁: noise in other rows says
//! nothing about it. m v₂ is the noise of y₂ in these rows, and v₁ tr P is the noise of the fit to y₁.
//!
//! A cause that removes less than nothing was fitted to the remainder of something else. A law that is present does not
//! get there by chance: with strength √λ it removes λ ± 2√λ of both halves together, and a law with enough evidence to
//! be named (√λ ≥ 6) lies at least three σ above zero.

use super::image::{Column, Image, Span};
use super::selection::Kept;
use super::study::{Entry, Study};

/// Share of a cause's square that is contained in the rows by which it is judged.
const WHERE_IT_ACTS: f64 = 0.95;
/// Least number of periods whose halves are worth a fit.
const LEAST_PERIODS: usize = 4;

impl Kept<'_, '_> {
    /// Drops causes that make the prediction of other periods worse, the worst first, and refines the remaining ones at
    /// the same site. Returns the gains of those that stay ([`on_other_periods`]).
    pub fn drop_idle(&mut self) -> Vec<Option<f64>> {
        loop {
            let gains = self.gains();
            let Some(worst) = most_harmful(&gains) else { return gains };
            let site = self.causes.remove(worst).entry.site;
            self.refine_at(site);
        }
    }

    /// What each cause gains beside the others ([`on_other_periods`]).
    pub fn gains(&self) -> Vec<Option<f64>> {
        let entries: Vec<&Entry> = self.causes.iter().map(|cause| &cause.entry).collect();
        on_other_periods(self.study, &entries)
    }
}

/// Index of the most negative of the `gains`; `None` if none is negative.
fn most_harmful(gains: &[Option<f64>]) -> Option<usize> {
    let known = gains.iter().enumerate().filter_map(|(c, gain)| Some((c, (*gain)?)));
    let harmful = known.filter(|(_, gain)| *gain < 0.0);
    harmful.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(c, _)| c)
}

/// removed/explainable of every entry, at most 1. `None` for a single run, for fewer than [`LEAST_PERIODS`], for a
/// cause that does not repeat, and if nothing explainable stands out of the noise.
fn on_other_periods(study: &Study, entries: &[&Entry]) -> Vec<Option<f64>> {
    if !study.scene.periodic || study.scene.periods < LEAST_PERIODS {
        return vec![None; entries.len()];
    }
    let halves = [0, 1].map(|half| half_mean(study, half));
    let all = Model::new(study, entries);
    (0..entries.len())
        .map(|c| {
            let mut others = entries.to_vec();
            let cause = others.remove(c);
            if cause.images.iter().any(|image| !image.contrast.is_empty()) {
                return None;
            }
            let without = Model::new(study, &others);
            let (mut removed, mut explainable) = (0.0, 0.0);
            for (fitted, judged) in [(0, 1), (1, 0)] {
                let with = all.prediction(&halves[fitted].mean);
                let less = without.prediction(&halves[fitted].mean);
                let signal: Vec<f64> =
                    with.mean.iter().zip(&less.mean).map(|(a, b)| a - b).collect();
                let rows = strongest(&signal);
                let left = |prediction: &Image, model: &Model| -> f64 {
                    let y = &halves[judged].mean.mean;
                    let square: f64 =
                        rows.iter().map(|&r| (y[r] - prediction.mean[r]).powi(2)).sum();
                    square
                        - rows.len() as f64 * halves[judged].variance
                        - model.trace(&rows) * halves[fitted].variance
                };
                let before = left(&less, &without);
                explainable += before;
                removed += before - left(&with, &all);
            }
            (explainable > 0.0).then(|| (removed / explainable).min(1.0))
        })
        .collect()
}

/// Span of a model: the null model, and the columns of the causes outside it.
struct Model<'a> {
    null: &'a Span,
    causes: Span,
}

impl<'a> Model<'a> {
    fn new(study: &'a Study, entries: &[&Entry]) -> Self {
        let mut causes = Span::default();
        for image in entries.iter().flat_map(|entry| &*entry.images) {
            causes.push(image);
        }
        Self { null: &study.null, causes }
    }

    /// The projection P y on the model.
    fn prediction(&self, y: &Image) -> Image {
        let mut prediction = self.null.inside(y);
        prediction.add(1.0, &self.causes.inside(y));
        prediction
    }

    /// Trace of P over `rows`.
    fn trace(&self, rows: &[usize]) -> f64 {
        let directions = self.null.directions().chain(self.causes.directions());
        directions.flat_map(|d| rows.iter().map(|&r| d.mean[r] * d.mean[r])).sum()
    }
}

/// The strongest rows of `signal`, which together contain [`WHERE_IT_ACTS`] of its square.
fn strongest(signal: &[f64]) -> Vec<usize> {
    let mut rows: Vec<usize> = (0..signal.len()).collect();
    rows.sort_by(|&a, &b| signal[b].abs().total_cmp(&signal[a].abs()));
    let all: f64 = signal.iter().map(|s| s * s).sum();
    let mut sum = 0.0;
    let enough = rows.iter().position(|&r| {
        sum += signal[r] * signal[r];
        sum >= WHERE_IT_ACTS * all
    });
    rows.truncate(enough.map_or(signal.len(), |last| last + 1));
    rows
}

/// Mean torque of one half of the periods.
struct Half {
    /// Whitened.
    mean: Image,
    /// Variance of its noise in every row.
    variance: f64,
}

/// The mean of the even (0) or odd (1) periods.
fn half_mean(study: &Study, half: usize) -> Half {
    let problem = &study.regression.problem;
    let (n, periods) = (problem.samples, problem.periods);
    let count = ((periods + 1 - half) / 2) as f64;
    let parts = problem.panels.iter().enumerate().map(|(j, panel)| {
        let mut mean = vec![0.0; n];
        for period in panel.y.chunks_exact(n).skip(half).step_by(2) {
            mean.iter_mut().zip(period).for_each(|(m, y)| *m += y / count);
        }
        (j, mean)
    });
    let mean = study.whitening.image(&Column { parts: parts.collect() });
    Half { mean, variance: periods as f64 / count }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_harmful_goes_first() {
        assert_eq!(most_harmful(&[Some(0.9), Some(-2e-4), None, Some(-0.1), Some(0.0)]), Some(3));
        assert_eq!(most_harmful(&[None, Some(0.0), Some(1.0)]), None);
    }
}
