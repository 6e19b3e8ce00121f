//! Play in the gear. While the load presses rotor and link together they move as one; where it changes
//! sign they part, and the rotor flies through the gap g to the other flank, alone:
//!
//! ```text
//! δ̈ = τ_L (1/I_a + 1/M_jj)   for |δ| < g/2,   δ̇ ← −e δ̇ at a flank,   δ = q_M − q_L
//! ```
//!
//! with the load τ_L of the rigid arm, which passes through zero, and the restitution e of the flanks. The
//! log has the motor's angle, so that the links have moved by δ less than it says. A flight lasts
//! (6 g/δ⃛)^(1/3), a few milliseconds, and is seen by its jerk at both ends.

use super::elasticity::{give_way, lagging_by};
use super::*;

/// See the module.
pub struct Backlash;

/// Restitution of the flanks, by variant: from greased to dry hardened steel.
const RESTITUTION: [f64; 2] = [0.3, 0.8];
/// Steps of the flight per sample of the log.
const STEPS: usize = 16;

impl Candidate for Backlash {
    fn kind(&self) -> Kind {
        Kind::Backlash
    }

    fn shapes(&self, _: &Scene, _: Option<usize>) -> Vec<Shape> {
        (0..RESTITUTION.len())
            .flat_map(|variant| geometric(3e-6, 1e-2, 8).map(move |value| Shape { variant, value }))
            .collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let load = scene.link_nm.joint(j);
        let n = load.len();
        let inertia = scene.own_inertia_kg_m2.joint(j);
        let rotor = scene.arm.joints[j].drive.rotor_inertia_kg_m2.max(f64::MIN_POSITIVE);
        let step_s = 1.0 / (scene.rate_hz * STEPS as f64);
        let phases: Vec<Vec<f64>> =
            (0..STEPS).map(|i| scene.delayed(load, -(i as f64) * step_s)).collect();
        let mut flight = Flight::pressed(0.5 * shape.value, RESTITUTION[shape.variant], load[0]);
        let mut delta = vec![0.0; n];
        // The second round begins as a motion that repeats does.
        let rounds = if scene.periodic { 2 } else { 1 };
        for k in (0..rounds).flat_map(|_| 0..n) {
            delta[k] = flight.angle_rad;
            let mobility = 1.0 / rotor + 1.0 / inertia[k].max(f64::MIN_POSITIVE);
            for phase in &phases {
                flight.step(phase[k] * mobility, step_s);
            }
        }
        vec![give_way(scene, &lagging_by(scene, j, &delta), shape.value)]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("gap_rad", b[0], "rad")]
    }

    fn separating_experiment(&self) -> &'static str {
        "hold the motor and push the link both ways: play gives no torque, a spring does"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    fn in_words(&self) -> &'static str {
        "play in the gear"
    }
}

/// A rotor between the flanks of its gear.
struct Flight {
    /// q_M − q_L, rad.
    angle_rad: f64,
    rate_rad_s: f64,
    half_gap_rad: f64,
    restitution: f64,
}

impl Flight {
    /// On the flank to which `load` presses it.
    fn pressed(half_gap_rad: f64, restitution: f64, load: f64) -> Self {
        Self { angle_rad: half_gap_rad.copysign(load), rate_rad_s: 0.0, half_gap_rad, restitution }
    }

    /// `step_s` later, with δ̈ = `acceleration` (rad/s²).
    fn step(&mut self, acceleration: f64, step_s: f64) {
        self.angle_rad += self.rate_rad_s * step_s + 0.5 * acceleration * step_s * step_s;
        self.rate_rad_s += acceleration * step_s;
        if self.angle_rad.abs() >= self.half_gap_rad && self.rate_rad_s * self.angle_rad > 0.0 {
            self.angle_rad = self.half_gap_rad.copysign(self.angle_rad);
            self.rate_rad_s *= -self.restitution;
            // A step adds up to a Δt to every bounce: bounces end where that keeps them alive.
            let kept_alive = acceleration.abs() * step_s / (1.0 - self.restitution);
            if self.rate_rad_s.abs() < kept_alive {
                self.rate_rad_s = 0.0;
            }
        }
        self.angle_rad = self.angle_rad.clamp(-self.half_gap_rad, self.half_gap_rad);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A load that grows as s t takes the rotor across the gap g in (6 g/s)^(1/3).
    #[test]
    fn a_gap_is_crossed_in_the_time_of_a_cubic() {
        let (gap, slope, step_s) = (2e-5_f64, 300.0_f64, 1e-5);
        let mut flight = Flight::pressed(0.5 * gap, 0.0, -1.0);
        let mut t = 0.0;
        while flight.angle_rad < 0.5 * gap {
            flight.step(slope * (t + 0.5 * step_s), step_s);
            t += step_s;
        }
        // Steps of 10 µs.
        assert!((t - (6.0 * gap / slope).cbrt()).abs() < 2.0 * step_s, "{t}");
    }

    #[test]
    fn a_rotor_comes_to_rest_on_the_flank() {
        let mut flight = Flight::pressed(1e-5, 0.85, -1.0);
        for _ in 0..20_000 {
            flight.step(5.0, 1e-5);
        }
        assert_eq!((flight.angle_rad, flight.rate_rad_s), (1e-5, 0.0));
    }
}
