//! Computes joint velocities for logs that have none.

use crate::median::median_step;
use crate::signal::Tears;

/// Number of rows that each interpolating polynomial passes through.
const ROWS: usize = 5;
/// A time step longer than this multiple of the median step is a gap; no polynomial spans a gap, or a tear.
const GAP: f64 = 2.5;

/// Returns the derivative of `y` at each of its times, per second. It is the derivative of the polynomial through five
/// rows: the row itself and two on either side. Closer to a gap, to one of the `tears` or to an end of the log, the
/// five nearest rows are used. For even sampling with step h, a sinusoid of angular frequency ω is differentiated with
/// relative error (ω h)⁴/30, and the standard deviation of the noise of a reading is multiplied by 0.95/h. An isolated
/// row gets slope zero.
pub(super) fn slopes(time_s: &[f64], y: &[f64], tears: &Tears) -> Vec<f64> {
    let gap_s = GAP * median_step(time_s).unwrap_or(f64::INFINITY);
    let ends = |k: &usize| {
        *k == time_s.len() || time_s[*k] - time_s[k - 1] > gap_s || tears.are_between(k - 1, *k)
    };
    let mut out = Vec::with_capacity(y.len());
    let mut first = 0;
    for end in (1..=time_s.len()).filter(ends) {
        let rows = first..end;
        let reach = ROWS.min(rows.len());
        out.extend(rows.clone().map(|k| {
            let from = k.saturating_sub(ROWS / 2).clamp(rows.start, rows.end - reach);
            slope_at(k - from, &time_s[from..from + reach], &y[from..from + reach])
        }));
        first = rows.end;
    }
    out
}

/// Derivative at the k-th point of the Lagrange polynomial through all points.
fn slope_at(k: usize, t: &[f64], y: &[f64]) -> f64 {
    let others = |i: usize| (0..t.len()).filter(move |&l| l != i && l != k);
    let weight = |i: usize| {
        let through: f64 = others(i).map(|l| (t[k] - t[l]) / (t[i] - t[l])).product();
        through / (t[i] - t[k])
    };
    // The derivative of a constant is zero, so all weights sum to zero; using differences to y[k] accounts for the
    // weight of point k.
    others(k).map(|i| weight(i) * (y[i] - y[k])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The slopes of a log of the angle `y` alone.
    fn slopes_of(time_s: &[f64], y: &[f64]) -> Vec<f64> {
        slopes(time_s, y, &Tears::of(time_s, &[y]))
    }

    /// A polynomial of degree four, unevenly sampled, is differentiated exactly, up to a gap and beyond it.
    #[test]
    fn polynomials_are_told_exactly() {
        let times = (0..40).map(|k| 0.008 * k as f64 + 0.002 * f64::from(k % 3));
        let times: Vec<f64> = times.filter(|t| !(0.1..0.16).contains(t)).collect();
        let y = |t: f64| 0.3 + t * (2.0 + t * (-5.0 + t * (7.0 - 4.0 * t)));
        let rate = |t: f64| 2.0 + t * (-10.0 + t * (21.0 - 16.0 * t));
        let values: Vec<f64> = times.iter().map(|t| y(*t)).collect();
        for (slope, t) in slopes_of(&times, &values).iter().zip(&times) {
            // Angles of 1 rad rounded to machine precision ε, differentiated over about 5 ms.
            assert!((slope - rate(*t)).abs() < 1e-11, "{slope} at {t} s, {}", rate(*t));
        }
    }

    /// Where another recording begins, a polynomial ends: the slopes of both parabolas are exact.
    #[test]
    fn no_polynomial_spans_a_tear() {
        let times: Vec<f64> = (0..40).map(|k| 0.008 * f64::from(k)).collect();
        let angle = |t: &f64| if *t < 0.156 { 0.3 * t * t } else { 2.0 - 0.5 * t * t };
        let y: Vec<f64> = times.iter().map(angle).collect();
        for (slope, t) in slopes_of(&times, &y).iter().zip(&times) {
            let rate = if *t < 0.156 { 0.6 * t } else { -t };
            // Angles of 2 rad rounded to machine precision, differentiated over 8 ms.
            assert!((slope - rate).abs() < 1e-11, "{slope} at {t} s, {rate}");
        }
    }

    /// The documented error bound is sharp: 5 Hz at 125 rows per second.
    #[test]
    fn a_wave_is_told_to_the_fourth_order() {
        let (omega, step_s) = (10.0 * std::f64::consts::PI, 0.008);
        let times: Vec<f64> = (0..500).map(|k| step_s * f64::from(k)).collect();
        let y: Vec<f64> = times.iter().map(|t| (omega * t).sin()).collect();
        let off = |(slope, t): (&f64, &f64)| (slope / omega - (omega * t).cos()).abs();
        let slopes = slopes_of(&times, &y);
        let worst = slopes[2..498].iter().zip(&times[2..498]).map(off).fold(0.0, f64::max);
        let bound = (omega * step_s).powi(4) / 30.0;
        assert!(worst < 1.01 * bound && worst > 0.9 * bound, "{worst} {bound}");
    }

    #[test]
    fn rows_alone_have_no_slope() {
        assert_eq!(slopes_of(&[1.0], &[3.0]), [0.0]);
        assert_eq!(slopes_of(&[], &[]), [0.0; 0]);
        // A single row after a gap.
        assert_eq!(slopes_of(&[0.0, 1.0, 2.0, 9.0], &[0.0, 1.0, 2.0, 5.0])[3], 0.0);
    }
}
