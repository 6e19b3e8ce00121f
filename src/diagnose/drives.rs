//! How the drives answer dry friction, as columns of the null model ([`Scene::answers`]).
//!
//! The share of its friction that a drive feeds forward is not in the log, and friction that rises near rest looks like
//! another share. But one controller drives all joints: their common share is a column of the null model, and what single
//! ones differ from it by the common error with which a controller knows friction is a torque of known variance, counted as
//! noise that repeats ([`PeriodWhitening::with_repeating_noise`](super::whitening::PeriodWhitening::with_repeating_noise)).
//! A drive that differs by more is a cause like others (`candidates/feed_forward.rs`).

use super::image::{Column, Image, Span};
use super::scene::Scene;
use super::whitening::Whitening;

/// A column of the null model: joint, place in [`Scene::answers`] and factor of each of its parts.
pub type Answer = Vec<(usize, usize, f64)>;

/// Place of the share in [`Scene::answers`].
const SHARE: usize = 0;

/// Standard deviation of the shares that drives of one arm feed forward: how well a controller knows the friction of a joint.
const ALIKE: f64 = 0.1;

/// What a drive's feeding nothing of its friction forward adds to the torque; `None` for a single run.
pub fn share(scene: &Scene, joint: usize) -> Option<Column> {
    let answer = scene.answers(joint).into_iter().nth(SHARE)?;
    Some(Column::on(joint, answer).scaled(scene.coulomb_nm[joint]))
}

/// By joint, torques by which the drives of an arm differ from each other, each of standard deviation one.
pub fn differences(scene: &Scene) -> Vec<(usize, Column)> {
    let of_joint = |j: usize| Some((j, share(scene, j)?.scaled(ALIKE)));
    (0..scene.joints()).filter_map(of_joint).collect()
}

/// Columns of the null model beside those of the rigid one, `rigid`: the lead of each drive but of those that no drive has
/// ([`Scene::can_answer`]; fitted to `torque` with a share of each drive's own), and the share that all feed forward.
pub fn answers(
    scene: &Scene,
    whitening: &Whitening,
    rigid: &Span,
    torque: &Image,
) -> Vec<(Answer, Image)> {
    let mut together = (Answer::new(), Column::default());
    let mut all = rigid.clone();
    let mut columns: Vec<(Answer, Image)> = Vec::new();
    let mut places = Vec::new();
    for joint in 0..scene.joints() {
        for (which, answer) in scene.answers(joint).into_iter().enumerate() {
            let column = Column::on(joint, answer);
            let image = whitening.image(&column);
            // A joint that stands still answers nothing.
            if !all.push(&image) {
                continue;
            }
            if which == SHARE {
                let friction = scene.coulomb_nm[joint];
                together.0.push((joint, which, friction));
                together.1.parts.extend(column.scaled(friction).parts);
            } else {
                places.push(all.len() - 1);
                columns.push((vec![(joint, which, 1.0)], image));
            }
        }
    }
    let b = all.solve(torque);
    let mut fitted = places.into_iter().map(|place| b[place]);
    columns.retain(|(answer, _)| {
        let (joint, which, _) = answer[0];
        fitted.next().is_some_and(|b| scene.can_answer(joint, which, b))
    });
    let (answer, column) = together;
    if !answer.is_empty() {
        columns.push((answer, whitening.image(&column)));
    }
    columns
}
