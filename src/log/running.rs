//! Numbers that run on: what is added at a row holds for all rows behind it.

use std::ops::Range;

/// Numbers of all rows, to which something is added from a row on. Later rows get it when they are looked at, so that
/// many additions to a long log take no time.
pub(super) struct Running {
    values: Vec<f64>,
    /// Rows before this one have got what was added.
    known: usize,
    /// What the others have not got yet.
    ahead: f64,
}

impl Running {
    pub(super) fn new(values: Vec<f64>) -> Self {
        Self { values, known: 0, ahead: 0.0 }
    }

    /// The numbers of these rows.
    pub(super) fn of(&mut self, rows: Range<usize>) -> &[f64] {
        for value in &mut self.values[self.known.min(rows.end)..rows.end] {
            *value += self.ahead;
        }
        self.known = self.known.max(rows.end);
        &self.values[rows]
    }

    /// Adds to the numbers of all rows `from` this one on.
    pub(super) fn add(&mut self, from: usize, what: f64) {
        self.of(from..from);
        for value in &mut self.values[from..self.known] {
            *value += what;
        }
        self.ahead += what;
    }

    /// Begins again with the first row.
    pub(super) fn rewind(&mut self) {
        self.of(0..self.values.len());
        (self.known, self.ahead) = (0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is added in front of, among and behind the rows that were looked at arrives once, also after a rewind.
    #[test]
    fn later_rows_get_what_was_added() {
        let mut running = Running::new(vec![0.0; 6]);
        assert_eq!(running.of(1..3), [0.0, 0.0]);
        running.add(2, 1.0);
        running.add(4, 10.0);
        assert_eq!(running.of(1..5), [0.0, 1.0, 1.0, 11.0]);
        running.rewind();
        running.add(1, 100.0);
        assert_eq!(running.of(0..6), [0.0, 100.0, 101.0, 101.0, 111.0, 111.0]);
    }
}
