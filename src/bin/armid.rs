//! Everything but the Monte Carlo: `armid --help`.

use std::process::ExitCode;

use armid::cli;
use clap::{Parser, Subcommand};

/// Dynamic parameters of a robot arm: design the motion, identify, diagnose.
#[derive(Debug, Parser)]
#[command(name = "armid", version)]
struct Command {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    Excite(cli::excite::ExciteArgs),
}

fn main() -> ExitCode {
    cli::exit_code(match Command::parse().task {
        Task::Excite(args) => cli::excite::run(&args),
    })
}
