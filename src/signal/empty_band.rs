//! Frequencies above which a recorded series holds nothing.

use fourier::Complex64;

use super::readings::resolution;
use crate::robot::JointSignals;

/// A series holds nothing in a band if its rms there is below this share of its rms: noise of sensors is a hundred times
/// more.
const EMPTY: f64 = 1e-4;
/// The same in units of the resolution of the readings. Rounding alone has 1/√12, spread over all frequencies.
const ROUNDING: f64 = 0.5;
/// The band must be at least this share of all frequencies, and the series at least [`FEWEST`] samples long.
const LEAST_BAND: f64 = 0.5;
const FEWEST: usize = 256;

/// The lowest frequency, Hz, above which no joint of `y` holds anything, if that is at least half of all frequencies of a
/// log of `rate_hz`: the mark of a steep low-pass. A joint with a constant reading says nothing.
pub fn empty_above_hz(y: &JointSignals, rate_hz: f64) -> Option<f64> {
    let n = y.samples();
    if n < FEWEST {
        return None;
    }
    let plan = fourier::forward(n);
    let mut spectrum = plan.make_output_vec();
    let mut highest = None;
    for joint in 0..y.joints() {
        let mut windowed = without_ends(y.joint(joint));
        // A plan of this length fits both buffers.
        plan.process(&mut windowed, &mut spectrum).ok()?;
        let square = |c: &Complex64| c.norm_sqr();
        let all: f64 = spectrum.iter().skip(1).map(square).sum();
        // Of the mean square of a Hann window, 3/8, the transform holds n²/2 times as much in its positive half.
        let rounding = (ROUNDING * resolution(y.joint(joint)) * n as f64).powi(2) * 3.0 / 16.0;
        let least = (EMPTY * EMPTY * all).max(rounding);
        if all <= least {
            continue;
        }
        let mut above = 0.0;
        let last = spectrum.iter().rposition(|c| {
            above += square(c);
            above > least
        });
        highest = highest.max(last);
    }
    let above_hz = highest? as f64 * rate_hz / n as f64;
    (above_hz <= (1.0 - LEAST_BAND) * 0.5 * rate_hz).then_some(above_hz)
}

/// `series` without its mean, faded out towards both ends by a Hann window: its ends need not meet.
fn without_ends(series: &[f64]) -> Vec<f64> {
    let n = series.len() as f64;
    let mean = series.iter().sum::<f64>() / n;
    let window = |k: usize| 0.5 - 0.5 * (std::f64::consts::TAU * (k as f64 + 0.5) / n).cos();
    series.iter().enumerate().map(|(k, y)| (y - mean) * window(k)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{Scratch, ZeroPhase};
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 250.0;

    /// A torque of 20 Nm at 0.3 Hz with friction that changes its sign, and noise of `sd_nm`; in the second joint of half
    /// that.
    fn torque(sd_nm: f64) -> JointSignals {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut out = JointSignals::zeros(2, 5000);
        for (joint, size) in [1.0, 0.5].into_iter().enumerate() {
            for (k, y) in out.joint_mut(joint).iter_mut().enumerate() {
                let (sin, cos) = (std::f64::consts::TAU * 0.3 * k as f64 / RATE_HZ).sin_cos();
                let noise: f64 = StandardNormal.sample(&mut rng);
                *y = size * (20.0 * sin + 5.0 * (cos / 0.02).tanh() + sd_nm * noise);
            }
        }
        out
    }

    /// Behind a low-pass of fourth order, forwards and backwards, an amplitude falls as (f_c/f)⁸: at 5 Hz what is left of
    /// noise and friction is below 10⁻⁴ of the torque from about 12 Hz on.
    #[test]
    fn a_steep_low_pass_leaves_nothing() {
        let low_pass = ZeroPhase::new(5.0, 4, RATE_HZ).unwrap();
        let mut filtered = torque(0.5);
        (0..2).for_each(|j| {
            low_pass.filter_in_place(filtered.joint_mut(j), &mut Scratch::default()).unwrap()
        });
        let above_hz = empty_above_hz(&filtered, RATE_HZ).unwrap();
        assert!((6.0..25.0).contains(&above_hz), "{above_hz}");
        // Readings of 0.01 Nm hide it no more than they have to.
        for j in 0..2 {
            filtered.joint_mut(j).iter_mut().for_each(|y| *y = (*y * 100.0).round() / 100.0);
        }
        assert!(empty_above_hz(&filtered, RATE_HZ).is_some());
    }

    /// Noise of a thousandth of the torque fills all frequencies; the corners of friction alone, in a torque without any
    /// noise, reach as far as 60 Hz.
    #[test]
    fn noise_fills_all_frequencies() {
        assert_eq!(empty_above_hz(&torque(0.02), RATE_HZ), None);
        assert!(empty_above_hz(&torque(0.0), RATE_HZ).is_none_or(|above_hz| above_hz > 30.0));
    }

    /// One joint whose torque was not filtered is enough: a recorder filters all or none.
    #[test]
    fn all_joints_have_to_be_empty() {
        let low_pass = ZeroPhase::new(5.0, 4, RATE_HZ).unwrap();
        let mut filtered = torque(0.5);
        low_pass.filter_in_place(filtered.joint_mut(0), &mut Scratch::default()).unwrap();
        assert_eq!(empty_above_hz(&filtered, RATE_HZ), None);
        // A joint that reads zero says nothing.
        low_pass.filter_in_place(filtered.joint_mut(1), &mut Scratch::default()).unwrap();
        filtered.joint_mut(0).fill(0.0);
        assert!(empty_above_hz(&filtered, RATE_HZ).is_some());
    }
}
