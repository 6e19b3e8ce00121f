//! Nuisance columns for a drive's response to dry friction.
//!
//! A controller that feeds the share β of a joint's friction F forward does so where the commanded velocity reverses,
//! a little time δ before the true velocity does. The share that is not fed forward accelerates the links for a
//! moment. With s(t) the sign of q̇ and s̃ the same signal [as logged](FineClock::as_logged), the record holds
//!
//! F (s̃ + β (s − s̃) + β δ (ṡ − s̃˙))
//!
//! where the model has F s. s̃ includes the feedback that follows ([`FEEDBACK_RAD_S`]). Neither β nor δ is known:
//! s̃ − s and its rate become additional columns beside the model's. They are of high frequency and carry no
//! information about the arm; if they are left out, an arm without feed-forward gets inertias that are wrong by more
//! than σ.

use super::held_at_rest::HeldAtRest;
use super::problem::Problem;
use crate::dynamics::{Model, Motion};
use crate::signal::{FineClock, HarmonicPower};

/// Bandwidth ω of the feedback that stops a rotor and the links on it, rad/s. For arms simulated with drives of 2 ζ
/// ω = 100 rad/s, values from 60 to 120 explain gears and play about equally well. Without this feedback, gears at
/// the shoulder seemed a third stiffer than they were, play seemed a quarter narrower, and half of the ripple faster
/// than half the sampling rate was left along another motion.
pub const FEEDBACK_RAD_S: f64 = 80.0;

/// [`FEEDBACK_RAD_S`] per tick of `tick_s`.
pub fn feedback_per_tick(tick_s: f64) -> f64 {
    FEEDBACK_RAD_S * tick_s
}

/// s̃ − s and its rate (per tick) at the samples of one period. `fine_sign` is the sign of the velocity at every
/// tick, `highest` the highest harmonic up to which the acceleration is known, and `rate_hz` the rate of the samples.
pub fn drive_answers(
    clock: &FineClock,
    fine_sign: &[f64],
    highest: usize,
    rate_hz: f64,
) -> [Vec<f64>; 2] {
    let n = fine_sign.len();
    let feedback_per_tick = feedback_per_tick(1.0 / (rate_hz * clock.ticks() as f64));
    let rate = |k: usize| 0.5 * (fine_sign[(k + 1) % n] - fine_sign[(k + n - 1) % n]);
    let rates: Vec<f64> = (0..n).map(rate).collect();
    [fine_sign, &rates].map(|fine| {
        let logged = clock.as_logged(fine, highest, feedback_per_tick);
        logged.iter().zip(fine.iter().step_by(clock.ticks())).map(|(l, now)| l - now).collect()
    })
}

/// Projects the responses of all drives out of `problem`, which is a repeating motion with its periods of torque. X
/// and y keep their components orthogonal to the responses, joint by joint, as in a fit that includes these columns
/// (Frisch and Waugh 1933). With equal weights the solution is that of such a fit; rows that are weighted afterwards
/// have another solution, which is just as free of the responses. Rows that are left out because friction is `held`
/// there stay out of it.
pub fn without_drive_answers(
    problem: &mut Problem,
    clock: &FineClock,
    model: &Model,
    motion: &Motion,
    acceleration: &[HarmonicPower],
    held: &[HeldAtRest],
) {
    let n = problem.samples;
    for (j, (panel, known)) in problem.panels.iter_mut().zip(acceleration).enumerate() {
        let qd = clock.refined(motion.qd_rad_s.joint(j));
        let sign: Vec<f64> = qd.iter().map(|qd| model.friction_sign(*qd)).collect();
        let mut directions: Vec<Vec<f64>> = Vec::new();
        let own = held.iter().find(|held| held.joint == j);
        for mut column in drive_answers(clock, &sign, known.estimate.len(), problem.rate_hz) {
            own.into_iter().for_each(|held| held.silence(&mut column));
            directions.iter().for_each(|d| take_out(d, &mut column));
            let length = column.iter().map(|x| x * x).sum::<f64>().sqrt();
            // A joint that stands still has no reversals.
            if length > 0.0 {
                column.iter_mut().for_each(|x| *x /= length);
                directions.push(column);
            }
        }
        for direction in &directions {
            panel.x.chunks_exact_mut(n).for_each(|x| take_out(direction, x));
            // Only the repeating part is projected out; differences between the periods are noise and stay.
            let periods = panel.y.len() / n;
            let along = |y: &[f64]| direction.iter().zip(y).map(|(d, y)| d * y).sum::<f64>();
            let mean = panel.y.chunks_exact(n).map(along).sum::<f64>() / periods as f64;
            for period in panel.y.chunks_exact_mut(n) {
                period.iter_mut().zip(direction).for_each(|(y, d)| *y -= mean * d);
            }
        }
    }
}

/// Removes from `y` its component along the unit vector `direction`.
fn take_out(direction: &[f64], y: &mut [f64]) {
    let along: f64 = direction.iter().zip(&*y).map(|(d, y)| d * y).sum();
    y.iter_mut().zip(direction).for_each(|(y, d)| *y -= along * d);
}
