//! Torque that repeats many times per turn: τ = A cos(N q + φ), of the gear's teeth (even multiples of the
//! ratio) or the motor's poles.

use super::*;

/// See the module.
pub struct Ripple;

/// Orders that a strain-wave gear of ratio 100 makes, per turn of the joint, and their neighbours.
const HIGHEST_ORDER: f64 = 450.0;
const LOWEST_ORDER: f64 = 20.0;
/// Orders of a strain-wave gear in multiples of its ratio.
const GEAR_MULTIPLES: [f64; 3] = [1.0, 2.0, 4.0];
/// Orders of the motor's poles and slots in multiples of the ratio; looked for along single runs, whose
/// slow parts show them.
const MOTOR_MULTIPLES: [f64; 2] = [8.0, 12.0];

/// Multiples of the gear's ratio that are looked at first.
fn multiples(scene: &Scene) -> impl Iterator<Item = f64> {
    let motor = if scene.periodic { &[][..] } else { &MOTOR_MULTIPLES[..] };
    GEAR_MULTIPLES.into_iter().chain(motor.iter().copied())
}
/// Peaks of the order spectrum that are looked at closely.
const PEAKS: usize = 3;

impl Candidate for Ripple {
    fn kind(&self) -> Kind {
        Kind::Ripple
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        let spacing = order_spacing(scene, joint(site));
        let ratio = scene.arm.joints[joint(site)].drive.gear_ratio;
        // Half the resolution on both sides brackets a peak of the order spectrum.
        let about = |order: f64| [-0.5, 0.0, 0.5].map(|u| order + u * spacing);
        multiples(scene)
            .flat_map(|m| about(m * ratio))
            .map(|value| Shape { variant: 0, value })
            .collect()
    }

    fn search(&self) -> Search {
        Search::Straight
    }

    fn half_width(&self, scene: &Scene, site: Option<usize>) -> Option<f64> {
        Some(0.5 * order_spacing(scene, joint(site)))
    }

    fn alternatives(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Option<f64> {
        let spacing = order_spacing(scene, joint(site));
        let ratio = scene.arm.joints[joint(site)].drive.gear_ratio;
        let of_the_gear = |m: f64| (shape.value - m * ratio).abs() <= spacing;
        let any_order = (HIGHEST_ORDER - LOWEST_ORDER) / spacing;
        (!multiples(scene).any(of_the_gear)).then_some(any_order)
    }

    fn is_repeatable(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let q = scene.motion.q_rad.joint(j);
        let qd = scene.motion.qd_rad_s.joint(j);
        let column = |f: fn(f64) -> f64| {
            let ripple = |k: usize| {
                let frequency_hz = shape.value * qd[k] / std::f64::consts::TAU;
                let share = if scene.periodic {
                    seen_share(frequency_hz, scene.rate_hz)
                } else {
                    // What was resampled from uneven times has no aliases that could be predicted.
                    f64::from(frequency_hz.abs() < 0.5 * scene.rate_hz)
                };
                share * f(shape.value * q[k])
            };
            Column::on(j, samples(scene, ripple))
        };
        vec![column(f64::cos), column(f64::sin)]
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

    fn in_words(&self) -> &'static str {
        "torque ripple that repeats many times per turn"
    }
}

/// Share of a ripple of this frequency that is left between torque and inertia times acceleration.
///
/// Fast ripple goes into the acceleration of the links, not into the torque. Above half the rate it has
/// its alias there: the velocity it makes, 1/f as large as the acceleration, is differentiated at the
/// frequency f − f_s round(f/f_s) at which it appears.
fn seen_share(frequency_hz: f64, rate_hz: f64) -> f64 {
    let turns = frequency_hz / rate_hz;
    if turns.abs() <= 0.5 { 1.0 } else { (turns - turns.round()) / turns }
}

/// Resolution in orders per turn: one cycle more over the joint's range.
fn order_spacing(scene: &Scene, j: usize) -> f64 {
    let q = scene.motion.q_rad.joint(j);
    let (low, high) =
        q.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &q| (l.min(q), h.max(q)));
    std::f64::consts::TAU / (high - low).max(1e-2)
}

/// Orders at which `residual_nm` of joint `j` has most power: shapes to begin with.
pub(in crate::diagnose) fn strongest_orders(
    scene: &Scene,
    j: usize,
    residual_nm: &[f64],
) -> Vec<Shape> {
    let q = scene.motion.q_rad.joint(j);
    let step = 0.5 * order_spacing(scene, j).min(2.0);
    let count = ((HIGHEST_ORDER - LOWEST_ORDER) / step) as usize;
    let mut power = vec![0.0; count];
    let mut phasors: Vec<(f64, f64)> = q.iter().map(|q| (LOWEST_ORDER * q).sin_cos()).collect();
    let turns: Vec<(f64, f64)> = q.iter().map(|q| (step * q).sin_cos()).collect();
    for power in &mut power {
        let (mut re, mut im) = (0.0, 0.0);
        for ((phasor, turn), r) in phasors.iter_mut().zip(&turns).zip(residual_nm) {
            re += r * phasor.1;
            im += r * phasor.0;
            *phasor =
                (phasor.0 * turn.1 + phasor.1 * turn.0, phasor.1 * turn.1 - phasor.0 * turn.0);
        }
        *power = re * re + im * im;
    }
    let mut peaks: Vec<usize> = (1..count.saturating_sub(1))
        .filter(|&k| power[k] >= power[k - 1] && power[k] >= power[k + 1])
        .collect();
    peaks.sort_by(|&a, &b| power[b].total_cmp(&power[a]));
    peaks
        .into_iter()
        .take(PEAKS)
        .flat_map(|k| [-1.0, 0.0, 1.0].map(|u| LOWEST_ORDER + step * (k as f64 + u)))
        .map(|value| Shape { variant: 0, value })
        .collect()
}
