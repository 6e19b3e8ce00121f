//! Tests of the residual that is left after the last cause: is it noise, and if not, on what does it depend?
//!
//! Enters: the whitened equations of a log, the span of its causes, and the residual that they leave. Leaves: how well
//! noise alone explains that residual, and the curve that it follows if noise does not.

mod curves;
mod own_parameters;
mod together;

pub(super) use curves::SINCE_THE_START;

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::chance;
use super::image::{Image, Span};
use super::statistic::Statistic;
use super::study::Study;
use super::verdict::Unexplained;
use curves::{Around, Curve, curves};
use own_parameters::with_own_parameters;
use together::together;

/// Lower edges, in Hz, of the bands in which the residual is compared with noise; the last band reaches to the highest
/// harmonic that has rows. Errors of friction and load show in the slow bands, those of gears and clocks in the fast
/// ones.
const BANDS_HZ: [f64; 5] = [0.0, 2.0, 5.0, 10.0, 20.0];

/// How well noise alone explains the residual that is left.
#[derive(Debug, Clone, Copy)]
pub struct LackOfFit {
    /// Probability that noise alone leaves a residual as large in any band of any joint.
    pub probability: f64,
    /// The joint (0-based) that noise explains least well.
    pub joint: usize,
}

/// Tests whether noise alone explains the residual on the joints that are looked at; `None` for a single run.
///
/// Per joint and band, Σ r² divided by its degrees of freedom k is distributed as F(k, ν). Here k is the number of rows
/// less their share in the directions that the null model and `accepted` have fitted (the sum of the leverages), and ν
/// the degrees of freedom with which the periods tell the noise power in the band. The smallest probability is
/// multiplied by the number of tests (Bonferroni).
pub fn lack_of_fit(study: &Study, accepted: &Span, residual: &Image) -> Option<LackOfFit> {
    let Statistic::Periods(knowledge) = &study.statistic else { return None };
    let harmonic = |hz: f64| (hz * study.scene.samples() as f64 / study.scene.rate_hz) as usize;
    let edges = band_edges(BANDS_HZ.map(harmonic), knowledge.harmonics());
    let fitted = |row: usize| -> f64 {
        let directions = study.null.directions().chain(accepted.directions());
        directions.map(|d| d.mean[row] * d.mean[row]).sum()
    };
    let (mut least, mut worst) = (1.0f64, 0);
    let mut tests = 0.0;
    for joint in (0..study.scene.joints()).filter(|j| study.looks_at(Some(*j))) {
        for band in edges.windows(2).filter(|band| band[0] < band[1]) {
            let (mut square, mut freedom) = (0.0, 0.0);
            for row in (band[0]..band[1]).flat_map(|h| knowledge.rows(h, joint)) {
                square += residual.mean[row] * residual.mean[row];
                freedom += 1.0 - fitted(row);
            }
            let freedom = freedom.max(1.0);
            let noise = knowledge.freedom_of_band(band[0]..band[1], joint);
            let chance =
                FisherSnedecor::new(freedom, noise).map_or(1.0, |f| f.sf(square / freedom));
            if chance < least {
                (least, worst) = (chance, joint);
            }
            tests += 1.0;
        }
    }
    (tests > 0.0).then(|| LackOfFit { probability: (tests * least).min(1.0), joint: worst })
}

/// The edges in `first` that lie below `end`, the harmonic behind the last one with rows, followed by `end`.
fn band_edges(first: [usize; BANDS_HZ.len()], end: usize) -> Vec<usize> {
    first.into_iter().take_while(|edge| *edge < end).chain([end]).collect()
}

/// Finds the axis along which the residual is largest, by a curve of 10 knots in each quantity of each joint.
///
/// Returns the curve with the most evidence among those that noise cannot explain. If there is none, it returns the best
/// of the curves that noise cannot explain [`together`] with those of the other joints; and if there is none either, but
/// noise cannot explain the lack of fit, the best curve of the joint with that lack. Beside a law of a log that repeats,
/// less is asked of these tests ([`chance::UNEXPLAINED_BESIDE_A_LAW`]), and joints
/// [with parameters of their own](with_own_parameters) are one more. Along a single run a curve must also reduce the
/// error in stretches of time that were left out of its fit, and on a joint that `has_law` by more than approximate laws
/// leave. A curve of friction over the whole log is tried only on joints whose periods `can_differ` for no reason that is
/// known already.
pub fn unexplained(
    study: &Study,
    accepted: &Span,
    residual: &Image,
    lack_of_fit: Option<LackOfFit>,
    has_law: impl Fn(usize) -> bool,
    can_differ: impl Fn(usize) -> bool,
) -> Option<Unexplained> {
    let joints: Vec<Around> = (0..study.scene.joints())
        .filter(|j| study.looks_at(Some(*j)))
        .map(|joint| Around { joint, has_law: has_law(joint), can_differ: can_differ(joint) })
        .collect();
    let is_beside_a_law = study.scene.periodic && joints.iter().any(|joint| joint.has_law);
    let level =
        if is_beside_a_law { chance::UNEXPLAINED_BESIDE_A_LAW } else { chance::UNEXPLAINED };
    let curves = joints.par_iter().flat_map_iter(|joint| curves(study, accepted, residual, joint));
    let mut found: Vec<Curve> = curves.collect();
    let tests = found.len() as f64;
    found.sort_by(|a, b| a.evidence.total_cmp(&b.evidence));
    // The curve with the most evidence may still be noise, because curves with fewer knots pay a lower price.
    if let Some(clear) = found.iter().rposition(|c| c.probability * tests < level) {
        return Some(found.swap_remove(clear).unexplained);
    }
    // What is told by no curve is told of the mean period, to which only curves that repeat can belong.
    let best_of = |joint: usize| {
        found.iter().rposition(|curve| curve.repeats && curve.unexplained.joint == joint + 1)
    };
    let beside_a_law =
        || is_beside_a_law.then(|| with_own_parameters(study, accepted, residual, level)).flatten();
    let of_all =
        together(study, residual, &found, level).or_else(|| beside_a_law().and_then(best_of));
    if let Some(largest) = of_all {
        let unexplained = found.swap_remove(largest).unexplained;
        return Some(Unexplained { of_all_joints: true, ..unexplained });
    }
    let lack = lack_of_fit.filter(|lack| lack.probability < level)?;
    best_of(lack.joint).map(|curve| found.swap_remove(curve).unexplained)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In periods of 10 s the rows end beyond 20 Hz, within a band, and at an edge.
    #[test]
    fn bands_reach_to_the_last_row() {
        let first = [0, 20, 50, 100, 200];
        assert_eq!(band_edges(first, 600), [0, 20, 50, 100, 200, 600]);
        assert_eq!(band_edges(first, 80), [0, 20, 50, 80]);
        assert_eq!(band_edges(first, 100), [0, 20, 50, 100]);
    }
}
