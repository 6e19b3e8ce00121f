//! Searches for the best shapes of a law at one site, one for each of its variants.

use rayon::prelude::*;

use super::candidates::{Search, Shape};
use super::image::{Image, Span};
use super::peak::PeakSearch;
use super::statistic::Score;
use super::study::{Entry, Study};

/// A search for the best shape near an entry.
struct Refinement {
    best: (Entry, Score),
    /// `None` if there are no other shapes.
    search: Option<PeakSearch>,
}

impl Study<'_> {
    /// The best shapes near `entries`, which belong to one family at one site, and their scores. Entries that cannot be
    /// scored are left out.
    ///
    /// All searches go on in step, because some laws are computed for several shapes at hardly more than the price of
    /// one.
    pub fn refined(
        &self,
        entries: &[&Entry],
        others: &Span,
        residual: &Image,
    ) -> Vec<(Entry, Score)> {
        let Some((family, site)) = entries.first().map(|entry| entry.place()) else {
            return Vec::new();
        };
        let logarithmic = self.families[family].search() == Search::Logarithmic;
        let to = |value: f64| if logarithmic { value.ln() } else { value };
        let from = |scaled: f64| if logarithmic { scaled.exp() } else { scaled };
        let search = |entry: &&Entry| -> Option<Refinement> {
            let score = self.score(entry, others, residual)?;
            let known = [to(entry.shape.value), score.gain];
            let search = self.bracket(entry).map(|ends| PeakSearch::new(ends.map(to), known));
            Some(Refinement { best: ((*entry).clone(), score), search })
        };
        let mut refinements: Vec<Refinement> = entries.iter().filter_map(search).collect();
        loop {
            let (asking, shapes): (Vec<&mut Refinement>, Vec<Shape>) = refinements
                .iter_mut()
                .filter_map(|refinement| {
                    let value = from(refinement.search.as_ref()?.wanted()?);
                    let shape = Shape { value, ..refinement.best.0.shape };
                    Some((refinement, shape))
                })
                .unzip();
            if asking.is_empty() {
                break;
            }
            let scored = |entry: Option<Entry>| -> Option<(Entry, Score)> {
                let entry = entry?;
                let score = self.score(&entry, others, residual)?;
                Some((entry, score))
            };
            let found = self.entries_at(family, site, &shapes).into_par_iter().map(scored);
            let found: Vec<Option<(Entry, Score)>> = found.collect();
            asking.into_iter().zip(found).for_each(|(refinement, found)| refinement.tell(found));
        }
        refinements.into_iter().map(|refinement| refinement.best).collect()
    }

    /// The range in which the nonlinear parameter of `entry` is searched: from the next smaller starting shape to the
    /// next larger one, but never beyond the smallest and largest; or the half-width that the family prescribes.
    fn bracket(&self, entry: &Entry) -> Option<[f64; 2]> {
        if self.families[entry.family].search() == Search::None {
            return None;
        }
        let value = entry.shape.value;
        if let Some(half_width) = self.families[entry.family].half_width(&self.scene, entry.site) {
            return Some([value - half_width, value + half_width]);
        }
        // Starting shapes that the null model absorbs count as neighbours as well: a shape between one of them and this
        // one need not be absorbed.
        let family = &self.families[entry.family];
        let mut shapes = family.shapes(&self.scene, entry.site);
        shapes.extend(family.richer_shapes(&self.scene));
        shapes.extend(family.finer_shapes(&self.scene, entry.site, entry.shape));
        let same = shapes.iter().filter(|shape| shape.variant == entry.shape.variant);
        let near = 1e-9 * value.abs();
        let (mut low, mut high) = (value, value);
        let mut below = f64::NEG_INFINITY;
        let mut above = f64::INFINITY;
        for other in same.map(|shape| shape.value) {
            if other < value - near {
                below = below.max(other);
            } else if other > value + near {
                above = above.min(other);
            }
        }
        if below.is_finite() {
            low = below;
        }
        if above.is_finite() {
            high = above;
        }
        (low < high).then_some([low, high])
    }
}

impl Refinement {
    /// Goes on with what was `found` at the shape that is wanted.
    fn tell(&mut self, found: Option<(Entry, Score)>) {
        let gain = found.as_ref().map_or(f64::NEG_INFINITY, |(_, score)| score.gain);
        self.search.iter_mut().for_each(|search| search.tell(gain));
        if let Some(found) = found.filter(|_| gain > self.best.1.gain) {
            self.best = found;
        }
    }
}
