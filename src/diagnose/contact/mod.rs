//! Contacts: something touched the arm, a torque that comes once and goes.
//!
//! A periodic motion needs no model: at every phase, the torque is compared with the trimmed mean of the other periods,
//! which one contact cannot move, and the deviations are searched for bumps ([`between_periods`]). Lower bumps are
//! accepted where the angles show that the arm moved differently: under a push, a drive yields by far more than an
//! encoder's noise. A single run is compared with the extended model, in samples far from the joint's own reversals,
//! where friction is known best ([`beside_model`]).
//!
//! Enters: the channels of a log, or the residual of a model along it. Leaves: contacts as causes, and the torque
//! without them.

mod beside_model;
mod between_periods;
mod bump;
mod disturbed;
mod loudness;
mod moves;
mod rarity;
mod repeats;
mod scoring;

use std::ops::Range;

use super::kind::Kind;
use super::verdict::{Cause, Estimate};

pub use beside_model::{BesideModel, beside_model};
pub use between_periods::{Compared, WithoutContacts, between_periods};

/// Margin around a contact that is set aside with it, s.
const MARGIN_S: f64 = 0.2;

/// The experiment that separates a push on one joint from one on the arm.
const HARDER: &str = "the same touch, harder or longer";

/// One contact.
#[derive(Debug, Clone, PartialEq)]
struct Touch {
    /// Samples in which the contact is felt.
    samples: Range<usize>,
    start_s: Estimate,
    end_s: Estimate,
    /// Peak torque of the joint that feels it most, Nm, and that joint (1-based).
    peak_nm: Estimate,
    peak_joint: usize,
    /// Joints (1-based) that felt it, and their peak torques, Nm.
    felt: Vec<(usize, f64)>,
    /// Strength in standard deviations of the noise.
    strength: f64,
    /// Whether further joints moved differently, whose torque does not tell whether they were pushed or the arm merely
    /// yielded.
    moved_others: bool,
    /// Confidence that it is a contact.
    confidence: f64,
}

/// Whether two stretches of samples are closer than `margin`.
fn are_near(a: &Range<usize>, b: &Range<usize>, margin: usize) -> bool {
    a.start < b.end + margin && b.start < a.end + margin
}

impl Touch {
    /// Merges with a following contact.
    fn join(&mut self, next: Self) {
        self.samples.end = self.samples.end.max(next.samples.end);
        if next.end_s.value > self.end_s.value {
            self.end_s = next.end_s;
        }
        for (joint, nm) in next.felt {
            match self.felt.iter_mut().find(|(j, _)| *j == joint) {
                Some((_, known)) if known.abs() >= nm.abs() => {}
                Some((_, known)) => *known = nm,
                None => self.felt.push((joint, nm)),
            }
        }
        self.felt.sort_by_key(|(joint, _)| *joint);
        if next.peak_nm.value.abs() > self.peak_nm.value.abs() {
            (self.peak_nm, self.peak_joint) = (next.peak_nm, next.peak_joint);
        }
        self.strength = self.strength.max(next.strength);
        self.moved_others |= next.moved_others;
        self.confidence = self.confidence.max(next.confidence);
    }

    /// Its samples and the margin around them, out of `n` samples in all.
    fn disturbed(&self, rate_hz: f64, n: usize) -> Range<usize> {
        let margin = (MARGIN_S * rate_hz) as usize;
        self.samples.start.saturating_sub(margin)..(self.samples.end + margin).min(n)
    }

    fn cause(&self) -> Cause {
        let joints: Vec<String> =
            self.felt.iter().map(|(j, nm)| format!("joint {j} by {nm:+.1} Nm")).collect();
        let parameters = [
            ("start_s", self.start_s.clone()),
            ("end_s", self.end_s.clone()),
            ("peak_nm", self.peak_nm.clone()),
        ];
        let site = if self.felt.len() == 1 { Some(self.felt[0].0 - 1) } else { None };
        let may_be_of_the_arm = site.is_some() && self.moved_others;
        let class =
            if may_be_of_the_arm { vec![Kind::Contact.name().to_owned()] } else { Vec::new() };
        let in_words = format!("something touched the arm: {}", joints.join(", "));
        Cause {
            class,
            confidence: self.confidence,
            peak_joint: Some(self.peak_joint),
            separating_experiment: may_be_of_the_arm.then_some(HARDER),
            ..Cause::certain(Kind::Contact, site, &in_words, self.strength, &parameters)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A contact felt by the joints `felt`, the first of which feels it most.
    fn touch(start: usize, felt: &[(usize, f64)]) -> Touch {
        Touch {
            samples: start..start + 50,
            start_s: Estimate::exact(start as f64 / 100.0, "s"),
            end_s: Estimate::exact((start + 50) as f64 / 100.0, "s"),
            peak_nm: Estimate::exact(felt[0].1, "Nm"),
            peak_joint: felt[0].0,
            felt: felt.to_vec(),
            strength: 10.0,
            moved_others: false,
            confidence: 1.0,
        }
    }

    #[test]
    fn the_peak_of_a_touch_has_its_joint() {
        let mut both = touch(100, &[(6, 5.5), (1, 28.7)]);
        both.join(touch(150, &[(2, -8.0)]));
        let cause = both.cause();
        assert_eq!(cause.joint, None);
        assert_eq!((cause.peak_joint, cause.parameters["peak_nm"].value), (Some(2), -8.0));
        both.join(touch(200, &[(6, 5.0)]));
        assert_eq!(both.cause().peak_joint, Some(2));
    }
}
