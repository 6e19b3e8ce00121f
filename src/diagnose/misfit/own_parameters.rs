//! The equations of the joints with base parameters of their own.

use super::curves::{clear_of, outside};
use super::together::joined;
use crate::diagnose::image::{Column, Image, Span};
use crate::diagnose::study::Study;

/// The one of `joints` (0-based) whose `residual` noise explains least if each of them may have base parameters of its
/// own, where noise explains what these parameters remove on all of them in less than the share `level` of logs.
///
/// Newton's third law makes the torques of all joints depend on the same parameters. An arm whose lengths, axes or
/// gains are not those of the model breaks that: what the load does to one joint is then not what it does to the
/// others. Which error it is remains open, but the columns of the regressor, joint by joint, follow all of them.
pub(super) fn with_own_parameters(
    study: &Study,
    accepted: &Span,
    residual: &Image,
    joints: &[usize],
    level: f64,
) -> Option<usize> {
    if joints.len() < 2 {
        return None;
    }
    let spans: Vec<Span> = joints.iter().map(|j| of_joint(study, accepted, *j)).collect();
    let probability = |span: &Span| study.statistic.probability(span, residual);
    let least = spans.iter().map(probability).enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
    (probability(&joined(spans.iter())) < level).then(|| joints[least.0])
}

/// The columns of the regressor in the equation of joint `j` alone, outside the null model and `accepted`.
fn of_joint(study: &Study, accepted: &Span, j: usize) -> Span {
    let problem = &study.regression.problem;
    let columns = problem.panels[j].x.chunks_exact(problem.samples);
    let raw: Vec<Image> =
        columns.map(|x| study.whitening.regression_image(&Column::on(j, x.to_vec()))).collect();
    clear_of(&raw, &outside(study, accepted, &raw))
}
