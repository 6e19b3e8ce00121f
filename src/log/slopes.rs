//! Velocities of a log that has none.

use crate::median::median_step;

/// Rows through which a polynomial is laid.
const ROWS: usize = 5;
/// A step of time so many times the usual one is a gap, across which nothing is known.
const GAP: f64 = 2.5;

/// The slope of `y` at each of its times, per second: that of the polynomial through the row, two before and two behind it, nearer to
/// a gap or an end through the five rows beside it. Of evenly recorded rows a step h apart a wave of ω is told to (ω h)⁴/30, and noise of
/// one reading becomes 0.95/h of it. Zero of a row alone.
pub(super) fn slopes(time_s: &[f64], y: &[f64]) -> Vec<f64> {
    let gap_s = GAP * median_step(time_s).unwrap_or(f64::INFINITY);
    let mut out = Vec::with_capacity(y.len());
    let mut first = 0;
    for stretch in time_s.chunk_by(|before, behind| behind - before <= gap_s) {
        let rows = first..first + stretch.len();
        let reach = ROWS.min(stretch.len());
        out.extend(rows.clone().map(|k| {
            let from = k.saturating_sub(ROWS / 2).clamp(rows.start, rows.end - reach);
            slope_at(k - from, &time_s[from..from + reach], &y[from..from + reach])
        }));
        first = rows.end;
    }
    out
}

/// The slope at the k-th point of the polynomial through all of them (Lagrange).
fn slope_at(k: usize, t: &[f64], y: &[f64]) -> f64 {
    let others = |i: usize| (0..t.len()).filter(move |&l| l != i && l != k);
    let weight = |i: usize| {
        let through: f64 = others(i).map(|l| (t[k] - t[l]) / (t[i] - t[l])).product();
        through / (t[i] - t[k])
    };
    // The weights of a constant add up to none, which is what is left for the point itself.
    others(k).map(|i| weight(i) * (y[i] - y[k])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polynomial of fourth order on uneven times is told exactly, up to a gap and behind it.
    #[test]
    fn polynomials_are_told_exactly() {
        let times = (0..40).map(|k| 0.008 * k as f64 + 0.002 * f64::from(k % 3));
        let times: Vec<f64> = times.filter(|t| !(0.1..0.16).contains(t)).collect();
        let y = |t: f64| 0.3 + t * (2.0 + t * (-5.0 + t * (7.0 - 4.0 * t)));
        let rate = |t: f64| 2.0 + t * (-10.0 + t * (21.0 - 16.0 * t));
        let values: Vec<f64> = times.iter().map(|t| y(*t)).collect();
        for (slope, t) in slopes(&times, &values).iter().zip(&times) {
            // Angles of 1 rad to ε, over some 5 ms.
            assert!((slope - rate(*t)).abs() < 1e-11, "{slope} at {t} s, {}", rate(*t));
        }
    }

    /// The bound of the documentation, with 5 Hz at 125 rows a second.
    #[test]
    fn a_wave_is_told_to_the_fourth_order() {
        let (omega, step_s) = (10.0 * std::f64::consts::PI, 0.008);
        let times: Vec<f64> = (0..500).map(|k| step_s * f64::from(k)).collect();
        let y: Vec<f64> = times.iter().map(|t| (omega * t).sin()).collect();
        let off = |(slope, t): (&f64, &f64)| (slope / omega - (omega * t).cos()).abs();
        let slopes = slopes(&times, &y);
        let worst = slopes[2..498].iter().zip(&times[2..498]).map(off).fold(0.0, f64::max);
        let bound = (omega * step_s).powi(4) / 30.0;
        assert!(worst < 1.01 * bound && worst > 0.9 * bound, "{worst} {bound}");
    }

    #[test]
    fn rows_alone_have_no_slope() {
        assert_eq!(slopes(&[1.0], &[3.0]), [0.0]);
        assert_eq!(slopes(&[], &[]), [0.0; 0]);
        // Beyond a gap that ends in a single row.
        assert_eq!(slopes(&[0.0, 1.0, 2.0, 9.0], &[0.0, 1.0, 2.0, 5.0])[3], 0.0);
    }
}
