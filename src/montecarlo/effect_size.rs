//! How much of a hidden effect a log can show.

use nalgebra::DMatrix;
use serde::Serialize;

use super::motion_noise::MotionNoise;
use super::scenario::Scenario;
use super::simulation::Simulation;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, ColumnPlan, Problem, Spectrum, Triangle};
use crate::plant::{PlantError, Recording, Whitening};
use crate::signal::FineClock;

/// Size of what is hidden in a scenario, in units of the noise of one log.
///
/// With d the noise-free torque minus that of the null model's truth along the same log (its angles, its velocities
/// and their derivative, all samples of the whole periods), less the same of the arm without effects (what sampling
/// does to friction that reverses), W the whitening of the noise of the equations (that of the torque readings, and
/// that of the encoders times the inertia: above some 10 Hz it is the larger one), and Q an orthonormal basis of the
/// whitened regressor W X of the null model:
///
/// ```text
/// λ     = ‖(1 − Q Qᵀ) W d‖²    what no parameters of the null model can explain
/// λ_sim = ‖Q Qᵀ W d‖²          what moves its parameters: Δpᵀ V⁻¹ Δp with V⁻¹ = Xᵀ WᵀW X
/// ```
///
/// λ is the noncentrality of the best test that could be made of the residuals, λ_sim that of the best
/// test against a given simulation. Readings that go wrong one by one (outliers, lost rows, coarse steps) are not
/// counted, and a clock that stalls has no size of this kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EffectSize {
    /// λ.
    pub lambda: f64,
    /// λ_sim.
    pub lambda_sim: f64,
}

/// Rows eliminated together.
const BLOCK: usize = 128;

impl Simulation {
    /// λ and λ_sim of all effects of the scenario together.
    ///
    /// # Errors
    /// [`PlantError::Setting`] where a joint's torque is read without noise: nothing is then too small
    /// to be seen.
    pub fn effect_size(&self) -> Result<EffectSize, PlantError> {
        let clean = Scenario { effects: Vec::new(), ..self.scenario.clone() };
        self.size_beside(&Self::run(clean)?.recording)
    }

    /// λ and λ_sim of all effects, `clean` being the run of the arm without them along the same motion, or one that
    /// goes on longer.
    ///
    /// # Errors
    /// See [`Self::effect_size`].
    pub fn size_beside(&self, clean: &Recording) -> Result<EffectSize, PlantError> {
        let scenario = &self.scenario;
        let rate_hz = scenario.plant.log_rate_hz;
        let sd = scenario.sensors.torque_sd_per_joint_nm(scenario.arm.dof())?;
        let whitening = Whitening::new(&scenario.sensors.torque_noise, &sd, rate_hz)?;
        let model = Model::new(&scenario.arm);
        let mut problem = self.equations(&model, &self.recording);
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

    /// The whole periods of `recording`.
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

/// λ and λ_sim of d, which stands in place of the torque in `problem`; `beside_torque` whitens at every frequency
/// what `torque` has made white but for the noise of the motion.
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
