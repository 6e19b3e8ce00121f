//! The search for the changes of a simulation that explain its difference from a log.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::super::chance;
use super::super::image::{Image, Span};
use super::super::intervals::tangents;
use super::super::judgement::{TELLS_APART, probability_of_class};
use super::super::kind::Kind;
use super::super::scene::Scene;
use super::super::significance::LEAST_EVIDENCE;
use super::super::statistic::Score;
use super::super::study::{Entry, Study};
use super::super::verdict::{Cause, Rival};
use super::super::whitening::RepeatingNoise;
use super::AcceptedEffect;
use super::changes::{Change, combined};

/// Largest tilt, zero or length at which a change is evaluated, rad or m.
const LARGEST: f64 = 0.5;
/// Rounds in which the changes are set to their size: each changes what the others are estimated to be.
const SIZING: usize = 2;
/// Maximum number of changes.
const MOST_CHANGES: usize = 8;
/// Rounds in which one change is added and others are removed; bounded because two may replace each other for ever.
const ROUNDS: usize = 2 * MOST_CHANGES;
/// Most selections after the changes were set to their size: they could take turns for ever.
const RESELECTIONS: usize = 3;
/// Number of alternatives that are reported.
const RIVALS: usize = 5;

/// An effect and the room that it is given in the residual of a simulation: its columns, including the part that a fit
/// of the null model would absorb, which is most of them; the derivatives of these columns by its shape; and the
/// columns of laws that the data cannot distinguish from it. A law whose exponent is off by a tenth, or that is another
/// one of its class, is still not a change of the arm.
pub(super) struct Beside<'a> {
    pub(super) entry: &'a Entry,
    room: Vec<Image>,
}

impl<'a> Beside<'a> {
    pub(super) fn new(study: &Study, found: &AcceptedEffect<'a>, unknown: &Unknown) -> Self {
        let mut room = tangents(study, found.effect);
        room.extend(found.alike.iter().flat_map(|entry| study.whole_images(entry)));
        Self { entry: found.entry, room: unknown.whitened(room) }
    }
}

/// Uncertainty of the simulation, as noise of its residual.
pub(super) struct Unknown(Option<RepeatingNoise>);

impl Unknown {
    /// Uncertainty of a simulation whose base parameters have this `covariance`. The null model's columns times the
    /// root of the covariance are torques of standard deviation one.
    pub(super) fn new(study: &Study, covariance: Option<&DMatrix<f64>>) -> Self {
        Self(covariance.map(|covariance| {
            let parts = covariance.clone().symmetric_eigen();
            // Rounding may make zero eigenvalues slightly negative.
            let roots = parts.eigenvalues.map(|variance| variance.max(0.0).sqrt());
            let torque = |(direction, root): (nalgebra::DVectorView<f64>, &f64)| {
                let coefficients: Vec<f64> = direction.iter().map(|d| root * d).collect();
                combined(&study.null_columns, &coefficients)
            };
            let columns = parts.eigenvectors.column_iter().zip(&roots);
            RepeatingNoise::new(&columns.map(torque).collect::<Vec<_>>())
        }))
    }

    /// Whitens `images` for this noise as well.
    pub(super) fn whiten(&self, images: &mut [Image]) {
        self.0.iter().for_each(|noise| noise.whiten(images));
    }

    /// [`Self::whiten`], by value.
    pub(super) fn whitened(&self, mut images: Vec<Image>) -> Vec<Image> {
        self.whiten(&mut images);
        images
    }
}

/// Nuisance columns of the residual of a simulation: the effects `beside` with their room, and how drives answer
/// friction, which no simulation says.
pub(super) fn nuisance<'a>(
    study: &Study,
    unknown: &Unknown,
    beside: impl Iterator<Item = &'a Beside<'a>>,
) -> Span {
    let mut span = Span::default();
    let mut entries = Vec::new();
    for Beside { entry, room } in beside {
        entries.push(*entry);
        for image in room {
            span.push(image);
        }
    }
    let answers = &study.null_columns[study.base_count()..];
    let of_drives = study.blurred_shares(&entries).chain(answers).cloned().collect();
    for image in unknown.whitened(of_drives) {
        span.push(&image);
    }
    span
}

pub(super) struct Search<'a> {
    pub(super) study: &'a Study<'a>,
    pub(super) changes: Vec<Change<'a>>,
    /// Columns of each change, whitened for the uncertainty of the simulation as well.
    pub(super) images: Vec<Vec<Image>>,
    /// See [`places`].
    pub(super) places: Vec<f64>,
    pub(super) unknown: Unknown,
    pub(super) nuisance: Span,
    pub(super) residual: Image,
}

/// A change with 2 ln of the evidence for it, and the probability that chance explains as much.
struct Scored {
    change: usize,
    evidence: f64,
    probability: f64,
}

impl Search<'_> {
    /// Forward selection of changes; changes that a later one makes unnecessary are removed.
    pub(super) fn select(&self) -> Vec<usize> {
        let significant =
            |s: &Scored| s.evidence > 0.0 && s.probability * self.places[s.change] < chance::CHANGE;
        let mut taken: Vec<usize> = Vec::new();
        for _ in 0..ROUNDS {
            if taken.len() == MOST_CHANGES {
                break;
            }
            let Some(best) = self.scored(&taken).into_iter().find(significant) else { break };
            taken.push(best.change);
            let mut c = 0;
            while c + 1 < taken.len() {
                let rest = without(&taken, c);
                let again = self.scored(&rest);
                let own = again.iter().find(|s| s.change == taken[c]);
                if own.is_some_and(significant) {
                    c += 1;
                } else {
                    taken.remove(c);
                }
            }
        }
        taken
    }

    /// Selects changes, sets them to their size, and selects again as long as others are taken then: their columns are
    /// still those of small changes.
    pub(super) fn select_at_size(
        &mut self,
        theta: &[f64],
        scene: &impl Fn(&[f64]) -> Scene,
    ) -> Vec<usize> {
        let mut taken = self.select();
        for _ in 0..RESELECTIONS {
            if taken.iter().all(|c| self.changes[*c].secants.is_none()) {
                break;
            }
            self.set_to_size(&taken, theta, scene);
            let again = self.select();
            if again == taken {
                break;
            }
            taken = again;
        }
        taken
    }

    /// Replaces the columns of the changes `taken`, which are those of small changes of the identified arm, by those of
    /// their size in the arm of the simulation with the base parameters `theta`: the identified one has taken most of a
    /// change up already. What the other changes add to the parameters counts: a zero that is off is felt the more, the
    /// more the flange carries. `scene` is the scene of an arm with given base parameters.
    fn set_to_size(&mut self, taken: &[usize], theta: &[f64], scene: &impl Fn(&[f64]) -> Scene) {
        for _ in 0..SIZING {
            for (index, &c) in taken.iter().enumerate() {
                let Some(secants) = &self.changes[c].secants else { continue };
                let mut theta = theta.to_vec();
                for (other, &o) in taken.iter().enumerate() {
                    for (b, base) in
                        self.coefficients(taken, other).iter().zip(&self.changes[o].base)
                    {
                        theta.iter_mut().zip(base).for_each(|(theta, base)| *theta += b * base);
                    }
                }
                let b = self.coefficients(taken, index);
                let b: Vec<f64> = b.iter().map(|b| b.clamp(-LARGEST, LARGEST)).collect();
                if let Some(images) = secants(&scene(&theta), &b) {
                    self.images[c] = self.unknown.whitened(images.clone());
                    self.changes[c].images = images;
                }
            }
        }
    }

    /// Coefficients of change `taken[index]` beside the others; zero where the data do not determine them.
    fn coefficients(&self, taken: &[usize], index: usize) -> Vec<f64> {
        let images = &self.images[taken[index]];
        let (others, left) = self.outside(&without(taken, index));
        let (span, places) = Span::telling(&others, images);
        let mut b = vec![0.0; images.len()];
        let told = span.solve(&left).into_iter().zip(places);
        for (value, (place, _)) in told.filter(|(_, (_, is_told))| *is_told) {
            b[place] = value;
        }
        b
    }

    /// Whether effect number `e` of those `beside` is worth its price beside the other effects and the changes `taken`.
    /// True where no change is taken, since the effect was found that way, and for each of several effects of a family
    /// at the same site, which are judged together.
    pub(super) fn needs(&self, e: usize, beside: &[Beside], taken: &[usize]) -> bool {
        let study = self.study;
        let entry = beside[e].entry;
        let alike = beside.iter().filter(|b| b.entry.place() == entry.place());
        if taken.is_empty() || alike.count() > 1 {
            return true;
        }
        let others = nuisance(study, &self.unknown, beside[..e].iter().chain(&beside[e + 1..]));
        let (others, rest) = self.outside_of(others, taken);
        let span = Span::outside(&others, &self.unknown.whitened(study.whole_images(entry)));
        let gain = study.statistic.gain(&span, &rest);
        let probability = study.statistic.probability(&span, &rest) * study.tests(entry);
        gain - study.price(entry) > LEAST_EVIDENCE && probability < chance::LAW
    }

    /// All changes that are not `taken`, best first.
    fn scored(&self, taken: &[usize]) -> Vec<Scored> {
        let study = self.study;
        let (others, rest) = self.outside(taken);
        let mut out: Vec<Scored> = (0..self.changes.len())
            .filter(|c| !taken.contains(c))
            .map(|c| {
                let site = self.changes[c].site;
                let span = Span::outside(&others, &self.images[c]);
                let price = study.statistic.coefficients_price(span.len(), site)
                    + 2.0 * self.places[c].ln();
                Scored {
                    change: c,
                    evidence: study.statistic.gain(&span, &rest) - price,
                    probability: study.statistic.probability(&span, &rest),
                }
            })
            .collect();
        out.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        out
    }

    /// Span of the changes `taken` and of the nuisance columns, and the residual outside it.
    fn outside(&self, taken: &[usize]) -> (Span, Image) {
        self.outside_of(self.nuisance.clone(), taken)
    }

    /// The same for the changes `taken` and a given `span`.
    fn outside_of(&self, mut span: Span, taken: &[usize]) -> (Span, Image) {
        for image in taken.iter().flat_map(|&c| &self.images[c]) {
            span.push(image);
        }
        let mut rest = self.residual.clone();
        span.residualise(&mut rest);
        (span, rest)
    }

    /// Change `taken[index]` as a cause with its numbers, the other changes given.
    pub(super) fn cause(&self, taken: &[usize], index: usize) -> Cause {
        let study = self.study;
        let change = &self.changes[taken[index]];
        let rest = without(taken, index);
        let (others, left) = self.outside(&rest);
        let (span, places) = Span::telling(&others, &self.images[taken[index]]);
        let b = span.solve(&left);
        let covariance = study.statistic.covariance(&span, &left);
        let scored = self.scored(&rest);
        let evidence = scored.iter().find(|s| s.change == taken[index]).map_or(0.0, |s| s.evidence);
        let quantile = study.statistic.quantile_95(&span, &left);
        // The part of the residual that the change explains.
        let signal = span.inside(&left);
        let size = signal.square();
        let Score { lambda, .. } = study.statistic.score(&span, &left, &span.coordinates(&left));
        let scale = lambda / size.max(f64::MIN_POSITIVE);
        let rivals: Vec<&Scored> = scored.iter().filter(|s| s.change != taken[index]).collect();
        let is_alike = |s: &&Scored| {
            let span = Span::outside(&others, &self.images[s.change]);
            scale * (size - span.explained(&signal)) < TELLS_APART
        };
        let alike: Vec<bool> = rivals.iter().map(is_alike).collect();
        let name = |(s, _): (&&Scored, &bool)| {
            let Change { kind, site, .. } = &self.changes[s.change];
            match site.filter(|_| *site != change.site) {
                Some(j) => format!("{kind}@{}", j + 1),
                None => kind.to_string(),
            }
        };
        let evidences: Vec<f64> = rivals.iter().map(|s| s.evidence).collect();
        let in_class = rivals.iter().zip(&alike).filter(|(_, alike)| **alike);
        let class: Vec<String> = in_class.map(name).collect();
        let behind = rivals.iter().take(RIVALS).map(|s| Rival {
            kind: self.changes[s.change].kind,
            joint: self.changes[s.change].site.map(|j| j + 1),
            evidence_behind: evidence - s.evidence,
        });
        let parameters = change.estimates((&b, &places), &covariance, quantile);
        Cause {
            kind: change.kind,
            joint: change.site.map(|j| j + 1),
            separating_experiment: (!class.is_empty()).then_some(change.separating_experiment),
            class,
            confidence: probability_of_class(evidence, &evidences, &alike),
            may_be_none: change.kind == Kind::Payload
                && parameters.get("mass_kg").is_some_and(|mass| mass.holds(0.0)),
            parameters,
            peak_joint: None,
            gain_fraction: None,
            strength: lambda.max(0.0).sqrt(),
            in_words: change.in_words.to_owned(),
            record_fault: None,
            form: None,
            rivals: behind.collect(),
        }
    }
}

/// Number of kinds of changes times the number of sites of each change's kind. Chance and odds are shared evenly: first
/// between the kinds, then between the sites of each, as for laws ([`price`](super::super::price)).
pub(super) fn places(changes: &[Change]) -> Vec<f64> {
    let mut sites: BTreeMap<Kind, usize> = BTreeMap::new();
    for change in changes {
        *sites.entry(change.kind).or_default() += 1;
    }
    changes.iter().map(|change| (sites.len() * sites[&change.kind]) as f64).collect()
}

fn without(taken: &[usize], index: usize) -> Vec<usize> {
    taken.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, c)| *c).collect()
}
