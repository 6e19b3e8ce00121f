//! The motion between the samples of a log, at [`FINE`] instants per sample: angles, velocities and torques there, and
//! how the samples show a friction that acts between them.

use std::borrow::Cow;
use std::sync::OnceLock;

use super::{Scene, Turn};
use crate::diagnose::drives::SHARE;
use crate::diagnose::load::LinkTorque;
use crate::diagnose::reversals::{Bends, Turning};
use crate::dynamics::of_pairs;
use crate::identify::{drive_answers, feedback_per_tick};
use crate::signal::first_order_lag;

/// Number of instants per sample of [`Scene::fine_link_nm`] and [`Scene::instants`].
pub const FINE: usize = 16;

/// Largest βδ of [`drive_answers`], s. In logs of clean arms, whose drives feed any share of the friction forward and
/// have feedback of 25 to 100 rad/s, up to 0.9 ms were measured on joints 1 to 3 and 5, and 1.3 ms on joint 4 and 1.6
/// ms on joint 6, where it is noise. At 4 ms, friction builds up over an angle, or a channel is recorded late.
pub const LONGEST_LEAD_S: f64 = 0.002;

/// Change of a joint's velocity within one sample by all of its dry friction, in widths of the law, up to which the motion
/// between samples is followed. Beyond it, the part that is followed falls with the inverse of the change. The joints of a
/// UR5 change by up to 2.4 widths.
///
/// A joint that changes by far more (one without a rotor: 8 to 30 widths) moves as its drive lets it. What the drive gives
/// between two samples is hardly known, and a wrong guess moves such a joint by widths, where the series of its samples is
/// right: with all of it followed, friction of a Stribeck curve was told as concave viscous friction.
const MOST_TURNED: f64 = 5.0;

/// The motion of one joint at the instants at which friction is evaluated.
pub struct Instants {
    /// Time between two instants, s.
    pub step_s: f64,
    /// Angles, rad; in a periodic motion, interpolated from the angles and velocities of the samples.
    pub q_rad: Vec<f64>,
    /// Velocities, rad/s; in a periodic motion, as the model's friction bends them, which is not exactly the rate of
    /// the angles.
    pub qd_rad_s: Vec<f64>,
    /// tanh(q̇/ε), or tanh(q̇/w) where another width w is known.
    pub sign: Vec<f64>,
}

/// What has been computed between the samples of a scene: each quantity when it is first asked for.
pub(super) struct BetweenSamples {
    /// See [`Scene::fine_link_nm`].
    fine_link_nm: Vec<OnceLock<Vec<f64>>>,
    /// See [`Scene::fine_jolt_nm`].
    fine_jolt_nm: Vec<OnceLock<Vec<f64>>>,
    /// See [`Scene::fine_bending_nm`].
    fine_bending_nm: Vec<OnceLock<[Vec<f64>; 2]>>,
    /// See [`Scene::fine_rigid_nm`].
    fine_rigid_nm: Vec<OnceLock<[Vec<f64>; 2]>>,
    /// See [`Scene::instants`].
    instants: Vec<OnceLock<Instants>>,
    /// See [`Scene::turned`].
    turned: Vec<OnceLock<Instants>>,
    /// See [`Scene::sign_if_fed`].
    signs_if_fed: Vec<[OnceLock<Vec<f64>>; 2]>,
    /// Correction of the Fourier series of the samples for bends between them.
    bends: OnceLock<Bends>,
    /// See [`Scene::turning`].
    turnings: Vec<OnceLock<Turning>>,
    /// See [`Scene::answers`].
    answers: Vec<OnceLock<Vec<Vec<f64>>>>,
}

impl BetweenSamples {
    /// Nothing yet of an arm with so many `joints`.
    pub(super) fn of(joints: usize) -> Self {
        Self {
            fine_link_nm: cells(joints),
            fine_jolt_nm: cells(joints),
            fine_bending_nm: cells(joints),
            fine_rigid_nm: cells(joints),
            instants: cells(joints),
            turned: cells(joints),
            signs_if_fed: (0..joints).map(|_| Default::default()).collect(),
            bends: OnceLock::new(),
            turnings: cells(joints),
            answers: cells(joints),
        }
    }

    /// Forgets how joint `j` turns round: another law of its friction is known.
    pub(super) fn forget_turned(&mut self, j: usize) {
        self.turned[j] = OnceLock::new();
    }
}

/// An empty cell for each of the `joints`.
fn cells<T>(joints: usize) -> Vec<OnceLock<T>> {
    (0..joints).map(|_| OnceLock::new()).collect()
}

impl Scene {
    /// Time between two of the `FINE` instants per sample, s.
    pub fn instant_s(&self) -> f64 {
        1.0 / (self.rate_hz * FINE as f64)
    }

    /// Link torque of joint `j`, Nm, at `FINE` instants per sample, for effects between samples.
    pub fn fine_link_nm(&self, j: usize) -> &[f64] {
        self.between.fine_link_nm[j].get_or_init(|| self.fine(self.link_nm.joint(j)))
    }

    /// Torque that the links of joint `j` take where joints reverse, at `FINE` instants per sample, Nm.
    pub fn fine_jolt_nm(&self, j: usize) -> &[f64] {
        self.between.fine_jolt_nm[j].get_or_init(|| self.fine(self.jolt_nm.joint(j)))
    }

    /// Torques that make a compliant gear at joint `j` swing, at `FINE` instants per sample, Nm: the torque of its
    /// links that the motion determines, and what the links take in addition where joints reverse.
    pub fn fine_bending_nm(&self, j: usize) -> [&[f64]; 2] {
        self.fine_parts_nm(&self.between.fine_bending_nm[j], &self.bending, j)
    }

    /// Torques that part the flanks of a gear with play at joint `j`, at `FINE` instants per sample, Nm: what moves its
    /// links as long as no gear has play, and what they take in addition where joints reverse.
    pub fn fine_rigid_nm(&self, j: usize) -> [&[f64]; 2] {
        self.fine_parts_nm(&self.between.fine_rigid_nm[j], &self.rigid, j)
    }

    /// Both parts of the torque `of` at `FINE` instants per sample, kept in `cell`.
    fn fine_parts_nm<'s>(
        &self,
        cell: &'s OnceLock<[Vec<f64>; 2]>,
        of: &LinkTorque,
        j: usize,
    ) -> [&'s [f64]; 2] {
        let fine = || [&of.told_nm, &of.jolt_nm].map(|y| self.fine(y.joint(j)));
        cell.get_or_init(fine).each_ref().map(Vec::as_slice)
    }

    /// Instants at which the friction of joint `j` is evaluated: `FINE` per sample of a periodic motion; the samples
    /// themselves in a single run, whose low-pass lies far below the sampling rate.
    pub fn instants(&self, j: usize) -> &Instants {
        let epsilon = self.arm.friction_epsilon_rad_s;
        self.between.instants[j].get_or_init(|| self.instants_with(j, None, epsilon))
    }

    /// The same where the friction of joint `j` turns round as another law says.
    pub fn turned(&self, j: usize) -> &Instants {
        match self.other_friction(j).turn {
            None => self.instants(j),
            Some(Turn { width_rad_s, fed }) => {
                self.between.turned[j].get_or_init(|| self.instants_with(j, Some(fed), width_rad_s))
            }
        }
    }

    /// The instants where friction turns round over `width_rad_s`, behind a drive as in [`Self::turning_rad_s`].
    fn instants_with(&self, j: usize, fed: Option<f64>, width_rad_s: f64) -> Instants {
        let (q, qd) = (self.motion.q_rad.joint(j), self.motion.qd_rad_s.joint(j));
        let sign = |v: f64| (v / width_rad_s).tanh();
        let (step_s, q_rad, qd_rad_s) = if self.periodic {
            let qd_rad_s = self.turning_rad_s(j, fed, width_rad_s, sign);
            (self.instant_s(), self.fine_angles_rad(j), qd_rad_s)
        } else {
            (1.0 / self.rate_hz, q.to_vec(), qd.to_vec())
        };
        Instants { step_s, q_rad, sign: qd_rad_s.iter().map(|v| sign(*v)).collect(), qd_rad_s }
    }

    /// Velocity of joint `j` at its instants, rad/s, while dry friction turns round by `law` within a few `width_rad_s`
    /// and the drive delivers a part of it (see `reversals`).
    ///
    /// The drive feeds forward the share `fed` of the friction that the model expects, and its feedback supplies what
    /// is lacking along the samples. With `None`, the drive's torque is the one inferred from its answer to reversals.
    /// In a single run, the result is the recorded velocity.
    pub fn turning_rad_s(
        &self,
        j: usize,
        fed: Option<f64>,
        width_rad_s: f64,
        law: impl Fn(f64) -> f64 + Copy,
    ) -> Vec<f64> {
        if !self.periodic {
            return self.motion.qd_rad_s.joint(j).to_vec();
        }
        let joint = self.turning(j);
        // The estimated friction may be zero or negative.
        let (Some(clock), Some(told), true) =
            (&self.clock, &self.delivered, self.coulomb_nm[j] > 0.0)
        else {
            return joint.series_rad_s.clone();
        };
        let delivered: Vec<f64> = match fed {
            Some(fed) => {
                let lacking = of_pairs(
                    joint.series_rad_s.clone(),
                    &joint.expected,
                    #[inline(always)]
                    |qd, sign| law(qd) - fed * sign,
                );
                let back = self.answered(&lacking);
                joint.expected.iter().zip(back).map(|(sign, back)| fed * sign + back).collect()
            }
            None => told.beyond_nm[j].iter().map(|nm| nm / self.coulomb_nm[j]).collect(),
        };
        let bends = self.between.bends.get_or_init(|| Bends::new(clock));
        bends.between_samples(joint, &delivered, width_rad_s, law)
    }

    /// tanh(q̇/ε) of joint `j` at its instants, for a drive that feeds `fed` times its dry friction forward, 0 or 1.
    pub fn sign_if_fed(&self, j: usize, fed: usize) -> &[f64] {
        self.between.signs_if_fed[j][fed].get_or_init(|| {
            let epsilon = self.arm.friction_epsilon_rad_s;
            let sign = |v: f64| self.arm.friction_sign(v);
            let qd_rad_s = self.turning_rad_s(j, Some(fed as f64), epsilon, sign);
            qd_rad_s.into_iter().map(sign).collect()
        })
    }

    /// Change of the velocity of joint `j` within one instant by its unbalanced dry friction, as far as it is followed,
    /// rad/s.
    pub fn kick_rad_s(&self, j: usize) -> &[f64] {
        &self.turning(j).kick_rad_s
    }

    /// Quantities that determine how the velocity of joint `j` bends where its friction turns round.
    fn turning(&self, j: usize) -> &Turning {
        self.between.turnings[j].get_or_init(|| {
            let series_rad_s = self.fine(self.motion.qd_rad_s.joint(j));
            let expected = series_rad_s.iter().map(|v| self.arm.friction_sign(*v)).collect();
            let rotor = self.rotor_kg_m2[j];
            let most = MOST_TURNED * self.arm.friction_epsilon_rad_s / FINE as f64;
            let kick = |mobility: &f64| {
                let acceleration_per_nm = (1.0 - 1.0 / (rotor * mobility)) / rotor;
                let kick = acceleration_per_nm * self.coulomb_nm[j] * self.instant_s();
                std::iter::repeat_n(kick * (most / kick.abs()).min(1.0).powi(2), FINE)
            };
            let kick_rad_s = self.mobility_per_kg_m2.joint(j).iter().flat_map(kick).collect();
            Turning { series_rad_s, expected, kick_rad_s }
        })
    }

    /// `y`, given at the samples, interpolated to the instants of a joint.
    pub fn at_instants<'y>(&self, y: &'y [f64]) -> Cow<'y, [f64]> {
        if self.periodic { self.fine(y).into() } else { y.into() }
    }

    /// [`Self::link_nm`] of joint `j` at its instants.
    pub fn link_at_instants(&self, j: usize) -> &[f64] {
        if self.periodic { self.fine_link_nm(j) } else { self.link_nm.joint(j) }
    }

    /// Angles of joint `j` at `FINE` instants per sample, interpolated from the mean angles and velocities of the
    /// samples in a periodic motion.
    ///
    /// A bend between two samples shows in the difference of their velocities, but in no Fourier series that ends below
    /// half the rate. The mean velocity of a periodic motion is the offset of its sensor, and is subtracted.
    fn fine_angles_rad(&self, j: usize) -> Vec<f64> {
        let (Some(clock), Some([q_rad, qd_rad_s])) = (&self.clock, &self.recorded) else {
            return self.fine(self.motion.q_rad.joint(j));
        };
        let qd_rad_s = qd_rad_s.joint(j);
        let offset_rad_s = qd_rad_s.iter().sum::<f64>() / qd_rad_s.len() as f64;
        let per_sample: Vec<f64> =
            qd_rad_s.iter().map(|qd| (qd - offset_rad_s) / self.rate_hz).collect();
        clock.between(q_rad.joint(j), &per_sample)
    }

    /// y at `FINE` instants per sample.
    fn fine(&self, y: &[f64]) -> Vec<f64> {
        if let Some(clock) = &self.clock {
            return clock.refined(y);
        }
        let between = |k: usize| {
            let next = y[(k + 1).min(y.len() - 1)];
            (0..FINE).map(move |i| y[k] + (next - y[k]) * i as f64 / FINE as f64)
        };
        (0..y.len()).flat_map(between).collect()
    }

    /// How the samples of a log show a friction `torque_nm`, given at the instants, that the drive answers only by its
    /// feedback, not at once ([`FineClock::as_logged`](crate::signal::FineClock::as_logged)).
    pub fn as_logged(&self, torque_nm: Vec<f64>) -> Vec<f64> {
        match &self.clock {
            Some(clock) => {
                clock.as_logged(&torque_nm, self.highest, feedback_per_tick(self.instant_s()))
            }
            None => torque_nm,
        }
    }

    /// Torque that the drive's feedback gives in answer to a torque at the instants of a periodic motion.
    pub fn answered(&self, torque_nm: &[f64]) -> Vec<f64> {
        first_order_lag(torque_nm, feedback_per_tick(self.instant_s()))
    }

    /// Weights w for which Σ y_k τ̃_k = Σ w_k τ̄_k, where τ̄_k is the mean of a torque from sample k to the next, and
    /// τ̃ is the torque as logged where no drive answers
    /// ([`FineClock::as_logged_adjoint`](crate::signal::FineClock::as_logged_adjoint)); `None` for a single run.
    pub fn as_logged_adjoint(&self, y: &[f64]) -> Option<Vec<f64>> {
        Some(self.clock.as_ref()?.as_logged_adjoint(y, self.highest))
    }

    /// How the samples of a log show a friction `torque_nm`, given at the instants, in answer to which the drive gives
    /// `given_nm` in total.
    pub fn as_logged_but(&self, torque_nm: Vec<f64>, given_nm: &[f64]) -> Vec<f64> {
        match &self.clock {
            Some(clock) => clock.as_logged_but(&torque_nm, given_nm, self.highest),
            None => torque_nm,
        }
    }

    /// Columns for the ways in which the drive of joint `j` may answer dry friction ([`drive_answers`]); none for a
    /// single run.
    pub fn answers(&self, j: usize) -> &[Vec<f64>] {
        let Some(clock) = &self.clock else { return &[] };
        self.between.answers[j].get_or_init(|| {
            drive_answers(clock, &self.instants(j).sign, self.highest, self.rate_hz).into()
        })
    }

    /// Converts the coefficient `b` of answer number `which` ([`Self::answers`]) to this log, from a log whose instants
    /// are `instant_s` apart: the lead's column is a rate per instant.
    pub fn answer_from(&self, instant_s: f64, which: usize, b: f64) -> f64 {
        if which == SHARE { b } else { b * (instant_s / self.instant_s()) }
    }

    /// Whether a real drive of joint `j` can give its answer number `which` ([`Self::answers`]) the coefficient `b`: no
    /// drive leads or lags its joint by more than `LONGEST_LEAD_S`.
    pub fn can_answer(&self, j: usize, which: usize, b: f64) -> bool {
        let lead_s = b * self.instants(j).step_s;
        which == SHARE || lead_s.abs() < LONGEST_LEAD_S * self.coulomb_nm[j].abs()
    }
}
