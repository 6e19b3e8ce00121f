//! Motions that repeat, for tests.

use std::f64::consts::PI;

use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};

use crate::robot::JointSignals;

/// Angles of six joints, rad: `periods` periods of `period` samples, of five harmonics each, with a smooth run-in from
/// rest over `run_in` samples and a standstill of `rest` samples before and after, and noise of `sigma`.
pub fn smooth_periods(
    period: f64,
    periods: f64,
    run_in: usize,
    rest: usize,
    sigma: f64,
    seed: u64,
) -> JointSignals {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n = 2 * rest + run_in + (period * periods).round() as usize;
    JointSignals::from_fn(6, n, |j, k| {
        let k = k.clamp(rest, n - 1 - rest) - rest;
        let ramp =
            if k >= run_in { 1.0 } else { 0.5 - 0.5 * (PI * k as f64 / run_in as f64).cos() };
        let phase = 2.0 * PI * (k as f64 - run_in as f64) / period;
        let q: f64 =
            (1..=5).map(|h| (h as f64 * phase + (j * j + 3 * h * j) as f64).sin() / h as f64).sum();
        let noise: f64 = StandardNormal.sample(&mut rng);
        ramp * q + sigma * noise
    })
}

/// Cycles of three moves and one back to the start, with a pause behind each: the sum over the moves of a cycle of the
/// way of joint `j`, rad, times `progress` of the share of the move's time that has passed. So many `cycles` have
/// passed since the first began, and each move takes the share `moving` of a cycle.
pub fn moves_with_pauses(j: usize, cycles: f64, moving: f64, progress: impl Fn(f64) -> f64) -> f64 {
    const MOVES: usize = 4;
    let there = |m: usize| ((j + 1) as f64 * (m + 2) as f64).sin();
    let way = |m: usize| match m + 1 {
        MOVES => -(0..m).map(there).sum::<f64>(),
        _ => there(m),
    };
    let phase = cycles.fract();
    let passed = |m: usize| ((phase - m as f64 / MOVES as f64) / moving).clamp(0.0, 1.0);
    (0..MOVES).map(|m| way(m) * progress(passed(m))).sum()
}

/// The `progress` of a move of least jerk: the share of its way that it has covered after the share `s` of its time.
pub fn minimum_jerk(s: f64) -> f64 {
    s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
}
