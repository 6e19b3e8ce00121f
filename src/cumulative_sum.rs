//! Cumulative sums.

use std::ops::AddAssign;

/// Adds to each of the `values` all those before it, from the first to the last.
pub fn accumulate<T: Copy + AddAssign>(values: &mut [T]) {
    for k in 1..values.len() {
        let before = values[k - 1];
        values[k] += before;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_becomes_the_sum_up_to_it() {
        let mut values = [2.0, -1.0, 0.5];
        accumulate(&mut values);
        assert_eq!(values, [2.0, 1.0, 1.5]);
        let mut counts = [1_usize, 0, 1];
        accumulate(&mut counts);
        assert_eq!(counts, [1, 1, 2]);
        accumulate::<f64>(&mut []);
    }
}
