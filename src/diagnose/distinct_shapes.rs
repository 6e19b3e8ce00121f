//! How many distinguishable shapes a family has.

use super::study::Entry;

/// About the z that a law has to exceed before it is named.
const TYPICAL_Z: f64 = 4.5;
/// The same where the noise is known with 20 degrees of freedom: Student's t with the same probability.
const MOST_Z: f64 = 6.0;

/// Effective number of tests that the shapes of one family at one site amount to: the probability that noise exceeds z
/// in any of them, divided by the probability for one.
///
/// For two shapes whose columns are an angle θ apart, the probability that noise exceeds z in one but not in the other
/// is at most (θ/π) exp(−z²/2), twice the expected number of up-crossings on the way from one to the other (Efron 1997,
/// the length heuristic); it is also at most that of one test, 2 Φ(−z) ≈ √(2/π) exp(−z²/2)/z. Each shape joins its
/// nearest neighbour among the earlier ones (Worsley 1982): the shape before it in its own variant, and all shapes of
/// the variant before. In variants with several coefficients every shape counts as one test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DistinctShapes {
    /// Number for all shapes, with any coefficients.
    pub all: f64,
    /// Number for the shapes that noise can reach: a coefficient as large as noise would need to be named is possible
    /// there.
    pub within_reach: f64,
}

impl DistinctShapes {
    /// Counts the shapes of `entries`; `is_possible` says whether a coefficient is possible for an entry.
    pub fn of(entries: &[Entry], is_possible: impl Fn(&Entry, f64) -> bool) -> Self {
        let variants = entries.chunk_by(|a, b| a.shape.variant == b.shape.variant);
        let (single, several): (Vec<_>, Vec<_>) =
            variants.partition(|variant| variant.iter().all(|e| e.images.len() == 1));
        let several = several.into_iter().map(|variant| variant.len() as f64).sum::<f64>();
        let single: Vec<&Entry> = single.into_iter().flatten().collect();
        if single.is_empty() {
            return Self { all: several, within_reach: several };
        }
        let is_within = |e: &&Entry| {
            let sigma = 1.0 / e.images[0].square().sqrt();
            [-MOST_Z, -TYPICAL_Z, TYPICAL_Z, MOST_Z].iter().any(|z| is_possible(e, z * sigma))
        };
        let within_reach: Vec<&Entry> = single.iter().copied().filter(is_within).collect();
        Self {
            all: several + tests(&single, TYPICAL_Z),
            within_reach: several + tests(&within_reach, TYPICAL_Z),
        }
    }
}

/// Effective number of tests at the threshold `z`, for entries with one column each.
fn tests(entries: &[&Entry], z: f64) -> f64 {
    let angle = |(a, a_square): &(&Entry, f64), (b, b_square): &(&Entry, f64)| {
        let along = a.images[0].dot(&b.images[0]).abs();
        (along / (a_square * b_square).sqrt()).min(1.0).acos()
    };
    let entries: Vec<(&Entry, f64)> = entries.iter().map(|e| (*e, e.images[0].square())).collect();
    let variants: Vec<&[(&Entry, f64)]> =
        entries.chunk_by(|(a, _), (b, _)| a.shape.variant == b.shape.variant).collect();
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
        Entry { family: 0, site: None, shape: Shape { variant, value }, images: images.into() }
    }

    /// A family in which every coefficient is possible for every shape.
    const ANY: fn(&Entry, f64) -> bool = |_, _| true;

    fn quarter_circle(steps: usize) -> Vec<Entry> {
        let angle = |k: usize| std::f64::consts::FRAC_PI_2 * k as f64 / steps as f64;
        let columns = (0..=steps).map(|k| [angle(k).cos(), angle(k).sin()]);
        columns.enumerate().map(|(k, mean)| entry(0, k as f64, &mean)).collect()
    }

    /// Along a quarter of a circle, sampled as finely as desired, the length heuristic counts 1 + (π/2) z/√(2π) tests.
    /// Columns at right angles are one test each. A column that occurs in two variants is counted once, wherever in the
    /// variants it is.
    #[test]
    fn shapes_that_resemble_each_other_are_counted_once() {
        let expected = 1.0 + std::f64::consts::FRAC_PI_2 * TYPICAL_Z / std::f64::consts::TAU.sqrt();
        for steps in [10, 100] {
            let tests = DistinctShapes::of(&quarter_circle(steps), ANY).all;
            assert!((tests / expected - 1.0).abs() < 1e-9, "{tests} {expected}");
        }
        let apart = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut entries: Vec<Entry> = (0..3).map(|k| entry(0, k as f64, &apart[k])).collect();
        assert_eq!(DistinctShapes::of(&entries, ANY).all, 3.0);
        entries.extend([2, 0].map(|k| entry(1, k as f64, &apart[k])));
        assert_eq!(DistinctShapes::of(&entries, ANY).all, 3.0);
    }

    /// Where shape and coefficient are one parameter, only shapes that noise reaches count. With σ = 1/‖x‖ = 1, and
    /// coefficients possible within half of the shape's value, these are 5 and −6 of the four values. Where noise
    /// reaches no shape, one test remains.
    #[test]
    fn what_noise_does_not_reach_is_no_test() {
        let apart = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.6, 0.8]];
        let values = [5.0, 1.0, 20.0, -6.0];
        let entries: Vec<Entry> = (0..4).map(|k| entry(0, values[k], &apart[k])).collect();
        let agrees = |e: &Entry, b: f64| (b / e.shape.value - 1.0).abs() < 0.5;
        let tests = |entries: &[Entry]| DistinctShapes::of(entries, agrees);
        assert_eq!(tests(&entries).within_reach, 2.0);
        assert_eq!(tests(&entries[1..3]), DistinctShapes { all: 2.0, within_reach: 1.0 });
        // A variant with two columns counts beside those with one.
        let mut mixed = entries.clone();
        let mut other = entry(1, 1.0, &[0.0, 1.0, 0.0]);
        other.images = [&*other.images, &*other.images].concat().into();
        mixed.push(other);
        assert_eq!(
            tests(&mixed),
            DistinctShapes { all: tests(&entries).all + 1.0, within_reach: 3.0 }
        );
        // One coefficient of two columns does not tell where the other one is.
        let mut both = entries;
        both.iter_mut().for_each(|e| e.images = [&*e.images, &*e.images].concat().into());
        assert_eq!(tests(&both), DistinctShapes { all: 4.0, within_reach: 4.0 });
    }

    /// The probability that noise exceeds z in any of the columns on a quarter of a circle, over that for one column,
    /// equals the number of tests counted, except that 2 Φ(−z) falls short of its leading term, by a factor of no less
    /// than 1 − 1/z² (Gordon 1941).
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
        let counted = tests(&columns.iter().collect::<Vec<_>>(), z);
        let at_most = 1.0 + (counted - 1.0) / (1.0 - z.powi(-2));
        // 2500 exceedances of one column and 4400 more of the others: the ratio is known to 1.6 %, and the tolerance is
        // four times that. Exceedances at both ends with opposite signs, which are counted twice, add 0.3 %.
        let ratio: f64 = any / one;
        assert!(ratio > 0.933 * counted, "{ratio} {counted}");
        assert!(ratio < 1.064 * at_most, "{ratio} {at_most}");
    }
}
