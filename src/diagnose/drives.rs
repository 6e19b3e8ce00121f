//! How the drives answer dry friction, as columns of the null model ([`Scene::answers`]).
//!
//! The share of its friction that a drive feeds forward is not in the log, and friction that rises near rest looks like
//! another share. But one controller drives all joints: a single one that seems to feed another share than the others may as
//! well have friction that the model does not know. Both are tried, and the evidence decides.

use super::image::{Column, Image, Span};
use super::scene::Scene;
use super::whitening::Whitening;

/// A column of the null model: joint, place in [`Scene::answers`] and factor of each of its parts.
pub type Answer = Vec<(usize, usize, f64)>;

/// What is taken for granted of the drives of an arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drives {
    /// Each feeds a share of its own forward.
    Differ,
    /// All feed the same share forward.
    Alike,
}

/// Shares are no further apart than this, beside [`ODD_SIGMA`] of what noise does to them: a controller knows the friction
/// of its joints that well.
const ALIKE: f64 = 0.2;
/// By chance alone one of six drives seems odd in less than one of 2000 logs.
const ODD_SIGMA: f64 = 4.0;
/// Of fewer drives none is odd.
const LEAST_DRIVES: usize = 3;

/// Every drive's answers, fitted beside a rigid model.
pub struct Answers {
    fitted: Vec<Fitted>,
}

struct Fitted {
    joint: usize,
    /// Place in [`Scene::answers`].
    which: usize,
    image: Image,
    coefficient: f64,
    sigma: f64,
}

impl Answers {
    /// Fitted to `torque` beside the span of `rigid`; without those that no drive gives ([`Scene::can_answer`]).
    pub fn of(scene: &Scene, whitening: &Whitening, rigid: &Span, torque: &Image) -> Self {
        let mut all = rigid.clone();
        let mut fitted = Vec::new();
        for joint in 0..scene.joints() {
            for (which, column) in scene.answers(joint).into_iter().enumerate() {
                let image = whitening.image(&Column::on(joint, column));
                if all.push(&image) {
                    fitted.push(Fitted { joint, which, image, coefficient: 0.0, sigma: 0.0 });
                }
            }
        }
        let (b, covariance) = (all.solve(torque), all.inverse_gram());
        for (k, own) in (rigid.len()..).zip(&mut fitted) {
            (own.coefficient, own.sigma) = (b[k], covariance[(k, k)].sqrt());
        }
        fitted.retain(|own| scene.can_answer(own.joint, own.which, own.coefficient));
        Self { fitted }
    }

    /// How many drives seem to feed another share of their friction forward than the middle one of all, by weight.
    pub fn odd(&self, coulomb_nm: &[f64]) -> usize {
        let share = |own: &Fitted| {
            let friction = coulomb_nm[own.joint];
            (own.coefficient / friction, own.sigma / friction)
        };
        let feeds = |own: &&Fitted| own.which == 0 && coulomb_nm[own.joint] > 0.0;
        let mut shares: Vec<(f64, f64)> = self.fitted.iter().filter(feeds).map(share).collect();
        if shares.len() < LEAST_DRIVES {
            return 0;
        }
        shares.sort_by(|a, b| a.0.total_cmp(&b.0));
        let weight = |(_, sigma): &(f64, f64)| sigma.powi(-2);
        let mut left = 0.5 * shares.iter().map(weight).sum::<f64>();
        let middle = shares.iter().find(|share| {
            left -= weight(share);
            left <= 0.0
        });
        let middle = middle.map_or(f64::NAN, |(share, _)| *share);
        let is_odd =
            |(share, sigma): &&(f64, f64)| (share - middle).abs() > ALIKE + ODD_SIGMA * sigma;
        shares.iter().filter(is_odd).count()
    }

    /// As columns of a null model.
    pub fn columns(self, coulomb_nm: &[f64], drives: Drives) -> Vec<(Answer, Image)> {
        let mut together = Answer::new();
        let mut of_all: Option<Image> = None;
        let mut columns = Vec::new();
        for Fitted { joint, which, image, .. } in self.fitted {
            if which != 0 || drives == Drives::Differ {
                columns.push((vec![(joint, which, 1.0)], image));
                continue;
            }
            let friction = coulomb_nm[joint];
            together.push((joint, which, friction));
            let sum = of_all.get_or_insert_with(|| Image {
                mean: vec![0.0; image.mean.len()],
                contrast: Vec::new(),
            });
            sum.add(friction, &image);
        }
        columns.extend(of_all.map(|image| (together, image)));
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers of drives with the friction of one Nm, each in a row of its own.
    fn answers(shares: &[f64]) -> Answers {
        let fitted = |(joint, coefficient): (usize, &f64)| {
            let mut image = Image { mean: vec![0.0; shares.len()], contrast: Vec::new() };
            image.mean[joint] = 1.0;
            Fitted { joint, which: 0, image, coefficient: *coefficient, sigma: 0.05 }
        };
        Answers { fitted: shares.iter().enumerate().map(fitted).collect() }
    }

    #[test]
    fn a_drive_is_odd_among_those_that_are_alike() {
        let friction = [1.0; 6];
        // 0.2 beside four times 0.05, from the middle one.
        assert_eq!(answers(&[0.1, 0.0, -0.1, 0.05, 0.39, 0.0]).odd(&friction), 0);
        assert_eq!(answers(&[0.1, 0.0, -0.1, 0.05, 0.46, 0.0]).odd(&friction), 1);
        assert_eq!(answers(&[1.0, 0.9, 0.4, 1.1, 0.3, 1.0]).odd(&friction), 2);
        assert_eq!(answers(&[0.0, 1.0]).odd(&friction), 0, "nobody knows which");
    }

    #[test]
    fn drives_that_are_alike_have_one_column() {
        let friction = [2.0, 3.0, 5.0];
        assert_eq!(answers(&[0.0; 3]).columns(&friction, Drives::Differ).len(), 3);
        let alike = answers(&[0.0; 3]).columns(&friction, Drives::Alike);
        let [(parts, image)] = &alike[..] else { panic!("one column") };
        assert_eq!(parts[..], [(0, 0, 2.0), (1, 0, 3.0), (2, 0, 5.0)]);
        assert_eq!(image.mean, friction);
    }
}
