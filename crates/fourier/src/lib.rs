//! Plans of Fourier transforms of real series in double precision.
//!
//! A crate of its own because the library behind it is generic: whoever asks it for a plan compiles all of its butterflies, which were
//! a seventh of what armid compiled, as often as anything in it changed. Here they are compiled once.
#![warn(missing_docs)]

use std::sync::Arc;

use realfft::RealFftPlanner;
pub use realfft::num_complex::Complex64;
pub use realfft::{ComplexToReal, RealToComplex};

/// From a series to its coefficients up to half the rate, Σ_k y_k e^(−2πihk/n).
pub type Forward = Arc<dyn RealToComplex<f64>>;
/// From the coefficients to n times the series.
pub type Inverse = Arc<dyn ComplexToReal<f64>>;

/// The plan for series of `n` samples.
#[inline(never)]
pub fn forward(n: usize) -> Forward {
    RealFftPlanner::new().plan_fft_forward(n)
}

/// The plan back to series of `n` samples.
#[inline(never)]
pub fn inverse(n: usize) -> Inverse {
    RealFftPlanner::new().plan_fft_inverse(n)
}
