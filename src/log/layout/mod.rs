//! Layouts: which column of a file holds which quantity, and in which unit.
//!
//! Input: a TOML file, or the name of a built-in layout. Output: names or numbers of the columns of each quantity, the
//! factors that convert them to SI units, and the widths that files may have.

mod block;
mod columns;
mod fault;
mod joints;
mod like;
mod units;

use std::path::Path;

use serde::Deserialize;

use super::counting::Counting;
use super::error::LogError;
pub(super) use block::Block;
use columns::Blocks;
pub(super) use columns::Columns;
pub use fault::LayoutFault;
pub use joints::Joints;
pub(super) use units::{Angle, AngularVelocity, TimeUnit, Units};

/// Built-in layouts, by the name given to `--layout`.
const BUILT_IN: [(&str, &str); 5] = [
    ("armid", include_str!("../../../layouts/armid.toml")),
    ("ur_torque", include_str!("../../../layouts/ur_torque.toml")),
    ("ros2_joint_states", include_str!("../../../layouts/ros2_joint_states.toml")),
    ("ur10e_innopolis", include_str!("../../../layouts/ur10e_innopolis.toml")),
    ("ur10e_innopolis_author", include_str!("../../../layouts/ur10e_innopolis_author.toml")),
];

/// The keys of the columns of currents and torques, with the table that they are in.
const CURRENT_COLUMNS: [&str; 2] = ["columns", "current"];
const TORQUE_COLUMNS: [&str; 2] = ["columns", "torque"];

/// The text of the built-in layout of this name.
fn built_in(name: &str) -> Option<&'static str> {
    BUILT_IN.iter().find(|(built_in, _)| *built_in == name).map(|(_, text)| *text)
}

/// Whether a name is that of a layout file, by its extension.
fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// Names of the built-in layouts; the first is the default.
pub fn built_in_layout_names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

/// Names of the built-in layouts for files without a header.
pub(super) fn built_in_without_header() -> impl Iterator<Item = &'static str> {
    let has_none =
        |text: &str, name: &str| Layout::from_toml(text, name).is_ok_and(|layout| !layout.header);
    BUILT_IN.iter().filter(move |(name, text)| has_none(text, name)).map(|(name, _)| *name)
}

/// Describes how to read the files of one recorder; written as a small TOML file.
///
/// ```toml
/// name = "my_robot"
/// delimiter = "semicolon"      # auto (default), comma, semicolon, tab, blank
/// header = true                # the first row holds column names
/// decimal_comma = true         # 0,25 for 0.25; default false
/// drive_gain_nm_a = [12.0, 12.0, 9.8, 10.7, 10.7, 10.7]   # default: the arm's own i_G·k
///
/// [units]                      # defaults: s, rad, rad/s, rad/s2, A
/// time = "ms"                  # s, ms, us, ns
/// q = "deg"                    # rad, deg; qdd = "deg/s2" likewise
/// qd = "deg/s"                 # rad/s, deg/s, rpm
/// current = "mA"               # A, mA
///
/// [columns]                    # {0}: joints counted from 0 in the names, {1}: from 1
/// time = "clock"
/// q = "angle {1}"
/// qd = ["w1", "w2", "w3", "w4", "w5", "w6"]
/// current = { first = 14, last = 19 }   # column numbers count from 1
///
/// [joints]                     # where the robot's description counts otherwise; joints from 1
/// order = [3, 2, 1, 4, 5, 6]   # each joint of the arm by the recorder's count; torque_order, where torques differ
/// motion_reversed = [3]        # angle and velocity, by the arm's count
/// torque_reversed = [3]
/// zero = [0, -90, 0, 0, 0, 0]  # added to the angles, in the unit of q
/// ```
///
/// Blocks: `time q qd`, `current` or `torque` (Nm; it takes precedence where both are present, see below), and
/// optionally `time_nanoseconds` (added to the time: ROS stamps), `target_q target_qd target_qdd target_current
/// target_moment temperature`. The unit of `q` also applies to `target_q`, and likewise for the other targets. Layouts
/// for files without a header must list their possible widths:
///
/// ```toml
/// [[width]]
/// fields = 19
/// blocks = ["time", "q", "qd", "current"]
/// ```
///
/// With `like = "armid"` (a built-in name, or a file beside this one) everything that this layout does not state is
/// taken from the other layout: `[units]` and `[columns]` key by key, any other entry as a whole. What a layout states
/// itself beats what it inherits, so one that states `current` and inherits `torque` reads the currents of a log that
/// has both. If torques are read with a layout that inherits `torque` and states `drive_gain_nm_a` or `current`, a
/// warning says so.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// Name, for messages.
    // Optional for serde, because a layout with `like` may inherit it; the module `like` reports keys that no layout of
    // the chain has.
    #[serde(default)]
    pub name: String,
    like: Option<String>,
    #[serde(default)]
    pub(super) delimiter: DelimiterChoice,
    #[serde(default)]
    pub(super) header: bool,
    #[serde(default)]
    pub(super) decimal_comma: bool,
    pub(super) drive_gain_nm_a: Option<Vec<f64>>,
    #[serde(default)]
    pub(super) units: Units,
    #[serde(default)]
    joints: Joints,
    #[serde(default)]
    columns: Blocks,
    #[serde(default, rename = "width")]
    pub(super) widths: Vec<Width>,
    /// The file of the layout, or the name of a built-in one.
    #[serde(skip)]
    pub(super) source: String,
    /// The layout named by `like`.
    #[serde(skip)]
    below: Option<Box<Layout>>,
    /// The layout's own keys, without those that it inherits.
    #[serde(skip)]
    stated: toml::Table,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum DelimiterChoice {
    #[default]
    Auto,
    Comma,
    Semicolon,
    Tab,
    Blank,
}

/// One width that files without header may have.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Width {
    pub(super) fields: usize,
    pub(super) blocks: Vec<Block>,
}

impl Default for Layout {
    /// The layout of the project's own logs, which is also the one that RTDE recorders write.
    fn default() -> Self {
        Self::from_toml(BUILT_IN[0].1, BUILT_IN[0].0).expect("a built-in layout is valid: tested")
    }
}

impl Layout {
    /// Loads what `--layout` accepts: a built-in name or a `.toml` file.
    ///
    /// # Errors
    /// [`LogError::UnknownLayout`], or [`LogError::Layout`] with what is wrong in the file.
    pub fn load(name_or_path: &str) -> Result<Self, LogError> {
        let (text, source) = like::text_of(name_or_path, Path::new(""))?;
        Self::from_toml(&text, &source)
    }

    /// Whether a file may lack the columns of `block` that the layout names: a layout of one's own names what the file
    /// has, while one that comes with the program, or the part of another that is inherited from it, may name more.
    pub(super) fn may_lack(&self, block: Block) -> bool {
        let is_inherited =
            |below: &Self| below.columns(block) == self.columns(block) && below.may_lack(block);
        built_in(&self.source).is_some() || self.below.as_deref().is_some_and(is_inherited)
    }

    /// Parses the text of a layout; `source` is its file, or its name in messages.
    ///
    /// # Errors
    /// [`LogError::Layout`] with what is wrong.
    pub fn from_toml(text: &str, source: &str) -> Result<Self, LogError> {
        let layout = like::overlaid(text, source)?;
        layout.checked_by(&Self::check)?;
        Ok(layout)
    }

    /// Checks that the layout fits an arm with this many joints.
    pub(super) fn check_for(&self, joints: usize) -> Result<(), LogError> {
        self.checked_by(&|layout: &Self| layout.joints.check_for(joints))
    }

    /// Checks that the layout has a drive gain for each joint of an arm with this many joints, even if no current is
    /// read.
    pub(super) fn check_gains_for(&self, joints: usize) -> Result<(), LogError> {
        self.checked_by(&|layout: &Self| match layout.drive_gain_nm_a.as_ref().map(Vec::len) {
            Some(found) if found != joints => Err(LayoutFault::GainCount { found, joints }),
            _ => Ok(()),
        })
    }

    /// Torque and current; the one that is read where a file has both is the first.
    pub(super) fn efforts(&self) -> [Block; 2] {
        match self.overrides(&CURRENT_COLUMNS, &TORQUE_COLUMNS) {
            true => [Block::Current, Block::Torque],
            false => [Block::Torque, Block::Current],
        }
    }

    /// What the layout says about currents although it only inherits the torques: whoever wrote it does not expect that
    /// torques are read.
    pub(super) fn about_currents(&self) -> Vec<&'static str> {
        let said: [(&[&str], &str); 3] = [
            (&["drive_gain_nm_a"], "drive_gain_nm_a"),
            (&["units", "current"], "current under [units]"),
            (&CURRENT_COLUMNS, "current under [columns]"),
        ];
        said.into_iter()
            .filter(|(key, _)| self.overrides(key, &TORQUE_COLUMNS))
            .map(|(_, words)| words)
            .collect()
    }

    /// The convention of the layout for the joints of an arm with this many joints.
    pub(super) fn counting(&self, joints: usize) -> Counting {
        self.joints.counting(joints, self.units.q)
    }

    /// Returns the text of a layout that reads files as this one does and then applies `counting` to the joints as this
    /// layout counts them. `counting` must have as many joints as a log read with this layout.
    pub(crate) fn recounted(&self, counting: &Counting) -> String {
        let earlier = self.counting(counting.motion().len());
        let mut both = counting.of_what_is_read_with(&earlier);
        both.leave_out_whole_turns();
        let joints = Joints::of(&both, self.units.q).lines();
        let name = format!("{} recounted", self.name);
        format!("name = {name:?}\nlike = {:?}\n\n{joints}", self.source)
    }

    pub(super) fn columns(&self, block: Block) -> Option<&Columns> {
        self.columns.of(block)
    }

    fn check(&self) -> Result<(), LayoutFault> {
        for (j, &value) in self.drive_gain_nm_a.iter().flatten().enumerate() {
            if !(value > 0.0 && value.is_finite()) {
                return Err(LayoutFault::Gain { joint: j + 1, value });
            }
        }
        if self.decimal_comma && self.delimiter == DelimiterChoice::Comma {
            return Err(LayoutFault::CommaTwice);
        }
        self.joints.check(self.units.q)?;
        let has = |block| self.columns(block).is_some();
        if has(Block::TimeNanoseconds) && self.units.time == TimeUnit::Ns {
            return Err(LayoutFault::NanosecondsTwice);
        }
        check_blocks(has, "[columns]")?;
        for block in Block::ALL {
            if let Some(columns) = self.columns(block) {
                columns.check(block, self.header)?;
            }
        }
        if self.header != self.widths.is_empty() {
            return Err(LayoutFault::Widths { header: self.header, widths: self.widths.len() });
        }
        for (i, width) in self.widths.iter().enumerate() {
            self.check_width(width)?;
            if self.widths[..i].iter().any(|w| w.fields == width.fields) {
                return Err(LayoutFault::SameWidth { fields: width.fields });
            }
        }
        Ok(())
    }

    fn check_width(&self, width: &Width) -> Result<(), LayoutFault> {
        let place = format!("the [[width]] of {} fields", width.fields);
        check_blocks(|block| width.blocks.contains(&block), &place)?;
        let mut owners: Vec<(usize, Block)> = Vec::new();
        for &block in &width.blocks {
            let numbers = self.columns(block).and_then(Columns::numbers).ok_or_else(|| {
                LayoutFault::MissingBlock { block: block.key(), place: "[columns]".to_owned() }
            })?;
            if numbers.end > width.fields {
                return Err(LayoutFault::BeyondWidth {
                    block: block.key(),
                    column: numbers.end,
                    fields: width.fields,
                });
            }
            for column in numbers {
                if let Some((_, first)) = owners.iter().find(|(c, _)| *c == column) {
                    return Err(LayoutFault::Overlap {
                        column: column + 1,
                        first: first.key(),
                        second: block.key(),
                    });
                }
                owners.push((column, block));
            }
        }
        Ok(())
    }
}

/// Checks that `has` contains the blocks that every log needs: time, angles and an effort.
fn check_blocks(has: impl Fn(Block) -> bool, place: &str) -> Result<(), LayoutFault> {
    let missing = [Block::Time, Block::Q]
        .into_iter()
        .find(|&block| !has(block))
        .or_else(|| (!has(Block::Current) && !has(Block::Torque)).then_some(Block::Current));
    match missing {
        Some(block) => {
            Err(LayoutFault::MissingBlock { block: block.key(), place: place.to_owned() })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALID: &str = r#"
        name = "mine"
        header = false
        [columns]
        time = 1
        q = { first = 2, last = 3 }
        qd = { first = 4, last = 5 }
        torque = { first = 6, last = 7 }
        [[width]]
        fields = 7
        blocks = ["time", "q", "qd", "torque"]
    "#;

    #[test]
    fn a_file_without_header_is_not_sent_to_a_layout_with_one() {
        let message = LogError::NoHeader {
            file: "x.csv".to_owned(),
            row: 1,
            value: "0.5".to_owned(),
            layout: "armid".to_owned(),
        };
        let message = message.to_string();
        assert!(
            message.contains(
                "--layout (ros2_joint_states, ur10e_innopolis, ur10e_innopolis_author or"
            ),
            "{message}"
        );
    }

    #[test]
    fn an_extension_in_capitals_is_one() {
        let file = tempfile::Builder::new().suffix(".TOML").tempfile().unwrap();
        std::fs::write(file.path(), VALID).unwrap();
        assert_eq!(Layout::load(file.path().to_str().unwrap()).unwrap().name, "mine");
    }

    /// The commented example uses everything that a layout can state.
    #[test]
    fn the_example_is_whole_and_valid() {
        let text = include_str!("../../../layouts/example.toml");
        let layout = Layout::from_toml(text, "example.toml").unwrap();
        assert!(Block::ALL.iter().all(|block| layout.columns(*block).is_some()));
        assert_eq!(layout.units.factor(Block::Time), Some(1e-3));
        assert_ne!(layout.joints, Joints::default());
    }

    fn fault_of(from: &str, to: &str) -> String {
        assert!(VALID.contains(from));
        Layout::from_toml(&VALID.replacen(from, to, 1), "mine.toml").unwrap_err().to_string()
    }

    #[test]
    fn every_built_in_layout_is_valid_and_has_its_own_name() {
        for name in built_in_layout_names() {
            assert_eq!(Layout::load(name).unwrap().name, name);
        }
        assert_eq!(Layout::default().name, "armid");
        Layout::from_toml(VALID, "mine.toml").unwrap();
    }

    #[test]
    fn the_documented_example_is_valid() {
        let text = "name = \"my_robot\"\ndelimiter = \"semicolon\"\nheader = true\ndecimal_comma = true\n\
            drive_gain_nm_a = [12.0, 12.0, 9.8, 10.7, 10.7, 10.7]\n[units]\ntime = \"ms\"\nq = \"deg\"\n\
            current = \"mA\"\n[columns]\ntime = \"clock\"\nq = \"angle {1}\"\n\
            qd = [\"w1\", \"w2\", \"w3\", \"w4\", \"w5\", \"w6\"]\ncurrent = { first = 14, last = 19 }\n";
        let layout = Layout::from_toml(text, "doc").unwrap();
        assert_eq!(layout.columns(Block::Q).unwrap().name(0).unwrap(), "angle 1");
        assert_eq!(layout.columns(Block::Current).unwrap().numbers().unwrap(), 13..19);
        assert_eq!(layout.units.factor(Block::Time), Some(1e-3));
    }

    #[test]
    fn each_fault_is_named_with_its_value() {
        for (from, to, parts) in [
            ("header = false", "header = false\nheadr = 1", vec!["headr"]),
            ("header = false", "header = true", vec!["header = true", "1 [[width]]"]),
            ("header = false", "header = false\ndelimiter = \"pipe\"", vec!["pipe"]),
            ("last = 5", "last = 3", vec!["qd", "3"]),
            ("time = 1\n", "time = 0\n", vec!["time", "count from 1"]),
            ("time = 1\n", "time = \"t\"\n", vec!["time", "column numbers"]),
            ("time = 1\n", "time = 1.5\n", vec!["columns are a name"]),
            ("first = 4", "first = 3", vec!["column 3", "\"q\"", "\"qd\""]),
            ("fields = 7", "fields = 6", vec!["torque", "column 7", "6 fields"]),
            (", \"torque\"]", "]", vec!["current", "[[width]] of 7"]),
            ("\"torque\"]", "\"current\"]", vec!["current", "[columns]"]),
            ("torque = { first = 6, last = 7 }", "", vec!["current", "[columns]"]),
            (
                "header = false",
                "header = false\ndrive_gain_nm_a = [1.0, -2.0]",
                vec!["joint 2", "-2"],
            ),
            (
                "header = false",
                "header = false\ndecimal_comma = true\ndelimiter = \"comma\"",
                vec!["decimal_comma"],
            ),
        ] {
            let message = fault_of(from, to);
            for part in parts {
                assert!(message.contains(part), "{to}: {message}");
            }
        }
    }

    #[test]
    fn an_unknown_layout_lists_those_built_in() {
        let message = Layout::load("ur10").unwrap_err().to_string();
        assert!(
            message.contains("\"ur10\"") && message.contains("ur10e_innopolis_author"),
            "{message}"
        );
        let message = Layout::load("missing.toml").unwrap_err().to_string();
        assert!(message.contains("missing.toml"), "{message}");
    }
}
