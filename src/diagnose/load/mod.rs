//! Torque on links and rotors along a log, as far as the log determines it, harmonic by harmonic.
//!
//! The noise of the acceleration is in the residual of the null model as well as in the columns that a family derives
//! from the load. Where a column differentiates the load, the two would be correlated for no physical reason. If the
//! motion repeats, the slow harmonics of the load are known well and used as they are ([`Harmonics`]). Each fast
//! harmonic is small and drowns in noise, yet these harmonics make gears swing. They are not accidental: a drive that
//! does not answer dry friction at once jolts its joint, in the same way at every reversal. This common course is known
//! ([`jolts`]), and the torque shows it better than the motion.
//!
//! Enters: the motion of a log, the arm, and the periods if the motion repeats. Leaves: [`Loads`].

mod harmonics;
mod rigid;

pub use rigid::{load_along, mass_along, rigid_torque_along, rotors_kg_m2};

use fourier::Complex64;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::reversal_answer::{FASTEST_HZ, ReversalAnswer};
use crate::dynamics::{Model, Motion};
use crate::robot::{Arm, JointSignals};
use crate::signal::{FineClock, mean_period};
use harmonics::{Harmonics, KNOWN, Known, WELL_KNOWN, beside_differentiated_noise};
use rigid::rotors_along;

/// Torques of a rigid arm along the motion of a log, as far as the log determines them.
pub struct Loads {
    /// Torque that moves the links, in the harmonics whose power is more than a hundred times their noise.
    pub link: LinkTorque,
    /// The same, in the harmonics whose power is more than ten times their noise. A gear that gives way is excited by
    /// its motor up to frequencies at which little of the motor's motion is left, and it makes no difference to the
    /// gear whether the motor is driven or swings back.
    pub bending: LinkTorque,
    /// The torque that would move the links if no gear had play: `link` in harmonics too slow to hold a rotor's flight
    /// through its gap ([`RIGID_HZ`]).
    pub rigid: LinkTorque,
    /// Torque that the drives deliver for the load and for dry friction, if the motion repeats.
    pub delivered: Option<Delivered>,
    /// Torque on the gears, which moves links and rotors, in the harmonics whose power is more than a hundred times
    /// their noise, Nm.
    pub load_nm: JointSignals,
    /// Relative acceleration of links and rotor of a joint per torque that presses them apart, 1/(kg m²), while the
    /// other joints are free to move: I_a⁻¹ + [(M + I_a')⁻¹]_jj, where I_a' lacks the rotor of the joint itself.
    pub mobility_per_kg_m2: JointSignals,
}

/// Torque that the drives deliver, in two sets of harmonics: those in which the load is known, and the others.
pub struct Delivered {
    /// Load (links and rotors) in the harmonics whose power is more than ten times their noise, Nm.
    pub load_nm: JointSignals,
    /// Whether a harmonic is one of these, by joint and harmonic.
    pub known: Vec<Vec<bool>>,
    /// Torque of the drives in the other harmonics, as reversals show it, at every tick, Nm. It is load and dry
    /// friction together, of which a drive may feed any share forward.
    pub beyond_nm: Vec<Vec<f64>>,
    /// The fitted answers to reversals from which `beyond_nm` is computed, by joint.
    pub answers: Vec<ReversalAnswer>,
}

/// Torque that moves the links of every joint, in two parts.
pub struct LinkTorque {
    /// The part that the motion determines, Nm.
    pub told_nm: JointSignals,
    /// The links' share of the drives' torque in harmonics too fast for the motion to determine, as shown by the
    /// reversals of the joints, Nm.
    pub jolt_nm: JointSignals,
}

/// A motion that repeats, with its periods one after another.
pub struct Periods<'a> {
    /// Angles, velocities and accelerations of every period.
    pub each: &'a Motion,
    /// Recorded torque, Nm.
    pub torque_nm: &'a JointSignals,
    /// The clock between the samples of one period.
    pub clock: &'a FineClock,
    /// Samples per second.
    pub rate_hz: f64,
    /// The highest harmonic up to which the accelerations are known.
    pub highest: usize,
}

impl Loads {
    /// Loads along a single run as it was recorded at `rate_hz`, where the links need `link_nm`. `mass_kg_m2` comes
    /// from [`mass_along`], `rotor_kg_m2` from [`rotors_kg_m2`]. The noise of the velocities has the power density
    /// `velocity_noise`, (rad/s)²/Hz.
    ///
    /// Without repetitions harmonics cannot be compared between periods: `link` and `load_nm` are used whole. The
    /// torque that bends gears is used where its power is ten times that of the velocity's noise, differentiated and
    /// multiplied by the inertia of the links. (A factor of a hundred leaves out what gears of 20 000 Nm/rad need, and
    /// the remainder of their effect had no name.)
    pub fn as_recorded(
        arm: &Arm,
        motion: &Motion,
        (link_nm, mass_kg_m2, rotor_kg_m2): (&JointSignals, &[JointSignals], &[f64]),
        (velocity_noise, rate_hz): (&[f64], f64),
    ) -> Self {
        let still = || link_nm.map_joints(|_, y| vec![0.0; y.len()]);
        let ([], mobility_per_kg_m2) = apart(mass_kg_m2, rotor_kg_m2, []);
        let load_nm = sum(link_nm, &rotors_along(arm, motion));
        let link = LinkTorque { told_nm: link_nm.clone(), jolt_nm: still() };
        let known = link_nm.map_joints(|j, y| {
            let through = |(mass, noise): (&JointSignals, &f64)| {
                let square: f64 = mass.joint(j).iter().map(|m| m * m).sum();
                square / y.len() as f64 * noise
            };
            let noise = mass_kg_m2.iter().zip(velocity_noise).map(through).sum();
            beside_differentiated_noise(y, noise, rate_hz)
        });
        let bending = LinkTorque { told_nm: known, jolt_nm: still() };
        let rigid = LinkTorque { told_nm: link_nm.clone(), jolt_nm: still() };
        Self { link, bending, rigid, delivered: None, load_nm, mobility_per_kg_m2 }
    }

    /// Loads along the mean of `periods`, as far as the periods agree. `link_nm` belongs to the motion of the
    /// regressor, whose accelerations end at the harmonic from which on their noise costs more than they tell. The
    /// torques that make gears swing use the accelerations of the periods themselves, with all their harmonics.
    pub fn agreed(
        (model, arm): (&Model, &Arm),
        mean: &Motion,
        (link_nm, mass_kg_m2, rotor_kg_m2): (&JointSignals, &[JointSignals], &[f64]),
        periods: &Periods,
    ) -> Self {
        let Periods { each, torque_nm, clock, rate_hz, highest } = *periods;
        let harmonics = |y: &JointSignals| -> Vec<Harmonics> {
            (0..y.joints()).into_par_iter().map(|j| Harmonics::of(clock, y.joint(j))).collect()
        };
        let known = |y: &JointSignals| -> Vec<Known> {
            harmonics(y).into_iter().map(|of| of.known).collect()
        };
        let part = |of: &[Known], y: &JointSignals, level: f64| {
            y.map_joints(|j, y| of[j].part(clock, y, level))
        };
        let (links, rotors) = (rigid_torque_along(model, each), rotors_along(arm, each));
        let loads = sum(&links, &rotors);
        let (of_loads, of_links) = (known(&loads), known(&links));
        let slow = |of: &[Known]| -> Vec<Known> {
            let last = (RIGID_HZ * clock.samples() as f64 / rate_hz) as usize;
            of.iter().map(|of| of.up_to(last)).collect()
        };
        let (of_slow_loads, of_slow_links) = (slow(&of_loads), slow(&of_links));
        let of_torques = harmonics(torque_nm);
        let fine_sign: Vec<Vec<f64>> = (0..mean.joints())
            .map(|j| {
                let sign = |qd: f64| arm.friction_sign(qd);
                clock.refined(mean.qd_rad_s.joint(j)).into_iter().map(sign).collect()
            })
            .collect();
        let coulomb_nm = |j: usize| arm.joints[j].drive.coulomb_nm;
        let dry = |j: usize| fine_sign[j].iter().map(move |s| coulomb_nm(j) * s);
        // Fitted to the harmonics in which the load is not known to `level`.
        let answers = |of_loads: &[Known], level: f64| -> Vec<ReversalAnswer> {
            let of_joint = |j: usize| {
                let torque = of_torques[j].beyond(&of_loads[j], level, fastest(periods));
                let sign = fine_sign[j].clone();
                ReversalAnswer::new((clock, rate_hz), sign, coulomb_nm(j), torque)
            };
            (0..mean.joints()).into_par_iter().map(of_joint).collect()
        };
        let given = |answers: &[ReversalAnswer]| -> Vec<Vec<f64>> {
            answers.iter().map(|answer| answer.given_nm(clock, 0.0)).collect()
        };
        let well_beyond_nm = given(&answers(&of_loads, WELL_KNOWN));
        let slow_beyond_nm = given(&answers(&of_slow_loads, WELL_KNOWN));
        let answers = answers(&of_loads, KNOWN);
        let beyond_nm = given(&answers);
        let jolts = |of_links: &[Known], delivered_nm: &[Vec<f64>], level: f64| {
            let of_joint = |j: usize| -> Vec<f64> {
                let beside: Vec<f64> =
                    delivered_nm[j].iter().zip(dry(j)).map(|(given, dry)| given - dry).collect();
                jolts(periods, &of_links[j], level, &beside)
            };
            let joints: Vec<Vec<f64>> = (0..mean.joints()).into_par_iter().map(of_joint).collect();
            JointSignals::from_fn(mean.joints(), mean.samples(), |j, k| joints[j][k])
        };
        let jolts_nm = [
            &jolts(&of_links, &well_beyond_nm, WELL_KNOWN),
            &jolts(&of_links, &beyond_nm, KNOWN),
            &jolts(&of_slow_links, &slow_beyond_nm, WELL_KNOWN),
        ];
        let (of_jolts, mobility_per_kg_m2) = apart(mass_kg_m2, rotor_kg_m2, jolts_nm);
        let [well_beyond, beyond, slow_beyond] = of_jolts;
        let rest = |of_links: &[Known], y: JointSignals, level: f64| {
            y.map_joints(|j, y| of_links[j].rest(clock, y, level, highest))
        };
        let link = LinkTorque {
            told_nm: part(&of_links, link_nm, WELL_KNOWN),
            jolt_nm: rest(&of_links, well_beyond, WELL_KNOWN),
        };
        let rigid = LinkTorque {
            told_nm: part(&of_slow_links, link_nm, WELL_KNOWN),
            jolt_nm: rest(&of_slow_links, slow_beyond, WELL_KNOWN),
        };
        let mean_of = |y: &JointSignals| y.map_joints(|_, y| mean_period(y, clock.samples()));
        let bending = LinkTorque {
            told_nm: part(&of_links, &mean_of(&links), KNOWN),
            jolt_nm: rest(&of_links, beyond, KNOWN),
        };
        let is_known =
            of_loads.iter().map(|of| (0..=highest).map(|h| of.holds(h, KNOWN)).collect()).collect();
        let load_nm = part(&of_loads, &mean_of(&loads), KNOWN);
        let delivered = Some(Delivered { load_nm, known: is_known, beyond_nm, answers });
        let rotor_nm = part(&known(&rotors), &rotors_along(arm, mean), WELL_KNOWN);
        let load_nm = sum(&link.told_nm, &rotor_nm);
        Self { load_nm, link, bending, rigid, delivered, mobility_per_kg_m2 }
    }
}

/// The lighter of links and rotor counts as at least this share of both.
const LEAST_SHARE: f64 = 1e-6;

/// The links' share M (M + I_a)⁻¹ τ of each of the torques τ on the gears, and [`Loads::mobility_per_kg_m2`].
fn apart<const N: usize>(
    mass_kg_m2: &[JointSignals],
    rotor_kg_m2: &[f64],
    torques_nm: [&JointSignals; N],
) -> ([JointSignals; N], JointSignals) {
    let joints = mass_kg_m2.len();
    let samples = mass_kg_m2.first().map_or(0, JointSignals::samples);
    let rotor = |j: usize| rotor_kg_m2[j];
    let mut links_nm = torques_nm.map(Clone::clone);
    let mut mobility = JointSignals::zeros(joints, samples);
    for k in 0..samples {
        let total = DMatrix::from_fn(joints, joints, |i, j| {
            mass_kg_m2[j].joint(i)[k] + if i == j { rotor(j) } else { 0.0 }
        });
        // The estimated mass matrix may be one that no arm has, that is not positive definite.
        let inverse = Cholesky::new(total).map(|total| total.inverse());
        for (links_nm, torque_nm) in links_nm.iter_mut().zip(torques_nm) {
            let Some(inverse) = &inverse else { continue };
            let tau = DVector::from_fn(joints, |j, _| torque_nm.joint(j)[k]);
            for j in 0..joints {
                links_nm.joint_mut(j)[k] -= rotor(j) * (inverse.row(j) * &tau)[0];
            }
        }
        for j in 0..joints {
            let own = inverse.as_ref().map_or(0.0, |inverse| inverse[(j, j)]);
            // Sherman and Morrison 1950. The links' share of the inertia lies between 0 and 1 in any real arm.
            let of_links = (1.0 - rotor(j) * own).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
            mobility.joint_mut(j)[k] = 1.0 / (rotor(j) * of_links);
        }
    }
    (links_nm, mobility)
}

/// Fastest harmonics of [`Loads::rigid`], Hz.
///
/// While a rotor flies through its gap g, its motor moves otherwise than behind a rigid gear, by as much as adds
/// (M_jj − 1/mobility) δ̈ to the torque that the links seem to need. In the harmonic ω this is up to (M_jj − 1/mobility)
/// ω² g: 0.08 Nm for 0.3 kg m² and 0.15 mrad at 7 Hz. What an arm is told to do is slower, and what its drives do where
/// friction reverses is in the jolts. Play of joint 3 that was named in one log removed 38 % of its squares along another
/// motion, recorded without noise, as long as all harmonics counted, and 82 % with these.
const RIGID_HZ: f64 = 7.0;

/// The last harmonic in which the drives' answers are fitted.
fn fastest(periods: &Periods) -> usize {
    let Periods { clock, rate_hz, highest, .. } = *periods;
    highest.min((FASTEST_HZ * clock.samples() as f64 / rate_hz) as usize)
}

/// The part of a drive's torque beyond friction in the harmonics in which the torque of its links is not known to
/// `level`, at the samples, Nm. `beside_friction_nm` is the torque at every tick.
fn jolts(periods: &Periods, links: &Known, level: f64, beside_friction_nm: &[f64]) -> Vec<f64> {
    let last = fastest(periods);
    let every_tick = FineClock::new(beside_friction_nm.len(), 1);
    let fast = every_tick.filtered(beside_friction_nm, |h| {
        if h <= last && !links.holds(h, level) { Complex64::ONE } else { Complex64::ZERO }
    });
    fast.into_iter().step_by(periods.clock.ticks()).collect()
}

fn sum(a: &JointSignals, b: &JointSignals) -> JointSignals {
    a.map_joints(|j, a| a.iter().zip(b.joint(j)).map(|(a, b)| a + b).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 500;
    const TICKS: usize = 16;
    const RATE_HZ: f64 = 125.0;

    fn ur5() -> (Arm, Model) {
        let arm = Arm::built_in("ur5").unwrap();
        let model = Model::new(&arm);
        (arm, model)
    }

    /// A pose in which the elbow alone accelerates, by one rad/s².
    fn one_sample() -> Motion {
        let of = |values: [f64; 6]| JointSignals::from_fn(6, 1, |j, _| values[j]);
        Motion {
            q_rad: of([0.3, -1.1, 0.9, 0.4, -0.7, 0.2]),
            qd_rad_s: of([0.0; 6]),
            qdd_rad_s2: of([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        }
    }

    /// M q̈ + I_a q̈ = τ written out: of the torque that accelerates the arm, the links and the rotors take their
    /// shares.
    #[test]
    fn links_and_rotors_share_a_torque() {
        let (arm, model) = ur5();
        let motion = one_sample();
        let at_rest =
            Motion { qdd_rad_s2: motion.qdd_rad_s2.map_joints(|_, _| vec![0.0]), ..motion.clone() };
        let gravity_nm = rigid_torque_along(&model, &at_rest);
        let mass = mass_along(&model, &at_rest, &gravity_nm);
        let less_gravity =
            |y: JointSignals| y.map_joints(|j, y| vec![y[0] - gravity_nm.joint(j)[0]]);
        let on_gears = less_gravity(load_along(&model, &arm, &motion));
        let on_links = less_gravity(rigid_torque_along(&model, &motion));
        let ([links], mobility) = apart(&mass, &rotors_kg_m2(&arm, &mass), [&on_gears]);
        for j in 0..6 {
            // Torques of some 10 Nm, through inertias whose ratio is up to 100 : 1.
            assert!((links.joint(j)[0] - on_links.joint(j)[0]).abs() < 1e-11);
            let rotor = |i: usize| arm.joints[i].drive.rotor_inertia_kg_m2;
            let free = DMatrix::from_fn(6, 6, |i, k| {
                mass[k].joint(i)[0] + if i == k && i != j { rotor(i) } else { 0.0 }
            });
            let apart = 1.0 / rotor(j) + free.try_inverse().unwrap()[(j, j)];
            // The links of the last joint are light: their share beside the rotor is 5e-4, which costs as many digits.
            assert!((mobility.joint(j)[0] / apart - 1.0).abs() < 1e-9, "{j}");
        }
    }

    /// A drive that feeds 90 % of the friction forward, 3 ms late: the jolts of its joint are found as they should be,
    /// up to the noise of six coefficients and the inability of steps of 8 ms to follow a delay of 3 ms.
    #[test]
    fn reversals_tell_the_jolts_of_a_drive() {
        let (fine, coulomb_nm, late) = (N * TICKS, 8.0, 6);
        let velocity = |k: usize| {
            let phase = std::f64::consts::TAU * k as f64 / fine as f64;
            (3.0 * phase + 0.4).sin() + 0.6 * (5.0 * phase + 1.0).cos() + 0.3 * (8.0 * phase).sin()
        };
        let sign: Vec<f64> = (0..fine).map(|k| (velocity(k) / 0.02).tanh()).collect();
        let fed = |k: usize| 0.9 * coulomb_nm * sign[(k + fine - late) % fine];
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        let torque: Vec<f64> = (0..8 * N)
            .map(|k| fed(k % N * TICKS) + 20.0 * velocity(k % N * TICKS) + noise())
            .collect();
        let load: Vec<f64> =
            (0..8 * N).map(|k| 20.0 * velocity(k % N * TICKS) + 4.0 * noise()).collect();
        let clock = FineClock::new(N, TICKS);
        let still = Motion {
            q_rad: JointSignals::zeros(1, N),
            qd_rad_s: JointSignals::zeros(1, N),
            qdd_rad_s2: JointSignals::zeros(1, N),
        };
        let periods = Periods {
            each: &still,
            torque_nm: &JointSignals::zeros(1, N),
            clock: &clock,
            rate_hz: RATE_HZ,
            highest: 200,
        };
        let of_load = Harmonics::of(&clock, &load).known;
        assert!(of_load.holds(8, WELL_KNOWN) && !of_load.holds(50, WELL_KNOWN));
        let of_torque = Harmonics::of(&clock, &torque);
        let torque = of_torque.beyond(&of_load, WELL_KNOWN, fastest(&periods));
        let answer = ReversalAnswer::new((&clock, RATE_HZ), sign.clone(), coulomb_nm, torque);
        let given = answer.given_nm(&clock, 0.0);
        let beside: Vec<f64> =
            given.iter().zip(&sign).map(|(given, s)| given - coulomb_nm * s).collect();
        let known = jolts(&periods, &of_load, WELL_KNOWN, &beside);
        let true_nm: Vec<f64> = (0..fine).map(|k| fed(k) - coulomb_nm * sign[k]).collect();
        let band = FineClock::new(fine, 1).filtered(&true_nm, |h| {
            if h <= 200 && !of_load.holds(h, WELL_KNOWN) { Complex64::ONE } else { Complex64::ZERO }
        });
        let truth: Vec<f64> = band.into_iter().step_by(TICKS).collect();
        let square = |y: &[f64]| y.iter().map(|y| y * y).sum::<f64>();
        let off: Vec<f64> = truth.iter().zip(&known).map(|(t, k)| t - k).collect();
        // Six coefficients of unit noise, relative to what they explain, and the error of the steps, which is 0.03
        // without noise.
        let share = square(&off) / square(&truth);
        assert!(share < 0.1, "{share}");
    }
}
