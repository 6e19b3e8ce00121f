//! Gains on a log that was used neither for a fit nor for a choice.
//!
//! All models see the log after the same processing, and nothing is fitted again. Three scores are kept apart: the
//! samples in which the joint moves (|q̇| > 0.02 rad/s); all samples, with friction at standstill as the model predicts
//! it; and all samples, with friction at standstill anywhere in [−F, F]. Dry friction holds a joint that stands still
//! against any torque up to F, so that no function of its speed can predict it. The third score leaves out this
//! unpredictable part, for all models alike.

use super::candidates::Candidate;
use super::common_motion::{move_to_common_motion, noise_of_mean};
use super::error::DiagnoseError;
use super::extension::Extension;
use super::image::{Image, Span};
use super::rms::rms_where;
use super::setup::Setup;
use super::verdict::HeldOut;
use super::whitening::{RunWhitening, Whitening};
use crate::base::BaseSet;
use crate::dynamics::Parameter;
use crate::identify::{Identifier, MOVING_RAD_S, Measurement, Misreading, Problem, Regression};
use crate::robot::JointSignals;
use crate::signal::mean_period;

/// A log that no model has seen, to measure gains on.
pub struct Validation<'a> {
    /// Its channels.
    pub measurement: Measurement<'a>,
    /// The manufacturer's feed-forward, Nm.
    pub manufacturer_nm: Option<&'a JointSignals>,
}

/// The models that are compared.
pub(super) struct Models<'a> {
    /// Rigid body, Coulomb and viscous friction, offset.
    pub(super) null: &'a Extension,
    /// With the causes.
    pub(super) extension: &'a Extension,
}

/// Rms residuals of both models, and of the manufacturer's feed-forward where it is given, on a log that neither model
/// has seen.
pub(super) fn held_out_gain(
    identifier: &mut Identifier,
    Setup { arm, set, options }: Setup,
    drive_gain_nm_a: Option<&[f64]>,
    families: &[Box<dyn Candidate>],
    log: &Validation,
    models: &Models,
) -> Result<HeldOut, DiagnoseError> {
    let extension = &models.extension.elsewhere(families);
    let mut regression = identifier.regression(&log.measurement)?;
    let misreading = Misreading::of(arm, &regression, options, drive_gain_nm_a);
    move_to_common_motion(&mut regression, (arm, set), &models.null.theta);
    let prepared = &regression.prepared;
    let whitening = Whitening::filter_of(&regression, options)?;
    let scene = extension.scene(families, (arm, set), prepared);
    let problem = &regression.problem;
    let (joints, samples) = (problem.joints(), problem.samples);
    let measured: Vec<Vec<f64>> =
        problem.panels.iter().map(|panel| mean_period(&panel.y, samples)).collect();
    let error = |model: &Extension| {
        let predicted = model.torque_nm(families, &scene, problem, whitening.as_ref());
        JointSignals::from_fn(joints, samples, |j, k| measured[j][k] - predicted.joint(j)[k])
    };
    let rows = Rows::of(&regression);
    let coulomb: Vec<f64> = (0..joints).map(|j| coulomb_nm(set, &models.null.theta, j)).collect();
    let outside_friction = |model: &Extension| {
        let bare = model.without_dry_friction(0..joints, set, families);
        let mut e = error(model);
        let free = error(&bare);
        for (j, coulomb) in coulomb.iter().enumerate() {
            let free = free.joint(j).iter();
            for ((e, free), rests) in e.joint_mut(j).iter_mut().zip(free).zip(&rows.rests[j]) {
                if *rests {
                    *e = free.signum() * (free.abs() - coulomb).max(0.0);
                }
            }
        }
        e
    };
    let all = |e: &JointSignals| (0..joints).map(|j| rms_where(e.joint(j), |_| true)).collect();
    let moving = |e: &JointSignals| -> Vec<f64> {
        (0..joints).map(|j| rms_where(e.joint(j), |k| rows.moves[j][k])).collect()
    };
    let own_friction = |e: &JointSignals| -> Vec<f64> {
        let of = |j: usize| without_friction_of(problem, set, j, e.joint(j), &rows.moves[j]);
        (0..joints).map(of).collect()
    };
    let mut warnings = regression.prepared.warnings.clone();
    warnings.extend(misreading.map(|misreading| misreading.sentence()));
    let manufacturer = match log.manufacturer_nm {
        Some(torque_nm) => {
            let given = Measurement { torque_nm, ..log.measurement };
            identifier.feed_forward(&given, &mut warnings)?.map(|given| {
                let of = |j: usize| mean_period(&given.problem.panels[j].y, samples);
                let given: Vec<Vec<f64>> = (0..joints).map(of).collect();
                JointSignals::from_fn(joints, samples, |j, k| measured[j][k] - given[j][k])
            })
        }
        None => None,
    };
    let (before, after) = (error(models.null), error(extension));
    let noise = noise_of_mean(&regression);
    Ok(HeldOut {
        log: log.measurement.source.to_owned(),
        warnings,
        standstill_fraction: rows.standstill_fractions(),
        noise_rms_nm: noise.as_ref().map(all),
        noise_moving_rms_nm: noise.as_ref().map(moving),
        before_rms_nm: all(&before),
        after_rms_nm: all(&after),
        before_moving_rms_nm: moving(&before),
        after_moving_rms_nm: moving(&after),
        before_own_friction_rms_nm: own_friction(&before),
        after_own_friction_rms_nm: own_friction(&after),
        before_standstill_free_rms_nm: all(&outside_friction(models.null)),
        after_standstill_free_rms_nm: all(&outside_friction(extension)),
        manufacturer_rms_nm: manufacturer.as_ref().map(all),
        manufacturer_moving_rms_nm: manufacturer.as_ref().map(moving),
    })
}

/// Classes of the regression's samples, per joint.
struct Rows {
    /// |q̇| > 0.02 rad/s.
    moves: Vec<Vec<bool>>,
    /// Within a rest of a quarter of a second or longer.
    rests: Vec<Vec<bool>>,
}

impl Rows {
    fn of(regression: &Regression) -> Self {
        let qd = &regression.prepared.motion.qd_rad_s;
        let samples = regression.problem.samples;
        let moves = (0..qd.joints()).map(|j| {
            (0..samples).map(|r| qd.joint(j)[regression.sample(r)].abs() > MOVING_RAD_S).collect()
        });
        let runs = RunWhitening::moving_rows(regression);
        let rests = runs.iter().map(|runs| runs.iter().map(|run| !run).collect());
        Self { moves: moves.collect(), rests: rests.collect() }
    }

    fn standstill_fractions(&self) -> Vec<f64> {
        let share = |rests: &Vec<bool>| {
            rests.iter().filter(|rests| **rests).count() as f64 / rests.len().max(1) as f64
        };
        self.rests.iter().map(share).collect()
    }
}

/// Rms of the error `e` of joint `j` while it moves, Nm, without the part of the error that the joint's own Coulomb and
/// viscous friction explain there.
fn without_friction_of(
    problem: &Problem,
    set: &BaseSet,
    j: usize,
    e: &[f64],
    moves: &[bool],
) -> f64 {
    let own = [Parameter::Coulomb(j), Parameter::Viscous(j)].map(|own| set.index_of(own));
    let columns = problem.panels[j].x.chunks_exact(problem.samples);
    let friction: Vec<&[f64]> = problem
        .plan
        .base_indices(j)
        .zip(columns)
        .filter(|(base, _)| own.contains(&Some(*base)))
        .map(|(_, column)| column)
        .collect();
    let where_moving = |y: &[f64]| -> Vec<f64> {
        y.iter().zip(moves).map(|(y, moves)| if *moves { *y } else { 0.0 }).collect()
    };
    let image = |y: &[f64]| Image { mean: where_moving(y), contrast: Vec::new() };
    let mut span = Span::default();
    for column in friction {
        span.push(&image(column));
    }
    let mut rest = image(e);
    span.residualise(&mut rest);
    rms_where(&rest.mean, |k| moves[k])
}

/// Coulomb friction of joint `j` in the base parameters `theta`, Nm.
fn coulomb_nm(set: &BaseSet, theta: &[f64], j: usize) -> f64 {
    set.index_of(Parameter::Coulomb(j)).map_or(0.0, |k| theta[k].abs())
}
