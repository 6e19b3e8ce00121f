//! Numbers of a log that contradict the units it states.

use thiserror::Error;

/// A stated unit that the numbers contradict.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UnitSuspicion {
    /// Positions and velocities are related by the factor between two units.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves {ratio:.4} times as far as the integral of \
         the velocity (from {q_from:.4} to {q_to:.4} rad as read): {quantity} looks like {unit}; \
         put {quantity} = \"{unit}\" under [units] in a layout file (--layout)"
    )]
    Ratio {
        /// The quantity that is in another unit: `time`, `q` or `qd`.
        quantity: &'static str,
        /// The unit it seems to be in.
        unit: &'static str,
        /// The joint on which it is seen, from 1.
        joint: usize,
        /// Change of position over integral of velocity.
        ratio: f64,
        /// First row of the stretch in which it is seen.
        first_row: usize,
        /// Last row of that stretch.
        last_row: usize,
        /// Position at the start of the stretch, as read.
        q_from: f64,
        /// Position at the end of the stretch, as read.
        q_to: f64,
    },
    /// The time steps are too long or too short for a recorder of motion.
    #[error(
        "the time steps by {step_s:.3e} s from row to row (first at row {row}, time {time_s}): {}put time = \"{unit}\" \
         under [units] in a layout file (--layout)",
        reading_of_clock(unit, *may_be_slow)
    )]
    Clock {
        /// The unit it seems to be in.
        unit: &'static str,
        /// Median step as read, s.
        step_s: f64,
        /// Whether the rows may really be that far apart.
        may_be_slow: bool,
        /// The first row.
        row: usize,
        /// Its time as read, s.
        time_s: f64,
    },
    /// The angles of a log without velocities move faster than any arm.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves at {speed_rad_s:.1} rad/s as read, and no arm moves faster \
         than {bound_rad_s:.0} rad/s: either the time is in a longer unit than the layout says (write minutes as seconds), or q is in \
         degrees; correct time, or put q = \"deg\", under [units] in a layout file (--layout)"
    )]
    TooFast {
        /// The joint on which it is seen, from 1.
        joint: usize,
        /// Its mean speed over the fastest stretch, as read, rad/s.
        speed_rad_s: f64,
        /// The speed that no arm exceeds, rad/s.
        bound_rad_s: f64,
        /// First row of that stretch.
        first_row: usize,
        /// Last row of that stretch.
        last_row: usize,
    },
    /// Positions and velocities agree with each other, and both are too large.
    #[error(
        "row {row}, joint {joint}: q = {q:.4} rad, and {joints} joints stay beyond one turn on average: q and qd look \
         like degrees; put q = \"deg\" and qd = \"deg/s\" under [units] in a layout file (--layout)"
    )]
    Degrees {
        /// The row.
        row: usize,
        /// The joint, from 1.
        joint: usize,
        /// Its position as read.
        q: f64,
        /// How many joints show it.
        joints: usize,
    },
    /// The angles change, but the velocities are zero.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves and the velocities are zero, as if they were not recorded; \
         leave qd out of [columns] in a layout file (--layout), and they are taken from the angles"
    )]
    NoVelocity {
        /// The joint on which it is seen, from 1.
        joint: usize,
        /// First row of the stretch in which it is seen.
        first_row: usize,
        /// Last row of that stretch.
        last_row: usize,
    },
    /// No unit explains how positions and velocities are related.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves {ratio:.4e} times as far as the integral of \
         the velocity, which no unit explains; check which columns are q, qd and time in the layout, and whether the velocities \
         are those of the motors, before the gears"
    )]
    Unrelated {
        /// The joint on which it is seen, from 1.
        joint: usize,
        /// Change of position over integral of velocity.
        ratio: f64,
        /// First row of the stretch in which it is seen.
        first_row: usize,
        /// Last row of that stretch.
        last_row: usize,
    },
}

/// What the steps of a clock say, up to the remedy for a clock in `unit`.
fn reading_of_clock(unit: &str, may_be_slow: bool) -> String {
    match may_be_slow {
        true => format!(
            "the rows are too far apart for a motion (record it again, 125 rows a second are enough), or the time is in {unit}; if it is, "
        ),
        false => format!("it looks like {unit}; "),
    }
}
