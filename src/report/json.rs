//! JSON documents that name the program, the command and the inputs of a result.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::error::ReportError;
use crate::output::write_text;

/// An input file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Path as the user gave it. The document replaces bytes that are not valid Unicode.
    #[serde(serialize_with = "as_text")]
    pub path: PathBuf,
    /// SHA-256 of its contents, 64 lowercase hexadecimal digits.
    pub sha256: String,
}

fn as_text<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

impl Input {
    /// Reads the file and computes its checksum.
    pub fn of(path: &Path) -> Result<Self, ReportError> {
        Ok(Self { path: path.to_owned(), sha256: sha256_of_file(path)? })
    }
}

/// The origin of a document: enough to produce it again.
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
    /// This program with the command line it was started with.
    pub fn started(seed: Option<u64>, inputs: Vec<Input>) -> Self {
        let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
        Self::new(words, seed, inputs)
    }

    /// This program with the words of `command` as its command line. The folder of the program is dropped, because it
    /// does not matter for a repetition.
    pub fn new(
        command: impl IntoIterator<Item = impl AsRef<str>>,
        seed: Option<u64>,
        inputs: Vec<Input>,
    ) -> Self {
        let mut words = command.into_iter();
        let program = words.next().map(|word| quoted(name_of(word.as_ref())));
        let rest = words.map(|word| quoted(word.as_ref()));
        let words: Vec<String> = program.into_iter().chain(rest).collect();
        Self { version: env!("CARGO_PKG_VERSION").into(), command: words.join(" "), seed, inputs }
    }
}

/// The name of a file without its folder.
fn name_of(path: &str) -> &str {
    Path::new(path).file_name().and_then(OsStr::to_str).unwrap_or(path)
}

/// A word of a command line, quoted for a shell if necessary.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// A document: schema and program first, then the fields of `body`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Document<'a, T> {
    /// Name and version of the format, such as `armid.identify/1`.
    pub schema: &'a str,
    /// Its origin.
    pub program: &'a Program,
    /// The result; must serialise as a struct or map.
    #[serde(flatten)]
    pub body: &'a T,
}

impl<T: Serialize> Document<'_, T> {
    /// The document as indented JSON that ends in a newline. Non-finite numbers become `null`.
    pub fn to_json(&self) -> Result<String, ReportError> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|source| ReportError::Json { schema: self.schema.to_owned(), source })?;
        Ok(text + "\n")
    }

    /// Writes the document atomically.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        Ok(write_text(path, &self.to_json()?)?)
    }
}

/// SHA-256 of a file in lowercase hexadecimal. The file is read in blocks and never held in memory as a whole.
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
    fn the_program_is_named_without_its_folder() {
        for (program, name) in [
            ("/usr/bin/armid", "armid"),
            ("sp ace/armid", "armid"),
            ("bin/my armid", "'my armid'"),
            ("armid", "armid"),
        ] {
            let command = Program::new([program, "logs/my log.csv"], None, Vec::new()).command;
            assert_eq!(command, format!("{name} 'logs/my log.csv'"));
        }
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
