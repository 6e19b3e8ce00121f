//! What it costs to have looked for a law in so many places.
//!
//! Families share the chance of a false alarm evenly, and the sites of one what it has: what only the arm as a whole can have is
//! not as rare as the same on one joint of six. What a site has is shared between the shapes of the law that can be told from
//! each other there. The odds before are shared likewise, but between the sites by what the family says of them
//! ([`prior_odds`](super::candidates::Candidate::prior_odds)).

use super::distinct_shapes::DistinctShapes;
use super::study::{Entry, Study};

impl Study<'_> {
    /// By how much the probability of `entry` alone is multiplied before it is held against [`LAW`](super::chance::LAW): the
    /// places, times the shapes of its family at its site that noise can reach and that can be told from each other.
    pub fn tests(&self, entry: &Entry) -> f64 {
        self.places(entry) * self.of_shapes(entry, |shapes| shapes.within_reach)
    }

    /// 2 ln of the evidence that `entry` has to have before there is any for it: its coefficients, the places and shapes that
    /// were looked at, and how common its family is there.
    pub fn price(&self, entry: &Entry) -> f64 {
        self.statistic.coefficients_price(entry.images.len(), entry.site)
            + 2.0 * self.places(entry).ln()
            + 2.0 * self.alternatives(entry).ln()
            - 2.0 * self.odds_over_mean(entry).ln()
    }

    /// Families, and sites of the family of `entry`.
    fn places(&self, entry: &Entry) -> f64 {
        let sites = self.families[entry.family].sites(self.scene.joints()).len();
        (self.families.len() * sites) as f64
    }

    /// How common the family of `entry` is at its site, over the mean of all its sites.
    fn odds_over_mean(&self, entry: &Entry) -> f64 {
        let family = &self.families[entry.family];
        let sites = family.sites(self.scene.joints());
        let all: f64 = sites.iter().map(|site| family.prior_odds(*site)).sum();
        family.prior_odds(entry.site) * sites.len() as f64 / all
    }

    /// Shapes that were to choose from when `entry` was taken, as many as can be told from each other; where the shape is the
    /// coefficient, those that go with it.
    fn alternatives(&self, entry: &Entry) -> f64 {
        let is_bound = self.families[entry.family].shape_is_coefficient();
        self.of_shapes(entry, |shapes| if is_bound { shapes.within_reach } else { shapes.all })
    }

    fn of_shapes(&self, entry: &Entry, count: impl Fn(&DistinctShapes) -> f64) -> f64 {
        let Entry { family, site, shape, .. } = *entry;
        self.families[family]
            .alternatives(&self.scene, site, shape)
            .unwrap_or_else(|| self.shapes.get(&(family, site)).map_or(1.0, count))
    }
}
