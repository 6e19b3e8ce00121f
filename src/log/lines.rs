//! Reads the lines of a text file with bounded memory, numbers them as in the file, and computes the file's SHA-256.

use std::io::{BufRead, BufReader, Read};

use sha2::{Digest, Sha256};

use super::error::LogError;

/// Longest line accepted, bytes. It has room for 200 numbers of 300 digits, the length at which an uninitialised double
/// prints.
const LINE_LIMIT: usize = 1 << 16;
/// Number of leading bytes that are inspected to tell text from binary files.
const HEAD: usize = 1 << 13;

/// One line without its line end.
#[derive(Debug, Clone, Default)]
pub(super) struct Line {
    /// Number of the line in the file, from 1.
    pub(super) row: usize,
    /// The bytes of the line.
    pub(super) bytes: Vec<u8>,
    /// Whether the line was terminated by a line end.
    pub(super) ended: bool,
}

/// Reads a source line by line.
///
/// A line ends with `\n`; carriage returns directly before it belong to the line end (Windows writes one, some
/// recorders two). If the first 8 kB contain `\r` but no `\n`, lines end with `\r`.
pub(super) struct Lines<R> {
    source: BufReader<Hashing<R>>,
    file: String,
    row: usize,
    end: u8,
}

impl<R: Read> Lines<R> {
    /// Inspects the first bytes: skips a byte order mark and rejects a source that is not text.
    pub(super) fn new(source: R, file: &str) -> Result<Self, LogError> {
        let source = Hashing { source, hash: Sha256::new() };
        let source = BufReader::with_capacity(1 << 16, source);
        let mut lines = Self { source, file: file.to_owned(), row: 0, end: b'\n' };
        let head = lines.fill()?;
        let head = &head[..head.len().min(HEAD)];
        let utf16 = head.starts_with(&[0xff, 0xfe]) || head.starts_with(&[0xfe, 0xff]);
        let binary = if utf16 { Some(0) } else { head.iter().position(|&b| b == 0) };
        if let Some(byte) = binary {
            let value = head[byte];
            return Err(LogError::NotText { file: lines.file, byte: byte + 1, value, utf16 });
        }
        let carriage_returns = head.contains(&b'\r') && !head.contains(&b'\n');
        let mark = head.starts_with(&[0xef, 0xbb, 0xbf]);
        if carriage_returns {
            lines.end = b'\r';
        }
        if mark {
            lines.source.consume(3);
        }
        Ok(lines)
    }

    /// Reads the next line that is not blank into `line`; returns `false` at the end of the source.
    pub(super) fn next_into(&mut self, line: &mut Line) -> Result<bool, LogError> {
        loop {
            line.bytes.clear();
            if !self.take_line(line)? {
                return Ok(false);
            }
            if line.bytes.iter().any(|b| !b.is_ascii_whitespace()) {
                return Ok(true);
            }
        }
    }

    /// Number of the line read last.
    pub(super) fn row(&self) -> usize {
        self.row
    }

    /// SHA-256 of all bytes read so far, in hexadecimal.
    pub(super) fn sha256(self) -> String {
        hexadecimal(self.source.into_inner().hash)
    }

    fn fill(&mut self) -> Result<&[u8], LogError> {
        self.source.fill_buf().map_err(|source| LogError::Read { file: self.file.clone(), source })
    }

    fn take_line(&mut self, line: &mut Line) -> Result<bool, LogError> {
        let (row, end) = (self.row + 1, self.end);
        loop {
            let buffer = self.fill()?;
            if buffer.is_empty() {
                line.ended = false;
                if line.bytes.is_empty() {
                    return Ok(false);
                }
                break;
            }
            let stop = buffer.iter().position(|&b| b == end);
            let length = stop.unwrap_or(buffer.len());
            line.bytes.extend_from_slice(&buffer[..length]);
            self.source.consume(length + usize::from(stop.is_some()));
            if line.bytes.len() > LINE_LIMIT {
                return Err(LogError::LineTooLong {
                    file: self.file.clone(),
                    row,
                    limit: LINE_LIMIT,
                });
            }
            if stop.is_some() {
                line.ended = true;
                break;
            }
        }
        while line.bytes.last() == Some(&b'\r') {
            line.bytes.pop();
        }
        self.row = row;
        line.row = row;
        Ok(true)
    }
}

/// A reader that hashes all bytes passing through it.
struct Hashing<R> {
    source: R,
    hash: Sha256,
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let length = self.source.read(buffer)?;
        self.hash.update(&buffer[..length]);
        Ok(length)
    }
}

/// The digest as 64 hexadecimal digits.
pub(super) fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
