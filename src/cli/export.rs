//! `armid export`: an identified arm for simulators.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use super::arm_result::ArmResult;
use super::{CommandResult, Outcome};
use crate::output::{check_outputs, write_atomically};
use crate::robot::export::{drive_file, mjcf, urdf};

/// Write an identified arm as URDF or MJCF.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("output").args(["urdf", "mjcf"]).multiple(true).required(true))]
pub struct ExportArgs {
    /// Result of `armid identify --physical --json`.
    result: PathBuf,
    /// Robot that the result is about, where it is not a built-in one: a .urdf or .toml file.
    #[arg(long)]
    robot: Option<String>,
    /// Write a URDF, and beside it `NAME.drives.toml` with what a URDF has no place for.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Write an MJCF.
    #[arg(long, value_name = "FILE")]
    mjcf: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &ExportArgs) -> CommandResult {
    let drives = args.urdf.as_ref().map(|path| path.with_extension("drives.toml"));
    let robot = args.robot.as_ref().map(PathBuf::from);
    check_outputs(
        [&args.urdf, &drives, &args.mjcf].into_iter().flatten(),
        robot.iter().chain([&args.result]),
    )?;
    let ArmResult { arm, offsets_nm, by_prior, doubt, frames, .. } =
        ArmResult::load(&args.result, args.robot.as_deref())?;
    let write = |path: &Path, text: &str| -> Result<(), crate::output::OutputError> {
        write_atomically(path, |file| file.write_all(text.as_bytes()))?;
        say!("{}", path.display());
        Ok(())
    };
    if let Some(path) = &args.urdf {
        write(path, &urdf(&arm, &frames)?)?;
    }
    if let Some(path) = &drives {
        write(path, &drive_file(&arm, &offsets_nm))?;
    }
    if let Some(path) = &args.mjcf {
        write(path, &mjcf(&arm, &frames)?)?;
        if offsets_nm.iter().any(|offset| *offset != 0.0) {
            say!("note: torque offsets {offsets_nm:?} Nm have no place in an MJCF");
        }
    }
    if let Some(doubt) = doubt {
        say!("note: {doubt}");
    }
    if !by_prior.is_empty() {
        say!(
            "note: of {} standard parameters ({}) the log tells only combinations with others; how these are shared between them \
             follows from the robot file, which need not keep its values, and hardly changes the torques.",
            by_prior.len(),
            by_prior.join(", ")
        );
    }
    Ok(Outcome::Done)
}
