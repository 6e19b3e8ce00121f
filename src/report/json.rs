//! JSON documents: what was computed, by which program, from which inputs.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::error::ReportError;
use crate::output::write_atomically;

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Path as the user gave it; in the document what Unicode has of it.
    #[serde(serialize_with = "as_text")]
    pub path: PathBuf,
    /// SHA-256 of its contents, 64 lowercase hexadecimal digits.
    pub sha256: String,
}

fn as_text<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

impl Input {
    /// Reads the file for its checksum.
    pub fn of(path: &Path) -> Result<Self, ReportError> {
        Ok(Self { path: path.to_owned(), sha256: sha256_of_file(path)? })
    }
}

/// Where a document comes from: enough to make it again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Version of this program.
    pub version: String,
    /// The command line.
    pub command: String,
    /// Seed of the random numbers; `None` where none were drawn.
    pub seed: Option<u64>,
    /// Files read.
    pub inputs: Vec<Input>,
}

impl Program {
    /// This program as it was started.
    pub fn started(seed: Option<u64>, inputs: Vec<Input>) -> Self {
        let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
        Self::new(words, seed, inputs)
    }

    /// This program, run as `command` (the words of the command line; the program's own folder is no part of
    /// what has to be repeated).
    pub fn new(
        command: impl IntoIterator<Item = impl AsRef<str>>,
        seed: Option<u64>,
        inputs: Vec<Input>,
    ) -> Self {
        let mut words: Vec<String> =
            command.into_iter().map(|word| quoted(word.as_ref())).collect();
        if let Some(program) = words.first_mut()
            && let Some((_, name)) = program.rsplit_once('/')
        {
            *program = name.to_owned();
        }
        Self { version: env!("CARGO_PKG_VERSION").into(), command: words.join(" "), seed, inputs }
    }
}

/// A word of a command line as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// A document: the schema and the program in front, then the fields of `body`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Document<'a, T> {
    /// Name and version of the format, such as `armid.identify/1`.
    pub schema: &'a str,
    /// Where it comes from.
    pub program: &'a Program,
    /// What was computed; a struct or map.
    #[serde(flatten)]
    pub body: &'a T,
}

impl<T: Serialize> Document<'_, T> {
    /// The document as indented JSON with a newline at its end. Numbers that are not finite are `null`.
    pub fn to_json(&self) -> Result<String, ReportError> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|source| ReportError::Json { schema: self.schema.to_owned(), source })?;
        Ok(text + "\n")
    }

    /// Writes the document as a whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let text = self.to_json()?;
        Ok(write_atomically(path, |file| file.write_all(text.as_bytes()))?)
    }
}

/// SHA-256 of a file's contents in lowercase hexadecimal, read piece by piece.
pub fn sha256_of_file(path: &Path) -> Result<String, ReportError> {
    let read = |source| ReportError::Read { path: path.to_owned(), source };
    let mut file = File::open(path).map_err(read)?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer).map_err(read)? {
            0 => break,
            length => hasher.update(&buffer[..length]),
        }
    }
    Ok(hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Body {
        sigma: [f64; 3],
        period_s: Option<f64>,
    }

    #[test]
    fn numbers_that_are_not_finite_are_null() {
        let program = Program::new(["armid", "identify", "my log.csv"], Some(7), Vec::new());
        let body =
            Body { sigma: [1.5, f64::NAN, f64::INFINITY], period_s: Some(f64::NEG_INFINITY) };
        let text = Document { schema: "armid.identify/1", program: &program, body: &body }
            .to_json()
            .unwrap();
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["schema"], "armid.identify/1");
        assert_eq!(value["program"]["command"], "armid identify 'my log.csv'");
        assert_eq!(value["program"]["seed"], 7);
        assert_eq!(value["sigma"], serde_json::json!([1.5, null, null]));
        assert!(value["period_s"].is_null());
        assert!(text.starts_with("{\n  \"schema\"") && text.ends_with("}\n"));
    }

    #[test]
    fn the_checksum_is_that_of_the_standard() {
        // FIPS 180-4, the example for the message "abc".
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "abc").unwrap();
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256_of_file(file.path()).unwrap(), expected);
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = sha256_of_file(Path::new("no/such.csv")).unwrap_err().to_string();
        assert!(error.starts_with("no/such.csv: "), "{error}");
    }
}
