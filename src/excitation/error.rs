//! Errors of trajectories.

use thiserror::Error;

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
    #[error("{what} = {value} must be {must}")]
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
