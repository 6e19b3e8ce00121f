//! Two single runs of one motion: how much of their residuals repeats.
//!
//! Noise does not repeat. With e₁ and e₂ the residuals of the same motion recorded twice, each outside its own fit, ρ =
//! ⟨e₁, e₂⟩/(‖e₁‖ ‖e₂‖) is the share of the mean square that a function of the motion could explain, and 1 − √(1 − ρ)
//! the share of the rms error that the best possible model could remove along that motion. ρ does not count what the
//! fits themselves absorb, nor what changes between the runs.

use super::finding::Finding;
use crate::identify::MOVING_RAD_S;
use crate::robot::JointSignals;

/// The share ρ of the residuals that repeats, per joint, over samples in which the joint moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Repeated {
    /// Of the residuals of the null model.
    pub before: Vec<f64>,
    /// Of the residuals with each run's causes in the model.
    pub after: Vec<f64>,
}

/// Longest shift in time between the runs that is tried, s.
const LONGEST_SHIFT_S: f64 = 3.0;
/// Two motions count as the same if their angles agree to this rms, rad.
const SAME_RAD: f64 = 0.005;

/// The share of the residuals of `first` and `second` that repeats; `None` if their motions or sampling differ.
pub fn repeated(first: &Finding, second: &Finding) -> Option<Repeated> {
    let (a, b) = (angles(first), angles(second));
    let rates = [first, second].map(|f| f.identification.processing.rate_hz);
    if (rates[0] / rates[1] - 1.0).abs() > 1e-6 {
        return None;
    }
    let [every, other] =
        [first, second].map(|f| f.samples.get(1).zip(f.samples.first()).map(|(b, a)| b - a));
    let every = every.filter(|_| every == other)?;
    let longest = (LONGEST_SHIFT_S * rates[0] / every as f64) as isize;
    let off = |shift: isize| {
        let (mut square, mut count) = (0.0, 0);
        for j in 0..a.joints() {
            for (k, l) in pairs(a.samples(), b.samples(), shift) {
                square += (a.joint(j)[k] - b.joint(j)[l]).powi(2);
                count += 1;
            }
        }
        // What hardly overlaps is not compared.
        let is_enough = 2 * count >= a.joints() * a.samples().min(b.samples());
        if is_enough { square / count as f64 } else { f64::INFINITY }
    };
    let (shift, square) =
        (-longest..=longest).map(|shift| (shift, off(shift))).min_by(|x, y| x.1.total_cmp(&y.1))?;
    if square.sqrt() > SAME_RAD {
        return None;
    }
    let share = |e: &JointSignals, f: &JointSignals| -> Vec<f64> {
        let of = |j: usize| {
            let qd = first.scene.motion.qd_rad_s.joint(j);
            let mut sums = [0.0; 3];
            for (k, l) in pairs(e.samples(), f.samples(), shift) {
                if qd[first.samples[k]].abs() > MOVING_RAD_S {
                    let (e, f) = (e.joint(j)[k], f.joint(j)[l]);
                    sums[0] += e * f;
                    sums[1] += e * e;
                    sums[2] += f * f;
                }
            }
            sums[0] / (sums[1] * sums[2]).sqrt()
        };
        (0..e.joints()).map(of).collect()
    };
    Some(Repeated {
        before: share(&first.before_nm, &second.before_nm),
        after: share(&first.after_nm, &second.after_nm),
    })
}

/// Angles at the samples of the residuals.
fn angles(finding: &Finding) -> JointSignals {
    let q = &finding.scene.motion.q_rad;
    JointSignals::from_fn(q.joints(), finding.samples.len(), |j, k| q.joint(j)[finding.samples[k]])
}

/// Pairs of samples k of one run and l = k + shift of the other that lie within both.
fn pairs(n: usize, m: usize, shift: isize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).filter_map(move |k| {
        let l = k.checked_add_signed(shift)?;
        (l < m).then_some((k, l))
    })
}
