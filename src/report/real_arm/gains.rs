//! The improvement by the extended model on held-out runs, and the largest improvement that is possible.

use super::{Part, RealArmStudy, list, mean, percents};
use crate::diagnose::HeldOut;
use crate::number::percent;
use crate::report::{Column, Table, file_name};

/// Mean of 1 − after/before for every joint over the held-out logs. Logs in which a joint never moves have no such
/// value and are left out of its mean.
fn mean_gains(held_out: &[HeldOut], of: impl Fn(&HeldOut) -> (&[f64], &[f64])) -> Vec<f64> {
    let joints = held_out.first().map_or(0, |log| of(log).0.len());
    (0..joints)
        .map(|j| {
            let gain = |log: &HeldOut| {
                let (before, after) = of(log);
                1.0 - after[j] / before[j]
            };
            mean(&held_out.iter().map(gain).collect::<Vec<f64>>())
        })
        .collect()
}

impl RealArmStudy {
    pub(super) fn all_gains(&self) -> Vec<f64> {
        mean_gains(&self.finding.diagnosis.held_out, |l| (&l.before_rms_nm, &l.after_rms_nm))
    }

    pub(super) fn moving_gains(&self) -> Vec<f64> {
        let held_out = &self.finding.diagnosis.held_out;
        mean_gains(held_out, |l| (&l.before_moving_rms_nm, &l.after_moving_rms_nm))
    }

    pub(super) fn gains(&self) -> Part {
        let held_out = &self.finding.diagnosis.held_out;
        let mut table = Table::new([
            Column::text("held-out run"),
            Column::text("samples"),
            Column::text("rigid model, Nm, joints 1 … 6"),
            Column::text("extended model"),
            Column::text("error removed"),
            Column::text("manufacturer's feed-forward"),
        ]);
        for log in held_out {
            let mut row = |samples: &str, before: &[f64], after: &[f64], own: Option<&Vec<f64>>| {
                let gains: Vec<f64> = before.iter().zip(after).map(|(b, a)| 1.0 - a / b).collect();
                table.push([
                    file_name(&log.log).to_owned(),
                    samples.to_owned(),
                    list(before, 3),
                    list(after, 3),
                    percents(&gains),
                    own.map_or("–".to_owned(), |m| list(m, 3)),
                ]);
            };
            let own = log.manufacturer_rms_nm.as_ref();
            row("all", &log.before_rms_nm, &log.after_rms_nm, own);
            let own = log.manufacturer_moving_rms_nm.as_ref();
            row("moving", &log.before_moving_rms_nm, &log.after_moving_rms_nm, own);
            let before = &log.before_standstill_free_rms_nm;
            row("standstill free", before, &log.after_standstill_free_rms_nm, None);
            let before = &log.before_own_friction_rms_nm;
            row("moving, own friction", before, &log.after_own_friction_rms_nm, None);
        }
        let all = self.all_gains();
        let moving = self.moving_gains();
        let free = mean_gains(held_out, |l| {
            (&l.before_standstill_free_rms_nm, &l.after_standstill_free_rms_nm)
        });
        let mut means = Table::new([
            Column::text("mean over the held-out runs"),
            Column::text("error removed, joints 1 … 6"),
            Column::number("mean", ""),
        ]);
        for (name, gains) in
            [("all samples", &all), ("moving", &moving), ("standstill free", &free)]
        {
            means.push([name.to_owned(), percents(gains), percent(mean(gains), 2)]);
        }
        Part::new("What the extended model gains")
            .say(
                "Nothing was fitted again and nothing was chosen on these runs, which are from other days. “Moving” \
                 counts samples with |q̇| > 0.02 rad/s. At standstill dry friction may be anything up to Coulomb \
                 friction, which no function of the motion predicts: “all” counts it as an error of the model all the \
                 same, “standstill free” counts only what lies outside ± Coulomb friction, for both models alike. The \
                 velocity is read back by the lags found on the training run, for both models.",
            )
            .say(
                "“Own friction” is no gain but a question: had each run's own Coulomb and viscous friction been fitted to \
                 it, in both models alike, what would be left? Where that row is much smaller, friction of another day \
                 is what the row above pays for.",
            )
            .say(
                "How far these runs are unseen: no number in this report is fitted to them, and no cause is chosen by \
                 them. While the program was written their errors were looked at, and three of its rules were settled \
                 with them in sight: the play with which presliding follows rounded angles, the low odds of one joint's \
                 torque being late, and the stretches left out that a cause has to pass. The laws that single runs are \
                 asked for beyond the usual ones (an exponent of the load, the bending moment, friction that rises \
                 around a speed, the motor's orders 8 and 12, no late torque of one joint) were chosen by \
                 cross-validation within the training run.",
            )
            .table("", means)
            .table("Rms error, Nm", table)
    }

    pub(super) fn at_most(&self) -> Part {
        let part = Part::new("How much could be gained at most");
        let Some(repeated) = &self.repeated else {
            return part.say("The training motion was not recorded twice: nothing can be said.");
        };
        let most = |shares: &[f64]| -> Vec<f64> {
            shares.iter().map(|share| 1.0 - (1.0 - share.clamp(0.0, 1.0)).sqrt()).collect()
        };
        let mut table = Table::new([
            Column::text("moving samples of the training motion"),
            Column::text("joints 1 … 6"),
        ]);
        let rows = [
            ("share of the rigid model's mean square that repeats", percents(&repeated.before)),
            ("rms error the best model of all could remove", percents(&most(&repeated.before))),
            ("share of the extended model's mean square that repeats", percents(&repeated.after)),
            ("rms error still to be removed", percents(&most(&repeated.after))),
        ];
        for (name, values) in rows {
            table.push([name.to_owned(), values]);
        }
        part.say(
            "The training motion was recorded again with a body on the flange. Both runs were diagnosed on their own; \
             what their errors have in common at the same point of the motion is the model's fault, the rest is \
             noise, and no function of the motion can predict it. With ρ the correlation of the errors, 1 − √(1 − ρ) \
             of the rms error is all that any model could remove.",
        )
        .table("", table)
        .say(
            "This is the limit along one motion, friction being that of the same day. On other days, and at other \
             angles, less can be reached; the wrist joints, half of whose error is noise, come nowhere near the gains \
             of joints 2 and 3.",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held_out(before_nm: [f64; 2], after_nm: [f64; 2]) -> HeldOut {
        let [before, after] = [before_nm, after_nm].map(Vec::from);
        HeldOut {
            log: String::new(),
            warnings: Vec::new(),
            noise_rms_nm: None,
            noise_moving_rms_nm: None,
            before_rms_nm: before.clone(),
            after_rms_nm: after.clone(),
            before_moving_rms_nm: before.clone(),
            after_moving_rms_nm: after.clone(),
            before_standstill_free_rms_nm: before.clone(),
            after_standstill_free_rms_nm: after.clone(),
            manufacturer_rms_nm: None,
            manufacturer_moving_rms_nm: None,
            before_own_friction_rms_nm: before,
            after_own_friction_rms_nm: after,
            standstill_fraction: vec![0.0; 2],
        }
    }

    /// Joint 2 moves only in the first log.
    #[test]
    fn a_joint_that_never_moves_is_left_out_of_the_mean() {
        let logs = [held_out([2.0, 4.0], [1.0, 1.0]), held_out([2.0, f64::NAN], [2.0, f64::NAN])];
        let gains = mean_gains(&logs, |log| (&log.before_moving_rms_nm, &log.after_moving_rms_nm));
        assert_eq!(gains, [0.25, 0.75]);
    }
}
