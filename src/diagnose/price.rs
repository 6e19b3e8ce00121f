//! The price of having looked for a law in so many places and shapes.
//!
//! All families have equal shares of the chance of a false alarm and of the prior odds. Each divides its shares among
//! its sites, by the odds that it says it has there ([`prior_odds`](super::candidates::Candidate::prior_odds)); a
//! division of the chance by odds keeps the chance of all together (Genovese, Roeder and Wasserman 2006). An effect
//! that only the arm as a whole can have is therefore not made as rare as one on a particular joint of six. A site
//! divides its shares among the shapes of the law that can be told from each other there.

use super::distinct_shapes::DistinctShapes;
use super::study::{Entry, Study};

impl Study<'_> {
    /// The factor on the probability of `entry` before it is compared with [`LAW`](super::chance::LAW): the number of
    /// places, as rare as its family is at its site, times the number of shapes of its family there that noise can
    /// reach and that can be told from each other.
    pub fn tests(&self, entry: &Entry) -> f64 {
        self.places(entry) / self.odds_over_mean(entry)
            * self.of_shapes(entry, |shapes| shapes.within_reach)
    }

    /// What `entry` has to gain, in 2 ln of the evidence, before there is any evidence for it: the price of its
    /// coefficients, of the places and shapes that were looked at, and of how rare its family is at its site.
    pub fn price(&self, entry: &Entry) -> f64 {
        self.statistic.coefficients_price(entry.images.len(), entry.site)
            + 2.0 * self.places(entry).ln()
            + 2.0 * self.alternatives(entry).ln()
            - 2.0 * self.odds_over_mean(entry).ln()
    }

    /// Number of families times the number of sites of the family of `entry`.
    fn places(&self, entry: &Entry) -> f64 {
        let sites = self.families[entry.family].sites(self.scene.joints()).len();
        (self.families.len() * sites) as f64
    }

    /// Prior odds of the family of `entry` at its site, relative to their mean over all its sites.
    fn odds_over_mean(&self, entry: &Entry) -> f64 {
        let family = &self.families[entry.family];
        let sites = family.sites(self.scene.joints());
        let all: f64 = sites.iter().map(|site| family.prior_odds(*site)).sum();
        family.prior_odds(entry.site) * sites.len() as f64 / all
    }

    /// Number of distinguishable shapes from which that of `entry` was chosen. Where the shape is the coefficient, only
    /// the shapes that go with the coefficient count.
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
