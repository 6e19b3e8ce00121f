//! The summary of the case study: the findings in plain words, and the targets reached or missed.

use super::super::{Status, Verdict, file_name};
use super::{RealArmStudy, mean, percents};
use crate::diagnose::{Cause, HeldOut, Kind};
use crate::number::significant;

/// Targeted reduction of the rms error on held-out runs, mean over the joints.
const AIM_MEAN: f64 = 0.35;
/// Targeted reduction on every single joint.
const AIM_JOINT: f64 = 0.2;
/// Kinds of cause listed in the summary.
const FIRST_SCREEN: usize = 4;

/// Joints (from 1) whose reduction is below the target.
fn short_of_aim(gains: &[f64]) -> Vec<usize> {
    (1..).zip(gains).filter(|(_, gain)| **gain < AIM_JOINT).map(|(j, _)| j).collect()
}

fn reaches_aim(gains: &[f64]) -> bool {
    mean(gains) >= AIM_MEAN && short_of_aim(gains).is_empty()
}

/// `joint 2`, `joints 2 and 3`, `joints 1, 2 and 3`.
fn on_joints(joints: &[usize]) -> String {
    let words: Vec<String> = joints.iter().map(usize::to_string).collect();
    match words.split_last() {
        None => "the arm as a whole".to_owned(),
        Some((only, [])) => format!("joint {only}"),
        Some((last, others)) => format!("joints {} and {last}", others.join(", ")),
    }
}

/// Joints whose velocity lags, and the longest lag, s. A late torque also has a delay but is a different cause.
fn velocity_lags(causes: &[Cause]) -> (Vec<usize>, f64) {
    let late = || causes.iter().filter(|cause| cause.kind == Kind::VelocityLag);
    let delay_s = |cause: &Cause| Some(cause.parameters.get("delay_s")?.value.abs());
    (
        late().filter_map(|cause| cause.joint).collect(),
        late().filter_map(delay_s).fold(0.0, f64::max),
    )
}

impl RealArmStudy {
    /// The verdict with its facts.
    pub(super) fn verdict(&self) -> Verdict {
        let (all, moving) = (self.all_gains(), self.moving_gains());
        let percent = |gains: &[f64]| format!("{:.0} %", 100.0 * mean(gains));
        let mut sentence = format!(
            "On runs of other days, naming what the rigid model misses lowers its rms error by {} (mean of the \
             joints)",
            percent(&all)
        );
        if reaches_aim(&moving) {
            sentence += &format!(", {} in samples in which the joint moves.", percent(&moving));
        } else {
            sentence += &format!(
                "; in samples in which the joint moves by {}, less than aimed at.",
                percent(&moving)
            );
        }
        let is_good = reaches_aim(&all) && reaches_aim(&moving);
        let mut facts: Vec<String> = self.physics();
        facts.extend(self.record());
        facts.push(self.aim("all samples", &all));
        facts.push(self.aim("samples in which the joint moves", &moving));
        facts.push(self.beside_the_manufacturer());
        facts.push(self.body());
        let status = if is_good { Status::Good } else { Status::Warn };
        Verdict { status, sentence, facts }
    }

    /// One sentence per kind of cause, in the order in which the diagnosis lists the causes.
    fn physics(&self) -> Vec<String> {
        let causes = self.finding.diagnosis.causes.iter();
        let physics: Vec<&Cause> = causes.filter(|c| !c.kind.is_of_the_record()).collect();
        let mut kinds = Vec::new();
        for cause in &physics {
            if !kinds.contains(&cause.kind) {
                kinds.push(cause.kind);
            }
        }
        let sentence = |kind| {
            let alike: Vec<&&Cause> = physics.iter().filter(|c| c.kind == kind).collect();
            let mut joints: Vec<usize> = alike.iter().filter_map(|c| c.joint).collect();
            joints.sort_unstable();
            joints.dedup();
            let most = alike.iter().filter_map(|c| c.gain_fraction).fold(0.0, f64::max);
            let words = alike.first().map_or("", |c| c.in_words.as_str());
            format!(
                "The model misses {words}, on {}: up to {:.0} % of a joint's mean square error.",
                on_joints(&joints),
                100.0 * most
            )
        };
        kinds.into_iter().take(FIRST_SCREEN).map(sentence).collect()
    }

    /// The defect of the recording itself, a lagging velocity, if there is one.
    fn record(&self) -> Option<String> {
        let (joints, longest) = velocity_lags(&self.finding.diagnosis.causes);
        (longest > 0.0).then(|| {
            format!(
                "The recording's velocity lags behind its angle by up to {} ms on {}; both models read it back.",
                significant(1e3 * longest, 2),
                on_joints(&joints)
            )
        })
    }

    fn aim(&self, samples: &str, gains: &[f64]) -> String {
        let aim = format!(
            "{:.0} % in the mean, {:.0} % on every joint",
            100.0 * AIM_MEAN,
            100.0 * AIM_JOINT
        );
        let short = short_of_aim(gains);
        let mut missed = Vec::new();
        if mean(gains) < AIM_MEAN {
            missed.push("in the mean".to_owned());
        }
        if !short.is_empty() {
            missed.push(format!("on {}", on_joints(&short)));
        }
        let outcome = match missed.is_empty() {
            true => "reached".to_owned(),
            false => format!("missed {}", missed.join(" and ")),
        };
        format!(
            "Error removed on held-out runs, {samples}, joints 1 … {}: {} (aim: {aim}; {outcome}).",
            gains.len(),
            percents(gains)
        )
    }

    fn beside_the_manufacturer(&self) -> String {
        let is_below = |log: &&HeldOut| {
            let pairs = [
                (&log.after_rms_nm, &log.manufacturer_rms_nm),
                (&log.after_moving_rms_nm, &log.manufacturer_moving_rms_nm),
            ];
            pairs.iter().all(|(after, own)| {
                // A joint that never moves has NaN in both, which counts as below.
                let is_below = |(after, own): (&f64, &f64)| after < own || after.is_nan();
                own.as_ref().is_some_and(|own| after.iter().zip(own).all(is_below))
            })
        };
        let held_out = &self.finding.diagnosis.held_out;
        let below: Vec<&str> =
            held_out.iter().filter(is_below).map(|log| file_name(&log.log)).collect();
        if below.is_empty() {
            return "On no held-out run is the error below that of the controller's own feed-forward on every joint."
                .to_owned();
        }
        format!(
            "Below the error of the controller's own feed-forward on every joint of {} of {} held-out runs.",
            below.len(),
            held_out.len()
        )
    }

    /// The body found on the flange, in a sentence.
    fn body(&self) -> String {
        let (loaded, bare): (Vec<_>, Vec<_>) =
            self.pairs.iter().partition(|pair| pair.known_kg.is_some());
        let masses: Vec<String> = loaded
            .iter()
            .map(|pair| {
                let mass = super::pair(&pair.finding.mass_kg);
                format!("{mass} kg in {} with the {} gains", pair.file, pair.gains)
            })
            .collect();
        let named = bare.iter().filter(|pair| pair.finding.is_named).count();
        let known = loaded.first().and_then(|pair| pair.known_kg).unwrap_or(f64::NAN);
        format!(
            "The body that weighs {known} kg is found to weigh (± half of the 95 % interval) {}; a body is found on {named} of {} runs without one.",
            masses.join(", "),
            bare.len()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Estimate;

    fn delay(kind: Kind, joint: Option<usize>, delay_s: f64) -> Cause {
        let estimate = Estimate { value: delay_s, unit: "s", ci95: [delay_s; 2] };
        Cause {
            kind,
            joint,
            class: Vec::new(),
            confidence: 1.0,
            parameters: [("delay_s", estimate)].into(),
            peak_joint: None,
            gain_fraction: None,
            separating_experiment: None,
            strength: 1.0,
            in_words: String::new(),
            record_fault: None,
            form: None,
            may_be_none: false,
            rivals: Vec::new(),
        }
    }

    #[test]
    fn a_late_torque_is_no_late_velocity() {
        let causes = [
            delay(Kind::VelocityLag, Some(2), 0.004),
            delay(Kind::TimeSkew, None, 0.02),
            delay(Kind::VelocityLag, Some(3), -0.006),
        ];
        assert_eq!(velocity_lags(&causes), (vec![2, 3], 0.006));
    }
}
