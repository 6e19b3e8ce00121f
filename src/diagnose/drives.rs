//! How the drives answer dry friction, as columns of the null model ([`Scene::answers`]).
//!
//! The share of its friction that a drive feeds forward is not in the log, and friction that rises near rest looks like
//! another share. But one controller drives all joints: their common share is a column of the null model, and what single
//! ones differ from it by the common error with which a controller knows friction is a torque of known variance, counted as
//! noise that repeats ([`PeriodWhitening::with_repeating_noise`](super::whitening::PeriodWhitening::with_repeating_noise)).
//! A drive that differs by more is a cause like others (`candidates/feed_forward.rs`).
//!
//! A controller acts at its ticks, and its feedback is not quite what the model takes it for: what a drive gives while friction
//! turns round is a little more or less at every single reversal ([`unknown_pulses`]), and so is how the joint turns ([`turns`]), both
//! noise as well.

use rayon::prelude::*;

use super::image::{Column, Image, Span};
use super::scene::{FINE, LONGEST_LEAD_S, Scene};
use super::whitening::Whitening;

/// A column of the null model: joint, place in [`Scene::answers`] and factor of each of its parts.
pub type Answer = Vec<(usize, usize, f64)>;

/// Place of the share in [`Scene::answers`].
const SHARE: usize = 0;
/// That of the lead.
const LEAD: usize = 1;

/// Standard deviation of the shares that drives of one arm feed forward: how well a controller knows the friction of a joint.
const ALIKE: f64 = 0.1;
/// Standard deviation of leads, s: half of the longest that any drive has ([`Scene::can_answer`]).
const USUAL_LEAD_S: f64 = 0.5 * LONGEST_LEAD_S;
/// Standard deviation of what drives do about a reversal beside what it tells, over the difference to feeding nothing or all forward.
/// Chosen, not derived: behind drives that feed half forward 1 of it stands in logs of little noise. With 0.35 and more steep
/// noise has something unexplained, with less clean logs of a thirtieth of the noise have a name (`reports/blind_history.md`).
const TURN: f64 = 0.25;
/// How long before a reversal and how long behind it a drive may give what it does not know, s, in pulses of half the time between
/// samples.
const AROUND_S: [f64; 2] = [0.004, 0.008];
/// A pulse of this length, s, …
const PULSE_S: f64 = 0.004;
/// … has this standard deviation over the step 2 F_c of friction; shorter ones are as independent as longer ones. In logs of
/// clean arms with a thousandth of the benchmark's noise, whose drives feed 0, 0.5 and 0.9 of friction forward with feedback of 25 to
/// 100 rad/s along both its motions, likelihood says 0.004 to 0.03 (of joint 1 along the first 0.07), 0.014 in the median;
/// pulses hold 0.7 to 0.95 of what those leave.
const PULSE_SHARE: f64 = 0.015;
/// Reversals of a joint in one period that have pulses of their own; more share them in turn.
const MOST_REVERSALS: usize = 64;

/// What a drive's feeding nothing of its friction forward adds to the torque; `None` for a single run.
pub fn share(scene: &Scene, joint: usize) -> Option<Column> {
    let answer = scene.answers(joint).get(SHARE)?;
    Some(Column::on(joint, answer.clone()).scaled(scene.coulomb_nm[joint]))
}

/// By joint, by what drives of an arm differ from each other in the share that they feed forward, as a torque of standard
/// deviation one.
pub fn differences(scene: &Scene) -> Vec<(usize, Column)> {
    let of_joint = |j: usize| Some((j, share(scene, j)?.scaled(ALIKE)));
    (0..scene.joints()).filter_map(of_joint).collect()
}

/// By joint, the lead of its drive as a torque of standard deviation one. Where the null model has it as a column that takes it, too.
pub fn leads(scene: &Scene) -> impl Iterator<Item = Column> {
    let of_joint = |j: usize| {
        let answer = scene.answers(j).get(LEAD)?;
        let per_tick = USUAL_LEAD_S / scene.instant_s();
        Some(Column::on(j, answer.clone()).scaled(per_tick * scene.coulomb_nm[j]))
    };
    (0..scene.joints()).filter_map(of_joint)
}

/// By joint, a share of what the record would show of friction if its drive fed nothing or all of it forward, less what its answer
/// to reversals tells, each as a torque of standard deviation one: between two samples a joint turns round as the drive lets it.
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

/// By joint, what its drive may give more or less around single reversals, each of standard deviation one; none for a single run.
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

/// Where a velocity that repeats turns round, going from beyond one `width` of rest to beyond it on the other side.
fn reversals(qd_rad_s: &[f64], width: f64) -> Vec<usize> {
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
        for (which, answer) in scene.answers(joint).iter().enumerate() {
            let column = Column::on(joint, answer.clone());
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A velocity that turns round twice a period, dwells near rest once without turning, and trembles as it turns.
    #[test]
    fn reversals_are_where_friction_turns_round() {
        let qd = [0.5, 0.3, 0.01, 0.4, 0.1, 0.01, -0.01, 0.01, -0.05, -0.4, -0.2, 0.1];
        assert_eq!(reversals(&qd, 0.02), [8, 11]);
        // Wherever the period begins.
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
