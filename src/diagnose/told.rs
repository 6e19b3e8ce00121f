//! Which causes get a sentence, and which share one: a late angle that shows as two causes, and the weaker ones of many
//! touches.
//!
//! The table of causes holds all of them.

use super::kind::Kind;
use super::verdict::{Cause, Estimate, are_unlikely};
use crate::number::significant;

/// Up to this many touches get a sentence each.
const TOUCHES: usize = 5;
/// Up to this many causes are told without an overview of them.
const MANY: usize = 6;

/// The sentences about `causes`, in the order of the causes. Unlikely causes get none ([`in_the_table_alone`]).
pub(super) fn in_sentences(causes: &[Cause], noise_is_known: bool) -> Vec<String> {
    let weaker = weaker_touches(causes);
    let last_touch = causes.iter().rposition(|cause| cause.kind == Kind::Contact);
    let mut out = Vec::new();
    for (c, cause) in causes.iter().enumerate() {
        let is_told_elsewhere =
            weaker.contains(&c) || causes.iter().any(|lag| is_late_angle(lag, cause));
        if !cause.is_unlikely() && !is_told_elsewhere {
            let skew = causes.iter().find(|skew| is_late_angle(cause, skew));
            out.push(match skew {
                Some(skew) => late_angle(cause, skew, noise_is_known),
                None => cause.sentence(noise_is_known),
            });
        }
        if Some(c) == last_touch {
            out.extend(number_of(&weaker, causes));
        }
    }
    if noise_is_known {
        out.extend(causes.iter().filter_map(|bristles| lugre(bristles, causes)));
    }
    out
}

/// The sentence about `bristles` that hold a Stribeck curve among `causes`, as a log that repeats tells: the parts of a
/// LuGre model, by its own parameters. `None` for any other cause.
fn lugre(bristles: &Cause, causes: &[Cause]) -> Option<String> {
    let is_told = |cause: &Cause, kind: Kind| cause.kind == kind && !cause.is_unlikely();
    let curve = causes
        .iter()
        .find(|cause| is_told(cause, Kind::Stribeck) && cause.joint == bristles.joint)?;
    let joint = bristles.joint.filter(|_| is_told(bristles, Kind::Presliding))?;
    let value = |cause: &Cause, name: &str| cause.parameters.get(name).map(|e| e.value);
    let coulomb_nm = value(bristles, "coulomb_nm")?;
    let sigma0 = coulomb_nm * value(bristles, "stiffness_per_rad")?;
    let damping = value(bristles, "damping_s").map_or_else(String::new, |damping_s| {
        format!("σ₁ = {} Nm s/rad, ", significant(sigma0 * damping_s, 3))
    });
    Some(format!(
        "Both laws of joint {joint} are one LuGre model: σ₀ = {} Nm/rad, {damping}F_c = {} Nm, F_s = {} Nm, v_s = {} rad/s.",
        significant(sigma0, 3),
        significant(coulomb_nm, 3),
        significant(coulomb_nm + value(curve, "extra_nm")?, 3),
        significant(value(curve, "vs_rad_s")?, 3),
    ))
}

/// One sentence that says how many causes there are and lists them by kind, for a reader of more than [`MANY`]
/// sentences; `None` if there are fewer. Unlikely causes are not counted.
pub(super) fn overview(causes: &[Cause]) -> Option<String> {
    let likely: Vec<&Cause> = causes.iter().filter(|cause| !cause.is_unlikely()).collect();
    if likely.len() <= MANY {
        return None;
    }
    let mut kinds: Vec<Kind> = Vec::new();
    for cause in &likely {
        if !kinds.contains(&cause.kind) {
            kinds.push(cause.kind);
        }
    }
    let sites = |kind: Kind| {
        let of_kind = likely.iter().filter(move |cause| cause.kind == kind);
        let mut joints: Vec<usize> = of_kind.clone().filter_map(|cause| cause.joint).collect();
        joints.sort_unstable();
        joints.dedup();
        let joints: Vec<String> = joints.iter().map(usize::to_string).collect();
        let of_joints = match &joints[..] {
            [] => None,
            [one] => Some(format!("joint {one}")),
            _ => Some(format!("joints {}", joints.join(", "))),
        };
        let is_of_all = of_kind.clone().any(|cause| cause.joint.is_none());
        let of_arm = (is_of_all && !kind.is_of_the_record()).then(|| "the arm".to_owned());
        let on: Vec<String> = of_arm.into_iter().chain(of_joints).collect();
        match of_kind.count() {
            times if kind == Kind::Contact && times > 1 => format!("{kind} ({times} times)"),
            _ if on.is_empty() => kind.to_string(),
            _ => format!("{kind} ({})", on.join(", ")),
        }
    };
    let kinds: Vec<String> = kinds.into_iter().map(sites).collect();
    Some(format!("{} causes are named: {}.", likely.len(), kinds.join(", ")))
}

/// The sentence about a log of which nothing but unlikely `causes` is known; `None` for any other.
pub(super) fn without_a_name(causes: &[Cause]) -> Option<String> {
    are_unlikely(causes).then(|| {
        "The log shows more than chance explains, but no known effect explains it well.".to_owned()
    })
}

/// One sentence with the names of the causes that are too unlikely for a sentence of their own; `None` if there are
/// none.
pub(super) fn in_the_table_alone(causes: &[Cause]) -> Option<String> {
    let name = |cause: &Cause| match cause.joint {
        Some(j) => format!("{} (joint {j})", cause.kind),
        None => cause.kind.to_string(),
    };
    let names: Vec<String> = causes.iter().filter(|c| c.is_unlikely()).map(name).collect();
    (!names.is_empty()).then(|| {
        format!(
            "In the table alone, because something else is likelier by far (confidence below 0.1 %): {}.",
            names.join(", ")
        )
    })
}

/// Indices of the touches beyond the [`TOUCHES`] strongest.
fn weaker_touches(causes: &[Cause]) -> Vec<usize> {
    let is_touch = |c: &usize| causes[*c].kind == Kind::Contact && !causes[*c].is_unlikely();
    let mut touches: Vec<usize> = (0..causes.len()).filter(is_touch).collect();
    touches.sort_by(|a, b| causes[*b].strength.total_cmp(&causes[*a].strength));
    touches.into_iter().skip(TOUCHES).collect()
}

/// The sentence that says how many `weaker` touches there are, and when; `None` if there are none.
fn number_of(weaker: &[usize], causes: &[Cause]) -> Option<String> {
    let at = |name: &'static str| {
        weaker.iter().filter_map(move |c| Some(causes[*c].parameters.get(name)?.value))
    };
    let first_s = at("start_s").fold(f64::INFINITY, f64::min);
    let last_s = at("end_s").fold(f64::NEG_INFINITY, f64::max);
    (!weaker.is_empty()).then(|| {
        format!(
            "And {} more, less clear, between {first_s:.2} s and {last_s:.2} s, which are in the table.",
            weaker.len()
        )
    })
}

/// Whether `lag` and `skew` together say that an angle is late: velocity and torque are both early against it, by times
/// whose 95 % intervals overlap.
fn is_late_angle(lag: &Cause, skew: &Cause) -> bool {
    if (lag.kind, skew.kind) != (Kind::VelocityLag, Kind::TimeSkew)
        || lag.joint != skew.joint
        || lag.is_doubtful()
        || skew.is_doubtful()
    {
        return false;
    }
    let delay = |cause: &Cause| cause.parameters.get("delay_s").cloned();
    let (Some(lag), Some(skew)) = (delay(lag), delay(skew)) else { return false };
    let are_early = lag.ci95[1] < 0.0 && skew.ci95[1] < 0.0;
    are_early && lag.ci95[0] <= skew.ci95[1] && skew.ci95[0] <= lag.ci95[1]
}

/// The sentence about an angle that is late ([`is_late_angle`]). It states the delay by the velocity, which tells it
/// far better than the torque.
fn late_angle(lag: &Cause, skew: &Cause, noise_is_known: bool) -> String {
    let early = |cause: &Cause| {
        let delay = &cause.parameters["delay_s"];
        let [low, high] = delay.ci95;
        Estimate { value: -delay.value, unit: delay.unit, ci95: [-high, -low] }.in_words()
    };
    let (velocity, torque) = (early(lag), early(skew));
    let whose = match lag.joint {
        Some(j) => format!("The angle of joint {j} is"),
        None => "The angles of all joints are".to_owned(),
    };
    let gain = skew.gain_in_words(noise_is_known).unwrap_or_default();
    format!(
        "{whose} recorded {velocity} late (that is: against the angle the velocity is as early, and the torque is early by {torque}).{gain}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delay(kind: Kind, joint: usize, value: f64, half: f64) -> Cause {
        let estimate = Estimate { value, unit: "s", ci95: [value - half, value + half] };
        Cause::certain(kind, Some(joint), "a delay", 20.0, &[("delay_s", estimate)])
    }

    /// An angle that is 2 ms late shows as two causes of one joint, which share one sentence.
    #[test]
    fn an_angle_that_is_late_is_one_sentence() {
        let lag = delay(Kind::VelocityLag, 1, -0.00196, 0.00003);
        let skew =
            Cause { gain_fraction: Some(0.961), ..delay(Kind::TimeSkew, 1, -0.00202, 0.00019) };
        let said = in_sentences(&[lag.clone(), skew.clone()], true);
        let late = "The angle of joint 2 is recorded 0.001960 ± 0.000030 s late (that is: against the angle the velocity is as early, \
                    and the torque is early by 0.00202 ± 0.00019 s).";
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].starts_with(late) && said[0].contains("removes 96 %"), "{said:?}");
        // These do not: the torque of another joint, a torque that is late, one that is early by another time, and one
        // that may be something else.
        for other in [
            delay(Kind::TimeSkew, 2, -0.00202, 0.00019),
            delay(Kind::TimeSkew, 1, 0.00202, 0.00019),
            delay(Kind::TimeSkew, 1, -0.004, 0.00019),
            Cause { confidence: 0.4, ..skew },
        ] {
            assert_eq!(in_sentences(&[lag.clone(), other], true).len(), 2);
        }
    }

    /// Bristles of 1000 /rad and 2 Nm with a damping of 2 ms, and a curve of 0.5 Nm.
    #[test]
    fn bristles_with_a_curve_are_lugres() {
        let law = |kind: Kind, joint: usize, parameters: &[(&'static str, f64)]| {
            let parameters: Vec<(&str, Estimate)> = parameters
                .iter()
                .map(|(name, value)| (*name, Estimate::exact(*value, "")))
                .collect();
            Cause::certain(kind, Some(joint), "a law", 20.0, &parameters)
        };
        let of_bristles =
            [("coulomb_nm", 2.0), ("stiffness_per_rad", 1000.0), ("damping_s", 0.002)];
        let of_curve = [("extra_nm", 0.5), ("vs_rad_s", 0.1)];
        let bristles = law(Kind::Presliding, 3, &of_bristles);
        let curve = law(Kind::Stribeck, 3, &of_curve);
        let said = in_sentences(&[curve.clone(), bristles.clone()], true);
        let lugre = "Both laws of joint 4 are one LuGre model: σ₀ = 2000 Nm/rad, σ₁ = 4.00 Nm s/rad, F_c = 2.00 Nm, F_s = 2.50 Nm, v_s = 0.100 rad/s.";
        assert_eq!((said.len(), &*said[2]), (3, lugre));
        // Of a single run, or of another joint, they are laws of their own.
        assert_eq!(in_sentences(&[curve.clone(), bristles], false).len(), 2);
        let elsewhere = law(Kind::Presliding, 2, &of_bristles[..2]);
        assert_eq!(in_sentences(&[curve, elsewhere], true).len(), 2);
    }

    fn touch(start_s: f64, strength: f64) -> Cause {
        let [start, end] = [start_s, start_s + 0.5].map(|t| Estimate::exact(t, "s"));
        let words = "something touched the arm: joint 6 by +1.0 Nm";
        Cause::certain(
            Kind::Contact,
            Some(5),
            words,
            strength,
            &[("start_s", start), ("end_s", end)],
        )
    }

    #[test]
    fn of_many_touches_the_strongest_are_told() {
        let drift = delay(Kind::VelocityLag, 0, 0.001, 0.0001);
        let touches = (1..=7).map(|k| touch(k as f64, if k == 2 { 9.0 } else { 10.0 - k as f64 }));
        let causes: Vec<Cause> = touches.chain([drift]).collect();
        let said = in_sentences(&causes, false);
        assert_eq!(said.len(), 7, "{said:#?}");
        for (k, said) in said[..5].iter().enumerate() {
            assert!(said.starts_with(&format!("From {}.00 s", k + 1)), "{said}");
        }
        let more = "And 2 more, less clear, between 6.00 s and 7.50 s, which are in the table.";
        assert_eq!(said[5], more);
        assert!(said[6].starts_with("Joint 1's record"));
        assert_eq!(in_sentences(&causes[..5], false).len(), 5);
    }

    #[test]
    fn many_causes_have_an_overview() {
        let gear = |joint| Cause::certain(Kind::Elasticity, Some(joint), "a soft gear", 9.0, &[]);
        let payload = Cause::certain(Kind::Payload, None, "a body", 9.0, &[]);
        let unlikely = Cause { confidence: 5e-4, ..delay(Kind::TimeSkew, 1, 0.001, 0.0001) };
        let touches = [touch(1.0, 10.0), touch(3.0, 9.0)];
        let mut causes: Vec<Cause> = [gear(4), gear(1), payload, unlikely].into();
        causes.extend(touches);
        causes.push(delay(Kind::VelocityLag, 0, 0.001, 0.0001));
        assert_eq!(overview(&causes), None);
        causes.push(gear(2));
        assert_eq!(
            overview(&causes).unwrap(),
            "7 causes are named: elasticity (joints 2, 3, 5), payload (the arm), contact (2 times), velocity_lag (joint 1)."
        );
    }

    #[test]
    fn what_is_unlikely_leads_nowhere() {
        let likely = touch(1.0, 10.0);
        let unlikely = Cause {
            confidence: 5e-4,
            ..Cause::certain(Kind::Elasticity, Some(0), "a soft gear", 5.9, &[])
        };
        let causes = [unlikely, likely];
        assert_eq!(in_sentences(&causes, true), [causes[1].sentence(true)]);
        let said = in_the_table_alone(&causes).unwrap();
        assert!(said.ends_with("(confidence below 0.1 %): elasticity (joint 1)."), "{said}");
        assert_eq!(in_the_table_alone(&causes[1..]), None);
        assert!(without_a_name(&causes[..1]).is_some());
        assert_eq!(without_a_name(&causes), None);
        assert_eq!(without_a_name(&[]), None);
    }
}
