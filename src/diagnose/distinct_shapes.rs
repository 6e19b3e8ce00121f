//! How many of a family's shapes can be told from each other.

use super::study::Entry;

/// The z of noise that has to be exceeded by what is named, about.
const TYPICAL_Z: f64 = 4.5;

/// How many tests the shapes of one family at one site are together: the chance that noise exceeds z in any of them, over
/// that in one.
///
/// Two shapes whose columns are an angle θ apart exceed z one without the other with a chance of no more than (θ/π)
/// exp(−z²/2), twice the up-crossings on the way from one to the other (Efron 1997, the length heuristic), or that of one
/// test, 2 Φ(−z) ≈ √(2/π) exp(−z²/2)/z. Each shape joins the nearest of those before it (Worsley 1982): the one before it in
/// its variant, and all of the variant before. Of families with several coefficients every shape counts.
pub fn distinct_shapes(entries: &[Entry]) -> f64 {
    tests(entries, TYPICAL_Z)
}

fn tests(entries: &[Entry], z: f64) -> f64 {
    if entries.iter().any(|e| e.images.len() > 1) {
        return entries.len() as f64;
    }
    let angle = |a: &Entry, b: &Entry| {
        let (a, b) = (&a.images[0], &b.images[0]);
        (a.dot(b).abs() / (a.square() * b.square()).sqrt()).min(1.0).acos()
    };
    let variants: Vec<&[Entry]> =
        entries.chunk_by(|a, b| a.shape.variant == b.shape.variant).collect();
    let mut count = 1.0;
    for (v, variant) in variants.iter().enumerate() {
        for (k, entry) in variant.iter().enumerate() {
            let before = k.checked_sub(1).map(|k| &variant[k]);
            let beside = v.checked_sub(1).into_iter().flat_map(|v| variants[v]);
            let nearest = before.into_iter().chain(beside).map(|other| angle(entry, other));
            if let Some(angle) = nearest.min_by(f64::total_cmp) {
                count += (angle * z / std::f64::consts::TAU.sqrt()).min(1.0);
            }
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::candidates::Shape;
    use crate::diagnose::image::Image;

    fn entry(variant: usize, value: f64, mean: &[f64]) -> Entry {
        let images = vec![Image { mean: mean.to_vec(), contrast: Vec::new() }];
        Entry { family: 0, site: None, shape: Shape { variant, value }, images }
    }

    fn quarter_circle(steps: usize) -> Vec<Entry> {
        let angle = |k: usize| std::f64::consts::FRAC_PI_2 * k as f64 / steps as f64;
        let columns = (0..=steps).map(|k| [angle(k).cos(), angle(k).sin()]);
        columns.enumerate().map(|(k, mean)| entry(0, k as f64, &mean)).collect()
    }

    /// Along a quarter of a circle, however finely, the length heuristic counts 1 + (π/2) z/√(2π) tests; columns at right
    /// angles are a test each, and the same column in two variants is one, wherever
    /// it stands in them.
    #[test]
    fn shapes_that_resemble_each_other_are_counted_once() {
        let expected = 1.0 + std::f64::consts::FRAC_PI_2 * TYPICAL_Z / std::f64::consts::TAU.sqrt();
        for steps in [10, 100] {
            let tests = distinct_shapes(&quarter_circle(steps));
            assert!((tests / expected - 1.0).abs() < 1e-9, "{tests} {expected}");
        }
        let apart = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut entries: Vec<Entry> = (0..3).map(|k| entry(0, k as f64, &apart[k])).collect();
        assert_eq!(distinct_shapes(&entries), 3.0);
        entries.extend([2, 0].map(|k| entry(1, k as f64, &apart[k])));
        assert_eq!(distinct_shapes(&entries), 3.0);
    }

    /// The chance that noise exceeds z in any of the columns on a quarter of a circle, over that in one, is the tests that
    /// are counted, but for what 2 Φ(−z) is less than its leading term, by 1 − 1/z² at most (Gordon 1941).
    #[test]
    fn the_count_is_the_chance() {
        use rand::{SeedableRng, rngs::ChaCha8Rng};
        use rand_distr::{Distribution, StandardNormal};
        let (z, trials) = (2.5_f64, 200_000);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let columns = quarter_circle(90);
        let (mut any, mut one) = (0.0, 0.0);
        for _ in 0..trials {
            let (x, y) = (normal(), normal());
            let exceeds = |e: &Entry| {
                let column = &e.images[0].mean;
                (x * column[0] + y * column[1]).abs() > z
            };
            any += f64::from(u8::from(columns.iter().any(exceeds)));
            one += f64::from(u8::from(exceeds(&columns[0])));
        }
        let counted = tests(&columns, z);
        let at_most = 1.0 + (counted - 1.0) / (1.0 - z.powi(-2));
        // 2500 cases of one and 4400 more of the others: the ratio is known to 1.6 %, of which this is four. Exceeding at
        // both ends with different signs, which is counted twice, has 0.3 %.
        let ratio: f64 = any / one;
        assert!(ratio > 0.933 * counted, "{ratio} {counted}");
        assert!(ratio < 1.064 * at_most, "{ratio} {at_most}");
    }
}
