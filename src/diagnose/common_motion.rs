//! Torque of every period, corrected to what it would have been along one motion common to all periods.
//!
//! A model can only be as good as the motion that is put into it. The averaged acceleration is a short Fourier series.
//! Beyond its last harmonic the torque still contains the effect of friction's corners on the acceleration, and the
//! motion of every period differs a little from the mean. The rigid model corrects for both; it is accurate enough for
//! small differences:
//!
//! y*_p = y_p − [τ̂_rigid(q_p, q̇_p, q̈_p) − τ̂_rigid(q̄, q̇̄, q̈)]
//!
//! The first term takes the motion of period p itself, with all its harmonics and all its encoder noise. The second
//! term takes the mean angles and velocities with all their harmonics, at which friction is evaluated, and the short
//! series of the acceleration. y* is then regressed on this common motion, whose columns are almost free of noise,
//! while the scatter of y* between the periods is that of the equations: noise of torque and motion together. Whitening
//! by this scatter gives noisy harmonics the weight they deserve (errors in variables, to first order). The effect of
//! the noise d_p in the velocity of period p on the friction φ,
//!
//! δ_p = √P [φ(q̇̄ + d_p/√P) − mean over p of the same],
//!
//! is subtracted from y*_p as well. It is evaluated with the step d_p/√P, which is the size of the error of the mean,
//! because friction turns round within a few hundredths of a rad/s, where the noise of a single period is not small.
//! The mean of y* over the periods does not change by δ_p.
//!
//! The acceleration, and the velocity of a joint that rests or creeps, keep only the harmonics in which they stand out of
//! their noise. Noise left in them is also in the equations, with the opposite sign, and therefore resembles any effect that
//! depends on them. Only a few percent of the harmonics of an inertia's column are noise, but where the noise of the
//! torque falls steeply with frequency these harmonics have the largest weight; and the friction of a joint at rest
//! changes its sign with the noise of its velocity. (Cycles of moves with pauses between them, without any fault, showed
//! torque that was late by 0.5 to 3 ms.) The velocity of a joint that reverses keeps all its harmonics, because they make
//! the kink at the reversal: friction that turns round too softly looks like friction that comes late.

use fourier::Complex64;

use super::friction_drift::FrictionDrift;
use super::load::load_along;
use super::mean_spectrum::{BAND, Band, MeanSpectrum};
use super::scene::equivalent_arm;
use crate::base::BaseSet;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, BetweenRows, Regression};
use crate::robot::{Arm, JointSignals};
use crate::signal::{Bracket, FineClock, cubic_at, mean_period, subtract_mean_period};

/// Corrects the torque of `regression` to the common motion of its periods, using the base parameters `theta`, and
/// recomputes its columns along this motion.
///
/// Where the log was resampled on an even clock, its torque is a straight line between rows. This cuts off the corners
/// of friction there, which looks like friction that builds up after reversals and like a delay. The difference between
/// the predicted torque and the straight line through the predictions at the rows is therefore added.
///
/// A single run is left unchanged: it has no motion but its own.
pub fn move_to_common_motion(
    regression: &mut Regression,
    (arm, set): (&Arm, &BaseSet),
    theta: &[f64],
) {
    let Some(each_period) = &regression.prepared.each_period else { return };
    let n = regression.problem.samples;
    let joints = 0..each_period.qd_rad_s.joints();
    let bands: Vec<Bands> =
        joints.map(|j| Bands::that_stand_out(each_period.qd_rad_s.joint(j), n)).collect();
    let sampled =
        Sampled { rate_hz: regression.problem.rate_hz, width_rad_s: arm.friction_epsilon_rad_s };
    let own_rad_s =
        each_period.qd_rad_s.map_joints(|j, qd| bands[j].without_noise_at_rest(qd, &sampled));
    let common = Motion {
        q_rad: each_period.q_rad.map_joints(|_, q| mean_period(q, n)),
        qd_rad_s: own_rad_s.map_joints(|_, qd| mean_period(qd, n)),
        qdd_rad_s2: regression.prepared.motion.qdd_rad_s2.map_joints(|j, qdd| bands[j].of(qdd)),
    };
    let (arm, _) = equivalent_arm(arm, set, theta);
    let model = Model::new(&arm);
    let own_nm = load_along(&model, &arm, each_period);
    let common_nm = load_along(&model, &arm, &common);
    let mut torque_nm = regression.prepared.torque_nm.map_joints(|j, y| {
        let moved = own_nm.joint(j).iter().zip(common_nm.joint(j).iter().cycle());
        y.iter().zip(moved).map(|(y, (own, common))| y - (own - common)).collect()
    });
    for j in 0..torque_nm.joints() {
        let (own, mean) = (own_rad_s.joint(j), common.qd_rad_s.joint(j));
        let noise = friction_noise(&arm, j, own, mean);
        torque_nm.joint_mut(j).iter_mut().zip(noise).for_each(|(y, noise)| *y -= noise);
    }
    if let Some(between) = &regression.prepared.between {
        let processing = &regression.prepared.processing;
        let (start_s, rate_hz) = (processing.window_s[0], processing.rate_hz);
        let rows = Rows { between, start_s, rate_hz };
        for j in 0..torque_nm.joints() {
            let lost = rows.lost_to_straight_lines(&arm, j, &own_nm, each_period);
            torque_nm.joint_mut(j).iter_mut().zip(lost).for_each(|(y, lost)| *y += lost);
        }
    }
    Assembler::new(&model).assemble(&mut regression.problem, &model, &common, &torque_nm);
    regression.prepared.motion = common;
}

/// Standard deviation of the mean over the periods at every sample, Nm: the error that noise of torque and motion
/// leaves there, without drift of friction. `None` where nothing repeats. `regression` must have been moved to its
/// common motion.
pub fn noise_of_mean(regression: &Regression) -> Option<JointSignals> {
    let (n, periods) = (regression.problem.samples, regression.problem.periods);
    if periods < 2 {
        return None;
    }
    let [of_mean, of_scatter] = regression.prepared.kept();
    let panels = &regression.problem.panels;
    let drift = FrictionDrift::beside_mean(&regression.prepared.motion.qd_rad_s, periods);
    let scatter = panels.iter().enumerate().map(|(j, panel)| {
        let mut off = panel.y.clone();
        drift.remove(j, &mut off, |_| true);
        subtract_mean_period(&mut off, n);
        off.iter_mut().for_each(|off| *off *= *off);
        mean_period(&off, n)
    });
    let scatter: Vec<Vec<f64>> = scatter.collect();
    let share = 1.0 / ((periods - 1) as f64 * of_scatter * of_mean);
    Some(JointSignals::from_fn(panels.len(), n, |j, k| (scatter[j][k] * share).sqrt()))
}

/// Least ratio of a band's power in the mean of the periods to the power of the noise in that mean: from here on the
/// band contains more motion than noise.
const STANDS_OUT: f64 = 2.0;

/// A joint is at rest while its velocity stays below this many σ of the noise in the rejected bands, for [`NEAR_S`]
/// before and after: a joint that reverses is faster by then.
const AT_REST: f64 = 15.0;
const NEAR_S: f64 = 0.04;
/// A joint creeps while its velocity stays below this many widths ε over which friction turns round, for [`CREEPS_S`]
/// before and after, and the rejected bands hold no more than [`LIKE_NOISE`] times the σ of their noise there, in which a
/// kink would stand out. From three widths on, friction is flat, and noise of the velocity does nothing to it.
const CREEPING: f64 = 3.0;
const CREEPS_S: f64 = 0.08;
const LIKE_NOISE: f64 = 1.5;

/// Bands of harmonics in which a motion is kept.
struct Bands {
    /// Whether each band is kept, from harmonic 1 on.
    kept: Vec<bool>,
    clock: FineClock,
}

impl Bands {
    /// Finds the bands in which the mean of the periods in `y`, of `n` samples each, stands out of its noise, which is
    /// known from the scatter between the periods.
    fn that_stand_out(y: &[f64], n: usize) -> Self {
        let clock = FineClock::new(n, 1);
        let stands_out = |band: Band| band.power >= STANDS_OUT * band.noise;
        // The mean velocity, harmonic 0, is always kept.
        let kept = MeanSpectrum::of(&clock, y).bands(1).map(stands_out).collect();
        Self { kept, clock }
    }

    /// One period of a motion, reduced to the bands that are kept.
    fn of(&self, period: &[f64]) -> Vec<f64> {
        let is_kept = |h: usize| h == 0 || self.kept[(h - 1) / BAND];
        self.clock.filtered(period, |h| if is_kept(h) { Complex64::ONE } else { Complex64::ZERO })
    }

    /// The velocities `own` of all periods; where their joint rests or creeps, reduced to the bands that are kept.
    fn without_noise_at_rest(&self, own: &[f64], sampled: &Sampled) -> Vec<f64> {
        let n = self.clock.samples();
        let told: Vec<f64> = own.chunks_exact(n).flat_map(|period| self.of(period)).collect();
        let mean = mean_period(&told, n);
        let mut rejected: Vec<f64> = own.iter().zip(&told).map(|(own, told)| own - told).collect();
        let off: Vec<f64> = mean_period(&rejected, n).iter().map(|off| off * off).collect();
        subtract_mean_period(&mut rejected, n);
        let periods = own.len() / n;
        let scatter = rejected.iter().map(|off| off * off).sum::<f64>();
        let noise = scatter / (n * periods * (periods - 1)) as f64;
        let slow = AT_REST * (off.iter().sum::<f64>() / n as f64).sqrt();
        let [near, long] =
            [NEAR_S, CREEPS_S].map(|s| ((s * sampled.rate_hz).ceil() as usize).min(n / 2));
        // The motion is periodic: the first sample follows the last.
        let around = |k: usize, reach: usize| (n + k - reach..=n + k + reach).map(|at| at % n);
        let stays_below = |k: usize, reach: usize, limit_rad_s: f64| {
            around(k, reach).all(|at| mean[at].abs() < limit_rad_s)
        };
        let is_like_noise = |k: usize| {
            let squares = around(k, long).map(|at| off[at]).sum::<f64>();
            squares < LIKE_NOISE * LIKE_NOISE * noise * (2 * long + 1) as f64
        };
        let rests = |k: usize| {
            stays_below(k, near, slow)
                || stays_below(k, long, CREEPING * sampled.width_rad_s) && is_like_noise(k)
        };
        let rests: Vec<bool> = (0..n).map(rests).collect();
        let of_row =
            |(k, (told, own)): (usize, (&f64, &f64))| if rests[k % n] { *told } else { *own };
        told.iter().zip(own).enumerate().map(of_row).collect()
    }
}

/// The samples of a log, and the width ε over which friction turns round, rad/s.
struct Sampled {
    rate_hz: f64,
    width_rad_s: f64,
}

/// δ_p (see the module) of joint `j`, Nm, at every sample of all periods. `own` are the velocities of all periods,
/// `mean` is their mean.
fn friction_noise(arm: &Arm, j: usize, own: &[f64], mean: &[f64]) -> Vec<f64> {
    let (n, drive) = (mean.len(), &arm.joints[j].drive);
    let periods = own.len() / n;
    let scale = (periods as f64).sqrt();
    let friction = |qd: f64| drive.coulomb_nm * arm.friction_sign(qd) + drive.viscous_nm_s_rad * qd;
    let of_mean = mean.iter().cycle().zip(own);
    let mut noise: Vec<f64> =
        of_mean.map(|(mean, own)| scale * friction(mean + (own - mean) / scale)).collect();
    subtract_mean_period(&mut noise, n);
    noise
}

/// The rows of a log that was resampled on an even clock.
struct Rows<'a> {
    between: &'a BetweenRows,
    start_s: f64,
    rate_hz: f64,
}

impl Rows<'_> {
    /// Predicted torque of joint `j` minus the straight line through the predictions at the neighbouring rows, Nm, at
    /// every sample of all periods. `load_nm` and `motion` are those of the periods.
    fn lost_to_straight_lines(
        &self,
        arm: &Arm,
        j: usize,
        load_nm: &JointSignals,
        motion: &Motion,
    ) -> Vec<f64> {
        let drive = &arm.joints[j].drive;
        let dry = |qd: f64| drive.coulomb_nm * arm.friction_sign(qd);
        let qd_rad_s = motion.qd_rad_s.joint(j);
        let pairs = load_nm.joint(j).iter().zip(qd_rad_s);
        // The smooth part of the torque, which may be interpolated: rows lie between the samples.
        let smooth: Vec<f64> = pairs.map(|(load, qd)| load + drive.viscous_nm_s_rad * qd).collect();
        let at_row = |row: usize| {
            let at = (self.between.time_s[row] - self.start_s) * self.rate_hz;
            cubic_at(&smooth, at) + dry(self.between.qd_rad_s.joint(j)[row])
        };
        let samples = smooth.iter().zip(qd_rad_s).zip(&self.between.places);
        samples
            .map(|((smooth, qd), &Bracket { left, u })| {
                if u == 0.0 {
                    return 0.0;
                }
                smooth + dry(*qd) - (1.0 - u) * at_row(left) - u * at_row(left + 1)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};
    use std::f64::consts::TAU;

    const SAMPLES: usize = 1000;
    const PERIODS: usize = 8;
    const RATE_HZ: f64 = 100.0;

    /// Periods of `mean(k)` plus white noise of standard deviation `noise`.
    fn periods(mean: impl Fn(usize) -> f64, noise: f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut random = || -> f64 { StandardNormal.sample(&mut rng) };
        (0..SAMPLES * PERIODS).map(|k| mean(k % SAMPLES) + noise * random()).collect()
    }

    fn rms(y: impl ExactSizeIterator<Item = f64>) -> f64 {
        let samples = y.len() as f64;
        (y.map(|y| y * y).sum::<f64>() / samples).sqrt()
    }

    /// Harmonics 3 and 101 contain motion; their two bands, with 14 harmonics of noise, stand out. In a band of noise
    /// alone, F with 16 and 112 degrees of freedom exceeds 2 by chance in 2 of 100 cases; more than eight of the 61
    /// bands of noise do so once in 10⁵ times. With this many bands the motion keeps at most √(11 · 16/1000) of the
    /// noise of its mean.
    #[test]
    fn noise_without_motion_goes() {
        let wave = |h: f64, k: usize| (TAU * h * k as f64 / SAMPLES as f64).sin();
        let motion = |k: usize| wave(3.0, k) + 0.1 * wave(101.0, k);
        let noise = 0.05;
        let y = periods(motion, noise);
        let bands = Bands::that_stand_out(&y, SAMPLES);
        let kept = bands.kept.iter().filter(|kept| **kept).count();
        assert!(bands.kept[0] && bands.kept[12] && kept <= 2 + 8, "{kept} of {}", bands.kept.len());
        let mean = mean_period(&y, SAMPLES);
        let told = bands.of(&mean);
        let off = rms(told.iter().enumerate().map(|(k, told)| told - motion(k)));
        let of_mean = noise / (PERIODS as f64).sqrt();
        assert!(off < of_mean * (11.0 * 16.0 / SAMPLES as f64).sqrt(), "{off}");
    }

    /// A motion that repeats exactly has no noise to stand out of, up to the rounding of a sum over n samples.
    #[test]
    fn a_motion_without_noise_stays_what_it_is() {
        let kink = |k: usize| (k as f64 - 300.0).abs() / 300.0;
        let y = periods(kink, 0.0);
        let bands = Bands::that_stand_out(&y, SAMPLES);
        let off =
            bands.of(&y[..SAMPLES]).iter().zip(&y).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < SAMPLES as f64 * f64::EPSILON, "{off}");
    }

    /// The velocity of a joint that moves for half a period and rests for the other half. Its harmonics fall as 1/h³
    /// and drop below the noise of their mean at h = 28. With these bands, and a few kept by chance, less than half of
    /// the noise remains at rest. Where the joint moves nothing changes.
    #[test]
    fn velocity_loses_its_noise_at_rest_alone() {
        let moves = SAMPLES / 2;
        let phase = |k: usize| TAU * k as f64 / moves as f64;
        let speed = |k: usize| if k < moves { 0.5 - 0.5 * phase(k).cos() } else { 0.0 };
        let y = periods(speed, 1e-3);
        let bands = Bands::that_stand_out(&y, SAMPLES);
        let sampled = Sampled { rate_hz: RATE_HZ, width_rad_s: 1e-6 };
        let told = bands.without_noise_at_rest(&y, &sampled);
        let rest = moves + 100..SAMPLES - 100;
        assert!(rms(told[rest.clone()].iter().copied()) < 0.5 * rms(y[rest].iter().copied()));
        assert_eq!(told[100..moves - 100], y[100..moves - 100]);
    }

    /// A joint that creeps at 0.1 rad/s, faster than fifteen σ of the noise of its mean, while friction turns round over
    /// 0.1 rad/s. Of a kink of fifteen σ of that noise, all is kept within 80 ms.
    #[test]
    fn velocity_loses_its_noise_where_a_joint_creeps_without_a_kink() {
        let noise = 1e-3;
        let kink = |k: usize| if k == 700 { 15.0 * noise / (PERIODS as f64).sqrt() } else { 0.0 };
        let y = periods(|k| 0.1 + kink(k), noise);
        let bands = Bands::that_stand_out(&y, SAMPLES);
        let of_width = |width_rad_s| {
            let sampled = Sampled { rate_hz: RATE_HZ, width_rad_s };
            bands.without_noise_at_rest(&y, &sampled)
        };
        let told = of_width(0.1);
        let left = |y: &[f64]| rms(y[..600].iter().map(|qd| qd - 0.1));
        assert!(left(&told) < 0.5 * left(&y));
        assert_eq!(told[692..=708], y[692..=708]);
        // Where friction is flat at that speed, nothing changes.
        assert_eq!(of_width(0.03), y);
    }

    /// δ_p of a velocity far from rest is the viscous friction of its noise, and its mean over the periods is zero.
    #[test]
    fn noise_of_the_velocity_rubs() {
        let arm = Arm::built_in("ur5").unwrap();
        let own = periods(|_| 1.0, 1e-3);
        let mean = mean_period(&own, SAMPLES);
        let noise = friction_noise(&arm, 1, &own, &mean);
        let viscous = arm.joints[1].drive.viscous_nm_s_rad;
        for (k, noise) in noise.iter().enumerate() {
            let expected = viscous * (own[k] - mean[k % SAMPLES]);
            // tanh(1/ε) is flat to the last bits for the UR5's ε of 0.02 rad/s.
            assert!((noise - expected).abs() < 1e-12, "{noise} {expected}");
        }
        let common = mean_period(&noise, SAMPLES);
        // The mean of eight numbers of about 30 Nm was subtracted from each: zero to their last digits.
        assert!(common.iter().all(|common| common.abs() < 8.0 * 30.0 * f64::EPSILON));
    }
}
