//! Power spectral density by Welch's method.

use std::f64::consts::PI;

use realfft::RealFftPlanner;

use super::error::{SignalError, checked_rate_hz, enough};

/// One-sided power spectral density.
#[derive(Debug, Clone, PartialEq)]
pub struct PowerSpectrum {
    /// Frequencies 0 … f_s/2, Hz.
    pub frequency_hz: Vec<f64>,
    /// Density in (unit of the signal)²/Hz; its integral over frequency is the variance.
    pub density: Vec<f64>,
    /// Segments averaged; neighbours overlap by half.
    pub segments: usize,
}

/// Welch's estimate: Hann-windowed segments of `segment_samples` overlapping by half, mean of each
/// removed, periodograms averaged. Same numbers as `scipy.signal.welch(x, fs, nperseg=…)`.
///
/// P(f) = 2/(f_s Σw²) · mean over segments |Σ_k w_k x_k e^{−2πifk/f_s}|² (without the 2 at 0 and
/// f_s/2). Source: P. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70–73. What does not fill
/// a last segment is not used.
///
/// Errors: segments shorter than 4 samples, a record shorter than one segment.
pub fn welch(
    x: &[f64],
    rate_hz: f64,
    segment_samples: usize,
) -> Result<PowerSpectrum, SignalError> {
    checked_rate_hz(rate_hz)?;
    let n = segment_samples;
    enough("a spectrum's segment", n, 4)?;
    enough("a spectrum", x.len(), n)?;
    let window: Vec<f64> =
        (0..n).map(|k| 0.5 - 0.5 * (2.0 * PI * k as f64 / n as f64).cos()).collect();
    let transform = RealFftPlanner::new().plan_fft_forward(n);
    let mut segment = transform.make_input_vec();
    let mut spectrum = transform.make_output_vec();
    let mut scratch = transform.make_scratch_vec();
    let mut density = vec![0.0; spectrum.len()];
    let segments = 1 + (x.len() - n) / (n - n / 2);
    for part in x.windows(n).step_by(n - n / 2) {
        let mean = part.iter().sum::<f64>() / n as f64;
        for ((s, v), w) in segment.iter_mut().zip(part).zip(&window) {
            *s = w * (v - mean);
        }
        transform
            .process_with_scratch(&mut segment, &mut spectrum, &mut scratch)
            .expect("all buffers were made by the plan");
        for (d, c) in density.iter_mut().zip(&spectrum) {
            *d += c.norm_sqr();
        }
    }
    let power: f64 = window.iter().map(|w| w * w).sum();
    let scale = 2.0 / (rate_hz * power * segments as f64);
    let nyquist = n.is_multiple_of(2).then_some(n / 2);
    for (k, d) in density.iter_mut().enumerate() {
        *d *= if k == 0 || Some(k) == nyquist { 0.5 * scale } else { scale };
    }
    let frequency_hz = (0..density.len()).map(|k| k as f64 * rate_hz / n as f64).collect();
    Ok(PowerSpectrum { frequency_hz, density, segments })
}
