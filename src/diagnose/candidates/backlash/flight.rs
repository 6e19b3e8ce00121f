//! Rotors that fly between the flanks of their gears, several at once.
//!
//! ```text
//! δ̈ = (τ_L − T) m − A₁₁ δ̇ − A₁₂ ν,   ν̇ = −A₂₁ δ̇ − A₂₂ ν,   T = k (δ ∓ g/2) + d δ̇ beyond ±g/2 as long as it pushes, 0 between
//! ```
//!
//! with the relative velocity δ̇ of rotor and links, and the velocity ν of both together (of their centre of mass), each
//! beyond the motion of a rigid arm. The mobility m is 1/I_a + 1/L, with L = 1/[(M + I_a')⁻¹]_jj the inertia of the
//! links while the other joints are free to move. The drives hold the motors with −ω (M + I_a) q̇_M, which makes the
//! [matrix A](drive_rates).
//!
//! The drive of a flying rotor, which no longer carries its links, stops it within I_a/(ω (M + I_a)), a few milliseconds. From
//! then on the links fly alone, and nothing damps them: that is ν. Without it, rotors landed late, and flights fitted
//! gaps that were up to a third too narrow.

use super::super::elasticity::Jolts;
use crate::dynamics::with_widest_registers;
use crate::identify::FEEDBACK_RAD_S;

/// Number of gaps that are simulated in parallel. One flight waits for the result of each operation before the next; two
/// registers' worth of them take as long as one, and four hardly longer.
pub(super) const ABREAST: usize = 16;
/// Damping ratio ζ of the flanks: a few percent in strain-wave gears, and the rotor's own friction.
const DAMPING_RATIO: f64 = 0.08;
/// Fastest swing that is followed, times the time between two instants: flanks are made no stiffer than this. At sixteen
/// instants per sample, this swing is five times faster than what the samples can show. Behind stiffer flanks, light
/// links move with their rotor anyway.
const FOLLOWED: f64 = 1.0;

/// Stiffness and damping of the flanks that a rotor meets at the ends of its gap.
#[derive(Clone, Copy)]
pub(super) struct Flanks {
    pub(super) stiffness_nm_rad: f64,
    damping_nm_s_rad: f64,
}

impl Flanks {
    /// Flanks on which a rotor alone would swing at `flank_rad_s`.
    pub(super) fn alone(rotor_kg_m2: f64, flank_rad_s: f64) -> Self {
        Self {
            stiffness_nm_rad: rotor_kg_m2 * flank_rad_s.powi(2),
            damping_nm_s_rad: 2.0 * DAMPING_RATIO * rotor_kg_m2 * flank_rad_s,
        }
    }

    /// Limits the stiffness to what steps of `step_s` can follow, where a relative torque accelerates rotor and links
    /// apart by `mobility` per unit, and limits the damping to its critical value for that stiffness.
    pub(super) fn followed(self, mobility: f64, step_s: f64) -> Self {
        let stiffness_nm_rad = self.stiffness_nm_rad.min((FOLLOWED / step_s).powi(2) / mobility);
        let critical = 2.0 * (stiffness_nm_rad / mobility).sqrt();
        Self { stiffness_nm_rad, damping_nm_s_rad: self.damping_nm_s_rad.min(critical) }
    }
}

/// A rotor between the flanks of its gear.
pub(super) struct Flight {
    /// q_M − q_L, rad.
    angle_rad: f64,
    half_gap_rad: f64,
    flanks: Flanks,
}

impl Flight {
    /// A rotor at rest on the flank to which `load_nm` presses it.
    pub(super) fn pressed(half_gap_rad: f64, flanks: Flanks, load_nm: f64) -> Self {
        let angle_rad = half_gap_rad.copysign(load_nm) + load_nm / flanks.stiffness_nm_rad;
        Self { angle_rad, half_gap_rad, flanks }
    }
}

/// Several rotors under one load, stored as a structure of arrays so that the processor moves several at once.
pub(super) struct Flights {
    /// δ, rad.
    pub(super) angle_rad: [f64; ABREAST],
    /// δ̇, rad/s.
    pub(super) rate_rad_s: [f64; ABREAST],
    /// ν, rad/s.
    common_rad_s: [f64; ABREAST],
    half_gap_rad: [f64; ABREAST],
    stiffness_nm_rad: [f64; ABREAST],
    damping_nm_s_rad: [f64; ABREAST],
}

impl Flights {
    pub(super) fn abreast(flight: impl Fn(usize) -> Flight) -> Self {
        let flights: [Flight; ABREAST] = std::array::from_fn(flight);
        let each = |number: fn(&Flight) -> f64| std::array::from_fn(|lane| number(&flights[lane]));
        Self {
            angle_rad: each(|f| f.angle_rad),
            rate_rad_s: [0.0; ABREAST],
            common_rad_s: [0.0; ABREAST],
            half_gap_rad: each(|f| f.half_gap_rad),
            stiffness_nm_rad: each(|f| f.flanks.stiffness_nm_rad),
            damping_nm_s_rad: each(|f| f.flanks.damping_nm_s_rad),
        }
    }

    /// Advances by one `step` per load and jolt, Nm.
    pub(super) fn follow(&mut self, step: &Step, load_nm: &[f64], jolt_nm: &[f64]) {
        with_widest_registers(
            #[inline(always)]
            || {
                for (load_nm, jolt_nm) in load_nm.iter().zip(jolt_nm) {
                    self.advance(step, *load_nm, *jolt_nm);
                }
            },
        );
    }

    /// Semi-implicit Euler with all damping implicit, stable as long as √(k · mobility) · `step_s` < 2. The rate is that
    /// half a step before the angle. The flanks push and never pull.
    #[inline(always)]
    fn advance(&mut self, step: &Step, load_nm: f64, jolt_nm: f64) {
        for lane in 0..ABREAST {
            let (angle, half_gap) = (self.angle_rad[lane], self.half_gap_rad[lane]);
            let pressed = angle - angle.max(-half_gap).min(half_gap);
            let (rate, spring_nm) = (self.rate_rad_s[lane], self.stiffness_nm_rad[lane] * pressed);
            let pushes = (spring_nm + self.damping_nm_s_rad[lane] * rate) * pressed > 0.0;
            let (spring_nm, left) = match pushes {
                true => (spring_nm, step.left_in_flank[lane]),
                false => (0.0, step.left_in_gap[lane]),
            };
            let relative_nm = load_nm + step.jolted[lane] * jolt_nm - spring_nm;
            let common = self.common_rad_s[lane];
            let rate =
                (rate + relative_nm * step.rad_s_nm - step.from_common[lane] * common) * left;
            self.rate_rad_s[lane] = rate;
            self.common_rad_s[lane] =
                (common - step.to_common[lane] * rate) * step.left_common[lane];
            self.angle_rad[lane] += rate * step.step_s;
        }
    }
}

/// What a rotor and its links are moved by, the same from one sample to the next.
pub(super) struct Joint {
    /// m, 1/(kg m²).
    pub(super) mobility_per_kg_m2: f64,
    /// I_a, kg m².
    pub(super) rotor_kg_m2: f64,
    /// d_M, Nm s/rad ([`held_nm_s_rad`](super::super::elasticity::held_nm_s_rad)).
    pub(super) held_nm_s_rad: f64,
}

/// The matrix A of the drives' answer, 1/s:
///
/// ```text
/// A = (m d_M, ω σ/(σ − 1); ω/σ, ω),   σ = m I_a = (I_a + L)/L
/// ```
///
/// While rotor j moves with the velocity x and its links with w, the other joints, on which no torque acts, follow the
/// links with c = L (M + I_a')⁻¹ e_j. The motors move with ṁ = x e_j + w (c − e_j), and the drives answer with the
/// torques u = −ω (M + I_a) ṁ. Because (M + I_a') c = L e_j, the rotor gets u_j = −ω ((M_jj + I_a) x − (M_jj − L) w), and
/// the links get Σ c_i u_i = ω (M_jj − L) (x − w), over the other joints i. With x = ν + δ̇/σ and w = x − δ̇ follows A.
fn drive_rates(joint: &Joint) -> [[f64; 2]; 2] {
    let sigma = joint.mobility_per_kg_m2 * joint.rotor_kg_m2;
    // M_jj ≥ L in any real arm. Were it less, the drives would speed flights up.
    let least = FEEDBACK_RAD_S / (sigma - 1.0);
    let own = (joint.mobility_per_kg_m2 * joint.held_nm_s_rad).max(least);
    [[own, FEEDBACK_RAD_S * sigma / (sigma - 1.0)], [FEEDBACK_RAD_S / sigma, FEEDBACK_RAD_S]]
}

/// One integration step of several rotors, the same from one sample to the next.
pub(super) struct Step {
    step_s: f64,
    /// Change of the rate per torque, rad/s/Nm.
    rad_s_nm: f64,
    /// How much of the jolt each rotor gets.
    jolted: [f64; ABREAST],
    /// Share of its rate that damping leaves to a rotor, in its gap and against a flank.
    left_in_gap: [f64; ABREAST],
    left_in_flank: [f64; ABREAST],
    /// Share of ν that is taken from δ̇, the other way round, and the share of ν that is left.
    from_common: [f64; ABREAST],
    to_common: [f64; ABREAST],
    left_common: [f64; ABREAST],
}

impl Step {
    /// `made` says how much of the jolt and of the drives' answer each rotor gets.
    pub(super) fn of(
        flights: &Flights,
        made: &[Jolts; ABREAST],
        joint: &Joint,
        step_s: f64,
    ) -> Self {
        let rad_s_nm = joint.mobility_per_kg_m2 * step_s;
        let answer = drive_rates(joint).map(|row| row.map(|rate| rate * step_s));
        let each = |share: &dyn Fn(usize) -> f64| std::array::from_fn(share);
        let in_flank = |lane: usize| flights.damping_nm_s_rad[lane] * rad_s_nm;
        Self {
            step_s,
            rad_s_nm,
            jolted: made.map(|made| made.height),
            left_in_gap: each(&|k| 1.0 / (1.0 + made[k].damping * answer[0][0])),
            left_in_flank: each(&|k| 1.0 / (1.0 + made[k].damping * answer[0][0] + in_flank(k))),
            from_common: each(&|k| made[k].damping * answer[0][1]),
            to_common: each(&|k| made[k].damping * answer[1][0]),
            left_common: each(&|k| 1.0 / (1.0 + made[k].damping * answer[1][1])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps without drives.
    fn undriven(flights: &Flights, mobility_per_kg_m2: f64, step_s: f64) -> Step {
        let joint = Joint { mobility_per_kg_m2, rotor_kg_m2: 2.0, held_nm_s_rad: 0.0 };
        Step::of(flights, &[Jolts { damping: 0.0, ..Jolts::USUAL }; ABREAST], &joint, step_s)
    }

    /// A load that grows as s t takes the rotor across the gap g in the time (6 g/s)^(1/3).
    #[test]
    fn a_gap_is_crossed_in_the_time_of_a_cubic() {
        let (gap, slope, step_s) = (2e-5_f64, 300.0_f64, 1e-5);
        let mut flights =
            Flights::abreast(|_| Flight::pressed(0.5 * gap, Flanks::alone(1.0, 900.0), -1e-9));
        let step = undriven(&flights, 1.0, step_s);
        let mut t = 0.0;
        while flights.angle_rad[0] < 0.5 * gap {
            let load_nm = slope * (t + 0.5 * step_s);
            flights.follow(&step, &[load_nm], &[0.0]);
            t += step_s;
        }
        // Steps of 10 µs.
        assert!((t - (6.0 * gap / slope).cbrt()).abs() < 2.0 * step_s, "{t}");
    }

    /// Under a constant load the rotor comes to rest where the flank's deflection carries the load.
    #[test]
    fn a_rotor_comes_to_rest_in_the_flank() {
        let frequency = |lane: usize| 300.0 + 50.0 * lane as f64;
        let mut flights = Flights::abreast(|lane| {
            Flight::pressed(1e-5, Flanks::alone(1.0, frequency(lane)), -1.0)
        });
        let step = undriven(&flights, 1.0, 1e-5);
        flights.follow(&step, &[5.0; 100_000], &[0.0; 100_000]);
        for (lane, angle) in flights.angle_rad.iter().enumerate() {
            let at_rest = 1e-5 + 5.0 / frequency(lane).powi(2);
            // The swing left after 1 s: e^(−0.12 · 300).
            assert!((angle - at_rest).abs() < 1e-9 * at_rest, "{angle}");
        }
    }

    /// Links with a hundredth of the rotor's inertia, on flanks that the steps cannot follow, penetrate the flank no
    /// deeper than under the full load at rest.
    #[test]
    fn light_links_stay_with_their_rotor() {
        let (rotor, share, step_s, half_gap) = (0.25, 0.01, 5e-4, 1e-4);
        let mobility = 1.0 / (rotor * share);
        let flanks = Flanks::alone(rotor, 900.0).followed(mobility, step_s);
        let mut flights = Flights::abreast(|_| Flight::pressed(half_gap, flanks, 1.0));
        let step = undriven(&flights, mobility, step_s);
        let at_rest = half_gap + 1.0 / flanks.stiffness_nm_rad;
        for k in 0..100_000 {
            let load = (0.01 * f64::from(k) * std::f64::consts::TAU * step_s).cos();
            flights.follow(&step, &[load], &[0.0]);
            // The load crosses zero at 2π · 0.01 Nm/s, the rotor crosses its gap in 36 ms, and the flank stops the
            // final speed of 0.016 rad/s within a few steps of 0.5 ms: 8 µrad deep, compared with 100 µrad under the
            // full load.
            assert!(flights.angle_rad[0].abs() < 1.001 * at_rest, "{k} {}", flights.angle_rad[0]);
        }
        // After 50 s, half a period of the load, the load presses to the other side.
        assert!(
            (flights.angle_rad[0] + at_rest).abs() < 1e-3 * at_rest,
            "{}",
            flights.angle_rad[0]
        );
    }

    /// Of two joints whose links are coupled, the second gear flies while the first joint follows: the drives' torques
    /// on rotor and links change δ̇ and ν as the matrix A says.
    #[test]
    fn drives_of_all_joints_answer_a_flight() {
        use nalgebra::{Matrix2, Vector2};
        let mass = Matrix2::new(3.0, 1.2, 1.2, 0.8);
        let rotors = Matrix2::from_diagonal(&Vector2::new(1.6, 0.5));
        let but_own = mass + Matrix2::from_diagonal(&Vector2::new(1.6, 0.0));
        let (rotor, own) = (0.5, Vector2::new(0.0, 1.0));
        let follows = but_own.try_inverse().unwrap() * own;
        let links = 1.0 / follows[1];
        let follows = follows * links;
        let mobility = 1.0 / rotor + 1.0 / links;
        let held_nm_s_rad = FEEDBACK_RAD_S * (mass[(1, 1)] - 1.0 / mobility);
        let joint = Joint { mobility_per_kg_m2: mobility, rotor_kg_m2: rotor, held_nm_s_rad };
        let a = drive_rates(&joint);
        for [x, w] in [[1.0, 0.0], [0.0, 1.0], [0.3, -0.7]] {
            let motors = own * x + (follows - own) * w;
            let torques = (mass + rotors) * motors * -FEEDBACK_RAD_S;
            let on_links = follows[0] * torques[0];
            let relative = torques[1] / rotor - on_links / links;
            let common = (torques[1] + on_links) / (rotor + links);
            let (rate, centre) = (x - w, (rotor * x + links * w) / (rotor + links));
            let expected = [0, 1].map(|row| -a[row][0] * rate - a[row][1] * centre);
            // A handful of operations on numbers of order 1000.
            assert!((relative - expected[0]).abs() < 1e-11, "{relative} {}", expected[0]);
            assert!((common - expected[1]).abs() < 1e-11, "{common} {}", expected[1]);
        }
    }

    /// Rotor and links as two bodies, with a drive that holds the rotor against both: the links cross the gap in the
    /// same time as in the flights.
    #[test]
    fn links_fly_on_while_the_drive_stops_their_rotor() {
        let (rotor, links, gap, slope, step_s) = (1.6, 3.0, 6e-5_f64, 100.0_f64, 1e-6);
        let mobility = 1.0 / rotor + 1.0 / links;
        let held_nm_s_rad = FEEDBACK_RAD_S * (links - 1.0 / mobility);
        let joint = Joint { mobility_per_kg_m2: mobility, rotor_kg_m2: rotor, held_nm_s_rad };
        let mut flights =
            Flights::abreast(|_| Flight::pressed(0.5 * gap, Flanks::alone(rotor, 900.0), -1e-9));
        let step = Step::of(&flights, &[Jolts::USUAL; ABREAST], &joint, step_s);
        let mut t = 0.0;
        while flights.angle_rad[0] < 0.5 * gap {
            flights.follow(&step, &[slope * t], &[0.0]);
            t += step_s;
        }
        let (mut motor, mut link, mut delta, mut landed) = (0.0, 0.0, -0.5 * gap, 0.0);
        while delta < 0.5 * gap {
            let load = slope * landed;
            motor += step_s * (load - FEEDBACK_RAD_S * (rotor + links) * motor) / rotor;
            link -= step_s * load / links;
            delta += step_s * (motor - link);
            landed += step_s;
        }
        // Both are of first order in steps of 1 µs, and the drive stops the rotor in 4 ms.
        assert!((t - landed).abs() < 5.0 * step_s, "{t} {landed}");
        // Without the drive.
        let free = (6.0 * gap / (slope * mobility)).cbrt();
        assert!(landed > 1.1 * free, "{landed} {free}");
    }
}
