//! Friction that joints hold in their pauses.

use serde::Serialize;

use super::Training;
use crate::identify::{HeldAtRest, Processing};
use crate::number::significant;

/// Friction that one joint holds in its pauses along a log.
#[derive(Debug, Clone, Serialize)]
pub struct HeldResult {
    /// The log; `None` where the rows of several logs are solved as one.
    pub log: Option<String>,
    /// The joint, from 1.
    pub joint: usize,
    /// Rms, over the pauses, of what is held in each of them on average, Nm.
    pub held_nm: f64,
    /// Pauses in a period, or in all single runs.
    pub pauses: usize,
    /// Share of the rows of the joint that were left out for them.
    pub share: f64,
}

impl HeldResult {
    /// All of the logs behind `training`. Of a misread log there are none: what seems to be friction there need not be
    /// any.
    pub fn all(training: &Training) -> Vec<Self> {
        let Processing { logs, periods, .. } = training.identification.processing;
        let is_stacked = logs > 1 && periods == 1;
        let of = |held: &HeldAtRest| Self {
            log: (!is_stacked).then(|| training.logs[held.log].source.clone()),
            joint: held.joint + 1,
            held_nm: held.held_nm,
            pauses: held.pauses.len(),
            share: held.share,
        };
        let is_read = training.misread.is_none();
        training.identification.held_at_rest.iter().filter(|_| is_read).map(of).collect()
    }

    /// The joint and what it holds.
    fn in_words(&self) -> String {
        let Self { joint, held_nm, pauses, share, .. } = self;
        let held = significant(*held_nm, 3);
        format!(
            "joint {joint} ({held} Nm rms in {pauses} pauses, {:.0} % of its rows)",
            100.0 * share
        )
    }
}

/// A remark on every log along which friction is held.
pub(super) fn remarks(training: &Training) -> Vec<String> {
    let of_one = |held: &[HeldResult]| {
        let joints: Vec<String> = held.iter().map(HeldResult::in_words).collect();
        let remark = format!(
            "friction is held in pauses: {}. Where a joint sticks, its torque at rest is what the controller happened to leave, \
             and says nothing of the arm: these rows are left out of the fit. The model cannot predict the torque there. armid \
             diagnose says whether something else than friction explains it",
            joints.join(", ")
        );
        match &held[0].log {
            Some(log) => training.named(log, remark),
            None => remark,
        }
    };
    HeldResult::all(training).chunk_by(|a, b| a.log == b.log).map(of_one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_is_told_with_its_rows() {
        let held = HeldResult {
            log: Some("a.csv".to_owned()),
            joint: 2,
            held_nm: 2.4431,
            pauses: 5,
            share: 0.482,
        };
        assert_eq!(held.in_words(), "joint 2 (2.44 Nm rms in 5 pauses, 48 % of its rows)");
    }
}
