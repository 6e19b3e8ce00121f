//! Reads a file into a log.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::account::RowAccount;
use super::error::LogError;
use super::layout::Layout;
use super::lines::{Line, Lines};
use super::plan::{Delimiter, Plan};
use super::record::Log;
use super::row::abridged;
use super::table::Table;

/// Number of rows of a file without header that are inspected to find its width, so that one truncated row does not
/// decide.
const WIDTH_ROWS: usize = 50;

/// Reads a log of an arm with `joints` joints.
///
/// If the layout has no velocities, they are computed from the angles once the times are in order, as slopes of
/// polynomials through five rows without a jump between them. Step 4 is then replaced: before differentiation, rows
/// with an angle far from the median of five rows are set aside.
///
/// Only the columns named by the layout are kept, row by row; memory use is 8 bytes per number kept. Numbers are
/// converted to SI units. Then, in this order:
///
/// 1. Rows are set aside if their number of fields differs from that of the file, or if time, angles, velocities or
///    effort contain an empty field, text, NaN, an infinity, or a magnitude beyond these bounds: angle and velocity
///    3.6·10⁵, acceleration 3·10⁴ rad/s², current 500 A, torque 5·10⁴ Nm, temperature 1000 °C, time 10¹⁹ s.
/// 2. Time stamps rounded more coarsely than half the sampling interval are replaced by the straight line through them,
///    if the motion shows that the rows were sampled evenly, and so are stamps that scatter; beside these, the motion
///    shows where rows were lost and where the clock was set. Among stamps that do not scatter otherwise, rows that were
///    held back and written in one burst are spread evenly between the row before and the row after, unless the motion
///    shows that they were really sampled that late. Then times must increase: repeated and backward times are set
///    aside, and so are up to 8 consecutive rows whose time is far ahead.
/// 3. Units are checked: Δq is compared with ∫q̇ dt, and the clock with the steps a recorder can have. Numbers that
///    indicate degrees, milli-, micro- or nanoseconds are an error that names the change to make in the layout. So are,
///    in a log without velocities, angles that move faster than 30 rad/s.
/// 4. Rows with angles beyond 1000 rad or velocities beyond 100 rad/s are set aside, and so are rows whose angles and
///    velocities do not follow from those of their neighbours: stretches of fewer than 10 rows, or interleaved with a
///    longer one, that no acceleration below 20 rad/s² connects to the other rows.
/// 5. Angles that jump by one turn are unwrapped, and the target angles with them.
/// 6. A block of targets or temperatures is left out of the log if the header lacks some of its columns, or if it has a
///    field as in step 1 in any of the remaining rows. Nothing is identified from these blocks, so they cost no rows.
/// 7. Joints that the recorder counts differently, according to the layout, are renumbered and re-signed to match the
///    robot's description.
///
/// # Errors
/// Any [`LogError`] about files, layouts, units and joints; [`LogError::NoUsableRows`] if fewer than two rows remain,
/// or if most rows hold values that the quantities cannot have.
pub fn read_log(path: &Path, layout: &Layout, joints: usize) -> Result<Log, LogError> {
    let file = path.display().to_string();
    if path.is_dir() {
        return Err(LogError::IsFolder { file });
    }
    match File::open(path) {
        Ok(source) => read_log_from(source, &file, layout, joints),
        Err(source) => Err(LogError::Read { file, source }),
    }
}

/// As [`read_log`], from any source of bytes; messages refer to the source as `name`.
///
/// # Errors
/// As [`read_log`].
pub fn read_log_from(
    source: impl Read,
    name: &str,
    layout: &Layout,
    joints: usize,
) -> Result<Log, LogError> {
    layout.check_for(joints)?;
    let mut lines = Lines::new(source, name)?;
    let mut first = Line::default();
    if !lines.next_into(&mut first)? {
        return Err(LogError::Empty { file: name.to_owned(), lines: lines.row() });
    }
    let delimiter = Delimiter::choose(layout, &first.bytes);
    let (plan, ahead) = if layout.header {
        (Plan::from_header(layout, joints, delimiter, &first, name)?, Vec::new())
    } else {
        plan_by_width(&mut lines, first.clone(), layout, joints, delimiter, name)?
    };
    layout.check_gains_for(joints)?;
    let mut table = Table::new(&plan);
    let mut account = RowAccount { warnings: plan.warnings.clone(), ..RowAccount::default() };
    for line in &ahead {
        table.push(&plan, line, &mut account, name)?;
    }
    let mut line = Line::default();
    while lines.next_into(&mut line)? {
        table.push(&plan, &line, &mut account, name)?;
    }
    if account.read == 0 {
        return Err(LogError::HeaderOnly { file: name.to_owned(), row: first.row });
    }
    let warnings = table.clean(&plan, layout, &mut account, name)?;
    account.warnings.extend(warnings);
    Ok(table.into_log(&plan, layout, account, name, lines.sha256()))
}

/// Builds the plan of a file without header from the most common width among its first rows.
///
/// Returns the plan and the rows already consumed.
fn plan_by_width(
    lines: &mut Lines<impl Read>,
    first: Line,
    layout: &Layout,
    joints: usize,
    delimiter: Delimiter,
    file: &str,
) -> Result<(Plan, Vec<Line>), LogError> {
    let leading = delimiter.split(&first.bytes).next().unwrap_or_default();
    let leading = String::from_utf8_lossy(leading);
    let begins_like_a_name = leading.starts_with(|c: char| c.is_alphabetic() || c == '_');
    if begins_like_a_name && leading.parse::<f64>().is_err() {
        return Err(LogError::UnexpectedHeader {
            file: file.to_owned(),
            row: first.row,
            value: abridged(&leading),
            layout: layout.name.clone(),
        });
    }
    let (first_row, first_width) = (first.row, delimiter.split(&first.bytes).count());
    let mut ahead = vec![first];
    let mut line = Line::default();
    while ahead.len() < WIDTH_ROWS && lines.next_into(&mut line)? {
        ahead.push(line.clone());
    }
    let rows_of =
        |fields: usize| ahead.iter().filter(|line| has_fields(delimiter, line, fields)).count();
    let common = layout.widths.iter().map(|w| w.fields).max_by_key(|&fields| rows_of(fields));
    let plan = match common.filter(|&fields| rows_of(fields) > 0) {
        Some(fields) => Plan::from_width(layout, joints, delimiter, fields, file)?,
        None => None,
    };
    match plan {
        Some(plan) => Ok((plan, ahead)),
        None => Err(LogError::Width {
            file: file.to_owned(),
            row: first_row,
            found: first_width,
            expected: layout.widths.iter().map(|w| w.fields).collect(),
            layout: layout.name.clone(),
        }),
    }
}

/// Whether a row has exactly this many fields, not counting the empty field after a trailing delimiter.
fn has_fields(delimiter: Delimiter, line: &Line, fields: usize) -> bool {
    let mut behind = delimiter.split(&line.bytes).skip(fields.saturating_sub(1));
    behind.next().is_some() && behind.next().is_none_or(<[u8]>::is_empty) && behind.next().is_none()
}
