//! The Monte Carlo program: `cargo run --release --bin montecarlo`.

use std::process::ExitCode;

use armid::cli;
use clap::Parser;

fn main() -> ExitCode {
    cli::exit_code(cli::montecarlo::run(cli::montecarlo::Command::parse()))
}
