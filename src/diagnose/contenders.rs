//! What could be a cause beside those that were kept: every family at its best shape, at every free site.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::candidates::ripple::strongest_orders;
use super::image::{Image, Span};
use super::kind::Kind;
use super::selection::{FINALISTS, Kept};
use super::significance::FAR_AHEAD;
use super::statistic::Score;
use super::study::Entry;

/// A cause can stand in for another one only if it explains at least this share of the other's square.
pub(super) const SHARED: f64 = 0.5;
/// Most causes of one family on one joint, where a family may occur more than once. Gears and motors have a few orders
/// of ripple; further ones are what another cause leaves.
const MOST_ALIKE: usize = 3;
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
    /// What it explains beside the causes that were there when it was scored: of a cause, at its last refinement.
    pub score: Score,
    /// Twice the log-evidence for it against no effect, beside the same causes.
    pub evidence: f64,
}

impl Contender {
    /// By evidence, the most first. Laws with the same columns differ by rounding, which decides nothing: they keep the
    /// order in which they were considered, at first that of the catalogue.
    pub(super) fn in_order(a: &Self, b: &Self) -> Ordering {
        let to_rounding = |c: &Self| (c.evidence / ROUNDING).round() + 0.0;
        to_rounding(b).total_cmp(&to_rounding(a))
    }
}

impl Kept<'_, '_> {
    /// Contenders that might take the place of cause `c`, best first.
    ///
    /// Along a single run, a contender with more evidence than the cause counts only if it explains the same part of
    /// the residual and would itself be significant there: more evidence in a few stretches of time does not make a
    /// rival.
    pub(super) fn rivals(&self, c: usize, others: &Span, residual: &Image) -> Vec<Contender> {
        let own = &self.causes[c].entry;
        let mut rivals = self.contenders(Some(c), others, residual);
        rivals.retain(|r| r.entry.place() != own.place());
        if !self.study.scene.periodic {
            let signal = self.study.span(own, others).inside(residual);
            let size = signal.square();
            let evidence = self.evidence_of(c, others, residual);
            let is_ahead = |r: &Contender| r.evidence > evidence;
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
        let mut best: Vec<(&Entry, Score)> = Vec::new();
        let is_other =
            |e: &&Entry| e.place() == entry.place() && e.shape.variant != entry.shape.variant;
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
    pub(super) fn at_its_best(
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
    pub(super) fn refine(&mut self, c: usize) {
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

    /// `entry` beside `others`, outside which the `residual` is; `None` if nothing of it lies outside them.
    pub(super) fn scored(
        &self,
        entry: &Entry,
        others: &Span,
        residual: &Image,
    ) -> Option<Contender> {
        let score = self.study.score(entry, others, residual)?;
        let evidence = self.evidence(entry, score);
        Some(Contender { entry: entry.clone(), score, evidence })
    }

    /// Cause `c` as it is now, beside `others`, outside which the `residual` is. Its own score is that of its last
    /// refinement: what was found, refined or dropped since changes it.
    pub(super) fn beside(&self, c: usize, others: &Span, residual: &Image) -> Option<Contender> {
        self.scored(&self.causes[c].entry, others, residual)
    }

    /// The evidence for [cause `c` as it is now](Self::beside).
    pub(super) fn evidence_of(&self, c: usize, others: &Span, residual: &Image) -> f64 {
        self.beside(c, others, residual).map_or(f64::NEG_INFINITY, |own| own.evidence)
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
            let place = entry.place();
            let is_taken =
                |(c, cause): &(usize, &Contender)| Some(*c) != open && cause.entry.place() == place;
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
            let same = |c: &&mut Contender| c.entry.place() == entry.place();
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
    pub(super) fn faint_behind(&self, c: usize) -> Option<Contender> {
        let (others, residual) = self.without(Some(c));
        let contender = |entry: &Entry| self.scored(entry, &others, &residual);
        let taken = |entry: &&Entry| self.causes.iter().any(|c| c.entry.place() == entry.place());
        let free = self.study.faint.iter().filter(|entry| !taken(entry));
        let best = free.filter_map(contender).min_by(Contender::in_order)?;
        (best.evidence > self.evidence_of(c, &others, &residual) + FAR_AHEAD).then_some(best)
    }

    /// Square of the part of `signal`, which lies outside `others`, that `contender` explains.
    pub(super) fn explains(&self, contender: &Contender, others: &Span, signal: &Image) -> f64 {
        self.study.span(&contender.entry, others).explained(signal)
    }
}
