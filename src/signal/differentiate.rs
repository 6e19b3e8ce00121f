//! Derivatives of a uniformly sampled series by finite differences.
//!
//! | function | interior, h = time step | ends | error |
//! |---|---|---|---|
//! | [`central_2`] | (y₁ − y₋₁)/2h | three-point one-sided | O(h²) |
//! | [`central_4`] | (y₋₂ − 8y₋₁ + 8y₁ − y₂)/12h | five-point one-sided | O(h⁴) |
//! | [`hermite_acceleration`] | 2(q₁ − 2q₀ + q₋₁)/h² − (q̇₁ − q̇₋₁)/2h | from samples 0, 1, 2 | O(h⁴) |
//!
//! Indices count samples from the one at which the derivative is taken.

use super::error::{SignalError, checked_rate_hz, enough, same};

/// dy/dt into `out`, second order. Needs 3 samples.
///
/// Response to a sine of angular frequency ω: jω·sin(ωh)/(ωh).
pub fn central_2(y: &[f64], rate_hz: f64, out: &mut [f64]) -> Result<(), SignalError> {
    let rate = checked_rate_hz(rate_hz)?;
    enough("a central difference of second order", y.len(), 3)?;
    same("samples of the derivative", y.len(), out.len())?;
    let n = y.len();
    let scale = 0.5 * rate;
    for (d, w) in out[1..n - 1].iter_mut().zip(y.windows(3)) {
        *d = scale * (w[2] - w[0]);
    }
    out[0] = scale * (-3.0 * y[0] + 4.0 * y[1] - y[2]);
    out[n - 1] = scale * (3.0 * y[n - 1] - 4.0 * y[n - 2] + y[n - 3]);
    Ok(())
}

/// dy/dt into `out`, fourth order. Needs 5 samples.
///
/// Response to a sine of angular frequency ω: jω·(8 sin ωh − sin 2ωh)/(6ωh) = jω(1 − (ωh)⁴/30 + …).
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

/// q̈ into `out` from samples of **both** q and q̇, fourth order in the time step. Needs 3 samples.
///
/// Derivation. Taylor's series about sample 0 give
///
/// (q₁ − 2q₀ + q₋₁)/h² = q̈ + h²/12 q⁗ + h⁴/360 q⁽⁶⁾ + …
/// (q̇₁ − q̇₋₁)/2h      = q̈ + h²/6 q⁗ + h⁴/120 q⁽⁶⁾ + …
///
/// Twice the first minus the second has no h² term: q̈ − h⁴/360 q⁽⁶⁾ + … At the ends the second
/// derivative of the quintic through q and q̇ at the three nearest samples is taken,
/// q̈₀ ≈ (−23q₀ + 16q₁ + 7q₂)/2h² − (6q̇₀ + 8q̇₁ + q̇₂)/h, with error −h⁴/90 q⁽⁶⁾.
///
/// It is exact enough to hold a simulated plant's log against the equation of motion without
/// using the simulator's own acceleration. It is **not** for measured logs: independent noise σ_q,
/// σ_v comes out as σ² = 24σ_q²/h⁴ + σ_v²/2h².
pub fn hermite_acceleration(
    q_rad: &[f64],
    qd_rad_s: &[f64],
    rate_hz: f64,
    out: &mut [f64],
) -> Result<(), SignalError> {
    let rate = checked_rate_hz(rate_hz)?;
    enough("acceleration from angle and velocity", q_rad.len(), 3)?;
    same("samples of angle and velocity", q_rad.len(), qd_rad_s.len())?;
    same("samples of the acceleration", q_rad.len(), out.len())?;
    let n = q_rad.len();
    let (from_q, from_qd) = (2.0 * rate * rate, 0.5 * rate);
    let interior = out[1..n - 1].iter_mut().zip(q_rad.windows(3)).zip(qd_rad_s.windows(3));
    for ((qdd, q), qd) in interior {
        *qdd = from_q * ((q[2] - q[1]) - (q[1] - q[0])) - from_qd * (qd[2] - qd[0]);
    }
    // Mirrored in time, q̇ changes sign and q̈ does not.
    let at_end = |q: [f64; 3], qd: [f64; 3]| {
        0.5 * rate * rate * (16.0 * (q[1] - q[0]) + 7.0 * (q[2] - q[0]))
            - rate * (6.0 * qd[0] + 8.0 * qd[1] + qd[2])
    };
    out[0] = at_end([q_rad[0], q_rad[1], q_rad[2]], [qd_rad_s[0], qd_rad_s[1], qd_rad_s[2]]);
    out[n - 1] = at_end(
        [q_rad[n - 1], q_rad[n - 2], q_rad[n - 3]],
        [-qd_rad_s[n - 1], -qd_rad_s[n - 2], -qd_rad_s[n - 3]],
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polynomial c₀ + c₁t + … with its first two derivatives at t.
    fn polynomial(c: &[f64], t: f64) -> [f64; 3] {
        c.iter().rev().fold([0.0; 3], |[p, d, dd], a| [p * t + a, d * t + p, dd * t + 2.0 * d])
    }

    /// A formula of order p differentiates polynomials of degree p exactly, ends included.
    #[test]
    fn each_formula_is_exact_for_the_polynomials_of_its_order() {
        let c = [0.3, -1.2, 0.7, 2.0, -0.4, 0.9];
        let rate = 4.0;
        let table = |degree: usize| -> Vec<[f64; 3]> {
            (0..9).map(|k| polynomial(&c[..=degree], k as f64 / rate)).collect()
        };
        let column = |t: &[[f64; 3]], i: usize| t.iter().map(|row| row[i]).collect::<Vec<_>>();
        let mut out = [0.0; 9];
        // Values reach 60, the formulas' weights 25/12h: a few hundred roundings of 1e-14.
        let near = |out: &[f64], t: &[[f64; 3]], i: usize| {
            out.iter().zip(t).all(|(d, row)| (d - row[i]).abs() < 1e-10)
        };
        let t = table(2);
        central_2(&column(&t, 0), rate, &mut out).unwrap();
        assert!(near(&out, &t, 1));
        let t = table(4);
        central_4(&column(&t, 0), rate, &mut out).unwrap();
        assert!(near(&out, &t, 1));
        let t = table(5);
        hermite_acceleration(&column(&t, 0), &column(&t, 1), rate, &mut out).unwrap();
        assert!(near(&out, &t, 2));
    }

    /// Halving the step divides the error by 2^order; the leading terms are the documented ones.
    #[test]
    fn errors_shrink_with_the_stated_power_of_the_step() {
        let worst = |rate: f64, which: usize, ends: bool| {
            let n = rate as usize + 1;
            let t = |k: usize| k as f64 / rate;
            let w = 6.0_f64;
            let q: Vec<f64> = (0..n).map(|k| (w * t(k)).sin()).collect();
            let qd: Vec<f64> = (0..n).map(|k| w * (w * t(k)).cos()).collect();
            let qdd: Vec<f64> = q.iter().map(|q| -w * w * q).collect();
            let mut out = vec![0.0; n];
            let truth = match which {
                0 => central_2(&q, rate, &mut out).map(|()| &qd),
                1 => central_4(&q, rate, &mut out).map(|()| &qd),
                _ => hermite_acceleration(&q, &qd, rate, &mut out).map(|()| &qdd),
            }
            .unwrap();
            let edge = if ends { 0 } else { 2 };
            (edge..n - edge).map(|k| (out[k] - truth[k]).abs()).fold(0.0, f64::max)
        };
        for (which, order) in [(0, 2.0), (1, 4.0), (2, 4.0)] {
            for ends in [false, true] {
                let rate = (worst(100.0, which, ends) / worst(200.0, which, ends)).log2();
                assert!((rate - order).abs() < 0.15, "formula {which}, ends {ends}: 2^{rate}");
            }
        }
        let h: f64 = 0.01;
        let predicted = h.powi(4) / 360.0 * 6.0_f64.powi(6);
        assert!((worst(100.0, 2, false) / predicted - 1.0).abs() < 0.01);
    }

    #[test]
    fn short_and_unequal_series_are_refused() {
        let mut out = [0.0; 4];
        assert!(matches!(
            central_4(&[0.0; 4], 1.0, &mut out),
            Err(SignalError::TooFewSamples { needed: 5, .. })
        ));
        assert!(matches!(
            central_2(&[0.0; 5], 1.0, &mut out),
            Err(SignalError::Mismatch { expected: 5, found: 4, .. })
        ));
        assert!(matches!(
            hermite_acceleration(&[0.0; 4], &[0.0; 5], 1.0, &mut out),
            Err(SignalError::Mismatch { .. })
        ));
    }
}
