//! Intervals of physical quantities from the covariance of the numbers that were fitted.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector};

use super::candidates::Quantity;

/// Step of the numerical gradient, in σ of the number that is moved.
const STEP: f64 = 1e-3;

/// The quantities `at` the numbers `b`, each with the half-width of its interval of ± `half` σ by the delta method:
/// half √(gᵀ V g), with the gradient g of the quantity and the `covariance` V of the numbers whose indices in `b` are
/// `free`. All others are taken as they are. Differences of angles are taken the short way round.
pub(super) fn with_reach(
    at: impl Fn(&[f64]) -> Vec<Quantity>,
    b: &[f64],
    (free, covariance): (&[usize], &DMatrix<f64>),
    half: f64,
) -> Vec<(Quantity, f64)> {
    let centre = at(b);
    let mut gradients = vec![DVector::<f64>::zeros(free.len()); centre.len()];
    for (k, place) in free.iter().enumerate() {
        let h = STEP * covariance[(k, k)].max(0.0).sqrt().max(f64::MIN_POSITIVE);
        let moved = |sign: f64| {
            let mut b = b.to_vec();
            b[*place] += sign * h;
            at(&b)
        };
        for (g, (up, down)) in gradients.iter_mut().zip(moved(1.0).iter().zip(moved(-1.0))) {
            let mut difference = up.value - down.value;
            if up.unit == "rad" && difference.abs() > PI {
                difference -= difference.signum() * TAU;
            }
            g[k] = difference / (2.0 * h);
        }
    }
    let reach = |g: &DVector<f64>| half * (g.transpose() * covariance * g)[(0, 0)].max(0.0).sqrt();
    centre.into_iter().zip(gradients.iter().map(reach)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The product a b and the angle α of two numbers: d(ab)/da = b, dα/da = −b/(a² + b²), dα/db = a/(a² + b²). One of
    /// them is free, at first where the angle lies at the cut of atan2; then both, given the other way round, with
    /// variances of 0.04 (b) and 0.09 (a) and a covariance of 0.03. The error of the central difference is of the order
    /// of the step squared, 1e-6.
    #[test]
    fn only_what_is_free_makes_an_interval() {
        let quantity = |name, value, unit| Quantity { name, value, unit };
        let at = |b: &[f64]| {
            vec![quantity("product", b[0] * b[1], "Nm"), quantity("angle", b[1].atan2(b[0]), "rad")]
        };
        let covariance = DMatrix::from_element(1, 1, 0.04);
        let b = [-2.0, 0.0];
        let found = with_reach(at, &b, (&[1], &covariance), 2.0);
        assert_eq!(found[0].0.value, 0.0);
        assert!((found[0].1 - 2.0 * 2.0 * 0.2).abs() < 1e-6, "{}", found[0].1);
        assert!((found[1].1 - 2.0 * 0.5 * 0.2).abs() < 1e-6, "{}", found[1].1);
        let found = with_reach(at, &[-2.0, 3.0], (&[0], &covariance), 1.0);
        assert!((found[0].1 - 3.0 * 0.2).abs() < 1e-6, "{}", found[0].1);
        assert!((found[1].1 - 3.0 / 13.0 * 0.2).abs() < 1e-6, "{}", found[1].1);
        let both = DMatrix::from_row_slice(2, 2, &[0.04, 0.03, 0.03, 0.09]);
        let found = with_reach(at, &[-2.0, 3.0], (&[1, 0], &both), 1.0);
        let sigma = |db: f64, da: f64| (0.04 * db * db + 0.06 * db * da + 0.09 * da * da).sqrt();
        assert!((found[0].1 - sigma(-2.0, 3.0)).abs() < 1e-6, "{}", found[0].1);
        assert!((found[1].1 - sigma(-2.0 / 13.0, -3.0 / 13.0)).abs() < 1e-6, "{}", found[1].1);
    }
}
