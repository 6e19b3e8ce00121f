//! The median (for an even number of values, the mean of the two in the middle) and other robust statistics.

/// Median of finite values, which are reordered; `None` without any value.
pub fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    let is_even = values.len().is_multiple_of(2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = below.iter().copied().max_by(f64::total_cmp).filter(|_| is_even);
    Some(lower.map_or(upper, |lower| 0.5 * (lower + upper)))
}

/// Mean of all values except the smallest and the largest; the values are reordered. One wild value does not move it.
/// For seven Gaussian values its variance is 7 % above that of the plain mean, where that of the median is 47 % above.
/// For one or two values it is their mean; `None` without any value.
pub fn trimmed_mean(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let inner = match values.len() {
        0 => return None,
        1 | 2 => &*values,
        n => &values[1..n - 1],
    };
    Some(inner.iter().sum::<f64>() / inner.len() as f64)
}

/// The value nearest to `share` (0…1) of the way from the first to the last of an ascending list: 0 gives the smallest
/// value, 1 the largest. Zero for an empty list. [`upper_quantile`] counts values instead.
pub fn nearest_quantile(ascending: &[f64], share: f64) -> f64 {
    let last = ascending.len().saturating_sub(1);
    ascending.get((share * last as f64).round() as usize).copied().unwrap_or(0.0)
}

/// The smallest of the `values` that more than this `share` (from 0, and below 1) of them do not exceed: of ten values,
/// the largest for 0.9, where [`nearest_quantile`] is the second largest. The values are reordered; `None` without any.
pub fn upper_quantile(values: &mut [f64], share: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let place = (share * values.len() as f64) as usize;
    Some(*values.select_nth_unstable_by(place, f64::total_cmp).1)
}

/// Standard deviation of Gaussian values from the median of their `sizes` |x|: median/0.6745. The sizes are reordered;
/// zero without any size.
pub fn robust_sigma(sizes: &mut [f64]) -> f64 {
    1.4826 * median(sizes).unwrap_or(0.0)
}

/// [`robust_sigma`] of the values that are not zero: a reading that did not change says nothing about noise.
pub fn sigma_of_changes(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|v| v.abs()).filter(|v| *v > 0.0).collect();
    robust_sigma(&mut sizes)
}

/// Median of the positive time steps, s; `None` without any.
pub fn median_step(time_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        time_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|&step| step > 0.0).collect();
    median(&mut steps)
}

/// Number of steps of `typical_s` that are missing between the stamps `k` − 1 and `k` of `time_s`, not rounded.
fn missing_steps(time_s: &[f64], k: usize, typical_s: f64) -> f64 {
    lasting(k, |k| Some((time_s.get(k)? - time_s.get(k.checked_sub(1)?)?) / typical_s - 1.0))
}

/// A step is uneven if it is farther than this from every whole number of typical steps, in such steps. Stamps of evenly
/// sampled rows, lost ones among them, are closer, and so are those of a recorder that alternates between 10 and 12 ms.
const UNEVEN: f64 = 0.25;
/// Rows are sampled unevenly if at least this share of the steps is uneven. Single rows that are late are fewer.
const OFTEN: f64 = 0.2;
/// Share of the steps that are not longer than the longest ones among which no row is missing. The rows that are really
/// missing may be behind the others.
const USUAL: f64 = 0.95;

/// The time steps of a record of which no row is missing.
pub struct UsualStep {
    typical_s: f64,
    longest_s: f64,
}

impl UsualStep {
    /// The median step and, for rows that are sampled unevenly, a step that few exceed; `None` without any step.
    pub fn of(time_s: &[f64]) -> Option<Self> {
        let typical_s = median_step(time_s)?;
        let steps = time_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
        let mut steps: Vec<f64> = steps.collect();
        let is_uneven = |step: &&f64| {
            let ratio = **step / typical_s;
            (ratio - ratio.round().max(1.0)).abs() > UNEVEN
        };
        let uneven = steps.iter().filter(is_uneven).count();
        if (uneven as f64) < OFTEN * steps.len() as f64 {
            return Some(Self { typical_s, longest_s: typical_s });
        }
        let longest_s = upper_quantile(&mut steps, USUAL)?;
        Some(Self { typical_s, longest_s })
    }

    /// Number of rows that are missing between the stamps `k` − 1 and `k` of `time_s`.
    pub fn missing_rows(&self, time_s: &[f64], k: usize) -> f64 {
        match missing_steps(time_s, k, self.longest_s).round() > 0.0 {
            true => missing_steps(time_s, k, self.typical_s).round(),
            false => 0.0,
        }
    }
}

/// The part of the `excess` of step `k` that the two neighbouring steps do not compensate, or 0.
///
/// A stamp that is late makes the step before it longer and the step after it shorter by the same amount: that is
/// jitter, and no excess lasts.
pub fn lasting(k: usize, excess: impl Fn(usize) -> Option<f64>) -> f64 {
    let deficit = |k: Option<usize>| k.and_then(&excess).map_or(0.0, |e| e.min(0.0));
    excess(k).map_or(0.0, |e| e + deficit(k.checked_sub(1)) + deficit(Some(k + 1))).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_stamps_miss_nothing_and_left_out_rows_do() {
        let late = [0.0, 1.0, 2.6, 3.0, 4.0, 5.4, 5.6, 7.0];
        assert!((1..late.len()).all(|k| missing_steps(&late, k, 1.0).round() == 0.0));
        let left_out = [0.0, 1.1, 1.9, 3.1, 6.0, 6.9];
        let found: Vec<f64> =
            (1..left_out.len()).map(|k| missing_steps(&left_out, k, 1.0).round()).collect();
        assert_eq!(found, [0.0, 0.0, 0.0, 2.0, 0.0]);
    }

    /// Steps of 2 to 6 ms at random, and every hundredth 40 ms long: nine rows are missing there, of which short steps
    /// beside may give back one, and none elsewhere.
    #[test]
    fn uneven_steps_miss_nothing() {
        let step_s = |k: usize| match k % 100 {
            99 => 0.040,
            _ => 0.002 + 0.001 * (k * 7919 % 1009 % 5) as f64,
        };
        let add = |sum: &mut f64, k: usize| {
            *sum += step_s(k);
            Some(*sum)
        };
        let time_s: Vec<f64> = (0..2000).scan(0.0, add).collect();
        let usual = UsualStep::of(&time_s).unwrap();
        for k in 1..time_s.len() {
            let missing = usual.missing_rows(&time_s, k);
            let expected = if k % 100 == 99 { 8.0..=9.0 } else { 0.0..=0.0 };
            assert!(expected.contains(&missing), "{k}: {missing}");
        }
    }

    #[test]
    fn the_middle_of_odd_and_even_numbers_of_values() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(median(&mut [7.0]), Some(7.0));
        assert_eq!(median(&mut []), None);
    }

    /// The place 0.9 · 9 = 8.1 among 0 … 9 is nearest to that of the second largest of ten values, which nine do not
    /// exceed; more than nine do not exceed the largest.
    #[test]
    fn one_quantile_is_the_nearest_and_the_other_the_upper() {
        let ascending: Vec<f64> = (1..=10).map(f64::from).collect();
        assert_eq!([0.0, 0.9, 1.0].map(|p| nearest_quantile(&ascending, p)), [1.0, 9.0, 10.0]);
        assert_eq!(nearest_quantile(&[], 0.9), 0.0);
        let mut values: Vec<f64> = ascending.into_iter().rev().collect();
        let upper = [0.0, 0.89, 0.9].map(|share| upper_quantile(&mut values, share));
        assert_eq!(upper, [Some(1.0), Some(9.0), Some(10.0)]);
        assert_eq!(upper_quantile(&mut [], 0.9), None);
    }

    #[test]
    fn one_wild_value_does_not_move_a_trimmed_mean() {
        assert_eq!(trimmed_mean(&mut [1e9, 1.0, 4.0, 2.0, 3.0]), Some(3.0));
        assert_eq!(trimmed_mean(&mut [4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(trimmed_mean(&mut [4.0, 1.0]), Some(2.5));
        assert_eq!(trimmed_mean(&mut [7.0]), Some(7.0));
        assert_eq!(trimmed_mean(&mut []), None);
    }
}
