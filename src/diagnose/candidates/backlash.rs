//! Play in the gear. While the load presses rotor and link together, they move as one, apart from the compliance of the
//! flanks. Where the load changes sign they part, and the rotor flies through the gap g to the other flank:
//!
//! ```text
//! δ̈ = (τ_L − T − d_M δ̇) (1/I_a + [(M + I_a')⁻¹]_jj),   T = k (δ ∓ g/2) + d δ̇ beyond ±g/2 as long as it pushes, 0 between
//! ```
//!
//! Here δ = q_M − q_L, and τ_L is the load of the rigid arm, which passes through zero ([`Scene::fine_rigid_nm`]: what the
//! logged motion needs holds the flight as well). The other joints are free to move; with them held, gaps at the elbow
//! seemed half as wide as they were. The flanks are such that the rotor alone swings against them at √(k/I_a), with the
//! damping d = 2 ζ √(k I_a). The drives damp by d_M, as they do in compliant gears.
//!
//! The log has the motor's angle, so that the links have moved by δ less than it says. A flight lasts (6 g/δ⃛)^(1/3), a
//! few milliseconds. It shows by its jerk at both ends and by the swing after it. The log has δ̇ only at its samples,
//! and the acceleration is the derivative of these samples; so is what it shows of the drives' answer
//! ([`Lag::column`]).

use super::elasticity::{HELD_ERROR, Jolts, Lag, held_nm_s_rad};
use super::*;
use crate::diagnose::scene::FINE;
use crate::dynamics::with_widest_registers;

/// See the module.
pub struct Backlash;

/// Frequencies at which the rotor swings against its flanks, rad/s, by variant: from flanks that the log's rate can
/// hardly tell from rigid ones to those of a compliant gear. What the samples show of a swing depends on its phase
/// within their step. Halfway between two neighbouring frequencies, the phase is off by one radian when the swing has
/// decayed to 1/e.
const FLANK_RAD_S: [f64; 14] = [
    900.0, 775.0, 668.0, 576.0, 496.0, 428.0, 369.0, 318.0, 274.0, 236.0, 203.0, 175.0, 151.0,
    130.0,
];
/// Damping ratio ζ of the flanks: a few percent in strain-wave gears, and the rotor's own friction.
const DAMPING_RATIO: f64 = 0.08;
/// Number of integration steps per instant. With one, rotors land on their flanks late by a part of it.
const STEPS: usize = 4;
/// Fastest swing that is followed, times the time between two instants: flanks are made no stiffer than this. At sixteen
/// instants per sample, this swing is five times faster than what the samples can show. Behind stiffer flanks, light
/// links move with their rotor anyway.
const FOLLOWED: f64 = 1.0;
/// Time in which the initial state of the simulated flight is mostly forgotten, s.
const RUN_IN_S: f64 = 3.0;
/// Number of gaps that are simulated in parallel.
const ABREAST: usize = 8;

impl Candidate for Backlash {
    fn kind(&self) -> Kind {
        Kind::Backlash
    }

    /// Variants whose flanks are too stiff for the integration steps are clipped to the same stiffness; only one of
    /// them is kept.
    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        let stiffness = Flanks::by_variant(scene, joint(site)).map(|f| f.stiffness_nm_rad);
        (0..FLANK_RAD_S.len())
            .filter(|&v| stiffness.get(v + 1).is_none_or(|softer| *softer < stiffness[v]))
            .flat_map(|variant| geometric(3e-6, 1e-2, 8).map(move |value| Shape { variant, value }))
            .collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        self.bank(scene, site, &[shape]).remove(0)
    }

    fn bank(&self, scene: &Scene, site: Option<usize>, shapes: &[Shape]) -> Vec<Vec<Column>> {
        let flown: Vec<_> = shapes.iter().map(|shape| (*shape, Jolts::USUAL)).collect();
        flights(scene, joint(site), &flown).map(|column| vec![column]).collect()
    }

    /// Directions in which the law may be wrong: the drive's response to jolts, the width of the gap where jolts are
    /// decisive, and the stiffness of its flanks.
    fn loose(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        if !scene.periodic {
            return Vec::new();
        }
        let wide = |factor: f64| Shape { value: factor * shape.value, ..shape };
        let hard = |variant: usize| Shape { variant: variant.min(FLANK_RAD_S.len() - 1), ..shape };
        let jolted = Jolts::OF_OTHER_DRIVES.map(|made| (shape, made));
        let harder = shape.variant.saturating_sub(1);
        let flanks = [shape, wide(0.85), wide(1.2), hard(harder), hard(shape.variant + 1)];
        let [usual, wider @ ..] = flanks.map(|shape| (shape, Jolts::USUAL));
        let flown = [&[usual], &jolted[..], &wider[..]].concat();
        let mut columns = flights(scene, joint(site), &flown);
        let Some(usual) = columns.next() else { return Vec::new() };
        columns.map(|other| other.minus(&usual)).collect()
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("gap_rad", b[0], "rad")]
    }

    fn in_shape(&self, shape: Shape) -> Option<Quantity> {
        Some(quantity("gap_rad", shape.value, "rad"))
    }

    fn whole(&self, shape: Shape) -> Option<f64> {
        Some(shape.value)
    }

    fn form_error(&self, _: &Scene, _: Shape) -> f64 {
        HELD_ERROR
    }

    fn separating_experiment(&self) -> &'static str {
        "hold the motor and push the link both ways: play gives no torque, a spring does"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    /// The gap is determined twice: by how far the links lag (coefficient) and by how long a flight lasts (shape).
    /// Flanks and drives that are harder or softer than assumed make a flight seem longer or shorter. If the flight
    /// fits a gap of less than a third of the lag, there was no gap but a compliant gear. If it fits a gap more than
    /// four times the lag, the flight seems 1.6 times too long, and no gap was flown through.
    fn is_its_own(&self, _: &Scene, _: Option<usize>, shape: Shape, b: &[f64]) -> bool {
        b.first().is_none_or(|gap_rad| (0.25..=3.0).contains(&(gap_rad / shape.value)))
    }

    fn in_words(&self) -> &'static str {
        "play in the gear"
    }
}

/// Torque per unit of the gap of joint `j`, for each shape and the response to jolts that goes with it.
fn flights(scene: &Scene, j: usize, flown: &[(Shape, Jolts)]) -> impl Iterator<Item = Column> {
    let column = move |((shape, _), [delta, rate]): (&(Shape, Jolts), [Vec<f64>; 2])| {
        Lag::logged(scene, delta, rate).column(scene, j, shape.value)
    };
    let abreast = flown.chunks(ABREAST).flat_map(move |some| some.iter().zip(fly(scene, j, some)));
    abreast.map(column)
}

/// δ (rad) and δ̇ (rad/s) at the samples of joint `j`, for each of up to [`ABREAST`] shapes.
fn fly(scene: &Scene, j: usize, flown: &[(Shape, Jolts)]) -> Vec<[Vec<f64>; 2]> {
    let n = scene.samples();
    let mobility = scene.mobility_per_kg_m2.joint(j);
    let step_s = scene.instant_s() / STEPS as f64;
    let [load, jolts] = scene.fine_rigid_nm(j);
    let mut entered = scene.entered(RUN_IN_S).peekable();
    let start_nm = entered.peek().map_or(0.0, |k| load[FINE * k]);
    let flanks = Flanks::by_variant(scene, j);
    let of_lane = |lane: usize| flown[lane.min(flown.len() - 1)];
    let made: [Jolts; ABREAST] = std::array::from_fn(|lane| of_lane(lane).1);
    let pressed = |lane: usize| {
        let (shape, _) = of_lane(lane);
        Flight::pressed(0.5 * shape.value, flanks[shape.variant], start_nm)
    };
    let mut flights = Flights::abreast(pressed);
    let mut out: Vec<[Vec<f64>; 2]> = flown.iter().map(|_| [vec![0.0; n], vec![0.0; n]]).collect();
    for k in entered {
        let (load_nm, jolt_nm) = (steps_from(load, k), steps_from(jolts, k));
        let held = held_nm_s_rad(scene, j, k);
        let step = Step::of(&flights, &made, (mobility[k], held), step_s);
        let [angle_rad, before_rad_s] = [flights.angle_rad, flights.rate_rad_s];
        flights.follow(&step, &load_nm[..1], &jolt_nm[..1]);
        // The angle is that at the sample; rates are those between two steps.
        for (lane, [delta, rate]) in out.iter_mut().enumerate() {
            delta[k] = angle_rad[lane];
            rate[k] = 0.5 * (before_rad_s[lane] + flights.rate_rad_s[lane]);
        }
        flights.follow(&step, &load_nm[1..], &jolt_nm[1..]);
    }
    out
}

/// The torque `fine_nm`, known at the instants, at every step from sample `k` to the next.
fn steps_from(fine_nm: &[f64], k: usize) -> [f64; FINE * STEPS] {
    let mut at_steps = [0.0; FINE * STEPS];
    let (between, ticks) = (at_steps.as_chunks_mut::<STEPS>().0, FINE * k..);
    for (between, tick) in between.iter_mut().zip(ticks) {
        let (from, to) = (fine_nm[tick], fine_nm[(tick + 1) % fine_nm.len()]);
        for (step, nm) in between.iter_mut().enumerate() {
            *nm = from + step as f64 / STEPS as f64 * (to - from);
        }
    }
    at_steps
}

/// Stiffness and damping of the flanks that a rotor meets at the ends of its gap.
#[derive(Clone, Copy)]
struct Flanks {
    stiffness_nm_rad: f64,
    damping_nm_s_rad: f64,
}

impl Flanks {
    /// Flanks of joint `j` on which its rotor, were it alone, would swing at [`FLANK_RAD_S`], limited to what the
    /// instants can follow.
    fn by_variant(scene: &Scene, j: usize) -> [Self; FLANK_RAD_S.len()] {
        let mobility = scene.mobility_per_kg_m2.joint(j).iter().copied().fold(0.0, f64::max);
        let rotor = scene.rotor_kg_m2[j];
        FLANK_RAD_S.map(|flank| Self::alone(rotor, flank).followed(mobility, scene.instant_s()))
    }

    fn alone(rotor_kg_m2: f64, flank_rad_s: f64) -> Self {
        Self {
            stiffness_nm_rad: rotor_kg_m2 * flank_rad_s.powi(2),
            damping_nm_s_rad: 2.0 * DAMPING_RATIO * rotor_kg_m2 * flank_rad_s,
        }
    }

    /// Limits the stiffness to what steps of `step_s` can follow, where a relative torque accelerates rotor and links
    /// apart by `mobility` per unit, and limits the damping to its critical value for that stiffness.
    fn followed(self, mobility: f64, step_s: f64) -> Self {
        let stiffness_nm_rad = self.stiffness_nm_rad.min((FOLLOWED / step_s).powi(2) / mobility);
        let critical = 2.0 * (stiffness_nm_rad / mobility).sqrt();
        Self { stiffness_nm_rad, damping_nm_s_rad: self.damping_nm_s_rad.min(critical) }
    }
}

/// A rotor between the flanks of its gear.
struct Flight {
    /// q_M − q_L, rad.
    angle_rad: f64,
    half_gap_rad: f64,
    flanks: Flanks,
}

impl Flight {
    /// A rotor at rest on the flank to which `load_nm` presses it.
    fn pressed(half_gap_rad: f64, flanks: Flanks, load_nm: f64) -> Self {
        let angle_rad = half_gap_rad.copysign(load_nm) + load_nm / flanks.stiffness_nm_rad;
        Self { angle_rad, half_gap_rad, flanks }
    }
}

/// Several rotors under one load, stored as a structure of arrays so that the processor moves several at once.
struct Flights {
    angle_rad: [f64; ABREAST],
    rate_rad_s: [f64; ABREAST],
    half_gap_rad: [f64; ABREAST],
    stiffness_nm_rad: [f64; ABREAST],
    damping_nm_s_rad: [f64; ABREAST],
}

impl Flights {
    fn abreast(flight: impl Fn(usize) -> Flight) -> Self {
        let flights: [Flight; ABREAST] = std::array::from_fn(flight);
        let each = |number: fn(&Flight) -> f64| std::array::from_fn(|lane| number(&flights[lane]));
        Self {
            angle_rad: each(|f| f.angle_rad),
            rate_rad_s: [0.0; ABREAST],
            half_gap_rad: each(|f| f.half_gap_rad),
            stiffness_nm_rad: each(|f| f.flanks.stiffness_nm_rad),
            damping_nm_s_rad: each(|f| f.flanks.damping_nm_s_rad),
        }
    }

    /// Advances by one `step` per load and jolt, Nm.
    fn follow(&mut self, step: &Step, load_nm: &[f64], jolt_nm: &[f64]) {
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
            self.rate_rad_s[lane] = (rate + relative_nm * step.rad_s_nm) * left;
            self.angle_rad[lane] += self.rate_rad_s[lane] * step.step_s;
        }
    }
}

/// One integration step of several rotors, the same from one sample to the next.
struct Step {
    step_s: f64,
    /// Change of the rate per torque, rad/s/Nm.
    rad_s_nm: f64,
    /// How much of the jolt each rotor gets.
    jolted: [f64; ABREAST],
    /// Share of its rate that damping leaves to a rotor, in its gap and against a flank.
    left_in_gap: [f64; ABREAST],
    left_in_flank: [f64; ABREAST],
}

impl Step {
    /// `held` is the damping by the drives, Nm s/rad; `made` says how much of it and of the jolt each rotor gets.
    fn of(
        flights: &Flights,
        made: &[Jolts; ABREAST],
        (mobility, held): (f64, f64),
        step_s: f64,
    ) -> Self {
        let rad_s_nm = mobility * step_s;
        let left = |damping_nm_s_rad: f64| 1.0 / (1.0 + damping_nm_s_rad * rad_s_nm);
        let in_gap = |lane: usize| made[lane].damping * held;
        let in_flank = |lane: usize| in_gap(lane) + flights.damping_nm_s_rad[lane];
        Self {
            step_s,
            rad_s_nm,
            jolted: made.map(|made| made.height),
            left_in_gap: std::array::from_fn(|lane| left(in_gap(lane))),
            left_in_flank: std::array::from_fn(|lane| left(in_flank(lane))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps without jolts and drives.
    fn undriven(flights: &Flights, mobility: f64, step_s: f64) -> Step {
        Step::of(flights, &[Jolts::USUAL; ABREAST], (mobility, 0.0), step_s)
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
}
