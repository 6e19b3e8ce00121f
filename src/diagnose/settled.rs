//! Causes and the estimate of the arm, fitted in turn.
//!
//! Causes are searched for along loads, friction and torques that an estimate of the arm predicts, and unmodelled
//! causes bias that estimate. Once friction is known better, so are the load on a gear, contacts with the arm, and
//! where readings are cut off.

use super::contact::{self, BesideModel};
use super::contenders::Contender;
use super::error::DiagnoseError;
use super::extension::{Effect, Extension, tell_friction};
use super::kind::Kind;
use super::scene::OtherFriction;
use super::selection::{CauseSet, FINALISTS, Kept};
use super::significance::{FAR_AHEAD, LEAST_EVIDENCE};
use super::study::{Entry, Place, Study};
use crate::base::BaseSet;
use crate::robot::{Arm, JointSignals};
use crate::signal::{SignalError, ZeroPhase, mean_period};

/// Most rounds of causes and estimate.
const ROUNDS: usize = 4;
/// A round that gains less than this, in 2 ln of the evidence, changes nothing that counts.
const SETTLED: f64 = 4.0;
/// Least number of rounds where one law multiplies the friction of others by 1 + f. Their sizes are those of the round
/// before, and what is left of an error of sizes falls by less than f in each. Of bristles and a curve that a log
/// hardly shows, an error of the curve's size fell to 0.56 in each.
const ROUNDS_OF_PRODUCTS: usize = 3;

/// Fits what was `found` in `study` and the estimate of the arm in turn, until neither changes the other.
///
/// For a motion that repeats, a cause that was found only because the estimate was biased is dropped on the way, and
/// the arm is estimated without it. A single run gets one round, because its causes are judged by what they leave
/// ([`Kept::of_a_single_run`]).
pub fn settled<'s>(
    study: Study<'s>,
    found: CauseSet,
    sources: (&Arm, &BaseSet),
    log: &str,
) -> Result<(Study<'s>, Vec<Contender>), DiagnoseError> {
    let (mut study, mut found) = in_turn(study, found, sources, log)?;
    if study.scene.periodic {
        if let Some(more) = with_products(&mut study, &found) {
            (study, found) = in_turn(study, more, sources, log)?;
        }
        found.causes = as_told(&mut study, found.causes);
    }
    study.look_everywhere();
    Ok((study, found.causes))
}

/// Whether the scene of `study` was told of laws that are not among the `causes`, and those beside them are computed
/// with them.
pub fn is_told_of_others(study: &Study, causes: &[Contender]) -> bool {
    let is_cause =
        |effect: &Effect| causes.iter().any(|c| c.entry.place() == (effect.family, effect.site));
    study.scene.has_products() && !study.told.iter().all(is_cause)
}

/// The `causes` in a scene that is told of no others; a law that was dropped last may have been told.
pub fn as_told(study: &mut Study, mut causes: Vec<Contender>) -> Vec<Contender> {
    // Every round takes a cause away, or is the last.
    while is_told_of_others(study, &causes) {
        tell(study, &causes, |_| false);
        let mut kept = Kept::taken_over(study, causes);
        kept.drop_unneeded(|_| true);
        causes = kept.causes;
    }
    causes
}

/// The rounds of [`settled`].
fn in_turn<'s>(
    mut study: Study<'s>,
    found: CauseSet,
    sources: (&Arm, &BaseSet),
    log: &str,
) -> Result<(Study<'s>, CauseSet), DiagnoseError> {
    let CauseSet { mut causes, mut evidence } = found;
    for round in 1..=ROUNDS {
        let entries: Vec<&Entry> = causes.iter().map(|c| &c.entry).collect();
        let mut refined = Extension::fit(&study, &entries, &study.torque);
        // The causes of a single run are chosen anew once all are found, so that its scene is told none of them.
        refined.told = if study.scene.periodic { refined.effects.clone() } else { Vec::new() };
        let scene = refined.scene(study.families, sources, &study.regression.prepared);
        study = study.with_scene((scene, refined.told.clone()), &entries);
        study = without_contacts(study, sources.1, &refined, log)?;
        if !study.scene.periodic {
            break;
        }
        let found = causes.len();
        let mut kept = Kept::taken_over(&study, causes);
        let is_complete = kept.causes.len() == found;
        let dropped = kept.drop_unneeded(|_| true);
        let gained = kept.total_evidence() - evidence;
        evidence += gained;
        causes = kept.causes;
        let is_due = study.scene.has_products() && round < ROUNDS_OF_PRODUCTS;
        if is_complete && dropped.is_empty() && gained < SETTLED && !is_due {
            break;
        }
    }
    Ok((study, CauseSet { causes, evidence }))
}

/// What was `found` with laws that change its friction, or that its bristles hold, if that explains the log far better;
/// the scene of `study` is then told of them.
///
/// Beside friction that falls with speed, say, no width of the reversal fits as long as the joint is taken to have
/// Coulomb and viscous friction alone, and what falls with speed was fitted without the width. A law that changes the
/// friction of others is therefore taken on trial, refined in turn with them, and only then has to be needed; and so is
/// a Stribeck curve on a joint with bristles.
fn with_products(study: &mut Study, found: &CauseSet) -> Option<CauseSet> {
    let joints = 0..study.scene.joints();
    let before: Vec<OtherFriction> =
        joints.clone().map(|j| study.scene.other_friction(j).clone()).collect();
    let told = study.told.clone();
    let mut better: Option<CauseSet> = None;
    for j in joints {
        let start = better.as_ref().unwrap_or(found).causes.clone();
        for contender in for_trial(study, start, j) {
            let best = better.as_ref().unwrap_or(found);
            better = tried(study, best, contender).or(better);
        }
    }
    match &better {
        Some(better) => tell(study, &better.causes, |_| false),
        None => {
            let of_joints = before.into_iter().enumerate();
            of_joints.for_each(|(j, other)| study.scene.set_other_friction(j, other));
            study.told = told;
            study.forget();
        }
    }
    better
}

/// 2 ln of the odds by which a log has to be explained better with a law of this `kind` than without.
///
/// Bristles with a curve are no other model of the joint than bristles and a curve: the curve has to be significant
/// beside them, and no more.
fn margin(kind: Kind) -> f64 {
    if kind.changes_friction() { FAR_AHEAD } else { LEAST_EVIDENCE }
}

/// What may act on joint `j` beside `causes` and changes their friction, or is held by their bristles, in a scene that
/// was told of them.
///
/// A law that explains the joint best but is not its family's own stands in for something unknown there. A curve far
/// behind it is part of that, as everywhere ([`Kept::grow`]).
fn for_trial(study: &mut Study, causes: Vec<Contender>, j: usize) -> Vec<Contender> {
    let families = study.families;
    let kind = |place: Place| families[place.0].kind();
    let on_joint = causes.iter().filter(|c| c.entry.site.is_none_or(|own| own == j));
    let kinds: Vec<Kind> = on_joint.map(|c| kind(c.entry.place())).collect();
    let has_bristles = kinds.contains(&Kind::Presliding);
    // Bristles have no width: their law says by itself how friction turns round.
    let is_plain = |kind: &Kind| kind.adds_friction() && *kind != Kind::Presliding;
    let is_multiplied = kinds.iter().any(is_plain);
    if !is_multiplied && !has_bristles {
        return Vec::new();
    }
    let is_there = |place: Place| place.1 == Some(j);
    let is_held = |place: Place| has_bristles && kind(place) == Kind::Stribeck;
    let changes = |place: Place| is_multiplied && kind(place).changes_friction();
    let is_wanted = |place: &Place| is_there(*place) && (has_bristles || changes(*place));
    tell(study, &causes, is_wanted);
    let kept = Kept::taken_over(study, causes);
    let (others, residual) = kept.without(None);
    let contenders = kept.contenders(None, &others, &residual);
    let stands_in = |c: &&Contender| {
        is_there(c.entry.place()) && !kept.is_its_own(&c.entry, &others, &residual)
    };
    let finalists = contenders.iter().take(FINALISTS);
    let unknown = finalists.filter(stands_in).map(|c| c.evidence).fold(0.0, f64::max);
    let is_clear = |c: &Contender| {
        let place = c.entry.place();
        let is_part = is_held(place) && unknown > c.evidence + FAR_AHEAD;
        let is_of_products = is_there(place) && (is_held(place) || changes(place));
        is_of_products && c.evidence > margin(kind(place)) && !is_part
    };
    contenders.into_iter().filter(is_clear).collect()
}

/// The causes of `best` with `contender`, refined in turn, if it is needed and the log is explained better enough.
fn tried(study: &mut Study, best: &CauseSet, contender: Contender) -> Option<CauseSet> {
    let place = contender.entry.place();
    let least = best.evidence + margin(study.families[place.0].kind());
    let mut trial = best.causes.clone();
    trial.push(contender);
    for _ in 0..ROUNDS_OF_PRODUCTS {
        tell(study, &trial, |_| false);
        trial = Kept::taken_over(study, trial).causes;
    }
    let mut kept = Kept::taken_over(study, trial);
    kept.drop_unneeded(|_| true);
    let evidence = kept.total_evidence();
    let is_better =
        evidence > least && kept.causes.iter().any(|cause| cause.entry.place() == place);
    is_better.then_some(CauseSet { causes: kept.causes, evidence })
}

/// Tells the scene of `study` the friction of the `causes`, and prepares them and the places that are wanted besides.
fn tell(study: &mut Study, causes: &[Contender], is_wanted: impl Fn(&Place) -> bool) {
    let entries: Vec<&Entry> = causes.iter().map(|c| &c.entry).collect();
    study.told = Extension::fit(study, &entries, &study.torque).effects;
    let joints = 0..study.scene.joints();
    joints.for_each(|j| tell_friction(&study.told, study.families, &mut study.scene, j));
    study.forget();
    let is_cause = |place: &Place| entries.iter().any(|entry| entry.place() == *place);
    study.prepare(|place| is_cause(place) || is_wanted(place));
}

/// The `study` of a single run without the rows in which something touched the arm according to `model`.
pub fn without_contacts<'s>(
    study: Study<'s>,
    set: &BaseSet,
    model: &Extension,
    log: &str,
) -> Result<Study<'s>, DiagnoseError> {
    if study.scene.periodic {
        return Ok(study);
    }
    let touched = beside_model(&study, &residual(&study, model))?;
    study.without_rows(set, &touched.samples, log)
}

/// Contacts in the residual of a model along a single run. None for a motion that repeats, which shows them better by
/// itself ([`contact::between_periods`]).
pub fn beside_model(study: &Study, after_nm: &JointSignals) -> Result<BesideModel, SignalError> {
    let regression = study.regression;
    let prepared = &regression.prepared;
    let processing = &prepared.processing;
    let (false, Some(cutoff_hz), Some(order)) =
        (study.scene.periodic, processing.cutoff_hz, processing.order)
    else {
        return Ok(BesideModel::default());
    };
    let low_pass = ZeroPhase::new(cutoff_hz, order, processing.rate_hz)?;
    let at = |row: usize| regression.sample(row);
    let qd = &prepared.motion.qd_rad_s;
    let qd = JointSignals::from_fn(qd.joints(), after_nm.samples(), |j, k| qd.joint(j)[at(k)]);
    let (start_s, rate_hz) = (processing.window_s[0], processing.rate_hz);
    let time_s: Vec<f64> =
        (0..after_nm.samples()).map(|k| start_s + at(k) as f64 / rate_hz).collect();
    contact::beside_model(after_nm, &qd, &time_s, &low_pass)
}

/// Torque that `model` predicts along its own log, Nm, at the samples of the regression.
pub fn fitted(study: &Study, model: &Extension) -> JointSignals {
    let problem = &study.regression.problem;
    model.torque_nm(study.families, &study.scene, problem, Some(&study.whitening))
}

/// Residual of `model` over time, Nm: of the mean period, or of the single run.
pub fn residual(study: &Study, model: &Extension) -> JointSignals {
    let problem = &study.regression.problem;
    let predicted = fitted(study, model);
    let mut out = JointSignals::zeros(problem.joints(), problem.samples);
    for (j, panel) in problem.panels.iter().enumerate() {
        let y = mean_period(&panel.y, problem.samples);
        let pairs = y.iter().zip(predicted.joint(j));
        out.joint_mut(j).iter_mut().zip(pairs).for_each(|(o, (y, p))| *o = y - p);
    }
    out
}
