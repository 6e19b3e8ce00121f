//! Prepares a log for identification: zero-phase filters, derivatives, decimation, a uniform time grid, separation of
//! rest and motion, detection of periods, their averages and derivatives, and spectra.
//!
//! Input: time stamps and [`JointSignals`](crate::robot::JointSignals) of one log. Output: the same quantities,
//! smoothed, on a uniform grid or averaged over periods, and their noise levels.
//!
//! | question | answer |
//! |---|---|
//! | how to remove what is faster than the motion without delay? | [`ZeroPhase`], [`Decimator`] |
//! | how to compute accelerations as the paper does? | [`PaperDifferentiator`] |
//! | how to differentiate a smooth series? | [`central_4`] |
//! | how to treat jittered time stamps and missing samples? | [`Resampler`], [`fill_gaps`] |
//! | does another recording begin within a log? | [`Tears`] |
//! | when does the arm move? | [`Activity`] |
//! | does the motion repeat, and from where to where? | [`find_period`] |
//! | what is the best estimate of a repeated motion and its derivatives? | [`PeriodicFit`] |
//! | what happens between the samples of a repeated motion? | [`FineClock`] |
//! | how noisy is a signal, without any model of it? | [`replicate_noise`] |
//! | how does the power of noise depend on frequency? | [`noise_trend`]; for several channels [`noise_trends`] |
//! | is there a bump in coloured noise? | [`MatchedFilter`] |
//! | what are resolution, noise and limit of a sensor? | [`resolution`], [`reading_noise`], [`reading_limit`] |

mod activity;
mod averaged_motion;
mod biquad;
mod butterworth;
mod decimate;
mod differentiate;
mod empty_band;
mod error;
mod fine_clock;
mod gap_filling;
mod instants;
mod matched;
mod noise;
mod noise_trend;
mod other_periods;
mod paper_filter;
mod period;
mod period_search;
mod periodic_fit;
mod periodic_record;
mod periods;
mod readings;
#[cfg(test)]
pub(crate) mod repeated_motions;
mod replicates;
mod resample;
mod slip;
mod spectra;
mod tears;

pub use activity::{Activity, rms};
pub use averaged_motion::{AveragedMotion, HarmonicPower};
pub use butterworth::{HIGHEST_ORDER, Scratch, ZeroPhase};
pub use decimate::Decimator;
pub use differentiate::central_4;
pub use empty_band::empty_above_hz;
pub use error::SignalError;
pub use fine_clock::{FineClock, first_order_lag};
pub use gap_filling::{Filled, fill_gaps};
pub use instants::{Bracket, Instants, cubic_at, linear_at};
pub use matched::{Heights, MatchedFilter};
pub use noise_trend::{LogScatter, NoisePower, noise_trend, noise_trends, pooled, pooled_level};
pub use other_periods::other_periods;
pub use paper_filter::{PaperDifferentiator, PaperReading};
pub use period::{Period, variance_of};
pub use period_search::{PeriodSearch, find_period};
pub use periodic_fit::{FitScratch, PeriodicFit, SERIES_END};
pub use periodic_record::PeriodicRecord;
pub use periods::{mean_period, subtract_mean_period};
pub use readings::{reading_limit, reading_noise, resolution};
pub use replicates::{Replicates, replicate_noise};
pub use resample::{Gap, MOST_PER_ROW, Resampler, bridged_gap_s, gaps, natural_rate_hz};
pub use tears::Tears;
