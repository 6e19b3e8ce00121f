//! Curves of the residual along the quantities of one joint.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::image::{Column, Image, Span};
use crate::diagnose::scene::Scene;
use crate::diagnose::study::{LEAST_GAIN, Study};
use crate::diagnose::verdict::Unexplained;

/// A hat that keeps less than this share of its length outside the model, the causes and the hats before it is not
/// fitted.
const ABSORBED: f64 = 0.1;
/// A component of the curve of which the model and the causes leave less than this share is not drawn: its height is
/// not determined.
const VISIBLE: f64 = 0.3;
/// Number of knots of the curve along an axis.
const KNOTS: usize = 10;
/// Along a single run, a curve on a joint that has a named law must remove more than this share of the joint's
/// remaining mean square. Laws are approximate in form and may leave that much along one curve: on a UR10e whose
/// friction has six kinds of laws, up to 0.22.
const LEFT_BY_LAWS: f64 = 0.25;
/// Number of quantities of a joint along which a curve is fitted; the last one is time.
const AXES: usize = 6;
/// Share of the samples that lie beyond each of the outermost knots. Where a drive that feeds friction forward jumps at
/// a reversal, the torque changes so fast that a few samples would have a knot for themselves, and their residual would
/// only reflect the instants at which they were taken.
const OUTERMOST: f64 = 0.01;
/// Least number of periods for the curve of friction over the whole log. With fewer, drifting friction takes more than
/// a third of the information that the slow harmonics give about the noise.
const FEWEST_PERIODS: usize = 4;
/// First knot of the distance travelled since a reversal, rad. Bristles and gear teeth give way over longer distances
/// than this.
const SHORTEST_WAY_RAD: f64 = 1e-4;

/// The axis of a curve that does not repeat from period to period.
pub(in crate::diagnose) const SINCE_THE_START: &str = "time since the start";

/// A joint, and what is known of it when its curves are tried.
pub(super) struct Around {
    /// Its index, from 0 on.
    pub(super) joint: usize,
    /// Whether a law is named on it.
    pub(super) has_law: bool,
    /// Whether its periods may differ for no reason that is known already.
    pub(super) can_differ: bool,
}

/// A curve of 10 knots in each quantity of one joint.
pub(super) fn curves(
    study: &Study,
    accepted: &Span,
    residual: &Image,
    around: &Around,
) -> Vec<Curve> {
    let (scene, j) = (&study.scene, around.joint);
    let torque_rate = scene.torque_rate_nm_s(j);
    let time: Vec<f64> = (0..scene.samples()).map(|k| k as f64 / scene.rate_hz).collect();
    let axes: [(Axis, &[f64]); AXES] = [
        (("angle", "rad"), scene.motion.q_rad.joint(j)),
        (("speed", "rad/s"), scene.motion.qd_rad_s.joint(j)),
        (("acceleration", "rad/s²"), scene.motion.qdd_rad_s2.joint(j)),
        (("torque", "Nm"), scene.torque_nm.joint(j)),
        (("rate of the torque", "Nm/s"), &torque_rate),
        (("time within the period", "s"), &time),
    ];
    // A single run has no axis of time: dependence on time cannot be told from events that happen once.
    let count = if scene.periodic { AXES } else { AXES - 1 };
    let curves = axes.into_iter().take(count).map(|(axis, values)| (axis, hats(values)));
    let course = if around.can_differ { since_the_start(scene, j) } else { None };
    let of_friction = behind_reversals(scene, j).into_iter().chain(course);
    let curve = |((axis, unit), (knots, hats)): (Axis, (Vec<f64>, Vec<Vec<f64>>))| {
        let columns: Vec<Column> = hats.iter().map(|hat| Column::on(j, hat.clone())).collect();
        let raw = study.whitening.images(columns.iter());
        let outside = outside(study, accepted, &raw);
        let span = clear_of(&raw, &outside);
        let explained = span.explained(residual);
        let least = if around.has_law { LEFT_BY_LAWS } else { LEAST_GAIN };
        let probability = if study.generalises(Some(j), &span, residual, least) {
            study.statistic.probability(&span, residual)
        } else {
            1.0
        };
        let evidence = explained - span.len() as f64 * (residual.mean.len() as f64).ln();
        let heights = visible(&raw, &outside, residual);
        let curve_at = |k: usize| -> f64 { hats.iter().zip(&heights).map(|(h, b)| h[k] * b).sum() };
        let n = hats[0].len();
        let square: f64 = (0..n).map(|k| curve_at(k).powi(2)).sum();
        let unexplained = Unexplained {
            axis,
            unit,
            joint: j + 1,
            of_all_joints: false,
            rms_nm: (square / n as f64).sqrt(),
            curve: knots.iter().zip(&heights).map(|(x, y)| [*x, *y]).collect(),
        };
        Curve { span, explained, evidence, probability, repeats: n == scene.samples(), unexplained }
    };
    curves.chain(of_friction).map(curve).collect()
}

/// The parts of the `images` outside the null model and `accepted`.
pub(super) fn outside(study: &Study, accepted: &Span, images: &[Image]) -> Vec<Image> {
    let mut outside = images.to_vec();
    study.null.residualise_all(&mut outside);
    accepted.residualise_all(&mut outside);
    outside
}

/// The span of the parts `outside`, without those that keep less than the share [`ABSORBED`] of their length in `raw`
/// beside the ones before them.
pub(super) fn clear_of(raw: &[Image], outside: &[Image]) -> Span {
    let mut span = Span::default();
    for (raw, image) in raw.iter().zip(outside) {
        span.push_longer_than(ABSORBED * raw.square().sqrt(), image);
    }
    span
}

/// A curve along one axis, and how clearly the residual shows it.
pub(super) struct Curve {
    /// The curve's hats outside the model and the causes.
    pub(super) span: Span,
    /// Square of the residual that it removes.
    pub(super) explained: f64,
    /// The square that it removes less k ln n for its k knots and the n rows (Schwarz 1978), which ranks curves.
    pub(super) evidence: f64,
    /// Probability that noise alone explains as much, this curve taken by itself.
    pub(super) probability: f64,
    /// Whether the curve is the same in every period.
    pub(super) repeats: bool,
    pub(super) unexplained: Unexplained,
}

impl Curve {
    /// Its joint, from 0 on.
    pub(super) fn joint(&self) -> usize {
        self.unexplained.joint - 1
    }
}

/// Least-squares heights of the knots that `residual` shows, without the components of the curve of which the model and
/// the causes leave less than [`VISIBLE`], and with mean zero because a constant belongs to the model.
///
/// With X the images of the hats and X⊥ (`outside`) their parts outside the model, the components v are the solutions
/// of X⊥ᵀX⊥ v = s² XᵀX v, where s is the share of component v that is left.
fn visible(raw: &[Image], outside: &[Image], residual: &Image) -> Vec<f64> {
    let n = raw.len();
    let gram = |of: &[Image]| DMatrix::from_fn(n, n, |i, k| of[i].dot(&of[k]));
    let mut heights = DVector::zeros(n);
    let own = gram(raw);
    // Knots may coincide, which makes XᵀX singular.
    let ridge = 1e-9 * own.trace() / n as f64;
    if let Some(factor) = (own + DMatrix::identity(n, n) * ridge).cholesky() {
        // With XᵀX = L Lᵀ, the matrix L⁻¹ X⊥ᵀX⊥ L⁻ᵀ has the eigenvalues s² and the eigenvectors Lᵀ v.
        let lower = factor.l();
        let half = lower.solve_lower_triangular(&gram(outside)).unwrap_or_default();
        let both = lower.solve_lower_triangular(&half.transpose()).unwrap_or_default();
        let parts = both.symmetric_eigen();
        let along = DVector::from_iterator(n, outside.iter().map(|image| image.dot(residual)));
        for (share, w) in parts.eigenvalues.iter().zip(parts.eigenvectors.column_iter()) {
            if *share > VISIBLE * VISIBLE
                && let Some(v) = lower.tr_solve_lower_triangular(&w)
            {
                heights += &v * (v.dot(&along) / share);
            }
        }
    }
    heights.add_scalar_mut(-heights.mean());
    heights.data.into()
}

/// Axis of what friction does after a reversal, whatever its law: hats over the logarithm of the distance travelled
/// since then, each times the direction of motion. `None` if the joint never reverses.
fn behind_reversals(scene: &Scene, j: usize) -> Option<(Axis, Curves)> {
    let (q, qd) = (scene.motion.q_rad.joint(j), scene.motion.qd_rad_s.joint(j));
    let n = q.len();
    let turns = |k: usize| qd[(k + n - 1) % n] * qd[k] < 0.0;
    // A period is followed by the next one, a single run by nothing: there the first sample has none before it, and up
    // to the first reversal the distance is left at its initial value, whose logarithm 0 stands for 1 rad.
    let start = if scene.periodic { 0 } else { 1 };
    let first = (start..n).find(|&k| turns(k))?;
    let end = if scene.periodic { first + n } else { n };
    let mut way = vec![0.0; n];
    let mut turn_rad = q[first];
    for k in (first..end).map(|k| k % n) {
        if turns(k) {
            // The angle of the reversal itself, where the velocity, taken as linear between the two samples, passes
            // through zero.
            let before = (k + n - 1) % n;
            turn_rad = q[k] - 0.5 * qd[k] * qd[k] / ((qd[k] - qd[before]) * scene.rate_hz);
        }
        way[k] = (q[k] - turn_rad).abs().max(SHORTEST_WAY_RAD).ln();
    }
    let (low, high) = (SHORTEST_WAY_RAD.ln(), way.iter().copied().fold(f64::MIN, f64::max));
    let knots = (0..KNOTS).map(|k| low + (high - low) * k as f64 / (KNOTS - 1) as f64).collect();
    let (knots, hats) = hats_at(knots, &way);
    let direction: Vec<f64> = qd.iter().map(|qd| qd.signum()).collect();
    let hats = times(hats, &direction);
    Some((("way since the reversal", "rad"), (knots.into_iter().map(f64::exp).collect(), hats)))
}

/// Axis of friction that changes over the log: hats over time, each times the direction of motion, with one knot per
/// period but no more knots than other curves have. `None` if the joint never reverses, or if there are so few periods
/// that little of the noise in their differences is not drift.
///
/// Only differences between the periods show such a change. From these the whitening removes drifts that fade or grow
/// linearly before it estimates the noise; a drift of any other course hides a little of itself by raising that
/// estimate.
fn since_the_start(scene: &Scene, j: usize) -> Option<(Axis, Curves)> {
    let sign = scene.sign.joint(j);
    let (n, knots) = (sign.len(), scene.periods.min(KNOTS));
    let turns = sign.iter().any(|s| *s > 0.5) && sign.iter().any(|s| *s < -0.5);
    if !turns || scene.periods < FEWEST_PERIODS {
        return None;
    }
    let samples = n * scene.periods;
    let time = (0..samples).map(|k| scene.lead_in_s + k as f64 / scene.rate_hz).collect::<Vec<_>>();
    // Each knot lies in the middle of one of equally long parts of the log.
    let part_s = samples as f64 / scene.rate_hz / knots as f64;
    let at = (0..knots).map(|k| scene.lead_in_s + (k as f64 + 0.5) * part_s).collect();
    let (knots, hats) = hats_at(at, &time);
    Some(((SINCE_THE_START, "s"), (knots, times(hats, sign))))
}

/// The hats times the `direction` of motion, which is the same in every period.
fn times(mut hats: Vec<Vec<f64>>, direction: &[f64]) -> Vec<Vec<f64>> {
    for hat in &mut hats {
        hat.iter_mut().zip(direction.iter().cycle()).for_each(|(h, sign)| *h *= sign);
    }
    hats
}

/// Name and unit of a quantity.
type Axis = (&'static str, &'static str);
/// Knots, and for each the samples of the hat function that is 1 there.
type Curves = (Vec<f64>, Vec<Vec<f64>>);

/// Knots at equally spaced quantiles of `values`, and the piecewise linear hat of each.
fn hats(values: &[f64]) -> Curves {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = (sorted.len() - 1) as f64;
    let share = |k: usize| (k as f64 / (KNOTS - 1) as f64).clamp(OUTERMOST, 1.0 - OUTERMOST);
    hats_at((0..KNOTS).map(|k| sorted[(share(k) * last) as usize]).collect(), values)
}

/// The `knots`, and the piecewise linear hat of each, evaluated at `values`.
fn hats_at(knots: Vec<f64>, values: &[f64]) -> Curves {
    let mut hats = vec![vec![0.0; values.len()]; knots.len()];
    for (k, &x) in values.iter().enumerate() {
        let right = knots.partition_point(|knot| *knot < x).clamp(1, knots.len() - 1);
        let width = knots[right] - knots[right - 1];
        let u = if width > 0.0 { ((x - knots[right - 1]) / width).clamp(0.0, 1.0) } else { 1.0 };
        hats[right - 1][k] = 1.0 - u;
        hats[right][k] = u;
    }
    (knots, hats)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The model absorbs a straight line except for 2 % of it. Least squares would give the remainder of the line fifty
    /// times its height.
    #[test]
    fn what_the_model_absorbs_is_not_drawn() {
        const ROWS: usize = 400;
        let x: Vec<f64> = (0..ROWS).map(|k| k as f64 / (ROWS - 1) as f64).collect();
        let image = |y: Vec<f64>| Image { mean: y, contrast: Vec::new() };
        let (_, hats) = hats(&x);
        let raw: Vec<Image> = hats.into_iter().map(image).collect();
        let mut model = Span::default();
        model.push(&image(vec![1.0; ROWS]));
        model.push(&image(x.iter().map(|x| x + 0.02 * (60.0 * x).sin()).collect()));
        let mut outside = raw.clone();
        model.residualise_all(&mut outside);
        // A bump of height one, plus 25 times the remainder of the line.
        let bump = |x: f64| (1.0 - (x - 0.4).abs() / 0.1).max(0.0);
        let mut residual = image(x.iter().map(|x| bump(*x) - 0.5 * (60.0 * x).sin()).collect());
        model.residualise(&mut residual);
        // The hats add up to one, which the model holds, so the last of them is linearly dependent.
        let mut span = Span::default();
        let pushed = outside.iter().filter(|image| span.push(image)).count();
        let least_squares = span.solve(&residual);
        assert!(pushed == KNOTS - 1 && least_squares[0].abs() > 20.0, "{least_squares:?}");

        let heights = visible(&raw, &outside, &residual);
        let highest = (0..KNOTS).max_by(|a, b| heights[*a].total_cmp(&heights[*b]));
        assert!(matches!(highest, Some(3 | 4)), "{heights:?}");
        assert!(heights.iter().all(|h| h.abs() < 1.2), "{heights:?}");
        assert!(heights.iter().sum::<f64>().abs() < 1e-9);
    }
}
