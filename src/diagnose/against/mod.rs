//! Comparison of a log with a given simulation: which of its parameters moved, and which physical changes moved them.
//!
//! Nothing is fitted first: the residual is y − X θ_sim, and a change explains its own torque in it ([`changes`]).
//! Effects that any fit would absorb stand out here. Where the simulation was identified from a log, θ_sim has the
//! covariance C of that identification; X C Xᵀ is then noise of the residual, like the noise of the log itself.
//!
//! Enters: the study of a log, the base parameters of the simulation, and the effects that were found without it.
//! Leaves: the changes that explain the difference, as causes, and which parameters moved by how much.

mod changes;
mod search;

use changes::Change;
use nalgebra::DMatrix;
use search::{Beside, Search, Unknown, nuisance, places};

use super::extension::Effect;
use super::image::Span;
use super::intervals::Base;
use super::kind::Kind;
use super::scene::Scene;
use super::statistic::upper_fisher;
use super::study::{Entry, Study};
use super::verdict::{BaseParameter, Cause, Moved, MovedTogether};
use crate::base::BaseSet;
use crate::identify::covariance::squared_distance;
use crate::robot::{Arm, JointSignals};

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
/// `study` knows; `None` for a single run. A parameter whose column the causes absorb is left out.
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
    let known: Vec<usize> =
        (0..parameters.len()).filter(|k| covariance[(*k, *k)].is_finite()).collect();
    if known.is_empty() {
        return None;
    }
    let difference = known.iter().map(|k| parameters[*k].value - simulation.theta[*k]);
    let covariance = covariance.select_rows(&known).select_columns(&known);
    let squared_distance = squared_distance(&covariance, &difference.collect::<Vec<_>>())?;
    let count = known.len();
    let noise = simulation.noise_beside(base);
    let inverse = known.iter().map(|k| 1.0 / noise[*k].1);
    let freedom = count as f64 / inverse.sum::<f64>();
    let p_value = upper_fisher(squared_distance / count as f64, count, freedom);
    Some(MovedTogether { squared_distance, degrees_of_freedom: [count as f64, freedom], p_value })
}

/// An effect that was found beside the null model.
pub struct AcceptedEffect<'a> {
    /// The law, at its best shape.
    pub entry: &'a Entry,
    /// Its numbers.
    pub effect: &'a Effect,
    /// Laws that the data cannot distinguish from it.
    pub alike: Vec<&'a Entry>,
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
    accepted: &[AcceptedEffect],
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
    let is_beside = |found: &&AcceptedEffect| !is_change(found.entry);
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
    let prepared = &study.regression.prepared;
    let scene = |theta: &[f64]| Scene::new(arm, set, theta, prepared);
    let mut taken = search.select_at_size(theta, &scene);
    // An accepted effect may have been the part of a change that the null model could not absorb.
    while let Some(needless) = (0..beside.len()).find(|&e| !search.needs(e, &beside, &taken)) {
        let entry = beside.remove(needless).entry;
        judged.push((study.families[entry.family].kind(), entry.site.map(|j| j + 1)));
        search.nuisance = self::nuisance(study, &search.unknown, beside.iter());
        taken = search.select_at_size(theta, &scene);
    }
    let mut span = study.span_of_all(&beside.iter().map(|b| b.entry).collect::<Vec<_>>());
    let images = taken.iter().flat_map(|&c| &search.changes[c].images);
    for image in images.filter_map(|image| study.outside_null(image.clone())) {
        span.push(&image);
    }
    let causes = (0..taken.len()).map(|index| search.cause(&taken, index)).collect();
    Explained { causes, judged, span }
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
