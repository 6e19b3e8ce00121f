//! Configuration of the plant.

use serde::{Deserialize, Serialize};

use super::error::PlantError;

/// Integration step, rates and controller: the `[plant]` table of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlantConfig {
    /// Step of the Runge–Kutta method, s. Default 1 ms, with which the logged motion satisfies the equations of motion
    /// to 2e-5 Nm between decisions of the controller, friction included (`tests/val_plant.rs` prints the table).
    pub step_s: f64,
    /// Rate of the controller, Hz; its period must be a whole number of steps. Default 1000. The logged torque is the
    /// mean of the torques held before and after an instant; at lower rates this mean is visibly wrong where friction
    /// reverses, which biases the identified friction parameters.
    pub control_rate_hz: f64,
    /// Rate of the log, Hz; its period must be a whole number of steps. Default 125.
    pub log_rate_hz: f64,
    /// Bandwidth ω of the feedback, rad/s. Default 50.
    pub bandwidth_rad_s: f64,
    /// Damping ratio ζ of the feedback. Default 1.
    pub damping: f64,
    /// Share of the arm's friction that the controller feeds forward. Default 0.9.
    pub friction_feedforward: f64,
}

impl Default for PlantConfig {
    fn default() -> Self {
        Self {
            step_s: 0.001,
            control_rate_hz: 1000.0,
            log_rate_hz: 125.0,
            bandwidth_rad_s: 50.0,
            damping: 1.0,
            friction_feedforward: 0.9,
        }
    }
}

impl PlantConfig {
    /// Checks that all values are in range and that the periods of controller and log are whole numbers of steps.
    pub fn validate(&self) -> Result<(), PlantError> {
        for (key, value, zero_allowed) in [
            ("step_s", self.step_s, false),
            ("control_rate_hz", self.control_rate_hz, false),
            ("log_rate_hz", self.log_rate_hz, false),
            ("bandwidth_rad_s", self.bandwidth_rad_s, false),
            ("damping", self.damping, true),
            ("friction_feedforward", self.friction_feedforward, true),
        ] {
            if !(value > 0.0 && value.is_finite() || zero_allowed && value == 0.0) {
                let requirement =
                    if zero_allowed { "must not be negative" } else { "must be positive" };
                return Err(PlantError::Setting { key, value, requirement });
            }
        }
        self.steps_per_control()?;
        self.steps_per_log()?;
        Ok(())
    }

    /// Number of steps between two decisions of the controller.
    pub fn steps_per_control(&self) -> Result<usize, PlantError> {
        self.steps_in("control_rate_hz", self.control_rate_hz)
    }

    /// Number of steps between two samples of the log.
    pub fn steps_per_log(&self) -> Result<usize, PlantError> {
        self.steps_in("log_rate_hz", self.log_rate_hz)
    }

    fn steps_in(&self, key: &'static str, rate_hz: f64) -> Result<usize, PlantError> {
        let steps = 1.0 / (rate_hz * self.step_s);
        let whole = steps.round();
        // Rates and steps are decimal numbers: the deviation is a few units of round-off or a real mismatch.
        if whole < 1.0 || (steps - whole).abs() > 1e-9 * whole {
            return Err(PlantError::Setting {
                key,
                value: rate_hz,
                requirement: "its period must be a whole number of integration steps (step_s)",
            });
        }
        Ok(whole as usize)
    }
}
