//! Options that take more of a log away than the program would by itself.

use super::even::usual_rate_hz;
use super::measurement::Measurement;
use super::options::Options;
use super::prepared::Processing;
use crate::number::significant;

/// Share by which a rate has to be below the usual one to count as lowered: rates of one recorder differ by less.
const LOWER: f64 = 0.999;

/// A frequency that an option lowered below what it is without the option.
#[derive(Debug, Clone, PartialEq)]
pub struct Lowered {
    /// The option on the command line.
    option: &'static str,
    /// What it sets.
    what: &'static str,
    /// Value with the option, Hz.
    given_hz: f64,
    /// Value without it, Hz.
    usual_hz: f64,
}

impl Lowered {
    /// What `options` lowered for the log `m`, which was processed as `processing` says. Rates that fast logs are
    /// decimated to are not low.
    pub(super) fn of(options: &Options, m: &Measurement, processing: &Processing) -> Vec<Self> {
        let of_rate = |given_hz: f64| {
            let usual_hz = usual_rate_hz(m.time_s).ok()?;
            let is_low = given_hz < LOWER * usual_hz.min(0.5 * Options::HIGHEST_RATE_HZ);
            is_low.then_some(Self { option: "--rate", what: "rate", given_hz, usual_hz })
        };
        let of_cutoff = |given_hz: f64| {
            let usual_hz = Options::default().cutoff_hz;
            let what = "cut-off of the low-pass";
            (given_hz < usual_hz).then_some(Self { option: "--cutoff", what, given_hz, usual_hz })
        };
        let rate = options.rate_hz.and_then(of_rate);
        rate.into_iter().chain(processing.cutoff_hz.and_then(of_cutoff)).collect()
    }

    /// Whether both are of the same option.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        self.option == other.option
    }

    /// Says which options lowered what, as the beginning of a sentence; `None` if there are none.
    pub fn in_words(all: &[Self]) -> Option<String> {
        let one = |lowered: &Self| {
            let Self { option, what, given_hz, usual_hz } = lowered;
            let [from, to] = [usual_hz, given_hz].map(|hz| significant(*hz, 3));
            format!("{option} lowered the {what} from {from} Hz to {to} Hz")
        };
        let words: Vec<String> = all.iter().map(one).collect();
        (!words.is_empty()).then(|| words.join(" and "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::JointSignals;

    /// What the options lowered for a log of `rows_hz`, a single run behind a low-pass if `is_filtered`.
    fn lowered(rows_hz: f64, options: &Options, is_filtered: bool) -> Option<String> {
        let time_s: Vec<f64> = (0..100).map(|k| f64::from(k) / rows_hz).collect();
        let still = JointSignals::zeros(1, time_s.len());
        let m = Measurement {
            source: "a.csv",
            time_s: &time_s,
            q_rad: &still,
            qd_rad_s: &still,
            torque_nm: &still,
        };
        let processing = Processing {
            cutoff_hz: is_filtered.then_some(options.cutoff_hz),
            order: None,
            rate_hz: options.rate_hz.unwrap_or(rows_hz),
            window_s: [0.0, 1.0],
            torque_filtered: is_filtered,
            period_s: None,
            periods: 1,
            logs: 1,
            resampled: false,
            harmonics: None,
        };
        Lowered::in_words(&Lowered::of(options, &m, &processing))
    }

    #[test]
    fn only_what_is_below_the_usual_is_lowered() {
        let rate = |hz: f64| Options { rate_hz: Some(hz), ..Options::default() };
        assert_eq!(lowered(125.0, &Options::default(), true), None);
        assert_eq!(lowered(125.0, &rate(125.0), true), None);
        assert_eq!(lowered(125.0, &rate(250.0), false), None);
        // A log of 500 Hz is decimated to 250 Hz, others to as little as 150 Hz.
        assert_eq!(lowered(500.0, &rate(200.0), false), None);
        let told = lowered(500.0, &rate(100.0), false).unwrap();
        assert_eq!(told, "--rate lowered the rate from 250 Hz to 100 Hz");
        let both = Options { cutoff_hz: 0.5, ..rate(25.0) };
        let told = lowered(125.0, &both, true).unwrap();
        let of_rate = "--rate lowered the rate from 125 Hz to 25.0 Hz";
        assert_eq!(
            told,
            format!(
                "{of_rate} and --cutoff lowered the cut-off of the low-pass from 10.0 Hz to 0.500 Hz"
            )
        );
        assert_eq!(lowered(125.0, &both, false).unwrap(), of_rate);
    }
}
