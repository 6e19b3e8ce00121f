//! The `armid` program, with every task except the Monte Carlo study: `armid --help`.

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
    Base(cli::base::BaseArgs),
    Diagnose(cli::diagnose::DiagnoseArgs),
    Excite(cli::excite::ExciteArgs),
    Export(cli::export::ExportArgs),
    Identify(cli::identify::IdentifyArgs),
    Predict(cli::predict::PredictArgs),
    Simulate(cli::simulate::SimulateArgs),
    Study(cli::study::StudyArgs),
}

fn main() -> ExitCode {
    cli::exit_code(match Command::parse().task {
        Task::Base(args) => cli::base::run(&args),
        Task::Diagnose(args) => cli::diagnose::run(&args),
        Task::Excite(args) => cli::excite::run(&args),
        Task::Export(args) => cli::export::run(&args),
        Task::Identify(args) => cli::identify::run(&args),
        Task::Predict(args) => cli::predict::run(&args),
        Task::Simulate(args) => cli::simulate::run(&args),
        Task::Study(args) => cli::study::run(&args),
    })
}
