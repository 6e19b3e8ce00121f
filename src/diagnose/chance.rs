//! The chance that a log without faults is given something, and how it is shared out between what is looked for.

/// Chance that a log without faults is given a law, a change against a simulation, a contact or something unexplained, along a
/// motion that repeats. Faults of the record are looked for far beyond what noise does, and a body on the flange between two
/// logs is a test of its own.
///
/// Two in a thousand, for a promise of three: tails of estimated noise are where its estimates are least to be trusted, and
/// whole benchmarks with three by design showed 3.8 and 4.8 of a thousand.
pub const FALSE_ALARM: f64 = 0.002;

/// A law of the dictionary; most, because most of what is wrong with an arm is one.
pub const LAW: f64 = 0.7 * FALSE_ALARM;
/// Something that differs from a given simulation; little, because changes are seen well beside one: a third of the chance asks
/// for a quarter of a σ more.
pub(super) const CHANGE: f64 = 0.05 * FALSE_ALARM;
/// A contact.
pub(super) const CONTACT: f64 = 0.15 * FALSE_ALARM;
/// A contact where the arm moved as noise does not let it, which is asked only whether a torque goes with it. It takes nothing of
/// [`FALSE_ALARM`]: noise makes no such place.
pub(super) const CONTACT_WHERE_MOVED: f64 = 0.02;
/// Something left unexplained, by the size of what is left; and as much again by the curve that it makes.
pub(super) const UNEXPLAINED: f64 = 0.05 * FALSE_ALARM;

/// A body on the flange between two logs: a test of its own, as rare as one that is asked for has to be.
pub(super) const PAYLOAD: f64 = 0.9 * FALSE_ALARM;

const ALL: f64 = LAW + CHANGE + CONTACT + 2.0 * UNEXPLAINED;
const _: () = assert!(0.999_999 * FALSE_ALARM < ALL && ALL < 1.000_001 * FALSE_ALARM);
