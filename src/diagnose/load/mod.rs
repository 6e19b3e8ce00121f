//! Torque on links and rotors along a log, as far as the log determines it, harmonic by harmonic.
//!
//! The noise of the acceleration is in the residual of the null model as well as in the columns that a family derives
//! from the load. Where a column differentiates the load, the two would be correlated for no physical reason. If the
//! motion repeats, the slow harmonics of the load are known well and used as they are ([`Known`]). Each fast harmonic
//! is small and drowns in noise, yet these harmonics make gears swing. They are not accidental: a drive that does not
//! answer dry friction at once jolts its joint, in the same way at every reversal. This common course is known
//! ([`DriveTorques`]), and the torque shows it better than the motion.
//!
//! Enters: the motion of a log, the arm, and the periods if the motion repeats. Leaves: [`Loads`].

mod drive_torques;
mod harmonics;
mod rigid;

pub use rigid::{RigidArm, load_along, rigid_torque_along};

use nalgebra::{Cholesky, DMatrix, DVector};

use super::reversal_answer::ReversalAnswer;
use crate::dynamics::{Model, Motion};
use crate::robot::{Arm, JointSignals};
use crate::signal::{FineClock, mean_period};
use drive_torques::DriveTorques;
use harmonics::{KNOWN, Known, WELL_KNOWN, beside_differentiated_noise};
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
    /// Loads of `rigid_arm` along a single run as it was recorded at `rate_hz`. The noise of the velocities has the
    /// power density `velocity_noise`, (rad/s)²/Hz.
    ///
    /// Without repetitions harmonics cannot be compared between periods: `link` and `load_nm` are used whole. The
    /// torque that bends gears is used where its power is ten times that of the velocity's noise, differentiated and
    /// multiplied by the inertia of the links. (A factor of a hundred leaves out what gears of 20 000 Nm/rad need, and
    /// the remainder of their effect had no name.)
    pub fn as_recorded(
        arm: &Arm,
        motion: &Motion,
        rigid_arm: &RigidArm,
        (velocity_noise, rate_hz): (&[f64], f64),
    ) -> Self {
        let RigidArm { link_nm, mass_kg_m2, rotor_kg_m2 } = rigid_arm;
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

    /// Loads along the mean of `periods`, as far as the periods agree. `rigid_arm` belongs to the motion of the
    /// regressor, whose accelerations end at the harmonic from which on their noise costs more than they tell. The
    /// torques that make gears swing use the accelerations of the periods themselves, with all their harmonics.
    pub fn agreed(
        (model, arm): (&Model, &Arm),
        mean: &Motion,
        rigid_arm: &RigidArm,
        periods: &Periods,
    ) -> Self {
        let Periods { each, clock, rate_hz, highest, .. } = *periods;
        let (links, rotors) = (rigid_torque_along(model, each), rotors_along(arm, each));
        let loads = sum(&links, &rotors);
        let [of_loads, of_links, of_rotors] =
            [&loads, &links, &rotors].map(|y| Known::of_joints(clock, y));
        let last = (RIGID_HZ * clock.samples() as f64 / rate_hz) as usize;
        let [of_slow_loads, of_slow_links] = [&of_loads, &of_links]
            .map(|of| of.iter().map(|of| of.up_to(last)).collect::<Vec<Known>>());
        let drives = DriveTorques::along(arm, mean, periods);
        let answers = drives.answers(&of_loads, KNOWN);
        let beyond_nm = drives.given_nm(&answers);
        let [well_beyond_nm, slow_beyond_nm] = [&of_loads, &of_slow_loads]
            .map(|of_loads| drives.given_nm(&drives.answers(of_loads, WELL_KNOWN)));
        let jolts_nm = [
            &drives.jolts_nm(&of_links, &well_beyond_nm, WELL_KNOWN),
            &drives.jolts_nm(&of_links, &beyond_nm, KNOWN),
            &drives.jolts_nm(&of_slow_links, &slow_beyond_nm, WELL_KNOWN),
        ];
        let RigidArm { link_nm, mass_kg_m2, rotor_kg_m2 } = rigid_arm;
        let (of_jolts, mobility_per_kg_m2) = apart(mass_kg_m2, rotor_kg_m2, jolts_nm);
        let [well_beyond, beyond, slow_beyond] = of_jolts;
        let part = |of: &[Known], y: &JointSignals, level: f64| {
            y.map_joints(|j, y| of[j].part(clock, y, level))
        };
        let link_torque = |of_links: &[Known], told: &JointSignals, jolts: &JointSignals, level| {
            let rest = |j: usize, y: &[f64]| of_links[j].rest(clock, y, level, highest);
            LinkTorque { told_nm: part(of_links, told, level), jolt_nm: jolts.map_joints(rest) }
        };
        let mean_of = |y: &JointSignals| y.map_joints(|_, y| mean_period(y, clock.samples()));
        let link = link_torque(&of_links, link_nm, &well_beyond, WELL_KNOWN);
        let rigid = link_torque(&of_slow_links, link_nm, &slow_beyond, WELL_KNOWN);
        let bending = link_torque(&of_links, &mean_of(&links), &beyond, KNOWN);
        let is_known =
            |of: &Known| -> Vec<bool> { (0..=highest).map(|h| of.holds(h, KNOWN)).collect() };
        let known = of_loads.iter().map(is_known).collect();
        let load_nm = part(&of_loads, &mean_of(&loads), KNOWN);
        let delivered = Some(Delivered { load_nm, known, beyond_nm, answers });
        let rotor_nm = part(&of_rotors, &rotors_along(arm, mean), WELL_KNOWN);
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

fn sum(a: &JointSignals, b: &JointSignals) -> JointSignals {
    a.map_joints(|j, a| a.iter().zip(b.joint(j)).map(|(a, b)| a + b).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let still = RigidArm::along(&model, &arm, &at_rest);
        let (gravity_nm, mass) = (still.link_nm, still.mass_kg_m2);
        let less_gravity =
            |y: JointSignals| y.map_joints(|j, y| vec![y[0] - gravity_nm.joint(j)[0]]);
        let on_gears = less_gravity(load_along(&model, &arm, &motion));
        let on_links = less_gravity(rigid_torque_along(&model, &motion));
        let ([links], mobility) = apart(&mass, &still.rotor_kg_m2, [&on_gears]);
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
}
