//! Entries that a study has worked out, by their family, site and shape.
//!
//! A search for the best shape begins where the one before it began, and the shapes it looks at first are the same.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::candidates::Shape;
use super::study::Entry;

/// Bytes of columns that are kept at most: what comes later is worked out each time.
const MOST_BYTES: usize = 64 << 20;

/// A family, a site and a shape.
type Key = (usize, Option<usize>, usize, u64);

/// Entries, and `None` for those that the null model absorbs.
#[derive(Default)]
pub struct Memory {
    known: Mutex<Known>,
}

#[derive(Default)]
struct Known {
    entries: HashMap<Key, Option<Arc<Entry>>>,
    bytes: usize,
}

impl Memory {
    /// The entry of `family` at `site` with `shape`, by `make` if it is not known.
    pub fn entry(
        &self,
        (family, site, shape): (usize, Option<usize>, Shape),
        make: impl FnOnce() -> Option<Entry>,
    ) -> Option<Entry> {
        let key = (family, site, shape.variant, shape.value.to_bits());
        // Entries are put in whole: a panic elsewhere leaves none half made.
        let lock = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let known = lock().entries.get(&key).cloned();
        if let Some(entry) = known {
            return entry.map(|entry| (*entry).clone());
        }
        let made = make();
        let bytes = made.as_ref().map_or(0, Entry::bytes);
        let kept = made.clone().map(Arc::new);
        let mut known = lock();
        if known.bytes + bytes <= MOST_BYTES && known.entries.insert(key, kept).is_none() {
            known.bytes += bytes;
        }
        made
    }
}
