//! Two published sets of drive gains: what the data say about them, and how the results change between them.

use super::{Part, RealArmStudy, list, pair};
use crate::diagnose::Cause;
use crate::report::{Column, Table};

/// Whether `other` is the same cause found with the other drive gains. Ripple is matched by its order per turn.
fn is_same(cause: &Cause, other: &Cause) -> bool {
    let order = |c: &Cause| c.parameters.get("order_per_turn").map_or(1.0, |e| e.value);
    (cause.kind, cause.joint) == (other.kind, other.joint)
        && (order(cause) / order(other) - 1.0).abs() < SAME_ORDER
}

/// Orders of ripple that differ by a smaller share count as the same.
const SAME_ORDER: f64 = 0.02;

impl RealArmStudy {
    pub(super) fn drives(&self) -> Part {
        let mut table =
            Table::new([Column::text("source"), Column::text("gain, Nm/A, joints 1 … 6")]);
        for (name, gains) in ["the controller's", "the authors'"].iter().zip(&self.gains_nm_a) {
            table.push([(*name).to_owned(), list(gains, 4)]);
        }
        let mut scales = Table::new([
            Column::text("pair"),
            Column::text("drive gains"),
            Column::text("all joints"),
            Column::text("joints 1 … 6, × the assumed gain"),
        ]);
        for p in &self.pairs {
            let (Some(all), Some(each)) = (&p.finding.gain_scale, &p.finding.joint_gain_scales)
            else {
                continue;
            };
            let each: Vec<String> = each.iter().map(pair).collect();
            scales.push([p.file.clone(), p.gains.to_owned(), pair(all), each.join(", ")]);
        }
        let mut moves = Table::new([
            Column::text("cause"),
            Column::number("joint", ""),
            Column::text("parameter"),
            Column::text("controller's gains"),
            Column::text("authors' gains"),
        ]);
        for cause in self.finding.diagnosis.causes.iter().filter(|c| !c.kind.is_of_the_record()) {
            let other = self.other_gains.iter().find(|other| is_same(cause, other));
            for (name, estimate) in &cause.parameters {
                moves.push([
                    cause.kind.to_string(),
                    cause.joint.map_or("all".to_owned(), |j| j.to_string()),
                    (*name).to_owned(),
                    pair(estimate),
                    other.and_then(|c| c.parameters.get(name)).map_or("not named".to_owned(), pair),
                ]);
            }
        }
        Part::new("Drive gains")
            .say(
                "Currents become torques by a gain per joint, and two published sets differ by up to 20 %. One run alone \
                 cannot tell them apart: with all gains multiplied by a factor every parameter is, and the fit is as \
                 good. A factor on one joint is nearly absorbed as well, by that joint's friction and inertia. What \
                 does not depend on the gains are ratios: friction per load, orders per turn, stiffnesses per radian.",
            )
            .say(
                "A known mass breaks this: the same body must come out right. The scale below is what the gains are to \
                 be multiplied by; where a joint hardly feels the body its interval is wide (± is half of it, at 95 %; \
                 an interval that is far from even is given by its ends).",
            )
            .table("Published gains", table)
            .table("What the body of known mass says", scales)
            .table("How the answers move", moves)
    }
}
