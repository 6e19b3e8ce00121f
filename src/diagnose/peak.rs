//! Search for the peak of a curve.

/// Steps of the golden section, after which the bracket is a twentieth of the first one.
const GOLDEN_STEPS: usize = 6;
/// Ratio of one bracket to the one before.
const RATIO: f64 = 0.618_033_988_749_895;

/// Looks for the peak of `f` between `low` and `high`, where it has only one: by golden section, and in the end at the
/// vertex of the parabola through the highest point and its two neighbours (Brent 1973). `f` keeps what it finds; `known`
/// is a point (x, f(x)) of the curve. Where there is no curve, f is −∞.
pub fn search_peak([mut low, mut high]: [f64; 2], known: [f64; 2], mut f: impl FnMut(f64) -> f64) {
    let mut points = vec![known];
    let mut value = |x: f64| {
        let y = f(x);
        points.push([x, y]);
        y
    };
    let mut inner = [high - RATIO * (high - low), low + RATIO * (high - low)];
    let mut values = inner.map(&mut value);
    for _ in 0..GOLDEN_STEPS {
        if values[0] >= values[1] {
            high = inner[1];
            inner = [high - RATIO * (high - low), inner[0]];
            values = [value(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + RATIO * (high - low)];
            values = [values[1], value(inner[1])];
        }
    }
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let is_peak = |three: &&[[f64; 2]]| three[1][1] >= three[0][1] && three[1][1] >= three[2][1];
    let peaks = points.windows(3).filter(is_peak);
    let highest = peaks.max_by(|a, b| a[1][1].total_cmp(&b[1][1]));
    if let Some(vertex) = highest.and_then(vertex) {
        f(vertex);
    }
}

/// Vertex of the parabola through three points; `None` if they lie on a straight line, or one of them on no curve.
fn vertex(points: &[[f64; 2]]) -> Option<f64> {
    let &[[x0, y0], [x, y], [x1, y1]] = points else { return None };
    let (left, right) = ((x - x0) * (y - y1), (x - x1) * (y - y0));
    let moved = 0.5 * ((x - x0) * left - (x - x1) * right) / (left - right);
    (moved.is_finite() && moved != 0.0).then_some(x - moved)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance from the peak of the best point that is tried of `f` between 0 and 1.
    fn missed(peak: f64, f: impl Fn(f64) -> f64) -> f64 {
        let mut best = [0.2, f(0.2)];
        search_peak([0.0, 1.0], best, |x| {
            let y = f(x);
            if y > best[1] {
                best = [x, y];
            }
            y
        });
        (best[0] - peak).abs()
    }

    #[test]
    fn the_peak_of_a_parabola_is_found_to_rounding() {
        for peak in [0.05, 0.37, 0.61, 0.93] {
            let off = missed(peak, |x| 3.0 - (x - peak).powi(2));
            assert!(off < 1e-12, "{peak}: {off}");
        }
    }

    /// With f‴ ≠ 0 the vertex is off by the cubic term over a bracket of a twentieth: f‴/f″ h²/6 with h below 0.06 · 0.62.
    #[test]
    fn the_peak_of_a_lopsided_curve_is_found_to_the_cubic_term() {
        for peak in [0.1, 0.37, 0.61, 0.9] {
            // x e^{−x/p} has its peak at p, where f‴/f″ = −2/p.
            let off = missed(peak, |x| x * (-x / peak).exp());
            assert!(off < 2.0 / peak * (0.06_f64 * 0.62).powi(2) / 6.0, "{peak}: {off}");
        }
    }

    #[test]
    fn a_peak_beside_a_range_without_a_curve_is_found_to_a_twentieth() {
        let off = missed(0.5, |x| if x < 0.5 { f64::NEG_INFINITY } else { -x });
        assert!(off < 0.06, "{off}");
        // A rising curve has its highest point at the end.
        assert!(missed(1.0, |x| x) < 0.06);
    }
}
