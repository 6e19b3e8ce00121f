//! How a joint moves between the samples of a log while its friction reverses.
//!
//! The Fourier series through the samples of a velocity says how the joint moves as long as nothing happens within a
//! sample. Friction that reverses faster violates this: the part that the drive does not deliver at once bends the
//! velocity by −a F Δ(s(q̇) − β s_ε(q̇)). Here a is the joint's acceleration per torque, F its dry friction, s the law
//! by which the friction reverses, and β s_ε what the drive delivers of it, by feed-forward and feedback. For a bend at
//! t′, the series of the samples lacks
//!
//! B(t, t′) = (t − t′)₊ − Σₙ (nT − t′)₊ sinc(t/T − n),
//!
//! with T the time between samples, and the velocity solves q̇ = series − Σ B a F Δ(s − β s_ε).

use super::scene::FINE;
use crate::dynamics::{map_pairs, with_widest_registers};
use crate::signal::FineClock;

/// What the series through the samples of a log lacks of a velocity that bends between them.
#[derive(Debug)]
pub struct Bends {
    /// B for a slope that changes by one per tick, by the tick within a sample at which it changes; each from `REACH`
    /// ticks before that tick to `REACH` ticks behind it.
    lacking: Vec<Vec<f64>>,
    /// The largest absolute value in `lacking`.
    most: f64,
}

/// Ticks over which a bend is followed on either side: four samples. Farther away, a series of 1250 samples lacks up to
/// a ninth of the maximum of B if the bend lies on a sample, and 1.4 % if it lies half-way between two.
const REACH: usize = 4 * FINE;
/// Widths of a law beyond which friction has reversed except for 7e-4 of it.
const WIDTHS: f64 = 4.0;
/// Total length of the iteration: the number of steps times the length of a step.
const STEPS: f64 = 5.0;

/// One joint whose friction reverses.
pub struct Turning {
    /// Velocity by the series through its samples, at every tick of one period, rad/s.
    pub series_rad_s: Vec<f64>,
    /// Sign s_ε of the dry friction that the model expects there, from the velocity of the series.
    pub expected: Vec<f64>,
    /// Change of the velocity within one tick if all dry friction is unbalanced, a F dt, rad/s.
    pub kick_rad_s: Vec<f64>,
}

impl Bends {
    /// For motions on the ticks of `clock`.
    pub fn new(clock: &FineClock) -> Self {
        let (ticks, n) = (clock.ticks(), clock.ticks() * clock.samples());
        let lacking = |phase: usize| -> Vec<f64> {
            let bend = n / 2 / ticks * ticks + phase;
            // A parabola over the period, whose slope jumps by one, from −½ to ½, where the period closes.
            let whole: Vec<f64> = (0..n)
                .map(|k| {
                    let x = ((k + n - bend) % n) as f64;
                    0.5 * x * (1.0 - x / n as f64)
                })
                .collect();
            let samples: Vec<f64> = whole.iter().step_by(ticks).copied().collect();
            let series = clock.refined(&samples);
            let from = bend + n * REACH - REACH;
            (from..=from + 2 * REACH).map(|k| whole[k % n] - series[k % n]).collect()
        };
        let lacking: Vec<Vec<f64>> = (0..ticks).map(lacking).collect();
        let most = lacking.iter().flatten().fold(0.0f64, |most, x| most.max(x.abs()));
        Self { lacking, most }
    }

    /// Velocity at every tick if friction reverses by `law`, from −1 to 1 within a few `width_rad_s`, and the drive
    /// delivers the share `delivered` of it, β s_ε.
    pub fn between_samples(
        &self,
        joint: &Turning,
        delivered: &[f64],
        width_rad_s: f64,
        law: impl Fn(f64) -> f64 + Copy,
    ) -> Vec<f64> {
        let series = &joint.series_rad_s;
        let n = series.len();
        let kick = joint.kick_rad_s.iter().fold(0.0f64, |most, k| most.max(k.abs()));
        let near = WIDTHS * width_rad_s + 2.0 * kick * self.most;
        let is_near = |k: usize| series[if k < n { k } else { k - n }].abs() < near;
        let mut out = series.clone();
        let Some(start) = (0..n).find(|k| !is_near(*k)) else { return out };
        let mut k = start;
        while k < start + n {
            let end = (k..start + n).find(|k| !is_near(*k)).unwrap_or(start + n);
            if end > k {
                with_widest_registers(
                    #[inline(always)]
                    || self.solve(joint, k..end, width_rad_s, law, delivered, &mut out),
                );
            }
            k = end + 1;
        }
        out
    }

    /// Solves one reversal, over the ticks `run` (modulo the period), and writes the velocity to `out`.
    #[inline(always)]
    fn solve(
        &self,
        joint: &Turning,
        run: std::ops::Range<usize>,
        width_rad_s: f64,
        law: impl Fn(f64) -> f64,
        delivered: &[f64],
        out: &mut [f64],
    ) {
        let Turning { series_rad_s: series, kick_rad_s: kick, .. } = joint;
        let n = series.len();
        let by_samples: Vec<f64> = run.clone().map(|k| series[k % n]).collect();
        let mut qd = by_samples.clone();
        let inner = 1..=qd.len();
        // The step is short enough to converge however steep the law is.
        let steepness = 2.0 * kick[run.start % n].abs() * self.most / width_rad_s;
        let step = 1.0 / (1.0 + steepness);
        // The unbalanced friction, with one tick before the run and one behind it, where the joint follows the series.
        let around = || (run.start + n - 1..=run.end + n).map(|k| k % n);
        let given: Vec<f64> = around().map(|k| delivered[k]).collect();
        let mut force: Vec<f64> = around().map(|k| law(series[k]) - delivered[k]).collect();
        let mut moved = qd.clone();
        for _ in 0..(STEPS / step).ceil() as usize {
            force[inner.clone()].copy_from_slice(&qd);
            map_pairs(
                &mut force[inner.clone()],
                &given[inner.clone()],
                #[inline(always)]
                |qd, given| law(qd) - given,
            );
            moved.copy_from_slice(&by_samples);
            for (i, k) in run.clone().enumerate() {
                let bend = -0.5 * kick[k % n] * (force[i + 2] - force[i]);
                let lacking = &self.lacking[k % self.lacking.len()];
                let first = i.saturating_sub(REACH);
                let moved = &mut moved[first..qd.len().min(i + REACH + 1)];
                let lacking = &lacking[first + REACH - i..];
                moved.iter_mut().zip(lacking).for_each(|(moved, l)| *moved += bend * l);
            }
            qd.iter_mut().zip(&moved).for_each(|(qd, moved)| *qd += step * (moved - *qd));
        }
        run.zip(qd).for_each(|(k, qd)| out[k % n] = qd);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLES: usize = 250;
    const SAMPLE_S: f64 = 0.008;
    const WIDTH_RAD_S: f64 = 0.004;
    /// Dry friction over inertia, rad/s².
    const FRICTION: f64 = 3.0;

    fn law(qd_rad_s: f64) -> f64 {
        (qd_rad_s / WIDTH_RAD_S).tanh()
    }

    fn turning(series_rad_s: Vec<f64>, kick_rad_s: Vec<f64>) -> Turning {
        let expected = series_rad_s.iter().map(|qd| law(*qd)).collect();
        Turning { series_rad_s, expected, kick_rad_s }
    }

    /// The velocity of a joint that is pushed to and fro by a drive without friction feed-forward, at every tick of the
    /// fourth period.
    fn motion() -> Vec<f64> {
        const STEPS: usize = 40;
        let ticks = SAMPLES * FINE;
        let period_s = SAMPLES as f64 * SAMPLE_S;
        let step_s = period_s / (ticks * STEPS) as f64;
        let rate = |t: f64, qd: f64| {
            let omega = std::f64::consts::TAU / period_s;
            7.0 * (omega * t).cos() + 4.0 * (3.0 * omega * t + 1.0).cos() - FRICTION * law(qd)
        };
        let (mut qd, mut out) = (0.0, Vec::new());
        for k in 0..4 * ticks * STEPS {
            if k >= 3 * ticks * STEPS && k.is_multiple_of(STEPS) {
                out.push(qd);
            }
            let t = k as f64 * step_s;
            let half = qd + 0.5 * step_s * rate(t, qd);
            qd += step_s * rate(t + 0.5 * step_s, half);
        }
        out
    }

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
    }

    /// Between its samples the joint departs from the series by more than half of the width of its friction. The
    /// solution lies within the error of the trapezoids on which it is computed: behind a reversal at 10 rad/s² a tick
    /// takes the joint through 5 mrad/s, a width, and an eighth of that is the error of one trapezoid.
    #[test]
    fn a_joint_is_found_between_its_samples() {
        let clock = FineClock::new(SAMPLES, FINE);
        let truth = motion();
        let samples: Vec<f64> = truth.iter().step_by(FINE).copied().collect();
        let series = clock.refined(&samples);
        let kick = vec![FRICTION * SAMPLE_S / FINE as f64; truth.len()];
        let delivered = vec![0.0; truth.len()];
        let joint = turning(series.clone(), kick);
        let found = Bends::new(&clock).between_samples(&joint, &delivered, WIDTH_RAD_S, law);
        let while_turning = |qd: &[f64]| -> Vec<f64> {
            let is_turning = |(_, truth): &(&f64, &f64)| truth.abs() < WIDTHS * WIDTH_RAD_S;
            qd.iter().zip(&truth).filter(is_turning).map(|(qd, _)| *qd).collect()
        };
        let [of_series, left] = [&series, &found]
            .map(|qd| largest_difference(&while_turning(&truth), &while_turning(qd)));
        assert!(of_series > 0.5 * WIDTH_RAD_S);
        assert!(left < WIDTH_RAD_S / 8.0);
    }

    /// A drive that delivers all of the friction leaves the joint where the series says.
    #[test]
    fn what_is_delivered_bends_nothing() {
        let clock = FineClock::new(SAMPLES, FINE);
        let samples: Vec<f64> = (0..SAMPLES).map(|k| (0.1 * k as f64).sin()).collect();
        let series = clock.refined(&samples);
        let kick = vec![1e-3; series.len()];
        let joint = turning(series, kick);
        let found = Bends::new(&clock).between_samples(&joint, &joint.expected, WIDTH_RAD_S, law);
        assert!(largest_difference(&joint.series_rad_s, &found) < 1e-15);
    }
}
