//! Butterworth low-pass of any order, run forward and backward so that it causes no delay.
//!
//! One pass has |H(f)|² = 1 / (1 + (Ω/Ω_c)^{2n}) with the bilinear frequency Ω = tan(πf/f_s). Two
//! passes multiply to the real, positive response
//!
//! G(f) = |H(f)|² = 1 / (1 + (Ω/Ω_c)^{2n}),
//!
//! which is down by **6** dB, not 3, at the single-pass cut-off. G = 1/√2 at the frequency f₃ needs
//! Ω_c = tan(πf₃/f_s) · (√2 − 1)^{−1/2n}; without that the −3 dB point of an order-4 filter sits
//! at 0.90 of the cut-off, of order 2 at 0.80. Design: S. Butterworth, "On the theory of filter
//! amplifiers" (1930), mapped by the bilinear transform.

use std::f64::consts::{PI, SQRT_2};
use std::ops::Range;

use super::biquad::{Biquad, TwoPass};
use super::error::{SignalError, checked_cutoff_hz, enough};

pub use super::biquad::Scratch;

/// Above this order nothing is gained: the two-pass roll-off is 1 : f⁴⁰ already.
pub const HIGHEST_ORDER: usize = 20;

/// Number of [`ZeroPhase::edge_samples`] by which a periodic series is continued at either end: each leaves 1 % of the
/// effect of what is assumed beyond, and three leave 1e-6.
const PERIODIC_EDGES: usize = 3;

/// A Butterworth low-pass without phase: filtered signals are not delayed.
///
/// ```
/// use armid::signal::{Scratch, ZeroPhase};
/// let filter = ZeroPhase::new(10.0, 4, 125.0)?;
/// let mut torque_nm = vec![3.0; 1000];
/// filter.filter_in_place(&mut torque_nm, &mut Scratch::default())?;
/// assert!(torque_nm.iter().all(|t| (t - 3.0).abs() < 1e-12));
/// # Ok::<(), armid::signal::SignalError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ZeroPhase {
    passes: TwoPass,
    order: usize,
    rate_hz: f64,
    /// Ω_c = tan(π f_c / f_s) of the single pass.
    warped_cutoff: f64,
}

impl ZeroPhase {
    /// Low-pass whose **two-pass** response is 1/√2 (−3 dB) at `cutoff_hz`.
    ///
    /// Errors: a cut-off outside (0, rate/2), an order outside 1…20, a rate that is not positive.
    pub fn new(cutoff_hz: f64, order: usize, rate_hz: f64) -> Result<Self, SignalError> {
        let warped = (PI * checked_cutoff_hz(cutoff_hz, rate_hz)? / rate_hz).tan();
        checked_order(order)?;
        let single_pass = warped * (SQRT_2 - 1.0).powf(-0.5 / order as f64);
        Ok(Self::from_warped(single_pass, order, rate_hz))
    }

    /// Low-pass whose **single pass** is −3 dB at `cutoff_hz`, hence −6 dB after both: the same
    /// numbers as `scipy.signal.sosfiltfilt(butter(order, cutoff_hz, fs=rate_hz, output="sos"), x)`.
    pub fn with_single_pass_cutoff(
        cutoff_hz: f64,
        order: usize,
        rate_hz: f64,
    ) -> Result<Self, SignalError> {
        let warped = (PI * checked_cutoff_hz(cutoff_hz, rate_hz)? / rate_hz).tan();
        checked_order(order)?;
        Ok(Self::from_warped(warped, order, rate_hz))
    }

    fn from_warped(warped_cutoff: f64, order: usize, rate_hz: f64) -> Self {
        let k = warped_cutoff;
        let mut sections = Vec::with_capacity(order.div_ceil(2));
        if order % 2 == 1 {
            let b = k / (1.0 + k);
            sections.push(Biquad { b: [b, b, 0.0], a: [(k - 1.0) / (k + 1.0), 0.0] });
        }
        for pair in 0..order / 2 {
            // Poles at angle θ from the negative real axis: s² + 2cosθ s + 1.
            let theta = PI * (order - 1 - 2 * pair) as f64 / (2 * order) as f64;
            let damping = 2.0 * theta.cos() * k;
            let norm = 1.0 + damping + k * k;
            let b = k * k / norm;
            sections.push(Biquad {
                b: [b, 2.0 * b, b],
                a: [2.0 * (k * k - 1.0) / norm, (1.0 - damping + k * k) / norm],
            });
        }
        Self { passes: TwoPass { sections, pad: 3 * (order + 1) }, order, rate_hz, warped_cutoff }
    }

    /// Filters one series in place; allocates nothing once `scratch` has been used.
    ///
    /// Error: fewer than [`Self::least_samples`] samples.
    pub fn filter_in_place(&self, x: &mut [f64], scratch: &mut Scratch) -> Result<(), SignalError> {
        self.passes.run(x, scratch)
    }

    /// Filters a series of which the whole record is a repetition, as if it had no ends. `longer` is overwritten by the
    /// filtered series with as much of its continuation on either side as the filter needs; returned is where in it the
    /// series lies.
    ///
    /// Error: the series is empty, or shorter than [`Self::least_samples`] even with its continuation.
    pub fn filter_periodic(
        &self,
        series: &[f64],
        longer: &mut Vec<f64>,
        scratch: &mut Scratch,
    ) -> Result<Range<usize>, SignalError> {
        let n = series.len();
        enough("zero-phase filtering of a periodic series", n, 1)?;
        let pad = PERIODIC_EDGES * self.edge_samples();
        longer.clear();
        longer.extend(series.iter().cycle().skip((n - pad % n) % n).take(n + 2 * pad));
        self.filter_in_place(longer, scratch)?;
        Ok(pad..pad + n)
    }

    /// Filters `series` into `longer`, by [`Self::filter_periodic`] if it `repeats`; returned is where in it the series
    /// lies.
    pub fn filter_into(
        &self,
        series: &[f64],
        repeats: bool,
        longer: &mut Vec<f64>,
        scratch: &mut Scratch,
    ) -> Result<Range<usize>, SignalError> {
        if repeats {
            return self.filter_periodic(series, longer, scratch);
        }
        longer.clear();
        longer.extend_from_slice(series);
        self.filter_in_place(longer, scratch)?;
        Ok(0..series.len())
    }

    /// Samples a series must have at least: 3(order + 1) + 1.
    pub fn least_samples(&self) -> usize {
        self.passes.least_samples()
    }

    /// Two-pass response G at `frequency_hz`: real, 1 at zero, never negative.
    pub fn response(&self, frequency_hz: f64) -> f64 {
        let ratio = (PI * frequency_hz / self.rate_hz).tan() / self.warped_cutoff;
        1.0 / (1.0 + ratio.powi(2 * self.order as i32))
    }

    /// Sampling rate that the filter is designed for, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Frequency at which both passes together are −3 dB, Hz.
    pub fn cutoff_hz(&self) -> f64 {
        let warped = self.warped_cutoff * (SQRT_2 - 1.0).powf(0.5 / self.order as f64);
        self.rate_hz / PI * warped.atan()
    }

    /// Number of samples at each end over which the effect of the assumed continuation of the record fades to one
    /// percent (slowest pole). Values closer to an end should not be trusted.
    pub fn edge_samples(&self) -> usize {
        let slowest = self.passes.sections.iter().map(slowest_pole).fold(0.0, f64::max);
        if slowest <= 0.0 { 1 } else { (0.01_f64.ln() / slowest.ln()).ceil() as usize }
    }
}

fn checked_order(order: usize) -> Result<(), SignalError> {
    if (1..=HIGHEST_ORDER).contains(&order) {
        Ok(())
    } else {
        Err(SignalError::Order { order, highest: HIGHEST_ORDER })
    }
}

/// Largest |z| with z² + a₁z + a₂ = 0.
fn slowest_pole(section: &Biquad) -> f64 {
    let [a1, a2] = section.a;
    let discriminant = a1 * a1 - 4.0 * a2;
    if discriminant < 0.0 { a2.sqrt() } else { 0.5 * (a1.abs() + discriminant.sqrt()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_pass_response_is_minus_three_decibels_at_the_cutoff_asked_for() {
        for order in 1..=8 {
            let filter = ZeroPhase::new(10.0, order, 125.0).unwrap();
            assert!((filter.response(10.0) - SQRT_2.recip()).abs() < 1e-14);
            assert!((filter.cutoff_hz() - 10.0).abs() < 1e-12);
            let single_pass = ZeroPhase::with_single_pass_cutoff(10.0, order, 125.0).unwrap();
            assert!((single_pass.response(10.0) - 0.5).abs() < 1e-13);
        }
    }

    /// Measured on a long sine, away from the ends: gain G and no phase.
    #[test]
    fn a_sine_comes_out_with_the_stated_gain_and_no_delay() {
        let filter = ZeroPhase::new(10.0, 4, 125.0).unwrap();
        for f in [2.0, 8.0, 10.0, 14.0] {
            let n = 4000;
            let phase = |k: usize| 2.0 * PI * f * k as f64 / 125.0 + 0.3;
            let mut x: Vec<f64> = (0..n).map(|k| phase(k).sin()).collect();
            filter.filter_in_place(&mut x, &mut Scratch::default()).unwrap();
            // Two hundred samples are more than twenty times `edge_samples`: e⁻⁹⁰ is left.
            assert!(filter.edge_samples() < 40);
            for (k, y) in x.iter().enumerate().skip(1000).take(2000) {
                assert!((y - filter.response(f) * phase(k).sin()).abs() < 1e-12);
            }
        }
    }

    /// The middle of ten edges of repetitions on either side is free of any end. Values within ±1 are continued by at
    /// most ±3 (2x₀ − x), so that what is assumed beyond either end is off by at most 4, of which three edges leave
    /// 1e-6.
    #[test]
    fn a_periodic_series_is_filtered_like_a_long_repetition_of_it() {
        let filter = ZeroPhase::new(5.0, 4, 125.0).unwrap();
        let edge = filter.edge_samples();
        let (mut scratch, mut longer) = (Scratch::default(), Vec::new());
        // One series is longer than what is added to it, the other shorter than one edge.
        for n in [400, 40] {
            assert!(n > 3 * edge || n < edge);
            // It does not fit its own beginning.
            let series: Vec<f64> =
                (0..n).map(|k| (0.37 * (k * k) as f64).sin() * k as f64 / n as f64).collect();
            let beside = (10 * edge).div_ceil(n);
            let mut long = series.repeat(2 * beside + 1);
            filter.filter_in_place(&mut long, &mut scratch).unwrap();
            let inside = filter.filter_periodic(&series, &mut longer, &mut scratch).unwrap();
            assert_eq!(inside.len(), n);
            for (k, (found, long)) in longer[inside].iter().zip(&long[beside * n..]).enumerate() {
                assert!((found - long).abs() < 8e-6, "{k} of {n}: {found} {long}");
            }
        }
        assert!(filter.filter_periodic(&[], &mut longer, &mut scratch).is_err());
    }

    #[test]
    fn constants_and_straight_lines_pass_unchanged() {
        for order in [1, 2, 3, 4, 7] {
            let filter = ZeroPhase::new(3.0, order, 500.0).unwrap();
            // A line is only kept where the transient of its slope has faded.
            let edge = filter.edge_samples() * 5;
            let line: Vec<f64> = (0..2 * edge + 500).map(|k| 5.0 - 0.01 * k as f64).collect();
            let mut x = line.clone();
            filter.filter_in_place(&mut x, &mut Scratch::default()).unwrap();
            let inner = edge..line.len() - edge;
            assert!(!inner.is_empty());
            for k in inner {
                assert!((x[k] - line[k]).abs() < 1e-9, "order {order}, sample {k}");
            }
            let mut constant = vec![-2.5; 200];
            filter.filter_in_place(&mut constant, &mut Scratch::default()).unwrap();
            assert!(constant.iter().all(|y| (y + 2.5).abs() < 1e-9));
        }
    }

    #[test]
    fn impossible_requests_are_refused_with_their_numbers() {
        let refused = |cutoff, order, rate| ZeroPhase::new(cutoff, order, rate).unwrap_err();
        assert_eq!(
            refused(62.5, 2, 125.0),
            SignalError::Cutoff { cutoff_hz: 62.5, rate_hz: 125.0 }
        );
        assert!(matches!(refused(f64::NAN, 2, 125.0), SignalError::Cutoff { .. }));
        assert!(matches!(refused(-1.0, 2, 125.0), SignalError::Cutoff { .. }));
        assert!(matches!(refused(1.0, 0, 125.0), SignalError::Order { order: 0, .. }));
        assert!(matches!(refused(1.0, 2, 0.0), SignalError::Rate { .. }));
        let filter = ZeroPhase::new(10.0, 4, 125.0).unwrap();
        assert_eq!(
            filter.filter_in_place(&mut [0.0; 15], &mut Scratch::default()).unwrap_err(),
            SignalError::TooFewSamples {
                task: "zero-phase filtering",
                samples: 15,
                needed: filter.least_samples()
            }
        );
    }
}
