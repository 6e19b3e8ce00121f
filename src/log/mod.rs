//! The log of one run: reading, checking and writing.
//!
//! Input: a CSV file from a real arm or from a simulation, and a [`Layout`] that says which column holds which
//! quantity. Output: a [`Log`] in SI units whose rows are finite, plausible, in order of time and consistent with their
//! neighbours, with a [`RowAccount`] of every row that was rejected. Whatever the file holds, the result is a [`Log`]
//! or a [`LogError`] that names file, row and value.

mod account;
mod arrival_stamps;
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
mod row;
mod row_steps;
mod running;
mod slopes;
mod stamp_pieces;
mod table;
mod unit_suspicion;
mod units;
mod write;

pub use account::{LogWarning, Reason, RowAccount, SetAside};
pub use counting::{Counting, Place};
pub use error::LogError;
pub use layout::{Joints, Layout, LayoutFault, built_in_layout_names};
pub use read::{read_log, read_log_from};
pub use record::{Effort, Log};
pub use unit_suspicion::UnitSuspicion;
pub(crate) use write::write_columns;
pub use write::write_log;
