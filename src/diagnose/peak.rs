//! Search for the peak of a curve.

use std::cmp::Ordering;

/// Points of the golden section: two, and one for each of the six steps after which the bracket is a twentieth of the
/// first one.
const SECTIONS: usize = 8;
/// Ratio of one bracket to the one before.
const RATIO: f64 = 0.618_033_988_749_895;

/// A search for the peak of a curve between two points, where it has only one: by golden section, and in the end at the
/// vertex of the parabola through the highest point and its two neighbours (Brent 1973).
///
/// It asks for one point at a time, so that several searches can be answered together.
pub struct PeakSearch {
    bracket: [f64; 2],
    /// The points that divide the bracket by the golden section, and the curve there.
    inner: [f64; 2],
    values: [f64; 2],
    /// The one of them that is wanted.
    wanted: usize,
    /// Points (x, y) of the curve.
    points: Vec<[f64; 2]>,
    /// Number of answers.
    told: usize,
}

impl PeakSearch {
    /// `known` is a point (x, y) of the curve.
    pub fn new([low, high]: [f64; 2], known: [f64; 2]) -> Self {
        Self {
            bracket: [low, high],
            inner: [high - RATIO * (high - low), low + RATIO * (high - low)],
            values: [f64::NEG_INFINITY; 2],
            wanted: 0,
            points: vec![known],
            told: 0,
        }
    }

    /// The point x at which the curve is wanted next; `None` at the end.
    pub fn wanted(&self) -> Option<f64> {
        match self.told.cmp(&SECTIONS) {
            Ordering::Less => Some(self.inner[self.wanted]),
            Ordering::Equal => self.vertex(),
            Ordering::Greater => None,
        }
    }

    /// Takes y at the point that is wanted; −∞ where there is no curve.
    pub fn tell(&mut self, y: f64) {
        if self.told < SECTIONS {
            self.points.push([self.inner[self.wanted], y]);
            self.values[self.wanted] = y;
        }
        self.told += 1;
        match self.told {
            1 => self.wanted = 1,
            2..SECTIONS => self.narrow(),
            _ => {}
        }
    }

    /// Leaves out the end of the bracket that is farther from the higher one of the inner points.
    fn narrow(&mut self) {
        let [low, high] = &mut self.bracket;
        if self.values[0] >= self.values[1] {
            *high = self.inner[1];
            self.inner = [*high - RATIO * (*high - *low), self.inner[0]];
            self.values[1] = self.values[0];
            self.wanted = 0;
        } else {
            *low = self.inner[0];
            self.inner = [self.inner[1], *low + RATIO * (*high - *low)];
            self.values[0] = self.values[1];
            self.wanted = 1;
        }
    }

    fn vertex(&self) -> Option<f64> {
        let mut points = self.points.clone();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let is_peak =
            |three: &&[[f64; 2]]| three[1][1] >= three[0][1] && three[1][1] >= three[2][1];
        let peaks = points.windows(3).filter(is_peak);
        peaks.max_by(|a, b| a[1][1].total_cmp(&b[1][1])).and_then(vertex)
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
        let mut search = PeakSearch::new([0.0, 1.0], best);
        while let Some(x) = search.wanted() {
            let y = f(x);
            if y > best[1] {
                best = [x, y];
            }
            search.tell(y);
        }
        (best[0] - peak).abs()
    }

    #[test]
    fn the_peak_of_a_parabola_is_found_to_rounding() {
        for peak in [0.05, 0.37, 0.61, 0.93] {
            let off = missed(peak, |x| 3.0 - (x - peak).powi(2));
            assert!(off < 1e-12, "{peak}: {off}");
        }
    }

    /// With f‴ ≠ 0 the vertex is off by the cubic term over a bracket of a twentieth: f‴/f″ h²/6 with h below
    /// 0.06 · 0.62.
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
