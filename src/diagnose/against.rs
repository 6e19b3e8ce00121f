//! A log against a given simulation: which of its parameters moved, and which physical changes moved them.
//!
//! Nothing is fitted first: the residual is y − X θ_sim, and a change explains its own torque of it. A body
//! on the flange adds X K δ, δ its ten inertial parameters and K the map to base parameters; other friction
//! adds multiples of its columns; a wrong torque constant a share of the joint's torque; gravity, tilt and
//! length add what the inverse dynamics of the changed arm add. Effects that any fit would absorb stand out
//! here.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::candidates::{Candidate, Quantity, Shape};
use super::chance;
use super::image::{Column, Image, Span};
use super::judgement::{TELLS_APART, probability_of_class};
use super::kind::Kind;
use super::significance::LEAST_EVIDENCE;
use super::study::{Entry, Study};
use super::verdict::{Cause, Estimate, Moved, Rival};
use crate::base::BaseSet;
use crate::dynamics::{Parameter, ParameterLayout};
use crate::identify::Identification;
use crate::robot::{Arm, JointSignals};

/// Changes at most.
const MOST_CHANGES: usize = 8;
/// Rounds in which one is added and others are removed: two may replace each other for ever.
const ROUNDS: usize = 2 * MOST_CHANGES;
/// Alternatives that are reported.
const RIVALS: usize = 5;
/// Steps of the numerical derivatives: small against what matters, large against rounding.
const LENGTH_STEP_M: f64 = 1e-4;
const GRAVITY_STEP: f64 = 1e-4;

/// Physical parameters of coefficients, as far as the data tell these.
type Quantities<'a> = Box<dyn Fn(&[Option<f64>]) -> Vec<Quantity> + 'a>;

/// A change that may have moved the parameters.
struct Change<'a> {
    kind: Kind,
    site: Option<usize>,
    /// By coefficient; zero where it moves nothing.
    images: Vec<Image>,
    quantities: Quantities<'a>,
    in_words: &'static str,
}

/// Every base parameter in the simulation and in the data.
pub fn moved(set: &BaseSet, simulation: &[f64], identification: &Identification) -> Vec<Moved> {
    let sigma = identification.sigma();
    let theta = &identification.fit.theta;
    (0..set.rank())
        .map(|k| Moved {
            name: set.name(k).to_owned(),
            simulation: simulation[k],
            data: theta[k],
            sigma: sigma[k],
            z: (theta[k] - simulation[k]) / sigma[k],
        })
        .collect()
}

/// How the data differ from a simulation.
pub struct Explained {
    /// The changes, the one that explains most first.
    pub causes: Vec<Cause>,
    /// Every change that was looked for, and every effect that is needless beside those found: kind and joint from 1. What is
    /// one of them is judged here alone.
    pub judged: Vec<(Kind, Option<usize>)>,
    /// What the changes and the effects that are needed span outside the null model.
    pub span: Span,
}

/// The changes that explain how the data differ from the simulation. `accepted` are effects that were found
/// beside the null model.
pub fn explain(study: &Study, set: &BaseSet, simulation: &[f64], accepted: &[&Entry]) -> Explained {
    let mut residual = study.torque.clone();
    for (column, theta) in study.null_columns.iter().zip(simulation) {
        residual.add(-theta, column);
    }
    let changes = changes(study, set, simulation);
    let is_change = |entry: &Entry| {
        let place = (study.families[entry.family].kind(), entry.site);
        changes.iter().any(|c| (c.kind, c.site) == place)
    };
    let mut beside: Vec<&Entry> = accepted.iter().filter(|e| !is_change(e)).copied().collect();
    let place = |c: &Change| (c.kind, c.site.map(|j| j + 1));
    let mut judged: Vec<(Kind, Option<usize>)> = changes.iter().map(place).collect();
    let places = places(&changes);
    let nuisance = nuisance(study, &beside);
    let mut search = Search { study, changes, places, nuisance, residual };
    let mut taken = search.select();
    // What the null model could not absorb of a change may have been taken for an effect.
    while let Some(needless) = (0..beside.len()).find(|&e| !search.needs(e, &beside, &taken)) {
        let entry = beside.remove(needless);
        judged.push((study.families[entry.family].kind(), entry.site.map(|j| j + 1)));
        search.nuisance = self::nuisance(study, &beside);
        taken = search.select();
    }
    let mut span = study.span_of_all(&beside);
    let images = taken.iter().flat_map(|&c| &search.changes[c].images);
    for image in images.filter_map(|image| study.outside_null(image.clone())) {
        span.push(&image);
    }
    let causes = (0..taken.len()).map(|index| search.cause(&taken, index)).collect();
    Explained { causes, judged, span }
}

/// What the residual of a simulation holds beside changes: the effects `beside`, and how drives answer friction, which no
/// simulation says.
fn nuisance(study: &Study, beside: &[&Entry]) -> Span {
    let mut span = study.span_of_all(beside);
    for image in &study.null_columns[study.base_count()..] {
        span.push(image);
    }
    span
}

struct Search<'a> {
    study: &'a Study<'a>,
    changes: Vec<Change<'a>>,
    /// See [`places`].
    places: Vec<f64>,
    nuisance: Span,
    residual: Image,
}

/// A change with 2 ln of the evidence for it and the probability of as much by chance.
struct Scored {
    change: usize,
    evidence: f64,
    probability: f64,
}

impl Search<'_> {
    /// Forward selection, with removal of what a later change makes needless.
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

    /// Whether effect number `e` of those `beside` is worth its price beside the others and the changes `taken`; true where none
    /// is, which is how it was found, and of one of several of a family at its site, which are judged together.
    fn needs(&self, e: usize, beside: &[&Entry], taken: &[usize]) -> bool {
        let study = self.study;
        let entry = beside[e];
        let alike = beside.iter().filter(|b| (b.family, b.site) == (entry.family, entry.site));
        if taken.is_empty() || alike.count() > 1 {
            return true;
        }
        let others = nuisance(study, &[&beside[..e], &beside[e + 1..]].concat());
        let (others, rest) = self.outside_of(others, taken);
        let span = Span::outside(&others, &entry.images);
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
                let span = Span::outside(&others, &self.changes[c].images);
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

    /// Span of the changes `taken` and of what no simulation has, and the residual outside it.
    fn outside(&self, taken: &[usize]) -> (Span, Image) {
        self.outside_of(self.nuisance.clone(), taken)
    }

    /// The same of the changes `taken` and `span`.
    fn outside_of(&self, mut span: Span, taken: &[usize]) -> (Span, Image) {
        for image in taken.iter().flat_map(|&c| &self.changes[c].images) {
            span.push(image);
        }
        let mut rest = self.residual.clone();
        span.residualise(&mut rest);
        (span, rest)
    }

    /// Change `taken[index]` with its numbers, the others given.
    fn cause(&self, taken: &[usize], index: usize) -> Cause {
        let study = self.study;
        let change = &self.changes[taken[index]];
        let rest = without(taken, index);
        let (others, left) = self.outside(&rest);
        let (span, places) = Span::telling(&others, &change.images);
        let b = span.solve(&left);
        let covariance = study.statistic.covariance(&span, &left);
        let scored = self.scored(&rest);
        let evidence = scored.iter().find(|s| s.change == taken[index]).map_or(0.0, |s| s.evidence);
        let quantile = study.statistic.quantile_95(&span, &left);
        // The part of the residual that the change explains.
        let signal = span.inside(&left);
        let size = signal.square();
        let gain = study.statistic.gain(&span, &left);
        let scale = study.statistic.lambda(&span, &left, gain) / size.max(f64::MIN_POSITIVE);
        let rivals: Vec<&Scored> = scored.iter().filter(|s| s.change != taken[index]).collect();
        let is_alike = |s: &&Scored| {
            let span = Span::outside(&others, &self.changes[s.change].images);
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
        Cause {
            kind: change.kind,
            joint: change.site.map(|j| j + 1),
            separating_experiment: (!class.is_empty()).then(|| separating_experiment(change.kind)),
            class,
            confidence: probability_of_class(evidence, &evidences, &alike),
            parameters: estimates(change, (&b, &places), &covariance, quantile),
            gain_fraction: None,
            strength: study.statistic.lambda(&span, &left, gain).max(0.0).sqrt(),
            in_words: change.in_words.to_owned(),
            rivals: behind.collect(),
        }
    }
}

/// Kinds of changes times sites of the kind of each, between which chance and odds are shared evenly: first between the kinds,
/// then between the sites of each, as laws share theirs ([`price`](super::price)).
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

/// Everything that is looked for.
fn changes<'a>(study: &'a Study<'a>, set: &BaseSet, simulation: &[f64]) -> Vec<Change<'a>> {
    let scene = &study.scene;
    let joints = scene.joints();
    let layout = ParameterLayout::new(joints);
    let image = |parameter: Parameter| {
        let mut standard = vec![0.0; layout.count()];
        standard[layout.index(parameter)] = 1.0;
        combined(&study.null_columns, &set.values(&standard))
    };
    let last = joints - 1;
    let mut out = vec![Change {
        kind: Kind::Payload,
        site: None,
        images: (0..10).map(|k| image(Parameter::Body(last, k))).collect(),
        quantities: Box::new(payload),
        in_words: "a body on the flange",
    }];
    for j in 0..joints {
        out.push(Change {
            kind: Kind::FrictionChange,
            site: Some(j),
            images: [Parameter::Coulomb(j), Parameter::Viscous(j)].map(image).into(),
            quantities: Box::new(friction),
            in_words: "friction that is not what the simulation assumes",
        });
        out.push(Change {
            kind: Kind::TorqueGain,
            site: Some(j),
            images: vec![study.torque_on(j, simulation)],
            quantities: Box::new(|b| told("error_fraction", b[0], "")),
            in_words: "a wrong torque constant",
        });
        let length_m = scene.arm.joints[j].placement.translation_m.norm();
        if j > 0 && length_m > 0.0 {
            out.push(Change {
                kind: Kind::LinkLength,
                site: Some(j),
                images: vec![study.whitening.image(&longer(study, j))],
                quantities: Box::new(|b| told("error_m", b[0], "m")),
                in_words: "a link that is longer or shorter than drawn",
            });
        }
    }
    let gravity_m_s2 = scene.arm.gravity_m_s2.norm();
    if gravity_m_s2 > 0.0 {
        let heavier = with_arm(study, GRAVITY_STEP, |arm| arm.gravity_m_s2 *= 1.0 + GRAVITY_STEP);
        out.push(Change {
            kind: Kind::Gravity,
            site: None,
            images: vec![study.whitening.image(&heavier)],
            quantities: Box::new(move |b| {
                told("g_m_s2", b[0].map(|b| gravity_m_s2 * (1.0 + b)), "m/s²")
            }),
            in_words: "another gravity than the simulation's",
        });
    }
    for family in study.families {
        let wanted = [Kind::BaseTilt, Kind::EncoderOffset, Kind::CurrentOffset, Kind::Spring];
        if wanted.contains(&family.kind()) {
            out.extend(
                family
                    .sites(joints)
                    .into_iter()
                    .map(|site| of_family(study, family.as_ref(), site)),
            );
        }
    }
    out.retain(|c| study.looks_at(c.site) && c.images.iter().any(|i| i.square() > 0.0));
    out
}

/// A family of the catalogue, whose columns the null model may absorb here.
fn of_family<'a>(
    study: &'a Study<'a>,
    family: &'a dyn Candidate,
    site: Option<usize>,
) -> Change<'a> {
    let scene = &study.scene;
    let shapes = family.shapes(scene, site);
    let shape = shapes.first().copied().unwrap_or(Shape { variant: 0, value: 0.0 });
    let columns = family.columns(scene, site, shape);
    Change {
        kind: family.kind(),
        site,
        images: columns.iter().map(|c| study.whitening.image(c)).collect(),
        quantities: Box::new(move |b| of_told(b, |b| family.quantities(scene, site, shape, b))),
        in_words: family.in_words(),
    }
}

/// Torque per metre by which the way to joint `j`'s frame is longer, Nm/m.
fn longer(study: &Study, j: usize) -> Column {
    with_arm(study, LENGTH_STEP_M, |arm| {
        let way_m = &mut arm.joints[j].placement.translation_m;
        *way_m += way_m.normalize() * LENGTH_STEP_M;
    })
}

/// Torque per unit of a small `change` of the arm of size `step`.
fn with_arm(study: &Study, step: f64, change: impl Fn(&mut Arm)) -> Column {
    let mut arm = study.scene.arm.clone();
    change(&mut arm);
    let torque_nm: JointSignals = study.scene.torque_change(&arm, &study.scene.motion);
    Column::everywhere(&torque_nm).scaled(1.0 / step)
}

/// Σ b_k column_k.
fn combined(columns: &[Image], b: &[f64]) -> Image {
    let mut sum = columns.first().cloned().unwrap_or_default();
    sum.scale(0.0);
    for (column, &b) in columns.iter().zip(b).filter(|(_, b)| **b != 0.0) {
        sum.add(b, column);
    }
    sum
}

fn separating_experiment(kind: Kind) -> &'static str {
    match kind {
        Kind::Payload => "the same motion with the flange bare",
        Kind::FrictionChange => "the same motion after half an hour of work",
        Kind::TorqueGain => "a known payload: it scales every torque constant",
        Kind::LinkLength => "a measurement of the kinematics",
        Kind::Gravity => "a known payload, weighed at the same place",
        _ => "a level on the base, and the same motion with joint 1 turned by 180°",
    }
}

/// The quantity of a coefficient; none where the data do not tell that.
fn told(name: &'static str, value: Option<f64>, unit: &'static str) -> Vec<Quantity> {
    value.map(|value| Quantity { name, value, unit }).into_iter().collect()
}

/// A body by its mass and where that sits, or by its first moments where no mass is told.
fn payload(b: &[Option<f64>]) -> Vec<Quantity> {
    let (mass_kg, first_moment_kg_m) = (b[0], &b[1..4]);
    let names = match mass_kg {
        Some(_) => ["com_x_m", "com_y_m", "com_z_m"],
        None => ["moment_x_kg_m", "moment_y_kg_m", "moment_z_kg_m"],
    };
    let mut out = told("mass_kg", mass_kg, "kg");
    for (name, moment) in names.into_iter().zip(first_moment_kg_m) {
        out.extend(match mass_kg {
            Some(mass_kg) => told(name, moment.map(|moment| moment / mass_kg), "m"),
            None => told(name, *moment, "kg m"),
        });
    }
    out
}

fn friction(b: &[Option<f64>]) -> Vec<Quantity> {
    let both = [told("coulomb_nm", b[0], "Nm"), told("viscous_nm_s_rad", b[1], "Nm s/rad")];
    both.into_iter().flatten().collect()
}

/// The `quantities` of a family as far as its coefficients `b` are told.
fn of_told(b: &[Option<f64>], quantities: impl Fn(&[f64]) -> Vec<Quantity>) -> Vec<Quantity> {
    // What stands last goes with what stands before it where it is not told.
    let Some(last) = b.iter().rposition(Option::is_some) else { return Vec::new() };
    let b: Vec<f64> = b[..=last].iter().map(|b| b.unwrap_or(f64::NAN)).collect();
    quantities(&b).into_iter().filter(|quantity| !quantity.value.is_nan()).collect()
}

/// Quantities of the coefficients `b` with 95 % intervals by the delta method; of each its place in the change, and whether
/// it is told.
fn estimates(
    change: &Change,
    (b, places): (&[f64], &[(usize, bool)]),
    covariance: &DMatrix<f64>,
    half: f64,
) -> BTreeMap<&'static str, Estimate> {
    let quantities = |b: &[f64]| {
        let mut all = vec![None; change.images.len()];
        for (b, (place, is_told)) in b.iter().zip(places) {
            all[*place] = is_told.then_some(*b);
        }
        (change.quantities)(&all)
    };
    let centre = quantities(b);
    let mut gradients = vec![DVector::<f64>::zeros(b.len()); centre.len()];
    for k in 0..b.len() {
        let h = 1e-3 * covariance[(k, k)].max(0.0).sqrt().max(f64::MIN_POSITIVE);
        let at = |sign: f64| {
            let mut moved = b.to_vec();
            moved[k] += sign * h;
            quantities(&moved)
        };
        for (g, (up, down)) in gradients.iter_mut().zip(at(1.0).iter().zip(at(-1.0))) {
            g[k] = (up.value - down.value) / (2.0 * h);
        }
    }
    centre
        .iter()
        .zip(&gradients)
        .map(|(q, g)| {
            let reach = half * (g.transpose() * covariance * g)[(0, 0)].max(0.0).sqrt();
            let ci95 = [q.value - reach, q.value + reach];
            (q.name, Estimate { value: q.value, unit: q.unit, ci95 })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(quantities: Vec<Quantity>) -> Vec<(&'static str, f64)> {
        quantities.into_iter().map(|quantity| (quantity.name, quantity.value)).collect()
    }

    /// One joint feels moments across its axis alone, two parallel ones the mass as well.
    #[test]
    fn a_body_is_told_as_far_as_the_joints_feel_it() {
        let moments = payload(&[None, Some(0.2), Some(0.1), None]);
        assert_eq!(numbers(moments), [("moment_x_kg_m", 0.2), ("moment_y_kg_m", 0.1)]);
        let in_a_plane = payload(&[Some(2.0), Some(0.2), Some(0.5), None]);
        assert_eq!(numbers(in_a_plane), [("mass_kg", 2.0), ("com_x_m", 0.1), ("com_y_m", 0.25)]);
    }

    /// A tilt about an axis that the arm does not feel is not taken for the one that it feels.
    #[test]
    fn a_coefficient_keeps_its_place() {
        let tilt = |b: &[f64]| -> Vec<Quantity> {
            let names = ["tilt_x_rad", "tilt_y_rad"].into_iter().zip(b);
            names.map(|(name, b)| Quantity { name, value: *b, unit: "rad" }).collect()
        };
        assert_eq!(numbers(of_told(&[None, Some(0.3)], tilt)), [("tilt_y_rad", 0.3)]);
        assert_eq!(numbers(of_told(&[Some(0.3), None], tilt)), [("tilt_x_rad", 0.3)]);
        assert!(of_told(&[None, None], tilt).is_empty());
    }
}
