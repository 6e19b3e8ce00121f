//! How the drives answer dry friction, as columns of the null model ([`Scene::answers`]).
//!
//! The log does not contain the share of its friction that a drive feeds forward, and friction that rises near rest
//! looks like another share. But one controller drives all joints. Their common share is therefore a column of the null
//! model. Single drives differ from it by the typical error with which a controller knows the friction of a joint; this
//! difference is a torque of known variance, and counts as noise that repeats in every period
//! ([`PeriodWhitening::with_repeating_noise`](super::whitening::PeriodWhitening::with_repeating_noise)). A drive that
//! differs by more is a cause like any other (`candidates/feed_forward.rs`).
//!
//! A controller acts at its ticks, and its feedback is not exactly as modelled. While friction turns round, a drive
//! therefore gives a little more or less torque at every single reversal ([`unknown_pulses`]), and the joint itself
//! turns round in a slightly different way ([`turns`]). Both count as noise as well.

use rayon::prelude::*;

use super::image::{Column, Image, Span};
use super::scene::{FINE, LONGEST_LEAD_S, Scene};
use super::whitening::Whitening;

/// A column of the null model: for each of its parts the joint, the index in [`Scene::answers`] and the factor.
pub type Answer = Vec<(usize, usize, f64)>;

/// Index of the share in [`Scene::answers`].
pub(super) const SHARE: usize = 0;
/// Index of the lead in [`Scene::answers`].
const LEAD: usize = 1;

/// Standard deviation of the shares that the drives of one arm feed forward: how well a controller knows the friction
/// of a joint.
const ALIKE: f64 = 0.1;
/// Standard deviation of the leads, s: half of the longest lead that a drive may have ([`Scene::can_answer`]).
const USUAL_LEAD_S: f64 = 0.5 * LONGEST_LEAD_S;
/// Standard deviation of the unknown part of the turning of joints at reversals, over the difference to a drive that
/// feeds nothing or all of its friction forward. The value is chosen, not derived: behind drives that feed half
/// forward, logs of little noise show 1 times this difference. With 0.35 and more, something unexplained appears in
/// steep noise; with less than 0.25, clean logs with a thirtieth of the noise are given a cause
/// (`reports/blind_history.md`).
const TURN: f64 = 0.25;
/// Time before and after a reversal during which a drive may give an unknown torque, s. It is divided into pulses of
/// half a sample each.
const AROUND_S: [f64; 2] = [0.004, 0.008];
/// Length of a reference pulse, s ([`PULSE_SHARE`]).
const PULSE_S: f64 = 0.004;
/// Standard deviation of a pulse of length [`PULSE_S`], over the step 2 F_c of friction. Shorter pulses are as
/// independent as longer ones, so that it goes as 1/√length. In logs of clean arms with a thousandth of the benchmark's
/// noise, whose drives feed 0, 0.5 and 0.9 of the friction forward with feedback of 25 to 100 rad/s along both motions
/// of the benchmark, the likelihood gives 0.004 to 0.03 (0.07 for joint 1 along the first motion), with a median of
/// 0.014. Pulses contain 0.7 to 0.95 of the residual left there.
const PULSE_SHARE: f64 = 0.015;
/// Number of reversals of a joint in one period that have pulses of their own; any further ones share these in turn.
const MOST_REVERSALS: usize = 64;

/// Torque that is added if the drive of `joint` feeds nothing of its friction forward; `None` for a single run.
pub fn share(scene: &Scene, joint: usize) -> Option<Column> {
    let answer = scene.answers(joint).get(SHARE)?;
    Some(Column::on(joint, answer.clone()).scaled(scene.coulomb_nm[joint]))
}

/// For each joint, the torque by which the shares that the drives of one arm feed forward differ, at one standard
/// deviation.
pub fn differences(scene: &Scene) -> Vec<(usize, Column)> {
    let of_joint = |j: usize| Some((j, share(scene, j)?.scaled(ALIKE)));
    (0..scene.joints()).filter_map(of_joint).collect()
}

/// For each joint, the torque of its drive's lead, at one standard deviation. Where the lead is also a column of the
/// null model, that column absorbs this torque.
pub fn leads(scene: &Scene) -> impl Iterator<Item = Column> {
    let of_joint = |j: usize| {
        let answer = scene.answers(j).get(LEAD)?;
        let per_tick = USUAL_LEAD_S / scene.instant_s();
        Some(Column::on(j, answer.clone()).scaled(per_tick * scene.coulomb_nm[j]))
    };
    (0..scene.joints()).filter_map(of_joint)
}

/// For each joint, two torques at one standard deviation: a share of the friction that the record would show if the
/// drive fed nothing, or all, of it forward, minus that for the velocity told by the drive's answer to reversals.
/// Between two samples, a joint turns round as its drive lets it.
pub fn turns(scene: &Scene) -> impl Iterator<Item = Column> {
    let joints = if scene.periodic { scene.joints() } else { 0 };
    let if_fed = |(j, fed): (usize, usize)| {
        let pairs = scene.sign_if_fed(j, fed).iter().zip(&scene.instants(j).sign);
        let change_nm =
            pairs.map(|(fed, told)| TURN * scene.coulomb_nm[j] * (fed - told)).collect();
        Column::on(j, scene.as_logged(change_nm))
    };
    (0..joints).flat_map(|j| [(j, 0), (j, 1)]).map(if_fed)
}

/// For each joint, the torques that its drive may give in addition around single reversals, each at one standard
/// deviation; none for a single run.
pub fn unknown_pulses(scene: &Scene) -> Vec<(usize, Vec<Column>)> {
    if !scene.periodic {
        return Vec::new();
    }
    let pulse_ticks = FINE as i64 / 2;
    let pulse_s = pulse_ticks as f64 * scene.instant_s();
    let share = PULSE_SHARE * (PULSE_S / pulse_s).sqrt();
    let [before, behind] = AROUND_S.map(|s| (s / pulse_s).round().max(1.0) as i64);
    let of_joint = |j: usize| {
        let qd_rad_s = &scene.instants(j).qd_rad_s;
        let ticks = qd_rad_s.len();
        let reversals = reversals(qd_rad_s, scene.arm.friction_epsilon_rad_s);
        let height_nm = share * 2.0 * scene.coulomb_nm[j].abs();
        let groups = reversals.len().min(MOST_REVERSALS);
        let pulse = |(group, which): (usize, i64)| {
            let mut given_nm = vec![0.0; ticks];
            for &reversal in reversals.iter().skip(group).step_by(MOST_REVERSALS) {
                let start = reversal as i64 + which * pulse_ticks;
                for tick in start..start + pulse_ticks {
                    given_nm[tick.rem_euclid(ticks as i64) as usize] = height_nm;
                }
            }
            Column::on(j, scene.as_logged_but(vec![0.0; ticks], &given_nm))
        };
        let pulses =
            (0..groups).flat_map(|group| (-before..behind).map(move |which| (group, which)));
        (j, pulses.map(pulse).collect())
    };
    (0..scene.joints()).into_par_iter().map(of_joint).collect()
}

/// Indices at which a periodic velocity reverses: it passes from beyond one `width` of rest to beyond it on the other
/// side.
pub(super) fn reversals(qd_rad_s: &[f64], width: f64) -> Vec<usize> {
    let n = qd_rad_s.len();
    let Some(start) = qd_rad_s.iter().position(|qd| qd.abs() > width) else { return Vec::new() };
    let mut sign = qd_rad_s[start].signum();
    let (mut out, mut last) = (Vec::new(), start);
    for k in (start + 1..=start + n).map(|k| k % n) {
        let qd = sign * qd_rad_s[k];
        if qd >= 0.0 {
            last = k;
        } else if qd < -width {
            out.push((last + 1) % n);
            (sign, last) = (-sign, k);
        }
    }
    out
}

/// Columns of the null model in addition to the rigid ones (`rigid`): the lead of each drive, and the share that all
/// drives feed forward. Leads longer than a drive can have are left out ([`Scene::can_answer`]); they are fitted to
/// `torque` together with a share for each drive.
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
        for (which, answer) in scene.answers(joint).iter().enumerate() {
            let column = Column::on(joint, answer.clone());
            let image = whitening.image(&column);
            // The columns of a joint that stands still vanish.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A velocity that reverses twice in a period, once stays near rest without reversing, and trembles as it reverses.
    #[test]
    fn reversals_are_where_friction_turns_round() {
        let qd = [0.5, 0.3, 0.01, 0.4, 0.1, 0.01, -0.01, 0.01, -0.05, -0.4, -0.2, 0.1];
        assert_eq!(reversals(&qd, 0.02), [8, 11]);
        // The result does not depend on where the period begins.
        for shift in 0..qd.len() {
            let mut turned = qd;
            turned.rotate_left(shift);
            let mut expected = [8, 11].map(|k| (k + qd.len() - shift) % qd.len());
            expected.sort_unstable();
            let mut found = reversals(&turned, 0.02);
            found.sort_unstable();
            assert_eq!(found, expected, "{shift}");
        }
        assert!(reversals(&[0.01, -0.01], 0.02).is_empty());
        assert!(reversals(&[1.0, 0.5], 0.02).is_empty());
    }
}
