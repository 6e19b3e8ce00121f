//! The blind benchmark: an arm with something hidden in it (or nothing), one log, one diagnosis, judged
//! against the truth. Thousands of times.
//!
//! Enters: a [`BlindPlan`]. Each trial draws its own case from its own random numbers: nothing, one
//! effect, two, or one whose family is taken out of the dictionary; where it sits, its shape and size,
//! the motion and the noise. The size is chosen for a √λ that is drawn ([`EffectSize`](super::EffectSize)),
//! the effect is made by the plant's physics, and the diagnosis sees the log alone. Leaves: one
//! [`Record`] per trial, and [`Scores`].

mod benchmark;
mod case;
mod family;
mod judge;
mod plan;
mod record;
mod score;
mod target;

pub use benchmark::{Benchmark, BlindContent, BlindError, BlindWorker};
pub use case::{Case, Hidden, Secret, place};
pub use family::{FAMILIES, Family, Judged};
pub use judge::{Outcome, is_at, is_right};
pub(super) use plan::BlindEntry;
pub use plan::{BlindPlan, Motion, Shares};
pub use record::{Answer, HeldOutGain, Interval, Left, Named, Record, Records};
pub use score::{
    ConfidenceBin, Confusion, FamilyScore, GainBin, SAID_NOTHING, SAID_UNEXPLAINED, SCORES_SCHEMA,
    Scores, StrengthBin, power,
};
pub use target::{NAMED_RIGHTLY, Target};
