//! What laws may leave because they are not exact.

use super::extension::Effect;
use super::judgement::Selected;
use super::kind::Kind;
use super::study::Study;
use super::verdict::Cause;

/// Laws are exact to this share of what they do, in units of the noise; less of it than that is no other effect. The
/// right law of a strong effect in the simulated arm left 0.015 Nm of a ripple of 0.8 Nm; of 38 wrong laws of strong
/// effects that were withheld none left as little as this share.
pub(super) const EXACT: f64 = 0.03;
/// A law with less confidence than this has no form that could be wrong.
const LIKELY: f64 = 0.5;

/// A law of one joint, and λ of what it does there.
pub(super) struct OnJoint {
    kind: Kind,
    joint: usize,
    lambda: f64,
}

impl OnJoint {
    /// The likely ones among the laws `selected` for one joint. What they do to other joints, and laws of the arm as a
    /// whole, are no part of it.
    pub(super) fn of(study: &Study, selected: &[Selected], effects: &[Effect]) -> Vec<Self> {
        let likely = selected.iter().zip(effects).filter(|(s, _)| s.confidence > LIKELY);
        let on_joint = |(s, effect): (&Selected, &Effect)| {
            let (entry, kind) = (&s.contender.entry, study.families[effect.family].kind());
            let on_joint = |j| study.square_on(j, entry, &effect.coefficients);
            effect.site.map(|joint| Self { kind, joint, lambda: on_joint(joint) })
        };
        likely.filter_map(on_joint).collect()
    }
}

/// λ that the `laws` among the `causes` may leave on each joint because they are not exact.
pub(super) fn error_of_form(laws: &[OnJoint], causes: &[Cause], joints: usize) -> Vec<f64> {
    let is_named = |law: &&OnJoint| {
        causes.iter().any(|cause| (cause.kind, cause.joint) == (law.kind, Some(law.joint + 1)))
    };
    let mut form = vec![0.0; joints];
    let named = laws.iter().filter(is_named);
    named.for_each(|law| form[law.joint] += EXACT * EXACT * law.lambda);
    form
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two laws, one is named: a law that did not stay among the causes excuses nothing.
    #[test]
    fn only_laws_that_are_named_may_be_inexact() {
        let law = |kind, joint| OnJoint { kind, joint, lambda: 1e4 };
        let laws = [law(Kind::Ripple, 0), law(Kind::Spring, 2)];
        let causes = [Cause::certain(Kind::Ripple, Some(0), "ripple", 100.0, &[])];
        let form = error_of_form(&laws, &causes, 3);
        assert!((form[0] - 9.0).abs() < 1e-9 && form[1..] == [0.0, 0.0], "{form:?}");
    }
}
