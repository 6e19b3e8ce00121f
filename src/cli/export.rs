//! `armid export`: writes an identified arm for simulators.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use super::arm_result::ArmResult;
use super::{CommandResult, Outcome};
use crate::output::{check_outputs, write_text};
use crate::robot::export::{OwnUrdf, drive_file, drive_file_of_urdf, mjcf_of_urdf, own_urdf, urdf};
use crate::robot::{LoadedArm, RobotError, text_of};

/// Write an identified arm as URDF or MJCF.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("output").args(["urdf", "mjcf"]).multiple(true).required(true))]
pub struct ExportArgs {
    /// Result of `armid identify --physical --json`.
    result: PathBuf,
    /// Robot of the result (a .urdf, .xml (MJCF) or .toml file), if its file has moved since.
    #[arg(long)]
    robot: Option<String>,
    /// Write a URDF, and beside it `NAME.drives.toml` with what a URDF has no place for. If the robot came as a .urdf
    /// file, the result is that file with its inertias and friction replaced.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Write an MJCF.
    #[arg(long, value_name = "FILE")]
    mjcf: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &ExportArgs) -> CommandResult {
    let drives = args.urdf.as_ref().map(|path| path.with_extension("drives.toml"));
    let result = ArmResult::load(&args.result, args.robot.as_deref(), None)?;
    check_outputs(
        [&args.urdf, &drives, &args.mjcf].into_iter().flatten(),
        result.files.iter().chain([&args.result]),
    )?;
    if let Some(path) = &args.urdf {
        write_urdf(path, &result)?;
    }
    if let Some(path) = &drives {
        write_text(path, &drives_of(&result)?)?;
        say!("{}", path.display());
    }
    let ArmResult { arm, offsets_nm, by_prior, doubt, frames, urdf_links, .. } = result;
    if let Some(path) = &args.mjcf {
        write_text(path, &mjcf_of_urdf(&arm, &frames, &urdf_links)?)?;
        say!("{}", path.display());
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

/// Writes a URDF: for a robot that came as a URDF a copy of that file with new numbers, for any other robot a URDF with
/// bodies only.
fn write_urdf(path: &Path, result: &ArmResult) -> Result<(), Box<dyn std::error::Error>> {
    let ArmResult { arm, frames, files, urdf_links, .. } = result;
    let Some(own) = files.first().filter(|_| !urdf_links.is_empty()) else {
        write_text(path, &urdf(arm, frames)?)?;
        say!("{}", path.display());
        return Ok(());
    };
    let name = own.display().to_string();
    let text = text_of(own)?;
    let OwnUrdf { text, takeovers, relative_mesh } = own_urdf(&text, &name, arm, urdf_links)?;
    write_text(path, &text)?;
    let end = if arm.dof() == 1 { "" } else { "s" };
    say!(
        "{}: {name} with the inertia of {dof} link{end} and the friction of {dof} joint{end}; everything else as it was",
        path.display(),
        dof = arm.dof()
    );
    for takeover in takeovers {
        say!("note: {takeover}");
    }
    if let Some(mesh) = relative_mesh.filter(|_| folder(path) != folder(own)) {
        say!(
            "note: meshes such as {mesh} are looked for from the folder of the file: write it beside {name}, or copy them along"
        );
    }
    Ok(())
}

/// The drive file. For a robot that came as a URDF it contains no shapes, since they are in the URDF, and it keeps the
/// entries of the robot's own drive file for joints outside the arm.
fn drives_of(result: &ArmResult) -> Result<String, RobotError> {
    let ArmResult { arm, offsets_nm, files, urdf_links, .. } = result;
    if urdf_links.is_empty() {
        return Ok(drive_file(arm, offsets_nm));
    }
    match LoadedArm::drive_file(files) {
        Some(own) => {
            let source = own.display().to_string();
            drive_file_of_urdf(arm, offsets_nm, &text_of(own)?, &source)
        }
        None => drive_file_of_urdf(arm, offsets_nm, "", ""),
    }
}

/// The real folder of a file, with symbolic links resolved.
fn folder(file: &Path) -> Option<PathBuf> {
    Some(std::fs::canonicalize(file).ok()?.parent()?.to_owned())
}
