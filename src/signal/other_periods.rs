//! Finds the samples at the same phase of a motion in its other periods.

/// Largest number of other periods that one is compared with. The nearest ones serve as well as all, and an hour of a
/// short motion has hundreds.
const MOST_OTHERS: usize = 16;

/// Returns the fractional sample positions at the phase of sample `k` in the other periods.
///
/// The log has `samples` samples and repeats every `period` of them. Only periods in which the phase was recorded
/// count, and of many only the nearest.
pub fn other_periods(k: usize, period: f64, samples: usize) -> impl Iterator<Item = f64> + Clone {
    let own = (k as f64 / period).floor() as usize;
    let phase = k as f64 - own as f64 * period;
    let at = move |number: usize| phase + number as f64 * period;
    let last = samples.saturating_sub(1) as f64;
    let recorded = if last < phase { 0 } else { ((last - phase) / period).floor() as usize + 1 };
    let most = MOST_OTHERS + 1;
    let first = own.saturating_sub(MOST_OTHERS / 2).min(recorded.saturating_sub(most));
    (first..recorded.min(first + most)).filter(move |number| *number != own).map(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 6.5 periods of 10 samples the seventh contains only the first half; of many periods the nearest sixteen are
    /// used.
    #[test]
    fn other_periods_are_those_that_were_recorded() {
        let others = |k, samples| other_periods(k, 10.0, samples).collect::<Vec<f64>>();
        assert_eq!(others(12, 65), [2.0, 22.0, 32.0, 42.0, 52.0, 62.0]);
        assert_eq!(others(17, 65), [7.0, 27.0, 37.0, 47.0, 57.0]);
        for (k, first) in [(3, 13.0), (503, 423.0), (993, 833.0)] {
            let near = others(k, 1000);
            assert_eq!((near.len(), near[0]), (16, first));
        }
    }
}
