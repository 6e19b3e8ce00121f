//! Splits a periodic signal into the part common to all periods and the remainder.

/// Mean over all periods of `n` samples.
pub fn mean_period(y: &[f64], n: usize) -> Vec<f64> {
    let periods = y.len() / n;
    (0..n).map(|k| y.iter().skip(k).step_by(n).sum::<f64>() / periods as f64).collect()
}

/// Subtracts the mean over all periods of `n` samples from each period.
pub fn subtract_mean_period(y: &mut [f64], n: usize) {
    let common = mean_period(y, n);
    y.iter_mut().zip(common.iter().cycle()).for_each(|(y, common)| *y -= common);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_and_own_parts() {
        let mut y = [1.0, 5.0, 2.0, 3.0, 3.0, 7.0];
        assert_eq!(mean_period(&y, 2), [2.0, 5.0]);
        subtract_mean_period(&mut y, 2);
        assert_eq!(y, [-1.0, 0.0, 0.0, -2.0, 1.0, 2.0]);
    }
}
