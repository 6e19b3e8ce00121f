//! Elements of an MJCF: their attributes and their places in the file.

use std::collections::{BTreeMap, HashSet};
use std::rc::Rc;

use super::fault::MjcfFault;

/// Attributes by name, as written.
pub(super) type Attributes = BTreeMap<String, String>;

/// Attributes that give an orientation; an element has at most one of them.
pub(super) const ORIENTATIONS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// Largest number that is accepted: no length, mass or torque of an arm exceeds it, and products of a few such numbers
/// are finite.
const LARGEST: f64 = 1e15;

/// An element with everything in it.
#[derive(Debug, Clone)]
pub(super) struct Element {
    /// Its tag.
    pub tag: String,
    /// Its attributes.
    pub attributes: Attributes,
    /// The elements in it, with those of included files in the place of `<include>`.
    pub children: Vec<Element>,
    /// The included file that contains it; `None` for the main file.
    pub file: Option<Rc<str>>,
    /// Its line in the file, from 1.
    pub line: usize,
}

/// Adds those `defaults` that are not given. A default orientation is added only if no attribute gives an orientation.
pub(super) fn fill(given: &mut Attributes, defaults: &Attributes) {
    let is_orientation = |name: &str| ORIENTATIONS.contains(&name);
    let is_turned = given.keys().any(|name| is_orientation(name));
    for (name, value) in defaults {
        if !(is_turned && is_orientation(name)) {
            given.entry(name.clone()).or_insert_with(|| value.clone());
        }
    }
}

impl Element {
    /// An attribute as written.
    pub(super) fn text(&self, attribute: &str) -> Option<&str> {
        self.attributes.get(attribute).map(String::as_str)
    }

    /// The elements with this tag directly in it.
    pub(super) fn each<'a>(&'a self, tag: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.tag == tag)
    }

    /// The combined attributes of all elements with this tag directly in it; a later element overrides an earlier one.
    pub(super) fn settings(&self, tag: &str) -> Option<Element> {
        let sections: Vec<&Element> = self.each(tag).collect();
        let mut settings = (*sections.last()?).clone();
        for earlier in sections.iter().rev().skip(1) {
            fill(&mut settings.attributes, &earlier.attributes);
        }
        Some(settings)
    }

    /// The line for messages, such as `line 12`, with the file if it is not the main one.
    pub(super) fn line(&self) -> String {
        match &self.file {
            Some(file) => format!("{file} line {}", self.line),
            None => format!("line {}", self.line),
        }
    }

    /// The place for messages, such as `line 12: joint "elbow"`.
    pub(super) fn place(&self) -> String {
        match self.text("name") {
            Some(name) => format!("{}: {} \"{name}\"", self.line(), self.tag),
            None => format!("{}: <{}>", self.line(), self.tag),
        }
    }

    /// A mandatory attribute as written.
    pub(super) fn required(&self, attribute: &'static str) -> Result<&str, MjcfFault> {
        self.text(attribute).ok_or_else(|| MjcfFault::Missing { place: self.place(), attribute })
    }

    /// An attribute of N numbers.
    pub(super) fn numbers<const N: usize>(
        &self,
        attribute: &'static str,
    ) -> Result<Option<[f64; N]>, MjcfFault> {
        let values = self.up_to(attribute, N)?;
        values.map(|values| self.exactly(attribute, values)).transpose()
    }

    /// A mandatory attribute of N numbers.
    pub(super) fn required_numbers<const N: usize>(
        &self,
        attribute: &'static str,
    ) -> Result<[f64; N], MjcfFault> {
        self.required(attribute)?;
        // `required` has found it.
        Ok(self.numbers(attribute)?.unwrap_or([0.0; N]))
    }

    /// An attribute of one number.
    pub(super) fn number(&self, attribute: &'static str) -> Result<Option<f64>, MjcfFault> {
        Ok(self.numbers::<1>(attribute)?.map(|[value]| value))
    }

    /// An attribute of one number that is at least 0; 0 if it is missing.
    pub(super) fn not_negative(&self, attribute: &'static str) -> Result<f64, MjcfFault> {
        let value = self.number(attribute)?.unwrap_or(0.0);
        self.refuse_negative(attribute, value)?;
        Ok(value)
    }

    /// Refuses a value below zero.
    pub(super) fn refuse_negative(
        &self,
        attribute: &'static str,
        value: f64,
    ) -> Result<(), MjcfFault> {
        if value >= 0.0 {
            return Ok(());
        }
        Err(MjcfFault::Negative { place: self.place(), attribute, value })
    }

    /// An attribute of one to `most` numbers.
    pub(super) fn up_to(
        &self,
        attribute: &'static str,
        most: usize,
    ) -> Result<Option<Vec<f64>>, MjcfFault> {
        let Some(text) = self.text(attribute) else { return Ok(None) };
        let mut values = Vec::new();
        for word in text.split_whitespace() {
            let Ok(value) = word.parse::<f64>() else {
                let word = word.to_owned();
                return Err(MjcfFault::NoNumber { place: self.place(), attribute, word });
            };
            if value.is_nan() || value.abs() > LARGEST {
                return Err(MjcfFault::NotFinite { place: self.place(), attribute, value });
            }
            values.push(value);
        }
        if values.is_empty() || values.len() > most {
            return Err(self.count(attribute, values.len(), most));
        }
        Ok(Some(values))
    }

    fn exactly<const N: usize>(
        &self,
        attribute: &'static str,
        values: Vec<f64>,
    ) -> Result<[f64; N], MjcfFault> {
        values.try_into().map_err(|values: Vec<f64>| self.count(attribute, values.len(), N))
    }

    fn count(&self, attribute: &'static str, found: usize, needed: usize) -> MjcfFault {
        MjcfFault::Count { place: self.place(), attribute, found, needed }
    }

    /// An attribute that is `true` or `false`; `None` if it is `auto` or missing.
    pub(super) fn switch(&self, attribute: &'static str) -> Result<Option<bool>, MjcfFault> {
        match self.text(attribute) {
            None | Some("auto") => Ok(None),
            Some("true") => Ok(Some(true)),
            Some("false") => Ok(Some(false)),
            Some(value) => Err(self.keyword(attribute, value, "true, false, auto")),
        }
    }

    /// The fault for a value that is none of `choice`.
    pub(super) fn keyword(
        &self,
        attribute: &'static str,
        value: &str,
        choice: &'static str,
    ) -> MjcfFault {
        let value = value.to_owned();
        MjcfFault::Keyword { place: self.place(), attribute, value, choice }
    }

    /// The one of `attributes` that the element has; two of them are a contradiction.
    pub(super) fn at_most_one(
        &self,
        attributes: &[&'static str],
    ) -> Result<Option<&'static str>, MjcfFault> {
        let mut given = attributes.iter().copied().filter(|name| self.text(name).is_some());
        match (given.next(), given.next()) {
            (Some(first), Some(second)) => {
                Err(MjcfFault::Both { place: self.place(), first, second })
            }
            (one, _) => Ok(one),
        }
    }

    /// Refuses a `joint` that is none of those that the file has `named`.
    pub(super) fn refuse_unknown_joint(
        &self,
        joint: &str,
        named: &HashSet<String>,
    ) -> Result<(), MjcfFault> {
        if named.contains(joint) {
            return Ok(());
        }
        Err(MjcfFault::UnknownJoint { place: self.place(), joint: joint.to_owned() })
    }

    /// The fault for an element that only MuJoCo can process, so that the file must be compiled there first.
    pub(super) fn unread(&self, what: &'static str) -> MjcfFault {
        MjcfFault::Unread { place: self.place(), what }
    }
}
