//! The entries of a [`Study`]: every family at every site with every starting shape, as whitened columns outside the
//! null model.

use rayon::prelude::*;

use super::candidates::{Search, Shape};
use super::distinct_shapes::DistinctShapes;
use super::image::{Column, Image};
use super::study::{Entry, Place, Shown, Study};

/// Shapes of a family that are prepared at once.
struct Bank {
    family: usize,
    /// One site; or the arm as a whole and all its joints, where it adds what they add.
    sites: Vec<Option<usize>>,
    shapes: Vec<Shape>,
}

/// A column that keeps less than this share of its length outside the null model counts as absorbed: the remainder
/// reflects the noise of the null model's accelerations, which the residual contains as well. A spring on a joint
/// without gravity keeps 2.7 %, and was found in one of 50 logs without a spring.
pub(super) const ABSORBED: f64 = 0.04;
/// The same for a law that is not looked for, but compared with what was found. A torque constant of joint 5 that is
/// off by a fifth keeps 1 to 4 % of its effect outside the null model, which is many times the noise, and was told as a
/// torque constant and an angle of joint 4.
pub(super) const FAINT: f64 = 0.01;
/// How much of these limits is asked of a cause that was found with an earlier estimate of the arm. The shares differ a
/// little between estimates, and if a cause came and went with them, the fit would not settle.
const AGAIN: f64 = 0.5;
/// Least number of shapes that are prepared at once.
const BANK: usize = 8;

impl Study<'_> {
    /// Prepares every family at every site with every starting shape.
    pub fn look_everywhere(&mut self) {
        self.prepare(|_| true);
    }

    /// Prepares the places that are wanted, and no others.
    pub(super) fn prepare(&mut self, is_wanted: impl Fn(&Place) -> bool) {
        let families = 0..self.families.len();
        let banks: Vec<Bank> =
            families.flat_map(|family| self.banks_of(family, &is_wanted)).collect();
        // Prices of banks differ by far: whoever is idle takes the next one.
        let each = banks.par_iter().with_max_len(1);
        let entries = each.flat_map_iter(|bank| self.entries_of(bank));
        self.entries = entries.collect();
        // The shapes of a place keep their order.
        self.entries.sort_by_key(Entry::place);
        // The noise of a single run is not known, and so neither is how large a coefficient it can make.
        let is_possible = |e: &Entry, b: f64| {
            !self.scene.periodic || self.families[e.family].is_possible(e.shape, &[b])
        };
        let places: Vec<&[Entry]> = self.entries.chunk_by(|a, b| a.place() == b.place()).collect();
        let distinct = |same: &[Entry]| (same[0].place(), DistinctShapes::of(same, is_possible));
        self.shapes = places.into_par_iter().map(distinct).collect();
        self.faint = if self.scene.periodic { self.faint_entries(&is_wanted) } else { Vec::new() };
    }

    /// The laws of one shape that are wanted where they have no entry, as far as they are faint.
    fn faint_entries(&self, is_wanted: impl Fn(&Place) -> bool) -> Vec<Entry> {
        let has_one_shape = |family: &usize| self.families[*family].search() == Search::None;
        let places = (0..self.families.len()).filter(has_one_shape).flat_map(|family| {
            let sites = self.families[family].sites(self.scene.joints());
            sites.into_iter().map(move |site| (family, site))
        });
        let is_absent = |place: &Place| {
            self.looks_for(*place) && is_wanted(place) && !self.shapes.contains_key(place)
        };
        let absent: Vec<Place> = places.filter(is_absent).collect();
        let faint = |(family, site): Place| {
            let shapes = self.families[family].shapes(&self.scene, site);
            let shape = shapes.get(..1)?;
            self.outside((family, site), shape, self.images(family, site, shape), FAINT).remove(0)
        };
        absent.into_par_iter().filter_map(faint).collect()
    }

    /// The banks of a family at the sites that are wanted.
    fn banks_of(&self, family: usize, is_wanted: impl Fn(&Place) -> bool) -> Vec<Bank> {
        let candidate = &self.families[family];
        let shapes_at = |site: Option<usize>| candidate.shapes(&self.scene, site);
        let banks_at = |sites: &[Option<usize>]| -> Vec<Bank> {
            let of_shapes =
                |shapes: &[Shape]| Bank { family, sites: sites.to_vec(), shapes: shapes.to_vec() };
            shapes_at(sites[0]).chunks(BANK.max(candidate.abreast())).map(of_shapes).collect()
        };
        let every = candidate.sites(self.scene.joints());
        let is_wanted =
            |site: &Option<usize>| self.looks_for((family, *site)) && is_wanted(&(family, *site));
        let wanted: Vec<Option<usize>> = every.iter().copied().filter(is_wanted).collect();
        let are_alike = || every.iter().all(|site| shapes_at(*site) == shapes_at(every[0]));
        if candidate.is_sum_of_joints() && wanted == every && are_alike() {
            return banks_at(&every);
        }
        wanted.iter().flat_map(|site| banks_at(&[*site])).collect()
    }

    /// The entries of `bank` that the null model does not absorb.
    fn entries_of(&self, bank: &Bank) -> Vec<Entry> {
        let Bank { family, sites, shapes } = bank;
        if let [site] = sites[..] {
            return self.bank(*family, site, shapes).into_iter().flatten().collect();
        }
        let (arm, joints) = (sites[0], &sites[1..]);
        let mut whole: Vec<Vec<Image>> = Vec::new();
        let mut entries = Vec::new();
        for site in joints {
            let images = self.images(*family, *site, shapes);
            if whole.is_empty() {
                whole.clone_from(&images);
            } else {
                let pairs = whole.iter_mut().flatten().zip(images.iter().flatten());
                pairs.for_each(|(sum, image)| sum.add(1.0, image));
            }
            entries.extend(self.outside((*family, *site), shapes, images, ABSORBED));
        }
        entries.extend(self.outside((*family, arm), shapes, whole, ABSORBED));
        entries.into_iter().flatten().collect()
    }

    /// The entry of a family at a site with this shape; `None` if the null model absorbs it.
    pub fn entry(&self, family: usize, site: Option<usize>, shape: Shape) -> Option<Entry> {
        self.entries_at(family, site, &[shape]).pop().flatten()
    }

    /// [`Self::entry`] for each of `shapes`.
    pub(super) fn entries_at(
        &self,
        family: usize,
        site: Option<usize>,
        shapes: &[Shape],
    ) -> Vec<Option<Entry>> {
        self.memory.entries((family, site), shapes, |unknown| {
            let abreast = unknown.par_chunks(self.families[family].abreast());
            abreast.flat_map_iter(|shapes| self.bank(family, site, shapes)).collect()
        })
    }

    /// The family of `entry` at its site in each of its richer shapes, and in its finer ones near `entry`.
    pub fn further_entries(&self, entry: &Entry) -> Vec<Entry> {
        let Entry { family, site, shape, .. } = *entry;
        let law = &self.families[family];
        let entries =
            |shapes: &[Shape]| self.entries_at(family, site, shapes).into_iter().flatten();
        let richer = entries(&law.richer_shapes(&self.scene));
        let finer = entries(&law.finer_shapes(&self.scene, site, shape));
        let same = || self.entries.iter().filter(|other| other.place() == entry.place());
        let usual = same().map(|other| other.shape.variant).min();
        let usual = same().filter(|other| Some(other.shape.variant) == usual);
        let plain = usual.map(|other| other.images.len()).max().unwrap_or(1);
        // If the null model absorbs the further coefficient, the law is the one without it.
        richer.filter(|entry| entry.images.len() > plain).chain(finer).collect()
    }

    /// The entries of a family at a site with these shapes, computed together; `None` where the null model absorbs
    /// them.
    fn bank(&self, family: usize, site: Option<usize>, shapes: &[Shape]) -> Vec<Option<Entry>> {
        self.outside((family, site), shapes, self.images(family, site, shapes), ABSORBED)
    }

    /// The whitened columns of a family at a site, for each of `shapes`.
    fn images(&self, family: usize, site: Option<usize>, shapes: &[Shape]) -> Vec<Vec<Image>> {
        let columns = self.families[family].bank(&self.scene, site, shapes);
        let mut images = self.whitening.images(columns.iter().flatten()).into_iter();
        let of_shape = |columns: &Vec<Column>| images.by_ref().take(columns.len()).collect();
        columns.iter().map(of_shape).collect()
    }

    /// The entries whose whitened columns are `images`, for each of `shapes`; `None` if less than the share `absorbed`
    /// of their length is outside the null model.
    fn outside(
        &self,
        (family, site): Place,
        shapes: &[Shape],
        images: Vec<Vec<Image>>,
        absorbed: f64,
    ) -> Vec<Option<Entry>> {
        let counts: Vec<usize> = images.iter().map(Vec::len).collect();
        let mut images: Vec<Image> = images.into_iter().flatten().collect();
        let lengths: Vec<f64> = images.iter().map(Image::square).collect();
        self.null.residualise_all(&mut images);
        let mut outside = images.into_iter().zip(lengths);
        let entry = |(shape, count): (&Shape, usize)| {
            let own: Vec<(Image, f64)> = outside.by_ref().take(count).collect();
            let shown = self.shown_as((family, site), shape.variant);
            let least = |column: usize| match shown {
                Some(shown) if column < shown.columns => AGAIN * shown.least,
                _ => absorbed,
            };
            // Columns behind an absorbed one are dropped with it: they are parameters that belong to it.
            let images: Vec<Image> = own
                .into_iter()
                .enumerate()
                .map_while(|(k, (image, length))| {
                    is_seen(&image, length, least(k)).then_some(image)
                })
                .collect();
            let is_seen = !images.is_empty();
            is_seen.then(|| Entry { family, site, shape: *shape, images: images.into() })
        };
        shapes.iter().zip(counts).map(entry).collect()
    }

    /// What was visible of a law with an earlier estimate of the arm.
    pub(super) fn shown_as(&self, place: Place, variant: usize) -> Option<&Shown> {
        let is_it = |s: &&Shown| ((s.family, s.site), s.variant) == (place, variant);
        self.shown.iter().filter(is_it).max_by_key(|s| s.columns)
    }

    /// The part of `image` outside the null model; `None` if the null model absorbs it.
    pub fn outside_null(&self, mut image: Image) -> Option<Image> {
        let length = image.square();
        self.null.residualise(&mut image);
        is_seen(&image, length, ABSORBED).then_some(image)
    }
}

/// Whether `image`, whose squared length was `length` before the null model was projected out, keeps more than the
/// share `least` of its length.
fn is_seen(image: &Image, length: f64, least: f64) -> bool {
    image.square() > least * least * length
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{BaseSet, Parameterisation};
    use crate::diagnose::candidates;
    use crate::diagnose::load::rigid_torque_along;
    use crate::diagnose::setup::Setup;
    use crate::dynamics::{Model, Motion};
    use crate::identify::{Identifier, Measurement, Options};
    use crate::robot::{Arm, JointSignals};
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 125.0;
    const PERIODS: usize = 4;
    /// Samples of a period.
    const N: usize = 500;

    /// Angles, velocities and torques of a UR5 in noise, on a motion of five harmonics.
    fn log(arm: &Arm, model: &Model) -> [JointSignals; 3] {
        let omega = std::f64::consts::TAU * RATE_HZ / N as f64;
        let order =
            |j: usize, h: usize| (h as f64 * omega, 0.12 / h as f64, (j * 5 + 3 * h) as f64);
        let wave = |derivative: i32| {
            JointSignals::from_fn(arm.dof(), N * PERIODS, |j, k| {
                let term = |h: usize| {
                    let (omega, amplitude, phase) = order(j, h);
                    let quarters = f64::from(derivative) * std::f64::consts::FRAC_PI_2;
                    let angle = omega * k as f64 / RATE_HZ + phase + quarters;
                    amplitude * omega.powi(derivative) * angle.sin()
                };
                (1..6).map(term).sum()
            })
        };
        let motion = Motion { q_rad: wave(0), qd_rad_s: wave(1), qdd_rad_s2: wave(2) };
        let rigid_nm = rigid_torque_along(model, &motion);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut noisy = |y: &JointSignals, sd: f64| {
            JointSignals::from_fn(y.joints(), y.samples(), |j, k| y.joint(j)[k] + sd * normal())
        };
        let torque_nm = JointSignals::from_fn(arm.dof(), N * PERIODS, |j, k| {
            rigid_nm.joint(j)[k] + model.friction(j, motion.qd_rad_s.joint(j)[k])
        });
        [noisy(&motion.q_rad, 2e-5), noisy(&motion.qd_rad_s, 1e-3), noisy(&torque_nm, 0.2)]
    }

    /// What the arm as a whole adds is computed from what its joints add when all are prepared together, and from the
    /// motion of all joints when it is prepared by itself.
    #[test]
    fn an_arm_adds_what_its_joints_add() {
        let arm = Arm::built_in("ur5").unwrap();
        let model = Model::new(&arm);
        let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), true)).unwrap();
        let [q_rad, qd_rad_s, torque_nm] = log(&arm, &model);
        let time_s: Vec<f64> = (0..N * PERIODS).map(|k| k as f64 / RATE_HZ).collect();
        let m = Measurement {
            source: "log",
            time_s: &time_s,
            q_rad: &q_rad,
            qd_rad_s: &qd_rad_s,
            torque_nm: &torque_nm,
        };
        let options = Options::default();
        let mut identifier = Identifier::new(&model, &set, options.clone());
        let regression = identifier.regression(&m).unwrap();
        let fit = identifier.identify_regression(&regression).unwrap().fit;
        let families = candidates::all();
        let estimate = (&fit.theta[..], &fit.joint_sigma_nm[..]);
        let setup = Setup { arm: &arm, set: &set, options: &options };
        let study = Study::new(&families, setup, &regression, estimate, "log");
        let mut study = study.unwrap();
        study.look_everywhere();
        let is_sum =
            |entry: &&Entry| entry.site.is_none() && families[entry.family].is_sum_of_joints();
        let mut compared = 0;
        for sum in study.entries.iter().filter(is_sum) {
            let whole = study.entry(sum.family, None, sum.shape).unwrap();
            let (mut off, whole) = (whole.images[0].clone(), whole.images[0].square());
            off.add(-1.0, &sum.images[0]);
            // Rounding of sums over 6 joints, of which the null model absorbs all but a part.
            assert!(off.square() < 1e-20 * whole, "{:?}: {}", sum.shape, off.square() / whole);
            compared += 1;
        }
        assert!(compared > 10, "{compared}");
    }
}
