//! One log prepared for tests: whitened, with the null model projected out, and with the columns of every family.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::candidates::{Candidate, Shape};
use super::coarse_angles;
use super::dictionary::{ABSORBED, FAINT};
use super::distinct_shapes::DistinctShapes;
use super::drives::{self, Answer};
use super::error::DiagnoseError;
use super::extension::Effect;
use super::image::{Column, Image, Span, dot};
use super::memory::Memory;
use super::scene::Scene;
use super::setup::Setup;
use super::statistic::{Score, Statistic};
use super::whitening::{PeriodWhitening, RunWhitening, Whitening};
use crate::base::BaseSet;
use crate::identify::Regression;

/// A family at one site with one shape.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Index into the families.
    pub family: usize,
    /// Joint (0-based), or `None` for the arm as a whole.
    pub site: Option<usize>,
    /// Nonlinear parameters.
    pub shape: Shape,
    /// Whitened columns, with the null model projected out.
    pub images: Arc<[Image]>,
}

impl Entry {
    /// Its family and site.
    pub(super) fn place(&self) -> Place {
        (self.family, self.site)
    }
}

/// A log, its null model, and the entries that may be added to it.
pub struct Study<'a> {
    /// The families.
    pub families: &'a [Box<dyn Candidate>],
    /// The motion and the predictions that the candidates see.
    pub scene: Scene,
    /// The regression of the null model.
    pub regression: &'a Regression,
    /// The whitening, from torques in time to the equations in which tests are made.
    pub whitening: Whitening,
    /// The null model's whitened columns: those of the base parameters, then those of how the drives answer friction.
    pub null_columns: Vec<Image>,
    /// The parts of each of the latter.
    pub answers: Vec<Answer>,
    /// The span of `null_columns`.
    pub null: Span,
    /// By joint (0-based), the whitened torque of its drive feeding another share of friction forward than the others,
    /// with the null model projected out.
    pub shares: Vec<(usize, Image)>,
    /// Whitened torque minus the null model.
    pub residual: Image,
    /// How explained squares become statistics.
    pub statistic: Statistic,
    /// Every family at every site with every starting shape; but see [`Self::with_scene`].
    pub entries: Vec<Entry>,
    /// Laws of a motion that repeats that the null model absorbs nearly, each at a site with no entry. They are not
    /// looked for, but one of them may be what really is behind a cause that was found.
    pub(super) faint: Vec<Entry>,
    /// How many starting shapes of a family at a site can be told from each other.
    pub(super) shapes: HashMap<Place, DistinctShapes>,
    /// Whitened measured torque.
    pub torque: Image,
    /// Joints (0-based) whose readings are too bad to look for physics in them.
    pub left_out: Vec<usize>,
    /// Joints (0-based) that do not move: all laws of friction and gears look alike where a joint trembles about a
    /// place.
    pub resting: Vec<usize>,
    /// Effects whose friction the scene was told.
    pub told: Vec<Effect>,
    /// Causes that were visible with an earlier estimate of the arm.
    pub(super) shown: Vec<Shown>,
    /// Cache of entries with any shape, and of directions in which they may be off.
    pub(super) memory: Memory,
}

/// A family and a site.
pub(super) type Place = (usize, Option<usize>);

/// A law that was visible with an earlier estimate of the arm, and the number of its columns that were.
pub(super) struct Shown {
    pub(super) family: usize,
    pub(super) site: Option<usize>,
    pub(super) variant: usize,
    pub(super) columns: usize,
    /// The share of its length outside the null model that was asked of each column.
    pub(super) least: f64,
}

/// Least share of the explained square that must also be explained in stretches left out of the fit.
const KEPT_SHARE: f64 = 0.5;
/// Least share of its joint's mean square that a cause must remove in stretches left out of the fit. It is 2.5 % of the
/// rms error, which approximate laws may leave beside each other.
pub(super) const LEAST_GAIN: f64 = 0.05;

impl<'a> Study<'a> {
    /// Prepares the log laid out in `regression`; `theta` and `sigma_nm` are the null model's fit. The study has no
    /// entries until it [looks everywhere](Self::look_everywhere).
    pub fn new(
        families: &'a [Box<dyn Candidate>],
        Setup { arm, set, options }: Setup,
        regression: &'a Regression,
        (theta, sigma_nm): (&[f64], &[f64]),
        log: &str,
    ) -> Result<Self, DiagnoseError> {
        let scene = Scene::new(arm, set, theta, &regression.prepared);
        let whitening = if scene.periodic {
            Whitening::Periods(Box::new(PeriodWhitening::new(regression, &scene, log)?))
        } else {
            Whitening::Run(RunWhitening::new(regression, options, sigma_nm)?)
        };
        Self::behind((whitening, scene), families, set, regression, log)
    }

    /// Everything but the entries.
    fn behind(
        (mut whitening, scene): (Whitening, Scene),
        families: &'a [Box<dyn Candidate>],
        set: &BaseSet,
        regression: &'a Regression,
        log: &str,
    ) -> Result<Self, DiagnoseError> {
        let problem = &regression.problem;
        let n = problem.samples;
        let differences = drives::differences(&scene);
        if let Whitening::Periods(periods) = &mut whitening {
            let mut of_joints = drives::unknown_pulses(&scene);
            for (j, torques) in &mut of_joints {
                torques.extend(coarse_angles::turns(&scene, *j));
            }
            periods.with_noise_of_joints(&of_joints);
            let of_drives: Vec<Column> =
                drives::leads(&scene).chain(drives::turns(&scene)).collect();
            let shares = differences.iter().map(|(_, torque)| torque);
            periods.with_repeating_noise(shares.chain(&of_drives));
        }
        let columns: Vec<Column> = (0..problem.parameters())
            .map(|base| {
                let part = |j: usize| {
                    let at = problem.plan.base_indices(j).position(|b| b == base)?;
                    Some((j, problem.panels[j].x[at * n..(at + 1) * n].to_vec()))
                };
                Column { parts: (0..problem.joints()).filter_map(part).collect() }
            })
            .collect();
        let mut images: Vec<Image> =
            columns.par_iter().map(|c| whitening.regression_image(c)).collect();
        let mut null = Span::default();
        for (k, image) in images.iter().enumerate() {
            if !null.push(image) {
                let parameter = set.name(k).to_owned();
                return Err(DiagnoseError::NotExcited { log: log.to_owned(), parameter });
            }
        }
        let torque = whitening.regression_image(&Column {
            parts: problem.panels.iter().enumerate().map(|(j, p)| (j, p.y.clone())).collect(),
        });
        let mut answers = Vec::new();
        for (answer, image) in drives::answers(&scene, &whitening, &null, &torque) {
            if null.push(&image) {
                answers.push(answer);
                images.push(image);
            }
        }
        let mut residual = torque.clone();
        null.residualise(&mut residual);
        let shares = differences.iter().map(|(j, torque)| {
            let mut image = whitening.image(torque);
            null.residualise(&mut image);
            (*j, image)
        });
        let shares = shares.collect();
        let statistic = Statistic::new(&whitening, &residual, problem.joints());
        Ok(Self {
            families,
            scene,
            regression,
            whitening,
            null_columns: images,
            answers,
            null,
            shares,
            residual,
            statistic,
            entries: Vec::new(),
            faint: Vec::new(),
            shapes: HashMap::new(),
            torque,
            left_out: Vec::new(),
            resting: Vec::new(),
            told: Vec::new(),
            shown: Vec::new(),
            memory: Memory::default(),
        })
    }

    /// The same study of a single run without `rows` of the regression, and without entries. What touched the arm there
    /// happened once, and no law of friction is to be bent by it.
    pub fn without_rows(
        mut self,
        set: &BaseSet,
        rows: &[Range<usize>],
        log: &str,
    ) -> Result<Self, DiagnoseError> {
        let Whitening::Run(run) = &mut self.whitening else { return Ok(self) };
        if rows.is_empty() {
            return Ok(self);
        }
        run.leave_out(rows);
        let Self { whitening, scene, families, regression, left_out, resting, shown, told, .. } =
            self;
        let of_run = (whitening, scene);
        let study = Self::behind(of_run, families, set, regression, log)?;
        Ok(Self { left_out, resting, shown, told, ..study })
    }

    /// The same study with the torques that `scene` predicts, which was `told` effects, after `entries` were found with
    /// others.
    /// It prepares only the families of `entries`, each at its site, until it [looks
    /// everywhere](Self::look_everywhere) again.
    pub fn with_scene(mut self, (scene, told): (Scene, Vec<Effect>), entries: &[&Entry]) -> Self {
        self.scene = scene;
        self.told = told;
        self.forget();
        let shown = |&&Entry { family, site, shape, ref images }: &&Entry| Shown {
            family,
            site,
            variant: shape.variant,
            columns: images.len(),
            least: match self.shown_as((family, site), shape.variant) {
                // What was faint once has been an entry since.
                Some(shown) => shown.least,
                None if self.is_faint((family, site)) => FAINT,
                None => ABSORBED,
            },
        };
        self.shown = entries.iter().map(shown).collect();
        let places: Vec<Place> = entries.iter().map(|entry| entry.place()).collect();
        self.prepare(|place| places.contains(place));
        self
    }

    /// Forgets columns that were computed before the scene changed.
    pub(super) fn forget(&mut self) {
        self.memory = Memory::default();
    }

    /// Recomputes the statistic from `residual`, that of a better model than the null model, so that it tells how many
    /// rows are independent.
    pub fn judge_by(&mut self, residual: &Image) {
        self.statistic = Statistic::new(&self.whitening, residual, self.scene.joints());
    }

    /// Whether the null model absorbs the law of `place` nearly.
    pub(super) fn is_faint(&self, place: Place) -> bool {
        self.faint.iter().any(|entry| entry.place() == place)
    }

    /// Excludes these joints from the search.
    pub fn leave_out(&mut self, joints: Vec<usize>) {
        self.entries.retain(|e| e.site.is_none_or(|j| !joints.contains(&j)));
        self.left_out = joints;
    }

    /// Whether the search includes `site`: a joint that is not left out, or the arm as a whole.
    pub fn looks_at(&self, site: Option<usize>) -> bool {
        site.is_none_or(|j| !self.left_out.contains(&j))
    }

    /// Whether the search includes the family of `place` at its site.
    pub(super) fn looks_for(&self, (family, site): Place) -> bool {
        let rests = site.is_some_and(|j| self.resting.contains(&j));
        self.looks_at(site) && !(rests && self.families[family].kind().needs_motion())
    }

    /// Span of an entry outside the null model and outside `others`.
    pub fn span(&self, entry: &Entry, others: &Span) -> Span {
        Span::outside(others, &entry.images)
    }

    /// Span of all `entries` outside the null model, together with the shares that drives feed forward where an entry
    /// blurs reversals, and with the directions along which the laws of the entries may be off.
    pub fn span_of_all(&self, entries: &[&Entry]) -> Span {
        let mut span = Span::default();
        for image in entries.iter().flat_map(|entry| &*entry.images) {
            span.push(image);
        }
        self.blurred_shares(entries).for_each(|share| {
            span.push(share);
        });
        for entry in entries {
            for image in &*self.loose(entry) {
                span.push(image);
            }
        }
        span
    }

    /// Directions along which the law of `entry` may be off, with the null model projected out.
    pub(super) fn loose(&self, entry: &Entry) -> Arc<[Image]> {
        let Entry { family, site, shape, .. } = *entry;
        self.memory.loose((family, site), shape, || {
            let columns = self.families[family].loose(&self.scene, site, shape);
            let mut images = self.whitening.images(columns.iter());
            self.null.residualise_all(&mut images);
            images
        })
    }

    /// The shares that drives feed forward on joints where one of `entries` blurs reversals, with the null model
    /// projected out.
    pub fn blurred_shares(&self, entries: &[&Entry]) -> impl Iterator<Item = &Image> {
        let is_blurred = |j: usize| {
            let mut blurs = entries.iter().filter(|e| self.families[e.family].blurs_reversals());
            blurs.any(|entry| entry.site.is_none_or(|own| own == j))
        };
        self.shares.iter().filter(move |(j, _)| is_blurred(*j)).map(|(_, share)| share)
    }

    /// The whitened columns of `entry`, including what the null model absorbs of them.
    pub fn whole_images(&self, entry: &Entry) -> Vec<Image> {
        let columns = self.families[entry.family].columns(&self.scene, entry.site, entry.shape);
        self.whitening.images(columns.iter().take(entry.images.len()))
    }

    /// Square of what `entry` with the coefficients `b` does to joint `j`, with the null model projected out.
    pub fn square_on(&self, j: usize, entry: &Entry, b: &[f64]) -> f64 {
        let columns = self.families[entry.family].columns(&self.scene, entry.site, entry.shape);
        let on_joint = columns.into_iter().zip(b).filter_map(|(mut column, b)| {
            column.parts.retain(|(joint, _)| *joint == j);
            (!column.parts.is_empty()).then(|| self.whitening.image(&column.scaled(*b)))
        });
        let sum = on_joint.reduce(|mut sum, image| {
            sum.add(1.0, &image);
            sum
        });
        sum.map_or(0.0, |mut sum| {
            self.null.residualise(&mut sum);
            sum.square()
        })
    }

    /// What adding `entry` to `others` explains of `residual`, from which the null model and `others` have been
    /// projected out. `None` if its columns are dependent there, or its coefficients physically impossible.
    pub fn score(&self, entry: &Entry, others: &Span, residual: &Image) -> Option<Score> {
        let span = self.span(entry, others);
        if span.len() != entry.images.len() {
            return None;
        }
        let coordinates = span.coordinates(residual);
        let b = span.coefficients(coordinates.clone());
        let is_possible = self.families[entry.family].is_possible(entry.shape, &b);
        is_possible.then(|| self.statistic.score(&span, residual, &coordinates))
    }

    /// Share of the mean square of the joint `site` (`None`: of all joints) that `span` removes from `residual` in
    /// stretches of a single run that were left out of its fit.
    pub fn left_out_gain(&self, site: Option<usize>, span: &Span, residual: &Image) -> Option<f64> {
        let gain = self.statistic.left_out_gain(span, residual)?;
        let square = self.square(site, residual);
        (square > 0.0).then(|| gain / square)
    }

    /// Whether `span` at `site` also explains `residual` in stretches of a single run that were left out of its fit,
    /// and removes more than the share `least` of the mean square there. Always true where noise is known.
    pub fn generalises(
        &self,
        site: Option<usize>,
        span: &Span,
        residual: &Image,
        least: f64,
    ) -> bool {
        self.statistic.left_out_gain(span, residual).is_none_or(|gain| {
            gain > KEPT_SHARE * span.explained(residual)
                && gain > least * self.square(site, residual)
        })
    }

    /// Square of `residual` on the joint `site` (`None`: on all joints) along a single run.
    fn square(&self, site: Option<usize>, residual: &Image) -> f64 {
        let rows = residual.mean.len() / self.scene.joints();
        let own = site.map_or(0..residual.mean.len(), |j| j * rows..(j + 1) * rows);
        dot(&residual.mean[own.clone()], &residual.mean[own])
    }

    /// Whitened image of a torque on joint `j` alone, sampled as the regression is.
    pub fn torque_on(&self, j: usize, torque_nm: &[f64]) -> Image {
        self.whitening.regression_image(&Column::on(j, torque_nm.to_vec()))
    }

    /// Number of base parameters in the null model.
    pub fn base_count(&self) -> usize {
        self.null_columns.len() - self.answers.len()
    }
}
