//! Curves of all joints along one axis, taken together.

use super::curves::{Curve, clear_of};
use crate::diagnose::image::{Image, Span};
use crate::diagnose::statistic::{Statistic, upper_chi_squared};
use crate::diagnose::study::Study;

/// An axis is looked at if noise explains the curves of its joints in less than this share of logs, were they
/// independent. How their torques go together moves that probability by a factor, and what is looked for lies orders of
/// magnitude lower.
const SCREEN: f64 = 0.05;

/// The curves of the joints that are asked (`is_asked`), all along one axis, if noise explains what they remove
/// together in less than the share `level` of logs: of the axis that noise explains least, the index in `found` of the
/// curve with the most evidence. `None` for a single run, whose noise is not known.
///
/// What acts on the arm as a whole, like an error of its geometry, may leave less on each joint than a curve needs to
/// be clear. With the curves of all joints in one span, the residual's part in it is tested like that of a curve alone.
pub(super) fn together(
    study: &Study,
    residual: &Image,
    found: &[Curve],
    is_asked: impl Fn(usize) -> bool,
    level: f64,
) -> Option<usize> {
    let Statistic::Periods(_) = &study.statistic else { return None };
    let along = |axis: &'static str| {
        let of_axis = |curve: &Curve| curve.unexplained.axis == axis && is_asked(curve.joint());
        (0..found.len()).filter(|k| of_axis(&found[*k])).collect::<Vec<usize>>()
    };
    let mut axes: Vec<&'static str> = found.iter().map(|curve| curve.unexplained.axis).collect();
    axes.sort_unstable();
    axes.dedup();
    // A curve of one joint alone has been tested already.
    axes.retain(|axis| along(axis).len() > 1);
    let tests = axes.len() as f64;
    let probability = |axis: &'static str| {
        let along = along(axis);
        let curves = || along.iter().map(|k| &found[*k]);
        let count = curves().map(|curve| curve.span.len()).sum();
        let explained = curves().map(|curve| curve.explained).sum();
        if upper_chi_squared(explained, count) > SCREEN {
            return 1.0;
        }
        study.statistic.probability(&joined(curves().map(|curve| &curve.span)), residual)
    };
    let (axis, least) = axes
        .into_iter()
        .map(|axis| (axis, probability(axis)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let by_evidence = |a: &usize, b: &usize| found[*a].evidence.total_cmp(&found[*b].evidence);
    if least * tests < level { along(axis).into_iter().max_by(by_evidence) } else { None }
}

/// The span of all `spans`, without directions that lie in the others but for a tenth of their length.
pub(super) fn joined<'s>(spans: impl Iterator<Item = &'s Span>) -> Span {
    let directions: Vec<Image> = spans
        .flat_map(Span::directions)
        .map(|d| Image { mean: d.mean.to_vec(), contrast: d.contrast.to_vec() })
        .collect();
    clear_of(&directions, &directions)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two joints whose torques go together: their second directions are the same but for a twentieth, and the second
    /// of the two counts no more.
    #[test]
    fn directions_that_joints_share_count_once() {
        let span = |columns: [[f64; 4]; 2]| {
            let mut span = Span::default();
            for mean in columns {
                assert!(span.push(&Image { mean: mean.to_vec(), contrast: Vec::new() }));
            }
            span
        };
        let one = span([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
        let other = span([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.05]]);
        let all = joined([&one, &other].into_iter());
        assert_eq!(all.len(), 3);
        let seen = Image { mean: vec![3.0, 4.0, 12.0, 7.0], contrast: Vec::new() };
        assert!((all.explained(&seen) - 13.0f64.powi(2)).abs() < 1e-9);
    }
}
