//! A cache of the entries that a study has computed, keyed by family, site and shape.
//!
//! It pays because a search for the best shape starts where the search before it started, so that both evaluate the
//! same shapes first.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::candidates::Shape;
use super::study::Entry;

/// Upper limit of the bytes of columns that are kept. An entry beyond it is computed anew each time.
const MOST_BYTES: usize = 64 << 20;

/// Family, site, variant of the shape, and the bits of the shape's value.
type Key = (usize, Option<usize>, usize, u64);

/// The cache itself. It holds `None` for shapes whose columns the null model absorbs.
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
    /// The entry of `family` at `site` with `shape`, computed by `make` if it is not in the cache.
    pub fn entry(
        &self,
        (family, site, shape): (usize, Option<usize>, Shape),
        make: impl FnOnce() -> Option<Entry>,
    ) -> Option<Entry> {
        let key = (family, site, shape.variant, shape.value.to_bits());
        // An entry is inserted whole or not at all, so a lock poisoned by a panic elsewhere still guards valid entries.
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
