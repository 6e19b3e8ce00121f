//! The elements of an MJCF: their attributes, and where they stand.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::fault::MjcfFault;

/// Attributes by name, as written.
pub(super) type Attributes = BTreeMap<String, String>;

/// Ways to give an orientation; an element has one of them or none.
pub(super) const ORIENTATIONS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// No length, mass or torque of an arm is beyond it, and products of a few of such numbers are still finite.
const LARGEST: f64 = 1e15;

/// An element with all that is in it.
#[derive(Debug, Clone)]
pub(super) struct Element {
    /// Its tag.
    pub tag: String,
    /// Its attributes.
    pub attributes: Attributes,
    /// The elements in it, those of included files in the place of `<include>`.
    pub children: Vec<Element>,
    /// The included file that it is from; `None` for the main file.
    pub file: Option<Rc<str>>,
    /// Its line there, from 1 on.
    pub line: usize,
}

/// Takes over `defaults` of what is not given: of an orientation only where none is given in any way.
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

    /// The elements of one tag directly in it.
    pub(super) fn each<'a>(&'a self, tag: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.tag == tag)
    }

    /// What all elements of one tag directly in it say together: of two that give an attribute the later one counts.
    pub(super) fn settings(&self, tag: &str) -> Option<Element> {
        let sections: Vec<&Element> = self.each(tag).collect();
        let mut settings = (*sections.last()?).clone();
        for earlier in sections.iter().rev().skip(1) {
            fill(&mut settings.attributes, &earlier.attributes);
        }
        Some(settings)
    }

    /// Such as `line 12`, with the file where it is not the main one.
    pub(super) fn line(&self) -> String {
        match &self.file {
            Some(file) => format!("{file} line {}", self.line),
            None => format!("line {}", self.line),
        }
    }

    /// Such as `line 12: joint "elbow"`, in messages.
    pub(super) fn place(&self) -> String {
        match self.text("name") {
            Some(name) => format!("{}: {} \"{name}\"", self.line(), self.tag),
            None => format!("{}: <{}>", self.line(), self.tag),
        }
    }

    /// An attribute that has to be there, as written.
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

    /// An attribute of N numbers that has to be there.
    pub(super) fn required_numbers<const N: usize>(
        &self,
        attribute: &'static str,
    ) -> Result<[f64; N], MjcfFault> {
        self.required(attribute)?;
        // It is there.
        Ok(self.numbers(attribute)?.unwrap_or([0.0; N]))
    }

    /// An attribute of one number.
    pub(super) fn number(&self, attribute: &'static str) -> Result<Option<f64>, MjcfFault> {
        Ok(self.numbers::<1>(attribute)?.map(|[value]| value))
    }

    /// An attribute of one number from 0 on; 0 where it is not there.
    pub(super) fn not_negative(&self, attribute: &'static str) -> Result<f64, MjcfFault> {
        let value = self.number(attribute)?.unwrap_or(0.0);
        self.refuse_negative(attribute, value)?;
        Ok(value)
    }

    /// Refuses what must not be below zero.
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

    /// An attribute that is `true` or `false`; `None` where it is `auto` or not there.
    pub(super) fn switch(&self, attribute: &'static str) -> Result<Option<bool>, MjcfFault> {
        match self.text(attribute) {
            None | Some("auto") => Ok(None),
            Some("true") => Ok(Some(true)),
            Some("false") => Ok(Some(false)),
            Some(value) => Err(self.keyword(attribute, value, "true, false, auto")),
        }
    }

    /// A word that is none of `choice`.
    pub(super) fn keyword(
        &self,
        attribute: &'static str,
        value: &str,
        choice: &'static str,
    ) -> MjcfFault {
        let value = value.to_owned();
        MjcfFault::Keyword { place: self.place(), attribute, value, choice }
    }

    /// The one of `attributes` that it has; two of them contradict each other.
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

    /// What is missing where a file would have to be compiled first.
    pub(super) fn unread(&self, what: &'static str) -> MjcfFault {
        MjcfFault::Unread { place: self.place(), what }
    }
}
