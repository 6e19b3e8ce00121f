//! Which families explain the residual: forward selection with refinement, exchange and removal.

use super::contenders::Contender;
use super::image::{Image, Span};
use super::significance::{FAR_AHEAD, LEAST_EVIDENCE};
use super::study::{Entry, Study};

/// Most causes: a log that needs more has another kind of problem.
const MOST_CAUSES: usize = 24;
/// Most rounds of exchanging the causes of a single run: two causes may replace each other for ever.
const EXCHANGES: usize = 3;
/// 2 ln of the odds by which a contender must be ahead of a cause to replace it. Without a margin, two that explain
/// much the same would take turns.
const CLEARLY_BETTER: f64 = 1.0;
/// Number of families whose shapes are refined before one is chosen.
pub(super) const FINALISTS: usize = 10;

/// The causes kept so far.
pub struct Kept<'s, 'a> {
    pub(super) study: &'s Study<'a>,
    pub(super) causes: Vec<Contender>,
    /// Whether causes of the arm as a whole are looked for.
    pub(super) with_common: bool,
}

/// Causes that were found together, and twice the log-evidence for all of them against none.
pub struct CauseSet {
    pub causes: Vec<Contender>,
    pub evidence: f64,
}

/// Adds families one by one as long as the data demand it; along a single run only on single joints.
///
/// A cause of the arm as a whole, which is found first because no cause of a single joint explains as much, may stand
/// in for a different effect that all joints have. Causes of single joints replace it where the evidence leaves no
/// doubt, unless they are of its own family, joint by joint.
pub fn select(study: &Study) -> CauseSet {
    let grown = |with_common: bool| {
        let mut kept = Kept { study, causes: Vec::new(), with_common };
        kept.grow();
        CauseSet { evidence: kept.total_evidence(), causes: kept.causes }
    };
    let found = grown(study.scene.periodic);
    if found.causes.iter().all(|cause| cause.entry.site.is_some()) {
        return found;
    }
    let of_joints = grown(false);
    let is_same = |common: &Contender| {
        let alike = of_joints.causes.iter().filter(|own| own.entry.family == common.entry.family);
        common.entry.site.is_none() && alike.count() > 1
    };
    if found.causes.iter().any(is_same) {
        return found;
    }
    if of_joints.evidence > found.evidence + FAR_AHEAD { of_joints } else { found }
}

impl<'s, 'a> Kept<'s, 'a> {
    /// The `causes` as they were found in this `study`.
    pub fn of(study: &'s Study<'a>, causes: Vec<Contender>) -> Self {
        Self { study, causes, with_common: true }
    }

    /// Takes `causes` found in another study of the same log (with loads from another estimate of the arm) over into
    /// `study`, and refines and scores them there.
    pub fn taken_over(study: &'s Study<'a>, causes: Vec<Contender>) -> Self {
        let again = causes.into_iter().filter_map(|cause| {
            let Entry { family, site, shape, .. } = cause.entry;
            Some(Contender { entry: study.entry(family, site, shape)?, ..cause })
        });
        let mut kept = Self { study, causes: again.collect(), with_common: true };
        for c in 0..kept.causes.len() {
            kept.refine(c);
        }
        kept
    }

    /// The causes of a single run: those `found` on single joints, then those of the arm as a whole beside them.
    ///
    /// If a cause of the whole arm shows up, all causes are also searched for together from the start, and the result
    /// with more evidence wins: one cause of all joints may explain more than any cause of one joint, and yet less than
    /// several of them.
    pub fn of_a_single_run(study: &'s Study<'a>, found: Vec<Contender>) -> Self {
        let mut kept = Self::taken_over(study, found);
        kept.grow();
        if kept.causes.iter().any(|c| c.entry.site.is_none()) {
            let mut together = Self { study, causes: Vec::new(), with_common: true };
            together.grow();
            if together.total_evidence() > kept.total_evidence() {
                kept = together;
            }
        }
        kept.exchange();
        // The arm was estimated anew since its causes were found. What a dropped one explained may have another cause.
        if !kept.drop_unneeded(|_| true).is_empty() {
            kept.grow();
        }
        kept
    }

    /// Adds families one by one as long as the data demand it.
    pub fn grow(&mut self) {
        let mut dropped: Vec<(usize, Option<usize>)> = Vec::new();
        // The limit counts rounds, not causes, because two causes may replace each other for ever.
        for _ in 0..MOST_CAUSES {
            let (others, residual) = self.without(None);
            // Where noise is correlated in time, the contender with the most evidence need not be the least likely by
            // chance.
            let contenders = self.contenders(None, &others, &residual);
            let significant = |c: &Contender| {
                !dropped.contains(&c.entry.place()) && self.is_significant(c, &others, &residual)
            };
            let finalists = &contenders[..FINALISTS.min(contenders.len())];
            // A contender that explains a joint best but is not its family's own law stands in for something unknown. A
            // contender far behind it is not that unknown, unless it is needed beside it. But a law of a single joint
            // is not ruled out by one of the whole arm, because several joints with a law each look like one of the
            // arm.
            let foreign: Vec<&Contender> = finalists
                .iter()
                .filter(|c| !self.is_its_own(&c.entry, &others, &residual))
                .collect();
            let is_behind = |c: &Contender| {
                let may_stand_for =
                    |f: &Contender| f.entry.site.is_some() || c.entry.site.is_none();
                foreign.iter().filter(|f| may_stand_for(f)).any(|f| {
                    f.evidence > c.evidence + FAR_AHEAD && !self.is_significant_beside(c, f)
                })
            };
            let Some(best) = finalists.iter().find(|c| significant(c) && !is_behind(c)).cloned()
            else {
                break;
            };
            let place = best.entry.place();
            self.causes.push(best);
            if !self.revise() {
                dropped.push(place);
            }
        }
    }

    /// 2 ln of the evidence for all causes together against none.
    pub(super) fn total_evidence(&self) -> f64 {
        let (span, _) = self.without(None);
        let price: f64 = self.causes.iter().map(|c| self.study.price(&c.entry)).sum();
        self.study.statistic.gain(&span, &self.study.residual) - price
    }

    /// Replaces causes by contenders that explain the log better beside all other causes, and grows again.
    ///
    /// A cause that was found early may have stood in for one that was found later, on any joint.
    fn exchange(&mut self) {
        for _ in 0..EXCHANGES {
            let mut exchanged = false;
            for c in 0..self.causes.len() {
                let (others, residual) = self.without(Some(c));
                let Some(best) = self.rivals(c, &others, &residual).into_iter().next() else {
                    continue;
                };
                if best.evidence > self.evidence_of(c, &others, &residual) + CLEARLY_BETTER {
                    self.causes[c] = best;
                    exchanged = true;
                }
            }
            if !exchanged {
                return;
            }
            for c in 0..self.causes.len() {
                self.refine(c);
            }
            self.drop_unneeded(|_| true);
            self.grow();
        }
    }

    /// The span of all causes but `left_out`, together with the shares that drives feed forward where a cause blurs
    /// reversals; and the residual outside that span.
    pub fn without(&self, left_out: Option<usize>) -> (Span, Image) {
        let study = self.study;
        let others = self.causes.iter().enumerate().filter(|(c, _)| Some(*c) != left_out);
        let entries: Vec<&Entry> = others.map(|(_, cause)| &cause.entry).collect();
        let span = study.span_of_all(&entries);
        let mut residual = self.study.residual.clone();
        span.residualise(&mut residual);
        (span, residual)
    }

    /// Refines all causes jointly, replaces those that another family explains better beside the newest one, and drops
    /// those that are no longer needed. Returns `false` if the newest cause was dropped.
    ///
    /// Along a single run, which has many causes, only those that share a joint with the newest are looked at; the
    /// others follow once all are found ([`Self::exchange`]).
    fn revise(&mut self) -> bool {
        let newest = self.causes.len() - 1;
        let new_site = self.causes[newest].entry.site;
        let shares_joint =
            |site: Option<usize>| site.is_none() || new_site.is_none() || site == new_site;
        let periodic = self.study.scene.periodic;
        let is_looked_at = |site| periodic || shares_joint(site);
        for _ in 0..2 {
            for c in 0..self.causes.len() {
                if is_looked_at(self.causes[c].entry.site) {
                    self.refine(c);
                }
            }
            let mut exchanged = false;
            for c in 0..self.causes.len().saturating_sub(1) {
                // Only a cause that shares a joint with the newest can have stood in for it.
                if !shares_joint(self.causes[c].entry.site) {
                    continue;
                }
                let (others, residual) = self.without(Some(c));
                let Some(best) = self.contenders(Some(c), &others, &residual).into_iter().next()
                else {
                    continue;
                };
                let current = self.evidence_of(c, &others, &residual);
                let margin = if self.study.is_faint(best.entry.place()) {
                    FAR_AHEAD
                } else {
                    CLEARLY_BETTER
                };
                if best.evidence > current + margin
                    && best.entry.place() != self.causes[c].entry.place()
                {
                    self.causes[c] = best;
                    exchanged = true;
                }
            }
            if let Some(faint) = self.faint_behind(newest) {
                self.causes[newest] = faint;
                exchanged = true;
            }
            if !exchanged {
                break;
            }
        }
        !self.drop_unneeded(is_looked_at).contains(&newest)
    }

    /// Drops causes at the sites `is_looked_at` that are not needed beside the others; returns their former indices.
    pub(super) fn drop_unneeded(
        &mut self,
        is_looked_at: impl Fn(Option<usize>) -> bool,
    ) -> Vec<usize> {
        let mut dropped = Vec::new();
        let mut c = 0;
        while c < self.causes.len() {
            let is_needed = |kept: &Self| {
                let (others, residual) = kept.without(Some(c));
                let beside = kept.beside(c, &others, &residual);
                beside.is_some_and(|own| kept.is_significant(&own, &others, &residual))
                    && kept.is_more_with(c)
            };
            if !is_looked_at(self.causes[c].entry.site) || is_needed(self) {
                c += 1;
            } else {
                self.causes.remove(c);
                dropped.push(c + dropped.len());
            }
        }
        dropped
    }

    /// Whether all causes together have more evidence with cause `c`, its price included, than without it. For the
    /// comparison the other causes on its joint are refined without it, because they may owe their shapes to it.
    fn is_more_with(&self, c: usize) -> bool {
        let site = self.causes[c].entry.site;
        let share_site = self.causes.iter().filter(|cause| cause.entry.site == site).count();
        if share_site == 1 || !self.study.scene.periodic {
            return true;
        }
        let mut without = Self { causes: self.causes.clone(), ..*self };
        without.causes.remove(c);
        without.refine_at(site);
        self.total_evidence() - without.total_evidence() > LEAST_EVIDENCE
    }
}
