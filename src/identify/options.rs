//! How a log is processed: the `[processing]` table of a scenario.

use serde::{Deserialize, Serialize};

use super::covariance::CovarianceKind;
use super::fit::Estimator;
use crate::signal::{HIGHEST_ORDER, SERIES_END};

/// All settings of the processing that a user may choose; by default they follow from the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// How equations are weighted; `None`: chosen by the log's content.
    pub estimator: Option<Estimator>,
    /// How σ is computed; `None`: chosen by the log's content.
    pub covariance: Option<CovarianceKind>,
    /// Low-pass applied to torque and regressor columns of a motion that does not repeat, Hz.
    pub cutoff_hz: f64,
    /// Order of that low-pass (each of its two passes).
    pub order: usize,
    /// Rate that logs are resampled to, Hz; `None`: the log's own, at most [`Self::HIGHEST_RATE_HZ`].
    pub rate_hz: Option<f64>,
    /// How the motion repeats.
    #[serde(rename = "period_s")]
    pub repetition: Repetition,
}

/// How the motion of a log repeats. In scenarios it is the period in s: left out where it is found, and 0 for a single
/// run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Option<f64>", into = "Option<f64>")]
pub enum Repetition {
    /// With the period that the log shows, if it shows one.
    #[default]
    Found,
    /// With this period, s.
    Every(f64),
    /// Not at all: the log counts as a single run.
    Never,
}

impl From<Option<f64>> for Repetition {
    fn from(period_s: Option<f64>) -> Self {
        match period_s {
            None => Self::Found,
            Some(0.0) => Self::Never,
            Some(period_s) => Self::Every(period_s),
        }
    }
}

impl From<Repetition> for Option<f64> {
    fn from(repetition: Repetition) -> Self {
        match repetition {
            Repetition::Found => None,
            Repetition::Never => Some(0.0),
            Repetition::Every(period_s) => Some(period_s),
        }
    }
}

impl Repetition {
    /// The period that the user gave, s.
    pub fn period_s(self) -> Option<f64> {
        match self {
            Self::Every(period_s) => Some(period_s),
            Self::Found | Self::Never => None,
        }
    }
}

/// A setting that no log can be processed with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Improper {
    /// Its name in [`Options`].
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// What it must be.
    pub requirement: &'static str,
}

impl Options {
    /// The first setting that no log can be processed with.
    pub fn improper(&self) -> Option<Improper> {
        let settings = [
            ("cutoff_hz", Some(self.cutoff_hz)),
            ("rate_hz", self.rate_hz),
            ("period_s", self.repetition.period_s()),
        ];
        let not_positive = settings.into_iter().find_map(|(key, value)| {
            let value = value.filter(|v| !(v.is_finite() && *v > 0.0))?;
            Some(Improper { key, value, requirement: "must be a positive number" })
        });
        let is_order = (1..=HIGHEST_ORDER).contains(&self.order);
        let order = Improper {
            key: "order",
            value: self.order as f64,
            requirement: "must be a whole number from 1 to 20",
        };
        not_positive.or((!is_order).then_some(order))
    }

    /// Faster logs are decimated to at most this rate. The motion itself would need less, but dry friction does not
    /// allow it: behind the decimator's low-pass the velocity passes through zero more slowly than the drive does,
    /// and the friction computed from it is not that in the torque. In logs decimated to 125 Hz this appears as
    /// presliding, delays and a bias of 1.4 σ; at 250 Hz it does not. At 250 Hz, the jumps of a drive that feeds
    /// friction forward, which fall between two rows at any rate, do not show yet.
    pub const HIGHEST_RATE_HZ: f64 = 300.0;

    /// Cut-off of the velocity from which the friction of a single run is computed, as a share of the sampling rate.
    /// The Fourier series of a repeating motion ends there as well.
    pub const VELOCITY_END: f64 = SERIES_END;

    /// Whether the log counts as a single run even where its motion repeats.
    pub fn is_single_run(&self) -> bool {
        self.repetition == Repetition::Never
    }

    /// Cutoff (Hz) of the low-pass on the velocity of a single run before it is differentiated: wide
    /// enough above [`Self::cutoff_hz`] to leave the acceleration to the low-pass on the equations.
    pub fn derivative_cutoff_hz(&self, rate_hz: f64) -> f64 {
        (DERIVATIVE_CUTOFF * self.cutoff_hz).min(0.4 * rate_hz)
    }
}

/// Velocity is low-passed at this multiple of the regression's cutoff before it is differentiated.
const DERIVATIVE_CUTOFF: f64 = 2.5;

impl Default for Options {
    fn default() -> Self {
        Self {
            estimator: None,
            covariance: None,
            cutoff_hz: 10.0,
            order: 4,
            rate_hz: None,
            repetition: Repetition::Found,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In scenarios and results, `period_s` is left out, a period, or 0.
    #[test]
    fn a_repetition_is_a_period_in_files() {
        for (repetition, line) in [
            (Repetition::Found, None),
            (Repetition::Every(12.5), Some("period_s = 12.5")),
            (Repetition::Never, Some("period_s = 0.0")),
        ] {
            let options = Options { repetition, ..Options::default() };
            let text = toml::to_string(&options).unwrap();
            assert_eq!(text.lines().find(|line| line.starts_with("period_s")), line);
            assert_eq!(toml::from_str::<Options>(&text).unwrap(), options);
        }
    }

    #[test]
    fn settings_that_no_log_can_be_processed_with_are_named() {
        let default = Options::default();
        assert_eq!(default.improper(), None);
        assert_eq!(Options { repetition: Repetition::Never, ..default.clone() }.improper(), None);
        let key = |options: Options| options.improper().map(|improper| improper.key);
        assert_eq!(key(Options { cutoff_hz: f64::NAN, ..default.clone() }), Some("cutoff_hz"));
        assert_eq!(key(Options { rate_hz: Some(0.0), ..default.clone() }), Some("rate_hz"));
        let repetition = Repetition::from(Some(-3.0));
        assert_eq!(key(Options { repetition, ..default.clone() }), Some("period_s"));
        assert_eq!(key(Options { order: 0, ..default.clone() }), Some("order"));
        assert_eq!(key(Options { order: 21, ..default }), Some("order"));
    }
}
