//! Comparison of a log with a given simulation: which of its parameters moved, and which physical changes moved them.
//!
//! Nothing is fitted first: the residual is y − X θ_sim, and a change explains its own torque in it ([`changes`]).
//! Effects that any fit would absorb stand out here. Where the simulation was identified from a log, θ_sim has the
//! covariance C of that identification; X C Xᵀ is then noise of the residual, like the noise of the log itself.
//!
//! Enters: the study of a log, the base parameters of the simulation, and the effects that were found without it.
//! Leaves: the changes that explain the difference, as causes, and which parameters moved by how much.

mod changes;

use std::collections::BTreeMap;

use changes::{Change, combined};
use nalgebra::DMatrix;

use super::chance;
use super::extension::Effect;
use super::image::{Image, Span};
use super::intervals::{Base, tangents};
use super::judgement::{TELLS_APART, probability_of_class};
use super::kind::Kind;
use super::scene::Scene;
use super::significance::LEAST_EVIDENCE;
use super::statistic::{Score, upper_fisher};
use super::study::{Entry, Study};
use super::verdict::{BaseParameter, Cause, Moved, MovedTogether, Rival};
use super::whitening::RepeatingNoise;
use crate::base::BaseSet;
use crate::identify::covariance::squared_distance;
use crate::robot::{Arm, JointSignals};

/// Largest tilt, zero or length at which a change is evaluated, rad or m.
const LARGEST: f64 = 0.5;
/// Maximum number of changes.
const MOST_CHANGES: usize = 8;
/// Rounds in which one change is added and others are removed; bounded because two may replace each other for ever.
const ROUNDS: usize = 2 * MOST_CHANGES;
/// Number of alternatives that are reported.
const RIVALS: usize = 5;
/// Difference between a parameter and a simulation, in σ of known noise, beyond which the parameter has moved: noise
/// exceeds it in one of 300 comparisons of fifty parameters.
pub const MOVED: f64 = 4.0;

/// The simulation that a log is compared with.
#[derive(Debug, Clone, Copy)]
pub struct Nominal<'a> {
    /// Base parameters of the simulation.
    pub theta: &'a [f64],
    /// Their covariance, where they were identified.
    pub covariance: Option<&'a DMatrix<f64>>,
    /// Degrees of freedom with which the covariance is known; infinite: many.
    pub freedom: f64,
    /// Caveat to be stated first, where the parameters were identified from a log that the model does not explain: a
    /// difference may then be an error of theirs, and no change is certain.
    pub doubt: Option<&'a str>,
}

impl<'a> Nominal<'a> {
    /// A simulation whose parameters are exact.
    pub fn certain(theta: &'a [f64]) -> Self {
        Self { theta, covariance: None, freedom: f64::INFINITY, doubt: None }
    }

    /// Variance of the difference between data and simulation for every base parameter, and its degrees of freedom.
    fn noise_beside(&self, base: &Base) -> Vec<(f64, f64)> {
        let data = base.parameters.iter().zip(&base.freedom).enumerate();
        data.map(|(k, (data, freedom))| self.with_noise((data.sigma.powi(2), *freedom), k))
            .collect()
    }

    /// Variance of the difference between data and simulation in parameter `k`, and its degrees of freedom
    /// (Satterthwaite 1946). `of_data` is the variance in the data, known with `freedom` degrees of freedom.
    fn with_noise(&self, (of_data, freedom): (f64, f64), k: usize) -> (f64, f64) {
        let own = self.covariance.map_or(0.0, |covariance| covariance[(k, k)]);
        let both = of_data + own;
        (both, both.powi(2) / (of_data.powi(2) / freedom + own.powi(2) / self.freedom))
    }
}

/// Every base parameter in the simulation and in the data, where it is estimated beside the causes that were found.
pub fn moved(simulation: Nominal, base: &Base) -> Vec<Moved> {
    let of_parameter = |((data, theta), (variance, freedom)): ((&BaseParameter, &f64), _)| {
        let (sigma, simulation) = (f64::sqrt(variance), *theta);
        let z = as_gaussian((data.value - simulation) / sigma, freedom);
        Moved { name: data.name.clone(), simulation, data: data.value, sigma, z }
    };
    let pairs = base.parameters.iter().zip(simulation.theta);
    pairs.zip(simulation.noise_beside(base)).map(of_parameter).collect()
}

/// The Gaussian deviate that is as improbable as Student's `t` with the given degrees of freedom. Up to 4 σ, it is
/// accurate to 1 % from five degrees of freedom on and to 6 % with two (Wallace 1959).
fn as_gaussian(t: f64, freedom: f64) -> f64 {
    let shrunk = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
    t.signum() * shrunk * (freedom * (t * t / freedom).ln_1p()).sqrt()
}

/// Distance of the data from a simulation in all `base` parameters together, for a periodic log, whose noise the
/// `study` knows; `None` for a single run.
///
/// Combinations of parameters are known far better than any single one. d²/b of b parameters is treated as F(b, ν),
/// with ν the harmonic mean of the degrees of freedom with which each σ is known.
pub fn moved_together(study: &Study, simulation: Nominal, base: &Base) -> Option<MovedTogether> {
    if !study.scene.periodic {
        return None;
    }
    let Base { parameters, covariance, .. } = base;
    let covariance = match simulation.covariance {
        Some(unknown) => covariance + unknown,
        None => covariance.clone(),
    };
    let difference =
        parameters.iter().zip(simulation.theta).map(|(data, theta)| data.value - theta);
    let squared_distance = squared_distance(&covariance, &difference.collect::<Vec<_>>())?;
    let count = parameters.len();
    let inverse = simulation.noise_beside(base).into_iter().map(|(_, freedom)| 1.0 / freedom);
    let freedom = count as f64 / inverse.sum::<f64>();
    let p_value = upper_fisher(squared_distance / count as f64, count, freedom);
    Some(MovedTogether { squared_distance, degrees_of_freedom: [count as f64, freedom], p_value })
}

/// An effect that was found beside the null model.
pub struct Found<'a> {
    /// The law, at its best shape.
    pub entry: &'a Entry,
    /// Its numbers.
    pub effect: &'a Effect,
    /// Laws that the data cannot distinguish from it.
    pub alike: Vec<&'a Entry>,
}

/// An effect and the room that it is given in the residual of a simulation: its columns, including the part that a fit
/// of the null model would absorb, which is most of them; the derivatives of these columns by its shape; and the
/// columns of laws that the data cannot distinguish from it. A law whose exponent is off by a tenth, or that is another
/// one of its class, is still not a change of the arm.
struct Beside<'a> {
    entry: &'a Entry,
    room: Vec<Image>,
}

impl<'a> Beside<'a> {
    fn new(study: &Study, found: &Found<'a>, unknown: &Unknown) -> Self {
        let mut room = tangents(study, found.effect);
        room.extend(found.alike.iter().flat_map(|entry| study.whole_images(entry)));
        Self { entry: found.entry, room: unknown.whitened(room) }
    }
}

/// Uncertainty of the simulation, as noise of its residual.
struct Unknown(Option<RepeatingNoise>);

impl Unknown {
    /// Uncertainty of a simulation whose base parameters have this `covariance`. The null model's columns times the
    /// root of the covariance are torques of standard deviation one.
    fn new(study: &Study, covariance: Option<&DMatrix<f64>>) -> Self {
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
    fn whiten(&self, images: &mut [Image]) {
        self.0.iter().for_each(|noise| noise.whiten(images));
    }

    /// [`Self::whiten`], by value.
    fn whitened(&self, mut images: Vec<Image>) -> Vec<Image> {
        self.whiten(&mut images);
        images
    }
}

/// How the data differ from a simulation.
pub struct Explained {
    /// The changes, in descending order of what they explain.
    pub causes: Vec<Cause>,
    /// Every change that was looked for, and every effect that proved unnecessary beside those found: kind and joint
    /// (1-based). Causes among them are judged here alone.
    pub judged: Vec<(Kind, Option<usize>)>,
    /// Span, outside the null model, of the changes and of the effects that are needed.
    pub span: Span,
}

/// Finds the changes that explain how the data differ from the simulation; `accepted` are the effects that were found
/// beside the null model, which with them predicts the torque `fitted_nm`.
pub fn explain(
    study: &Study,
    (arm, set): (&Arm, &BaseSet),
    simulation: Nominal,
    accepted: &[Found],
    fitted_nm: &JointSignals,
) -> Explained {
    let Nominal { theta, covariance, .. } = simulation;
    let unknown = Unknown::new(study, covariance);
    let mut residual = study.torque.clone();
    for (column, theta) in study.null_columns.iter().zip(theta) {
        residual.add(-theta, column);
    }
    unknown.whiten(std::slice::from_mut(&mut residual));
    let changes = changes::all(study, set, fitted_nm);
    let images = changes.iter().map(|change| unknown.whitened(change.images.clone())).collect();
    let is_change = |entry: &Entry| {
        let place = (study.families[entry.family].kind(), entry.site);
        changes.iter().any(|c| (c.kind, c.site) == place)
    };
    let is_beside = |found: &&Found| !is_change(found.entry);
    let mut beside: Vec<Beside> = accepted
        .iter()
        .filter(is_beside)
        .map(|found| Beside::new(study, found, &unknown))
        .collect();
    let place = |c: &Change| (c.kind, c.site.map(|j| j + 1));
    let mut judged: Vec<(Kind, Option<usize>)> = changes.iter().map(place).collect();
    let places = places(&changes);
    let nuisance = nuisance(study, &unknown, beside.iter());
    let mut search = Search { study, changes, images, places, unknown, nuisance, residual };
    let mut taken = search.select();
    if taken.iter().any(|c| search.changes[*c].secants.is_some()) {
        search.set_to_size(&taken, &Scene::new(arm, set, theta, &study.regression.prepared));
        taken = search.select();
    }
    // An accepted effect may have been the part of a change that the null model could not absorb.
    while let Some(needless) = (0..beside.len()).find(|&e| !search.needs(e, &beside, &taken)) {
        let entry = beside.remove(needless).entry;
        judged.push((study.families[entry.family].kind(), entry.site.map(|j| j + 1)));
        search.nuisance = self::nuisance(study, &search.unknown, beside.iter());
        taken = search.select();
    }
    let mut span = study.span_of_all(&beside.iter().map(|b| b.entry).collect::<Vec<_>>());
    let images = taken.iter().flat_map(|&c| &search.changes[c].images);
    for image in images.filter_map(|image| study.outside_null(image.clone())) {
        span.push(&image);
    }
    let causes = (0..taken.len()).map(|index| search.cause(&taken, index)).collect();
    Explained { causes, judged, span }
}

/// Nuisance columns of the residual of a simulation: the effects `beside` with their room, and how drives answer
/// friction, which no simulation says.
fn nuisance<'a>(
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

struct Search<'a> {
    study: &'a Study<'a>,
    changes: Vec<Change<'a>>,
    /// Columns of each change, whitened for the uncertainty of the simulation as well.
    images: Vec<Vec<Image>>,
    /// See [`places`].
    places: Vec<f64>,
    unknown: Unknown,
    nuisance: Span,
    residual: Image,
}

/// A change with 2 ln of the evidence for it, and the probability that chance explains as much.
struct Scored {
    change: usize,
    evidence: f64,
    probability: f64,
}

impl Search<'_> {
    /// Forward selection of changes; changes that a later one makes unnecessary are removed.
    fn select(&self) -> Vec<usize> {
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

    /// Replaces the columns of the changes `taken`, which are those of small changes of the identified arm, by those of
    /// their size in the `simulated` arm: the identified one has taken most of a change up already.
    fn set_to_size(&mut self, taken: &[usize], simulated: &Scene) {
        for (index, &c) in taken.iter().enumerate() {
            let Some(secants) = &self.changes[c].secants else { continue };
            let (others, left) = self.outside(&without(taken, index));
            let (span, places) = Span::telling(&others, &self.images[c]);
            let mut b = vec![0.0; self.images[c].len()];
            let told = span.solve(&left).into_iter().zip(places);
            for (value, (place, _)) in told.filter(|(_, (_, is_told))| *is_told) {
                b[place] = value.clamp(-LARGEST, LARGEST);
            }
            if let Some(images) = secants(simulated, &b) {
                self.images[c] = self.unknown.whitened(images.clone());
                self.changes[c].images = images;
            }
        }
    }

    /// Whether effect number `e` of those `beside` is worth its price beside the other effects and the changes `taken`.
    /// True where no change is taken, since the effect was found that way, and for each of several effects of a family
    /// at the same site, which are judged together.
    fn needs(&self, e: usize, beside: &[Beside], taken: &[usize]) -> bool {
        let study = self.study;
        let entry = beside[e].entry;
        let place = |entry: &Entry| (entry.family, entry.site);
        let alike = beside.iter().filter(|b| place(b.entry) == place(entry));
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
    fn cause(&self, taken: &[usize], index: usize) -> Cause {
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
            form: None,
            rivals: behind.collect(),
        }
    }
}

/// Number of kinds of changes times the number of sites of each change's kind. Chance and odds are shared evenly: first
/// between the kinds, then between the sites of each, as for laws ([`price`](super::price)).
fn places(changes: &[Change]) -> Vec<f64> {
    let mut sites: BTreeMap<Kind, usize> = BTreeMap::new();
    for change in changes {
        *sites.entry(change.kind).or_default() += 1;
    }
    changes.iter().map(|change| (sites.len() * sites[&change.kind]) as f64).collect()
}

fn without(taken: &[usize], index: usize) -> Vec<usize> {
    taken.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, c)| *c).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against an exact simulation, the degrees of freedom are those of the log. For two variances that are known
    /// equally well, they add up. Where a short log determines the larger variance, they are those of that log.
    #[test]
    fn degrees_of_freedom_are_those_of_both_logs() {
        let covariance = DMatrix::identity(1, 1) * 4.0;
        let of = |variance: f64, freedom: f64, nominal: Nominal| {
            nominal.with_noise((variance, freedom), 0)
        };
        assert_eq!(of(4.0, 20.0, Nominal::certain(&[0.0])), (4.0, 20.0));
        let identified = |freedom: f64| Nominal {
            covariance: Some(&covariance),
            freedom,
            ..Nominal::certain(&[0.0])
        };
        assert_eq!(of(4.0, 20.0, identified(20.0)), (8.0, 40.0));
        let (variance, freedom) = of(0.01, 400.0, identified(10.0));
        assert!((variance - 4.01).abs() < 1e-12 && (10.0..10.1).contains(&freedom), "{freedom}");
        let (_, freedom) = of(4.0, 20.0, identified(f64::INFINITY));
        assert_eq!(freedom, 80.0);
    }

    /// Quantiles of Student's t that are as improbable as 1, 2, 3 and 4 σ (SciPy 1.17, `stats.t.isf(stats.norm.sf(z),
    /// nu)`).
    #[test]
    fn few_degrees_of_freedom_make_large_deviations_usual() {
        for (freedom, within, quantiles) in [
            (2.0, 0.06, [1.3213, 4.5265, 19.2067, 125.6411]),
            (5.0, 0.015, [1.1105, 2.6486, 5.5071, 12.2814]),
            (20.0, 0.001, [1.0256, 2.133, 3.4222, 5.0355]),
        ] {
            for (z, t) in [1.0, 2.0, 3.0, 4.0].into_iter().zip(quantiles) {
                let found = as_gaussian(-t, freedom);
                assert!((found / -z - 1.0).abs() < within, "{found} {z} {freedom}");
            }
        }
    }
}
