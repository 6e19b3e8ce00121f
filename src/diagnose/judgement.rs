//! Alternatives to a cause that was kept: its class, its rivals and other forms of its own law, and how certain its
//! name is.

use super::contenders::{Contender, SHARED};
use super::extension::Effect;
use super::image::{Image, Span};
use super::selection::{FINALISTS, Kept};
use super::statistic::Score;
use super::study::Entry;

/// Two effects are told apart with 99.9 % confidence and 90 % power where λ(1 − cos²) exceeds
/// (z₀.₉₉₉ + z₀.₉)² = (3.09 + 1.28)².
pub const TELLS_APART: f64 = 19.0;

/// Strength √λ below which a cause is faint. What a wrong or missing law leaves on one joint leaks into the laws of others
/// through the parameters of the arm: of 23 causes below that which something else outdid, in 3500 logs of the blind
/// benchmarks, none was right (by Clopper and Pearson 1934, fewer than one in eight is), and of 24 stronger ones two.
const OUTSHONE: f64 = 10.0;

/// A cause that was kept, with its alternatives.
#[derive(Debug, Clone)]
pub struct Selected {
    /// The cause.
    pub contender: Contender,
    /// Posterior probability of the class, the cause itself included.
    pub confidence: f64,
    /// Alternatives that the data cannot tell from the cause: family and site.
    pub class: Vec<(usize, Option<usize>)>,
    /// The best alternatives, best first, whether or not the data can tell them from the cause.
    pub rivals: Vec<Contender>,
    /// Share of the mean square that the cause removes in stretches of a single run that were left out of its fit.
    pub left_out_gain: Option<f64>,
}

impl Selected {
    /// Whether the cause is faint, and something else that is left is more likely than it and its class.
    pub fn is_outdone(&self) -> bool {
        self.confidence < 0.5 && self.contender.score.lambda < OUTSHONE * OUTSHONE
    }

    /// The rivals that the data cannot tell from the cause, at their best shapes.
    pub fn alike(&self) -> Vec<&Entry> {
        let in_class = |rival: &&Contender| self.class.contains(&rival.entry.place());
        self.rivals.iter().filter(in_class).map(|rival| &rival.entry).collect()
    }
}

/// A cause in another form of its family.
pub struct Form {
    /// The effect in this form, with its coefficients.
    pub effect: Effect,
    /// Twice the log-likelihood that this form lacks. Prices do not count, so that an interval also holds the values of
    /// a form with another coefficient that the log neither shows nor excludes.
    pub behind: f64,
}

impl Kept<'_, '_> {
    /// Drops causes that gain nothing on other periods ([`Self::drop_idle`]), and those of a motion that repeats which
    /// are [outdone](Selected::is_outdone), the least likely first. Returns those that stay, with their alternatives, and
    /// their gains.
    pub fn likely(&mut self) -> (Vec<Selected>, Vec<Option<f64>>) {
        loop {
            let gains = self.drop_idle();
            let selected = self.selected();
            let outdone = selected.iter().enumerate().filter(|(_, cause)| cause.is_outdone());
            let least = outdone.min_by(|a, b| a.1.confidence.total_cmp(&b.1.confidence));
            let Some((least, _)) = least.filter(|_| self.study.scene.periodic) else {
                return (selected, gains);
            };
            let site = self.causes.remove(least).entry.site;
            self.refine_at(site);
        }
    }

    /// All causes, each with its confidence, class and rivals.
    pub fn selected(&self) -> Vec<Selected> {
        (0..self.causes.len()).map(|c| self.judged(c)).collect()
    }

    /// Cause `c` in the other variants of its family, each at its best shape beside `others`, outside which the
    /// `residual` is.
    pub fn other_forms(&self, c: usize, (others, residual): (&Span, &Image)) -> Vec<Form> {
        let entry = &self.causes[c].entry;
        let own = self.study.score(entry, others, residual).map_or(0.0, |score| score.gain);
        let further = self.study.further_entries(entry);
        let least = f64::NEG_INFINITY;
        let variants = self.other_variants(entry, &further, least, others, residual);
        let variants = self.study.refined(&variants, others, residual);
        let form = |(entry, score): (Entry, Score)| {
            let coefficients = self.study.span(&entry, others).solve(residual);
            let behind = (own - score.gain).max(0.0);
            let Entry { family, site, shape, .. } = entry;
            let effect =
                Effect { family, site, shape, coefficients, off: Vec::new(), absorbed: Vec::new() };
            Form { effect, behind }
        };
        variants.into_iter().map(form).collect()
    }

    /// Confidence, class and rivals of cause `c`, given the other causes.
    fn judged(&self, c: usize) -> Selected {
        let study = self.study;
        let (others, residual) = self.without(Some(c));
        // What is found later changes the score of a cause; one that nothing is left of keeps that of its choice.
        let contender =
            self.beside(c, &others, &residual).unwrap_or_else(|| self.causes[c].clone());
        let own = study.span(&contender.entry, &others);
        // The signal of the cause as it appears in the data.
        let signal = own.inside(&residual);
        let size = signal.square();
        let mut rivals = self.rivals(c, &others, &residual);
        let scale = contender.score.lambda / size.max(f64::MIN_POSITIVE);
        let explained: Vec<f64> =
            rivals.iter().map(|rival| self.explains(rival, &others, &signal)).collect();
        // Along a single run, a cause may gain nothing as it is now, and then resembles no other.
        let is_alike = |explained: &f64| scale > 0.0 && scale * (size - explained) < TELLS_APART;
        let in_class = rivals.iter().zip(&explained).filter(|(_, explained)| is_alike(explained));
        let class = in_class.map(|(rival, _)| rival.entry.place()).collect();
        // Along a single run, another effect that is visible beside the cause is no reason to doubt it.
        let in_its_place = |explained: &f64| {
            study.scene.periodic || is_alike(explained) || *explained > SHARED * size
        };
        let (evidences, alike): (Vec<f64>, Vec<bool>) = rivals
            .iter()
            .zip(&explained)
            .filter(|(_, explained)| in_its_place(explained))
            .map(|(rival, explained)| (rival.evidence, is_alike(explained)))
            .unzip();
        let confidence = probability_of_class(contender.evidence, &evidences, &alike);
        rivals.truncate(FINALISTS);
        let left_out_gain = study.left_out_gain(contender.entry.site, &own, &residual);
        Selected { contender, confidence, class, rivals, left_out_gain }
    }
}

/// Posterior probability that a cause, or one of its class, is present. `evidence` is 2 ln of the odds for it against
/// no effect, `evidences` are those of its rivals, and `alike` marks the rivals in its class. The alternatives are the
/// other rivals and no effect at all.
pub fn probability_of_class(evidence: f64, evidences: &[f64], alike: &[bool]) -> f64 {
    let top = evidences.iter().copied().fold(evidence, f64::max).max(0.0);
    let weight = |evidence: f64| (0.5 * (evidence - top)).exp();
    let in_class = evidences.iter().zip(alike).filter(|(_, alike)| **alike);
    let own = weight(evidence) + in_class.map(|(e, _)| weight(*e)).sum::<f64>();
    own / (weight(0.0) + weight(evidence) + evidences.iter().map(|e| weight(*e)).sum::<f64>())
}
