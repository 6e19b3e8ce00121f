//! A diagnosis in words.

use super::against::MOVED;
use super::form_error::EXACT;
use super::kind::Kind;
use super::modesty::scattered_joints;
use super::told;
use super::verdict::{Cause, Diagnosis, Estimate, HeldOut, Unexplained};
use crate::number::{percent, resolved_from, significant, with_sigma};

/// An interval that reaches this many times farther to one side than to the other is stated by its ends.
const UNEVEN: f64 = 1.2;
/// A cause with less confidence than this is stated with a "may".
const EVEN_ODDS: f64 = 0.5;
/// From this many times the error along the log on, the error along another log is not one of the same arm.
const OF_ANOTHER_ARM: f64 = 3.0;
/// Nothing is called noise that noise leaves in a smaller share of logs than this.
const SELDOM: f64 = 0.01;
/// Smaller probabilities are not told apart.
const RARE: f64 = 1e-4;
/// If the ends of an uneven interval are this factor apart, the size is open: no value between them is an estimate of
/// it.
const VAST: f64 = 10.0;

/// What is said besides the causes.
pub(super) struct Besides<'a> {
    /// Doubt about the simulation that the log is compared with: everything else rests on it.
    pub doubt: Option<&'a str>,
    /// Drives at their limits.
    pub limited: Vec<String>,
    /// Torque that drifts. It does not repeat from period to period, and counts as noise in all that is said of causes.
    pub drift: Option<String>,
    /// Of a single run in which nothing was found, how much is left if that is no white noise.
    pub slow: Option<String>,
}

impl Diagnosis {
    /// The sentences of the first screen. `laws` are the sites of the extended model's effects: a joint (1-based), or
    /// `None` for the arm as a whole.
    pub(super) fn in_sentences(&self, laws: &[Option<usize>], besides: Besides) -> Vec<String> {
        let Besides { doubt, limited, drift, slow } = besides;
        // Without a cause, drift is what there is to say.
        let (first, last) = if self.causes.is_empty() { (drift, None) } else { (None, drift) };
        let of_the_arm = self.doubt.as_ref().map(|doubt| doubt.sentence());
        let mut out: Vec<String> = of_the_arm.into_iter().collect();
        out.extend(doubt.map(str::to_owned));
        out.extend(limited);
        out.extend(first);
        out.extend(self.about_causes(laws));
        out.extend(last);
        out.extend(slow);
        out
    }

    /// The sentences about single causes, if there are so many that one sentence gives an overview; otherwise none.
    pub(super) fn about_each_of_many(&self) -> Vec<String> {
        match told::overview(&self.causes) {
            Some(_) => told::in_sentences(&self.causes, self.noise_floor_nm.is_some()),
            None => Vec::new(),
        }
    }

    /// The sentences about the causes, and about what is left beside them.
    fn about_causes(&self, laws: &[Option<usize>]) -> Vec<String> {
        let is_left = self.unexplained.is_some() && self.noise_floor_nm.is_some();
        let mut out: Vec<String> = Vec::new();
        out.extend(
            is_left.then(|| missing_effect(&self.causes, self.before.rms_nm.len())).flatten(),
        );
        out.extend(told::overview(&self.causes));
        out.extend(told::in_sentences(&self.causes, self.noise_floor_nm.is_some()));
        out.extend(match &self.unexplained {
            Some(unexplained) => Some(unexplained.sentence()),
            None => told::without_a_name(&self.causes),
        });
        out.extend(self.form_error.as_ref().map(Unexplained::as_form_error));
        out.extend(told::in_the_table_alone(&self.causes));
        if out.is_empty() {
            out.push(self.nothing_found());
        }
        out.extend(self.moved());
        let along =
            |held_out| self.does_not_carry_over(held_out).or_else(|| gain_along(held_out, laws));
        out.extend(self.held_out.iter().filter_map(along));
        out
    }

    /// The sentence if nothing is named.
    pub(super) fn nothing_found(&self) -> String {
        let words = match (&self.noise_floor_nm, self.lack_of_fit_probability) {
            (Some(_), Some(chance)) if chance < SELDOM => {
                return format!(
                    "Nothing found that could be told from noise for certain. But noise alone leaves as much as is left here in {} of logs: \
                     there may be an effect that a longer log would show.",
                    percent(chance, 2)
                );
            }
            (Some(_), _) => {
                "Nothing found: what the model leaves is noise, as the scatter between periods shows; the detection \
                 limits say what would have been seen, of each law in the one shape that stands beside them. What only \
                 moves the parameters (a body on the flange, a little more gravity, a link that is a millimetre longer) shows beside a simulation (--sim) or a second log."
            }
            (None, _) => {
                "Nothing found above what a single run can show; the motion does not repeat, so that the noise is \
                 judged from the residual itself."
            }
        };
        words.to_owned()
    }

    /// The sentence that compares the base parameters with those of a simulation.
    fn moved(&self) -> Option<String> {
        // What a cause absorbs of a parameter is not known, and has no z.
        let known = || self.moved_parameters.iter().filter(|m| m.z.is_finite());
        let farthest = known().max_by(|a, b| a.z.abs().total_cmp(&b.z.abs()))?;
        let moved = known().filter(|m| m.z.abs() > MOVED).count();
        let together = self.moved_together.map_or_else(String::new, |together| {
            let share = match together.p_value < RARE {
                true => format!("less than {}", percent(RARE, 1)),
                false => percent(together.p_value, 2),
            };
            format!("; had nothing changed, noise alone would take all of them together as far in {share} of logs")
        });
        Some(format!(
            "Compared with the simulation, {moved} of {} base parameters differ by more than {MOVED} σ; {} differs most, by {} σ{together}.",
            known().count(),
            farthest.name,
            significant(farthest.z.abs(), 2),
        ))
    }

    /// The sentence about a log along which the model errs far more than along this one, even with friction at
    /// standstill left open.
    fn does_not_carry_over(&self, held_out: &HeldOut) -> Option<String> {
        // Of a log that repeats, the mean is compared, whose noise is less than that of a sample.
        let noise_nm = held_out.noise_rms_nm.as_ref().or(self.noise_floor_nm.as_ref());
        let noise = |j: usize| noise_nm.map_or(0.0, |noise| noise[j]);
        let expected = self.after.rms_nm.iter().enumerate().map(|(j, rms)| rms.hypot(noise(j)));
        let (j, times) = held_out
            .after_standstill_free_rms_nm
            .iter()
            .zip(expected)
            .map(|(found, expected)| found / expected)
            .enumerate()
            .filter(|(_, times)| *times > OF_ANOTHER_ARM)
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(format!(
            "The model does not carry over to {}: on joint {} it errs {times:.0} times as much there. Another load, \
             another gain, or a motion that shows what this log does not.",
            held_out.log,
            j + 1
        ))
    }
}

impl Unexplained {
    fn as_form_error(&self) -> String {
        format!(
            "On joint {} the laws named are not exact: {} Nm (rms) are left, less than {:.0} % of what they do there, in units of the noise; it is seen best along the {}.",
            self.joint,
            significant(self.rms_nm, 2),
            100.0 * EXACT,
            self.axis
        )
    }

    fn sentence(&self) -> String {
        let (joint, axis, nm) = (self.joint, self.axis, significant(self.rms_nm, 2));
        if self.of_all_joints {
            format!(
                "The joints together show what no known effect explains and noise does not leave, most on joint {joint} ({nm} Nm rms); \
                 it is seen best along the {axis}. Something may act on the arm as a whole."
            )
        } else {
            format!(
                "Joint {joint} shows {nm} Nm (rms) that no known effect explains; it depends most clearly on the {axis}."
            )
        }
    }
}

/// The sentence about `causes` that are spread over many of the arm's `joints`, for a log that shows something unexplained.
fn missing_effect(causes: &[Cause], joints: usize) -> Option<String> {
    let joints: Vec<String> =
        scattered_joints(causes, joints).iter().map(usize::to_string).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "Something that acts on the arm as a whole is likely missing from the dictionary: joints {} have causes of their own, and \
             yet something is left unexplained. What is named may be parts of it.",
            joints.join(", ")
        )
    })
}

/// The sentence about how `laws` at these sites change the error along another log while the joint moves, for the joint
/// with a law on which the error changes most. Joints without laws are left out: parameters that only moved are in both
/// models, and events that happened once in neither.
fn gain_along(held_out: &HeldOut, laws: &[Option<usize>]) -> Option<String> {
    let has_law = |j: usize| laws.iter().any(|joint| joint.is_none_or(|joint| joint == j + 1));
    let HeldOut { before_moving_rms_nm, after_moving_rms_nm, .. } = held_out;
    let both = before_moving_rms_nm.iter().zip(after_moving_rms_nm).enumerate();
    let told = both.filter(|(j, (before, after))| has_law(*j) && **before > 0.0 && **after > 0.0);
    let (j, (before, after)) = told.max_by(|(_, a), (_, b)| {
        let change = |(before, after): (&f64, &f64)| (before / after).ln().abs();
        change(*a).total_cmp(&change(*b))
    })?;
    let (included, alone) = match &held_out.noise_moving_rms_nm {
        Some(noise) => ("", format!("; noise alone makes {} Nm", significant(noise[j], 3))),
        None => (", noise included,", String::new()),
    };
    Some(format!(
        "Along {} the error of joint {} while it moves{included} is {} Nm rms with what is named and {} Nm without{alone}.",
        held_out.log,
        j + 1,
        significant(*after, 3),
        significant(*before, 3)
    ))
}

impl Estimate {
    /// `value ± half unit`, or the value between both ends if these are far from even.
    pub(super) fn in_words(&self) -> String {
        let [low, high] = self.ci95;
        if self.says_nothing() {
            let [low, high] = [low, high].map(|v| significant(v, 2));
            return format!("hardly known (between {low} and {high}) {}", self.unit)
                .trim_end()
                .to_owned();
        }
        if self.is_uneven() {
            let [value, low, high] =
                [self.value, low, high].map(|v| resolved_from(2, v, high - low));
            return format!("{value} (between {low} and {high}) {}", self.unit)
                .trim_end()
                .to_owned();
        }
        pair(self.value, 0.5 * (high - low), self.unit)
    }

    /// Whether the interval reaches so much farther to one side that `value ± half` would misstate it.
    pub(crate) fn is_uneven(&self) -> bool {
        let [below, above] = self.ci95.map(|end| (end - self.value).abs());
        above > UNEVEN * below || below > UNEVEN * above
    }

    /// Whether the interval says nothing about the value. Either it spans a whole turn; or it is uneven, of one sign,
    /// and its ends are more than a factor of ten apart. An end at zero, where the meaningful sizes begin, is
    /// infinitely far apart in this sense.
    fn says_nothing(&self) -> bool {
        let [low, high] = self.ci95;
        let (near, far) = (low.abs().min(high.abs()), low.abs().max(high.abs()));
        let is_vast = self.is_uneven() && low * high >= 0.0 && far > VAST * near;
        is_vast || self.unit == "rad" && high - low > std::f64::consts::TAU
    }
}

impl Cause {
    pub(super) fn sentence(&self, noise_is_known: bool) -> String {
        match self.kind {
            Kind::Contact => return self.contact_sentence(),
            Kind::Payload => return self.payload_sentence(),
            _ => {}
        }
        let place = self.joint.map_or("The model".to_owned(), |j| format!("Joint {j}'s model"));
        let what = format!("{}{}", self.in_words, self.numbers());
        let mut text = match (self.kind.is_of_the_record(), self.joint) {
            (true, None) => format!("The record has {what}."),
            (true, Some(j)) => format!("Joint {j}'s record has {what}."),
            (false, _) if self.is_doubtful() => {
                format!("{place} may miss {what}; other causes fit as well.")
            }
            (false, _) if self.confidence <= EVEN_ODDS => {
                format!("{place} may miss {what}, or something unknown that looks like it.")
            }
            (false, _) if self.may_be_none => {
                format!("{place} may miss {what}; as far as its size is known, there may be none.")
            }
            (false, _) => format!("{place} misses {what}."),
        };
        text += &self.gain_in_words(noise_is_known).unwrap_or_default();
        if !self.class.is_empty() {
            let class = self.class.join(", ");
            text += &format!(" These data cannot tell it from {class}");
            if let Some(experiment) = self.separating_experiment {
                text += &format!("; this would: {experiment}");
            }
            text.push('.');
        }
        text
    }

    /// Whether something else is more likely than this cause.
    pub(super) fn is_doubtful(&self) -> bool {
        self.confidence < EVEN_ODDS
    }

    /// The sentence about what the cause removes, with a leading blank.
    pub(super) fn gain_in_words(&self, noise_is_known: bool) -> Option<String> {
        let of = if noise_is_known {
            "of what the noise floor leaves to explain, on periods that were not used to fit it"
        } else {
            "of the error's mean square, in stretches of time left out of its fit"
        };
        let removed =
            |gain: f64| format!(" Adding it removes {:.0} % {of}.", 100.0 * gain.clamp(0.0, 1.0));
        self.gain_fraction.map(removed)
    }

    fn contact_sentence(&self) -> String {
        let value = |name: &str| self.parameters.get(name).map_or(f64::NAN, |e| e.value);
        let when = format!("From {:.2} s to {:.2} s", value("start_s"), value("end_s"));
        if self.confidence <= EVEN_ODDS {
            return format!(
                "{when} it looks as if {}; something unknown may look like it.",
                self.in_words
            );
        }
        match self.separating_experiment {
            None => format!("{when} {}.", self.in_words),
            Some(experiment) => format!(
                "{when} {}. Other joints moved as well and may have been pushed too; this would tell: {experiment}.",
                self.in_words
            ),
        }
    }

    /// The parameters and the best form of the law in brackets, with a leading blank; empty if there are no parameters.
    fn numbers(&self) -> String {
        let number = |(name, e): (&&str, &Estimate)| {
            let name = name.trim_end_matches(&unit_suffix(e.unit)).replace('_', " ");
            format!("{name} {}", e.in_words())
        };
        match self.parameters.iter().map(number).collect::<Vec<_>>().join(", ") {
            numbers if numbers.is_empty() => numbers,
            numbers => match self.form {
                None => format!(" ({numbers})"),
                Some(form) => format!(" ({numbers}; {form})"),
            },
        }
    }

    fn payload_sentence(&self) -> String {
        let told = |name: &str| {
            let estimate = self.parameters.get(name)?;
            let [low, high] = estimate.ci95;
            Some((estimate.value, 0.5 * (high - low)))
        };
        let Some((mass, half)) = told("mass_kg") else {
            let numbers = self.numbers();
            return format!(
                "The flange carries something else{numbers}; these motions cannot tell its mass."
            );
        };
        let which = if mass < 0.0 { "missing from" } else { "on" };
        let place = ["com_x_m", "com_y_m", "com_z_m"]
            .map(|name| told(name).map_or("?".to_owned(), |(value, half)| with_sigma(value, half)));
        format!(
            "A body of {} kg {which} the flange, its centre at ({}) m in the last joint's frame.",
            with_sigma(mass.abs(), half),
            place.join(", ")
        )
    }
}

/// The unit as a suffix of parameter names, such as `_nm`.
fn unit_suffix(unit: &str) -> String {
    format!(
        "_{}",
        unit.to_lowercase().replace(['/', ' '], "_").replace('²', "2").replace("1_", "per_")
    )
}

/// `value ± half unit`.
fn pair(value: f64, half: f64, unit: &str) -> String {
    let number = if half.is_finite() && half > 0.0 {
        with_sigma(value, half)
    } else {
        significant(value, 3)
    };
    format!("{number} {unit}").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(value: f64, ci95: [f64; 2], unit: &'static str) -> String {
        Estimate { value, unit, ci95 }.in_words()
    }

    /// The ends are rounded finely enough to differ from the value: an order of ripple must not be "21 (between 21 and
    /// 21)".
    #[test]
    fn the_ends_of_an_interval_differ() {
        let order = told(20.959, [20.937, 20.989], "1/turn");
        assert_eq!(order, "20.959 (between 20.937 and 20.989) 1/turn");
        assert_eq!(told(0.4788, [0.3246, 1.472], "Nm"), "0.48 (between 0.32 and 1.5) Nm");
    }

    /// Friction that rises by 6 % or 360 % as it warms up, and friction that falls likewise.
    #[test]
    fn what_may_be_ten_times_as_much_is_hardly_known() {
        assert_eq!(told(0.058, [0.031, 3.6], ""), "hardly known (between 0.031 and 3.6)");
        assert_eq!(told(-0.058, [-3.6, -0.031], ""), "hardly known (between -3.6 and -0.031)");
        assert_eq!(told(0.3, [0.0, 0.4], "rad"), "hardly known (between 0 and 0.40) rad");
        // A size that may be half or none is still stated with its value.
        assert_eq!(told(0.02, [0.001, 0.039], ""), "0.020 ± 0.019");
        assert_eq!(told(0.02, [-0.001, 0.06], ""), "0.020 (between -0.0010 and 0.060)");
    }

    /// Where something is unexplained as well, a touch is not stated as a fact.
    #[test]
    fn a_touch_at_even_odds_is_said_to_look_like_one() {
        let estimate = |value| Estimate { value, unit: "s", ci95: [value - 0.1, value + 0.1] };
        let times = [("start_s", estimate(1.5)), ("end_s", estimate(2.25))];
        let words = "something touched the arm: joint 2 by +1.6 Nm";
        let sure = Cause::certain(Kind::Contact, None, words, 20.0, &times);
        assert_eq!(sure.sentence(true), format!("From 1.50 s to 2.25 s {words}."));
        let unsure = Cause { confidence: 0.5, ..sure };
        let said = format!(
            "From 1.50 s to 2.25 s it looks as if {words}; something unknown may look like it."
        );
        assert_eq!(unsure.sentence(true), said);
    }

    #[test]
    fn what_may_be_none_is_said_with_a_may() {
        let estimate = |ci95| Estimate { value: 0.02, unit: "", ci95 };
        let known = Cause::certain(
            Kind::LoadFriction,
            Some(1),
            "friction by load",
            5.0,
            &[("mu", estimate([0.01, 0.03]))],
        );
        let open = Cause {
            may_be_none: true,
            parameters: [("mu", estimate([-0.01, 0.05]))].into(),
            ..known.clone()
        };
        let unsure = Cause { confidence: 0.4, ..open.clone() };
        let of_the_motor = Cause { form: Some("load of the motor"), ..known.clone() };
        assert_eq!(
            known.sentence(true),
            "Joint 2's model misses friction by load (mu 0.020 ± 0.010)."
        );
        assert_eq!(
            of_the_motor.sentence(true),
            "Joint 2's model misses friction by load (mu 0.020 ± 0.010; load of the motor)."
        );
        let said = "Joint 2's model may miss friction by load (mu 0.020 ± 0.030); as far as its size is known, there may be none.";
        assert_eq!(open.sentence(true), said);
        assert!(unsure.sentence(true).ends_with("; other causes fit as well."));
    }

    #[test]
    fn causes_on_many_joints_are_told_to_lack_one_effect() {
        let kinds = [Kind::Stribeck, Kind::TorqueGain, Kind::Ripple, Kind::Spring];
        let of_joint = |(j, kind)| Cause::certain(kind, Some(j), "an effect", 9.0, &[]);
        let causes: Vec<Cause> = kinds.into_iter().enumerate().map(of_joint).collect();
        let said = missing_effect(&causes, 6).unwrap();
        assert!(said.contains("joints 1, 2, 3, 4 have causes of their own"), "{said}");
        assert_eq!(missing_effect(&causes[1..], 6), None);
    }
}
