//! Single readings far off their neighbours, and the values that replace them.
//!
//! Torques are compared with the median of nine readings. It follows a step, and four wild values in a row do not move
//! it; but it cuts the top off every peak that lasts only a few rows, and torque has such peaks where an arm hurries or
//! the flanks of a gear meet. A torque therefore counts as wild only if it is left as abruptly as it is reached. Angles
//! and velocities change from row to row by more than their noise, so the test is on q − ∫q̇ dt for an angle and on
//! q̇ − Δq/Δt for a velocity.

use rayon::prelude::*;

use super::channel::Channel;
use super::data_faults::{FAR, MOVES_RAD_S, step_s};
use super::record::Record;
use super::record_fault::RecordFault;
use super::verdict::{Cause, Estimate};
use crate::median::{median, sigma_of_changes};
use crate::robot::JointSignals;
use crate::signal::resolution;

/// Least number of wild readings in one channel of a joint: fewer are an accident, and no fault of the channel. They
/// are replaced only where they are so many standard deviations off that nothing but an accident can be meant.
const FEWEST: usize = 3;
const ACCIDENT: f64 = 50.0;
/// An angle that is off by less than this share of its usual change between two rows is not wild.
const SMALL_STRAY: f64 = 0.5;
/// Readings that flicker by so many steps of their resolution, as those of a joint at rest, are not wild.
const STEPS_OFF: f64 = 3.0;
/// A time stamp may be off by this many steps: a deviation no larger than what the joint travels in that time is not
/// wild.
const STAMPS_OFF: f64 = 1.5;
/// Rows to either side of the median.
const REACH: usize = 4;
/// Wild torques are entered and left by jumps of at least this share of their deviation, …
const ABRUPT: f64 = 0.5;
/// … and of at least this many times the median change between the rows before and behind them. Of eight changes of
/// white noise with standard deviation σ that median is 0.95 σ to within a third; a wild value is off by at least
/// 8 √2 σ.
const ABOVE_USUAL: f64 = 3.0;

/// Where a joint starts or stops, its friction is there a row or two before its acceleration, or goes before it: the
/// torque then has a peak as abrupt as a wild value, but within the range of the others. That is within this time of an
/// end of a rest that lasts at least as long, s.
const STOPS_S: f64 = 0.1;

/// Wild readings of one channel of a joint.
pub struct Strays {
    /// Joint (0-based).
    joint: usize,
    channel: Channel,
    rows: Vec<usize>,
}

impl Strays {
    /// Whether there are so many that the channel is at fault.
    fn are_many(&self) -> bool {
        self.rows.len() >= FEWEST
    }

    fn in_words(&self, time_s: &[f64]) -> String {
        let Self { joint, channel, rows } = self;
        let first_s = rows.first().and_then(|row| time_s.get(*row)).unwrap_or(&0.0);
        let values = if rows.len() == 1 { "value" } else { "values" };
        format!(
            "{} single {values} of the {} of joint {}, far off those around, replaced by what these say (the first at {first_s:.3} s)",
            rows.len(),
            channel.name(),
            joint + 1
        )
    }
}

/// Replaces wild readings by what their neighbours say they should be.
pub fn mend(record: &mut Record) -> Vec<Strays> {
    let mut strays = mend_motion(record);
    strays.extend(mend_torque(record));
    strays
}

/// Remarks for the user about wild readings that are too few to be a fault of their channel.
pub fn accidents(strays: &[Strays], time_s: &[f64]) -> Vec<String> {
    strays.iter().filter(|few| !few.are_many()).map(|few| few.in_words(time_s)).collect()
}

/// Replaces wild torques by the median of nine.
fn mend_torque(record: &mut Record) -> Vec<Strays> {
    let of_joint = |j: usize| {
        let y = record.torque_nm.joint(j);
        let far = far_off(y);
        let stops = starts_or_stops(record.qd_rad_s.joint(j), &record.time_s);
        let widest_nm = if far.is_empty() { 0.0 } else { spread(y) };
        let is_of_a_stop = |stray: &Stray| stops[stray.row] && stray.off.abs() < widest_nm;
        let alone = |run: &&[Stray]| stands_alone(y, run, &far) && !run.iter().any(is_of_a_stop);
        let of_one_run =
            |a: &Stray, b: &Stray| a.row + 1 == b.row && a.off.signum() == b.off.signum();
        let runs = far.chunk_by(of_one_run).filter(alone);
        runs.flatten().copied().collect()
    };
    let joints = (0..record.torque_nm.joints()).into_par_iter();
    let found = joints.map(|j| (j, of_joint(j))).collect();
    replace(&mut record.torque_nm, Channel::Torque, found)
}

/// Whether each row is within [`STOPS_S`] of a row at which a joint with the velocities `qd_rad_s` comes to rest or starts
/// from one.
fn starts_or_stops(qd_rad_s: &[f64], time_s: &[f64]) -> Vec<bool> {
    let mut stops = vec![false; qd_rad_s.len()];
    let mut row = 0;
    for same in qd_rad_s.chunk_by(|a, b| (a.abs() < MOVES_RAD_S) == (b.abs() < MOVES_RAD_S)) {
        let (first, last) = (row, row + same.len() - 1);
        row += same.len();
        if same[0].abs() >= MOVES_RAD_S || time_s[last] - time_s[first] < STOPS_S {
            continue;
        }
        for end_s in [time_s[first], time_s[last]] {
            let from = time_s.partition_point(|s| *s < end_s - STOPS_S);
            let to = time_s.partition_point(|s| *s <= end_s + STOPS_S);
            stops[from..to].fill(true);
        }
    }
    stops
}

/// Width of the range of `y` without a hundredth of its values at either end.
fn spread(y: &[f64]) -> f64 {
    let mut sorted = y.to_vec();
    sorted.sort_by(f64::total_cmp);
    let beyond = sorted.len() / 100;
    sorted[sorted.len() - 1 - beyond] - sorted[beyond]
}

/// Replaces wild angles by what the velocities say, and wild velocities by what the angles say.
///
/// A stamp that came late moves ∫q̇ dt just as a wild angle does, and a row that was read late moves the angle. A
/// reading therefore counts as wild only if it is far off both with the recorded stamps and with even steps of time.
fn mend_motion(record: &mut Record) -> Vec<Strays> {
    let joints = record.q_rad.joints();
    let even_s = step_s(&record.measurement(""));
    let stamped = steps(&record.time_s);
    let even: Vec<f64> = stamped.iter().map(|s| even_s * (s / even_s).round().max(1.0)).collect();
    let of_angle = |j: usize| {
        let (q, qd) = (record.q_rad.joint(j), record.qd_rad_s.joint(j));
        let far = [&stamped, &even].map(|steps| {
            let mut way = 0.0;
            let beside = q.iter().enumerate().map(|(k, q)| {
                if k > 0 {
                    way += 0.5 * (qd[k - 1] + qd[k]) * steps[k - 1];
                }
                q - way
            });
            far_off(&beside.collect::<Vec<f64>>())
        });
        let mut far = by_all(q, far);
        let usual_rad = sigma_of_changes(&steps(q));
        far.retain(|stray| {
            let way_rad = STAMPS_OFF * qd[stray.row].abs() * even_s;
            stray.off.abs() > way_rad.max(SMALL_STRAY * usual_rad)
        });
        far
    };
    let angles = (0..joints).into_par_iter().map(|j| (j, of_angle(j))).collect();
    let mut strays = replace(&mut record.q_rad, Channel::Angle, angles);
    let of_velocity = |j: usize| {
        let (q, qd) = (record.q_rad.joint(j), record.qd_rad_s.joint(j));
        let [stamped, even] = [&stamped, &even].map(|steps| {
            let inner = qd.iter().enumerate().map(|(k, qd)| match (k, q.get(k + 1)) {
                (1.., Some(next)) => qd - (next - q[k - 1]) / (steps[k - 1] + steps[k]),
                _ => 0.0,
            });
            far_off(&inner.collect::<Vec<f64>>())
        });
        // Where the acceleration jumps, Δq/Δt differs from q̇ although no velocity is far from its neighbours.
        by_all(qd, [far_off(qd), stamped, even])
    };
    let velocities = (0..joints).into_par_iter().map(|j| (j, of_velocity(j))).collect();
    strays.extend(replace(&mut record.qd_rad_s, Channel::Velocity, velocities));
    strays
}

/// Values of `y` that are far off by every one of the `ways` to test them, with the replacement from the last way.
fn by_all<const N: usize>(y: &[f64], ways: [Vec<Stray>; N]) -> Vec<Stray> {
    let is_in = |way: &[Stray], row| way.binary_search_by_key(&row, |stray| stray.row).is_ok();
    let Some((last, others)) = ways.split_last() else { return Vec::new() };
    let all = last.iter().filter(|stray| others.iter().all(|way| is_in(way, stray.row)));
    all.map(|stray| Stray { instead: y[stray.row] - stray.off, ..*stray }).collect()
}

/// Replaces the readings `found`: on a joint with at least [`FEWEST`] of them all, on others those of an [`ACCIDENT`].
fn replace(
    signals: &mut JointSignals,
    channel: Channel,
    found: Vec<(usize, Vec<Stray>)>,
) -> Vec<Strays> {
    let meant = found.into_iter().map(|(joint, mut far)| {
        let least = STEPS_OFF * resolution(signals.joint(joint));
        far.retain(|stray| stray.off.abs() > least);
        if far.len() < FEWEST {
            far.retain(|stray| stray.sigmas > ACCIDENT);
        }
        (joint, far)
    });
    let meant: Vec<(usize, Vec<Stray>)> = meant.collect();
    meant
        .into_iter()
        .filter(|(_, far)| !far.is_empty())
        .map(|(joint, far)| {
            let y = signals.joint_mut(joint);
            far.iter().for_each(|stray| y[stray.row] = stray.instead);
            Strays { joint, channel, rows: far.iter().map(|stray| stray.row).collect() }
        })
        .collect()
}

/// One cause for every joint with wild readings, in a record of `rows` rows.
pub fn causes(strays: &[Strays], rows: usize) -> Vec<Cause> {
    let strays: Vec<&Strays> = strays.iter().filter(|strays| strays.are_many()).collect();
    let mut joints: Vec<usize> = strays.iter().map(|stray| stray.joint).collect();
    joints.sort_unstable();
    joints.dedup();
    let of_joint = |joint: usize| {
        let own: Vec<&Strays> =
            strays.iter().copied().filter(|stray| stray.joint == joint).collect();
        let mut wild: Vec<usize> = own.iter().flat_map(|stray| &stray.rows).copied().collect();
        wild.sort_unstable();
        wild.dedup();
        let fault = RecordFault::WildReadings(own.iter().map(|stray| stray.channel).collect());
        let parameters = [("fraction", Estimate::exact(wild.len() as f64 / rows as f64, ""))];
        Cause::of_the_record(fault, Some(joint), FAR, &parameters)
    };
    joints.into_iter().map(of_joint).collect()
}

/// One value far off its neighbours.
#[derive(Debug, Clone, Copy)]
struct Stray {
    row: usize,
    /// Its difference from what its neighbours say.
    off: f64,
    /// What its neighbours say it should be.
    instead: f64,
    /// The difference in standard deviations of the changes from row to row.
    sigmas: f64,
}

/// Values of `y` far off the median of nine, in the order of their rows.
fn far_off(y: &[f64]) -> Vec<Stray> {
    let sigma = sigma_of_changes(&steps(y));
    y.windows(2 * REACH + 1)
        .enumerate()
        .filter_map(|(k, window)| Some((k + REACH, median(&mut window.to_vec())?)))
        .filter(|(row, instead)| (y[*row] - instead).abs() > FAR * sigma)
        .map(|(row, instead)| {
            let off = y[row] - instead;
            Stray { row, off, instead, sigmas: off.abs() / sigma }
        })
        .collect()
}

/// Whether the consecutive values `run` of `y` are entered and left by jumps that exceed the usual changes of `y`
/// around them. Changes from or to values that are `far` off do not count as usual. A peak fails this test, because its
/// flanks are as steep before and behind the run.
fn stands_alone(y: &[f64], run: &[Stray], far: &[Stray]) -> bool {
    let [Some(first), Some(last)] = [run.first(), run.last()] else { return false };
    // `far_off` returns only values with [`REACH`] rows on either side.
    let entered = y[first.row] - y[first.row - 1];
    let left = y[last.row] - y[last.row + 1];
    let before = first.row.saturating_sub(REACH)..first.row;
    let behind = last.row + 2..(last.row + REACH + 2).min(y.len());
    let is_far = |row: usize| far.binary_search_by_key(&row, |stray| stray.row).is_ok();
    let is_usual = |row: &usize| !is_far(*row) && !is_far(*row - 1);
    let rows = before.filter(|row| *row > 0).chain(behind).filter(is_usual);
    let mut beside: Vec<f64> = rows.map(|row| (y[row] - y[row - 1]).abs()).collect();
    let usual = median(&mut beside).unwrap_or(0.0);
    let off = run.iter().map(|stray| stray.off.abs()).fold(f64::INFINITY, f64::min);
    let least = (ABRUPT * off).max(ABOVE_USUAL * usual);
    [entered, left].iter().all(|jump| jump * first.off.signum() > least)
}

/// Differences between consecutive values.
fn steps(y: &[f64]) -> Vec<f64> {
    y.windows(2).map(|w| w[1] - w[0]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Kind;
    use crate::diagnose::record::moves_and_rests;

    /// One row while the joint moves, two next to each other, and one at rest.
    const WILD: [usize; 4] = [150, 320, 321, 700];

    /// The readings of one channel of a record's only joint.
    fn readings(record: &mut Record, channel: Channel) -> &mut [f64] {
        let signals = match channel {
            Channel::Angle => &mut record.q_rad,
            Channel::Velocity => &mut record.qd_rad_s,
            Channel::Torque => &mut record.torque_nm,
        };
        signals.joint_mut(0)
    }

    /// Motion is restored by rules with errors of h³/12 |q̇̈| = 1.7e-7 rad per row and h²/6 |q̇̈| = 4e-5 rad/s. Torque
    /// is restored to the median of nine, which is off by 0.42 of the noise of 0.3 Nm, while the clean reading itself
    /// is off by all of it: the tolerance is five standard deviations of the two together.
    #[test]
    fn wild_readings_go_back_to_where_they_were() {
        for (channel, name, off, tolerance) in [
            (Channel::Angle, "angle", 0.04, 2e-6),
            (Channel::Velocity, "velocity", 0.5, 1e-4),
            (Channel::Torque, "torque", -40.0, 1.6),
        ] {
            let mut clean = moves_and_rests(4.0, 0.3);
            let mut record = moves_and_rests(4.0, 0.3);
            WILD.iter().for_each(|&row| readings(&mut record, channel)[row] += off);
            let strays = mend(&mut record);
            assert_eq!(strays.len(), 1, "{name}");
            assert_eq!((strays[0].channel, &*strays[0].rows), (channel, &WILD[..]));
            let (mended, clean) = (readings(&mut record, channel), readings(&mut clean, channel));
            let furthest =
                mended.iter().zip(clean).map(|(a, b)| (*a - *b).abs()).fold(0.0, f64::max);
            assert!(furthest < tolerance, "{name}: {furthest}");
            let cause = &causes(&strays, 3000)[0];
            assert_eq!((cause.kind, cause.joint), (Kind::Outliers, Some(1)));
            assert_eq!(cause.in_words, format!("single values of {name} that are far off"));
            assert_eq!(cause.parameters["fraction"].value, 4.0 / 3000.0);
        }
    }

    /// An arm that rests most of the time and hurries in between. At each of its peaks of 0.3 s the median of nine is
    /// off by 60 Nm (2π/15)² = 10 Nm, twice what stands out of the noise at rest.
    #[test]
    fn peaks_of_torque_are_not_wild() {
        let [noisy, clean] = [0.5, 0.0].map(|sd| moves_and_rests(4.0, sd).torque_nm);
        let pairs = noisy.joint(0).iter().zip(clean.joint(0));
        let mut noise: Vec<f64> = pairs.map(|(noisy, clean)| noisy - clean).collect();
        let peak = |k: usize| {
            let u = (k % 60) as f64 / 15.0;
            if u < 1.0 { 60.0 * (std::f64::consts::PI * u).sin().powi(2) } else { 0.0 }
        };
        noise.iter_mut().enumerate().for_each(|(k, t)| *t += peak(k));
        assert!(far_off(&noise).len() > 30, "the median of nine cuts peaks off");
        let mended = |torque_nm: Vec<f64>| {
            let mut record = moves_and_rests(4.0, 0.5);
            record.torque_nm = JointSignals::from_fn(1, torque_nm.len(), |_, k| torque_nm[k]);
            mend_torque(&mut record).into_iter().flat_map(|stray| stray.rows).collect::<Vec<_>>()
        };
        assert_eq!(mended(noise.clone()), [0; 0]);
        // Four wild values in a row and one alone at rest, one on a flank, and two of different sign next to each
        // other.
        let wild = [150, 151, 152, 153, 700, 905, 940, 941];
        wild.iter().for_each(|&k| noise[k] += if k == 941 { -60.0 } else { 60.0 });
        assert_eq!(mended(noise), wild);
    }

    /// Where a move of the trapezoidal kind ends, friction is gone a row before the deceleration is: of hardly noisy torque
    /// that is far off. A value that is off as much in the middle of a move is wild, and so is one at a stop that is
    /// outside the range of all others.
    #[test]
    fn peaks_at_a_stop_are_not_wild() {
        let mended = |off: &[(usize, f64)]| {
            let mut record = moves_and_rests(4.0, 0.02);
            off.iter().for_each(|&(row, nm)| record.torque_nm.joint_mut(0)[row] += nm);
            mend_torque(&mut record).into_iter().flat_map(|stray| stray.rows).collect::<Vec<_>>()
        };
        // The torque ranges from −6.5 to 8 Nm. The moves end in rows 500, 1500 and 2500.
        let at_stops = [(500, -4.0), (1500, -4.0), (2500, -4.0)];
        assert_eq!(mended(&at_stops), [0; 0]);
        assert_eq!(mended(&[(300, -4.0), (1300, -4.0), (2300, -4.0)]), [300, 1300, 2300]);
        let far = at_stops.map(|(row, _)| (row, 40.0));
        assert_eq!(mended(&far), [500, 1500, 2500]);
    }

    /// None of these is wild: stamps that are half a row late, rows that were read that late, an acceleration that
    /// jumps where a move begins, a torque that steps.
    #[test]
    fn what_moves_is_not_wild() {
        let late_s = 0.004;
        let mut stamps = moves_and_rests(4.0, 0.3);
        (50..3000).step_by(97).for_each(|row| stamps.time_s[row] += late_s);
        assert_eq!(mend(&mut stamps).len(), 0);
        let mut rows = moves_and_rests(4.0, 0.3);
        for row in (50..3000).step_by(97) {
            let (q, qd) = (rows.q_rad.joint(0), rows.qd_rad_s.joint(0));
            let towards = |y: &[f64]| 0.5 * (y[row] + y[row + 1]);
            let late = [towards(q), towards(qd)];
            rows.q_rad.joint_mut(0)[row] = late[0];
            rows.qd_rad_s.joint_mut(0)[row] = late[1];
        }
        assert_eq!(mend(&mut rows).len(), 0);
        let mut steps = moves_and_rests(4.0, 0.3);
        steps.torque_nm.joint_mut(0)[1200..1700].iter_mut().for_each(|t| *t += 30.0);
        assert_eq!(mend(&mut steps).len(), 0);
    }

    /// The last digit of a joint at rest flickers.
    #[test]
    fn a_last_digit_is_not_wild() {
        let mut rest = moves_and_rests(4.0, 0.3);
        rest.q_rad.joint_mut(0).fill(0.5);
        rest.qd_rad_s.joint_mut(0).fill(0.0);
        for row in (50..3000).step_by(41) {
            rest.q_rad.joint_mut(0)[row] += 1e-4;
            rest.qd_rad_s.joint_mut(0)[row + 7] -= 1e-4;
        }
        assert_eq!(mend(&mut rest).len(), 0);
    }

    /// One or two wild readings are replaced and told, but are no fault of their channel. What is only 17 standard
    /// deviations off may be torque.
    #[test]
    fn an_accident_is_mended_and_no_cause() {
        let clean = moves_and_rests(4.0, 0.3);
        let mut accident = moves_and_rests(4.0, 0.3);
        WILD[..2].iter().for_each(|&row| accident.q_rad.joint_mut(0)[row] += 0.1);
        accident.torque_nm.joint_mut(0)[700] += 20_000.0;
        let strays = mend(&mut accident);
        let rows = accident.time_s.len();
        assert_eq!(causes(&strays, rows), []);
        let remarks = accidents(&strays, &accident.time_s);
        let said =
            ["2 single values of the angle of joint 1", "1 single value of the torque of joint 1"];
        assert_eq!(remarks.len(), said.len());
        remarks.iter().zip(said).for_each(|(told, said)| assert!(told.starts_with(said), "{told}"));
        let off =
            |a: &JointSignals, b: &JointSignals, row: usize| a.joint(0)[row] - b.joint(0)[row];
        let of_angles = WILD[..2].iter().map(|&row| off(&accident.q_rad, &clean.q_rad, row));
        assert!(of_angles.map(f64::abs).fold(0.0, f64::max) < 2e-6);
        assert!(off(&accident.torque_nm, &clean.torque_nm, 700).abs() < 1.6);
        let mut peak = moves_and_rests(4.0, 0.3);
        peak.torque_nm.joint_mut(0)[700] += 17.0 * 0.3;
        assert_eq!(mend(&mut peak).len(), 0);
    }
}
