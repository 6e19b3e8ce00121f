//! Readings of single channels that repeat the one before, because the recorder asked again before the sensor had a new
//! one.
//!
//! A signal that is quantised in steps Δ and changes by c from reading to reading repeats by chance in about Δ/c of all
//! readings, and a noisy one as often as it comes back to the reading before the last one. Readings that repeat far
//! more often while their joint moves are stale, unless they lie at the end of the channel's range. Steps may grow with
//! the size of the readings ([`ReadingSteps`]).

use rayon::prelude::*;

use super::channel::Channel;
use super::data_faults::MOVES_RAD_S;
use super::reading_steps::ReadingSteps;
use super::record::Record;
use super::record_fault::RecordFault;
use super::verdict::{Cause, Estimate};
use crate::median::median;
use crate::robot::JointSignals;

/// Stale readings must be this many times as frequent as chance makes them, and at least this share of all: a few
/// missed samples are no cause of anything.
const BEYOND_CHANCE: f64 = 3.0;
const LEAST_SHARE: f64 = 2e-3;
/// From this share of repeated readings on, a channel is not stale but read at a lower rate.
const MOST_SHARE: f64 = 0.4;
/// A joint counts as possibly at rest if it is slower than [`MOVES_RAD_S`] for most of this time before and behind, s.
const NEAR_S: f64 = 0.2;
/// Largest share of the rows that may be removed because of stale readings.
const MOST_ROWS: f64 = 0.4;
/// This many repeated readings in a row are a sensor that hangs: the values in between can no longer be interpolated.
const HANGS: usize = 6;
/// Largest share of the runs of equal readings that may have the same value by chance.
const ONE_NUMBER: f64 = 0.05;
/// A signal is noisy if its second differences are at least this share of its first differences (in the median): for
/// white noise the ratio is 1.7, for smooth motion less than 0.2.
const NOISY: f64 = 0.5;
/// Readings that differ by less than this share of their median change are the same but for rounding.
const SAME: f64 = 1e-4;
/// If more than this share of the stale rows of every joint is common to all joints, the whole recorder hangs; and if
/// more than this share of those of every channel is common to all channels of a joint, all of the joint does.
const ALIKE: f64 = 0.9;

/// Stale readings of one joint.
struct OfJoint {
    joint: usize,
    /// Rows with stale readings by channel, in the order of [`Channel::ALL`].
    readings: [Vec<usize>; 3],
    /// Rows in which the torque hangs.
    hangs: Vec<usize>,
}

impl OfJoint {
    /// Rows with a stale or hanging reading, in ascending order.
    fn rows(&self) -> Vec<usize> {
        in_order(self.readings.iter().chain([&self.hangs]).flatten().copied())
    }

    /// Whether readings of this channel are stale, or hang.
    fn is_stale_in(&self, channel: Channel) -> bool {
        let hangs = channel == Channel::Torque && !self.hangs.is_empty();
        hangs || !self.readings[channel as usize].is_empty()
    }

    /// Whether all channels repeat the same rows.
    fn is_of_whole_rows(&self) -> bool {
        self.hangs.is_empty() && are_alike(&self.readings)
    }
}

/// Whether these lists of rows, each in ascending order, are mostly one ([`ALIKE`]).
fn are_alike(lists: &[Vec<usize>]) -> bool {
    let is_in_all = |row: &&usize| lists.iter().all(|other| other.binary_search(row).is_ok());
    let common = lists.first().map_or(0, |first| first.iter().filter(is_in_all).count());
    let most = lists.iter().map(Vec::len).max().unwrap_or(0);
    most > 0 && common as f64 > ALIKE * most as f64
}

/// Each of `rows` once, in ascending order.
fn in_order(rows: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut rows: Vec<usize> = rows.collect();
    rows.sort_unstable();
    rows.dedup();
    rows
}

/// The causes that stale readings make, and the rows in which torques hang.
pub struct StaleReadings {
    pub causes: Vec<Cause>,
    /// By joint (0-based), the rows of the mended record in which its torque hangs.
    pub hangs: Vec<(usize, Vec<usize>)>,
}

impl StaleReadings {
    /// All rows in which a torque hangs, in ascending order.
    pub fn hanging_rows(&self) -> Vec<usize> {
        in_order(self.hangs.iter().flat_map(|(_, rows)| rows.iter().copied()))
    }
}

/// Removes the rows with stale readings from `record`. If these are too many, no row is removed and each stale reading
/// is interpolated instead. A torque that hangs is left as it is.
pub fn mend(record: &mut Record) -> StaleReadings {
    let joints = record.torque_nm.joints();
    let samples = record.time_s.len();
    let found: Vec<OfJoint> = (0..joints).into_par_iter().map(|j| of_joint(record, j)).collect();
    let single = found.iter().flat_map(|stale| stale.readings.iter().flatten().copied());
    let mut left_out = in_order(single);
    if left_out.len() as f64 > MOST_ROWS * samples as f64 {
        left_out.clear();
        for stale in &found {
            let [q, qd, torque] = &stale.readings;
            let Record { time_s, q_rad, qd_rad_s, torque_nm, .. } = record;
            interpolate(time_s, q_rad, stale.joint, q);
            interpolate(time_s, qd_rad_s, stale.joint, qd);
            interpolate(time_s, torque_nm, stale.joint, torque);
        }
    } else if !left_out.is_empty() {
        *record = record.leave_out(&left_out);
    }
    let causes = causes(&found, samples);
    let is_left = |k: &usize| left_out.binary_search(k).is_err();
    let place = |k: usize| k - left_out.partition_point(|row| *row < k);
    let hanging = found.into_iter().filter(|stale| !stale.hangs.is_empty());
    let hangs = hanging.map(|OfJoint { joint, hangs, .. }| {
        (joint, hangs.into_iter().filter(is_left).map(place).collect())
    });
    StaleReadings { causes, hangs: hangs.collect() }
}

/// One cause for all joints if they repeat the same rows, else one cause for every joint that repeats any.
fn causes(found: &[OfJoint], samples: usize) -> Vec<Cause> {
    let rows: Vec<Vec<usize>> = found.iter().map(OfJoint::rows).collect();
    let channels = |stale: &[&OfJoint]| -> Vec<Channel> {
        let is_stale = |channel: &Channel| stale.iter().any(|s| s.is_stale_in(*channel));
        Channel::ALL.into_iter().filter(is_stale).collect()
    };
    let said = |joint: Option<usize>, rows: &[usize], stale: &[&OfJoint]| {
        let parameters = [("fraction", Estimate::exact(rows.len() as f64 / samples as f64, ""))];
        let fault = match stale.iter().all(|s| s.is_of_whole_rows()) {
            true => RecordFault::RepeatedRows,
            false => RecordFault::RepeatedReadings(channels(stale)),
        };
        Cause::of_the_record(fault, joint, f64::INFINITY, &parameters)
    };
    if rows.len() > 1 && are_alike(&rows) {
        let all: Vec<&OfJoint> = found.iter().collect();
        return vec![said(None, &rows[0], &all)];
    }
    let stale = found.iter().zip(&rows).filter(|(_, rows)| !rows.is_empty());
    stale.map(|(stale, rows)| said(Some(stale.joint), rows, &[stale])).collect()
}

fn of_joint(record: &Record, joint: usize) -> OfJoint {
    let Record { time_s, q_rad, qd_rad_s, torque_nm, .. } = record;
    let speed = qd_rad_s.joint(joint);
    let span_s = time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0);
    // The rate of a record without rows is NaN; the limits make `reach` zero then.
    let reach = (NEAR_S * time_s.len() as f64 / span_s).max(1.0).min(time_s.len() as f64) as usize;
    // A quarter of the samples near by suffices, so that a reversal does not count as rest.
    let moves = |k: usize| {
        let near = k.saturating_sub(reach)..(k + reach).min(speed.len());
        let fast = speed[near.clone()].iter().filter(|speed| speed.abs() > MOVES_RAD_S).count();
        4 * fast > near.len()
    };
    // An angle must change if the joint travels several steps of its resolution. A velocity that reads zero may be too
    // slow to be seen.
    let turns = |k: usize, step: f64| {
        let speed = speed[k].abs();
        speed > MOVES_RAD_S && (time_s[k] - time_s[k - 1]) * speed > BEYOND_CHANCE * step
    };
    let is_seen = |k: usize, _: f64| speed[k] != 0.0 && moves(k);
    let is_moving = |k: usize, _: f64| moves(k);
    let (angles, _) = stale(q_rad.joint(joint), turns);
    let (velocities, _) = stale(speed, is_seen);
    let (torques, hangs) = stale(torque_nm.joint(joint), is_moving);
    OfJoint { joint, readings: [angles, velocities, torques], hangs }
}

/// Readings of `y` that repeat the one before although, by the resolution of `y`, they should change: first those of
/// short runs, then those of a noisy sensor that hangs.
fn stale(y: &[f64], should_change: impl Fn(usize, f64) -> bool) -> (Vec<usize>, Vec<usize>) {
    let sizes = |steps: Vec<f64>| -> f64 {
        let mut sizes: Vec<f64> = steps.into_iter().map(f64::abs).filter(|v| *v > 0.0).collect();
        median(&mut sizes).unwrap_or(0.0)
    };
    let change = sizes(y.windows(2).map(|w| w[1] - w[0]).collect());
    // Of smaller steps, chance makes too few readings repeat to count.
    let steps = ReadingSteps::of(y, LEAST_SHARE / BEYOND_CHANCE * change);
    let ends =
        y.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
    let changing: Vec<usize> =
        (1..y.len()).filter(|k| should_change(*k, steps.at(y[*k]))).collect();
    let is_stale = |k: &usize| y[*k] == y[k - 1] && !ends.contains(&y[*k]);
    let (mut single, mut hanging) = (Vec::new(), Vec::new());
    let all: Vec<usize> = changing.iter().copied().filter(is_stale).collect();
    let runs: Vec<&[usize]> = all.chunk_by(|a, b| b - a == 1).collect();
    // A value that is read again and again is one that the signal does not pass: the limit of a drive.
    let mut values: Vec<f64> = runs.iter().map(|run| y[run[0]]).filter(|v| *v != 0.0).collect();
    values.sort_by(f64::total_cmp);
    let often = (ONE_NUMBER * runs.len() as f64).max(2.0);
    let is_often = |same: &&[f64]| same.len() as f64 > often;
    let limits: Vec<f64> = values.chunk_by(|a, b| a == b).filter(is_often).map(|v| v[0]).collect();
    for run in runs {
        let (first, last) = (run[0], run[run.len() - 1]);
        // If the readings around a run are almost equal, the readings in it need not have changed.
        let around = y.get(last + 1).zip(first.checked_sub(2).map(|k| y[k]));
        let least = BEYOND_CHANCE * steps.at(y[first]);
        let changes = around.is_some_and(|(next, before)| (next - before).abs() > least);
        match run.len() {
            _ if limits.contains(&y[first]) => {}
            HANGS.. => hanging.extend_from_slice(run),
            _ if changes => single.extend_from_slice(run),
            _ => {}
        }
    }
    let bend = sizes(y.windows(3).map(|w| w[2] - 2.0 * w[1] + w[0]).collect());
    if bend < NOISY * change {
        // A smooth signal may as well be constant.
        hanging.clear();
    }
    let share = |rows: &[usize]| rows.len() as f64 / changing.len().max(1) as f64;
    // Chance makes no more than every reading repeat.
    let step = steps.mean_at(changing.iter().map(|k| y[*k]), change);
    let by_steps = if change > 0.0 { step / change } else { 1.0 };
    // Noise comes back to the reading before the last one as often as it stays. (Velocities that are slopes of rounded
    // angles have coarse steps that no smallest difference shows, because times are rounded as well.)
    let comes_back =
        |k: &usize| *k > 1 && (y[*k] - y[*k - 2]).abs() <= SAME * change && y[*k] != y[*k - 1];
    let back: Vec<usize> = changing.iter().copied().filter(comes_back).collect();
    let chance = BEYOND_CHANCE * by_steps.max(share(&back));
    if !(chance.max(LEAST_SHARE)..MOST_SHARE).contains(&share(&single)) {
        single.clear();
    }
    if !(LEAST_SHARE..MOST_SHARE).contains(&share(&hanging)) || chance > MOST_SHARE {
        hanging.clear();
    }
    (single, hanging)
}

/// Interpolates joint `j` of `signals` at the `stale` samples: by the cubic through two good readings on either side,
/// or by the straight line through one on either side if there are no two.
fn interpolate(time_s: &[f64], signals: &mut JointSignals, j: usize, stale: &[usize]) {
    let y = signals.joint_mut(j);
    let is_good = |k: &usize| stale.binary_search(k).is_err();
    for &k in stale {
        let before: Vec<usize> = (0..k).rev().filter(is_good).take(2).collect();
        let behind: Vec<usize> = (k + 1..y.len()).filter(is_good).take(2).collect();
        let nodes: Vec<usize> = if before.len() == 2 && behind.len() == 2 {
            before.into_iter().chain(behind).collect()
        } else {
            before.into_iter().take(1).chain(behind.into_iter().take(1)).collect()
        };
        // Weights of Lagrange's polynomial.
        let weight = |at: usize| -> f64 {
            let others = nodes.iter().filter(|other| **other != at);
            others
                .map(|&other| (time_s[k] - time_s[other]) / (time_s[at] - time_s[other]))
                .product()
        };
        let value = nodes.iter().map(|&at| weight(at) * y[at]).sum();
        y[k] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Kind;
    use crate::diagnose::record::moves_and_rests as record;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    /// Without noise, all channels of a joint at rest are constant; and a drive at its limit reads the same value again
    /// and again.
    #[test]
    fn rest_and_a_limit_are_not_stale() {
        for noise_nm in [0.0, 0.3] {
            let mut still = record(4.0, noise_nm);
            assert_eq!(mend(&mut still).causes, []);
            let mut limited = record(4.0, noise_nm);
            limited.torque_nm.joint_mut(0).iter_mut().for_each(|t| *t = t.clamp(-6.0, 6.0));
            assert_eq!(mend(&mut limited).causes, []);
            // With wild readings in the channel, the limit is not its largest value.
            limited.torque_nm.joint_mut(0)[100] = 40.0;
            limited.torque_nm.joint_mut(0)[400] = -40.0;
            assert_eq!(mend(&mut limited).causes, []);
        }
    }

    /// Torque in steps as coarse as its noise repeats by chance; and for torque that is read at a half or a fourth of
    /// the rate there are no other readings.
    #[test]
    fn coarse_and_slow_readings_are_not_stale() {
        let mut coarse = record(4.0, 0.3);
        coarse.torque_nm.joint_mut(0).iter_mut().for_each(|t| *t = (*t / 0.3).round() * 0.3);
        assert_eq!(mend(&mut coarse).causes, []);
        let mut held = record(4.0, 0.3);
        let torque = held.torque_nm.joint_mut(0);
        (0..torque.len()).for_each(|k| torque[k] = torque[k - k % 4]);
        assert_eq!(mend(&mut held).causes, []);
        let mut half = record(4.0, 0.3);
        let torque = half.torque_nm.joint_mut(0);
        (0..torque.len()).for_each(|k| torque[k] = torque[k - k % 2]);
        assert_eq!(mend(&mut half).causes, []);
    }

    /// Slopes, over five rows, of angles in steps of 50 µrad are multiples of a step of 0.5 mrad/s. Times are rounded
    /// to nanoseconds, so that no smallest difference shows this step. Of the slopes of a slow joint, 1.4 % repeat the
    /// one before (seven times the least share), and 1.6 % the one before the last.
    #[test]
    fn slopes_of_rounded_angles_are_not_stale() {
        let mut record = record(4.0, 0.3);
        let (slow, step_rad) = (0.3, 5e-5);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let counted = |q: &f64| (slow * q / step_rad + rng.random_range(-0.6..0.6)).round();
        let q: Vec<f64> = record.q_rad.joint(0).iter().map(counted).collect();
        let qd = record.qd_rad_s.joint_mut(0);
        qd.iter_mut().for_each(|qd| *qd *= slow);
        for (k, q) in (2..).zip(q.windows(5)) {
            // Two neighbours are rounded alike, and may be equal; the one before them is not.
            let rounding = 1.0 + 1e-9 * (k / 2 % 3) as f64;
            let slope = (q[0] - 8.0 * q[1] + 8.0 * q[3] - q[4]) / 12.0;
            qd[k] = slope * step_rad / 0.008 * rounding;
        }
        record.q_rad.joint_mut(0).iter_mut().zip(q).for_each(|(angle, q)| *angle = q * step_rad);
        assert_eq!(mend(&mut record).causes, []);
    }

    /// Backward differences of angles in steps of 96 µrad, printed in degrees per second with four digits, come in
    /// steps of 12 mrad/s, about as much as the velocity changes from row to row.
    #[test]
    fn printed_differences_of_rounded_angles_are_not_stale() {
        let mut record = record(4.0, 0.3);
        let step_rad = 9.6e-5;
        let counts: Vec<f64> =
            record.q_rad.joint(0).iter().map(|q| (q / step_rad).round()).collect();
        let qd = record.qd_rad_s.joint_mut(0);
        for (k, pair) in (1..).zip(counts.windows(2)) {
            let slope_rad_s = (pair[1] - pair[0]) * step_rad / 0.008;
            qd[k] = ((slope_rad_s.to_degrees() * 1e4).round() * 1e-4).to_radians();
        }
        record.q_rad.joint_mut(0).iter_mut().zip(counts).for_each(|(q, n)| *q = n * step_rad);
        assert_eq!(mend(&mut record).causes, []);
    }

    /// Angles printed with four digits come in steps of 1 mrad from 1 rad on, and of 0.01 mrad below 0.1 rad. The joint
    /// turns from 0.05 to 1.45 rad by up to 1.3 mrad from row to row.
    #[test]
    fn angles_of_four_digits_are_not_stale() {
        let mut record = record(28.0, 0.3);
        let scale = 0.7;
        let printed = |q: &f64| {
            let q_rad = 0.05 + scale * q;
            let step_rad = 10f64.powf(q_rad.log10().floor() - 3.0);
            (q_rad / step_rad).round() * step_rad
        };
        let q: Vec<f64> = record.q_rad.joint(0).iter().map(printed).collect();
        let qd = record.qd_rad_s.joint_mut(0);
        qd.iter_mut().for_each(|qd| *qd *= scale);
        let repeats = |(pair, qd): (&[f64], &f64)| pair[0] == pair[1] && *qd > MOVES_RAD_S;
        let repeated = q.windows(2).zip(&qd[1..]).filter(|row| repeats(*row)).count();
        assert!(repeated > 100, "{repeated}");
        record.q_rad.joint_mut(0).copy_from_slice(&q);
        assert_eq!(mend(&mut record).causes, []);
    }

    /// One in ten angles repeats the one before: these rows are removed, and the words name the channel.
    #[test]
    fn an_angle_that_repeats_is_told_from_its_torque() {
        let mut record = record(4.0, 0.3);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let before = record.time_s.len();
        let q = record.q_rad.joint_mut(0);
        (1..q.len()).for_each(|k| {
            if rng.random_bool(0.1) {
                q[k] = q[k - 1];
            }
        });
        let causes = mend(&mut record).causes;
        assert_eq!(causes.len(), 1);
        assert_eq!((causes[0].kind, causes[0].joint), (Kind::DroppedSamples, Some(1)));
        assert_eq!(causes[0].in_words, "readings of the angle that repeat the one before");
        let of_the_angle = RecordFault::RepeatedReadings(vec![Channel::Angle]);
        assert_eq!(causes[0].record_fault, Some(of_the_angle));
        // The joint moves in half of the rows, a tenth of these is stale, and at the slow ends of a motion stale
        // readings go unseen.
        let left_out = (before - record.time_s.len()) as f64 / before as f64;
        assert!((0.03..0.06).contains(&left_out), "{left_out}");
    }

    /// One in ten rows repeats angle, velocity and torque of the one before, while the joint moves.
    #[test]
    fn a_joint_that_repeats_all_of_its_readings_repeats_rows() {
        let mut record = record(4.0, 0.3);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let Record { q_rad, qd_rad_s, torque_nm, .. } = &mut record;
        let mut channels = [q_rad, qd_rad_s, torque_nm].map(|signals| signals.joint_mut(0));
        for k in 1..channels[1].len() {
            if channels[1][k].abs() > 0.05 && rng.random_bool(0.1) {
                channels.iter_mut().for_each(|y| y[k] = y[k - 1]);
            }
        }
        let causes = mend(&mut record).causes;
        let told: Vec<_> = causes.iter().map(|c| (c.kind, c.joint, &c.record_fault)).collect();
        assert_eq!(told, [(Kind::DroppedSamples, Some(1), &Some(RecordFault::RepeatedRows))]);
    }

    /// A cubic through its good neighbours puts a smooth angle back to where it was, as is done where too many rows are
    /// stale to be removed.
    #[test]
    fn readings_between_good_ones_are_put_back() {
        let mut record = record(4.0, 0.0);
        let truth = record.q_rad.joint(0).to_vec();
        let stale: Vec<usize> = (4..truth.len() - 4).filter(|k| k % 3 == 1).collect();
        let q = record.q_rad.joint_mut(0);
        stale.iter().for_each(|&k| q[k] = q[k - 1]);
        interpolate(&record.time_s, &mut record.q_rad, 0, &stale);
        let off = |(a, b): (&f64, &f64)| (a - b).abs();
        let most = record.q_rad.joint(0).iter().zip(&truth).map(off).fold(0.0, f64::max);
        // The angle's fourth derivative is (2π/4)⁴ = 6 rad/s⁴. Where the joint comes to rest, its second derivative
        // jumps by 2.5 rad/s², over steps of 8 ms.
        assert!(most < 0.5 * 2.5 * 0.008 * 0.008, "{most}");
    }
}
