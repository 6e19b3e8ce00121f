//! A cache of the entries that a study has computed, and of the directions in which their laws may be off, keyed by
//! family, site and shape.
//!
//! It pays because a search for the best shape starts where the search before it started, so that both evaluate the
//! same shapes first, and because a cause is looked at beside every other one.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::candidates::Shape;
use super::image::Image;
use super::study::{Entry, Place};

/// Upper limit of the bytes of columns that are kept of a place. What is beyond it is computed anew each time. Places
/// have limits of their own because several are searched at once: with a common one, which columns are kept would
/// depend on how the threads run, and the last bit of a column depends on those that are computed with it.
const MOST_BYTES: usize = 4 << 20;

/// A place, a variant of the shape, and the bits of the shape's value.
type Key = (Place, usize, u64);

fn key(place: Place, shape: &Shape) -> Key {
    (place, shape.variant, shape.value.to_bits())
}

/// The cache itself.
#[derive(Default)]
pub struct Memory {
    contents: Mutex<Contents>,
}

/// What the cache holds.
#[derive(Default)]
struct Contents {
    /// `None` for shapes whose columns the null model absorbs.
    entries: HashMap<Key, Option<Entry>>,
    loose: HashMap<Key, Arc<[Image]>>,
    bytes: HashMap<Place, usize>,
}

impl Contents {
    /// Whether there is room for `images` of `place`, which is then taken.
    fn takes(&mut self, place: Place, images: &[Image]) -> bool {
        let bytes: usize = images.iter().map(Image::bytes).sum();
        let taken = self.bytes.entry(place).or_default();
        let has_room = *taken + bytes <= MOST_BYTES;
        *taken += if has_room { bytes } else { 0 };
        has_room
    }
}

impl Memory {
    /// Values are inserted whole or not at all, so a lock poisoned by a panic elsewhere still guards valid ones.
    fn lock(&self) -> MutexGuard<'_, Contents> {
        self.contents.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The entries at `place` with these `shapes`. Those that are not in the cache are computed by `make`, all at once.
    pub fn entries(
        &self,
        place: Place,
        shapes: &[Shape],
        make: impl FnOnce(&[Shape]) -> Vec<Option<Entry>>,
    ) -> Vec<Option<Entry>> {
        let known: Vec<Option<Option<Entry>>> = {
            let known = self.lock();
            shapes.iter().map(|shape| known.entries.get(&key(place, shape)).cloned()).collect()
        };
        let pairs = shapes.iter().zip(&known);
        let unknown: Vec<Shape> =
            pairs.filter(|(_, known)| known.is_none()).map(|(shape, _)| *shape).collect();
        let made = if unknown.is_empty() { Vec::new() } else { make(&unknown) };
        let mut cache = self.lock();
        for (shape, made) in unknown.iter().zip(&made) {
            let key = key(place, shape);
            if !cache.entries.contains_key(&key)
                && cache.takes(place, made.as_ref().map_or(&[], |entry| &entry.images))
            {
                cache.entries.insert(key, made.clone());
            }
        }
        let mut made = made.into_iter();
        known.into_iter().map(|known| known.unwrap_or_else(|| made.next().flatten())).collect()
    }

    /// The directions in which the law at `place` may be off at this `shape`, computed by `make` if they are not in the
    /// cache.
    pub fn loose(
        &self,
        place: Place,
        shape: Shape,
        make: impl FnOnce() -> Vec<Image>,
    ) -> Arc<[Image]> {
        let key = key(place, &shape);
        let known = self.lock().loose.get(&key).cloned();
        known.unwrap_or_else(|| {
            let made: Arc<[Image]> = make().into();
            let mut cache = self.lock();
            if !cache.loose.contains_key(&key) && cache.takes(place, &made) {
                cache.loose.insert(key, Arc::clone(&made));
            }
            made
        })
    }
}
