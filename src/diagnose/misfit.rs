//! What is left behind the last cause: is it noise, and if not, on what does it depend?

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::chance;
use super::image::{Column, Image, Span};
use super::scene::Scene;
use super::statistic::Statistic;
use super::study::{LEAST_GAIN, Study};
use super::verdict::Unexplained;

/// Edges of the bands in which the residual is compared with noise, Hz; the last one ends with the rows.
/// Errors of friction and load live in the slow ones, of gears and clocks in the fast ones.
const BANDS_HZ: [f64; 5] = [0.0, 2.0, 5.0, 10.0, 20.0];
/// A part of the curve that keeps less than this share of its length belongs to the model.
const ABSORBED: f64 = 0.1;
/// A part of the curve that keeps less than this share has no height of its own that could be drawn.
const VISIBLE: f64 = 0.3;
/// Knots of the curve along an axis.
const KNOTS: usize = 10;
/// Share of the error that is left along a single run which the approximate forms of laws on a joint may leave along one curve: of
/// a UR10e whose friction has six kinds of laws up to 0.22.
const LEFT_BY_LAWS: f64 = 0.25;
/// Quantities of a joint along which curves are drawn; the last is time.
const AXES: usize = 6;
/// Share of the samples beyond the outermost knots. A drive that feeds friction forward jumps at a reversal, and the
/// torque changes there so fast that these few samples would have a knot for themselves: what is left of them is
/// when they were taken.
const OUTERMOST: f64 = 0.01;
/// Of fewer periods, drifting friction takes more than a third of what slow harmonics say of noise.
const FEWEST_PERIODS: usize = 4;
/// The first knot of the way behind a reversal, rad: bristles and teeth give way by more.
const SHORTEST_WAY_RAD: f64 = 1e-4;

/// How well noise explains what is left.
#[derive(Debug, Clone, Copy)]
pub struct LackOfFit {
    /// Probability that noise alone leaves as much in any band of any joint.
    pub probability: f64,
    /// The joint (0-based) of which that is least likely.
    pub joint: usize,
}

/// Whether noise alone leaves as much on the joints that are looked at; `None` for a single run.
///
/// Per joint and band, Σ r² over its degrees of freedom is F(k, ν): k the rows less their share in what the
/// null model and `accepted` have fitted (Σ of the leverages), ν what the periods know of the noise there.
/// The smallest probability is multiplied by their number (Bonferroni).
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

/// Those of `first` below the harmonic at which the rows end, and that.
fn band_edges(first: [usize; BANDS_HZ.len()], end: usize) -> Vec<usize> {
    first.into_iter().take_while(|edge| *edge < end).chain([end]).collect()
}

/// The axis along which the residual is largest: a curve of 10 knots in each quantity of each joint.
///
/// `Some` if that curve cannot be noise; or if the lack of fit cannot, and then of the joint of which it is. Along a single run the
/// curve has to show in stretches of time that were left out of its fit as well, and be more than laws leave on a joint that
/// `has_law`. Whether friction changes as the log goes on is asked of the joints whose periods `can_differ` by nothing else that is known.
pub fn unexplained(
    study: &Study,
    accepted: &Span,
    residual: &Image,
    lack_of_fit: Option<LackOfFit>,
    has_law: impl Fn(usize) -> bool,
    can_differ: impl Fn(usize) -> bool,
) -> Option<Unexplained> {
    let scene = &study.scene;
    let mut found: Vec<Curve> = Vec::new();
    let mut tests = 0.0;
    for j in (0..scene.joints()).filter(|j| study.looks_at(Some(*j))) {
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
        // What happens once in a single run depends on nothing.
        let count = if scene.periodic { AXES } else { AXES - 1 };
        let curves = axes.into_iter().take(count).map(|(axis, values)| (axis, hats(values)));
        let course = if can_differ(j) { since_the_start(scene, j) } else { None };
        let of_friction = behind_reversals(scene, j).into_iter().chain(course);
        for ((axis, unit), (knots, hats)) in curves.chain(of_friction) {
            tests += 1.0;
            let mut span = Span::default();
            let image = |hat: &Vec<f64>| study.whitening.image(&Column::on(j, hat.clone()));
            let raw: Vec<Image> = hats.iter().map(image).collect();
            let mut outside = raw.clone();
            study.null.residualise_all(&mut outside);
            accepted.residualise_all(&mut outside);
            for (raw, image) in raw.iter().zip(&outside) {
                let mut own = image.clone();
                span.residualise(&mut own);
                if own.square() > ABSORBED * ABSORBED * raw.square() {
                    span.push(image);
                }
            }
            let explained = span.explained(residual);
            let least = if has_law(j) { LEFT_BY_LAWS } else { LEAST_GAIN };
            let probability = if study.generalises(Some(j), &span, residual, least) {
                study.statistic.probability(&span, residual)
            } else {
                1.0
            };
            let evidence = explained - span.len() as f64 * (residual.mean.len() as f64).ln();
            let heights = visible(&raw, &outside, residual);
            let curve_at =
                |k: usize| -> f64 { hats.iter().zip(&heights).map(|(h, b)| h[k] * b).sum() };
            let n = hats[0].len();
            let square: f64 = (0..n).map(|k| curve_at(k).powi(2)).sum();
            let unexplained = Unexplained {
                axis,
                unit,
                joint: j + 1,
                rms_nm: (square / n as f64).sqrt(),
                curve: knots.iter().zip(&heights).map(|(x, y)| [*x, *y]).collect(),
            };
            let repeats = n == scene.samples();
            found.push(Curve { evidence, probability, repeats, unexplained });
        }
    }
    found.sort_by(|a, b| a.evidence.total_cmp(&b.evidence));
    // Curves of fewer knots may be worth more and still be noise.
    if let Some(clear) = found.iter().rposition(|c| c.probability * tests < chance::UNEXPLAINED) {
        return Some(found.swap_remove(clear).unexplained);
    }
    let lack = lack_of_fit.filter(|lack| lack.probability < chance::UNEXPLAINED)?;
    // The lack is one of the mean period.
    let of_joint = |curve: &Curve| curve.repeats && curve.unexplained.joint == lack.joint + 1;
    found.into_iter().rfind(of_joint).map(|curve| curve.unexplained)
}

/// A curve along one axis, and how clearly the residual shows it.
struct Curve {
    /// Twice the gain in log-likelihood less its price.
    evidence: f64,
    /// Of as much by chance.
    probability: f64,
    /// Whether every period has it.
    repeats: bool,
    unexplained: Unexplained,
}

/// Heights of the knots that `residual` shows, without their mean, which belongs to the model: the least-squares curve
/// without the parts of which the model and the causes leave less than [`VISIBLE`]. With the hats' images X, and `outside`
/// of the model X⊥, X⊥ᵀX⊥ v = s² XᵀX v: the share that is left of the part v is s.
fn visible(raw: &[Image], outside: &[Image], residual: &Image) -> Vec<f64> {
    let n = raw.len();
    let gram = |of: &[Image]| DMatrix::from_fn(n, n, |i, k| of[i].dot(&of[k]));
    let mut heights = DVector::zeros(n);
    let own = gram(raw);
    // Knots may coincide.
    let ridge = 1e-9 * own.trace() / n as f64;
    if let Some(factor) = (own + DMatrix::identity(n, n) * ridge).cholesky() {
        // L⁻¹ X⊥ᵀX⊥ L⁻ᵀ has the eigenvalues s²; its vectors are Lᵀ v.
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

/// What friction does behind a reversal, whatever its law: hats over the logarithm of the way since then, each
/// times the direction of motion; `None` if the joint never turns.
fn behind_reversals(scene: &Scene, j: usize) -> Option<(Axis, Curves)> {
    let (q, qd) = (scene.motion.q_rad.joint(j), scene.motion.qd_rad_s.joint(j));
    let n = q.len();
    let turns = |k: usize| qd[(k + n - 1) % n] * qd[k] < 0.0;
    // The end of a single run is not followed by its beginning, where a joint counts as a radian from its reversal.
    let start = if scene.periodic { 0 } else { 1 };
    let first = (start..n).find(|&k| turns(k))?;
    let end = if scene.periodic { first + n } else { n };
    let mut way = vec![0.0; n];
    let mut turn_rad = q[first];
    for k in (first..end).map(|k| k % n) {
        if turns(k) {
            // Between two samples, where a straight velocity passes through zero.
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

/// Friction that changes as the log goes on: hats over time, each times the direction of motion, a knot to a period or as many as
/// other curves have; `None` if the joint never turns, or few periods leave little of the noise that is not drift. It is told by
/// what periods have beside their mean, from which the whitening takes drifts that fade or go on evenly before it
/// asks how strong the noise is: others hide a little of themselves.
fn since_the_start(scene: &Scene, j: usize) -> Option<(Axis, Curves)> {
    let sign = scene.sign.joint(j);
    let (n, knots) = (sign.len(), scene.periods.min(KNOTS));
    let turns = sign.iter().any(|s| *s > 0.5) && sign.iter().any(|s| *s < -0.5);
    if !turns || scene.periods < FEWEST_PERIODS {
        return None;
    }
    let samples = n * scene.periods;
    let time = (0..samples).map(|k| scene.lead_in_s + k as f64 / scene.rate_hz).collect::<Vec<_>>();
    // In the middle of equal parts.
    let part_s = samples as f64 / scene.rate_hz / knots as f64;
    let at = (0..knots).map(|k| scene.lead_in_s + (k as f64 + 0.5) * part_s).collect();
    let (knots, hats) = hats_at(at, &time);
    Some((("time since the start", "s"), (knots, times(hats, sign))))
}

/// Hats times the `direction` of motion, which is the same in every period.
fn times(mut hats: Vec<Vec<f64>>, direction: &[f64]) -> Vec<Vec<f64>> {
    for hat in &mut hats {
        hat.iter_mut().zip(direction.iter().cycle()).for_each(|(h, sign)| *h *= sign);
    }
    hats
}

/// Name and unit of a quantity.
type Axis = (&'static str, &'static str);
/// Knots, and what rises to 1 at each.
type Curves = (Vec<f64>, Vec<Vec<f64>>);

/// Knots at equal shares of the samples, and the piecewise linear hat of each.
fn hats(values: &[f64]) -> Curves {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = (sorted.len() - 1) as f64;
    let share = |k: usize| (k as f64 / (KNOTS - 1) as f64).clamp(OUTERMOST, 1.0 - OUTERMOST);
    hats_at((0..KNOTS).map(|k| sorted[(share(k) * last) as usize]).collect(), values)
}

/// The piecewise linear hat of each of `knots`.
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

    /// Of periods of 10 s: where rows end beyond 20 Hz, within the bands, and at an edge.
    #[test]
    fn bands_reach_to_the_last_row() {
        let first = [0, 20, 50, 100, 200];
        assert_eq!(band_edges(first, 600), [0, 20, 50, 100, 200, 600]);
        assert_eq!(band_edges(first, 80), [0, 20, 50, 80]);
        assert_eq!(band_edges(first, 100), [0, 20, 50, 100]);
    }

    /// A model that follows a straight line but for 2 % of it: least squares would give what is left of the line fifty
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
        // A bump of height one, and 25 times what is left of the line.
        let bump = |x: f64| (1.0 - (x - 0.4).abs() / 0.1).max(0.0);
        let mut residual = image(x.iter().map(|x| bump(*x) - 0.5 * (60.0 * x).sin()).collect());
        model.residualise(&mut residual);
        // The last knot's hat is one less the others.
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
