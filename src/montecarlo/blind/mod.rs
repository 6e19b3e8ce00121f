//! The blind benchmark: thousands of times, an arm with a hidden effect (or none) makes one log, the log is
//! diagnosed, and the diagnosis is judged against the truth.
//!
//! Input: a [`BlindPlan`]. Each trial draws its own case from its own random numbers: no effect, one, two, one whose
//! family is taken out of the dictionary, or a change of the arm beside a law; also the site, shape and size of each
//! effect, the motion and the noise. The size is chosen to reach a √λ that is drawn
//! ([`EffectSize`](super::EffectSize)). The plant's physics produces the effect, and the diagnosis sees the log alone.
//! Output: one [`Record`] per trial, and [`Scores`].

mod benchmark;
mod case;
mod family;
mod judge;
mod plan;
mod recipe;
mod record;
mod score;
mod target;

pub use benchmark::{Benchmark, BlindContent, BlindError};
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
