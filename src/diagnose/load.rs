//! Torque on links and rotors along a log, as far as the log determines it, harmonic by harmonic.
//!
//! The noise of the acceleration is in the residual of the null model as well as in the columns that a family derives
//! from the load. Where a column differentiates the load, the two would be correlated for no physical reason. If the
//! motion repeats, the slow harmonics of the load are known well and used as they are ([`Harmonics`]). Each fast
//! harmonic is small and drowns in noise, yet these harmonics make gears swing. They are not accidental: a drive that
//! does not answer dry friction at once jolts its joint, in the same way at every reversal. This common course is known
//! ([`jolts`]), and the torque shows it better than the motion.

use fourier::Complex64;
use nalgebra::{Cholesky, DMatrix, DVector};

use super::reversal_answer::{FASTEST_HZ, ReversalAnswer, TorqueHarmonic};
use crate::dynamics::{
    LANES, Lanes, Model, Motion, Real, Workspace, rigid_torque, with_widest_registers,
};
use crate::robot::{Arm, JointSignals};
use crate::signal::{FineClock, mean_period};

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
            (0..y.joints()).map(|j| Harmonics::of(clock, y.joint(j))).collect()
        };
        let part = |of: &[Harmonics], y: &JointSignals, level: f64| {
            y.map_joints(|j, y| of[j].part(clock, y, level))
        };
        let (links, rotors) = (rigid_torque_along(model, each), rotors_along(arm, each));
        let loads = sum(&links, &rotors);
        let (of_loads, of_links) = (harmonics(&loads), harmonics(&links));
        let slow = |of: &[Harmonics]| -> Vec<Harmonics> {
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
        let answers = |of_loads: &[Harmonics], level: f64| -> Vec<ReversalAnswer> {
            let of_joint = |j: usize| {
                let torque = of_torques[j].beyond(&of_loads[j], level, fastest(periods));
                let sign = fine_sign[j].clone();
                ReversalAnswer::new((clock, rate_hz), sign, coulomb_nm(j), torque)
            };
            (0..mean.joints()).map(of_joint).collect()
        };
        let given = |answers: &[ReversalAnswer]| -> Vec<Vec<f64>> {
            answers.iter().map(|answer| answer.given_nm(clock, 0.0)).collect()
        };
        let well_beyond_nm = given(&answers(&of_loads, WELL_KNOWN));
        let slow_beyond_nm = given(&answers(&of_slow_loads, WELL_KNOWN));
        let answers = answers(&of_loads, KNOWN);
        let beyond_nm = given(&answers);
        let jolts = |of_links: &[Harmonics], delivered_nm: &[Vec<f64>], level: f64| {
            mean.qd_rad_s.map_joints(|j, _| {
                let beside: Vec<f64> =
                    delivered_nm[j].iter().zip(dry(j)).map(|(given, dry)| given - dry).collect();
                jolts(periods, &of_links[j], level, &beside)
            })
        };
        let jolts_nm = [
            &jolts(&of_links, &well_beyond_nm, WELL_KNOWN),
            &jolts(&of_links, &beyond_nm, KNOWN),
            &jolts(&of_slow_links, &slow_beyond_nm, WELL_KNOWN),
        ];
        let (of_jolts, mobility_per_kg_m2) = apart(mass_kg_m2, rotor_kg_m2, jolts_nm);
        let [well_beyond, beyond, slow_beyond] = of_jolts;
        let rest = |of_links: &[Harmonics], y: JointSignals, level: f64| {
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
        let known =
            of_loads.iter().map(|of| (0..=highest).map(|h| of.holds(h, KNOWN)).collect()).collect();
        let load_nm = part(&of_loads, &mean_of(&loads), KNOWN);
        let delivered = Some(Delivered { load_nm, known, beyond_nm, answers });
        let rotor_nm = part(&harmonics(&rotors), &rotors_along(arm, mean), WELL_KNOWN);
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

/// A band of harmonics whose power is more than this many times its noise is used as it is.
const WELL_KNOWN: f64 = 100.0;
/// The same for [`Loads::bending`].
const KNOWN: f64 = 10.0;
/// Fastest harmonics of [`Loads::rigid`], Hz.
///
/// While a rotor flies through its gap g, its motor moves otherwise than behind a rigid gear, by as much as adds
/// (M_jj − 1/mobility) δ̈ to the torque that the links seem to need. In the harmonic ω this is up to (M_jj − 1/mobility)
/// ω² g: 0.08 Nm for 0.3 kg m² and 0.15 mrad at 7 Hz. What an arm is told to do is slower, and what its drives do where
/// friction reverses is in the jolts. Play of joint 3 that was named in one log removed 38 % of its squares along another
/// motion, recorded without noise, as long as all harmonics counted, and 82 % with these.
const RIGID_HZ: f64 = 7.0;
/// Number of harmonics that are judged together.
const BAND: usize = 8;

/// The part of `y` whose power is more than ten times that of differentiated white noise, selected band by band.
/// `noise` is the power density of the white noise, per Hz.
///
/// `y` is followed by its own mirror image, which avoids a jump between its ends.
fn beside_differentiated_noise(y: &[f64], noise: f64, rate_hz: f64) -> Vec<f64> {
    let there_and_back: Vec<f64> = y.iter().chain(y.iter().rev()).copied().collect();
    let n = there_and_back.len();
    let clock = FineClock::new(n, 1);
    let spectrum = clock.spectrum(&there_and_back);
    let omega = std::f64::consts::TAU * rate_hz / n as f64;
    // The noise is mirrored as well: each coefficient has the mean square σ²/n, with σ² = density · f_s/2.
    let of_noise = |h: usize| (h as f64 * omega).powi(2) * noise * 0.5 * rate_hz / n as f64;
    let holds: Vec<bool> = spectrum
        .chunks(BAND)
        .zip((0..).step_by(BAND))
        .map(|(band, first)| {
            let power: f64 = band.iter().map(Complex64::norm_sqr).sum();
            let noise: f64 = (first..first + band.len()).map(of_noise).sum();
            power > (1.0 + KNOWN) * noise
        })
        .collect();
    let gain = |h: usize| if holds[h / BAND] { Complex64::ONE } else { Complex64::ZERO };
    let mut known = clock.filtered(&there_and_back, gain);
    known.truncate(y.len());
    known
}

/// The harmonics of a torque and how well they are known.
struct Harmonics {
    /// Ratio of power, without its noise, to noise, by band.
    known: Vec<f64>,
    /// Coefficients of the mean period.
    mean: Vec<Complex64>,
    /// Mean square of the noise in each coefficient.
    noise: Vec<f64>,
}

impl Harmonics {
    /// The harmonics of `periods`, which follow one after another.
    fn of(clock: &FineClock, periods: &[f64]) -> Self {
        let spectra: Vec<Vec<Complex64>> =
            periods.chunks_exact(clock.samples()).map(|y| clock.spectrum(y)).collect();
        let count = spectra.len() as f64;
        let harmonics = clock.samples() / 2 + 1;
        let mean: Vec<Complex64> = (0..harmonics)
            .map(|h| spectra.iter().map(|s| s[h]).sum::<Complex64>() / count)
            .collect();
        let (mut known, mut noise) = (Vec::new(), Vec::with_capacity(harmonics));
        for first in (0..harmonics).step_by(BAND) {
            let band = first..(first + BAND).min(harmonics);
            let (mut power, mut scatter) = (0.0, 0.0);
            for h in band.clone() {
                power += mean[h].norm_sqr();
                scatter += spectra.iter().map(|s| (s[h] - mean[h]).norm_sqr()).sum::<f64>();
            }
            let of_mean = scatter / (count * (count - 1.0));
            known.push(if power > 0.0 { power / of_mean - 1.0 } else { 0.0 });
            noise.resize(band.end, of_mean / band.len() as f64);
        }
        // Without noise all harmonics are known equally well, to within their rounding.
        let rounding = f64::EPSILON * mean.iter().map(Complex64::norm_sqr).fold(0.0, f64::max);
        noise.iter_mut().for_each(|noise| *noise = noise.max(rounding));
        Self { known, mean, noise }
    }

    /// The same with nothing known in bands beyond that of the harmonic `last`.
    fn up_to(&self, last: usize) -> Self {
        let bands = last / BAND + 1;
        let known = |(band, known): (usize, &f64)| if band < bands { *known } else { 0.0 };
        let known = self.known.iter().enumerate().map(known).collect();
        Self { known, mean: self.mean.clone(), noise: self.noise.clone() }
    }

    /// Whether the power of harmonic `h`, judged with its band, is more than `level` times its noise.
    fn holds(&self, h: usize, level: f64) -> bool {
        self.known[h / BAND] > level
    }

    /// The harmonics up to `last` in which `load` is not known to `level`.
    fn beyond(&self, load: &Self, level: f64, last: usize) -> Vec<TorqueHarmonic> {
        let harmonic =
            |h: usize| TorqueHarmonic { number: h, mean: self.mean[h], noise: self.noise[h] };
        let is_beyond = |h: &TorqueHarmonic| !load.holds(h.number, level) && h.noise > 0.0;
        (1..=last).map(harmonic).filter(is_beyond).collect()
    }

    /// `y` with only the harmonics that are known to `level`.
    fn part(&self, clock: &FineClock, y: &[f64], level: f64) -> Vec<f64> {
        let gain = |h: usize| if self.holds(h, level) { Complex64::ONE } else { Complex64::ZERO };
        clock.filtered(y, gain)
    }

    /// `y` without the harmonics known to `level`, up to the harmonic `highest`.
    fn rest(&self, clock: &FineClock, y: &[f64], level: f64, highest: usize) -> Vec<f64> {
        let is_rest = |h: usize| h <= highest && !self.holds(h, level);
        clock.filtered(y, |h| if is_rest(h) { Complex64::ONE } else { Complex64::ZERO })
    }
}

/// The last harmonic in which the drives' answers are fitted.
fn fastest(periods: &Periods) -> usize {
    let Periods { clock, rate_hz, highest, .. } = *periods;
    highest.min((FASTEST_HZ * clock.samples() as f64 / rate_hz) as usize)
}

/// The part of a drive's torque beyond friction in the harmonics in which the torque of its links is not known to
/// `level`, at the samples, Nm. `beside_friction_nm` is the torque at every tick.
fn jolts(periods: &Periods, links: &Harmonics, level: f64, beside_friction_nm: &[f64]) -> Vec<f64> {
    let last = fastest(periods);
    let every_tick = FineClock::new(beside_friction_nm.len(), 1);
    let fast = every_tick.filtered(beside_friction_nm, |h| {
        if h <= last && !links.holds(h, level) { Complex64::ONE } else { Complex64::ZERO }
    });
    fast.into_iter().step_by(periods.clock.ticks()).collect()
}

/// Torque on the gear of every sample, Nm: M q̈ + c + g of links and rotors, without friction.
pub fn load_along(model: &Model, arm: &Arm, motion: &Motion) -> JointSignals {
    sum(&rigid_torque_along(model, motion), &rotors_along(arm, motion))
}

/// M_links q̈ + c + g at every sample, eight samples at a time with the widest registers of the machine.
pub fn rigid_torque_along(model: &Model, motion: &Motion) -> JointSignals {
    let mut out = JointSignals::zeros(motion.joints(), motion.samples());
    with_widest_registers(
        #[inline(always)]
        || fill_rigid_torque(model, motion, &mut out),
    );
    out
}

#[inline(always)]
fn fill_rigid_torque(model: &Model, motion: &Motion, out: &mut JointSignals) {
    let (joints, n) = (motion.joints(), motion.samples());
    let mut workspace = Workspace::<Lanes>::new(model);
    let zero = <Lanes as Real>::constant(0.0);
    let (mut q, mut qd, mut qdd) = (vec![zero; joints], vec![zero; joints], vec![zero; joints]);
    let mut torque = vec![zero; joints];
    for start in (0..n).step_by(LANES) {
        let count = LANES.min(n - start);
        for j in 0..joints {
            for lane in 0..count {
                q[j].0[lane] = motion.q_rad.joint(j)[start + lane];
                qd[j].0[lane] = motion.qd_rad_s.joint(j)[start + lane];
                qdd[j].0[lane] = motion.qdd_rad_s2.joint(j)[start + lane];
            }
        }
        rigid_torque(model, &mut workspace, &q, &qd, &qdd, &mut torque);
        for (j, torque) in torque.iter().enumerate() {
            out.joint_mut(j)[start..start + count].copy_from_slice(&torque.0[..count]);
        }
    }
}

/// M at every sample, kg m², column by column: the additional torque on all joints, over `recorded_nm`, when one joint
/// accelerates by one rad/s² more.
pub fn mass_along(model: &Model, motion: &Motion, recorded_nm: &JointSignals) -> Vec<JointSignals> {
    (0..motion.joints())
        .map(|j| {
            let mut faster = motion.clone();
            faster.qdd_rad_s2.joint_mut(j).iter_mut().for_each(|qdd| *qdd += 1.0);
            let torque = rigid_torque_along(model, &faster);
            torque
                .map_joints(|i, t| t.iter().zip(recorded_nm.joint(i)).map(|(t, r)| t - r).collect())
        })
        .collect()
}

/// Least inertia of a rotor, as a share of the mean inertia of its links. A gear that gives way has two sides, and
/// models without rotors count the inertia of the rotors with that of the links.
const LIGHTEST_ROTOR: f64 = 0.02;

/// I_a of every joint, kg m², at least the share `LIGHTEST_ROTOR` of the mean inertia of the links; `mass_kg_m2` comes
/// from [`mass_along`].
pub fn rotors_kg_m2(arm: &Arm, mass_kg_m2: &[JointSignals]) -> Vec<f64> {
    let rotor = |(j, mass): (usize, &JointSignals)| {
        let own = mass.joint(j);
        let lightest = LIGHTEST_ROTOR * own.iter().sum::<f64>() / own.len() as f64;
        arm.joints[j].drive.rotor_inertia_kg_m2.max(lightest).max(f64::MIN_POSITIVE)
    };
    mass_kg_m2.iter().enumerate().map(rotor).collect()
}

/// I_a q̈ at every sample, Nm.
fn rotors_along(arm: &Arm, motion: &Motion) -> JointSignals {
    motion.qdd_rad_s2.map_joints(|j, qdd| {
        let inertia = arm.joints[j].drive.rotor_inertia_kg_m2;
        qdd.iter().map(|qdd| inertia * qdd).collect()
    })
}

fn sum(a: &JointSignals, b: &JointSignals) -> JointSignals {
    a.map_joints(|j, a| a.iter().zip(b.joint(j)).map(|(a, b)| a + b).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

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

    /// A slow swing plus differentiated white noise: the swing is what remains. Its band is 0.1 Hz wide, a little wider
    /// because of the kink at the ends, and the noise in this band is a ten thousandth of the swing.
    #[test]
    fn what_is_known_beside_differentiated_noise() {
        const NOISE: f64 = 1e-3;
        let swing = |k: usize| 20.0 * (0.8 * std::f64::consts::TAU * k as f64 / RATE_HZ).cos();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let velocity: Vec<f64> = (0..4000).map(|_| StandardNormal.sample(&mut rng)).collect();
        let noise = |k: usize| NOISE * 0.5 * RATE_HZ * (velocity[k + 1] - velocity[k - 1]);
        let y: Vec<f64> = (1..3999).map(|k| swing(k) + noise(k)).collect();
        let density = 2.0 * NOISE.powi(2) / RATE_HZ;
        let known = beside_differentiated_noise(&y, density, RATE_HZ);
        let rms =
            |y: &mut dyn Iterator<Item = f64>| (y.map(|y| y * y).sum::<f64>() / 3998.0).sqrt();
        let before = rms(&mut y.iter().zip(1..).map(|(y, k)| y - swing(k)));
        let after = rms(&mut known.iter().zip(1..).map(|(y, k)| y - swing(k)));
        assert!(after < 0.01 * 20.0 && after < 0.5 * before, "{before} {after}");
        // Next to nothing remains of noise alone: the slowest harmonics, where differentiated noise is weaker than the
        // jump at the ends. Without noise everything remains.
        let alone: Vec<f64> = (1..3999).map(noise).collect();
        let left = beside_differentiated_noise(&alone, density, RATE_HZ);
        assert!(rms(&mut left.into_iter()) < 0.01 * rms(&mut alone.into_iter()));
        let all = beside_differentiated_noise(&y, 0.0, RATE_HZ);
        assert!(rms(&mut all.iter().zip(&y).map(|(a, b)| a - b)) < 1e-12);
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
        let of_load = Harmonics::of(&clock, &load);
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
