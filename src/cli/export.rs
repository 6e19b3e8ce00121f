//! `armid export`: writes an identified arm for simulators.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use super::arm_result::ArmResult;
use super::{CommandResult, Outcome};
use crate::output::{check_outputs, write_text};
use crate::robot::export::{
    OwnUrdf, drive_file, drive_file_of_mjcf, drive_file_of_urdf, mjcf_with_links, own_urdf,
    urdf_with_links,
};
use crate::robot::{LoadedArm, RobotError, is_urdf, text_of};

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
    /// Write an MJCF, and beside it `NAME.drives.toml` with what an MJCF has no place for (one for both if the URDF has
    /// the same name).
    #[arg(long, value_name = "FILE")]
    mjcf: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &ExportArgs) -> CommandResult {
    let beside = |model: &PathBuf| model.with_extension("drives.toml");
    let of_mjcf = args.mjcf.as_ref().map(beside);
    // The drive file of the MJCF says what a URDF of the same name needs as well.
    let of_urdf = args.urdf.as_ref().map(beside).filter(|path| Some(path) != of_mjcf.as_ref());
    let result = ArmResult::load(&args.result, args.robot.as_deref(), None)?;
    check_outputs(
        [&args.urdf, &of_urdf, &args.mjcf, &of_mjcf].into_iter().flatten(),
        result.files.iter().chain([&args.result]),
    )?;
    let own = own_urdf_text(&result)?;
    if let Some(path) = &args.urdf {
        write_urdf(path, &result, own.as_ref())?;
    }
    if let Some(path) = &of_urdf {
        write_text(path, &drives_of_urdf(&result, own.is_some())?)?;
        say!("{}", path.display());
    }
    let ArmResult { arm, offsets_nm, by_prior, doubt, frames, files, urdf_links, .. } = &result;
    if let Some(path) = &args.mjcf {
        write_text(path, &mjcf_with_links(arm, frames, urdf_links)?)?;
        say!("{}", path.display());
    }
    if let Some(path) = &of_mjcf {
        let (text, source) = own_drives(files)?;
        write_text(path, &drive_file_of_mjcf(arm, offsets_nm, &text, &source)?)?;
        say!("{}", path.display());
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

/// The file that the robot came from, and its text, if it is a URDF.
fn own_urdf_text(result: &ArmResult) -> Result<Option<(&Path, String)>, RobotError> {
    // Robots without links came from files of other kinds.
    let Some(own) = result.files.first().filter(|_| !result.urdf_links.is_empty()) else {
        return Ok(None);
    };
    let text = text_of(own)?;
    Ok(is_urdf(own, &text).then_some((own.as_path(), text)))
}

/// Writes a URDF: for a robot that came as a URDF a copy of that file (`own`) with new numbers, for any other robot a
/// URDF with bodies only.
fn write_urdf(
    path: &Path,
    result: &ArmResult,
    own: Option<&(&Path, String)>,
) -> Result<(), Box<dyn std::error::Error>> {
    let ArmResult { arm, frames, urdf_links, .. } = result;
    let Some((own, text)) = own else {
        write_text(path, &urdf_with_links(arm, frames, urdf_links)?)?;
        say!("{}", path.display());
        return Ok(());
    };
    let name = own.display().to_string();
    let OwnUrdf { text, rescalings, relative_mesh } = own_urdf(text, &name, arm, urdf_links)?;
    write_text(path, &text)?;
    let end = if arm.dof() == 1 { "" } else { "s" };
    say!(
        "{}: {name} with the inertia of {dof} link{end} and the friction of {dof} joint{end}; everything else as it was",
        path.display(),
        dof = arm.dof()
    );
    for rescaling in rescalings {
        say!("note: {rescaling}");
    }
    if let Some(mesh) = relative_mesh.filter(|_| folder(path) != folder(own)) {
        say!(
            "note: meshes such as {mesh} are looked for from the folder of the file: write it beside {name}, or copy them along"
        );
    }
    Ok(())
}

/// The drive file beside a URDF. For a robot that came as a URDF it contains no shapes, since they are in the URDF, and
/// it keeps the entries of the robot's own drive file for joints outside the arm.
fn drives_of_urdf(result: &ArmResult, came_as_urdf: bool) -> Result<String, RobotError> {
    let ArmResult { arm, offsets_nm, files, .. } = result;
    if !came_as_urdf {
        return Ok(drive_file(arm, offsets_nm));
    }
    let (text, source) = own_drives(files)?;
    drive_file_of_urdf(arm, offsets_nm, &text, &source)
}

/// Text and name of the drive file among the robot's `files`; empty if there is none.
fn own_drives(files: &[PathBuf]) -> Result<(String, String), RobotError> {
    match LoadedArm::drive_file(files) {
        Some(own) => Ok((text_of(own)?, own.display().to_string())),
        None => Ok((String::new(), String::new())),
    }
}

/// The real folder of a file, with symbolic links resolved.
fn folder(file: &Path) -> Option<PathBuf> {
    Some(std::fs::canonicalize(file).ok()?.parent()?.to_owned())
}
