//! Plans of Fourier transforms of real series in double precision.
//!
//! This is a crate of its own because the library behind it is generic: every crate that requests a plan compiles all
//! of its butterflies. They took a seventh of the compile time of armid, each time anything in armid changed. Here they
//! are compiled once.
#![warn(missing_docs)]

use std::sync::Arc;

use realfft::RealFftPlanner;
pub use realfft::num_complex::Complex64;
pub use realfft::{ComplexToReal, RealToComplex};

/// From a series to its coefficients up to half the sampling rate, Σ_k y_k e^(−2πihk/n).
pub type Forward = Arc<dyn RealToComplex<f64>>;
/// From the coefficients back to n times the series.
pub type Inverse = Arc<dyn ComplexToReal<f64>>;

/// The plan for series of `n` samples.
#[inline(never)]
pub fn forward(n: usize) -> Forward {
    RealFftPlanner::new().plan_fft_forward(n)
}

/// The inverse plan to series of `n` samples.
#[inline(never)]
pub fn inverse(n: usize) -> Inverse {
    RealFftPlanner::new().plan_fft_inverse(n)
}
