//! One run's record: reading, checking and writing.
//!
//! Enters: a CSV file of a real arm or of the simulation, and a [`Layout`] that says what its columns
//! are. Leaves: a [`Log`] in SI units whose rows are finite, plausible, in the order of time and
//! consistent from one to the next, with a [`RowAccount`] of every row that did not make it.
//! Whatever the file holds, the answer is a [`Log`] or a [`LogError`] that names file, row and value.

mod account;
mod clean;
mod counting;
mod error;
mod even_stamps;
mod late_bursts;
mod layout;
mod lines;
mod plan;
mod read;
mod record;
mod slopes;
mod units;
mod write;

pub use account::{LogWarning, Reason, RowAccount, SetAside};
pub use counting::{Counting, Place};
pub use error::{LayoutFault, LogError, UnitSuspicion};
pub use layout::{Joints, Layout, built_in_layout_names};
pub use read::{read_log, read_log_from};
pub use record::{Effort, Log};
pub use write::write_log;
