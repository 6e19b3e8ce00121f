//! Input files that are text.

use std::io::{Error, ErrorKind, Result};
use std::path::Path;

/// The text of a file, which must be UTF-8.
pub fn read_text(path: impl AsRef<Path>) -> Result<String> {
    std::fs::read_to_string(path).map_err(|fault| match fault.kind() {
        // The standard library does not say what to do about it.
        ErrorKind::InvalidData => {
            Error::new(fault.kind(), "it is not UTF-8 text; save it as UTF-8")
        }
        _ => fault,
    })
}

/// `text` without the byte order mark that some editors and spreadsheets put in front.
pub fn without_mark(text: &str) -> &str {
    text.trim_start_matches('\u{feff}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_counts_in_front_alone() {
        assert_eq!(without_mark("\u{feff}a\u{feff}"), "a\u{feff}");
        assert_eq!(without_mark("a"), "a");
    }

    #[test]
    fn a_text_in_another_encoding_is_to_be_saved_again() {
        let file = tempfile::NamedTempFile::new().unwrap();
        // ü in Latin-1.
        std::fs::write(file.path(), b"name = \"f\xfcr\"").unwrap();
        let message = read_text(file.path()).unwrap_err().to_string();
        assert_eq!(message, "it is not UTF-8 text; save it as UTF-8");
        std::fs::write(file.path(), "für").unwrap();
        assert_eq!(read_text(file.path()).unwrap(), "für");
        let missing = read_text("no/such.toml").unwrap_err();
        assert_eq!(missing.kind(), ErrorKind::NotFound);
    }
}
