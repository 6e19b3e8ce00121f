use super::*;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};

const RATE_HZ: f64 = 125.0;

/// A five-harmonic motion of `joints` joints: angle, velocity, acceleration at time t.
fn motion(joint: usize, t: f64, period_s: f64) -> [f64; 3] {
    (1..=5).fold([0.4 * joint as f64, 0.0, 0.0], |[q, qd, qdd], h| {
        let w = 2.0 * PI * h as f64 / period_s;
        let (s, c) = (w * t + (joint * h) as f64).sin_cos();
        let a = 0.5 / h as f64;
        [q + a * s, qd + a * w * c, qdd - a * w * w * s]
    })
}

fn record(n: usize, p: usize, sigma: [f64; 2], seed: u64) -> PeriodicRecord {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
    let [q_rad, qd_rad_s] = [0, 1].map(|i| {
        JointSignals::from_fn(6, n * p, |j, k| {
            motion(j, k as f64 / RATE_HZ, n as f64 / RATE_HZ)[i] + sigma[i] * noise()
        })
    });
    PeriodicRecord::new(q_rad, qd_rad_s, n)
}

fn rms_error(found: &JointSignals, j: usize, which: usize) -> f64 {
    let n = found.samples();
    let square: f64 = (0..n)
        .map(|k| motion(j, k as f64 / RATE_HZ, n as f64 / RATE_HZ)[which])
        .zip(found.joint(j))
        .map(|(truth, value)| (value - truth).powi(2))
        .sum();
    (square / n as f64).sqrt()
}

#[test]
fn without_noise_the_derivatives_are_exact_to_rounding() {
    for n in [1250, 1251] {
        let record = record(n, 3, [0.0, 0.0], 0);
        let fit = PeriodicFit::new(n, 3, RATE_HZ).unwrap();
        let m = fit.fit(&record, &mut FitScratch::default()).unwrap();
        for j in 0..6 {
            assert!(m.harmonics[j] >= 5);
            // Rounding of a coefficient, 1e-16, grows by ω and ω² of the highest harmonic.
            let w = fit.angular_frequency(n / 2);
            assert!(rms_error(&m.q_rad, j, 0) < 1e-14);
            assert!(rms_error(&m.qd_rad_s, j, 1) < 1e-15 * (10.0 + w));
            assert!(rms_error(&m.qdd_rad_s2, j, 2) < 1e-15 * (100.0 + w * w));
        }
    }
}

/// Every period separately: without noise it is the motion; with noise the periods scatter about their own mean,
/// which the fit of all periods is close to.
#[test]
fn each_period_is_the_motion_with_its_own_noise() {
    let (n, p) = (1250, 4);
    let fit = PeriodicFit::new(n, p, RATE_HZ).unwrap();
    let mut scratch = FitScratch::default();
    let record = self::record(n, p, [0.0, 0.0], 0);
    let each = fit.each_period(&record, 0.32, &mut scratch).unwrap();
    for (which, found) in each.iter().enumerate() {
        // Rounding, 1e-16 of an angle, grows by ω ≤ 2π 0.32 · 125 rad/s per derivative.
        let limit = 1e-14 * 251.0f64.powi(which as i32);
        for (j, k) in (0..6).flat_map(|j| (0..n * p).map(move |k| (j, k))) {
            let truth = motion(j, k as f64 / RATE_HZ, n as f64 / RATE_HZ)[which];
            assert!((found.joint(j)[k] - truth).abs() < limit, "joint {j}, sample {k}");
        }
    }
    let record = self::record(n, p, [2e-5, 1e-3], 1);
    let [found, ..] = fit.each_period(&record, 0.32, &mut scratch).unwrap();
    let mean = fit.fit(&record, &mut scratch).unwrap().q_rad;
    // Angle and velocity together have the variance 1/(1/σ_q² + ω²/σ_q̇²) per harmonic. For each harmonic the fit
    // contains the mean of the periods, or nothing: (P − 1)/P of the variance, or all of it, is scatter. Some 650
    // degrees of freedom determine the rms of a joint to 2.8 %; the limit is four times that, one seed in 2000.
    let variance = |h: usize| 1.0 / (2e-5f64.powi(-2) + (fit.angular_frequency(h) / 1e-3).powi(2));
    let highest = (0.32 * n as f64) as usize;
    let expected = (2.0 / n as f64 * (1..=highest).map(variance).sum::<f64>()).sqrt();
    let least = expected * (1.0 - 1.0 / p as f64).sqrt();
    for j in 0..6 {
        let scatter = |k: usize| found.joint(j)[k] - mean.joint(j)[k % n];
        let rms = ((0..n * p).map(|k| scatter(k).powi(2)).sum::<f64>() / (n * p) as f64).sqrt();
        assert!(rms > 0.89 * least && rms < 1.11 * expected, "joint {j}: {rms:e}, {expected:e}");
    }
}

const TRIALS: u64 = 40;

/// Mean ratio of the squared error of the acceleration to the predicted one, and the number of joints with too much
/// noise, over records of eight periods of 1250 samples.
fn of_claimed(record: impl Fn(u64) -> PeriodicRecord) -> (f64, usize) {
    let (n, p) = (1250, 8);
    let fit = PeriodicFit::new(n, p, RATE_HZ).unwrap();
    let mut scratch = FitScratch::default();
    let mut ratio = 0.0;
    let mut too_noisy = 0;
    for seed in 0..TRIALS {
        let record = record(seed);
        let m = fit.fit(&record, &mut scratch).unwrap();
        for j in 0..6 {
            let noise = m.acceleration[j].noise.iter().sum::<f64>();
            let square = (0..n)
                .map(|k| motion(j, k as f64 / RATE_HZ, n as f64 / RATE_HZ)[2].powi(2))
                .sum::<f64>()
                / n as f64;
            assert!(m.harmonics[j] > 5);
            too_noisy += usize::from(noise > 1.1 * FREE_NOISE * square);
            ratio += rms_error(&m.qdd_rad_s2, j, 2).powi(2) / noise;
        }
    }
    (ratio / (6 * TRIALS) as f64, too_noisy)
}

/// The error of the acceleration agrees with the predicted one.
#[test]
fn with_noise_the_claimed_noise_of_the_acceleration_holds() {
    let (mean, too_noisy) = of_claimed(|seed| record(1250, 8, [2e-5, 1e-3], seed));
    // 100 harmonics and more are 200 normal numbers, unevenly weighted (ω²): about 110 effective
    // ones, relative sd of the mean square √(2/110/240) = 0.9 %; 5 sd.
    assert!((mean - 1.0).abs() < 0.045, "squared error / claimed variance = {mean}");
    // 240 joints, each with a probability of 1 % of keeping a band of pure noise: more than 9 of them in 5e-4 of
    // the runs.
    assert!(too_noisy <= 9, "{too_noisy} of 240 joints kept too much noise");
}

/// So it does where the velocity is the slope of the angle over five rows. As a second measurement it would halve the
/// predicted square, and bend the series where slopes fall short of the velocity. With ten harmonics at least, 20
/// normal numbers are 9 effective ones: √(2/9/240) = 3 %; 5 sd.
#[test]
fn slopes_of_the_angle_are_no_second_measurement() {
    let (mean, _) = of_claimed(|seed| {
        let q = record(1250, 8, [2e-5, 0.0], seed).q_rad().clone();
        let slope = |y: &[f64], k: usize| {
            let at = |by: usize| y[(k + y.len() + by - 2) % y.len()];
            (at(0) - 8.0 * at(1) + 8.0 * at(3) - at(4)) / 12.0 * RATE_HZ
        };
        let qd = q.map_joints(|_, y| (0..y.len()).map(|k| slope(y, k)).collect());
        PeriodicRecord::new(q, qd, 1250)
    });
    assert!((mean - 1.0).abs() < 0.15, "squared error / claimed variance = {mean}");
}

/// The deviations of the periods from their mean predict the error of the mean.
#[test]
fn deviations_over_the_root_of_the_periods_are_the_errors_of_the_mean() {
    let (n, p) = (1250, 8);
    let fit = PeriodicFit::new(n, p, RATE_HZ).unwrap();
    let mut scratch = FitScratch::default();
    let (mut errors, mut claimed) = ([0.0; 3], [0.0; 3]);
    for seed in 0..TRIALS {
        let record = record(n, p, [2e-5, 1e-3], seed);
        let mean = fit.fit(&record, &mut scratch).unwrap();
        let deviations = fit.deviations(&record, &mut scratch).unwrap();
        let means = [&mean.q_rad, &mean.qd_rad_s, &mean.qdd_rad_s2];
        for (which, (mean, off)) in means.into_iter().zip(&deviations).enumerate() {
            for j in 0..6 {
                errors[which] += n as f64 * rms_error(mean, j, which).powi(2);
                claimed[which] += off.joint(j).iter().map(|d| d * d).sum::<f64>();
                let sum: f64 = off.joint(j).iter().skip(7).step_by(n).sum();
                assert!(sum.abs() < 1e-10, "deviations of joint {j} sum to {sum:e}");
            }
        }
    }
    // 240 joints with at least 16 numbers of similar weight (slow harmonics for the angle, fast ones for the
    // acceleration): the errors' mean square has a relative sd of √(2/16/240) = 2.3 %, the claim 0.9 %; the limit
    // is 5 sd.
    for (errors, claimed) in errors.into_iter().zip(claimed) {
        let ratio = errors / (claimed / (p * (p - 1)) as f64);
        assert!((ratio - 1.0).abs() < 0.12, "squared error over claim: {ratio}");
    }
}

/// Above the last visible band of the motion, harmonics are added only while their noise is negligible.
#[test]
fn much_noise_ends_the_series_with_the_motion() {
    let (n, p) = (1250, 8);
    let fit = PeriodicFit::new(n, p, RATE_HZ).unwrap();
    let mut too_many = 0;
    for seed in 0..40 {
        let record = record(n, p, [1e-2, 3e-1], seed);
        let m = fit.fit(&record, &mut FitScratch::default()).unwrap();
        too_many += m.harmonics.iter().filter(|h| **h != BAND_HARMONICS).count();
    }
    // 240 joints with a probability of 1 % each: more than 9 of them in 5e-4 of the runs.
    assert!(too_many <= 9, "{too_many} of 240 joints kept a band of pure noise");
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    assert!(matches!(PeriodicFit::new(100, 1, 125.0), Err(SignalError::Periods { .. })));
    assert!(matches!(PeriodicFit::new(4, 2, 125.0), Err(SignalError::TooFewSamples { .. })));
    let fit = PeriodicFit::new(100, 2, 125.0).unwrap();
    let zeros = |samples| JointSignals::zeros(6, samples);
    let short = PeriodicRecord::new(zeros(199), zeros(199), 100);
    let mut scratch = FitScratch::default();
    assert!(matches!(
        fit.fit(&short, &mut scratch),
        Err(SignalError::Mismatch { expected: 200, found: 199, .. })
    ));
    let good = PeriodicRecord::new(zeros(200), zeros(200), 100);
    let still = fit.fit(&good, &mut scratch).unwrap();
    assert_eq!(still.harmonics, [0; 6]);
    let mut bad = zeros(200);
    bad.joint_mut(4)[17] = f64::NAN;
    let bad = PeriodicRecord::new(zeros(200), bad, 100);
    assert!(matches!(
        fit.fit(&bad, &mut scratch),
        Err(SignalError::NotFinite { what: "velocity", joint: 4, sample: 17, .. })
    ));
}
