//! Replay of a diagnosis: torque and motion of the logs beside a simulation without and with the causes.

use super::plot::{Axis, Colour, Grid, Mark};
use super::{Column, ReportError, Section, Table};
use crate::diagnose::replay::{Replay, ReplayedLog};
use crate::number::{percent, significant};

/// Errors of torque and angle for every log and joint.
pub fn table(replay: &Replay) -> Table {
    let mut table = Table::new([
        Column::text("replayed log"),
        Column::number("joint", ""),
        Column::number("torque off, before", "Nm"),
        Column::number("after", "Nm"),
        Column::number("torque noise of the mean", "Nm"),
        Column::number("tracking off, before", "mrad"),
        Column::number("after", "mrad"),
    ]);
    for log in std::iter::once(&replay.log).chain(&replay.held_out) {
        for j in 0..log.before.torque_rms_nm.len() {
            let milli = |tracking: &[f64]| significant(1e3 * tracking[j], 3);
            table.push([
                if j == 0 { log.log.clone() } else { String::new() },
                (j + 1).to_string(),
                significant(log.before.torque_rms_nm[j], 3),
                significant(log.after.torque_rms_nm[j], 3),
                log.noise_nm.as_ref().map_or("–".to_owned(), |n| significant(n[j], 2)),
                milli(&log.before.tracking_rms_rad),
                milli(&log.after.tracking_rms_rad),
            ]);
        }
    }
    table
}

/// The section for the page.
pub fn section(replay: &Replay) -> Result<Section, ReportError> {
    let mut section = Section::new("The loop closed").paragraph(
        "The identified arm and, with it, the causes as physics (not as the columns that were fitted) are put \
         into the simulation, which moves as the log did. What its drives then give is compared with what the \
         log says.",
    );
    for log in std::iter::once(&replay.log).chain(&replay.held_out) {
        let j = log.worst_joint();
        let noise = log.noise_nm.as_ref();
        let of_the_mean = noise.map_or(String::new(), |n| {
            format!(", torque noise of the mean {} Nm", significant(n[j], 2))
        });
        let [before, after] = [&log.before, &log.after].map(|d| significant(d.torque_rms_nm[j], 3));
        let share = log.removed_fraction.map_or(String::new(), |share| {
            format!(
                " Over all joints the causes remove {} of what the noise leaves to explain.",
                percent(share, 3)
            )
        });
        section = section.figure(
            figure(log, j)?,
            format!(
                "{}: torque of joint {} over {}, and what the simulation is off by: {before} Nm rms before, \
                 {after} Nm after{of_the_mean}.{share}",
                log.log,
                j + 1,
                if noise.is_some() { "the mean period" } else { "the run, low-passed" },
            ),
        );
    }
    section = section.table(table(replay), "Rms of log minus simulation").paragraph(
        "Torque is compared along the same motion, up to the cutoff of the processing: within some tens of \
         milliseconds of a reversal of friction the log and the simulation settle each in its own way. Tracking is logged minus simulated angle where the \
         simulation's own controller follows the logged motion without knowing the causes: its size depends on \
         that controller, which need not be the real one, and only its change from before to after says \
         something about the arm.",
    );
    if !replay.not_replayed.is_empty() {
        section = section.list(replay.not_replayed.iter().map(|not| {
            let place = not.joint.map_or(String::new(), |j| format!(", joint {j}"));
            format!("Not in the simulation as an effect: {}{place}: {}.", not.kind, not.reason)
        }));
    }
    Ok(section)
}

/// Torque of joint `j` (0-based) and its error.
fn figure(log: &ReplayedLog, j: usize) -> Result<String, ReportError> {
    let course = &log.course;
    let measured = course.measured_nm.joint(j);
    let mut grid = Grid::new("", Axis::linear("time", "s"), Axis::linear("torque", "Nm"));
    grid.columns = 1;
    let series = [
        ("simulation before", course.before_nm.joint(j), Colour::BEFORE),
        ("simulation after", course.after_nm.joint(j), Colour::AFTER),
    ];
    let mut torque = grid.panel(format!("Joint {}", j + 1));
    torque = torque.with("measured", &course.time_s, measured, Colour::MEASURED, Mark::ThinLine);
    let mut error = grid.panel(format!("Joint {}, measured minus simulation", j + 1));
    for (name, simulated, colour) in series {
        torque = torque.with(name, &course.time_s, simulated, colour, Mark::ThinLine);
        let off: Vec<f64> = measured.iter().zip(simulated).map(|(m, s)| m - s).collect();
        error = error.with(name, &course.time_s, &off, colour, Mark::ThinLine);
    }
    grid.panels = vec![torque, error];
    Ok(grid.to_svg()?)
}
