//! Friction that joints hold in their pauses.

use serde::Serialize;

use super::Training;
use crate::identify::{HeldAtRest, Processing};

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
    /// All of the logs behind `training`.
    pub fn all(training: &Training) -> Vec<Self> {
        let of = |held: &HeldAtRest| Self {
            log: (!is_stacked(training)).then(|| training.logs[held.log].source.clone()),
            joint: held.joint + 1,
            held_nm: held.held_nm,
            pauses: held.pauses.len(),
            share: held.share,
        };
        held(training).iter().map(of).collect()
    }
}

/// What helps along a motion that repeats.
const WHAT_ELSE: &str = ". armid diagnose says whether something else than friction explains it";

/// A remark on every log along which friction is held.
pub(super) fn remarks(training: &Training) -> Vec<String> {
    let of_one = |held: &[HeldAtRest]| {
        let joints: Vec<String> = held.iter().map(HeldAtRest::in_words).collect();
        let remark = format!(
            "friction is held in pauses: {}. Where a joint sticks, its torque at rest is what the controller happened to leave, \
             and says nothing of the arm: these rows are left out of the fit. The model cannot predict the torque there{}",
            joints.join(", "),
            if training.identification.processing.periods > 1 { WHAT_ELSE } else { "" }
        );
        match is_stacked(training) {
            true => remark,
            false => training.named(&training.logs[held[0].log].source, remark),
        }
    };
    held(training).chunk_by(|a, b| a.log == b.log).map(of_one).collect()
}

/// What is held along the logs behind `training`. Of a misread log it is nothing: what seems to be friction there need not be
/// any.
fn held<'t>(training: &'t Training) -> &'t [HeldAtRest] {
    if training.misread.is_some() { &[] } else { &training.identification.held_at_rest }
}

/// Whether the rows of several logs are solved as one.
fn is_stacked(training: &Training) -> bool {
    let Processing { logs, periods, .. } = training.identification.processing;
    logs > 1 && periods == 1
}
