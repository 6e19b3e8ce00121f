//! The steps in which the readings of a channel come, which may grow with their size.
//!
//! A file with four significant digits (`%.4g`) has angles of 0.9 rad in steps of 0.1 mrad, and angles of 1.1 rad in steps
//! of 1 mrad. The smallest distance between any two readings tells only the finest of these.

use crate::signal::resolution;

/// Readings are coarse if all but this share of their changes are larger than this share of the median. Of noise, a
/// twentieth of the changes are smaller than a tenth of it.
const SELDOM: f64 = 0.05;
const COARSE: f64 = 0.5;
/// Steps grow with the size of the readings if those of the largest twentieth of the readings are this many times the
/// finest ones: from one number of digits to the next they grow tenfold.
const LARGEST: f64 = 0.05;
const GROWS: f64 = 5.0;

/// The steps of one channel.
pub struct ReadingSteps {
    /// The step of all readings, or the finest one.
    least: f64,
    /// Where steps grow with size: sizes of the readings in ascending order, each with the smallest distance between the
    /// sizes from there on.
    by_size: Vec<[f64; 2]>,
}

impl ReadingSteps {
    /// The steps of the readings `y`. Steps of up to `negligible` are not told from each other: among so many readings
    /// without steps, some are closer than others.
    pub fn of(y: &[f64], negligible: f64) -> Self {
        let finest = resolution(y);
        let by_size = steps_by_size(y);
        let largest = by_size.get(((1.0 - LARGEST) * by_size.len() as f64) as usize);
        // Readings that are all equal, at the limit of a drive say, have no step.
        let is_coarser = |step: f64| step.is_finite() && step > (GROWS * finest).max(negligible);
        let grows = largest.is_some_and(|[_, step]| is_coarser(*step));
        Self {
            least: finest.max(coarse_step(y)),
            by_size: if grows { by_size } else { Vec::new() },
        }
    }

    /// The step at a `reading`.
    pub fn at(&self, reading: f64) -> f64 {
        let from = self.by_size.partition_point(|[size, _]| *size < reading.abs());
        match self.by_size.get(from) {
            Some([_, step]) if step.is_finite() => step.max(self.least),
            _ => self.least,
        }
    }

    /// The mean step at these `readings`. Where steps grow, those of more than `most` count as `most`: below a wild
    /// reading, which may be far from all others, they seem to be huge.
    pub fn mean_at(&self, readings: impl ExactSizeIterator<Item = f64>, most: f64) -> f64 {
        let count = readings.len() as f64;
        if self.by_size.is_empty() || count == 0.0 {
            return self.least;
        }
        readings.map(|reading| self.at(reading).min(most)).sum::<f64>() / count
    }
}

/// The step of readings that hardly ever change by less; zero where changes are spread. Of slopes of rounded angles,
/// printed with a few digits, no smallest difference shows it.
fn coarse_step(y: &[f64]) -> f64 {
    let mut changes: Vec<f64> =
        y.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|change| *change > 0.0).collect();
    changes.sort_by(f64::total_cmp);
    let at = |share: f64| changes.get((share * changes.len() as f64) as usize).copied();
    match (at(SELDOM), at(0.5)) {
        (Some(least), Some(typical)) if least > COARSE * typical => least,
        _ => 0.0,
    }
}

/// Sizes of the readings in ascending order, but the largest, each with the smallest distance between two sizes from
/// there on; infinite where all of these are equal.
fn steps_by_size(y: &[f64]) -> Vec<[f64; 2]> {
    let mut sizes: Vec<f64> = y.iter().map(|y| y.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    // Sizes that differ only by rounding count as equal.
    let rounding = 1e-12 * sizes.last().copied().unwrap_or(0.0);
    let mut least = f64::INFINITY;
    let from_largest = sizes.windows(2).rev().map(|pair| {
        let distance = pair[1] - pair[0];
        if distance > rounding {
            least = least.min(distance);
        }
        [pair[0], least]
    });
    let mut steps: Vec<[f64; 2]> = from_largest.collect();
    steps.reverse();
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave of 3 rad, rounded to `step(size)`.
    fn wave(step: impl Fn(f64) -> f64) -> Vec<f64> {
        let value = |k: usize| 3.0 * (0.2 + 0.0371 * k as f64).sin();
        let rounded = |v: f64| (v / step(v.abs())).round() * step(v.abs());
        (0..4000).map(|k| rounded(value(k))).collect()
    }

    #[test]
    fn steps_of_significant_digits_grow_with_size() {
        let digits = |size: f64| 10f64.powf(size.log10().floor() - 3.0);
        let steps = ReadingSteps::of(&wave(digits), 1e-6);
        for (reading, step) in [(0.5, 1e-4), (-0.5, 1e-4), (1.5, 1e-3), (-2.5, 1e-3)] {
            // Readings of a few rad are rounded in binary to 4e-16 rad.
            assert!((steps.at(reading) - step).abs() < 1e-14, "{reading}: {}", steps.at(reading));
        }
        let mean = steps.mean_at([0.5, 1.5].into_iter(), 1.0);
        assert!((mean - 5.5e-4).abs() < 1e-14, "{mean}");
    }

    /// Between the largest readings, of 3 rad, and a wild one is a step of 997 rad.
    #[test]
    fn a_wild_reading_makes_no_coarse_steps() {
        let mut wild = wave(|size| 10f64.powf(size.log10().floor() - 3.0));
        wild[7] = 1000.0;
        let steps = ReadingSteps::of(&wild, 1e-6);
        assert!(steps.at(2.9999) > 900.0, "{}", steps.at(2.9999));
        let mean = steps.mean_at([0.5, 2.9999].into_iter(), 0.01);
        assert!((mean - 0.5 * (1e-4 + 0.01)).abs() < 1e-14, "{mean}");
    }

    #[test]
    fn even_steps_do_not_grow() {
        let even = wave(|_| 1e-3);
        let steps = ReadingSteps::of(&even, 1e-6);
        let step = resolution(&even);
        assert_eq!([0.0, 0.01, 1.0, 2.9, 5.0].map(|reading| steps.at(reading)), [step; 5]);
        assert_eq!(steps.mean_at([0.5, 1.5].into_iter(), 1.0), step);
        // Readings without steps lie closer in some places than in others.
        let fine = ReadingSteps::of(&wave(|_| 1e-15), 1e-3);
        assert!(fine.by_size.is_empty());
        assert_eq!(ReadingSteps::of(&[], 0.0).at(1.0), 0.0);
        assert_eq!(ReadingSteps::of(&[2.0; 9], 0.0).at(2.0), 0.0);
    }
}
