//! The command line: one file per subcommand, shared by the two binaries.
//!
//! Input: arguments. Output: files, text on the terminal and an exit code.

/// Prints a line and ignores write errors: if the reader of the output has gone (`| head`), files are written all the
/// same.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

mod arm_result;
pub mod base;
mod count;
pub mod diagnose;
mod earlier;
pub mod excite;
pub mod export;
pub mod identify;
mod loaded_log;
pub mod montecarlo;
mod outputs;
pub mod predict;
mod prior;
mod robot;
pub mod simulate;
mod simulated;
pub mod study;
mod study_cutoff;
mod study_noise;
mod study_paper;
mod study_physical;
mod study_real_arm;

use std::io::IsTerminal;
use std::process::ExitCode;

use indicatif::{ProgressBar, ProgressStyle};

use crate::diagnose::DiagnoseError;
use crate::excitation::Reference;
use crate::montecarlo::Scenario;

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The command did what was asked: exit code 0.
    Done,
    /// The command ran and wrote its outputs, but the answer is negative, such as data that do not identify the model:
    /// exit code 3.
    Negative,
    /// Ctrl-C ended the command early; outputs cover the finished part: exit code 130, the shell's code for that
    /// signal.
    Interrupted,
}

/// The outcome of a command, or an error worded for the user.
pub type CommandResult = Result<Outcome, Box<dyn std::error::Error>>;

/// Prints an error as one message and turns the result into the exit code.
pub fn exit_code(result: CommandResult) -> ExitCode {
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Negative) => ExitCode::from(3),
        Ok(Outcome::Interrupted) => ExitCode::from(130),
        Err(error) => {
            eprintln!("error: {error}");
            let declined = error.downcast_ref().is_some_and(DiagnoseError::is_declined);
            if declined { ExitCode::from(3) } else { ExitCode::FAILURE }
        }
    }
}

/// Message before a simulation, which can take a while.
fn simulating(scenario: &Scenario) -> String {
    let duration_s = scenario.excitation.duration_s();
    format!("simulating a log of {duration_s:.0} s of {} in rapier …", scenario.arm.name)
}

/// Largest number of threads per core: more would finish nothing sooner, and each takes memory of its own.
const THREADS_PER_CORE: usize = 4;

/// Number of threads asked for, as far as the cores can use them, or one per core.
fn threads_or_all(asked: Option<u16>) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    asked.map_or(cores, |threads| usize::from(threads).min(THREADS_PER_CORE * cores))
}

/// Progress of long work: a bar on a terminal, otherwise an occasional plain line.
pub struct Progress {
    bar: ProgressBar,
    what: &'static str,
    total: u64,
    printed: std::sync::Mutex<std::time::Instant>,
}

/// Time between plain lines.
const PLAIN_LINE_EVERY: std::time::Duration = std::time::Duration::from_secs(10);

impl Progress {
    /// Progress of `total` steps of `what`, such as "trials".
    pub fn new(what: &'static str, total: u64) -> Self {
        let bar = if std::io::stderr().is_terminal() {
            let style = "{bar:40} {pos}/{len} {msg}, {per_sec}, {eta} left";
            let style = ProgressStyle::with_template(style).unwrap_or(ProgressStyle::default_bar());
            ProgressBar::new(total).with_style(style).with_message(what)
        } else {
            ProgressBar::hidden()
        };
        Self { bar, what, total, printed: std::sync::Mutex::new(std::time::Instant::now()) }
    }

    /// Shows that `done` steps are finished.
    pub fn reached(&self, done: u64) {
        self.bar.set_position(done);
        if !self.bar.is_hidden() {
            return;
        }
        let mut printed = self.printed.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if printed.elapsed() > PLAIN_LINE_EVERY {
            *printed = std::time::Instant::now();
            eprintln!("{done}/{} {}", self.total, self.what);
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// A flag that Ctrl-C sets, so that work can stop between two steps and keep its results.
pub fn interrupt_flag() -> &'static std::sync::atomic::AtomicBool {
    static FLAG: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false);
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        // If the handler cannot be installed, Ctrl-C just ends the program, which is acceptable.
        let _ = ctrlc::set_handler(|| {
            if FLAG.swap(true, std::sync::atomic::Ordering::Relaxed) {
                std::process::exit(130);
            }
            eprintln!("ends when what is under way is done; once more ends it at once");
        });
    });
    &FLAG
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_threads_are_started_than_the_cores_can_use() {
        let cores = threads_or_all(None);
        assert_eq!(threads_or_all(Some(1)), 1);
        assert_eq!(threads_or_all(Some(u16::MAX)), THREADS_PER_CORE * cores);
    }
}
