//! Derivative of a uniformly sampled series by finite differences.

use super::error::{SignalError, checked_rate_hz, enough, same};

/// Writes dy/dt into `out`, with an error of fourth order in the time step h. Needs 5 samples.
///
/// The formula is (y₋₂ − 8y₋₁ + 8y₁ − y₂)/12h, with indices relative to the sample at which the derivative is taken;
/// the two samples at each end use one-sided formulas of five points. Response of the interior to a sine of angular
/// frequency ω: jω·(8 sin ωh − sin 2ωh)/(6ωh) = jω(1 − (ωh)⁴/30 + …).
pub fn central_4(y: &[f64], rate_hz: f64, out: &mut [f64]) -> Result<(), SignalError> {
    let rate = checked_rate_hz(rate_hz)?;
    enough("a central difference of fourth order", y.len(), 5)?;
    same("samples of the derivative", y.len(), out.len())?;
    let n = y.len();
    let scale = rate / 12.0;
    for (d, w) in out[2..n - 2].iter_mut().zip(y.windows(5)) {
        *d = scale * (w[0] - w[4] + 8.0 * (w[3] - w[1]));
    }
    let at_end = |f: [f64; 5]| -25.0 * f[0] + 48.0 * f[1] - 36.0 * f[2] + 16.0 * f[3] - 3.0 * f[4];
    let beside = |f: [f64; 5]| -3.0 * f[0] - 10.0 * f[1] + 18.0 * f[2] - 6.0 * f[3] + f[4];
    let head = [y[0], y[1], y[2], y[3], y[4]];
    let tail = [y[n - 1], y[n - 2], y[n - 3], y[n - 4], y[n - 5]];
    out[0] = scale * at_end(head);
    out[1] = scale * beside(head);
    out[n - 1] = -scale * at_end(tail);
    out[n - 2] = -scale * beside(tail);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polynomial c₀ + c₁t + … and its derivative at t.
    fn polynomial(c: &[f64], t: f64) -> [f64; 2] {
        c.iter().rev().fold([0.0; 2], |[p, d], a| [p * t + a, d * t + p])
    }

    /// A formula of fourth order differentiates polynomials of degree 4 exactly, ends included.
    #[test]
    fn polynomials_of_degree_four_are_differentiated_exactly() {
        let c = [0.3, -1.2, 0.7, 2.0, -0.4];
        let rate = 4.0;
        let table: Vec<[f64; 2]> = (0..9).map(|k| polynomial(&c, k as f64 / rate)).collect();
        let y: Vec<f64> = table.iter().map(|row| row[0]).collect();
        let mut out = [0.0; 9];
        central_4(&y, rate, &mut out).unwrap();
        // Values reach 60, the formulas' weights 25/12h: a few hundred roundings of 1e-14.
        assert!(out.iter().zip(&table).all(|(d, row)| (d - row[1]).abs() < 1e-10), "{out:?}");
    }

    /// Halving the step divides the error by 2⁴; the leading term is the documented one.
    #[test]
    fn errors_shrink_with_the_fourth_power_of_the_step() {
        let omega = 6.0_f64;
        let worst = |rate: f64, edge: usize| {
            let n = rate as usize + 1;
            let phase = |k: usize| omega * k as f64 / rate;
            let y: Vec<f64> = (0..n).map(|k| phase(k).sin()).collect();
            let mut out = vec![0.0; n];
            central_4(&y, rate, &mut out).unwrap();
            let off = |k: usize| (out[k] - omega * phase(k).cos()).abs();
            (edge..n - edge).map(off).fold(0.0, f64::max)
        };
        for edge in [0, 2] {
            let order = (worst(100.0, edge) / worst(200.0, edge)).log2();
            assert!((order - 4.0).abs() < 0.15, "{edge} samples left out at the ends: 2^{order}");
        }
        let predicted = omega * (omega / 100.0).powi(4) / 30.0;
        assert!((worst(100.0, 2) / predicted - 1.0).abs() < 0.01);
    }

    #[test]
    fn short_and_unequal_series_are_refused() {
        let mut out = [0.0; 4];
        assert!(matches!(
            central_4(&[0.0; 4], 1.0, &mut out),
            Err(SignalError::TooFewSamples { needed: 5, .. })
        ));
        assert!(matches!(
            central_4(&[0.0; 5], 1.0, &mut out),
            Err(SignalError::Mismatch { expected: 5, found: 4, .. })
        ));
    }
}
