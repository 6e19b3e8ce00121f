//! Errors of trajectories.

use thiserror::Error;

use crate::number::significant;

/// A trajectory that cannot be used, with the place and the value.
#[derive(Debug, Error)]
pub enum ExcitationError {
    /// The name is neither a built-in trajectory nor a file.
    #[error(
        "unknown trajectory \"{name}\": built in are {}; or give a .json file",
        super::fourier::built_in_names().collect::<Vec<_>>().join(", ")
    )]
    UnknownName {
        /// What was asked for.
        name: String,
    },
    /// The file could not be read or written.
    #[error("{file}: {source}")]
    File {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// Not JSON, or a key that trajectory files do not have.
    #[error("{file}: {message}")]
    Json {
        /// The file.
        file: String,
        /// The parser's message with line and column.
        message: String,
    },
    /// JSON of another kind or version.
    #[error("{file}: its schema is \"{found}\", expected \"{expected}\"", expected = super::TRAJECTORY_SCHEMA)]
    Schema {
        /// The file.
        file: String,
        /// The schema it states.
        found: String,
    },
    /// A value that a series cannot have.
    #[error("{what} = {} must be {must}", readable(*value))]
    Value {
        /// Which quantity.
        what: String,
        /// Its value.
        value: f64,
        /// What is allowed.
        must: &'static str,
    },
    /// Lists of coefficients with inconsistent lengths.
    #[error("{what}: {found} values, expected {expected}")]
    Length {
        /// Which list.
        what: String,
        /// How many there are.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// A trajectory for another number of joints than the arm has.
    #[error("the trajectory moves {trajectory} joints, the arm \"{arm}\" has {dof}")]
    WrongArm {
        /// Joints of the trajectory.
        trajectory: usize,
        /// Name of the arm.
        arm: String,
        /// Joints of the arm.
        dof: usize,
    },
    /// The periodic motion itself exceeds a limit.
    #[error(
        "the motion itself passes a limit: {limit} by {short} at t = {time_s:.3} s of its period (allowed are \
         {torque_percent:.0} % of the torque limits and a clearance of at least {clearance_m} m)"
    )]
    PeriodPasses {
        /// The limit that is exceeded, in words.
        limit: String,
        /// By how much, in words.
        short: String,
        /// When, s.
        time_s: f64,
        /// Clearance asked for, m.
        clearance_m: f64,
        /// Allowed fraction of the torque limits, %.
        torque_percent: f64,
    },
    /// None of the run-ins that were tried keeps the limits.
    #[error(
        "no run-in of {shortest_s} … {longest_s} s joins this motion inside the limits: the best keeps \
         {margin} of {limit} at t = {time_s:.3} s"
    )]
    NoRunIn {
        /// Shortest run-in tried, s.
        shortest_s: f64,
        /// Longest run-in tried, s.
        longest_s: f64,
        /// The limit that is exceeded, in words.
        limit: String,
        /// Margin of the best run-in, in words (negative).
        margin: String,
        /// When, s.
        time_s: f64,
    },
}

/// Refuses a `value` that is not positive and finite.
pub(super) fn positive(what: &str, value: f64) -> Result<(), ExcitationError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(ExcitationError::Value { what: what.to_owned(), value, must: "positive" })
}

/// Characters up to which a number is shown with all of its digits.
const LONGEST_NUMBER: usize = 12;

/// A number as it was given, so that it can be found again, or with six digits if it is long: 1e300 has 301.
pub(super) fn readable(value: f64) -> String {
    let whole = value.to_string();
    if whole.len() <= LONGEST_NUMBER { whole } else { significant(value, 6) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_shown_as_given_unless_it_is_long() {
        for (value, shown) in
            [(24.0, "24"), (-0.02, "-0.02"), (1e9, "1000000000"), (f64::NAN, "NaN")]
        {
            assert_eq!(readable(value), shown);
        }
        assert_eq!(readable(1e300), "1.00000e300");
        assert_eq!(readable(0.1 + 0.2), "0.300000");
        let refused = positive("period_s", -1e300).unwrap_err().to_string();
        assert_eq!(refused, "period_s = -1.00000e300 must be positive");
    }
}
