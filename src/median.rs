//! The upper median: the value in the middle, of an even number of values the larger of the two there.

/// Upper median of finite values, whose order changes; `None` of none.
pub fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Median step of time among the steps forward, s; `None` without any.
pub fn median_step(time_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        time_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|&step| step > 0.0).collect();
    median(&mut steps)
}
