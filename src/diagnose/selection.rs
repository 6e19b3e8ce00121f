//! Which families explain the residual: forward selection with refinement, exchange and removal.

use rayon::prelude::*;

use super::candidates::ripple::strongest_orders;
use super::extension::Effect;
use super::image::{Image, Span};
use super::kind::Kind;
use super::study::{Entry, Score, Study};

/// Chance that a log without faults is given a cause.
pub const FALSE_ALARM: f64 = 0.002;
/// A family's law is right to this share of its own size: what is smaller on the same joint is no second
/// cause.
const FORM_ERROR: f64 = 0.05;
/// 2 ln of the odds for a cause, at least: seven to one.
pub const LEAST_EVIDENCE: f64 = 4.0;
/// Causes at most: a log that needs more has another kind of problem.
const MOST_CAUSES: usize = 24;
/// Families whose shapes are refined before one is chosen.
const FINALISTS: usize = 10;
/// Two effects are told apart with 99.9 % confidence and 90 % power where λ(1 − cos²) exceeds
/// (z₀.₉₉₉ + z₀.₉)² = (3.09 + 1.28)².
pub const TELLS_APART: f64 = 19.0;

/// A family that was considered, at its best shape.
#[derive(Debug, Clone)]
pub struct Contender {
    /// Family, site, shape and columns.
    pub entry: Entry,
    /// What it explains.
    pub score: Score,
    /// Twice the log-evidence against no effect.
    pub evidence: f64,
}

/// A cause that was kept, and what else it might be.
#[derive(Debug, Clone)]
pub struct Selected {
    /// The cause.
    pub contender: Contender,
    /// Posterior probability of its class.
    pub confidence: f64,
    /// Others that the data cannot tell from it: family and site.
    pub class: Vec<(usize, Option<usize>)>,
    /// The others, best first.
    pub rivals: Vec<Contender>,
}

/// A cause in another form of its family.
pub struct Form {
    /// With its numbers.
    pub effect: Effect,
    /// 2 ln of the odds against it, prices aside.
    pub behind: f64,
}

/// The causes kept so far.
pub struct Kept<'s, 'a> {
    study: &'s Study<'a>,
    causes: Vec<Contender>,
}

/// Adds families one by one while the data ask for it.
pub fn select(study: &Study) -> Vec<Contender> {
    let mut kept = Kept { study, causes: Vec::new() };
    kept.grow();
    kept.causes
}

impl<'s, 'a> Kept<'s, 'a> {
    /// `causes` found in another study of the same log (its load estimated with another model),
    /// taken over into `study`, refined and judged.
    pub fn taken_over(study: &'s Study<'a>, causes: Vec<Contender>) -> Self {
        let again = causes.into_iter().filter_map(|cause| {
            let Entry { family, site, shape, .. } = cause.entry;
            Some(Contender { entry: study.entry(family, site, shape)?, ..cause })
        });
        let mut kept = Self { study, causes: again.collect() };
        for c in 0..kept.causes.len() {
            kept.refine(c);
        }
        kept
    }

    /// Adds families one by one while the data ask for it.
    pub fn grow(&mut self) {
        let mut dropped: Vec<(usize, Option<usize>)> = Vec::new();
        // Two causes may replace each other for ever: rounds are counted, not causes.
        for _ in 0..MOST_CAUSES {
            let (others, residual) = self.without(None);
            // Where noise has a memory, the most evidence and the least chance need not go together.
            let contenders = self.contenders(None, &others, &residual);
            let significant = |c: &Contender| {
                !dropped.contains(&(c.entry.family, c.entry.site))
                    && self.is_significant(c, &others, &residual)
            };
            let Some(best) = contenders.into_iter().take(FINALISTS).find(significant) else {
                break;
            };
            let place = (best.entry.family, best.entry.site);
            self.causes.push(best);
            if !self.settle() {
                dropped.push(place);
            }
        }
    }

    /// The causes, judged.
    pub fn selected(&self) -> Vec<Selected> {
        (0..self.causes.len()).map(|c| self.judged(c)).collect()
    }

    /// Cause `c` in its family's other variants, each at its best shape.
    pub fn other_forms(&self, c: usize) -> Vec<Form> {
        let (others, residual) = self.without(Some(c));
        let own = self.causes[c].score.gain;
        let variants = self.other_variants(c, &others, &residual).into_iter();
        let form = |(entry, score): (Entry, Score)| {
            let coefficients = self.study.span(&entry, &others).solve(&residual);
            let Entry { family, site, shape, .. } = entry;
            let effect = Effect { family, site, shape, coefficients, absorbed: Vec::new() };
            Form { effect, behind: (own - score.gain).max(0.0) }
        };
        variants.map(form).collect()
    }

    fn other_variants(&self, c: usize, others: &Span, residual: &Image) -> Vec<(Entry, Score)> {
        let study = self.study;
        let Entry { family, site, shape, .. } = self.causes[c].entry;
        let mut best: Vec<(&Entry, Score)> = Vec::new();
        let is_other =
            |e: &&Entry| (e.family, e.site) == (family, site) && e.shape.variant != shape.variant;
        for entry in study.entries.iter().filter(is_other) {
            let Some(score) = study.score(entry, others, residual) else { continue };
            match best.iter_mut().find(|(b, _)| b.shape.variant == entry.shape.variant) {
                Some(old) if old.1.gain >= score.gain => {}
                Some(old) => *old = (entry, score),
                None => best.push((entry, score)),
            }
        }
        best.into_par_iter().filter_map(|(e, _)| study.refined(e, others, residual)).collect()
    }

    /// The best variant and shape of cause `c`, the others given.
    fn refine(&mut self, c: usize) {
        let (others, residual) = self.without(Some(c));
        let current = &self.causes[c].entry;
        let own = self.study.refined(current, &others, &residual);
        let forms = self.other_variants(c, &others, &residual);
        let best = own.into_iter().chain(forms).max_by(|a, b| a.1.gain.total_cmp(&b.1.gain));
        if let Some((entry, score)) = best {
            let evidence = self.evidence(&entry, score);
            self.causes[c] = Contender { entry, score, evidence };
        }
    }

    /// Span of all causes but `left_out`, and the residual outside it.
    pub fn without(&self, left_out: Option<usize>) -> (Span, Image) {
        let mut span = Span::default();
        for (_, cause) in self.causes.iter().enumerate().filter(|(c, _)| Some(*c) != left_out) {
            for image in &cause.entry.images {
                span.push(image);
            }
        }
        let mut residual = self.study.residual.clone();
        span.residualise(&mut residual);
        (span, residual)
    }

    /// 2 ln of the evidence for adding `entry`: what it explains, less its price.
    fn evidence(&self, entry: &Entry, score: Score) -> f64 {
        score.gain - self.study.price(entry)
    }

    /// The best shape of every family at every site that is free (`open` is the cause to be replaced,
    /// if any), best first.
    fn contenders(&self, open: Option<usize>, others: &Span, residual: &Image) -> Vec<Contender> {
        let study = self.study;
        let orders = self.ripple_orders(residual);
        let taken = |entry: &Entry| {
            let place = (entry.family, entry.site);
            let is_taken = |c: &Contender| (c.entry.family, c.entry.site) == place;
            !study.families[entry.family].is_repeatable()
                && self
                    .causes
                    .iter()
                    .enumerate()
                    .any(|(c, cause)| Some(c) != open && is_taken(cause))
        };
        let mut best: Vec<Contender> = Vec::new();
        let scores: Vec<Option<Score>> = study
            .entries
            .par_iter()
            .chain(orders.par_iter())
            .map(|entry| if taken(entry) { None } else { study.score(entry, others, residual) })
            .collect();
        for (entry, score) in study.entries.iter().chain(&orders).zip(scores) {
            let Some(score) = score else { continue };
            let evidence = self.evidence(entry, score);
            let same =
                |c: &&mut Contender| (c.entry.family, c.entry.site) == (entry.family, entry.site);
            match best.iter_mut().find(same) {
                Some(old) if old.score.gain >= score.gain => {}
                Some(old) => *old = Contender { entry: entry.clone(), score, evidence },
                None => best.push(Contender { entry: entry.clone(), score, evidence }),
            }
        }
        best.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        let (head, tail) = best.split_at(FINALISTS.min(best.len()));
        let mut all: Vec<Contender> = head
            .par_iter()
            .map(|contender| match study.refined(&contender.entry, others, residual) {
                Some((entry, score)) => {
                    let evidence = self.evidence(&entry, score);
                    Contender { entry, score, evidence }
                }
                None => contender.clone(),
            })
            .collect();
        all.extend_from_slice(tail);
        all.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        all
    }

    /// Ripple at the orders in which the residual has most power.
    fn ripple_orders(&self, residual: &Image) -> Vec<Entry> {
        let study = self.study;
        let Some(family) = study.families.iter().position(|f| f.kind() == Kind::Ripple) else {
            return Vec::new();
        };
        let Some(torque) = study.whitening.in_time(residual) else { return Vec::new() };
        (0..study.scene.joints())
            .into_par_iter()
            .filter(|j| !study.left_out.contains(j))
            .flat_map(|j| {
                let shapes = strongest_orders(&study.scene, j, torque.joint(j));
                shapes
                    .into_iter()
                    .filter_map(|s| study.entry(family, Some(j), s))
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    /// Whether chance explains `contender` in fewer than one log without faults in 500, all
    /// families, sites and shapes counted, the evidence is for it, and it is more than what the
    /// approximate form of the causes found beside it may leave.
    fn is_significant(&self, contender: &Contender, others: &Span, residual: &Image) -> bool {
        let study = self.study;
        let site = contender.entry.site;
        let beside = self
            .causes
            .iter()
            .filter(|c| (c.entry.family, c.entry.site) != (contender.entry.family, site))
            .filter(|c| c.entry.site.is_none() || site.is_none() || c.entry.site == site)
            .map(|c| c.score.lambda)
            .fold(0.0, f64::max);
        if contender.score.lambda < FORM_ERROR * FORM_ERROR * beside {
            return false;
        }
        let span = study.span(&contender.entry, others);
        let single = study.statistic.probability(&span, residual);
        let tests = study.entries.len() as f64 + study.alternatives(&contender.entry);
        contender.evidence > LEAST_EVIDENCE
            && single * tests < FALSE_ALARM
            && study.statistic.generalises(&span, residual)
    }

    /// Refines all causes jointly, exchanges those that another family now replaces, and drops those
    /// that are not needed any more. `false` if the newest cause was dropped.
    fn settle(&mut self) -> bool {
        let newest = self.causes.len() - 1;
        let new_site = self.causes[newest].entry.site;
        for _ in 0..2 {
            for c in 0..self.causes.len() {
                self.refine(c);
            }
            let mut exchanged = false;
            for c in 0..self.causes.len().saturating_sub(1) {
                // Only what shares a joint with the newest can have stood in for it.
                let site = self.causes[c].entry.site;
                if site.is_some() && new_site.is_some() && site != new_site {
                    continue;
                }
                let (others, residual) = self.without(Some(c));
                let Some(best) = self.contenders(Some(c), &others, &residual).into_iter().next()
                else {
                    continue;
                };
                let current = &self.causes[c];
                if best.evidence > current.evidence + 1.0
                    && (best.entry.family, best.entry.site)
                        != (current.entry.family, current.entry.site)
                {
                    self.causes[c] = best;
                    exchanged = true;
                }
            }
            if !exchanged {
                break;
            }
        }
        let mut newest_stays = true;
        let mut c = 0;
        let mut index = 0;
        while c < self.causes.len() {
            let (others, residual) = self.without(Some(c));
            let needed = self.is_significant(&self.causes[c].clone(), &others, &residual);
            if needed {
                c += 1;
            } else {
                self.causes.remove(c);
                newest_stays &= index != newest;
            }
            index += 1;
        }
        newest_stays
    }

    /// Confidence, class and rivals of cause `c`, the others given.
    fn judged(&self, c: usize) -> Selected {
        let study = self.study;
        let (others, residual) = self.without(Some(c));
        let contender = self.causes[c].clone();
        let own = study.span(&contender.entry, &others);
        // The signal of the cause as the data show it.
        let signal = own.inside(&residual);
        let size = signal.square();
        let identity = (contender.entry.family, contender.entry.site);
        let mut rivals = self.contenders(Some(c), &others, &residual);
        rivals.retain(|r| (r.entry.family, r.entry.site) != identity);
        let scale = contender.score.lambda / size.max(f64::MIN_POSITIVE);
        let is_alike = |rival: &Contender| {
            let explained = study.span(&rival.entry, &others).explained(&signal);
            scale * (size - explained) < TELLS_APART
        };
        let alike: Vec<bool> = rivals.iter().map(is_alike).collect();
        let in_class = rivals.iter().zip(&alike).filter(|(_, alike)| **alike);
        let class = in_class.map(|(rival, _)| (rival.entry.family, rival.entry.site)).collect();
        let evidences: Vec<f64> = rivals.iter().map(|r| r.evidence).collect();
        let confidence = probability_of_class(contender.evidence, &evidences, &alike);
        rivals.truncate(FINALISTS);
        Selected { contender, confidence, class, rivals }
    }
}

/// Posterior probability that a cause with `evidence` (2 ln, against no effect) or one of its class is there:
/// of its rivals with their `evidences` those that are `alike`. The others and no effect at all are what else
/// it may be.
pub fn probability_of_class(evidence: f64, evidences: &[f64], alike: &[bool]) -> f64 {
    let top = evidences.iter().copied().fold(evidence, f64::max).max(0.0);
    let weight = |evidence: f64| (0.5 * (evidence - top)).exp();
    let in_class = evidences.iter().zip(alike).filter(|(_, alike)| **alike);
    let own = weight(evidence) + in_class.map(|(e, _)| weight(*e)).sum::<f64>();
    own / (weight(0.0) + weight(evidence) + evidences.iter().map(|e| weight(*e)).sum::<f64>())
}
