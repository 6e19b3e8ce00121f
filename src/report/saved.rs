//! Reads back what [`Document`](super::json::Document) wrote.

use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

use crate::input::{read_text, without_mark};

/// A file that is not a document of the expected schema.
#[derive(Debug, Error)]
#[error("{file}: {fault}")]
pub struct SavedError {
    /// The file.
    pub file: String,
    /// The reason.
    pub fault: SavedFault,
}

/// Why a document cannot be read back; see [`SavedError`].
#[derive(Debug, Error)]
pub enum SavedFault {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// The file is not JSON, or lacks a field.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// The file has a different schema.
    #[error("its schema is \"{found}\", expected \"{expected}\"")]
    OtherSchema {
        /// Schema of the file.
        found: String,
        /// Expected schema.
        expected: &'static str,
    },
}

#[derive(Deserialize)]
struct Head {
    schema: String,
}

/// Reads the fields of `T` from the document in `path`, which must have the given `schema`.
///
/// Errors: the file cannot be read, is not JSON, has a different schema, or lacks a field of `T`.
pub fn load<T: DeserializeOwned>(path: &Path, schema: &'static str) -> Result<T, SavedError> {
    let read = || -> Result<T, SavedFault> {
        let text = read_text(path)?;
        let text = without_mark(&text);
        let Head { schema: found } = serde_json::from_str(text)?;
        if found != schema {
            return Err(SavedFault::OtherSchema { found, expected: schema });
        }
        Ok(serde_json::from_str(text)?)
    };
    read().map_err(|fault| SavedError { file: path.display().to_string(), fault })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Sigma {
        sigma: f64,
    }

    fn loaded(text: &str) -> Result<f64, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let saved: Result<Sigma, _> = load(file.path(), "armid.sigma/2");
        saved.map(|saved| saved.sigma).map_err(|error| error.to_string())
    }

    /// A different schema is reported as such, whichever fields the document has.
    #[test]
    fn what_is_wrong_is_said() {
        assert_eq!(loaded(r#"{"schema": "armid.sigma/2", "sigma": 0.5, "n": 3}"#), Ok(0.5));
        let error = loaded(r#"{"schema": "armid.sigma/1", "s": 0.5}"#).unwrap_err();
        assert!(error.ends_with("its schema is \"armid.sigma/1\", expected \"armid.sigma/2\""));
        let error = loaded(r#"{"schema": "armid.sigma/2"}"#).unwrap_err();
        assert!(error.contains("missing field `sigma`"), "{error}");
        assert!(loaded("{}").unwrap_err().contains("missing field `schema`"));
        assert!(loaded("").unwrap_err().contains("EOF"));
        assert_eq!(loaded("\u{feff}{\"schema\": \"armid.sigma/2\", \"sigma\": 0.5}"), Ok(0.5));
    }
}
