//! Which families explain the residual: forward selection with refinement, exchange and removal.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::candidates::ripple::strongest_orders;
use super::image::{Image, Span};
use super::kind::Kind;
use super::significance::{FAR_AHEAD, LEAST_EVIDENCE};
use super::statistic::Score;
use super::study::{Entry, Study};

/// Most causes: a log that needs more has another kind of problem.
const MOST_CAUSES: usize = 24;
/// A cause can stand in for another one only if it explains at least this share of the other's square.
pub(super) const SHARED: f64 = 0.5;
/// Most rounds of exchanging the causes of a single run: two causes may replace each other for ever.
const EXCHANGES: usize = 3;
/// 2 ln of the odds by which a contender must be ahead of a cause to replace it. Without a margin, two that explain
/// much the same would take turns.
const CLEARLY_BETTER: f64 = 1.0;
/// Most causes of one family on one joint, where a family may occur more than once. Gears and motors have a few orders
/// of ripple; further ones are what another cause leaves.
const MOST_ALIKE: usize = 3;
/// Number of families whose shapes are refined before one is chosen.
pub(super) const FINALISTS: usize = 10;

/// Evidence, as 2 ln of the odds, that differs by less may as well be rounded differently.
const ROUNDING: f64 = 1e-6;

/// Another variant is refined only if, at its best starting shape, it explains at least this share of what the family
/// explains at the starting shape under consideration; otherwise it cannot be ahead between its starting shapes. For
/// scale: from a starting shape to the best one near it, Stribeck's curve gains 3 %.
const BETWEEN_SHAPES: f64 = 0.8;

/// A family that was considered at one site, at its best shape.
#[derive(Debug, Clone)]
pub struct Contender {
    /// Family, site, shape and columns.
    pub entry: Entry,
    /// What it explains.
    pub score: Score,
    /// Twice the log-evidence for it against no effect.
    pub evidence: f64,
}

impl Contender {
    /// By evidence, the most first. Laws with the same columns differ by rounding, which decides nothing: they keep the
    /// order in which they were considered, at first that of the catalogue.
    fn in_order(a: &Self, b: &Self) -> Ordering {
        let to_rounding = |c: &Self| (c.evidence / ROUNDING).round() + 0.0;
        to_rounding(b).total_cmp(&to_rounding(a))
    }
}

/// The causes kept so far.
pub struct Kept<'s, 'a> {
    pub(super) study: &'s Study<'a>,
    pub(super) causes: Vec<Contender>,
    /// Whether causes of the arm as a whole are looked for.
    with_common: bool,
}

/// The causes that were found, and twice the log-evidence for all of them together against none.
pub struct Found {
    pub causes: Vec<Contender>,
    pub evidence: f64,
}

/// Adds families one by one as long as the data demand it; along a single run only on single joints.
///
/// A cause of the arm as a whole, which is found first because no cause of a single joint explains as much, may stand
/// in for a different effect that all joints have. Causes of single joints replace it where the evidence leaves no
/// doubt, unless they are of its own family, joint by joint.
pub fn select(study: &Study) -> Found {
    let grown = |with_common: bool| {
        let mut kept = Kept { study, causes: Vec::new(), with_common };
        kept.grow();
        Found { evidence: kept.total_evidence(), causes: kept.causes }
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
                !dropped.contains(&(c.entry.family, c.entry.site))
                    && self.is_significant(c, &others, &residual)
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
            let place = (best.entry.family, best.entry.site);
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
                if best.evidence > self.causes[c].evidence + CLEARLY_BETTER {
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

    /// Contenders that might take the place of cause `c`, best first.
    ///
    /// Along a single run, a contender with more evidence than the cause counts only if it explains the same part of
    /// the residual and would itself be significant there: more evidence in a few stretches of time does not make a
    /// rival.
    pub(super) fn rivals(&self, c: usize, others: &Span, residual: &Image) -> Vec<Contender> {
        let Entry { family, site, .. } = self.causes[c].entry;
        let mut rivals = self.contenders(Some(c), others, residual);
        rivals.retain(|r| (r.entry.family, r.entry.site) != (family, site));
        if !self.study.scene.periodic {
            let signal = self.study.span(&self.causes[c].entry, others).inside(residual);
            let size = signal.square();
            let is_ahead = |r: &Contender| r.evidence > self.causes[c].evidence;
            rivals.retain(|r| {
                !is_ahead(r)
                    || self.explains(r, others, &signal) > SHARED * size
                        && self.is_significant(r, others, residual)
            });
        }
        rivals
    }

    /// The best starting shape of each other variant of the family of `entry`, those of `further` included, that gains
    /// more than `least`.
    pub(super) fn other_variants<'e>(
        &'e self,
        entry: &Entry,
        further: &'e [Entry],
        least: f64,
        others: &Span,
        residual: &Image,
    ) -> Vec<&'e Entry> {
        let study = self.study;
        let Entry { family, site, shape, .. } = *entry;
        let mut best: Vec<(&Entry, Score)> = Vec::new();
        let is_other =
            |e: &&Entry| (e.family, e.site) == (family, site) && e.shape.variant != shape.variant;
        for entry in study.entries.iter().chain(further).filter(is_other) {
            let Some(score) = study.score(entry, others, residual) else { continue };
            match best.iter_mut().find(|(b, _)| b.shape.variant == entry.shape.variant) {
                Some(old) if old.1.gain >= score.gain => {}
                Some(old) => *old = (entry, score),
                None => best.push((entry, score)),
            }
        }
        best.retain(|(_, score)| score.gain > least);
        best.into_iter().map(|(entry, _)| entry).collect()
    }

    /// The best variant and shape near `entry`, the variants of `further` included. A form that is the family's own
    /// ([`Self::is_its_own`]) is preferred to one that is not, unless the latter is far ahead: the narrowest curve of one
    /// law looks like a wider one of another.
    fn at_its_best(
        &self,
        entry: &Entry,
        further: &[Entry],
        others: &Span,
        residual: &Image,
    ) -> Option<Contender> {
        let start = self.study.score(entry, others, residual).map_or(0.0, |score| score.gain);
        let mut starts = vec![entry];
        starts.extend(self.other_variants(
            entry,
            further,
            BETWEEN_SHAPES * start,
            others,
            residual,
        ));
        let forms = self.study.refined(&starts, others, residual).into_iter();
        let contender = |(entry, score): (Entry, Score)| {
            let evidence = self.evidence(&entry, score);
            Contender { entry, score, evidence }
        };
        let mut forms: Vec<Contender> = forms.map(contender).collect();
        forms.sort_by(Contender::in_order);
        let best = forms.first()?.evidence;
        let near = forms.iter().take_while(|form| best - form.evidence < FAR_AHEAD).count();
        let is_own = |form: &Contender| near == 1 || self.is_its_own(&form.entry, others, residual);
        let place = forms[..near].iter().position(is_own).unwrap_or(0);
        Some(forms.swap_remove(place))
    }

    /// Refines cause `c` to its best variant and shape, given the other causes.
    fn refine(&mut self, c: usize) {
        let (others, residual) = self.without(Some(c));
        let current = self.best_start(&self.causes[c].entry, &others, &residual);
        let further = self.study.further_entries(current);
        if let Some(best) = self.at_its_best(current, &further, &others, &residual) {
            self.causes[c] = best;
        }
    }

    /// Refines all causes at `site` to their best variants and shapes.
    pub(super) fn refine_at(&mut self, site: Option<usize>) {
        for c in 0..self.causes.len() {
            if self.causes[c].entry.site == site {
                self.refine(c);
            }
        }
    }

    /// The best of `entry`'s own shape and the starting shapes of its variant. Causes of a repeatable family keep their
    /// own shape, and so do all causes of a motion that repeats.
    fn best_start<'e>(&'e self, entry: &'e Entry, others: &Span, residual: &Image) -> &'e Entry {
        let study = self.study;
        if study.scene.periodic || study.families[entry.family].is_repeatable() {
            return entry;
        }
        let score = |e: &Entry| {
            study.score(e, others, residual).map_or(f64::NEG_INFINITY, |score| score.gain)
        };
        let place = |e: &Entry| (e.family, e.site, e.shape.variant);
        let same = |e: &&Entry| place(e) == place(entry);
        let start = (entry, score(entry));
        let best = study.entries.iter().filter(same).map(|e| (e, score(e)));
        best.fold(start, |best, e| if e.1 > best.1 { e } else { best }).0
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

    /// 2 ln of the evidence for adding `entry`: its gain less its price.
    pub(super) fn evidence(&self, entry: &Entry, score: Score) -> f64 {
        score.gain - self.study.price(entry)
    }

    /// The best shape of every family at every free site, best first. `open` is the cause to be replaced, if any; its
    /// place counts as free.
    pub(super) fn contenders(
        &self,
        open: Option<usize>,
        others: &Span,
        residual: &Image,
    ) -> Vec<Contender> {
        let study = self.study;
        let orders = self.ripple_orders(residual);
        let open_site =
            open.and_then(|c| self.causes[c].entry.site).filter(|_| !study.scene.periodic);
        let left_out = |entry: &Entry| match entry.site {
            None => !self.with_common,
            // Along a single run, a cause on another joint cannot stand in for one of this joint.
            site => open_site.is_some() && site != open_site,
        };
        let taken = |entry: &Entry| {
            let place = (entry.family, entry.site);
            let is_taken = |(c, cause): &(usize, &Contender)| {
                Some(*c) != open && (cause.entry.family, cause.entry.site) == place
            };
            let law = &study.families[entry.family];
            let most = if law.is_repeatable() { MOST_ALIKE } else { 1 };
            let is_same = |(_, cause): &(usize, &Contender)| {
                !law.are_apart(&study.scene, entry.site, entry.shape, cause.entry.shape)
            };
            let there: Vec<(usize, &Contender)> =
                self.causes.iter().enumerate().filter(is_taken).collect();
            there.len() >= most || there.iter().any(is_same)
        };
        // An effect that all joints share is told from effects of single joints by majority. Beside a cause of the
        // whole arm, at most one joint may have a cause of the same family: if most joints had one, these would say in
        // many numbers that the remaining joints differ.
        let outvoted = |entry: &Entry| {
            let (mut single, mut common) = (0, 0);
            for (c, cause) in self.causes.iter().enumerate() {
                if Some(c) != open && cause.entry.family == entry.family {
                    *if cause.entry.site.is_some() { &mut single } else { &mut common } += 1;
                }
            }
            if entry.site.is_some() { common > 0 && single > 0 } else { single > 1 }
        };
        let mut best: Vec<Contender> = Vec::new();
        // What is faint takes part only as an alternative to a cause.
        let faint: &[Entry] = if open.is_some() { &study.faint } else { &[] };
        let scores: Vec<Option<Score>> = study
            .entries
            .par_iter()
            .chain(orders.par_iter())
            .chain(faint.par_iter())
            .map(|entry| {
                if left_out(entry) || taken(entry) || outvoted(entry) {
                    None
                } else {
                    study.score(entry, others, residual)
                }
            })
            .collect();
        for (entry, score) in study.entries.iter().chain(&orders).chain(faint).zip(scores) {
            let Some(score) = score else { continue };
            let evidence = self.evidence(entry, score);
            let same =
                |c: &&mut Contender| (c.entry.family, c.entry.site) == (entry.family, entry.site);
            match best.iter_mut().find(same) {
                Some(old) if old.evidence >= evidence => {}
                Some(old) => *old = Contender { entry: entry.clone(), score, evidence },
                None => best.push(Contender { entry: entry.clone(), score, evidence }),
            }
        }
        best.sort_by(Contender::in_order);
        let mut finalists = FINALISTS.min(best.len());
        if !study.scene.periodic {
            // Refining a shape does not double the evidence.
            let near = |c: &&Contender| c.evidence > 0.5 * best[0].evidence;
            finalists = best.iter().take(finalists).take_while(near).count();
        }
        let (head, tail) = best.split_at(finalists);
        let mut all: Vec<Contender> = head
            .par_iter()
            .with_max_len(1)
            .map(|contender| {
                let best = self.at_its_best(&contender.entry, &[], others, residual);
                best.unwrap_or_else(|| contender.clone())
            })
            .collect();
        all.extend_from_slice(tail);
        all.sort_by(Contender::in_order);
        all
    }

    /// Entries of ripple at the orders in which the residual has most power.
    fn ripple_orders(&self, residual: &Image) -> Vec<Entry> {
        let study = self.study;
        let Some(family) = study.families.iter().position(|f| f.kind() == Kind::Ripple) else {
            return Vec::new();
        };
        let Some(torque) = study.whitening.in_time(residual) else { return Vec::new() };
        (0..study.scene.joints())
            .into_par_iter()
            .filter(|j| study.looks_at(Some(*j)))
            .flat_map(|j| {
                let shapes = strongest_orders(&study.scene, j, torque.joint(j));
                shapes
                    .into_iter()
                    .filter_map(|s| study.entry(family, Some(j), s))
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    /// The law that is [`faint`](Study::faint) and explains more than cause `c`, far beyond doubt.
    fn faint_behind(&self, c: usize) -> Option<Contender> {
        let (others, residual) = self.without(Some(c));
        let contender = |entry: &Entry| {
            let score = self.study.score(entry, &others, &residual)?;
            let evidence = self.evidence(entry, score);
            Some(Contender { entry: entry.clone(), score, evidence })
        };
        let taken = |entry: &&Entry| self.causes.iter().any(|c| c.entry.place() == entry.place());
        let free = self.study.faint.iter().filter(|entry| !taken(entry));
        let best = free.filter_map(contender).min_by(Contender::in_order)?;
        (best.evidence > self.causes[c].evidence + FAR_AHEAD).then_some(best)
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
                let current = &self.causes[c];
                let margin = if self.study.is_faint(best.entry.place()) {
                    FAR_AHEAD
                } else {
                    CLEARLY_BETTER
                };
                if best.evidence > current.evidence + margin
                    && (best.entry.family, best.entry.site)
                        != (current.entry.family, current.entry.site)
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
                kept.is_significant(&kept.causes[c], &others, &residual) && kept.is_more_with(c)
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

    /// Square of the part of `signal`, which lies outside `others`, that `contender` explains.
    pub(super) fn explains(&self, contender: &Contender, others: &Span, signal: &Image) -> f64 {
        self.study.span(&contender.entry, others).explained(signal)
    }
}
