//! The numbers of a log while it is read, column by column.

use super::account::{LogWarning, Reason, RowAccount};
use super::arrival_stamps::{arrival_stamps, scatter_is_common};
use super::clean;
use super::error::LogError;
use super::even_stamps::{EvenStamps, even_stamps};
use super::late_bursts::late_bursts;
use super::layout::{Block, Layout};
use super::lines::Line;
use super::plan::Plan;
use super::record::{Effort, Log};
use super::row::{abridged, is_decimal_comma, parse};
use super::slopes::slopes;
use super::stamp_pieces::stamp_pieces;
use super::unit_suspicion::UnitSuspicion;
use super::units;
use crate::robot::JointSignals;
use crate::signal::Tears;

/// The numbers read so far, column by column, and the row of the file that each one came from.
pub(super) struct Table {
    /// The columns of the plan; if the file has no velocities, their columns follow after these.
    columns: Vec<Vec<f64>>,
    rows: Vec<usize>,
    current: Vec<f64>,
}

impl Table {
    pub(super) fn new(plan: &Plan) -> Self {
        Self {
            columns: vec![Vec::new(); motion_ranges(plan).2.end.max(plan.fields.len())],
            rows: Vec::new(),
            current: vec![0.0; plan.fields.len()],
        }
    }

    /// Adds a row to the table, or counts it as set aside with the reason.
    pub(super) fn push(
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
    pub(super) fn clean(
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
            false => {
                // Between rows that are far apart all angles jump, and angles that turn on and on are unwrapped: both
                // units show before any angle is taken for wild.
                let recorded = self.motion(plan);
                units::check_clock(&recorded, &layout.units)
                    .and_then(|()| units::check_degrees(&recorded, &layout.units))
                    .map_err(fault)?;
                self.take_slopes(plan, account, file)?
            }
        };
        let motion = self.motion(plan);
        // Many garbage rows can hide the relation between angles and velocities. If no unit explains the relation, the
        // garbage is removed first, if it is less than half of the rows, and the units are checked again afterwards.
        let mut related = match has_velocities {
            true => units::check(&motion, &layout.units),
            false => units::check_speed(&motion).map(|()| Vec::new()),
        };
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

    /// Repairs time stamps that are rounded, scatter or are late where the motion contradicts them; returns the warnings
    /// that report the repair.
    fn restamp(&mut self, plan: &Plan) -> Vec<LogWarning> {
        let Some((time_s, warnings)) = restamped(&self.motion(plan)) else { return Vec::new() };
        let (time, ..) = motion_ranges(plan);
        self.columns[time] = time_s;
        warnings
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
        let tears = Tears::of(&self.columns[time], &self.columns[q.clone()]);
        for (q, qd) in q.zip(qd) {
            self.columns[qd] = slopes(&self.columns[time], &self.columns[q], &tears);
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

    pub(super) fn into_log(
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

/// The time stamps of `motion` after their repair, and the warnings that report it; `None` if nothing is repaired.
fn restamped(motion: &clean::Motion) -> Option<(Vec<f64>, Vec<LogWarning>)> {
    if let Some(EvenStamps { time_s, resolution_s, rate_hz }) = even_stamps(motion) {
        return Some((time_s, vec![LogWarning::RoundedStamps { resolution_s, rate_hz }]));
    }
    let with_one = |(time_s, warning)| (time_s, vec![warning]);
    if let Some(on_a_line) = arrival_stamps(motion) {
        return Some(with_one(on_a_line));
    }
    if !scatter_is_common(motion) {
        return late_bursts(motion).map(with_one);
    }
    // Among stamps that scatter, late rows and tiny steps are everywhere, and say nothing about bursts, unless bursts are
    // all that scatters. Of an arm that rests for most of the log, no motion tells the line.
    let leave_no_scatter = |(time_s, _): &(Vec<f64>, LogWarning)| {
        !scatter_is_common(&clean::Motion { time_s, ..*motion })
    };
    stamp_pieces(motion).or_else(|| late_bursts(motion).filter(leave_no_scatter).map(with_one))
}

/// Positions of time, angles and velocities among the columns of a [`Table`]. Without recorded velocities, the velocity
/// columns follow after those of the plan.
fn motion_ranges(plan: &Plan) -> (usize, std::ops::Range<usize>, std::ops::Range<usize>) {
    let range = |block| plan.range(block).unwrap_or_default();
    let q = range(Block::Q);
    let behind = plan.fields.len()..plan.fields.len() + q.len();
    (range(Block::Time).start, q, plan.range(Block::Qd).unwrap_or(behind))
}
