//! A layout applied to one file: which field of a row goes where.

use super::account::LogWarning;
use super::error::LogError;
use super::layout::LayoutFault;
use super::layout::{Block, Columns, DelimiterChoice, Layout};
use super::lines::Line;

/// What separates the fields of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Delimiter {
    /// Exactly one of this byte.
    Byte(u8),
    /// Any run of blanks and tabs.
    Blanks,
}

impl Delimiter {
    /// The delimiter stated by the layout, or the one found in the first line.
    pub(super) fn choose(layout: &Layout, first_line: &[u8]) -> Self {
        match layout.delimiter {
            DelimiterChoice::Comma => Self::Byte(b','),
            DelimiterChoice::Semicolon => Self::Byte(b';'),
            DelimiterChoice::Tab => Self::Byte(b'\t'),
            DelimiterChoice::Blank => Self::Blanks,
            DelimiterChoice::Auto => [b'\t', b';', b',']
                .into_iter()
                .filter(|&byte| byte != b',' || !layout.decimal_comma)
                .find(|byte| first_line.contains(byte))
                .map_or(Self::Blanks, Self::Byte),
        }
    }

    /// The fields of a line, without surrounding blanks and quotes.
    pub(super) fn split(self, line: &[u8]) -> impl Iterator<Item = &[u8]> {
        let runs = self == Self::Blanks;
        line.split(move |&b| match self {
            Self::Byte(byte) => b == byte,
            Self::Blanks => b == b' ' || b == b'\t',
        })
        .filter(move |field| !runs || !field.is_empty())
        .map(|field| {
            let field = field.trim_ascii();
            match field {
                [b'"', inner @ .., b'"'] => inner.trim_ascii(),
                _ => field,
            }
        })
    }
}

/// One column of the file that is read.
#[derive(Debug, Clone)]
pub(super) struct Field {
    pub(super) block: Block,
    /// Name in the file, or empty.
    pub(super) name: String,
    /// Factor that converts to the SI unit; `None` if it is one.
    pub(super) factor: Option<f64>,
    /// Column number in the file, from 0.
    pub(super) column: usize,
}

/// The columns of a file that are read. The fields of a block are contiguous, in the order of the joints.
pub(super) struct Plan {
    pub(super) delimiter: Delimiter,
    pub(super) decimal_comma: bool,
    /// Number of fields of every row.
    pub(super) width: usize,
    pub(super) fields: Vec<Field>,
    /// For every column of the file, its index in `fields`.
    pub(super) place: Vec<Option<usize>>,
    /// What a reader of the results should know about the choice of columns.
    pub(super) warnings: Vec<LogWarning>,
    joints: usize,
}

impl Plan {
    /// Builds the plan from the header of a file.
    pub(super) fn from_header(
        layout: &Layout,
        joints: usize,
        delimiter: Delimiter,
        header: &Line,
        file: &str,
    ) -> Result<Self, LogError> {
        let mut names: Vec<String> = delimiter
            .split(&header.bytes)
            .map(|name| String::from_utf8_lossy(name).into_owned())
            .collect();
        // A trailing delimiter does not start another field.
        if names.len() > 1 && names.last().is_some_and(String::is_empty) {
            names.pop();
        }
        let header = Header { layout, joints, file, row: header.row, names };
        header.refuse_numbers()?;
        let mut fields = Vec::new();
        for block in [Block::Time, Block::TimeNanoseconds, Block::Q, Block::Qd] {
            let may_miss = matches!(block, Block::TimeNanoseconds | Block::Qd);
            if may_miss && layout.columns(block).is_none() {
                continue;
            }
            let found = header.block(block)?;
            if block == Block::Qd && found.is_err() && layout.may_lack(block) {
                continue;
            }
            fields.extend(found.map_err(|missing| header.missing(missing))?);
        }
        fields.extend(header.effort()?);
        let mut incomplete = Vec::new();
        for block in Block::optional().filter(|block| layout.columns(*block).is_some()) {
            match header.block(block) {
                // Nothing is identified from these blocks, so a part of one costs no log.
                Err(LogError::MissingColumn { column, .. }) => {
                    incomplete.push(LogWarning::Incomplete { block: block.key(), column });
                }
                found => fields.extend(found?.unwrap_or_default()),
            }
        }
        let mut plan = Self::new(layout, joints, delimiter, header.names.len(), fields)?;
        plan.warnings.extend(incomplete);
        Ok(plan)
    }

    /// Builds the plan from the number of fields of a file without header; `None` if the layout does not list this
    /// width.
    pub(super) fn from_width(
        layout: &Layout,
        joints: usize,
        delimiter: Delimiter,
        width: usize,
        file: &str,
    ) -> Result<Option<Self>, LogError> {
        let Some(known) = layout.widths.iter().find(|w| w.fields == width) else {
            return Ok(None);
        };
        let mut fields = Vec::new();
        let efforts = layout.efforts();
        let read = efforts.into_iter().find(|effort| known.blocks.contains(effort));
        for &block in &known.blocks {
            if efforts.contains(&block) && Some(block) != read {
                continue;
            }
            let numbers = layout.columns(block).and_then(Columns::numbers).unwrap_or_default();
            check_joints(block, numbers.len(), joints, file)?;
            fields.extend(numbers.map(|column| Field {
                block,
                name: String::new(),
                factor: layout.units.factor(block),
                column,
            }));
        }
        Self::new(layout, joints, delimiter, width, fields).map(Some)
    }

    fn new(
        layout: &Layout,
        joints: usize,
        delimiter: Delimiter,
        width: usize,
        fields: Vec<Field>,
    ) -> Result<Self, LogError> {
        let mut place: Vec<Option<usize>> = vec![None; width];
        for (i, field) in fields.iter().enumerate() {
            if let Some(other) = place[field.column].replace(i) {
                let fault = LayoutFault::Overlap {
                    column: field.column + 1,
                    first: fields[other].block.key(),
                    second: field.block.key(),
                };
                return Err(LogError::Layout { file: layout.source.clone(), fault });
            }
        }
        let has_torque = fields.iter().any(|field| field.block == Block::Torque);
        let stated = if has_torque { layout.about_currents() } else { Vec::new() };
        let about_currents = (!stated.is_empty())
            .then(|| LogWarning::TorquesRead { layout: layout.name.clone(), stated });
        Ok(Self {
            delimiter,
            decimal_comma: layout.decimal_comma,
            width,
            fields,
            place,
            warnings: about_currents.into_iter().collect(),
            joints,
        })
    }

    /// Range of the block's fields within `fields`.
    pub(super) fn range(&self, block: Block) -> Option<std::ops::Range<usize>> {
        let first = self.fields.iter().position(|f| f.block == block)?;
        Some(first..first + if block.is_of_time() { 1 } else { self.joints })
    }
}

impl Field {
    /// The position of the column for messages, such as "column 14 (actual_current_0)".
    pub(super) fn place(&self) -> String {
        if self.name.is_empty() {
            format!("column {}", self.column + 1)
        } else {
            format!("column {} ({})", self.column + 1, self.name)
        }
    }
}

fn check_joints(block: Block, found: usize, joints: usize, file: &str) -> Result<(), LogError> {
    if block.is_of_time() || found == joints {
        return Ok(());
    }
    Err(LogError::JointCount { file: file.to_owned(), what: "the layout", found, expected: joints })
}

struct Header<'a> {
    layout: &'a Layout,
    joints: usize,
    file: &'a str,
    row: usize,
    names: Vec<String>,
}

impl Header<'_> {
    fn refuse_numbers(&self) -> Result<(), LogError> {
        // Rows of numbers may hold names as well: those of the joints in messages of ROS.
        match self.names.first() {
            Some(first) if first.replace(',', ".").parse::<f64>().is_ok() => {
                Err(LogError::NoHeader {
                    file: self.file.to_owned(),
                    row: self.row,
                    value: first.clone(),
                    layout: self.layout.name.clone(),
                })
            }
            _ => Ok(()),
        }
    }

    /// The fields of a block, or `Err(name)` with the name of its first column if none of its columns is in the header.
    fn block(&self, block: Block) -> Result<Result<Vec<Field>, String>, LogError> {
        let Some(columns) = self.layout.columns(block) else {
            return Ok(Err(block.key().to_owned()));
        };
        let count = if block.is_of_time() { 1 } else { self.joints };
        if let Some(stated) = columns.len() {
            check_joints(block, stated, self.joints, self.file)?;
        }
        let field = |column, name: String| Field {
            block,
            name,
            factor: self.layout.units.factor(block),
            column,
        };
        if let Some(numbers) = columns.numbers() {
            if numbers.end > self.names.len() {
                return Err(self.missing(format!("number {}", numbers.end)));
            }
            return Ok(Ok(numbers.map(|c| field(c, self.names[c].clone())).collect()));
        }
        let mut found = Vec::with_capacity(count);
        let mut first_missing = None;
        for name in (0..count).map_while(|joint| columns.name(joint)) {
            match self.find(&name)? {
                Some(column) => found.push(field(column, name)),
                None => first_missing = first_missing.or(Some(name)),
            }
        }
        let joint_count = |found| LogError::JointCount {
            file: self.file.to_owned(),
            what: "the log",
            found,
            expected: self.joints,
        };
        match first_missing {
            None => {
                let one_more = columns.len().is_none().then(|| columns.name(count)).flatten();
                let one_more = one_more.filter(|_| !block.is_of_time());
                match one_more.map(|name| self.find(&name)).transpose()?.flatten() {
                    Some(_) => {
                        let names = (0..).map_while(|joint| columns.name(joint));
                        let there = names.take_while(|name| matches!(self.find(name), Ok(Some(_))));
                        Err(joint_count(there.count()))
                    }
                    None => Ok(Ok(found)),
                }
            }
            Some(name) if found.is_empty() => Ok(Err(name)),
            // The first joints are present and all later ones are missing: the log is of another arm.
            Some(name)
                if columns.name(found.len()).as_ref() == Some(&name) && block == Block::Q =>
            {
                Err(joint_count(found.len()))
            }
            Some(name) => Err(self.missing(name)),
        }
    }

    /// The fields of the torques or of the currents: of the first of [`Layout::efforts`] that is logged.
    fn effort(&self) -> Result<Vec<Field>, LogError> {
        for effort in self.layout.efforts() {
            if let Ok(fields) = self.block(effort)? {
                return Ok(fields);
            }
        }
        let first = |block| self.layout.columns(block).and_then(|columns| columns.name(0));
        Err(match (first(Block::Current), first(Block::Torque)) {
            (Some(current), Some(torque)) => {
                LogError::NoEffort { file: self.file.to_owned(), row: self.row, current, torque }
            }
            (current, torque) => {
                let only = current.or(torque);
                self.missing(only.unwrap_or_else(|| Block::Current.key().to_owned()))
            }
        })
    }

    fn find(&self, name: &str) -> Result<Option<usize>, LogError> {
        let mut places = (0..self.names.len()).filter(|&i| self.names[i] == name);
        match (places.next(), places.next()) {
            (Some(first), Some(second)) => Err(LogError::DuplicateColumn {
                file: self.file.to_owned(),
                row: self.row,
                column: name.to_owned(),
                first: first + 1,
                second: second + 1,
            }),
            (first, _) => Ok(first),
        }
    }

    fn missing(&self, column: String) -> LogError {
        const SHOWN: usize = 4;
        let mut found: Vec<String> = self
            .names
            .iter()
            .take(SHOWN)
            .map(|name| format!("\"{}\"", name.chars().take(30).collect::<String>()))
            .collect();
        if self.names.len() > SHOWN {
            found.push(format!("… ({} columns)", self.names.len()));
        }
        LogError::MissingColumn {
            file: self.file.to_owned(),
            row: self.row,
            column,
            layout: self.layout.name.clone(),
            found: found.join(", "),
        }
    }
}
