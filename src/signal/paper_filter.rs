//! The paper's way to accelerations: y = s/(s/ω + 1) u, equation (33), run with `filtfilt`.
//!
//! `filtfilt` runs a filter forward and then backward in time, which multiplies H(jω) by its
//! conjugate. That is harmless for a low-pass, but (33) is a differentiator:
//!
//! |s/(s/ω_c + 1)|² at s = jω is **+ω²/(1 + (ω/ω_c)²)** — real, a *second* derivative with the sign
//! turned.
//!
//! Taken literally, (33) therefore makes −d²q̇/dt² of the velocity, and −q̈ of the angle. An
//! inertia identified with −q̈ comes out negative. What must be meant is one derivative times the
//! zero-phase low-pass, jω/(1 + (ω/ω_c)²). Both are here, so that the consequence can be shown.

use std::f64::consts::PI;

use super::biquad::{Biquad, Scratch, TwoPass};
use super::differentiate::central_4;
use super::error::{SignalError, checked_cutoff_hz};

/// How equation (33) is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PaperReading {
    /// As printed, run forward and backward: response +ω²/(1 + (ω/ω_c)²).
    Literal,
    /// One derivative and a zero-phase low-pass: response jω/(1 + (ω/ω_c)²).
    Intended,
}

/// Equation (33) with its cut-off f = ω_c/2π (10 Hz in the paper).
///
/// Discretised by the bilinear transform s = 2f_s (1 − z⁻¹)/(1 + z⁻¹) with ω_c = 2f_s tan(πf/f_s), so that the cut-off
/// is met exactly. The derivative of the intended reading is the central difference of fourth order.
#[derive(Debug, Clone, PartialEq)]
pub struct PaperDifferentiator {
    passes: TwoPass,
    reading: PaperReading,
    rate_hz: f64,
}

impl PaperDifferentiator {
    /// The filter for `reading`, with the single-pass cut-off that the paper states.
    pub fn new(reading: PaperReading, cutoff_hz: f64, rate_hz: f64) -> Result<Self, SignalError> {
        let k = (PI * checked_cutoff_hz(cutoff_hz, rate_hz)? / rate_hz).tan();
        let gain = match reading {
            PaperReading::Literal => 2.0 * rate_hz * k / (1.0 + k),
            PaperReading::Intended => k / (1.0 + k),
        };
        let b = match reading {
            PaperReading::Literal => [gain, -gain, 0.0],
            PaperReading::Intended => [gain, gain, 0.0],
        };
        let section = Biquad { b, a: [(k - 1.0) / (k + 1.0), 0.0] };
        // 3 × (order + 1) samples, as `filtfilt` extends a first-order filter.
        let passes = TwoPass { sections: vec![section], pad: 6 };
        Ok(Self { passes, reading, rate_hz })
    }

    /// Applies the filter to the series `u`: returns du/dt, smoothed, with the intended reading, and −d²u/dt²,
    /// smoothed, with the literal one. Needs 7 samples.
    pub fn apply(&self, u: &[f64], scratch: &mut Scratch) -> Result<Vec<f64>, SignalError> {
        let mut y = u.to_vec();
        self.passes.run(&mut y, scratch)?;
        match self.reading {
            PaperReading::Literal => Ok(y),
            PaperReading::Intended => {
                let mut derivative = vec![0.0; y.len()];
                central_4(&y, self.rate_hz, &mut derivative)?;
                Ok(derivative)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine well below the cut-off, away from the ends: the literal reading of the velocity is
    /// minus its second derivative, of the angle minus the acceleration; the intended one is q̈.
    #[test]
    fn taken_literally_the_paper_filter_turns_the_sign_and_differentiates_twice() {
        let (rate, cutoff, f) = (500.0, 10.0, 0.8);
        let w = 2.0 * PI * f;
        let series = |g: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..5000).map(|k| g(w * k as f64 / rate)).collect()
        };
        let q = series(&|p| p.sin());
        let qd = series(&|p| w * p.cos());
        let qdd = series(&|p| -w * w * p.sin());
        let qddd = series(&|p| -w * w * w * p.cos());
        let apply = |reading, u: &[f64]| {
            PaperDifferentiator::new(reading, cutoff, rate)
                .unwrap()
                .apply(u, &mut Scratch::default())
                .unwrap()
        };
        let attenuation = 1.0 / (1.0 + (f / cutoff).powi(2));
        // Tolerance: the bilinear frequency departs by (πf/f_s)²/3 = 8e-6 at f and 1.3e-3 at the
        // cut-off, which is prewarped; what is left in the ratio is (f/f_c)² × 2.6e-3 = 2e-5.
        let matches = |y: &[f64], truth: &[f64], factor: f64| {
            let size = truth.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            (1000..4000).all(|k| (y[k] - factor * truth[k]).abs() < 5e-5 * size)
        };
        assert!(matches(&apply(PaperReading::Literal, &qd), &qddd, -attenuation));
        assert!(matches(&apply(PaperReading::Literal, &q), &qdd, -attenuation));
        assert!(matches(&apply(PaperReading::Intended, &qd), &qdd, attenuation));
        // The literal output contains nothing of the acceleration.
        let literal = apply(PaperReading::Literal, &qd);
        let period = 1000..1000 + 8 * 625;
        let range = period.start..period.end.min(4125);
        let dot = |a: &[f64], b: &[f64]| -> f64 { range.clone().map(|k| a[k] * b[k]).sum() };
        let correlation = dot(&literal, &qdd) / (dot(&literal, &literal) * dot(&qdd, &qdd)).sqrt();
        assert!(correlation.abs() < 1e-9, "{correlation}");
    }

    /// Noise of an acceleration computed from a velocity with white noise σ_v, for f_c ≪ f_s: σ_a² = σ_v² ω_c³ / (4
    /// f_s), from ∫₀^∞ ω²/(1 + (ω/ω_c)²)² dω = πω_c³/4 times the one-sided density 2σ_v²/f_s over 2π.
    #[test]
    fn the_noise_formula_is_the_energy_of_the_impulse_response() {
        let (cutoff_hz, rate_hz) = (2.0, 500.0);
        let filter = PaperDifferentiator::new(PaperReading::Intended, cutoff_hz, rate_hz).unwrap();
        let mut impulse = vec![0.0; 8001];
        impulse[4000] = 1.0;
        let y = filter.apply(&impulse, &mut Scratch::default()).unwrap();
        let sigma = y.iter().map(|v| v * v).sum::<f64>().sqrt();
        // The tail ∝ 1/ω² of the integral beyond the Nyquist rate is cut: 4f_c/(π f_s/2)/… ≈ 1 %.
        let expected = ((2.0 * PI * cutoff_hz).powi(3) / (4.0 * rate_hz)).sqrt();
        assert!((sigma / expected - 1.0).abs() < 0.02, "{sigma} {expected}");
    }
}
