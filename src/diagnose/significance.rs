//! When a family's law counts as a cause: chance does not explain it, the evidence is for it, it is its family's own,
//! and it is more than what the other causes leave by the approximate form of their laws.

use super::candidates::Shape;
use super::chance;
use super::image::{Image, Span};
use super::selection::{Contender, Kept};
use super::study::{Entry, LEAST_GAIN};

/// A law is another's only if its coefficient is so by more than so many σ.
const DOUBT: f64 = 2.0;
/// A family's law is right to this share of its own size: what is smaller on the same joint is no second
/// cause.
const FORM_ERROR: f64 = 0.05;
/// 2 ln of the odds for a cause, at least: e to one.
pub const LEAST_EVIDENCE: f64 = 2.0;
/// 2 ln of the odds between two laws that leave no doubt: twenty to one.
pub(super) const FAR_AHEAD: f64 = 6.0;

impl Kept<'_, '_> {
    /// Whether chance explains `contender` in fewer logs without faults than [`chance::LAW`], all
    /// families, sites and shapes counted, the evidence is for it, and it is more than what the
    /// approximate form of the causes found beside it may leave. Along a single run it also has to show in
    /// stretches of time left out of its fit.
    pub(super) fn is_significant(
        &self,
        contender: &Contender,
        others: &Span,
        residual: &Image,
    ) -> bool {
        let study = self.study;
        let site = contender.entry.site;
        let is_left_by = |(c, cause): (usize, &Contender)| {
            if (cause.entry.family, cause.entry.site) == (contender.entry.family, site) {
                return false;
            }
            let error = self.form_error(&cause.entry).powi(2);
            let is_less = |square: f64| contender.score.lambda < error * square;
            is_less(cause.score.lambda)
                && match (cause.entry.site, site) {
                    (Some(own), Some(j)) if own != j => is_less(self.square_on(j, c)),
                    _ => true,
                }
        };
        if self.causes.iter().enumerate().any(is_left_by) {
            return false;
        }
        let span = study.span(&contender.entry, others);
        let single = study.statistic.probability(&span, residual);
        contender.evidence > LEAST_EVIDENCE
            && single * study.tests(&contender.entry) < chance::LAW
            && self.is_its_own(&contender.entry, others, residual)
            && study.generalises(site, &span, residual, LEAST_GAIN)
    }

    /// Whether `contender` is needed beside `other`, which is on another joint, and all causes.
    pub(super) fn is_significant_beside(&self, contender: &Contender, other: &Contender) -> bool {
        let (site, other_site) = (contender.entry.site, other.entry.site);
        if site == other_site || site.is_none() || other_site.is_none() {
            return false;
        }
        let (mut others, _) = self.without(None);
        for image in &other.entry.images {
            others.push(image);
        }
        let mut residual = self.study.residual.clone();
        others.residualise(&mut residual);
        let Some(score) = self.study.score(&contender.entry, &others, &residual) else {
            return false;
        };
        let evidence = self.evidence(&contender.entry, score);
        let beside = Contender { entry: contender.entry.clone(), score, evidence };
        self.is_significant(&beside, &others, &residual)
    }

    /// See [`super::candidates::Candidate::is_its_own`]; a coefficient counts as what is nearest to the law's own of
    /// all that noise leaves possible, and so does one with which the shape does not go
    /// ([`super::candidates::Candidate::agreeing`]) unless that which does explains as much. A law that holds a parameter
    /// twice, so that it could be of any size by its coefficients alone, is the family's own only where the data tell its
    /// shape from the smallest: play that is none but for flanks that give way is a soft gear.
    pub(super) fn is_its_own(&self, entry: &Entry, others: &Span, residual: &Image) -> bool {
        let study = self.study;
        let Entry { family, site, shape, .. } = *entry;
        if study.families[family].in_shape(shape).is_some()
            && self.ahead_of_smallest(entry, others, residual) < FAR_AHEAD
        {
            return false;
        }
        let span = study.span(entry, others);
        let b = span.solve(residual);
        let Some(&first) = b.first() else { return true };
        let sigma = study.statistic.covariance(&span, residual)[(0, 0)].max(0.0).sqrt();
        let law = &study.families[family];
        let some_doubt = |holds: &dyn Fn(&[f64]) -> bool| {
            let mut b = b.clone();
            [0.0, -DOUBT, DOUBT].into_iter().any(|doubt| {
                b[0] = first + doubt * sigma;
                holds(&b)
            })
        };
        some_doubt(&|b| law.is_its_own(&study.scene, site, shape, b))
            && (some_doubt(&|b| law.agreeing(shape, b) == shape)
                || self.is_as_good(entry, law.agreeing(shape, &b), others, residual))
    }

    /// Whether `entry` explains hardly more than it would with another `shape`.
    fn is_as_good(&self, entry: &Entry, shape: Shape, others: &Span, residual: &Image) -> bool {
        let study = self.study;
        let gain = |e: &Entry| study.score(e, others, residual).map(|score| score.gain);
        let other = study.entry(entry.family, entry.site, shape);
        match (gain(entry), other.as_ref().and_then(gain)) {
            (Some(own), Some(other)) => own - other < FAR_AHEAD,
            _ => false,
        }
    }

    /// 2 ln of the odds for the shape of `entry` against the smallest of its variant.
    fn ahead_of_smallest(&self, entry: &Entry, others: &Span, residual: &Image) -> f64 {
        let place = |e: &Entry| (e.family, e.site, e.shape.variant);
        let same = self.study.entries.iter().filter(|e| place(e) == place(entry));
        let smallest = same.min_by(|a, b| a.shape.value.total_cmp(&b.shape.value));
        let gain = |e: &Entry| self.study.score(e, others, residual).map(|score| score.gain);
        let of_smallest = smallest.and_then(gain).unwrap_or(0.0);
        gain(entry).unwrap_or(0.0) - of_smallest
    }

    /// The share of its own size to which the law of `entry` is right.
    fn form_error(&self, entry: &Entry) -> f64 {
        let study = self.study;
        study.families[entry.family].form_error(&study.scene, entry.shape).max(FORM_ERROR)
    }

    /// Square of what cause `c`, which sits on another joint, does to joint `j`: what swings or turns round sharply jolts
    /// all joints, and an error in how it does looks like a cause of theirs.
    fn square_on(&self, j: usize, c: usize) -> f64 {
        let (others, residual) = self.without(Some(c));
        let entry = &self.causes[c].entry;
        let b = self.study.span(entry, &others).solve(&residual);
        self.study.square_on(j, entry, &b)
    }
}
