//! Effect size: how much of a hidden effect a log can show.

use nalgebra::DMatrix;
use serde::Serialize;

use super::motion_noise::MotionNoise;
use super::scenario::Scenario;
use super::simulation::Simulation;
use crate::base::ColumnPlan;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, Problem, Spectrum, Triangle};
use crate::plant::{PlantError, Recording, Whitening};
use crate::signal::FineClock;

/// Size of the effects hidden in a scenario, in units of the noise of one log.
///
/// d is the torque that the effects add along the log. The noise-free torque minus the torque of the null model with
/// its true parameters (from the log's angles, velocities and the derivative of the velocities, at all samples of the
/// whole periods) gives a difference; d is this difference minus the same difference for the arm without effects,
/// which holds the errors that sampling makes where friction reverses. W whitens the noise of the equations: that of
/// the torque readings, and that of the encoders times the inertia, which is the larger one above some 10 Hz. Q is an
/// orthonormal basis of the whitened regressor W X of the null model. Then:
///
/// ```text
/// λ     = ‖(1 − Q Qᵀ) W d‖²    what no parameters of the null model can explain
/// λ_sim = ‖Q Qᵀ W d‖²          what moves its parameters: Δpᵀ V⁻¹ Δp with V⁻¹ = Xᵀ WᵀW X
/// ```
///
/// λ is the noncentrality of the most powerful test on the residuals, λ_sim that of the most powerful test against a
/// given simulation. Effects on single readings (outliers, lost rows, coarse steps) are not counted, and no size of
/// this kind is defined for a clock that stalls.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EffectSize {
    /// λ.
    pub lambda: f64,
    /// λ_sim.
    pub lambda_sim: f64,
}

/// Number of harmonic rows that are eliminated in one block.
const BLOCK: usize = 128;

impl Simulation {
    /// λ and λ_sim of all effects of the scenario together.
    ///
    /// # Errors
    /// [`PlantError::Setting`] where a joint's torque is read without noise: every effect, however small, would then
    /// be visible.
    pub fn effect_size(&self) -> Result<EffectSize, PlantError> {
        let clean = Scenario { effects: Vec::new(), ..self.scenario.clone() };
        self.size_beside(&Self::run(clean)?.recording)
    }

    /// λ and λ_sim of all effects of the scenario together. `clean` is the run of the arm without effects along the
    /// same motion; it may be longer.
    ///
    /// # Errors
    /// See [`Self::effect_size`].
    pub fn size_beside(&self, clean: &Recording) -> Result<EffectSize, PlantError> {
        let scenario = &self.scenario;
        let rate_hz = scenario.plant.log_rate_hz;
        let sd = scenario.sensors.torque_sd_per_joint_nm(scenario.arm.dof())?;
        let whitening = Whitening::new(&scenario.sensors.torque_noise, &sd, rate_hz)?;
        let model = Model::new(&scenario.arm);
        let mut problem = self.equations(&model, &self.without_noise());
        let truth = scenario.set.values(&model.standard_parameters());
        let difference = problem.residuals(&truth);
        let without = self.equations(&model, clean).residuals(&truth);
        for (j, panel) in problem.panels.iter_mut().enumerate() {
            let pairs = difference.joint(j).iter().zip(without.joint(j));
            panel.y.iter_mut().zip(pairs).for_each(|(y, (with, without))| *y = with - without);
        }
        let q_rad = &self.recording.q_rad;
        let motion_noise = MotionNoise::new(&scenario.sensors, &model, q_rad, &whitening)?;
        let torque_power = scenario.sensors.torque_noise.spectrum(rate_hz);
        let whitening_at =
            |frequency_hz| motion_noise.whitening(frequency_hz, torque_power(frequency_hz));
        Ok(size(problem, &whitening, &whitening_at))
    }

    /// The equations of motion of the whole periods of `recording`.
    fn equations(&self, model: &Model, recording: &Recording) -> Problem {
        let Scenario { excitation, plant, set, .. } = &self.scenario;
        let [begin_s, end_s] = excitation.periodic_window_s();
        let first = recording.time_s.partition_point(|t| *t < begin_s - 1e-9);
        let behind = recording.time_s.partition_point(|t| *t < end_s - 1e-9);
        let window = first..behind;
        let qd_rad_s = recording.qd_rad_s.slice(window.clone());
        let clock = FineClock::new(window.len(), 1);
        let motion = Motion {
            q_rad: recording.q_rad.slice(window.clone()),
            qdd_rad_s2: qd_rad_s.map_joints(|_, qd| clock.derivative(qd, plant.log_rate_hz)),
            qd_rad_s,
        };
        let mut problem = Problem::new(ColumnPlan::new(model, set), plant.log_rate_hz);
        let torque = recording.torque_nm.slice(window);
        Assembler::new(model).assemble(&mut problem, model, &motion, &torque);
        problem
    }
}

/// λ and λ_sim of d, which `problem` holds in place of the torque. `torque` whitens the noise of the torque readings;
/// `beside_torque` then whitens, at each frequency, the sum of that white noise and the noise of the motion.
fn size(
    mut problem: Problem,
    torque: &Whitening,
    beside_torque: &dyn Fn(f64) -> DMatrix<f64>,
) -> EffectSize {
    let (n, b, joints) = (problem.samples, problem.parameters(), problem.joints());
    for panel in &mut problem.panels {
        panel.x.chunks_exact_mut(n).for_each(|column| torque.in_time(column));
        torque.in_time(&mut panel.y);
    }
    let mut rows = Problem::new(problem.plan.clone(), problem.rate_hz);
    Spectrum::default().transform(&problem, n, &mut rows);
    let across = DMatrix::from_fn(joints, joints, |i, k| torque.across(i)[k]);
    let fundamental_hz = problem.rate_hz / n as f64;
    let weights: Vec<DMatrix<f64>> = (0..=rows.samples / 2)
        .map(|harmonic| beside_torque(harmonic as f64 * fundamental_hz) * &across)
        .collect();
    let n = rows.samples;
    let mut triangle = Triangle::new(b, 1);
    let mut block = Vec::new();
    for start in (0..n).step_by(BLOCK) {
        let end = n.min(start + BLOCK);
        for joint in 0..joints {
            block.clear();
            block.resize((b + 1) * (end - start), 0.0);
            for (source, panel) in rows.panels.iter().enumerate() {
                let columns = rows.plan.base_indices(source).chain([b]);
                let series = panel.x.chunks_exact(n).chain([panel.y.as_slice()]);
                for (column, series) in columns.zip(series) {
                    let target = &mut block[column * (end - start)..];
                    for (t, row) in target.iter_mut().zip(start..end) {
                        *t += weights[row.div_ceil(2)][(joint, source)] * series[row];
                    }
                }
            }
            triangle.append(&mut block, end - start);
        }
    }
    let lambda_sim = triangle.rhs(0).iter().map(|z| z * z).sum();
    EffectSize { lambda: triangle.outside(0), lambda_sim }
}
