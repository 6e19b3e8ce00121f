//! `armid study`: general results, found by simulation or from public logs.

use clap::{Args, Subcommand};

use super::CommandResult;
use super::study_cutoff::{self, CutoffArgs};
use super::study_noise::{self, NoiseArgs};
use super::study_paper::{self, PaperArgs};
use super::study_physical::{self, PhysicalArgs};
use super::study_real_arm::{self, RealArmArgs};

/// Studies over many scenarios.
#[derive(Debug, Args)]
pub struct StudyArgs {
    #[command(subcommand)]
    topic: Topic,
}

#[derive(Debug, Subcommand)]
enum Topic {
    /// Which σ is true under which noise: every estimator and covariance on the same logs.
    Noise(NoiseArgs),
    /// The paper's section IV on the simulated arm, and where negative rotor inertias come from.
    Paper(PaperArgs),
    /// What physical consistency repairs, and what not: scatter, model error and σ.
    Physical(PhysicalArgs),
    /// Where the low-pass should sit: bias and scatter against its cutoff, by formula and measured.
    Cutoff(CutoffArgs),
    /// What a real UR10e's rigid model gets wrong, from its public logs.
    RealArm(RealArmArgs),
}

/// Runs the command.
pub fn run(args: &StudyArgs) -> CommandResult {
    match &args.topic {
        Topic::Noise(args) => study_noise::run(args),
        Topic::Paper(args) => study_paper::run(args),
        Topic::Physical(args) => study_physical::run(args),
        Topic::Cutoff(args) => study_cutoff::run(args),
        Topic::RealArm(args) => study_real_arm::run(args),
    }
}
