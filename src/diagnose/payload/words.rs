//! What is said about a body on the flange.

use serde::{Serialize, Serializer};

use super::super::verdict::Estimate;
use super::PayloadFinding;
use crate::number::significant;

impl PayloadFinding {
    /// The sentences about the finding: that no body is named, and what a known mass says about the drives.
    pub fn sentences(&self) -> Vec<String> {
        let mut out = Vec::new();
        if !self.is_named {
            out.push(self.no_body());
        }
        if self.was_touched {
            out.push(
                "Something touched the arm along the log with the body; that was taken out before."
                    .to_owned(),
            );
        }
        if let Some(scale) = &self.gain_scale {
            out.push(format!(
                "With the mass known, the drive gains are to be multiplied by {}, if one factor is right for all drives.",
                with_interval(scale)
            ));
        }
        if let Some(scales) = &self.joint_gain_scales {
            let told: Vec<String> = scales
                .iter()
                .enumerate()
                .map(|(j, scale)| {
                    if is_told(scale) {
                        format!("joint {}: {}", j + 1, with_interval(scale))
                    } else {
                        format!("joint {}: not told by these motions", j + 1)
                    }
                })
                .collect();
            out.push(format!("Joint by joint: {}.", told.join(", ")));
            out.extend(self.apart().map(|joints| {
                format!("One scale for all drives does not fit joint {joints}: take those of the joints.")
            }));
        }
        out
    }

    /// Joints whose own scale of gains differs from the common one (their 95 % intervals do not overlap).
    fn apart(&self) -> Option<String> {
        let (all, own) = self.gain_scale.as_ref().zip(self.joint_gain_scales.as_ref())?;
        let is_apart = |scale: &Estimate| {
            is_told(scale) && (scale.ci95[1] < all.ci95[0] || scale.ci95[0] > all.ci95[1])
        };
        let joints = (1..).zip(own).filter(|(_, scale)| is_apart(scale));
        let joints: Vec<String> = joints.map(|(j, _)| j.to_string()).collect();
        (!joints.is_empty()).then(|| joints.join(", "))
    }

    /// The sentence if no body is named.
    fn no_body(&self) -> String {
        let Self { reference, probability, mass_kg, .. } = self;
        let axes = ["x", "y", "z"].into_iter().zip(&self.first_moment_kg_m);
        let moments: Vec<String> = axes
            .filter(|(_, moment)| !moment.value.is_nan())
            .map(|(axis, moment)| format!("{axis} {}", with_interval(moment)))
            .collect();
        let moments = moments.join(", ");
        let by_chance = !self.differs();
        let chance = significant(*probability, 2);
        if mass_kg.value.is_nan() {
            let first = "These motions cannot tell a mass on the flange";
            return match (moments.is_empty(), by_chance) {
                (true, _) => format!("{first}, nor its first moments."),
                (false, true) => format!(
                    "{first}. First moments are those of {reference}: {moments} kg m more, which chance explains (p = \
                     {chance})."
                ),
                (false, false) => format!(
                    "{first}. First moments are not those of {reference}: {moments} kg m more."
                ),
            };
        }
        let mass = with_interval(mass_kg);
        if by_chance {
            return format!(
                "No body on the flange beside {reference}: {mass} kg, which chance explains (p = {chance})."
            );
        }
        if mass_kg.ci95[1] < 0.0 {
            return format!(
                "No body on the flange beside {reference}, but less of one: {mass} kg. The first log carries more than the \
                 second; were they swapped?"
            );
        }
        format!(
            "The same mass on the flange as in {reference}, {mass} kg more, but with other first moments: {moments} kg m \
             more. Was a body turned, moved or exchanged for one as heavy?"
        )
    }
}

/// Value ± half of the 95 % interval.
fn with_interval(estimate: &Estimate) -> String {
    format!("{:.3} ± {:.3}", estimate.value, 0.5 * (estimate.ci95[1] - estimate.ci95[0]))
}

/// A scale of gains counts as told if its 95 % interval is within ± this share of it: two sources rarely differ by
/// less.
const TOLD_WITHIN: f64 = 0.1;

/// Whether the motions tell this scale of gains well enough to be stated.
fn is_told(scale: &Estimate) -> bool {
    0.5 * (scale.ci95[1] - scale.ci95[0]) < TOLD_WITHIN * scale.value
}

/// Writes `scales` of gains without the numbers of those that are not told, as the sentences do.
pub(super) fn only_told<S: Serializer>(
    scales: &Option<Vec<Estimate>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let told = |scale: &Estimate| match is_told(scale) {
        true => scale.clone(),
        false => Estimate { value: f64::NAN, unit: scale.unit, ci95: [f64::NAN; 2] },
    };
    let told: Option<Vec<Estimate>> =
        scales.as_ref().map(|scales| scales.iter().map(told).collect());
    told.serialize(serializer)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known_to(half: f64) -> impl Fn(f64) -> Estimate {
        move |value| Estimate { value, unit: "", ci95: [value - half, value + half] }
    }

    /// A second log with this mass and first moment more on the flange, at this probability that chance explains them.
    fn finding(mass_kg: f64, moment_kg_m: f64, probability: f64) -> PayloadFinding {
        PayloadFinding {
            reference: "bare.csv".to_owned(),
            mass_kg: known_to(0.02)(mass_kg),
            first_moment_kg_m: [moment_kg_m, 0.0, f64::NAN].map(known_to(0.004)),
            com_m: [0.0; 3].map(known_to(0.01)),
            probability,
            is_named: false,
            gain_scale: None,
            joint_gain_scales: None,
            coulomb_change_nm: Vec::new(),
            was_touched: false,
        }
    }

    /// What is said of it.
    fn said(mass_kg: f64, moment_kg_m: f64, probability: f64) -> String {
        finding(mass_kg, moment_kg_m, probability).sentences().join(" ")
    }

    /// A reader of the JSON must not take for a result what the sentence calls none.
    #[test]
    fn scales_that_are_not_told_are_null() {
        let scales = vec![known_to(0.118)(1.057), known_to(0.02)(1.05)];
        let finding = PayloadFinding { joint_gain_scales: Some(scales), ..finding(2.0, 0.1, 1e-9) };
        let said = finding.sentences().join(" ");
        let words = "joint 1: not told by these motions, joint 2: 1.050 ± 0.020.";
        assert!(said.contains(words), "{said}");
        let written = serde_json::to_value(&finding).unwrap();
        let [first, second] = [0, 1].map(|j| &written["joint_gain_scales"][j]);
        assert!(first["value"].is_null() && first["ci95"][1].is_null(), "{first}");
        assert_eq!(second["value"], 1.05);
    }

    /// Chance is named only where it explains the difference: a gripper that was turned, or exchanged for one as heavy,
    /// is no accident.
    #[test]
    fn chance_is_named_where_it_explains_a_difference() {
        let chance = |mass_kg, moment_kg_m, probability| {
            said(mass_kg, moment_kg_m, probability).contains("chance explains")
        };
        assert!(chance(0.01, 0.002, 0.4) && chance(-0.03, 0.0, 0.02) && chance(f64::NAN, 0.0, 0.4));
        let turned = said(0.01, 0.1, 1e-9);
        assert!(turned.starts_with("The same mass on the flange as in bare.csv"), "{turned}");
        assert!(turned.contains("x 0.100 ± 0.004, y 0.000 ± 0.004 kg m"), "{turned}");
        assert!(said(-2.0, 0.1, 1e-9).contains("swapped"));
        let unknown = said(f64::NAN, 0.1, 1e-9);
        assert!(unknown.starts_with("These motions cannot tell a mass"), "{unknown}");
        assert!(unknown.contains("are not those of bare.csv: x 0.100 ± 0.004"), "{unknown}");
    }
}
