//! Play in the gear. While the load presses rotor and link together, they move as one, apart from the compliance of the
//! flanks. Where the load changes sign they part, and the rotor flies through the gap g to the other flank:
//!
//! ```text
//! δ̈ = (τ_L − T) (1/I_a + [(M + I_a')⁻¹]_jj) + the drives' answer,
//! T = k (δ ∓ g/2) + d δ̇ beyond ±g/2 as long as it pushes, 0 between
//! ```
//!
//! Here δ = q_M − q_L, and τ_L is the load of the rigid arm, which passes through zero ([`Scene::fine_rigid_nm`]: what the
//! logged motion needs holds the flight as well). The other joints are free to move; with them held, gaps at the elbow
//! seemed half as wide as they were. The flanks are such that the rotor alone swings against them at √(k/I_a), with the
//! damping d = 2 ζ √(k I_a). What the drives do during a flight is in `flight.rs`.
//!
//! The log has the motor's angle, so that the links have moved by δ less than it says. A flight lasts (6 g/δ⃛)^(1/3), a
//! few milliseconds. It shows by its jerk at both ends and by the swing after it. The log has δ̇ only at its samples,
//! and the acceleration is the derivative of these samples; so is what it shows of the drives' answer
//! ([`Lag::column`]).

mod flight;

use self::flight::{ABREAST, Flanks, Flight, Flights, Joint, Step};
use super::elasticity::{HELD_ERROR, Jolts, Lag, held_nm_s_rad};
use super::*;
use crate::diagnose::scene::FINE;

/// See the module.
pub struct Backlash;

/// Frequencies at which the rotor swings against its flanks, rad/s: from flanks that the log's rate can hardly tell from
/// rigid ones to those of a compliant gear.
const FLANK_RAD_S: [f64; 2] = [900.0, 130.0];
/// Number of variants: flanks of [`FLANK_RAD_S`] in geometric progression. The search takes every other one, and the
/// best of them is compared with those beside it. What the samples show of a swing depends on its phase within their
/// step: halfway between two frequencies of the search, the phase is off by one radian when the swing has decayed to
/// 1/e.
const FLANKS: usize = 27;
/// Variants from one of the search to the next.
const SEARCHED: usize = 2;
/// The range of gaps, rad, and the number of starting ones.
const GAP_RAD: [f64; 2] = [3e-6, 1e-2];
/// See [`GAP_RAD`].
const GAPS: usize = 8;
/// Number of integration steps per instant. With one, rotors land on their flanks late by a part of it.
const STEPS: usize = 4;
/// Time in which the initial state of the simulated flight is mostly forgotten, s.
const RUN_IN_S: f64 = 3.0;

impl Candidate for Backlash {
    fn kind(&self) -> Kind {
        Kind::Backlash
    }

    /// Variants whose flanks are too stiff for the integration steps are clipped to the same stiffness; only one of
    /// them is kept.
    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        let flanks = flanks(scene, joint(site));
        let is_distinct = |v: &usize| differ(&flanks, *v, *v + SEARCHED);
        let variants = (0..FLANKS).step_by(SEARCHED).filter(is_distinct);
        variants.flat_map(|variant| gaps().map(move |value| Shape { variant, value })).collect()
    }

    /// Flanks between those of the search, with the gap of `shape` and those of the search beside it.
    fn finer_shapes(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Shape> {
        let flanks = flanks(scene, joint(site));
        let near = shape.variant.saturating_sub(1)..=shape.variant + 1;
        let below = gaps().filter(|gap| *gap < shape.value).last();
        let above = gaps().find(|gap| *gap > shape.value);
        let values: Vec<f64> = [below, Some(shape.value), above].into_iter().flatten().collect();
        near.filter(|v| v % SEARCHED != 0 && differ(&flanks, *v, *v + 1))
            .flat_map(|variant| values.iter().map(move |&value| Shape { variant, value }))
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

    fn abreast(&self) -> usize {
        ABREAST
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
        let hard = |variant: usize| Shape { variant: variant.min(FLANKS - 1), ..shape };
        let jolted = Jolts::OF_OTHER_DRIVES.map(|made| (shape, made));
        let harder = shape.variant.saturating_sub(SEARCHED);
        let flanks = [shape, wide(0.85), wide(1.2), hard(harder), hard(shape.variant + SEARCHED)];
        let [usual, wider @ ..] = flanks.map(|shape| (shape, Jolts::USUAL));
        let flown = [&[usual], &jolted[..], &wider[..]].concat();
        let mut columns = flights(scene, joint(site), &flown);
        let Some(usual) = columns.next() else { return Vec::new() };
        columns.map(|other| other.minus(&usual)).collect()
    }

    fn carries_loose(&self) -> bool {
        true
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

    /// How small a gap shows depends on how the rotor flies through it. A description without its inertia, as most URDFs
    /// are, does not tell: a gap of ten times the limit that follows from no inertia was not seen.
    fn can_be(&self, scene: &Scene, site: Option<usize>, _: f64) -> bool {
        scene.has_described_rotor[joint(site)]
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

/// Starting gaps, rad.
fn gaps() -> impl Iterator<Item = f64> {
    geometric(GAP_RAD[0], GAP_RAD[1], GAPS)
}

/// The flanks of joint `j` by variant, limited to what the instants can follow.
fn flanks(scene: &Scene, j: usize) -> Vec<Flanks> {
    let mobility = scene.mobility_per_kg_m2.joint(j).iter().copied().fold(0.0, f64::max);
    let limited = |flank_rad_s: f64| {
        Flanks::alone(scene.rotor_kg_m2[j], flank_rad_s).followed(mobility, scene.instant_s())
    };
    geometric(FLANK_RAD_S[0], FLANK_RAD_S[1], FLANKS).map(limited).collect()
}

/// Whether the flanks of two variants, of which the second may not exist, are different.
fn differ(flanks: &[Flanks], variant: usize, softer: usize) -> bool {
    flanks.get(variant).is_some_and(|own| {
        flanks.get(softer).is_none_or(|softer| softer.stiffness_nm_rad < own.stiffness_nm_rad)
    })
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
    let flanks = flanks(scene, j);
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
        let joint = Joint {
            mobility_per_kg_m2: mobility[k],
            rotor_kg_m2: scene.rotor_kg_m2[j],
            held_nm_s_rad: held_nm_s_rad(scene, j, k),
        };
        let step = Step::of(&flights, &made, &joint, step_s);
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
