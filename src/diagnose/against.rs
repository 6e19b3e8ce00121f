//! A log against a given simulation: which of its parameters moved, and which single physical change
//! moved them.
//!
//! Nothing is fitted first: the residual is y − X θ_sim, and a change of standard parameters δ explains
//! X K δ of it, K the map to base parameters. Effects that any fit would absorb — a body on the flange,
//! other friction, a wrong torque constant — stand out here.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::image::{Image, Span};
use super::kind::Kind;
use super::selection::FALSE_ALARM;
use super::study::Study;
use super::verdict::{Cause, Estimate, Moved, Rival};
use crate::base::BaseSet;
use crate::dynamics::{Parameter, ParameterLayout};
use crate::identify::Identification;

/// Changes at most.
const MOST_CHANGES: usize = 8;

/// A change that may have moved the parameters.
struct Change {
    kind: Kind,
    site: Option<usize>,
    images: Vec<Image>,
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

/// The changes that explain how the data differ from the simulation, largest first.
pub fn explain(study: &Study, set: &BaseSet, simulation: &[f64]) -> Vec<Cause> {
    let mut residual = study.torque.clone();
    for (column, theta) in study.null_columns.iter().zip(simulation) {
        residual.add(-theta, column);
    }
    let changes = changes(study, set, simulation);
    let tests = changes.len() as f64;
    let mut taken: Vec<usize> = Vec::new();
    let mut rivals: Vec<Vec<Rival>> = Vec::new();
    while taken.len() < MOST_CHANGES {
        let (others, rest) = outside(&changes, &taken, &residual);
        let mut open: Vec<(usize, f64, f64)> = (0..changes.len())
            .filter(|c| !taken.contains(c))
            .map(|c| {
                let span = own(&changes[c], &others);
                let gain = study.statistic.gain(&span, changes[c].site, &rest);
                let n = study.statistic.sample_count(changes[c].site, rest.mean.len());
                let price = span.len() as f64 * n.ln() + 2.0 * tests.ln();
                (c, gain - price, study.statistic.probability(&span, &rest))
            })
            .collect();
        open.sort_by(|a, b| b.1.total_cmp(&a.1));
        let Some(&(best, evidence, probability)) = open.first() else { break };
        if !(evidence > 0.0 && probability * tests < FALSE_ALARM) {
            break;
        }
        taken.push(best);
        let behind = open[1..].iter().take(5).map(|&(c, e, _)| Rival {
            kind: changes[c].kind,
            joint: changes[c].site.map(|j| j + 1),
            evidence_behind: evidence - e,
        });
        rivals.push(behind.collect());
    }
    taken
        .iter()
        .zip(rivals)
        .map(|(&c, rivals)| {
            let rest: Vec<usize> = taken.iter().copied().filter(|o| *o != c).collect();
            let (others, left) = outside(&changes, &rest, &residual);
            let span = own(&changes[c], &others);
            let b = span.solve(&left);
            let covariance = study.statistic.covariance(&span, &left);
            let half = study.statistic.quantile_95();
            Cause {
                kind: changes[c].kind,
                joint: changes[c].site.map(|j| j + 1),
                class: Vec::new(),
                confidence: 1.0,
                parameters: quantities(changes[c].kind, &b, &covariance, half),
                gain_fraction: None,
                separating_experiment: None,
                strength: study.statistic.gain(&span, changes[c].site, &left).max(0.0).sqrt(),
                in_words: in_words(changes[c].kind).to_owned(),
                rivals,
            }
        })
        .collect()
}

/// Span of the changes `taken`, and the residual outside it.
fn outside(changes: &[Change], taken: &[usize], residual: &Image) -> (Span, Image) {
    let mut span = Span::default();
    for image in taken.iter().flat_map(|&c| &changes[c].images) {
        span.push(image);
    }
    let mut rest = residual.clone();
    span.residualise(&mut rest);
    (span, rest)
}

fn own(change: &Change, others: &Span) -> Span {
    let mut span = Span::default();
    for image in &change.images {
        let mut image = image.clone();
        others.residualise(&mut image);
        span.push(&image);
    }
    span
}

fn changes(study: &Study, set: &BaseSet, simulation: &[f64]) -> Vec<Change> {
    let joints = study.scene.joints();
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
        images: (0..10).filter_map(|k| image(Parameter::Body(last, k))).collect(),
    }];
    for j in 0..joints {
        let images = [Parameter::Coulomb(j), Parameter::Viscous(j)].map(image);
        let images: Vec<Image> = images.into_iter().flatten().collect();
        out.push(Change { kind: Kind::FrictionChange, site: Some(j), images });
        let torque = study.torque_on(j, simulation);
        out.push(Change { kind: Kind::TorqueGain, site: Some(j), images: vec![torque] });
    }
    out
}

/// Σ b_k column_k; `None` if every b_k is zero.
fn combined(columns: &[Image], b: &[f64]) -> Option<Image> {
    let mut sum: Option<Image> = None;
    for (column, &b) in columns.iter().zip(b).filter(|(_, b)| **b != 0.0) {
        match &mut sum {
            Some(sum) => sum.add(b, column),
            None => {
                let mut first = column.clone();
                first.scale(b);
                sum = Some(first);
            }
        }
    }
    sum
}

fn in_words(kind: Kind) -> &'static str {
    match kind {
        Kind::Payload => "a body on the flange",
        Kind::FrictionChange => "friction that is not what the simulation assumes",
        _ => "a wrong torque constant",
    }
}

fn quantities(
    kind: Kind,
    b: &[f64],
    covariance: &DMatrix<f64>,
    half: f64,
) -> BTreeMap<&'static str, Estimate> {
    let estimate = |value: f64, gradient: &[f64], unit: &'static str| {
        let g = DVector::from_fn(b.len(), |k, _| gradient.get(k).copied().unwrap_or(0.0));
        let reach = half * (g.transpose() * covariance * &g)[(0, 0)].max(0.0).sqrt();
        Estimate { value, unit, ci95: [value - reach, value + reach] }
    };
    let unit_vector = |k: usize| {
        let mut g = vec![0.0; b.len()];
        g[k] = 1.0;
        g
    };
    match (kind, b.len()) {
        (Kind::Payload, 4..) => {
            let m = b[0];
            let names = ["com_x_m", "com_y_m", "com_z_m"];
            let com = names.iter().enumerate().map(|(axis, name)| {
                let mut g = unit_vector(axis + 1);
                g[axis + 1] = 1.0 / m;
                g[0] = -b[axis + 1] / (m * m);
                (*name, estimate(b[axis + 1] / m, &g, "m"))
            });
            std::iter::once(("mass_kg", estimate(m, &unit_vector(0), "kg"))).chain(com).collect()
        }
        (Kind::FrictionChange, 2) => [
            ("coulomb_nm", estimate(b[0], &unit_vector(0), "Nm")),
            ("viscous_nm_s_rad", estimate(b[1], &unit_vector(1), "Nm s/rad")),
        ]
        .into(),
        (Kind::TorqueGain, 1) => [("error_fraction", estimate(b[0], &unit_vector(0), ""))].into(),
        _ => BTreeMap::new(),
    }
}
