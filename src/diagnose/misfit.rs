//! What is left behind the last cause: is it noise, and if not, on what does it depend?

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::image::{Column, Image, Span};
use super::scene::Scene;
use super::statistic::Statistic;
use super::study::Study;
use super::verdict::Unexplained;

/// Edges of the bands in which the residual is compared with noise, Hz; the last one ends with the rows.
/// Errors of friction and load live in the slow ones, of gears and clocks in the fast ones.
const BANDS_HZ: [f64; 5] = [0.0, 2.0, 5.0, 10.0, 20.0];
/// Chance that a log without faults is called unexplained, per test.
const FALSE_ALARM: f64 = 0.0005;
/// A part of the curve that keeps less than this share of its length belongs to the model.
const ABSORBED: f64 = 0.1;
/// Knots of the curve along an axis.
const KNOTS: usize = 10;
/// Share of the samples beyond the outermost knots. A drive that feeds friction forward jumps at a reversal, and the
/// torque changes there so fast that these few samples would have a knot for themselves: what is left of them is
/// when they were taken.
const OUTERMOST: f64 = 0.01;
/// The first knot of the way behind a reversal, rad: bristles and teeth give way by more.
const SHORTEST_WAY_RAD: f64 = 1e-4;

/// Probability that noise alone leaves as much in any band of any joint; `None` for a single run.
///
/// Per joint and band, Σ r² over its degrees of freedom is F(k, ν): k the rows less their share in what the
/// null model and `accepted` have fitted (Σ of the leverages), ν what the periods know of the noise there.
/// The smallest probability is multiplied by their number (Bonferroni).
pub fn lack_of_fit(study: &Study, accepted: &Span, residual: &Image) -> Option<f64> {
    let Statistic::Periods(knowledge) = &study.statistic else { return None };
    let harmonic = |hz: f64| (hz * study.scene.samples() as f64 / study.scene.rate_hz) as usize;
    let edges: Vec<usize> = BANDS_HZ
        .iter()
        .map(|hz| harmonic(*hz))
        .chain([knowledge.harmonics()])
        .take_while(|edge| *edge <= knowledge.harmonics())
        .collect();
    let fitted = |row: usize| -> f64 {
        let directions = study.null.directions().iter().chain(accepted.directions());
        directions.map(|d| d.mean[row] * d.mean[row]).sum()
    };
    let mut least = 1.0f64;
    let mut tests = 0.0;
    for joint in 0..study.scene.joints() {
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
            least = least.min(chance);
            tests += 1.0;
        }
    }
    Some((tests * least).min(1.0))
}

/// The axis along which the residual is largest: a curve of 10 knots in each quantity of each joint.
///
/// `Some` if that curve, or the lack of fit as a whole, cannot be noise.
pub fn unexplained(
    study: &Study,
    accepted: &Span,
    residual: &Image,
    lack_of_fit: Option<f64>,
) -> Option<Unexplained> {
    if !study.scene.periodic {
        return None;
    }
    let scene = &study.scene;
    let mut best: Option<(f64, f64, Unexplained)> = None;
    let mut tests = 0.0;
    for j in (0..scene.joints()).filter(|j| !study.left_out.contains(j)) {
        let torque_rate = scene.derivative(scene.torque_nm.joint(j));
        let time: Vec<f64> = (0..scene.samples()).map(|k| k as f64 / scene.rate_hz).collect();
        let axes: [(&'static str, &[f64]); 6] = [
            ("angle", scene.motion.q_rad.joint(j)),
            ("speed", scene.motion.qd_rad_s.joint(j)),
            ("acceleration", scene.motion.qdd_rad_s2.joint(j)),
            ("torque", scene.torque_nm.joint(j)),
            ("rate of the torque", &torque_rate),
            ("time within the period", &time),
        ];
        let curves = axes.map(|(axis, values)| (axis, hats(values)));
        for (axis, (knots, hats)) in curves.into_iter().chain(behind_reversals(scene, j)) {
            tests += 1.0;
            let mut span = Span::default();
            let mut used = Vec::new();
            for (knot, hat) in hats.iter().enumerate() {
                let mut image = study.whitening.image(&Column::on(j, hat.clone()));
                let length = image.square();
                study.null.residualise(&mut image);
                accepted.residualise(&mut image);
                let mut own = image.clone();
                span.residualise(&mut own);
                if own.square() > ABSORBED * ABSORBED * length && span.push(&image) {
                    used.push(knot);
                }
            }
            let explained = span.explained(residual);
            let probability = study.statistic.probability(&span, residual);
            let evidence = explained - span.len() as f64 * (residual.mean.len() as f64).ln();
            if best.as_ref().is_some_and(|b| b.0 >= evidence) {
                continue;
            }
            let mut heights = vec![0.0; KNOTS];
            for (knot, b) in used.iter().zip(span.solve(residual)) {
                heights[*knot] = b;
            }
            // The level belongs to the model; the curve is what varies.
            let mean = heights.iter().sum::<f64>() / KNOTS as f64;
            heights.iter_mut().for_each(|h| *h -= mean);
            let curve_at =
                |k: usize| -> f64 { hats.iter().zip(&heights).map(|(h, b)| h[k] * b).sum() };
            let n = scene.samples();
            let square: f64 = (0..n).map(|k| curve_at(k).powi(2)).sum();
            let found = Unexplained {
                axis,
                joint: j + 1,
                rms_nm: (square / n as f64).sqrt(),
                curve: knots.iter().zip(&heights).map(|(x, y)| [*x, *y]).collect(),
            };
            best = Some((evidence, probability, found));
        }
    }
    let (_, probability, found) = best?;
    let fires = probability * tests < FALSE_ALARM || lack_of_fit.is_some_and(|p| p < FALSE_ALARM);
    fires.then_some(found)
}

/// What friction does behind a reversal, whatever its law: hats over the logarithm of the way since then, each
/// times the direction of motion; `None` if the joint never turns.
fn behind_reversals(scene: &Scene, j: usize) -> Option<(&'static str, Curves)> {
    let (q, qd) = (scene.motion.q_rad.joint(j), scene.motion.qd_rad_s.joint(j));
    let n = q.len();
    let turns = |k: usize| qd[(k + n - 1) % n] * qd[k] < 0.0;
    let first = (0..n).find(|&k| turns(k))?;
    let mut way = vec![0.0; n];
    let mut turn_rad = q[first];
    for k in (first..first + n).map(|k| k % n) {
        if turns(k) {
            // Between two samples, where a straight velocity passes through zero.
            let before = (k + n - 1) % n;
            turn_rad = q[k] - 0.5 * qd[k] * qd[k] / ((qd[k] - qd[before]) * scene.rate_hz);
        }
        way[k] = (q[k] - turn_rad).abs().max(SHORTEST_WAY_RAD).ln();
    }
    let (low, high) = (SHORTEST_WAY_RAD.ln(), way.iter().copied().fold(f64::MIN, f64::max));
    let knots = (0..KNOTS).map(|k| low + (high - low) * k as f64 / (KNOTS - 1) as f64).collect();
    let (knots, mut hats) = hats_at(knots, &way);
    for hat in &mut hats {
        hat.iter_mut().zip(qd).for_each(|(h, qd)| *h = h.copysign(*qd));
    }
    Some(("way since the reversal", (knots.into_iter().map(f64::exp).collect(), hats)))
}

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
    let mut hats = vec![vec![0.0; values.len()]; KNOTS];
    for (k, &x) in values.iter().enumerate() {
        let right = knots.partition_point(|knot| *knot < x).clamp(1, KNOTS - 1);
        let width = knots[right] - knots[right - 1];
        let u = if width > 0.0 { ((x - knots[right - 1]) / width).clamp(0.0, 1.0) } else { 1.0 };
        hats[right - 1][k] = 1.0 - u;
        hats[right][k] = u;
    }
    (knots, hats)
}
