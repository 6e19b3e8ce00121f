//! The extended model: base parameters and effects, fitted together.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::bristles::Curve;
use super::candidates::{Candidate, Shape};
use super::drives::Answer;
use super::image::{Column, Image, Span};
use super::kind::Kind;
use super::scene::{OtherFriction, SHARPEST, Scene, Turn};
use super::study::{Entry, Study};
use super::whitening::Whitening;
use crate::base::BaseSet;
use crate::dynamics::Parameter;
use crate::identify::{Prepared, Problem};
use crate::robot::{Arm, JointSignals};
use crate::signal::mean_period;

/// An effect with its fitted shape and coefficients.
#[derive(Debug, Clone)]
pub struct Effect {
    /// Index into the families.
    pub family: usize,
    /// Joint (0-based), or `None` for the arm as a whole.
    pub site: Option<usize>,
    /// Nonlinear parameters.
    pub shape: Shape,
    /// Coefficients of its columns.
    pub coefficients: Vec<f64>,
    /// Coefficients of the [directions](Candidate::loose) in which its law may be wrong.
    pub off: Vec<f64>,
    /// Change of the base parameters that would absorb part of the effect if it were left out.
    pub absorbed: Vec<f64>,
}

/// By how much the width over which friction turns round is another for the arm as a whole, rad/s, if `effect` is such a
/// width of one joint: the joint's change adds to it. `None` for all other effects, and where the arm has none among
/// `effects`.
pub(super) fn width_of_arm(
    effects: &[Effect],
    effect: &Effect,
    families: &[Box<dyn Candidate>],
) -> Option<f64> {
    let is_width = |effect: &Effect| families[effect.family].kind() == Kind::ReversalWidth;
    if !is_width(effect) || effect.site.is_none() {
        return None;
    }
    let of_arm = effects.iter().find(|other| is_width(other) && other.site.is_none())?;
    of_arm.coefficients.first().copied()
}

/// Torque of the drive per torque that the log shows of `effect`: 1/(1 + e) where `effects` hold an error e of the torque
/// constant of its joint, and 1 elsewhere. The column of that error holds the torque of the rigid arm and its friction
/// alone, so that the coefficients of other effects are those of the reading.
pub(super) fn torque_per_reading(
    effects: &[Effect],
    effect: &Effect,
    families: &[Box<dyn Candidate>],
) -> f64 {
    let kind = |effect: &Effect| families[effect.family].kind();
    // These are faults of the reading itself.
    let is_read = matches!(kind(effect), Kind::TorqueGain | Kind::CurrentOffset | Kind::Saturation);
    if is_read || effect.site.is_none() {
        return 1.0;
    }
    let is_gain = |other: &&Effect| kind(other) == Kind::TorqueGain && other.site == effect.site;
    let error = effects.iter().find(is_gain).and_then(|gain| gain.coefficients.first());
    error.map_or(1.0, |e| 1.0 / (1.0 + e))
}

/// Standard deviation of the coefficients of [`Candidate::loose`] relative to that of the law, before any log is seen.
///
/// The directions are differences to other drives and flanks that are listed as extremes, so that most arms are within
/// a part of them.
const OFF: f64 = 0.3;

/// Smallest curve that bristles hold, relative to Coulomb friction.
const LEAST_SHARE: f64 = 0.01;

/// Base parameters and effects, fitted together.
#[derive(Debug, Clone)]
pub struct Extension {
    /// Base parameters.
    pub theta: Vec<f64>,
    /// How the drives answer friction; rates are per [`Self::instant_s`].
    pub answers: Answer,
    /// Time between two instants of the log that was fitted, s ([`Scene::instant_s`]).
    pub instant_s: f64,
    /// Effects.
    pub effects: Vec<Effect>,
    /// Effects whose friction the scene of the fit was told: those of the round before.
    pub told: Vec<Effect>,
}

impl Extension {
    /// Fits the null model and `entries` to `torque` by least squares in the whitened equations. `torque` is the
    /// study's own, or that of other periods of the same motion.
    ///
    /// What a law takes for granted about the drives may be fitted with it ([`Candidate::carries_loose`]), as far as
    /// the log insists (ridge regression, Hoerl and Kennard 1970): the drives are the same along another motion.
    pub fn fit(study: &Study, entries: &[&Entry], torque: &Image) -> Self {
        let mut residual = torque.clone();
        study.null.residualise(&mut residual);
        let mut span = Span::default();
        let mut telling = |entry: &&Entry| -> Vec<bool> {
            entry.images.iter().map(|image| span.push(image)).collect()
        };
        let telling: Vec<Vec<bool>> = entries.iter().map(&mut telling).collect();
        // The coefficient of a column that is a combination of those before it is zero.
        let of_entries = |residual: &Image| -> Vec<Vec<f64>> {
            let mut solved = span.solve(residual).into_iter();
            let mut coefficient =
                |told: &bool| if *told { solved.next().unwrap_or(0.0) } else { 0.0 };
            telling.iter().map(|telling| telling.iter().map(&mut coefficient).collect()).collect()
        };
        let loose_of = |entry: &&Entry| match study.families[entry.family].carries_loose() {
            true => study.loose(entry),
            false => Arc::default(),
        };
        let loose: Vec<Arc<[Image]>> = entries.iter().map(loose_of).collect();
        let prior_sd = loose.iter().zip(of_entries(&residual)).flat_map(|(images, b)| {
            let size = b.first().map_or(0.0, |b| b.abs());
            images.iter().map(move |_| OFF * size)
        });
        let prior_sd: Vec<f64> = prior_sd.collect();
        let directions: Vec<&Image> = loose.iter().flat_map(|images| &**images).collect();
        let mut off = ridge(&span, &directions, &prior_sd, &residual);
        directions.iter().zip(&off).for_each(|(image, c)| residual.add(-c, image));
        let mut effects: Vec<Effect> = entries
            .iter()
            .zip(of_entries(&residual))
            .zip(&loose)
            .map(|((entry, coefficients), loose)| Effect {
                family: entry.family,
                site: entry.site,
                shape: entry.shape,
                coefficients,
                off: off.drain(..loose.len()).collect(),
                absorbed: Vec::new(),
            })
            .collect();
        let mut rest = torque.clone();
        for effect in &mut effects {
            let mut own = torque.clone();
            own.scale(0.0);
            for (column, b) in effect.torques(study.families, &study.scene) {
                let image = study.whitening.image(&column);
                rest.add(-b, &image);
                own.add(b, &image);
            }
            effect.absorbed = study.null.solve(&own);
            effect.absorbed.truncate(study.base_count());
        }
        let mut theta = study.null.solve(&rest);
        let answers = theta.split_off(study.base_count());
        let parts = |(answer, b): (&Answer, f64)| -> Answer {
            answer.iter().map(|(j, which, factor)| (*j, *which, factor * b)).collect()
        };
        let answers = study.answers.iter().zip(answers).flat_map(parts).collect();
        let told = study.told.clone();
        Self { theta, answers, instant_s: study.scene.instant_s(), effects, told }
    }

    /// The scene along `prepared` for the arm of this model, told the friction that the scene of its fit was told.
    pub fn scene(
        &self,
        families: &[Box<dyn Candidate>],
        (arm, set): (&Arm, &BaseSet),
        prepared: &Prepared,
    ) -> Scene {
        self.telling(families, Scene::new(arm, set, &self.theta, prepared))
    }

    /// `scene` told the friction of [`Self::told`] on joints where one law changes that of another, or bristles hold a
    /// curve.
    pub fn telling(&self, families: &[Box<dyn Candidate>], mut scene: Scene) -> Scene {
        for j in 0..scene.joints() {
            let kinds = on_joint(&self.told, j).map(|effect| families[effect.family].kind());
            let (change, others): (Vec<_>, Vec<_>) =
                kinds.partition(|kind| kind.changes_friction());
            let is_product = change.len() > 1 || others.iter().any(|kind| kind.adds_friction());
            let is_held = [Kind::Presliding, Kind::Stribeck].iter().all(|k| others.contains(k));
            if !change.is_empty() && is_product || is_held {
                tell_friction(&self.told, families, &mut scene, j);
            }
        }
        scene
    }

    /// The same model for another log, with shapes as [`Candidate::elsewhere`] gives them, and without the coefficients
    /// that hold along the motion of its own log alone ([`Candidate::carried`]).
    pub fn elsewhere(&self, families: &[Box<dyn Candidate>]) -> Self {
        let mut out = self.clone();
        for effect in out.effects.iter_mut().chain(&mut out.told) {
            let family = &families[effect.family];
            effect.shape = family.elsewhere(effect.shape, &effect.coefficients);
            // Their number stays, by which the unknowns of several logs are laid out.
            let own = effect.coefficients.iter_mut().skip(family.carried(effect.shape));
            own.for_each(|b| *b = 0.0);
        }
        out
    }

    /// The same model without Coulomb friction on `joints`, and without effects of the friction families there.
    pub fn without_dry_friction(
        &self,
        joints: Range<usize>,
        set: &BaseSet,
        families: &[Box<dyn Candidate>],
    ) -> Self {
        let mut bare = self.clone();
        let acts = |effect: &Effect| effect.site.is_none_or(|own| joints.contains(&own));
        let is_friction = |effect: &Effect| families[effect.family].kind().is_friction();
        bare.effects.retain(|effect| !(acts(effect) && is_friction(effect)));
        for k in joints.filter_map(|j| set.index_of(Parameter::Coulomb(j))) {
            bare.theta[k] = 0.0;
        }
        bare
    }

    /// Predicted torque of one period (or of the run) as the regression sees it, Nm: joints × samples of `problem`.
    pub fn torque_nm(
        &self,
        families: &[Box<dyn Candidate>],
        scene: &Scene,
        problem: &Problem,
        whitening: Option<&Whitening>,
    ) -> JointSignals {
        let mut out = JointSignals::zeros(problem.joints(), problem.samples);
        for j in 0..problem.joints() {
            let out = out.joint_mut(j);
            problem.predict(j, &self.theta, out);
            let columns = scene.answers(j);
            for &(_, which, b) in self.answers.iter().filter(|(joint, ..)| *joint == j) {
                // A single run has no answers.
                if let Some(column) = columns.get(which) {
                    let b = scene.answer_from(self.instant_s, which, b);
                    out.iter_mut().zip(column).for_each(|(o, y)| *o += b * y);
                }
            }
        }
        for effect in &self.effects {
            for (column, b) in effect.torques(families, scene) {
                for (j, y) in column.parts {
                    // A torque that does not repeat is averaged over the periods.
                    let mean = mean_period(&y, scene.samples());
                    let y = whitening.map_or(mean.clone(), |w| w.as_regressed(&mean));
                    out.joint_mut(j).iter_mut().zip(&y).for_each(|(o, y)| *o += b * y);
                }
            }
        }
        out
    }
}

/// Those of the `effects` that act on joint `j`, those of the arm as a whole among them.
fn on_joint(effects: &[Effect], j: usize) -> impl Iterator<Item = &Effect> {
    effects.iter().filter(move |effect| effect.site.is_none_or(|own| own == j))
}

/// Tells `scene` the friction of the `effects` on joint `j`.
pub(super) fn tell_friction(
    effects: &[Effect],
    families: &[Box<dyn Candidate>],
    scene: &mut Scene,
    j: usize,
) {
    let (mut change_rad_s, mut turn) = (0.0, None);
    let mut warm = 1.0;
    let (mut bristles, mut near_rest) = (None, None);
    for Effect { family, shape, coefficients, .. } in on_joint(effects, j) {
        if let Some((change, fed)) = families[*family].turning(*shape, coefficients) {
            let epsilon = scene.arm.friction_epsilon_rad_s;
            // A joint may have a width of its own beside that of the arm: their torques add.
            change_rad_s += change;
            let width_rad_s = (epsilon + change_rad_s).max(SHARPEST * epsilon);
            turn = Some(Turn { width_rad_s, fed });
        }
        warm *= families[*family].warm(scene, *shape, coefficients).unwrap_or(1.0);
        bristles = bristles.or(families[*family].bristles(*shape, coefficients));
        let curve = families[*family].near_rest_nm(coefficients).map(|nm| (nm, *shape));
        near_rest = near_rest.or(curve);
    }
    if let (Some(bristles), Some((nm, shape))) =
        (&mut bristles, near_rest.filter(|(nm, _)| *nm > 0.0))
    {
        let share = (nm / bristles.coulomb_nm).max(LEAST_SHARE);
        bristles.curve = Some(Curve { share, shape });
    }
    let mut other = OtherFriction { turn, bristles, torque_nm: Vec::new(), warm };
    // The other laws depend on how friction turns round.
    scene.set_other_friction(j, other.clone());
    for effect in on_joint(effects, j).filter(|e| families[e.family].kind().adds_friction()) {
        for (column, b) in effect.torques(families, scene) {
            let parts = column.parts.iter().filter(|(joint, _)| *joint == j);
            parts.for_each(|(_, y)| other.add(y, b));
        }
    }
    scene.set_torque_of_others(j, other.torque_nm);
}

/// Coefficients c of the `directions` outside `span`, by ridge regression on `residual`: (LᵀL + diag(1/sd²)) c = Lᵀr.
fn ridge(span: &Span, directions: &[&Image], prior_sd: &[f64], residual: &Image) -> Vec<f64> {
    let count = directions.len();
    let outside: Vec<Image> = directions
        .iter()
        .zip(prior_sd)
        .map(|(direction, sd)| {
            let mut image = (*direction).clone();
            span.residualise(&mut image);
            image.scale(*sd);
            image
        })
        .collect();
    // In units of the standard deviations, the prior is the unit matrix, and there is a solution even if one of them is
    // zero.
    let normal = DMatrix::from_fn(count, count, |i, k| {
        outside[i].dot(&outside[k]) + if i == k { 1.0 } else { 0.0 }
    });
    let right = DVector::from_fn(count, |i, _| outside[i].dot(residual));
    let solved = Cholesky::new(normal).map(|normal| normal.solve(&right));
    prior_sd.iter().enumerate().map(|(i, sd)| solved.as_ref().map_or(0.0, |c| sd * c[i])).collect()
}

impl Effect {
    /// The effect's columns with their coefficients.
    pub(super) fn columns(
        &self,
        families: &[Box<dyn Candidate>],
        scene: &Scene,
    ) -> Vec<(Column, f64)> {
        let columns = families[self.family].columns(scene, self.site, self.shape);
        columns.into_iter().zip(self.coefficients.iter().copied()).collect()
    }

    /// The directions in which the law was found to be off, with their coefficients.
    pub(super) fn off_columns(
        &self,
        families: &[Box<dyn Candidate>],
        scene: &Scene,
    ) -> Vec<(Column, f64)> {
        if self.off.is_empty() {
            return Vec::new();
        }
        let loose = families[self.family].loose(scene, self.site, self.shape);
        loose.into_iter().zip(self.off.iter().copied()).collect()
    }

    /// All columns of the effect with their coefficients.
    fn torques(&self, families: &[Box<dyn Candidate>], scene: &Scene) -> Vec<(Column, f64)> {
        let mut torques = self.columns(families, scene);
        torques.extend(self.off_columns(families, scene));
        torques
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::candidates::all;
    use crate::diagnose::candidates::presliding::HELD;

    /// Friction that was held at the rests of one log says nothing of the rests of another one; the stiffness and the
    /// sliding friction of bristles do.
    #[test]
    fn what_was_held_at_rest_is_not_predicted_elsewhere() {
        let families = all();
        let family = families.iter().position(|f| f.kind() == Kind::Presliding).unwrap();
        let carried = |variant: usize| -> Vec<f64> {
            let effect = Effect {
                family,
                site: Some(1),
                shape: Shape { variant, value: 1000.0 },
                coefficients: vec![8.0, 3.0, -2.0],
                off: Vec::new(),
                absorbed: Vec::new(),
            };
            let extension = Extension {
                theta: Vec::new(),
                answers: Answer::new(),
                instant_s: 1e-3,
                effects: vec![effect],
                told: Vec::new(),
            };
            extension.elsewhere(&families).effects.remove(0).coefficients
        };
        assert_eq!(carried(HELD), [0.0; 3]);
        // Beside bristles, the variants just before.
        assert_eq!(carried(HELD - 1), [8.0, 0.0, 0.0]);
        assert_eq!(carried(0), [8.0, 3.0, -2.0]);
    }

    /// One direction of length l beside a column: its coefficient is l r/(l² + 1/sd²) of the part r of the residual
    /// along it, outside the column.
    #[test]
    fn a_prior_shrinks_what_the_log_does_not_insist_on() {
        let image = |mean: &[f64]| Image { mean: mean.to_vec(), contrast: Vec::new() };
        let mut law = Span::default();
        assert!(law.push(&image(&[1.0, 0.0, 0.0])));
        let directions = [image(&[5.0, 2.0, 0.0]), image(&[1.0, 0.0, 30.0])];
        let residual = image(&[0.0, 4.0, 60.0]);
        let c = ridge(&law, &[&directions[0], &directions[1]], &[0.5, 0.5], &residual);
        let expected = [2.0 * 4.0 / (4.0 + 4.0), 30.0 * 60.0 / (900.0 + 4.0)];
        // A handful of operations on numbers of order one.
        for (c, expected) in c.iter().zip(expected) {
            assert!((c - expected).abs() < 1e-14, "{c} {expected}");
        }
        // A law that is not there is not off.
        assert_eq!(ridge(&law, &[&directions[0]], &[0.0], &residual), [0.0]);
    }
}
