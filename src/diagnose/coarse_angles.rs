//! Velocities of a repeated motion whose angles were read in coarse steps.
//!
//! A motion that repeats to less than a step of its angles is rounded alike in every period. No average removes this
//! error, and where no velocities were recorded, their rates have it: steps of 0.01° at 250 Hz make 18 mrad/s of it,
//! about the width ε over which friction turns round. The scatter that stands for it
//! ([`PeriodicRecord`](crate::signal::PeriodicRecord)) has the same power, but spread over the whole period, while the
//! error of friction has all of it where a joint reverses: along eight reversals it looked like another width, like a
//! delay, or like bristles.
//!
//! The error grows with frequency, and the kink that friction makes in the velocity at a reversal fades with it. Friction
//! is therefore evaluated at the velocity up to the harmonic at which its noise is a small share of ε ([`QUIET`]). What the
//! harmonics beyond it tell of the kink is less than what their noise hides. The noise that is left, and the kink that is
//! lost, are an unknown velocity at every single reversal ([`turns`]).

use super::drives::reversals;
use super::image::Column;
use super::kept_bands::KeptBands;
use super::scene::Scene;
use crate::identify::Prepared;

/// Noise of the velocity, as a share of ε, up to which harmonics are used.
///
/// Of four clean logs of a UR10e (eight periods of 10 s; steps of 0.01° at 125 and 250 Hz, of 0.1 mrad at 250 Hz), the
/// residual along a change of the width has, over its noise, an rms of 3 to 6 with all harmonics and of 0.9 to 1.4 with
/// this share; along a pulse at every reversal 1.9 to 2.8, and 1.2 to 1.7; along a Stribeck curve 1.5 to 3.2, and 0.8 to
/// 0.9; along a delay of friction 2.6 to 3.8, and 1.5 to 3.4. (Angles without rounding: 1.1, 1.4, 1.1 and 1.6.) With 0.03,
/// the kinks become so soft that friction seems to come late (4.4 to 7.1); with 0.1, the width is 1.1 to 1.3.
const QUIET: f64 = 0.07;

/// Error of the velocity at a reversal over the noise that is left, in rms: the kink adds to it. In two of these logs it is
/// 0.8 to 1.5 on joints 1, 2, 3 and 5, and 2.0 to 2.3 on joints 4 and 6, whose kinks are larger; 1.5 in rms. Without this
/// error, a ripple on joint 4 explained 46, where ripples explain up to 19 of logs without rounding.
const WITH_KINK: f64 = 1.5;
/// Number of reversals of a joint in one period that have a torque of their own; any further ones share these in turn.
const MOST_REVERSALS: usize = 64;

/// A joint whose friction is evaluated at a velocity without its fastest harmonics.
pub struct CoarseAngles {
    /// The joint (0-based).
    pub joint: usize,
    /// Highest frequency of that velocity, Hz.
    pub highest_hz: f64,
    /// Error of that velocity at reversals, at one standard deviation, rad/s.
    pub error_rad_s: f64,
    /// What is kept of the velocity.
    bands: KeptBands,
}

impl CoarseAngles {
    /// Joint `j` of `prepared`, whose friction turns round over `width_rad_s`. `None` if its angles are fine, or no
    /// harmonic of its velocity is too noisy.
    pub fn of(prepared: &Prepared, j: usize, width_rad_s: f64) -> Option<Self> {
        let (recorded, each) = (prepared.recorded.as_ref()?, prepared.each_period.as_ref()?);
        let motion = (each.qd_rad_s.joint(j), prepared.motion.samples());
        let rate_hz = prepared.processing.rate_hz;
        recorded.has_coarse_angles(j).then(|| Self::along(motion, j, width_rad_s, rate_hz))?
    }

    /// From the velocities of all periods, of so many samples each.
    fn along(
        (own, n): (&[f64], usize),
        joint: usize,
        width_rad_s: f64,
        rate_hz: f64,
    ) -> Option<Self> {
        let (bands, noise_rad_s) = KeptBands::quieter_than(QUIET * width_rad_s, own, n)?;
        Some(Self {
            joint,
            highest_hz: bands.highest() as f64 * rate_hz / n as f64,
            error_rad_s: WITH_KINK * noise_rad_s,
            bands,
        })
    }

    /// Takes the harmonics that are too noisy out of the velocities `own` of all periods of `n` samples.
    pub fn quieten(&self, own: &mut [f64], n: usize) {
        for period in own.chunks_exact_mut(n) {
            period.copy_from_slice(&self.bands.of(period));
        }
    }
}

/// Torques by which the friction of joint `j` of `scene` may err at single reversals, each at one standard deviation;
/// none where its angles are fine.
pub fn turns(scene: &Scene, j: usize) -> Vec<Column> {
    let error_rad_s = scene.velocity_error_rad_s[j];
    if error_rad_s == 0.0 {
        return Vec::new();
    }
    let width_rad_s = scene.arm.friction_epsilon_rad_s;
    let reversals = reversals(scene.motion.qd_rad_s.joint(j), width_rad_s);
    let groups = reversals.len().min(MOST_REVERSALS);
    let nearest = nearest(&reversals, scene.samples());
    // tanh(q̇/ε) rises by (1 − tanh²)/ε.
    let height_nm = scene.coulomb_nm[j].abs() * error_rad_s / width_rad_s;
    let of_group = |group: usize| {
        let err = |(sign, which): (&f64, &usize)| match which % MOST_REVERSALS == group {
            true => height_nm * (1.0 - sign * sign),
            false => 0.0,
        };
        Column::on(j, scene.sign.joint(j).iter().zip(&nearest).map(err).collect())
    };
    (0..groups).map(of_group).collect()
}

/// For each of `n` samples of a period, which of the `reversals` is nearest.
fn nearest(reversals: &[usize], n: usize) -> Vec<usize> {
    let distance = |k: usize, at: usize| {
        let apart = k.abs_diff(at);
        apart.min(n - apart)
    };
    let of = |k: usize| {
        (0..reversals.len()).min_by_key(|which| distance(k, reversals[*which])).unwrap_or(0)
    };
    (0..n).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noisy_periods::{PERIODS, SAMPLES, periods, rms};
    use crate::signal::mean_period;
    use std::f64::consts::TAU;

    const WIDTH_RAD_S: f64 = 0.02;

    fn along(own: &[f64]) -> Option<CoarseAngles> {
        CoarseAngles::along((own, SAMPLES), 1, WIDTH_RAD_S, 100.0)
    }

    /// Noise of the mean as large as ε, white: a share of 0.07² of its square lies below harmonic 500 · 0.0049 = 2.5,
    /// less than one band, and the motion in harmonic 2 stands out. Its noise in that band of eight is √(16/1000) ε.
    #[test]
    fn a_noisy_velocity_keeps_its_motion() {
        let motion = |k: usize| 0.5 * (TAU * 2.0 * k as f64 / SAMPLES as f64).sin();
        let mut own = periods(motion, WIDTH_RAD_S * (PERIODS as f64).sqrt());
        let coarse = along(&own).unwrap();
        assert_eq!((coarse.joint, coarse.highest_hz), (1, 0.8));
        let noise = WIDTH_RAD_S * 0.016f64.sqrt();
        // From 112 deviations, the noise is known to 7 %, of which three are allowed.
        let told = coarse.error_rad_s / WITH_KINK;
        assert!((told / noise - 1.0).abs() < 0.2, "{told}");
        coarse.quieten(&mut own, SAMPLES);
        let mean = mean_period(&own, SAMPLES);
        let off = rms(mean.iter().enumerate().map(|(k, qd)| qd - motion(k)));
        // The rms of its 16 numbers is known to 18 %; three of these.
        assert!((off / noise - 1.0).abs() < 0.54, "{off}");
    }

    /// Velocities as quiet as usual keep all their harmonics.
    #[test]
    fn a_quiet_velocity_is_kept_whole() {
        assert!(along(&periods(|k| (TAU * k as f64 / SAMPLES as f64).sin(), 1e-3)).is_none());
    }

    #[test]
    fn samples_belong_to_the_nearest_reversal_around_the_period() {
        assert_eq!(nearest(&[1, 5], 8), [0, 0, 0, 0, 1, 1, 1, 0]);
    }
}
