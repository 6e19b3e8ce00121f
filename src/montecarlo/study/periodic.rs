//! Filtering of periodic series by a filter of known frequency response.

use fourier::Complex64;

use crate::signal::FineClock;

/// Filters for series of one period with a given number of samples.
pub(super) struct Periodic {
    samples: usize,
    rate_hz: f64,
    clock: FineClock,
}

impl Periodic {
    pub(super) fn new(samples: usize, rate_hz: f64) -> Self {
        Self { samples, rate_hz, clock: FineClock::new(samples, 1) }
    }

    fn frequency_hz(&self, bin: usize) -> f64 {
        bin as f64 * self.rate_hz / self.samples as f64
    }

    /// Steady-state output, over one period, of a filter with the given `response` (a function of the frequency in Hz)
    /// whose input is the periodic series `x`.
    pub(super) fn filtered(&self, x: &[f64], response: impl Fn(f64) -> Complex64) -> Vec<f64> {
        self.clock.filtered(x, |bin| response(self.frequency_hz(bin)))
    }

    /// Variance of unit white noise after a filter with the given `gain`: the mean of the squared gain over all
    /// frequencies.
    pub(super) fn noise_gain(&self, gain: impl Fn(f64) -> f64) -> f64 {
        let half = self.samples / 2;
        let sum: f64 = (0..=half)
            .map(|bin| {
                let once = bin == 0 || (self.samples.is_multiple_of(2) && bin == half);
                gain(self.frequency_hz(bin)).powi(2) * if once { 1.0 } else { 2.0 }
            })
            .sum();
        sum / self.samples as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_is_scaled_and_turned_and_noise_keeps_its_share() {
        let (n, rate_hz) = (200, 50.0);
        let periodic = Periodic::new(n, rate_hz);
        let wave = |k: usize| std::f64::consts::TAU * 3.0 * k as f64 / n as f64;
        let x: Vec<f64> = (0..n).map(|k| wave(k).cos()).collect();
        // 3 periods in 4 s: 0.75 Hz.
        let y = periodic.filtered(&x, |f| Complex64::new(0.0, 2.0 * f));
        assert!((0..n).all(|k| (y[k] + 1.5 * wave(k).sin()).abs() < 1e-12));
        assert!((periodic.noise_gain(|_| 1.0) - 1.0).abs() < 1e-12);
    }
}
