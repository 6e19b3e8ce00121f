//! How much of a hidden effect a log can show.

use serde::Serialize;

use super::simulation::Simulation;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, ColumnPlan, Problem, Triangle};
use crate::plant::{PlantError, Whitening};

/// Size of what is hidden in a scenario, in units of the noise of one log.
///
/// With d the noise-free torque minus that of the null model's truth along the same log (its angles,
/// velocities and accelerations, all samples of the whole periods), W the whitening of the torque
/// noise, and Q an orthonormal basis of the whitened regressor W X of the null model:
///
/// ```text
/// λ     = ‖(1 − Q Qᵀ) W d‖²    what no parameters of the null model can explain
/// λ_sim = ‖Q Qᵀ W d‖²          what moves its parameters: Δpᵀ V⁻¹ Δp with V⁻¹ = Xᵀ WᵀW X
/// ```
///
/// λ is the noncentrality of the best test that could be made of the residuals, λ_sim that of the best
/// test against a given simulation. Noise of the encoders is not counted, and neither are readings that
/// go wrong one by one (outliers, lost rows, coarse steps). Accelerations are derivatives of the
/// encoders' angles at the instants at which rows are read: a clock that stalls has no size of this kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EffectSize {
    /// λ.
    pub lambda: f64,
    /// λ_sim.
    pub lambda_sim: f64,
}

/// Samples whitened and eliminated together.
const BLOCK: usize = 128;

impl Simulation {
    /// λ and λ_sim of all effects of the scenario together.
    ///
    /// # Errors
    /// [`PlantError::Setting`] where a joint's torque is read without noise: nothing is then too small
    /// to be seen.
    pub fn effect_size(&self) -> Result<EffectSize, PlantError> {
        let scenario = &self.scenario;
        let rate_hz = scenario.plant.log_rate_hz;
        let sd = scenario.sensors.torque_sd_per_joint_nm(scenario.arm.dof())?;
        let whitening = Whitening::new(&scenario.sensors.torque_noise, &sd, rate_hz)?;

        let (recording, qdd_rad_s2) = self.plant.run_with_acceleration(&scenario.excitation)?;
        let [begin_s, end_s] = scenario.excitation.periodic_window_s();
        let first = recording.time_s.partition_point(|t| *t < begin_s - 1e-9);
        let behind = recording.time_s.partition_point(|t| *t < end_s - 1e-9);
        let window = first..behind;
        let motion = Motion {
            q_rad: recording.q_rad.slice(window.clone()),
            qd_rad_s: recording.qd_rad_s.slice(window.clone()),
            qdd_rad_s2: qdd_rad_s2.slice(window.clone()),
        };
        let model = Model::new(&scenario.arm);
        let plan = ColumnPlan::new(&model, &scenario.set);
        let mut problem = Problem::new(plan, rate_hz);
        let torque = recording.torque_nm.slice(window);
        Assembler::new(&model).assemble(&mut problem, &model, &motion, &torque);
        let truth = scenario.set.values(&model.standard_parameters());
        let difference = problem.residuals(&truth);
        for (j, panel) in problem.panels.iter_mut().enumerate() {
            panel.y.copy_from_slice(difference.joint(j));
        }
        Ok(size(problem, &whitening))
    }
}

/// λ and λ_sim of d, which stands in place of the torque in `problem`.
fn size(mut problem: Problem, whitening: &Whitening) -> EffectSize {
    let (n, b) = (problem.samples, problem.parameters());
    for panel in &mut problem.panels {
        panel.x.chunks_exact_mut(n).for_each(|column| whitening.in_time(column));
        whitening.in_time(&mut panel.y);
    }
    let mut triangle = Triangle::new(b, 1);
    let mut block = Vec::new();
    for start in (0..n).step_by(BLOCK) {
        let rows = BLOCK.min(n - start);
        for joint in 0..problem.joints() {
            block.clear();
            block.resize((b + 1) * rows, 0.0);
            for (source, &weight) in whitening.across(joint).iter().enumerate() {
                let panel = &problem.panels[source];
                let columns = problem.plan.base_indices(source).chain([b]);
                let series = panel.x.chunks_exact(n).chain([panel.y.as_slice()]);
                for (column, series) in columns.zip(series) {
                    let target = &mut block[column * rows..][..rows];
                    for (t, s) in target.iter_mut().zip(&series[start..start + rows]) {
                        *t += weight * s;
                    }
                }
            }
            triangle.append(&mut block, rows);
        }
    }
    let lambda_sim = triangle.rhs(0).iter().map(|z| z * z).sum();
    EffectSize { lambda: triangle.outside(0), lambda_sim }
}
