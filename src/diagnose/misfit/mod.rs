//! Tests of the residual that is left after the last cause: is it noise, and if not, on what does it depend?
//!
//! Enters: the whitened equations of a log, the span of its causes, and the residual that they leave. Leaves: how well
//! noise alone explains that residual, and the curve that it follows if noise does not: what the laws of a joint leave
//! because they are not exact, or something unexplained, of one joint or of all of them together.

mod curves;
mod own_parameters;
mod together;

pub(super) use curves::SINCE_THE_START;

use std::ops::Range;

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

/// From this λ of its laws' error of form on, a joint is not asked whether it shows something together with others.
const NOTICEABLE: f64 = 10.0;

/// How well noise alone explains the residual that is left.
#[derive(Debug, Clone)]
pub struct LackOfFit {
    /// Probability that noise alone leaves a residual as large in any band of any joint.
    pub probability: f64,
    /// The joints that are looked at, beginning with the one that noise explains least well.
    joints: Vec<OfJoint>,
}

/// How well noise alone explains the residual of a joint, in the band that it explains least.
#[derive(Debug, Clone, Copy)]
struct OfJoint {
    /// Index of the joint, from 0 on.
    joint: usize,
    /// Probability that noise alone leaves as much in any band of any joint.
    probability: f64,
    /// Σ r² less its degrees of freedom: of the joint in all bands.
    excess: f64,
}

/// Tests whether noise alone explains the residual on the joints that are looked at; `None` for a single run.
///
/// Per joint and band, Σ r² divided by its degrees of freedom k is distributed as F(k, ν). Here k is the number of rows
/// less their share in the directions that the null model and `accepted` have fitted (the sum of the leverages), and less
/// the share of pauses that are left out, and ν
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
    let band_of = |joint: usize, band: Range<usize>| {
        let in_motion = 1.0 - study.scene.held_at_rest(joint).map_or(0.0, |held| held.share);
        let (mut square, mut freedom) = (0.0, 0.0);
        for row in band.clone().flat_map(|h| knowledge.rows(h, joint)) {
            square += residual.mean[row] * residual.mean[row];
            freedom += in_motion - fitted(row);
        }
        let freedom = freedom.max(1.0);
        let noise = knowledge.freedom_of_band(band, joint);
        let probability =
            FisherSnedecor::new(freedom, noise).map_or(1.0, |f| f.sf(square / freedom));
        OfJoint { joint, probability, excess: square - freedom }
    };
    let bands = || edges.windows(2).map(|edge| edge[0]..edge[1]).filter(|band| !band.is_empty());
    let looked_at = (0..study.scene.joints()).filter(|j| study.looks_at(Some(*j)));
    let by_probability = |a: &OfJoint, b: &OfJoint| a.probability.total_cmp(&b.probability);
    let worst = |joint: usize| {
        let all: Vec<OfJoint> = bands().map(|band| band_of(joint, band)).collect();
        let excess = all.iter().map(|of| of.excess).sum();
        all.into_iter().min_by(by_probability).map(|of| OfJoint { excess, ..of })
    };
    let mut joints: Vec<OfJoint> = looked_at.filter_map(worst).collect();
    let tests = (joints.len() * bands().count()) as f64;
    joints.iter_mut().for_each(|of| of.probability = (tests * of.probability).min(1.0));
    joints.sort_by(by_probability);
    let probability = joints.first()?.probability;
    Some(LackOfFit { probability, joints })
}

/// The edges in `first` that lie below `end`, the harmonic behind the last one with rows, followed by `end`.
fn band_edges(first: [usize; BANDS_HZ.len()], end: usize) -> Vec<usize> {
    first.into_iter().take_while(|edge| *edge < end).chain([end]).collect()
}

/// What is known of the joints when their residuals are looked at.
pub struct KnownOfJoints<'k, L, D> {
    /// Whether a law is named on a joint (0-based).
    pub has_law: L,
    /// Whether the periods of a joint (0-based) may differ for no reason that is known already.
    pub can_differ: D,
    /// λ that the laws of each joint may leave because they are not exact.
    pub form: &'k [f64],
}

/// What the causes leave.
#[derive(Debug)]
pub struct Left {
    /// An effect that is there but not explained.
    pub unexplained: Option<Unexplained>,
    /// What the laws of a joint leave because they are not exact.
    pub form_error: Option<Unexplained>,
}

impl Left {
    /// Both, but a joint that shows something unexplained has no mere error of form.
    fn of(unexplained: Option<Unexplained>, form_error: Option<Unexplained>) -> Self {
        let joint = unexplained.as_ref().map(|left| left.joint);
        let form_error = form_error.filter(|left| Some(left.joint) != joint);
        Self { unexplained, form_error }
    }

    /// See [`Unexplained::at_most`].
    pub(super) fn at_most(self, residual_nm: &[f64]) -> Self {
        let at_most = |left: Option<Unexplained>| left.map(|left| left.at_most(residual_nm));
        Self { unexplained: at_most(self.unexplained), form_error: at_most(self.form_error) }
    }
}

/// Finds the axis along which the residual is largest, by a curve of 10 knots in each quantity of each joint.
///
/// What is not explained is the curve with the most evidence among those that noise cannot explain, and that are more
/// than an error of form. If there is none, it is the best of the curves that noise cannot explain [`together()`] with
/// those of the other joints; and if there is none either, but noise cannot explain the lack of fit, the best curve of
/// the joint with that lack. Beside a law of a log that repeats, less is asked of these tests
/// ([`chance::UNEXPLAINED_BESIDE_A_LAW`]), and joints [with parameters of their own](with_own_parameters) are one more.
/// Along a single run a curve must also reduce the error in stretches of time that were left out of its fit, and on a
/// joint that has a law by more than approximate laws leave. A curve of friction over the whole log is tried only on
/// joints whose periods can differ.
pub fn left(
    study: &Study,
    accepted: &Span,
    residual: &Image,
    lack_of_fit: Option<&LackOfFit>,
    known: &KnownOfJoints<impl Fn(usize) -> bool, impl Fn(usize) -> bool>,
) -> Left {
    let around = |joint: usize| {
        let (has_law, can_differ) = ((known.has_law)(joint), (known.can_differ)(joint));
        Around { joint, has_law, can_differ }
    };
    let looked_at = (0..study.scene.joints()).filter(|j| study.looks_at(Some(*j)));
    let joints: Vec<Around> = looked_at.map(around).collect();
    let is_beside_a_law = study.scene.periodic && joints.iter().any(|joint| joint.has_law);
    let level =
        if is_beside_a_law { chance::UNEXPLAINED_BESIDE_A_LAW } else { chance::UNEXPLAINED };
    let curves = joints.par_iter().flat_map_iter(|joint| curves(study, accepted, residual, joint));
    let mut found: Vec<Curve> = curves.collect();
    let tests = found.len() as f64;
    found.sort_by(|a, b| a.evidence.total_cmp(&b.evidence));
    // The curve with the most evidence may still be noise, because curves with fewer knots pay a lower price.
    let is_clear = |curve: &Curve| curve.probability * tests < level;
    // Friction that changes as the log goes on is no form of what is the same in every period.
    let is_of_form = |curve: &Curve| curve.repeats && curve.explained < known.form[curve.joint()];
    let mut form_error =
        found.iter().rfind(|c| is_clear(c) && is_of_form(c)).map(|c| c.unexplained.clone());
    if let Some(clear) = found.iter().rposition(|c| is_clear(c) && !is_of_form(c)) {
        return Left::of(Some(found.swap_remove(clear).unexplained), form_error);
    }
    let is_exact = |joint: usize| known.form[joint] < NOTICEABLE;
    // What is told by no curve is told of the mean period, to which only curves that repeat can belong.
    let best_of =
        |joint: usize| found.iter().rposition(|curve| curve.repeats && curve.joint() == joint);
    let of_all = together(study, residual, &found, is_exact, level).or_else(|| {
        let exact: Vec<usize> =
            joints.iter().map(|around| around.joint).filter(|j| is_exact(*j)).collect();
        let test = || with_own_parameters(study, accepted, residual, &exact, level);
        is_beside_a_law.then(test).flatten().and_then(best_of)
    });
    if let Some(largest) = of_all {
        let unexplained = found.swap_remove(largest).unexplained;
        return Left::of(Some(Unexplained { of_all_joints: true, ..unexplained }), form_error);
    }
    let mut unexplained = None;
    let lacks = lack_of_fit.into_iter().flat_map(|lack| &lack.joints);
    for lack in lacks.filter(|lack| lack.probability < level) {
        let best = || best_of(lack.joint).map(|curve| found[curve].unexplained.clone());
        if lack.excess < known.form[lack.joint] {
            form_error = form_error.or_else(best);
        } else if unexplained.is_none() {
            unexplained = best();
        }
    }
    Left::of(unexplained, form_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_is_told_once() {
        let on = |joint| Unexplained {
            axis: "angle",
            unit: "rad",
            joint,
            of_all_joints: false,
            rms_nm: 0.1,
            curve: Vec::new(),
        };
        let left = |joint| Left::of(Some(on(2)), Some(on(joint)));
        assert!(left(2).form_error.is_none());
        assert_eq!(left(3).form_error, Some(on(3)));
    }

    /// In periods of 10 s the rows end beyond 20 Hz, within a band, and at an edge.
    #[test]
    fn bands_reach_to_the_last_row() {
        let first = [0, 20, 50, 100, 200];
        assert_eq!(band_edges(first, 600), [0, 20, 50, 100, 200, 600]);
        assert_eq!(band_edges(first, 80), [0, 20, 50, 80]);
        assert_eq!(band_edges(first, 100), [0, 20, 50, 100]);
    }
}
