//! Reads a file into a log.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::account::{LogWarning, Reason, RowAccount};
use super::clean;
use super::error::{LogError, UnitSuspicion};
use super::even_stamps::{EvenStamps, even_stamps};
use super::late_bursts::late_bursts;
use super::layout::{Block, Layout};
use super::lines::{Line, Lines};
use super::plan::{Delimiter, Plan};
use super::record::{Effort, Log};
use super::slopes::slopes;
use super::units;
use crate::robot::JointSignals;

/// Number of rows of a file without header that are inspected to find its width, so that one truncated row does not
/// decide.
const WIDTH_ROWS: usize = 50;

/// Reads a log of an arm with `joints` joints.
///
/// If the layout has no velocities, they are computed from the angles once the times are in order, as slopes of
/// polynomials through five rows. Step 4 is then replaced: before differentiation, rows with an angle far from the
/// median of five rows are set aside.
///
/// Only the columns named by the layout are kept, row by row; memory use is 8 bytes per number kept. Numbers are
/// converted to SI units. Then, in this order:
///
/// 1. Rows are set aside if their number of fields differs from that of the file, or if time, angles, velocities or
///    effort contain an empty field, text, NaN, an infinity, or a magnitude beyond these bounds: angle and velocity
///    3.6·10⁵, acceleration 3·10⁴ rad/s², current 500 A, torque 5·10⁴ Nm, temperature 1000 °C, time 10¹⁹ s.
/// 2. Time stamps rounded more coarsely than half the sampling interval are replaced by the straight line through them,
///    if the motion shows that the rows were sampled evenly. Rows that were held back and written in one burst are
///    spread evenly between the row before and the row after, unless the motion shows that they were really sampled
///    that late. Then times must increase: repeated and backward times are set aside, and so are up to 8 consecutive
///    rows whose time is far ahead.
/// 3. Units are checked: Δq is compared with ∫q̇ dt, and the clock with the steps a recorder can have. Numbers that
///    indicate degrees, milli-, micro- or nanoseconds are an error that names the change to make in the layout.
/// 4. Rows with angles beyond 1000 rad or velocities beyond 100 rad/s are set aside, and so are rows whose angles and
///    velocities do not follow from those of their neighbours: stretches of fewer than 10 rows, or interleaved with a
///    longer one, that no acceleration below 20 rad/s² connects to the other rows.
/// 5. Angles that jump by one turn are unwrapped, and the target angles with them.
/// 6. A block of targets or temperatures is left out of the log if it has a field as in step 1 in any of the remaining
///    rows. Nothing is identified from these blocks, so they cost no rows.
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
    let mut table = Table::new(&plan);
    let mut account = RowAccount::default();
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

/// The numbers read so far, column by column, and the row of the file that each one came from.
struct Table {
    /// The columns of the plan; if the file has no velocities, their columns follow after these.
    columns: Vec<Vec<f64>>,
    rows: Vec<usize>,
    current: Vec<f64>,
}

/// What is wrong with a row: `at` is the column (from 0) or, for a wrong number of fields, that number.
struct Defect {
    reason: Reason,
    at: usize,
}

impl Table {
    fn new(plan: &Plan) -> Self {
        Self {
            columns: vec![Vec::new(); motion_ranges(plan).2.end.max(plan.fields.len())],
            rows: Vec::new(),
            current: vec![0.0; plan.fields.len()],
        }
    }

    /// Adds a row to the table, or counts it as set aside with the reason.
    fn push(
        &mut self,
        plan: &Plan,
        line: &Line,
        account: &mut RowAccount,
        file: &str,
    ) -> Result<(), LogError> {
        account.read += 1;
        match parse(plan, line, &mut self.current) {
            Ok(()) => {
                for (column, &value) in self.columns.iter_mut().zip(&self.current) {
                    column.push(value);
                }
                self.rows.push(line.row);
            }
            Err(defect) => {
                let text = plan.delimiter.split(&line.bytes).nth(defect.at).unwrap_or_default();
                let text = String::from_utf8_lossy(text);
                if defect.reason == Reason::NotANumber && is_decimal_comma(&text) {
                    return Err(LogError::DecimalComma {
                        file: file.to_owned(),
                        row: line.row,
                        column: defect.at + 1,
                        value: abridged(&text),
                    });
                }
                account.add(defect.reason, line.row, || match defect.reason {
                    Reason::TooFewFields | Reason::TooManyFields | Reason::CutShort => {
                        format!("{} fields of {}", defect.at, plan.width)
                    }
                    _ => {
                        let place = plan.place[defect.at].map(|i| plan.fields[i].place());
                        format!("{} = \"{}\"", place.unwrap_or_default(), abridged(&text))
                    }
                });
            }
        }
        Ok(())
    }

    /// Steps 2 to 6 of [`read_log`].
    fn clean(
        &mut self,
        plan: &Plan,
        layout: &Layout,
        account: &mut RowAccount,
        file: &str,
    ) -> Result<Vec<LogWarning>, LogError> {
        let fault = |suspicion| LogError::Units { file: file.to_owned(), suspicion };
        let (time, q, qd) = motion_ranges(plan);
        let has_velocities = plan.range(Block::Qd).is_some();
        let restamped = self.restamp(plan);
        let order = clean::order_of_time(&self.columns[time]);
        self.retain(&order, account, |table, k, _| format!("time {} s", table.columns[time][k]));
        self.require_two(account, file)?;
        let slopes = match has_velocities {
            true => Vec::new(),
            false => self.take_slopes(plan, account, file)?,
        };
        let motion = self.motion(plan);
        // Many garbage rows can hide the relation between angles and velocities. If no unit explains the relation, the
        // garbage is removed first, if it is less than half of the rows, and the units are checked again afterwards.
        let mut related = units::check(&motion, &layout.units);
        if let Err(suspicion) = &related
            && !matches!(suspicion, UnitSuspicion::Unrelated { .. })
        {
            return Err(fault(suspicion.clone()));
        }
        // Velocities computed as slopes always agree with the angles, so there is nothing to check.
        let verdicts = if has_velocities { clean::consistency(&motion) } else { Vec::new() };
        self.retain(&verdicts, account, |table, k, reason| {
            let beyond = |columns: std::ops::Range<usize>, bound: f64| {
                columns.into_iter().find(|&c| table.columns[c][k].abs() > bound)
            };
            let worst = beyond(q.clone(), clean::ANGLE_BOUND_RAD)
                .or_else(|| beyond(qd.clone(), clean::VELOCITY_BOUND_RAD_S))
                .filter(|_| reason == Reason::Implausible);
            let c = worst.unwrap_or(q.start);
            format!("{} = {}", plan.fields[c].place(), table.columns[c][k])
        });
        // Where half of the rows or more are removed, they are not garbage but the motion itself.
        if let Err(suspicion) = &related
            && 2 * self.rows.len() <= verdicts.len()
        {
            return Err(fault(suspicion.clone()));
        }
        self.require_two(account, file)?;
        if related.is_err() {
            related = units::check(&self.motion(plan), &layout.units);
        }
        let mut warnings = related.map_err(fault)?;
        warnings.splice(0..0, restamped);
        warnings.extend(slopes);
        if has_velocities {
            warnings.extend(self.unwrap_angles(plan));
        }
        let motion = self.motion(plan);
        warnings.extend(clean::held(&motion));
        warnings.extend(clean::jumps(&motion));
        if let Some((missed, warning)) = clean::missed_samples(&motion) {
            account.missed_samples = missed;
            warnings.push(warning);
        }
        let set_aside = account.total_set_aside();
        if set_aside * 10 > account.read {
            warnings.push(LogWarning::ManySetAside { set_aside, read: account.read });
        }
        warnings.extend(Block::optional().filter_map(|b| self.left_out(plan, b)));
        Ok(warnings)
    }

    fn motion(&self, plan: &Plan) -> clean::Motion<'_> {
        let (time, q, qd) = motion_ranges(plan);
        let qd = &self.columns[qd];
        let are_taken = qd.iter().all(|qd| qd.len() == self.rows.len());
        clean::Motion {
            time_s: &self.columns[time],
            q: &self.columns[q],
            qd: if are_taken { qd } else { &[] },
            row: &self.rows,
        }
    }

    /// Repairs rounded or late time stamps where the motion contradicts them; returns the warning that reports the
    /// repair.
    fn restamp(&mut self, plan: &Plan) -> Option<LogWarning> {
        let motion = self.motion(plan);
        let (time_s, warning) = match even_stamps(&motion) {
            Some(EvenStamps { time_s, resolution_s, rate_hz }) => {
                (time_s, LogWarning::RoundedStamps { resolution_s, rate_hz })
            }
            None => late_bursts(&motion)?,
        };
        let (time, ..) = motion_ranges(plan);
        self.columns[time] = time_s;
        Some(warning)
    }

    /// Computes the velocities of a file that has none, after unwrapping the angles and setting wild ones aside.
    fn take_slopes(
        &mut self,
        plan: &Plan,
        account: &mut RowAccount,
        file: &str,
    ) -> Result<Vec<LogWarning>, LogError> {
        let (time, q, qd) = motion_ranges(plan);
        let mut warnings: Vec<LogWarning> = self.unwrap_angles(plan).into_iter().collect();
        let wild = clean::wild_angles(&self.motion(plan));
        self.retain(&wild, account, |table, k, _| {
            let farthest = |c: &usize| table.columns[*c][k].abs();
            let c = q.clone().max_by(|a, b| farthest(a).total_cmp(&farthest(b)));
            let c = c.unwrap_or(q.start);
            format!("{} = {}", plan.fields[c].place(), table.columns[c][k])
        });
        self.require_two(account, file)?;
        for (q, qd) in q.zip(qd) {
            self.columns[qd] = slopes(&self.columns[time], &self.columns[q]);
        }
        warnings.push(LogWarning::SlopesOfAngles);
        Ok(warnings)
    }

    /// Step 5 of [`read_log`].
    fn unwrap_angles(&mut self, plan: &Plan) -> Option<LogWarning> {
        let (_, q, _) = motion_ranges(plan);
        let (joints, warning) = clean::unwrapped(&self.motion(plan));
        for unwrapped in joints {
            if let Some(target_q) = plan.range(Block::TargetQ) {
                unwrapped.bring_along(&mut self.columns[target_q.start + unwrapped.joint]);
            }
            self.columns[q.start + unwrapped.joint] = unwrapped.q;
        }
        warning
    }

    /// Step 6 of [`read_log`]: the warning for an optional block that is left out because of unusable fields.
    fn left_out(&self, plan: &Plan, block: Block) -> Option<LogWarning> {
        let range = plan.range(block)?;
        let columns = &self.columns[range.clone()];
        let first_bad = |values: &Vec<f64>| values.iter().position(|v| v.is_nan());
        let (k, place) = columns
            .iter()
            .zip(range)
            .filter_map(|(values, place)| Some((first_bad(values)?, place)))
            .min()?;
        Some(LogWarning::LeftOut {
            block: block.key(),
            fields: columns.iter().flatten().filter(|v| v.is_nan()).count(),
            first_row: self.rows[k],
            column: plan.fields[place].place(),
        })
    }

    /// Keeps the rows without a reason against them and counts the other rows as set aside.
    fn retain(
        &mut self,
        verdicts: &[Option<Reason>],
        account: &mut RowAccount,
        example: impl Fn(&Self, usize, Reason) -> String,
    ) {
        for (k, verdict) in verdicts.iter().enumerate() {
            if let Some(reason) = *verdict {
                account.add(reason, self.rows[k], || example(self, k, reason));
            }
        }
        if verdicts.iter().all(Option::is_none) {
            return;
        }
        for column in &mut self.columns {
            let mut verdict = verdicts.iter();
            column.retain(|_| verdict.next().is_some_and(Option::is_none));
        }
        let mut verdict = verdicts.iter();
        self.rows.retain(|_| verdict.next().is_some_and(Option::is_none));
    }

    fn require_two(&self, account: &mut RowAccount, file: &str) -> Result<(), LogError> {
        account.used = self.rows.len();
        // If most rows look like garbage, the column holds another quantity or another unit.
        if account.used < 2 || 2 * account.count(Reason::Implausible) > account.read {
            return Err(LogError::NoUsableRows {
                file: file.to_owned(),
                account: std::mem::take(account),
            });
        }
        Ok(())
    }

    fn into_log(
        mut self,
        plan: &Plan,
        layout: &Layout,
        rows: RowAccount,
        source: &str,
        sha256: String,
    ) -> Log {
        let mut signals = |block| {
            let range = plan.range(block).filter(|_| self.left_out(plan, block).is_none())?;
            Some(self.signals(range))
        };
        let gain = || layout.drive_gain_nm_a.clone();
        let current = |ampere| Effort::Current { ampere, gain_nm_a: gain() };
        // Every plan contains torques or currents, so the zero-sized fallback is never used.
        let effort = match signals(Block::Torque) {
            Some(nm) => Effort::Torque(nm),
            None => current(signals(Block::Current).unwrap_or(JointSignals::zeros(0, 0))),
        };
        let target_effort = signals(Block::TargetCurrent)
            .map(current)
            .or_else(|| signals(Block::TargetMoment).map(Effort::Torque));
        let (time, q, qd) = motion_ranges(plan);
        let mut log = Log {
            source: source.to_owned(),
            target_q_rad: signals(Block::TargetQ),
            target_qd_rad_s: signals(Block::TargetQd),
            target_qdd_rad_s2: signals(Block::TargetQdd),
            temperature_c: signals(Block::Temperature),
            effort,
            target_effort,
            q_rad: self.signals(q),
            qd_rad_s: self.signals(qd),
            time_s: std::mem::take(&mut self.columns[time]),
            rows,
            sha256,
        };
        layout.counting(log.q_rad.joints()).apply(&mut log);
        log
    }

    /// Moves columns into signals. Each block is released as it is converted, so that no second copy of the whole log
    /// is ever held in memory.
    fn signals(&mut self, range: std::ops::Range<usize>) -> JointSignals {
        let columns: Vec<Vec<f64>> = self.columns[range].iter_mut().map(std::mem::take).collect();
        JointSignals::from_fn(columns.len(), self.rows.len(), |j, k| columns[j][k])
    }
}

/// Positions of time, angles and velocities among the columns of a [`Table`]. Without recorded velocities, the velocity
/// columns follow after those of the plan.
fn motion_ranges(plan: &Plan) -> (usize, std::ops::Range<usize>, std::ops::Range<usize>) {
    let range = |block| plan.range(block).unwrap_or_default();
    let q = range(Block::Q);
    let behind = plan.fields.len()..plan.fields.len() + q.len();
    (range(Block::Time).start, q, plan.range(Block::Qd).unwrap_or(behind))
}

/// Writes the numbers of one row, in SI units, into `values`; unusable fields of optional blocks become NaN.
fn parse(plan: &Plan, line: &Line, values: &mut [f64]) -> Result<(), Defect> {
    let mut defect = None;
    let mut count = 0;
    let mut last_is_empty = false;
    for (at, text) in plan.delimiter.split(&line.bytes).enumerate() {
        count += 1;
        last_is_empty = text.is_empty();
        let Some(&Some(place)) = plan.place.get(at) else { continue };
        let field = &plan.fields[place];
        let value = number(text, plan.decimal_comma)
            .map(|raw| field.factor.map_or(raw, |factor| raw * factor))
            .and_then(|value| {
                let is_plausible = value.abs() <= field.block.bound();
                if is_plausible { Ok(value) } else { Err(Reason::Implausible) }
            });
        match value {
            Ok(value) => values[place] = value,
            Err(_) if field.block.is_optional() => values[place] = f64::NAN,
            Err(reason) => defect = defect.or(Some(Defect { reason, at })),
        }
    }
    // A trailing delimiter does not start another field.
    let surplus = usize::from(last_is_empty && count == plan.width + 1);
    let fields = count - surplus;
    let last_is_used = plan.place.last().is_some_and(Option::is_some);
    let reason = if !line.ended && surplus == 0 && (fields < plan.width || last_is_used) {
        Some(Reason::CutShort)
    } else {
        match fields.cmp(&plan.width) {
            std::cmp::Ordering::Less => Some(Reason::TooFewFields),
            std::cmp::Ordering::Greater => Some(Reason::TooManyFields),
            std::cmp::Ordering::Equal => None,
        }
    };
    if let Some(defect) = reason.map(|reason| Defect { reason, at: fields }).or(defect) {
        return Err(defect);
    }
    if let (Some(time), Some(rest)) = (plan.range(Block::Time), plan.range(Block::TimeNanoseconds))
    {
        values[time.start] += values[rest.start];
    }
    Ok(())
}

fn number(text: &[u8], decimal_comma: bool) -> Result<f64, Reason> {
    if text.is_empty() {
        return Err(Reason::EmptyField);
    }
    let text = std::str::from_utf8(text).map_err(|_| Reason::NotANumber)?;
    let value: Result<f64, _> =
        if decimal_comma { text.replace(',', ".").parse() } else { text.parse() };
    match value {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(Reason::NotFinite),
        Err(_) => Err(Reason::NotANumber),
    }
}

/// Whether the text is a number once its only comma is replaced by a point, such as "0,25" or "-1,5e3".
fn is_decimal_comma(text: &str) -> bool {
    text.matches(',').count() == 1 && text.replace(',', ".").parse::<f64>().is_ok()
}

/// Shortens a value for messages; uninitialised doubles can print as 300 digits.
fn abridged(text: &str) -> String {
    const SHOWN: usize = 24;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}… ({} characters)", &text[..end], text.chars().count()),
        None => text.to_owned(),
    }
}
