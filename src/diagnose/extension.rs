//! The extended model: base parameters and effects, fitted together.

use super::candidates::{Candidate, Shape};
use super::drives::Answer;
use super::image::{Column, Image, Span};
use super::scene::Scene;
use super::study::{Entry, Study};
use super::whitening::Whitening;
use crate::identify::Problem;
use crate::robot::JointSignals;
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
    /// Change of the base parameters that would absorb part of the effect if it were left out.
    pub absorbed: Vec<f64>,
}

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
}

impl Extension {
    /// Fits the null model and `entries` to `torque` by least squares in the whitened equations. `torque` is the
    /// study's own, or that of other periods of the same motion.
    pub fn fit(study: &Study, entries: &[&Entry], torque: &Image) -> Self {
        let mut residual = torque.clone();
        study.null.residualise(&mut residual);
        let mut span = Span::default();
        let mut telling = |entry: &&Entry| -> Vec<bool> {
            entry.images.iter().map(|image| span.push(image)).collect()
        };
        let telling: Vec<Vec<bool>> = entries.iter().map(&mut telling).collect();
        let mut solved = span.solve(&residual).into_iter();
        // The coefficient of a column that is a combination of those before it is zero.
        let mut coefficient = |told| if told { solved.next().unwrap_or(0.0) } else { 0.0 };
        let mut effects: Vec<Effect> = entries
            .iter()
            .zip(telling)
            .map(|(entry, telling)| Effect {
                family: entry.family,
                site: entry.site,
                shape: entry.shape,
                coefficients: telling.into_iter().map(&mut coefficient).collect(),
                absorbed: Vec::new(),
            })
            .collect();
        let mut rest = torque.clone();
        for effect in &mut effects {
            let mut own = torque.clone();
            own.scale(0.0);
            for (column, b) in effect.columns(study.families, &study.scene) {
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
        Self { theta, answers, instant_s: study.scene.instant_s(), effects }
    }

    /// The same model for another log, with shapes as [`Candidate::elsewhere`] gives them.
    pub fn elsewhere(&self, families: &[Box<dyn Candidate>]) -> Self {
        let mut out = self.clone();
        for effect in &mut out.effects {
            effect.shape = families[effect.family].elsewhere(effect.shape, &effect.coefficients);
        }
        out
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
            for (column, b) in effect.columns(families, scene) {
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
}
