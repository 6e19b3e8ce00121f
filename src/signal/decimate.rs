//! Decimation without aliasing: a zero-phase low-pass, after which every n-th sample is kept.

use super::butterworth::{Scratch, ZeroPhase};
use super::error::{SignalError, checked_rate_hz};

/// Order of the anti-alias filter, each pass.
const ANTI_ALIAS_ORDER: usize = 8;
/// Its −3 dB frequency as a fraction of the new Nyquist frequency. A component that would alias onto this frequency
/// lies at 1.2 times the new Nyquist frequency, where two passes leave at most 1/(1 + 0.414·1.5¹⁶) = 0.0037 (−49 dB).
const ANTI_ALIAS_SHARE: f64 = 0.8;

/// Keeps every n-th sample after a zero-phase low-pass.
///
/// Measured torque, motion and every regressor column must pass the *same* decimator: then the equation of motion still
/// holds between the filtered columns, whatever the filter does.
#[derive(Debug, Clone, PartialEq)]
pub struct Decimator {
    filter: Option<ZeroPhase>,
    every: usize,
    rate_hz: f64,
}

impl Decimator {
    /// Keeps every `every`-th sample of a record at `rate_hz`, low-passed at 0.8 of the new Nyquist frequency.
    /// `every` = 1 leaves the record unchanged.
    pub fn new(every: usize, rate_hz: f64) -> Result<Self, SignalError> {
        checked_rate_hz(rate_hz)?;
        match every {
            0 => Err(SignalError::Factor),
            1 => Ok(Self { filter: None, every, rate_hz }),
            _ => {
                let cutoff_hz = ANTI_ALIAS_SHARE * rate_hz / (2.0 * every as f64);
                let filter = ZeroPhase::new(cutoff_hz, ANTI_ALIAS_ORDER, rate_hz)?;
                Ok(Self { filter: Some(filter), every, rate_hz })
            }
        }
    }

    /// Sampling rate of the result, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz / self.every as f64
    }

    /// One sample in so many is kept.
    pub fn every(&self) -> usize {
        self.every
    }

    /// Number of samples at each end of a record that depend on how it is taken to continue.
    pub fn edge_samples(&self) -> usize {
        self.filter.as_ref().map_or(0, ZeroPhase::edge_samples)
    }

    /// Number of samples of the result for a record of `samples`: ⌈samples / every⌉.
    pub fn samples(&self, samples: usize) -> usize {
        samples.div_ceil(self.every)
    }

    /// Filters `x` in place, moves the kept samples (0, n, 2n, …) to the front and returns their number. Allocates
    /// nothing.
    pub fn decimate_in_place(
        &self,
        x: &mut [f64],
        scratch: &mut Scratch,
    ) -> Result<usize, SignalError> {
        if let Some(filter) = &self.filter {
            filter.filter_in_place(x, scratch)?;
        }
        let kept = self.samples(x.len());
        for k in 1..kept {
            x[k] = x[k * self.every];
        }
        Ok(kept)
    }

    /// The decimated copy of `x`.
    pub fn decimate(&self, x: &[f64], scratch: &mut Scratch) -> Result<Vec<f64>, SignalError> {
        let mut y = x.to_vec();
        let kept = self.decimate_in_place(&mut y, scratch)?;
        y.truncate(kept);
        Ok(y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn slow_sines_stay_in_place_and_fast_ones_do_not_fold_back() {
        let decimator = Decimator::new(5, 500.0).unwrap();
        assert_eq!(decimator.rate_hz(), 100.0);
        let sine = |f: f64| -> Vec<f64> {
            (0..5003).map(|k| (2.0 * PI * f * k as f64 / 500.0).sin()).collect()
        };
        let mut scratch = Scratch::default();
        let slow = decimator.decimate(&sine(5.0), &mut scratch).unwrap();
        assert_eq!(slow.len(), 1001);
        for (k, y) in slow.iter().enumerate().skip(50).take(900) {
            assert!((y - (2.0 * PI * 5.0 * k as f64 / 100.0).sin()).abs() < 1e-9);
        }
        let folding = decimator.decimate(&sine(60.0), &mut scratch).unwrap();
        assert!(folding[50..950].iter().all(|y| y.abs() < 0.0037));
    }

    #[test]
    fn a_factor_of_one_changes_nothing_and_zero_is_refused() {
        let x = [1.0, 5.0, -2.0];
        let one = Decimator::new(1, 125.0).unwrap();
        assert_eq!(one.decimate(&x, &mut Scratch::default()).unwrap(), x);
        assert_eq!(Decimator::new(0, 125.0).unwrap_err(), SignalError::Factor);
    }
}
