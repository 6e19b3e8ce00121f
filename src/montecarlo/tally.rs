//! Sums over trials that are the same for any order of the trials.

use serde::{Deserialize, Serialize};

use super::trials::{Failure, Gathered};

/// Fixed-point units per one: a unit is 2⁻⁴⁰ of a parameter's scale, about 1e-12 of a σ.
///
/// Integer addition is exact and associative, so a tally does not depend on the number of threads, on the split into
/// shards or on the order of merging; nor does its size depend on the number of trials. The range of 2¹²⁷ units is
/// enough to sum z⁴ over 1e10 trials with |z| ≤ 1e4.
const UNITS_PER_ONE: f64 = (1u64 << 40) as f64;

/// Largest |z| that a tally accepts; a trial with a larger one counts as failed.
pub const LARGEST_Z: f64 = 1e4;

/// Bin width of the histogram of (θ̂ − θ)/σ̂, pooled over the parameters. The bins reach from −[`BIN_RANGE`] to
/// +[`BIN_RANGE`]; one more bin at each end collects the values beyond.
pub const BIN_WIDTH: f64 = 0.25;
/// Range of the histogram; see [`BIN_WIDTH`].
pub const BIN_RANGE: f64 = 5.0;
const BINS: usize = (2.0 * BIN_RANGE / BIN_WIDTH) as usize + 2;

fn to_units(x: f64) -> i128 {
    (x * UNITS_PER_ONE).round() as i128
}

fn from_units(units: i128) -> f64 {
    units as f64 / UNITS_PER_ONE
}

/// Result of one trial for one parameter, in units of the parameter's scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// (θ̂ − θ)/scale.
    pub z: f64,
    /// σ̂/scale.
    pub sigma: f64,
    /// Half-width of the 95 % interval in units of σ̂.
    pub quantile_95: f64,
}

impl Outcome {
    fn covered(&self) -> bool {
        self.z.abs() <= self.quantile_95 * self.sigma
    }

    /// Whether the tally accepts this outcome.
    pub fn is_sound(&self) -> bool {
        self.z.abs() <= LARGEST_Z && self.sigma > 0.0 && self.sigma <= LARGEST_Z
    }
}

/// Result of one trial for all parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcomes {
    /// One outcome per parameter.
    pub parameters: Vec<Outcome>,
    /// Squared error of all parameters jointly in units of the predicted covariance, (θ̂ − θ)ᵀV⁻¹(θ̂ − θ), divided by
    /// its expected value for a correct V; `None` if that expected value is not known.
    pub distance: Option<f64>,
}

impl Outcomes {
    /// Whether the tally accepts the joint distance.
    pub fn is_sound(&self) -> bool {
        self.distance.is_none_or(|distance| (0.0..=LARGEST_Z * LARGEST_Z).contains(&distance))
    }
}

/// Exact sums over trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tally {
    /// Trials that gave an estimate.
    pub succeeded: u64,
    /// Trials that gave no estimate, sorted by number.
    pub failures: Vec<Failure>,
    parameters: Vec<ParameterSums>,
    /// Sum over the trials of the number of covered parameters; below it, the sum of the squares of this number.
    covered: u64,
    covered_squared: u64,
    /// Sum over the trials of the mean of z² over the parameters; below it, the sum of the squares of this mean.
    #[serde(with = "decimal")]
    spread: i128,
    #[serde(with = "decimal")]
    spread_squared: i128,
    /// Number of trials with an [`Outcomes::distance`]; below it, the sums of the distance and of its square.
    measured: u64,
    #[serde(with = "decimal")]
    distance: i128,
    #[serde(with = "decimal")]
    distance_squared: i128,
    histogram: Vec<u64>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterSums {
    #[serde(with = "decimal")]
    z: i128,
    #[serde(with = "decimal")]
    z_squared: i128,
    #[serde(with = "decimal")]
    sigma_squared: i128,
    covered: u64,
}

/// Serialises 128-bit integers as decimal strings, because JSON numbers would lose their low digits.
mod decimal {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub fn serialize<S: Serializer>(value: &i128, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(value)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<i128, D::Error> {
        String::deserialize(d)?.parse().map_err(D::Error::custom)
    }
}

impl Gathered for Tally {
    type Outcome = Outcomes;

    fn gather(&mut self, _trial: u64, outcomes: Outcomes) {
        self.add(&outcomes);
    }

    fn gather_failure(&mut self, failure: Failure) {
        self.add_failure(failure);
    }

    fn merge(&mut self, other: &Self) {
        Self::merge(self, other);
    }

    fn trials(&self) -> u64 {
        Self::trials(self)
    }

    fn fits(&self, other: &Self) -> bool {
        self.parameters.len() == other.parameters.len()
            && self.histogram.len() == other.histogram.len()
    }
}

/// Statistics of one parameter over the trials, in units of its scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterStatistics {
    /// Mean of (θ̂ − θ)/scale.
    pub bias: f64,
    /// Standard deviation of θ̂/scale; NaN for fewer than two trials.
    pub sigma_empirical: f64,
    /// Root mean square of σ̂/scale.
    pub sigma_predicted: f64,
    /// Share of all trials whose 95 % interval holds the true value; failed trials count as misses.
    pub coverage: f64,
}

impl Tally {
    /// A tally without trials.
    pub fn new(parameters: usize) -> Self {
        Self {
            succeeded: 0,
            failures: Vec::new(),
            parameters: vec![ParameterSums::default(); parameters],
            covered: 0,
            covered_squared: 0,
            spread: 0,
            spread_squared: 0,
            measured: 0,
            distance: 0,
            distance_squared: 0,
            histogram: vec![0; BINS],
        }
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters.len()
    }

    /// Number of trials, including failed ones.
    pub fn trials(&self) -> u64 {
        self.succeeded + self.failures.len() as u64
    }

    /// Adds a trial's estimates.
    pub fn add(&mut self, Outcomes { parameters, distance }: &Outcomes) {
        self.succeeded += 1;
        let mut covered = 0;
        for (sums, outcome) in self.parameters.iter_mut().zip(parameters) {
            sums.z += to_units(outcome.z);
            sums.z_squared += to_units(outcome.z * outcome.z);
            sums.sigma_squared += to_units(outcome.sigma * outcome.sigma);
            sums.covered += u64::from(outcome.covered());
            covered += u64::from(outcome.covered());
            let bin = ((outcome.z / outcome.sigma + BIN_RANGE) / BIN_WIDTH).floor() + 1.0;
            self.histogram[bin.clamp(0.0, (BINS - 1) as f64) as usize] += 1;
        }
        self.covered += covered;
        self.covered_squared += covered * covered;
        let spread = parameters.iter().map(|o| o.z * o.z).sum::<f64>() / parameters.len() as f64;
        self.spread += to_units(spread);
        self.spread_squared += to_units(spread * spread);
        if let Some(distance) = distance {
            self.measured += 1;
            self.distance += to_units(*distance);
            self.distance_squared += to_units(distance * distance);
        }
    }

    /// Adds a trial that failed.
    pub fn add_failure(&mut self, failure: Failure) {
        let at = self.failures.partition_point(|known| known < &failure);
        self.failures.insert(at, failure);
    }

    /// Adds another tally over other trials of the same experiment.
    pub fn merge(&mut self, other: &Self) {
        self.succeeded += other.succeeded;
        other.failures.iter().for_each(|failure| self.add_failure(failure.clone()));
        for (sums, more) in self.parameters.iter_mut().zip(&other.parameters) {
            sums.z += more.z;
            sums.z_squared += more.z_squared;
            sums.sigma_squared += more.sigma_squared;
            sums.covered += more.covered;
        }
        self.covered += other.covered;
        self.covered_squared += other.covered_squared;
        self.spread += other.spread;
        self.spread_squared += other.spread_squared;
        self.measured += other.measured;
        self.distance += other.distance;
        self.distance_squared += other.distance_squared;
        self.histogram.iter_mut().zip(&other.histogram).for_each(|(a, b)| *a += b);
    }

    /// Statistics of parameter `k`.
    pub fn statistics(&self, k: usize) -> ParameterStatistics {
        let n = self.succeeded as f64;
        let sums = &self.parameters[k];
        let bias = from_units(sums.z) / n;
        let variance = (from_units(sums.z_squared) - n * bias * bias) / (n - 1.0);
        ParameterStatistics {
            bias,
            sigma_empirical: if self.succeeded < 2 { f64::NAN } else { variance.max(0.0).sqrt() },
            sigma_predicted: (from_units(sums.sigma_squared) / n).sqrt(),
            coverage: sums.covered as f64 / self.trials() as f64,
        }
    }

    /// Coverage averaged over the parameters, and the standard error of that average. The standard error comes from the
    /// scatter between trials, so that correlated parameters are not counted as independent evidence. A failed trial
    /// covers no parameter.
    pub fn mean_coverage(&self) -> (f64, f64) {
        let n = self.trials() as f64;
        let b = self.parameters.len() as f64;
        let mean = self.covered as f64 / n;
        let variance = (self.covered_squared as f64 - n * mean * mean) / (n - 1.0);
        (mean / b, (variance.max(0.0) / n).sqrt() / b)
    }

    /// Empirical over predicted σ pooled over the parameters, √(Σ s² / Σ σ̂²), and its standard error. The standard
    /// error again comes from the scatter between trials: that of the squared deviations from the truth, which scatter
    /// at least as much as those from the mean.
    pub fn pooled_ratio(&self) -> (f64, f64) {
        let (_, error) = mean(self.succeeded, self.spread, self.spread_squared);
        let of_all = |square: fn(ParameterStatistics) -> f64| -> f64 {
            (0..self.parameters()).map(|k| square(self.statistics(k))).sum()
        };
        let empirical = of_all(|s| s.sigma_empirical.powi(2));
        let ratio = (empirical / of_all(|s| s.sigma_predicted.powi(2))).sqrt();
        (ratio, 0.5 * ratio * error * self.parameters() as f64 / empirical)
    }

    /// Error of all parameters jointly over the predicted covariance, which is the root of the mean of
    /// [`Outcomes::distance`], and its standard error. The pooled ratio tests each σ; this ratio tests every linear
    /// combination of the parameters. `None` if fewer than two trials have a distance.
    pub fn joint_ratio(&self) -> Option<(f64, f64)> {
        let (mean, error) = mean(self.measured, self.distance, self.distance_squared);
        (self.measured > 1).then(|| (mean.sqrt(), 0.5 * error / mean.sqrt()))
    }

    /// Histogram of (θ̂ − θ)/σ̂ pooled over parameters and trials, as pairs `(bin centre, share of all)`. The first and
    /// the last bin collect all values beyond the range.
    pub fn histogram(&self) -> Vec<(f64, f64)> {
        let all: u64 = self.histogram.iter().sum();
        let centre = |bin: usize| (bin as f64 - 0.5) * BIN_WIDTH - BIN_RANGE;
        let share = |count: u64| count as f64 / all.max(1) as f64;
        self.histogram.iter().enumerate().map(|(bin, &c)| (centre(bin), share(c))).collect()
    }
}

/// Mean over `trials` trials and its standard error, from the sum of the values and the sum of their squares.
fn mean(trials: u64, sum: i128, squares: i128) -> (f64, f64) {
    let n = trials as f64;
    let mean = from_units(sum) / n;
    let variance = (from_units(squares) / n - mean * mean) * n / (n - 1.0);
    (mean, (variance.max(0.0) / n).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_other_parameters_do_not_fit() {
        assert!(Tally::new(3).fits(&Tally::new(3)) && !Tally::new(3).fits(&Tally::new(2)));
    }

    fn outcome(k: u64, parameter: u64) -> Outcome {
        let z = ((k * 7 + parameter * 13) as f64 * 0.37).sin() * 2.2;
        Outcome { z, sigma: 1.0 + 0.01 * (k % 5) as f64, quantile_95: 1.96 }
    }

    fn distance(k: u64) -> f64 {
        1.0 + (k as f64).sin()
    }

    fn tally(trials: impl Iterator<Item = u64>) -> Tally {
        let mut tally = Tally::new(3);
        for k in trials {
            if k % 10 == 9 {
                tally.add_failure(Failure { trial: k, reason: "did not converge".into() });
            } else {
                let parameters = vec![outcome(k, 0), outcome(k, 1), outcome(k, 2)];
                tally.add(&Outcomes { parameters, distance: Some(distance(k)) });
            }
        }
        tally
    }

    #[test]
    fn any_split_and_any_order_give_the_same_tally() {
        let whole = tally(0..100);
        let mut parts = tally(60..100);
        parts.merge(&tally(0..13));
        parts.merge(&tally((13..60).rev()));
        assert_eq!(whole, parts);
        assert_eq!(whole.trials(), 100);
        assert_eq!(whole.failures.len(), 10);
    }

    #[test]
    fn statistics_are_those_of_the_textbook() {
        let whole = tally(0..100);
        let z: Vec<f64> = (0..100).filter(|k| k % 10 != 9).map(|k| outcome(k, 1).z).collect();
        let n = z.len() as f64;
        let mean = z.iter().sum::<f64>() / n;
        let sd = (z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let statistics = whole.statistics(1);
        // Every term is rounded to 1e-12.
        assert!((statistics.bias - mean).abs() < 1e-11);
        assert!((statistics.sigma_empirical - sd).abs() < 1e-11);
        let covered = (0..100).filter(|k| k % 10 != 9).filter(|&k| outcome(k, 1).covered()).count();
        assert_eq!(statistics.coverage, covered as f64 / 100.0);
        let distances: Vec<f64> = (0..100).filter(|k| k % 10 != 9).map(distance).collect();
        let mean = distances.iter().sum::<f64>() / n;
        let sd = (distances.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let (joint, error) = whole.joint_ratio().unwrap();
        assert!((joint - mean.sqrt()).abs() < 1e-11);
        assert!((error - sd / n.sqrt() / (2.0 * mean.sqrt())).abs() < 1e-11);
        assert!(
            (whole.histogram().iter().map(|(_, share)| share).sum::<f64>() - 1.0).abs() < 1e-12
        );
    }

    /// 50 trials of ±2 and 50 of ±1 about a bias of 3: s² is 2.5 · 100/99, regardless of the bias.
    #[test]
    fn the_pooled_ratio_is_about_the_mean() {
        let mut tally = Tally::new(1);
        for k in 0..100 {
            let size = if k < 50 { 2.0 } else { 1.0 };
            let z = 3.0 + if k % 2 == 0 { size } else { -size };
            let parameters = vec![Outcome { z, sigma: 1.0, quantile_95: 1.96 }];
            tally.add(&Outcomes { parameters, distance: None });
        }
        let (ratio, _) = tally.pooled_ratio();
        assert!((ratio - (2.5_f64 * 100.0 / 99.0).sqrt()).abs() < 1e-11, "{ratio}");
    }

    #[test]
    fn a_tally_survives_json() {
        let whole = tally(0..50);
        let text = serde_json::to_string(&whole).unwrap();
        assert_eq!(serde_json::from_str::<Tally>(&text).unwrap(), whole);
    }
}
