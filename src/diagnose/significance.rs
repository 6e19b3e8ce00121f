//! When a family's law counts as a cause: chance does not explain it, the evidence is for it, it is the family's own
//! law, and it is more than what the other causes leave because their laws are approximate.

use super::candidates::Shape;
use super::chance;
use super::contenders::Contender;
use super::image::{Image, Span};
use super::selection::Kept;
use super::study::{Entry, LEAST_GAIN};

/// A coefficient rules a law out as the family's own only if it still does so this many σ to either side.
const DOUBT: f64 = 2.0;
/// A family's law is accurate to this share of its own size: anything smaller on the same joint is no second cause.
/// (What is left without a name is compared with less, as nothing else explains it: see `form_error`.)
const FORM_ERROR: f64 = 0.05;
/// Least 2 ln of the odds for a cause: e to one.
pub const LEAST_EVIDENCE: f64 = 2.0;
/// 2 ln of the odds at which no doubt is left between two laws: twenty to one.
pub(super) const FAR_AHEAD: f64 = 6.0;

impl Kept<'_, '_> {
    /// Whether `contender` counts as a cause beside `others`.
    ///
    /// Chance must explain it in fewer than [`chance::LAW`] of logs without faults, all families, sites and shapes
    /// counted; the evidence must be for it; it must be its family's own law; and it must be more than what the causes
    /// found beside it may leave by the approximate form of their laws. Along a single run it also has to show in
    /// stretches of time that were left out of its fit.
    pub(super) fn is_significant(
        &self,
        contender: &Contender,
        others: &Span,
        residual: &Image,
    ) -> bool {
        let study = self.study;
        let site = contender.entry.site;
        let span = study.span(&contender.entry, others);
        // The score of a cause is that of its last refinement. What was exchanged or dropped since is not in it, and
        // need not be. A contender that is added is judged again once all causes that share a joint with it (in a log
        // that repeats: all causes) are refined beside it; along a single run, causes of other joints hardly change a
        // score. To score every cause anew would take the span of all others for each cause and contender, and would be
        // no truer: a score counts what a cause alone explains beside the others, while its error of form is a share of
        // all that its law does.
        let is_left_by = |(c, cause): (usize, &Contender)| {
            if cause.entry.place() == contender.entry.place() {
                return false;
            }
            let error = self.form_error(&cause.entry).powi(2);
            contender.score.lambda < error * cause.score.lambda
                && match (cause.entry.site, site) {
                    (Some(own), Some(j)) if own != j => {
                        span.explained(residual) < error * self.square_on(j, c)
                    }
                    _ => true,
                }
        };
        if self.causes.iter().enumerate().any(is_left_by) {
            return false;
        }
        let single = study.statistic.probability(&span, residual);
        contender.evidence > LEAST_EVIDENCE
            && single * study.tests(&contender.entry) < chance::LAW
            && self.is_its_own(&contender.entry, others, residual)
            && study.generalises(site, &span, residual, LEAST_GAIN)
    }

    /// Whether `contender` is needed beside all causes and `other`, which sits on another joint.
    pub(super) fn is_significant_beside(&self, contender: &Contender, other: &Contender) -> bool {
        let (site, other_site) = (contender.entry.site, other.entry.site);
        if site == other_site || site.is_none() || other_site.is_none() {
            return false;
        }
        let (mut others, _) = self.without(None);
        for image in &*other.entry.images {
            others.push(image);
        }
        let mut residual = self.study.residual.clone();
        others.residualise(&mut residual);
        let beside = self.scored(&contender.entry, &others, &residual);
        beside.is_some_and(|beside| self.is_significant(&beside, &others, &residual))
    }

    /// Whether `entry`, with its shape and fitted coefficients, is its family's own law
    /// ([`super::candidates::Candidate::is_its_own`]).
    ///
    /// Its first coefficient may take any value that noise leaves possible. The shape must also agree with the
    /// coefficient ([`super::candidates::Candidate::agreeing`]) for one such value, unless the shape that does agree
    /// explains as much. A law that holds a parameter twice could have any size by its coefficients alone; it is the
    /// family's own only if the data tell its shape from the smallest one: play of no width between flanks that give
    /// way is a soft gear.
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

    /// Whether `entry` explains hardly more than it would with the other `shape`.
    fn is_as_good(&self, entry: &Entry, shape: Shape, others: &Span, residual: &Image) -> bool {
        let study = self.study;
        let gain = |e: &Entry| study.score(e, others, residual).map(|score| score.gain);
        let other = study.entry(entry.family, entry.site, shape);
        match (gain(entry), other.as_ref().and_then(gain)) {
            (Some(own), Some(other)) => own - other < FAR_AHEAD,
            _ => false,
        }
    }

    /// 2 ln of the odds for the shape of `entry` against the smallest shape of its variant.
    fn ahead_of_smallest(&self, entry: &Entry, others: &Span, residual: &Image) -> f64 {
        let place = |e: &Entry| (e.family, e.site, e.shape.variant);
        let same = self.study.entries.iter().filter(|e| place(e) == place(entry));
        let smallest = same.min_by(|a, b| a.shape.value.total_cmp(&b.shape.value));
        let gain = |e: &Entry| self.study.score(e, others, residual).map(|score| score.gain);
        let of_smallest = smallest.and_then(gain).unwrap_or(0.0);
        gain(entry).unwrap_or(0.0) - of_smallest
    }

    /// The share of its own size to which the law of `entry` is accurate.
    fn form_error(&self, entry: &Entry) -> f64 {
        let study = self.study;
        study.families[entry.family].form_error(&study.scene, entry.shape).max(FORM_ERROR)
    }

    /// Square of what cause `c`, which sits on another joint, does to joint `j`. A cause that oscillates or reverses
    /// sharply jolts all joints, and an error in its law looks like a cause on them.
    fn square_on(&self, j: usize, c: usize) -> f64 {
        let (others, residual) = self.without(Some(c));
        let entry = &self.causes[c].entry;
        let b = self.study.span(entry, &others).solve(&residual);
        self.study.square_on(j, entry, &b)
    }
}
