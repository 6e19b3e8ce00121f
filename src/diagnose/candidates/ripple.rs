//! Torque ripple that repeats many times per turn: τ = A cos(N q + φ), caused by the gear (once, twice or four times
//! per turn of its wave generator) or by the motor's poles.
//!
//! Fast ripple accelerates the links and hardly shows in the torque, and above half the sampling rate the samples hold
//! its alias. A log shows it as it shows any torque that no controller answers at once ([`Scene::as_logged`]). Ripple
//! that the drive answers, or that is in its current only, is in the recorded torque at every sample (variant 1).

use super::*;
use crate::diagnose::rms::rms_where;
use crate::dynamics::{Lanes, Real};

/// See the module.
pub struct Ripple;

/// Variant for ripple that no drive answers at once.
const OF_THE_LINKS: usize = 0;
/// Variant for ripple that is in the torque at once. In a single run, behind its low-pass, the two are the same.
const OF_THE_DRIVE: usize = 1;

/// Variants that a log can distinguish.
fn variants(scene: &Scene) -> std::ops::RangeInclusive<usize> {
    OF_THE_LINKS..=if scene.periodic { OF_THE_DRIVE } else { OF_THE_LINKS }
}

/// Range of orders per turn of the joint: those of a strain-wave gear of ratio 100, and their neighbours.
const HIGHEST_ORDER: f64 = 450.0;
const LOWEST_ORDER: f64 = 20.0;
/// Orders of a strain-wave gear in multiples of its ratio.
const GEAR_MULTIPLES: [f64; 3] = [1.0, 2.0, 4.0];
/// Orders of the motor's poles and slots in multiples of the ratio. They are looked for in single runs, whose slow
/// parts show them.
const MOTOR_MULTIPLES: [f64; 2] = [8.0, 12.0];

/// Orders that are tried first, for a gear of this `ratio` and its motor. None for an arm without drives, whose ratio
/// is 1.
fn expected_orders(ratio: f64, is_periodic: bool) -> impl Iterator<Item = f64> {
    let motor = if is_periodic { &[][..] } else { &MOTOR_MULTIPLES[..] };
    let multiples = GEAR_MULTIPLES.into_iter().chain(motor.iter().copied());
    multiples.map(move |m| m * ratio).filter(|order| *order >= LOWEST_ORDER)
}

/// [`expected_orders`] of joint `j`.
fn expected_on(scene: &Scene, j: usize) -> impl Iterator<Item = f64> {
    expected_orders(scene.arm.joints[j].drive.gear_ratio, scene.periodic)
}

/// A joint that turns by less than this between two samples reveals no order.
const STANDSTILL_RAD: f64 = 1e-8;
/// Number of peaks of the order spectrum that are examined.
const PEAKS: usize = 3;

impl Candidate for Ripple {
    fn kind(&self) -> Kind {
        Kind::Ripple
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        let spacing = order_spacing(scene, joint(site));
        // Half the resolution to either side brackets a peak of the order spectrum.
        let about = |order: f64| [-0.5, 0.0, 0.5].map(|u| order + u * spacing);
        let orders: Vec<f64> = expected_on(scene, joint(site)).flat_map(about).collect();
        let shapes = |variant| orders.iter().map(move |&value| Shape { variant, value });
        variants(scene).flat_map(shapes).collect()
    }

    fn search(&self) -> Search {
        Search::Straight
    }

    fn half_width(&self, scene: &Scene, site: Option<usize>) -> Option<f64> {
        Some(0.5 * order_spacing(scene, joint(site)))
    }

    fn alternatives(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Option<f64> {
        let spacing = order_spacing(scene, joint(site));
        let is_near = |order: f64| (shape.value - order).abs() <= spacing;
        let any_order = variants(scene).count() as f64 * (HIGHEST_ORDER - LOWEST_ORDER) / spacing;
        (!expected_on(scene, joint(site)).any(is_near)).then_some(any_order)
    }

    fn is_repeatable(&self) -> bool {
        true
    }

    /// Orders that differ by less than two cycles over the joint's range are one, which is refined by half a cycle.
    fn are_apart(&self, scene: &Scene, site: Option<usize>, one: Shape, other: Shape) -> bool {
        (one.value - other.value).abs() >= 2.0 * order_spacing(scene, joint(site))
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        if shape.variant == OF_THE_DRIVE {
            let q = scene.motion.q_rad.joint(j);
            let wave = |f: fn(f64) -> f64| samples(scene, |k| f(shape.value * q[k]));
            return [wave(f64::cos), wave(f64::sin)].map(|ripple| Column::on(j, ripple)).into();
        }
        let at = scene.instants(j);
        // A run resampled from uneven times has no aliases that could be predicted.
        let fastest_rad_s = if scene.periodic {
            f64::INFINITY
        } else {
            0.5 * scene.rate_hz * std::f64::consts::TAU / shape.value
        };
        let (mut sin, mut cos) = (at.q_rad.clone(), at.q_rad.clone());
        with_widest_registers(
            #[inline(always)]
            || {
                for ((sin, cos), qd) in sin.iter_mut().zip(&mut cos).zip(&at.qd_rad_s) {
                    let seen = if qd.abs() < fastest_rad_s { 1.0 } else { 0.0 };
                    let wave = Real::sin_cos(shape.value * *sin);
                    (*sin, *cos) = (seen * wave.0, seen * wave.1);
                }
            },
        );
        [cos, sin].map(|ripple| Column::on(j, scene.as_logged(ripple))).into()
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![
            quantity("amplitude_nm", b[0].hypot(second(b)), "Nm"),
            quantity("order_per_turn", shape.value, "1/turn"),
            quantity("phase_rad", (-second(b)).atan2(b[0]), "rad"),
        ]
    }

    fn separating_experiment(&self) -> &'static str {
        "constant speed over a whole turn at two speeds: the order per turn stays"
    }

    /// A ripple as large as all the torque of its joint is none: it stands in for something else that depends on the
    /// angle.
    fn is_its_own(&self, scene: &Scene, site: Option<usize>, _: Shape, b: &[f64]) -> bool {
        let torque_nm = rms_where(scene.torque_nm.joint(joint(site)), |_| true);
        b[0].hypot(second(b)) < torque_nm
    }

    fn in_words(&self) -> &'static str {
        "torque ripple that repeats many times per turn"
    }

    fn form(&self, scene: &Scene, shape: Shape) -> Option<&'static str> {
        let form = if shape.variant == OF_THE_DRIVE {
            "in the recorded torque at once"
        } else {
            "in the motion first, as no drive answers it at once"
        };
        scene.periodic.then_some(form)
    }
}

/// Resolution in orders per turn: one more cycle over the joint's range.
fn order_spacing(scene: &Scene, j: usize) -> f64 {
    let [low, high] = range_rad(scene, j);
    std::f64::consts::TAU / (high - low).max(1e-2)
}

/// Weights v for which Σ v_k e^{iNq_k} = iN Σ w_k c_k, where c_k is the mean of e^{iNq} from sample k of a period to
/// the next, with q linear in between: c_k = (e^{iNq_{k+1}} − e^{iNq_k})/(iN (q_{k+1} − q_k)).
fn of_phasors(w: &[f64], q: &[f64]) -> Vec<f64> {
    let next = q[1..].iter().chain(&q[..1]);
    let per_turn: Vec<f64> = w
        .iter()
        .zip(q.iter().zip(next))
        .map(|(w, (q, next))| if (next - q).abs() > STANDSTILL_RAD { w / (next - q) } else { 0.0 })
        .collect();
    let before = per_turn.last().into_iter().chain(&per_turn);
    before.zip(&per_turn).map(|(before, own)| before - own).collect()
}

/// Starting shapes: the orders at which `residual_nm` of joint `j` has most power, ignoring the feedback of its drive.
pub(in crate::diagnose) fn strongest_orders(
    scene: &Scene,
    j: usize,
    residual_nm: &[f64],
) -> Vec<Shape> {
    let q = scene.motion.q_rad.joint(j);
    let of_links = scene.as_logged_adjoint(residual_nm).map(|w| of_phasors(&w, q));
    // A mean of phasors is their difference divided by the order, hence the tilt of −2 in power.
    let of_links = of_links.map(|weights| power_of_orders(scene, j, &weights, -2));
    let of_drive = power_of_orders(scene, j, residual_nm, 0);
    // A single run has the second spectrum only, which then counts as variant 0.
    let powers = of_links.into_iter().chain([of_drive]).enumerate();
    let shape = |variant| move |value| Shape { variant, value };
    powers.flat_map(|(variant, power)| power.peaks().map(shape(variant))).collect()
}

/// Power over equally spaced orders.
struct OrderSpectrum {
    step: f64,
    power: Vec<f64>,
}

/// |Σ w_k e^{iNq_k}|² N^`tilt` over the orders N.
fn power_of_orders(scene: &Scene, j: usize, weights: &[f64], tilt: i32) -> OrderSpectrum {
    let q = scene.motion.q_rad.joint(j);
    let step = 0.5 * order_spacing(scene, j).min(2.0);
    let count = ((HIGHEST_ORDER - LOWEST_ORDER) / step) as usize;
    debug_assert_eq!(q.len(), weights.len());
    let (q, weights) = (Lanes::of(q), Lanes::of(weights));
    let [mut phasors, turns] = [LOWEST_ORDER, step]
        .map(|order| q.iter().map(|q| (*q * order).sin_cos()).collect::<Vec<_>>());
    let power_at = |k: usize| {
        let [re, im] = with_widest_registers(
            #[inline(always)]
            || sum_and_turn(&mut phasors, &turns, &weights),
        );
        let order = LOWEST_ORDER + step * k as f64;
        (re * re + im * im) * order.powi(tilt)
    };
    OrderSpectrum { step, power: (0..count).map(power_at).collect() }
}

/// Real and imaginary part of Σ w_k p_k, with the `phasors` p as (imaginary, real); each is then multiplied by its turn.
#[inline(always)]
fn sum_and_turn(
    phasors: &mut [(Lanes, Lanes)],
    turns: &[(Lanes, Lanes)],
    weights: &[Lanes],
) -> [f64; 2] {
    let mut sums = [Lanes::constant(0.0); 2];
    for ((phasor, turn), weight) in phasors.iter_mut().zip(turns).zip(weights) {
        let (im, re) = *phasor;
        sums[0] += re * *weight;
        sums[1] += im * *weight;
        *phasor = (im * turn.1 + re * turn.0, re * turn.1 - im * turn.0);
    }
    sums.map(|lanes| lanes.0.iter().sum())
}

impl OrderSpectrum {
    /// Orders of the highest peaks, each with its two neighbours.
    fn peaks(self) -> impl Iterator<Item = f64> {
        let Self { step, power } = self;
        let mut peaks: Vec<usize> = (1..power.len().saturating_sub(1))
            .filter(|&k| power[k] >= power[k - 1] && power[k] >= power[k + 1])
            .collect();
        peaks.sort_by(|&a, &b| power[b].total_cmp(&power[a]));
        peaks.truncate(PEAKS);
        let about = move |k: usize| [-1.0, 0.0, 1.0].map(|u| LOWEST_ORDER + step * (k as f64 + u));
        peaks.into_iter().flat_map(about)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;

    /// A robot file without drives says nothing of gears: its ratio of one is not a gear ratio.
    #[test]
    fn no_order_is_expected_of_a_gear_that_is_not_known() {
        let expected = |ratio, is_periodic| expected_orders(ratio, is_periodic).collect::<Vec<_>>();
        assert_eq!(expected(101.0, true), [101.0, 202.0, 404.0]);
        assert_eq!(expected(101.0, false), [101.0, 202.0, 404.0, 808.0, 1212.0]);
        assert_eq!(expected(10.0, true), [20.0, 40.0]);
        assert!(expected(1.0, true).is_empty() && expected(1.0, false).is_empty());
    }

    /// For a joint that turns at constant speed between samples, the weights of the phasors give the same sum as the
    /// means.
    #[test]
    fn means_are_differences_of_phasors() {
        const N: usize = 12;
        let q: Vec<f64> = (0..N).map(|k| 0.02 * ((k * k) % 7) as f64).collect();
        let w: Vec<f64> = (0..N).map(|k| ((k * 5) % 3) as f64 - 0.8).collect();
        let order = 90.0;
        let phasor = |q: f64| Complex::from_polar(1.0, order * q);
        let turned = |k: usize| (q[(k + 1) % N] - q[k]) * order;
        // sinc(x) e^{iN(q_k + q_{k+1})/2}, with x half the phase that the cell turns through.
        let mean = |k: usize| {
            let x = 0.5 * turned(k);
            phasor(q[k] + x / order) * if x == 0.0 { 1.0 } else { x.sin() / x }
        };
        // A cell without motion is left out.
        let cells = (0..N).filter(|&k| turned(k) != 0.0);
        let by_means: Complex<f64> = cells.map(|k| mean(k) * w[k]).sum();
        let by_phasors: Complex<f64> =
            of_phasors(&w, &q).iter().zip(&q).map(|(v, q)| phasor(*q) * *v).sum();
        let difference = by_means * Complex::new(0.0, order) - by_phasors;
        // Rounding: terms of up to w/Δq = 60 with phases of up to 11 rad, in total some 10⁻¹³.
        assert!(difference.norm() < 1e-10 * by_phasors.norm(), "{by_means} {by_phasors}");
    }
}
