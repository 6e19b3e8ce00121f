//! Shares: proportions of trials, with confidence bounds.

use serde::{Deserialize, Serialize};
use statrs::distribution::{Beta, ContinuousCDF};

/// A count out of a total, as an estimate of the probability behind it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Share {
    /// Number of trials of the wanted kind.
    pub count: u64,
    /// Total number of trials.
    pub of: u64,
}

impl Share {
    /// Counts the items of `all` for which `wanted` holds.
    pub fn of<T>(all: impl IntoIterator<Item = T>, mut wanted: impl FnMut(&T) -> bool) -> Self {
        let mut share = Self::default();
        for one in all {
            share.of += 1;
            share.count += u64::from(wanted(&one));
        }
        share
    }

    /// The share; NaN if the total is zero.
    pub fn value(&self) -> f64 {
        self.count as f64 / self.of as f64
    }

    /// Lower and upper Clopper–Pearson bounds (1934), each one-sided at confidence 1 − `alpha`.
    pub fn bounds(&self, alpha: f64) -> [f64; 2] {
        let (k, n) = (self.count as f64, self.of as f64);
        let quantile =
            |a: f64, b: f64, p: f64| Beta::new(a, b).map(|beta| beta.inverse_cdf(p)).ok();
        // Without successes the lower bound is 0; without failures the upper bound is 1.
        let low = if self.count == 0 { None } else { quantile(k, n - k + 1.0, alpha) };
        let high = if self.count == self.of { None } else { quantile(k + 1.0, n - k, 1.0 - alpha) };
        [low.unwrap_or(0.0), high.unwrap_or(1.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rule of three: with no event in n trials the 95 % upper bound is 1 − 0.05^(1/n), about 3/n.
    #[test]
    fn bounds_are_those_of_clopper_and_pearson() {
        let none = Share { count: 0, of: 1000 };
        assert!((none.bounds(0.05)[1] - (1.0 - 0.05f64.powf(1e-3))).abs() < 1e-9);
        assert_eq!(none.bounds(0.05)[0], 0.0);
        // Published example: 10 of 100, two-sided 95 %: 4.90 … 17.62 %.
        let [low, high] = Share { count: 10, of: 100 }.bounds(0.025);
        assert!((low - 0.0490).abs() < 1e-4 && (high - 0.1762).abs() < 1e-4, "{low} {high}");
    }
}
