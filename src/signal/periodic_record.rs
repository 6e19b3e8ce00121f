//! Angles and velocities over whole periods, and the rounding in them that repeats.

use std::f64::consts::TAU;

use super::readings::resolution;
use crate::robot::JointSignals;

/// Readings may be coarse if at least this fraction of the samples recurs one period later to the last digit. The
/// fraction is 0.49 for noise of half a step; it is 0.09 for noise of three steps, whose rounding does not repeat.
const READ_AGAIN: f64 = 0.05;

/// Of values that are at most ten steps apart there must be so many, and this share of them must be a whole number of
/// steps apart, to within this fraction of a step. (Decimals of a file may round each step once more.)
const NEAR_STEPS: f64 = 10.0;
const FEWEST_NEAR: f64 = 10.0;
const MOST_WHOLE: f64 = 0.9;
const OFF_STEP: f64 = 0.15;

/// Terms of the series of the rounding: without noise, they make up all but 0.3 % of it.
const TERMS: usize = 200;
/// Halvings of the interval in which the variance of the noise is looked for.
const BISECTIONS: usize = 30;

/// Angle and velocity of a motion that repeats, over whole periods (joints × P·n samples).
#[derive(Debug, Clone)]
pub struct PeriodicRecord {
    /// Angles, rad.
    q_rad: JointSignals,
    /// Velocities, rad/s.
    qd_rad_s: JointSignals,
    /// Variance of the samples' rounding that is the same in every period: of angle and velocity, by joint.
    rounding: [Vec<f64>; 2],
}

impl PeriodicRecord {
    /// The samples as they were read, with periods of `samples_per_period`.
    pub fn new(q_rad: JointSignals, qd_rad_s: JointSignals, samples_per_period: usize) -> Self {
        let rounding = [&q_rad, &qd_rad_s].map(|y| repeated_rounding(y, samples_per_period));
        Self { q_rad, qd_rad_s, rounding }
    }

    /// The samples that a decimator keeps of `rows` (angle and velocity as they were read, with periods of
    /// `rows_per_period`), one in `every`. Their low-pass hides the steps of the readings, and leaves as much of the
    /// rounding as of any white noise.
    pub fn decimated(
        [q_rad, qd_rad_s]: [JointSignals; 2],
        rows: [&JointSignals; 2],
        rows_per_period: usize,
        every: usize,
    ) -> Self {
        let rounding = rows.map(|y| {
            let read = repeated_rounding(y, rows_per_period);
            read.into_iter().map(|variance| variance / every as f64).collect()
        });
        Self { q_rad, qd_rad_s, rounding }
    }

    /// Angles, rad.
    pub fn q_rad(&self) -> &JointSignals {
        &self.q_rad
    }

    /// Velocities, rad/s.
    pub fn qd_rad_s(&self) -> &JointSignals {
        &self.qd_rad_s
    }

    /// Whether the angles of joint `j` were read in steps so coarse that their rounding is the same in every period.
    pub fn has_coarse_angles(&self, j: usize) -> bool {
        self.rounding[0][j] > 0.0
    }

    /// Variance of the rounding of joint `j` that repeats: of the angle, rad², and of the velocity, rad²/s².
    pub(super) fn rounding(&self, j: usize) -> [f64; 2] {
        self.rounding.each_ref().map(|of| of[j])
    }
}

/// Variance of the rounding error that is the same in every period of `n` samples, by joint.
fn repeated_rounding(signals: &JointSignals, n: usize) -> Vec<f64> {
    (0..signals.joints()).map(|j| of_readings(signals.joint(j), n)).collect()
}

/// For readings in steps Δ of a signal with noise σ it is R(σ) = Σ_k Δ²/(2π²k²) exp(−(2πkσ/Δ)²), which is Δ²/12 without
/// noise (Widrow 1956). No scatter between periods shows this error, and no average removes it. The scatter shows the
/// noise and the rest of the rounding, S = σ² + Δ²/12 − R(σ), which tells σ.
fn of_readings(y: &[f64], n: usize) -> f64 {
    let pairs = || y.iter().zip(y.get(n..).unwrap_or(&[]));
    let count = pairs().len() as f64;
    let again = pairs().filter(|(now, later)| now == later).count() as f64;
    if again < READ_AGAIN * count {
        return 0.0;
    }
    let Some(step) = step_of(y) else { return 0.0 };
    let scatter = pairs().map(|(now, later)| ((later - now) / step).powi(2)).sum::<f64>();
    let scatter = scatter / (2.0 * count);
    let repeated = |noise: f64| {
        let term = |k: usize| {
            let w = (TAU * k as f64).powi(2);
            2.0 / w * (-w * noise).exp()
        };
        (1..=TERMS).map(term).sum::<f64>()
    };
    // The scatter grows with the noise: the noise is found by bisection.
    let (mut least, mut most) = (0.0, scatter);
    for _ in 0..BISECTIONS {
        let noise = 0.5 * (least + most);
        if noise + repeated(0.0) - repeated(noise) < scatter { least = noise } else { most = noise }
    }
    step * step * repeated(least)
}

/// The steps in which `y` was read; `None` for a constant, and for values of which the smallest distance is no common
/// step: those of a motion without noise and rounding recur as well.
fn step_of(y: &[f64]) -> Option<f64> {
    let step = resolution(y);
    let mut values = y.to_vec();
    values.sort_by(f64::total_cmp);
    let distances = values.windows(2).map(|v| (v[1] - v[0]) / step);
    let (mut near, mut whole) = (0.0, 0.0);
    for steps in distances.filter(|d| (0.5..NEAR_STEPS).contains(d)) {
        near += 1.0;
        whole += f64::from(u8::from((steps - steps.round()).abs() < OFF_STEP));
    }
    (near >= FEWEST_NEAR && whole >= MOST_WHOLE * near).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// The error of the mean of many periods is the repeated rounding, and its variance is the one predicted.
    #[test]
    fn rounding_repeats_as_far_as_noise_leaves_it() {
        const STEP: f64 = 1e-3;
        let (n, periods) = (500, 400);
        let truth = |k: usize| (0.0126 * k as f64 + 0.3).sin() + 0.4 * (0.0503 * k as f64).cos();
        for sigma in [0.0, 0.2, 0.35] {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let mut noise =
                || -> f64 { sigma * STEP * Distribution::<f64>::sample(&StandardNormal, &mut rng) };
            let read = |k: usize| ((truth(k % n) + noise()) / STEP).round() * STEP;
            let y: Vec<f64> = (0..n * periods).map(read).collect();
            let off = |k: usize| y[k..].iter().step_by(n).sum::<f64>() / periods as f64 - truth(k);
            let square = (0..n).map(|k| off(k).powi(2)).sum::<f64>() / n as f64;
            // The part that does not repeat scatters over the periods by no more than noise and one step.
            let scatter = (sigma * sigma + 1.0 / 12.0) * STEP * STEP / periods as f64;
            let said = of_readings(&y, n);
            let left = f64::from(u8::from(sigma > 0.0)) * scatter;
            // The mean square of 500 samples is known to 6 %, and so is, through the scatter at these samples, what is
            // said of it; three times √2 · 6 % is allowed.
            assert!((square - said).abs() < 0.26 * said + left, "{sigma}: {square:e} {said:e}");
        }
    }

    /// Readings as fine as their noise have no repeated rounding.
    #[test]
    fn fine_readings_have_no_rounding_that_repeats() {
        let y: Vec<f64> = (0..1000).map(|k| (0.1 * k as f64).sin()).collect();
        assert_eq!(of_readings(&y, 100), 0.0);
        assert_eq!(of_readings(&[2.0; 500], 100), 0.0);
        assert_eq!(of_readings(&[2.0; 50], 100), 0.0);
    }

    /// A motion without noise recurs to the last digit, as coarse readings do, but has no steps; steps of 96 µrad that
    /// a file rounds to 1 µrad are steps.
    #[test]
    fn what_recurs_need_not_be_coarse() {
        let w = TAU / 1250.0;
        let truth =
            |k: usize| (w * (k % 1250) as f64).sin() + 0.3 * (7.0 * w * (k % 1250) as f64).cos();
        let exact: Vec<f64> = (0..5000).map(truth).collect();
        assert_eq!(of_readings(&exact, 1250), 0.0);
        let step = TAU / 65536.0;
        let coarse = |q: &f64| ((q / step).round() * step * 1e6).round() / 1e6;
        let said = of_readings(&exact.iter().map(coarse).collect::<Vec<_>>(), 1250);
        // The smallest distance is 95 µrad, 0.9 % less than a step.
        assert!((said / (step * step / 12.0) - 1.0).abs() < 0.03, "{said:e}");
    }

    /// What a decimator leaves of the rounding has, up to 0.3 of the new rate, the power per harmonic that is said.
    #[test]
    fn a_decimator_leaves_the_rounding_that_it_hides() {
        use crate::signal::{Decimator, Scratch};
        const STEP: f64 = 1e-4;
        let (n, periods, every) = (5000, 3, 4);
        let w = TAU / n as f64;
        let truth = |k: usize| (3.0 * w * k as f64).sin() + 0.4 * (11.0 * w * k as f64).cos();
        let read = |k: usize| (truth(k) / STEP).round() * STEP;
        let decimator = Decimator::new(every, 500.0).unwrap();
        let of = |f: &dyn Fn(usize) -> f64| JointSignals::from_fn(1, n * periods, |_, k| f(k));
        let (rows, exact) = (of(&read), of(&truth));
        let kept = |y: &JointSignals| {
            y.map_joints(|_, y| decimator.decimate(y, &mut Scratch::default()).unwrap())
        };
        let (q, clean) = (kept(&rows), kept(&exact));
        let m = n / every;
        // The middle one of three periods is far from the ends of the filter.
        let off: Vec<f64> = (m..2 * m).map(|k| q.joint(0)[k] - clean.joint(0)[k]).collect();
        let record = PeriodicRecord::decimated([q.clone(), q.clone()], [&rows, &rows], n, every);
        let [said, _] = record.rounding(0);
        let forward = fourier::forward(m);
        let (mut scratch, mut spectrum) = (
            vec![fourier::Complex64::ZERO; forward.get_scratch_len()],
            vec![fourier::Complex64::ZERO; m / 2 + 1],
        );
        let mut time = off.clone();
        forward.process_with_scratch(&mut time, &mut spectrum, &mut scratch).unwrap();
        let band = 12..(0.3 * m as f64) as usize;
        let power: f64 = spectrum[band.clone()].iter().map(|c| c.norm_sqr()).sum();
        let per_sample = power / (band.len() * m) as f64;
        // 363 harmonics have a mean square with a relative sd of 5 %; 4 sd.
        assert!((per_sample / said - 1.0).abs() < 0.2, "{per_sample:e}, said {said:e}");
        // Taken from the samples that are kept, it would be nothing.
        assert_eq!(PeriodicRecord::new(q.clone(), q, m).rounding(0), [0.0; 2]);
    }
}
