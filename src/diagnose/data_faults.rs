//! Faults of the record itself. They are looked for before any physics, because a wrong friction law would otherwise
//! explain what they do to a log.
//!
//! All tests use the raw channels. Angle and velocity contain the same information twice; this reveals a velocity that
//! lags and a clock that stood still while the time stamps went on:
//!
//! - the lag d of q̇ follows from q̇ − Δq/Δt = −d q̈ by least squares;
//! - for the time lost between two rows see [`stalls`](super::stalls).

use super::kind::Kind;
use super::outliers;
use super::record::Record;
use super::record_fault::RecordFault;
use super::stale::{self, StaleReadings};
use super::stalls::stalls;
use super::verdict::{Cause, Estimate};
use crate::identify::Measurement;
use crate::identify::covariance::quantile_95;
use crate::median::{UsualStep, median_step};
use crate::robot::JointSignals;
use crate::signal::SignalError;

/// A deviation of this many robust standard deviations is not noise: among 10⁶ Gaussian values, one in 10⁹ logs has
/// such a value.
pub(super) const FAR: f64 = 8.0;
/// A lag below this many samples is too small to matter to the user of a log.
const SMALL_LAG_SAMPLES: f64 = 0.01;
/// A quantisation step is coarse from this ratio to the rms change from sample to sample on: there it adds a tenth to
/// the variance of the noise. (White noise of variance σ² changes by √2 σ; a step s adds s²/12.)
const COARSE: f64 = 0.77;
/// A step that is larger than the rms change between samples leaves rounding errors that repeat with the motion, as
/// physical effects do.
const TOO_COARSE: f64 = 1.0;
/// Number of blocks whose scatter gives the σ of the lag.
const BLOCKS: usize = 20;
/// Student's t₁₉ that noise exceeds with a probability of about 2·10⁻⁵, two-tailed and for six joints together.
const LAG_T: f64 = 6.5;
/// All joints share one lag if each differs from the mean by less than this many of its own σ plus this share of the
/// mean: the lag of a filter common to all channels depends a little on how fast a joint moves.
const ALIKE: [f64; 2] = [5.0, 0.1];
/// Angle and velocity of a moving joint agree: the mean product of the logged velocity and the slope of the angle is at
/// least this share of the mean square velocity. For a joint at rest both are noise, and the product is small.
const GO_TOGETHER: f64 = 0.5;
/// A joint slower than this, rad/s, may repeat its readings.
pub(super) const MOVES_RAD_S: f64 = 0.01;
/// Share of rows that an ordinary recorder misses; this is not reported.
const MISSED: f64 = 2e-3;

/// The faults of a record.
pub struct Faults {
    /// The faults as causes.
    pub causes: Vec<Cause>,
    /// The record after the faults that can be corrected have been corrected.
    pub record: Record,
    /// Remarks for the user.
    pub warnings: Vec<String>,
    /// Joints (0-based) whose torque readings are not reliable.
    pub unreadable: Vec<usize>,
}

/// Finds all faults of the record of `m`. Repeated rows, stalls of the clock and gaps are dealt with first, because
/// they hide faults of the velocity and the torque. Missing rows are filled in from other periods unless the motion
/// counts as a `single_run`.
pub fn find(m: &Measurement, single_run: bool) -> Result<Faults, SignalError> {
    find_by(m, single_run, 0.0)
}

/// Like [`find`]; velocities that are late by less than `least_lag_s` are not computed from the angles
/// ([`Record::undo_lags`]).
pub fn find_by(m: &Measurement, single_run: bool, least_lag_s: f64) -> Result<Faults, SignalError> {
    let mut out: Vec<Cause> = Vec::new();
    let repeats = repeats(m);
    out.extend(repeated_or_missing(m, &repeats));
    let mut record = Record::without_rows(m, &repeats);
    let stale = stale::mend(&mut record);
    let strays = outliers::mend(&mut record);
    let wild = outliers::causes(&strays, record.time_s.len());
    let mut warnings = outliers::accidents(&strays, &record.time_s);
    let stalls = stalls(&record.measurement(m.source));
    if let Some(stalls) = &stalls {
        out.push(stalls.cause());
        record.give_back_time(&stalls.rows, stalls.lost_s);
    }
    let (warning, unreadable) = without_hanging_torques(&mut record, &stale, single_run)?;
    out.extend(stale.causes);
    let lags = velocity_lag(&record.measurement(m.source));
    record.undo_lags(&lags, least_lag_s);
    out.extend(lags);
    out.extend(wild);
    out.extend(quantisation(m.torque_nm, &record.torque_nm));
    warnings.extend(warning);
    Ok(Faults { causes: out, record, warnings, unreadable })
}

/// If a torque hangs in no more than this share of the rows, they are replaced only where other periods can fill them
/// in. If it hangs in more, they are removed in any case and the rest of the log is used.
const SHORT_HANG: f64 = 0.1;

/// Fills the gaps of `record` and replaces the rows in which a torque hangs by rows of other periods. If there are few
/// such rows and nothing repeats, they stay, and their joints are unreliable. Returns a remark for the user and the
/// unreliable joints (0-based).
fn without_hanging_torques(
    record: &mut Record,
    stale: &StaleReadings,
    single_run: bool,
) -> Result<(Option<String>, Vec<usize>), SignalError> {
    let filled = |record: &mut Record| if single_run { Ok(None) } else { record.fill_gaps() };
    let rows = stale.hanging_rows();
    if !rows.is_empty() {
        let mut without = record.leave_out(&rows);
        let warning = filled(&mut without)?;
        let is_long = rows.len() as f64 > SHORT_HANG * record.time_s.len() as f64;
        if is_long || !without.filled.is_empty() {
            *record = without;
            return Ok((warning, Vec::new()));
        }
    }
    let hanging = stale.hangs.iter().map(|(joint, _)| *joint).collect();
    Ok((filled(record)?, hanging))
}

/// Least σ of a lag, in samples: how well means over four steps tell it where velocities carry no noise, as those that
/// are differences of the recorded angles. A lag of 4.33 samples, hidden with little noise, came out 1e-3 samples
/// short.
const LEAST_SIGMA_SAMPLES: f64 = 1e-3;

/// Velocity channels that lag behind the angle: one cause for all joints if they share one lag, otherwise one per
/// joint.
fn velocity_lag(m: &Measurement) -> Vec<Cause> {
    let step_s = step_s(m);
    let lags: Vec<Option<(f64, f64)>> = (0..m.q_rad.joints()).map(|j| lag(m, j)).collect();
    let is_late = |&(lag, sigma): &(f64, f64)| {
        lag.abs() > SMALL_LAG_SAMPLES * step_s && lag.abs() > LAG_T * sigma
    };
    let estimate = |lag: f64, sigma: f64| {
        let reach = quantile_95((BLOCKS - 1) as f64) * sigma;
        [("delay_s", Estimate { value: lag, unit: "s", ci95: [lag - reach, lag + reach] })]
    };
    let known: Vec<(f64, f64)> = lags.iter().flatten().copied().collect();
    let late: Vec<(f64, f64)> = known.iter().copied().filter(is_late).collect();
    // Joints that do not move have no lag and do not speak against a common one.
    if 2 * late.len() > lags.len() && late.len() > 1 {
        let weight: f64 = late.iter().map(|(_, s)| s.powi(-2)).sum();
        let mean = late.iter().map(|(d, s)| d / (s * s)).sum::<f64>() / weight;
        let alike =
            known.iter().all(|(d, s)| (d - mean).abs() < ALIKE[0] * s + ALIKE[1] * mean.abs());
        if alike {
            // What the means over four steps do to one joint they do to all.
            let sigma = weight.powf(-0.5).max(LEAST_SIGMA_SAMPLES * step_s);
            return vec![Cause::of_the_record(
                RecordFault::LateVelocity,
                None,
                mean.abs() / sigma,
                &estimate(mean, sigma),
            )];
        }
    }
    lags.iter()
        .enumerate()
        .filter_map(|(j, lag)| {
            let (lag, sigma) = lag.filter(is_late)?;
            Some(Cause::of_the_record(
                RecordFault::LateVelocity,
                Some(j),
                lag.abs() / sigma,
                &estimate(lag, sigma),
            ))
        })
        .collect()
}

/// Lag of joint `j`'s velocity and its σ from the scatter between blocks, s. `None` for a joint that does not move, and
/// in short logs.
fn lag(m: &Measurement, j: usize) -> Option<(f64, f64)> {
    let (t, q, qd) = (m.time_s, m.q_rad.joint(j), m.qd_rad_s.joint(j));
    let n = t.len();
    // The slope of the angle over two samples to each side is the mean velocity over these four steps. It is compared
    // with the mean of the logged velocity over the same steps, so that the curvature of the motion cancels.
    let (mut alike, mut all) = (0.0, 0.0);
    let terms: Vec<(f64, f64)> = (2..n.saturating_sub(2))
        .map(|k| {
            let span = t[k + 2] - t[k - 2];
            let mean: f64 =
                (k - 2..k + 2).map(|i| 0.5 * (qd[i] + qd[i + 1]) * (t[i + 1] - t[i])).sum::<f64>()
                    / span;
            let slope = (q[k + 2] - q[k - 2]) / span;
            let acceleration = (qd[k + 2] - qd[k - 2]) / span;
            alike += mean * slope;
            all += mean * mean;
            (-(mean - slope) * acceleration, acceleration * acceleration)
        })
        .collect();
    let sum = |part: &[(f64, f64)]| part.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let (product, square) = sum(&terms);
    // For a joint at rest, velocity and angle are noise, which has no lag.
    let moves = alike > GO_TOGETHER * all;
    if square.is_nan() || square <= 0.0 || !moves || terms.len() < 10 * BLOCKS {
        return None;
    }
    let lag = product / square;
    let scatter: f64 = terms
        .chunks(terms.len().div_ceil(BLOCKS))
        .map(|block| {
            let (product, square) = sum(block);
            (product - lag * square).powi(2)
        })
        .sum();
    let variance = scatter * BLOCKS as f64 / (BLOCKS - 1) as f64 / square.powi(2);
    Some((lag, variance.sqrt().max(LEAST_SIGMA_SAMPLES * step_s(m))))
}

/// Rows of a moving arm that repeat the row before in every channel.
fn repeats(m: &Measurement) -> Vec<usize> {
    let channels = [m.q_rad, m.qd_rad_s, m.torque_nm];
    let moves =
        |k: usize| (0..m.q_rad.joints()).any(|j| m.qd_rad_s.joint(j)[k].abs() > MOVES_RAD_S);
    let same =
        |s: &JointSignals, k: usize| (0..s.joints()).all(|j| s.joint(j)[k] == s.joint(j)[k - 1]);
    (1..m.time_s.len()).filter(|&k| moves(k) && channels.iter().all(|s| same(s, k))).collect()
}

/// Rows that repeat the one before, or that are missing according to the time stamps.
fn repeated_or_missing(m: &Measurement, repeats: &[usize]) -> Option<Cause> {
    let missing: f64 = UsualStep::of(m.time_s)
        .map_or(0.0, |usual| (1..m.time_s.len()).map(|k| usual.missing_rows(m.time_s, k)).sum());
    let repeated = repeats.len() as f64;
    let share = |rows: f64| rows / (missing + m.time_s.len() as f64);
    let fraction = share(missing + repeated);
    (fraction > MISSED).then(|| {
        let fault = match [missing, repeated].map(|rows| share(rows) > MISSED) {
            [true, false] => RecordFault::MissingRows,
            [false, true] => RecordFault::RepeatedRows,
            _ => RecordFault::MissingOrRepeatedRows,
        };
        let parameters = [("fraction", Estimate::exact(fraction, ""))];
        Cause::of_the_record(fault, None, f64::INFINITY, &parameters)
    })
}

/// Joints (0-based) whose torque is too coarse for anything but this finding.
pub fn coarse_joints(faults: &[Cause]) -> Vec<usize> {
    let coarse = |f: &&Cause| f.kind == Kind::Quantisation && f.strength > TOO_COARSE;
    faults.iter().filter(coarse).filter_map(|f| f.joint).map(|j| j - 1).collect()
}

/// Least share of the rows whose torque is on a grid that counts as coarse. Readings that are wild, or hang, need not
/// be on it.
const ON_GRID: f64 = 0.9;

/// Torques that were `recorded` as whole multiples of a step that is coarse compared with the changes from sample to
/// sample of the `mended` ones. What was filled in or interpolated is on no grid, and what is wild changes too much.
fn quantisation(recorded: &JointSignals, mended: &JointSignals) -> Vec<Cause> {
    let of_joint = |j: usize| {
        let step = grid_step(recorded.joint(j))?;
        let y = mended.joint(j);
        let changes: Vec<f64> = y.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let rms = (changes.iter().map(|c| c * c).sum::<f64>() / changes.len() as f64).sqrt();
        (step > COARSE * rms).then(|| {
            let parameters = [("step", Estimate::exact(step, "Nm"))];
            Cause::of_the_record(RecordFault::CoarseTorque, Some(j), step / rms, &parameters)
        })
    };
    (0..recorded.joints()).filter_map(of_joint).collect()
}

/// Step of the grid on which the values of `y` are; `None` if there is none. Values that occur once do not count: on a
/// coarse grid, nearly all occur again.
fn grid_step(y: &[f64]) -> Option<f64> {
    let mut sorted = y.to_vec();
    sorted.sort_by(f64::total_cmp);
    let alike = sorted.chunk_by(|a, b| a == b).filter(|alike| alike.len() > 1);
    let repeated: Vec<(f64, usize)> = alike.map(|alike| (alike[0], alike.len())).collect();
    let (origin, _) = *repeated.iter().max_by_key(|(_, rows)| *rows)?;
    let gaps = repeated.windows(2).map(|w| w[1].0 - w[0].0);
    let step = gaps.fold(f64::INFINITY, f64::min);
    // The last digits of every value may contain the rounding of a decimal fraction.
    let on_grid = |(v, _): &&(f64, usize)| {
        let steps = (v - origin) / step;
        (steps - steps.round()).abs() * step <= 1e-9 * v.abs().max(origin.abs())
    };
    let rows: usize = repeated.iter().filter(on_grid).map(|(_, rows)| rows).sum();
    (repeated.len() > 2 && rows as f64 > ON_GRID * y.len() as f64).then_some(step)
}

/// The record's usual step, s.
pub(super) fn step_s(m: &Measurement) -> f64 {
    median_step(m.time_s).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 125.0;

    /// Two joints in a slow dance; the velocity channel is late by `lag_s`, and the clock loses 20 ms
    /// every `stall` rows.
    fn record(lag_s: f64, stall: Option<usize>) -> (Vec<f64>, [JointSignals; 3]) {
        let n = 4000;
        let time: Vec<f64> = (0..n).map(|k| k as f64 / RATE_HZ).collect();
        let true_time = |k: usize| time[k] + stall.map_or(0.0, |s| 0.02 * (k / s) as f64);
        let w = |j: usize| 1.1 + 0.7 * j as f64;
        let noise = |k: usize, j: usize| ((k * 7919 + j * 104_729) % 1009) as f64 / 1009.0 - 0.5;
        let q =
            JointSignals::from_fn(2, n, |j, k| (w(j) * true_time(k)).sin() + 1e-5 * noise(k, j));
        let qd = JointSignals::from_fn(2, n, |j, k| {
            w(j) * (w(j) * (true_time(k) - lag_s)).cos() + 1e-3 * noise(k, j + 2)
        });
        let torque = JointSignals::from_fn(2, n, |j, k| 10.0 * q.joint(j)[k] + noise(k, j + 4));
        (time, [q, qd, torque])
    }

    fn found(lag_s: f64, stall: Option<usize>) -> Vec<Cause> {
        let (time_s, signals) = record(lag_s, stall);
        find_in(&time_s, &signals).causes
    }

    fn find_in(time_s: &[f64], [q_rad, qd_rad_s, torque_nm]: &[JointSignals; 3]) -> Faults {
        find(&Measurement { source: "test", time_s, q_rad, qd_rad_s, torque_nm }, false).unwrap()
    }

    #[test]
    fn a_good_record_has_no_fault() {
        assert_eq!(found(0.0, None), []);
    }

    #[test]
    fn coarse_torque_is_found_with_its_step_and_fine_torque_is_not() {
        let (time_s, [q, qd, torque]) = record(0.0, None);
        let rounded = |step: f64| {
            let torque =
                torque.map_joints(|_, y| y.iter().map(|v| (v / step).round() * step).collect());
            find_in(&time_s, &[q.clone(), qd.clone(), torque]).causes
        };
        let coarse = rounded(0.8);
        assert_eq!(coarse.len(), 2, "both joints");
        for cause in coarse {
            assert_eq!(cause.kind, Kind::Quantisation);
            assert!((cause.parameters["step"].value - 0.8).abs() < 1e-9);
        }
        assert_eq!(rounded(0.01), []);
    }

    /// Rows that are filled in, readings that are wild, and readings that hang are on no grid.
    #[test]
    fn a_grid_is_seen_beside_values_that_are_not_on_it() {
        let (_, [_, _, torque]) = record(0.0, None);
        let coarse: Vec<f64> = torque.joint(0).iter().map(|v| (v / 0.8).round() * 0.8).collect();
        assert!((grid_step(&coarse).unwrap() - 0.8).abs() < 1e-9);
        let spoilt = |every: usize| {
            let value = |(k, v): (usize, &f64)| match k % every {
                0 => torque.joint(0)[k],
                1 => 333.3,
                _ => *v,
            };
            coarse.iter().enumerate().map(value).collect::<Vec<f64>>()
        };
        assert!((grid_step(&spoilt(25)).unwrap() - 0.8).abs() < 1e-9);
        // A grid for less than nine tenths of the rows is none.
        assert_eq!(grid_step(&spoilt(15)), None);
        assert_eq!(grid_step(torque.joint(0)), None);
        assert_eq!(grid_step(&[1.0; 100]), None);
    }

    #[test]
    fn a_late_velocity_is_found_to_a_tenth_of_a_millisecond() {
        let faults = found(0.004, None);
        assert_eq!(faults.len(), 1);
        assert_eq!((faults[0].kind, faults[0].joint), (Kind::VelocityLag, None));
        assert!((faults[0].parameters["delay_s"].value - 0.004).abs() < 1e-4);
    }

    /// A third joint is at rest and contains only noise. It does not speak against a lag common to all joints.
    #[test]
    fn a_joint_at_rest_contradicts_no_late_velocity() {
        let (time_s, signals) = record(0.004, None);
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut noise_sd = [1e-5, 1e-3, 0.3].into_iter();
        let three = signals.each_ref().map(|two| {
            let sd = noise_sd.next().unwrap();
            JointSignals::from_fn(3, time_s.len(), |j, k| match j {
                2 => sd * Distribution::<f64>::sample(&StandardNormal, &mut rng),
                _ => two.joint(j)[k],
            })
        });
        let faults = find_in(&time_s, &three).causes;
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert_eq!((faults[0].kind, faults[0].joint), (Kind::VelocityLag, None));
    }

    /// A time stamp that is late makes one step longer and the next one shorter: no time is lost.
    #[test]
    fn stamps_that_come_late_are_no_stalls() {
        let (mut time_s, signals) = record(0.0, None);
        for k in [1000, 2000, 3000] {
            time_s[k] += 0.005;
        }
        assert_eq!(find_in(&time_s, &signals).causes, []);
    }

    /// Ten rows are stamped when the row after them is written: the long step before them contains the time that their
    /// own steps lack.
    #[test]
    fn time_that_is_regained_is_no_stall() {
        let (mut time_s, signals) = record(0.0, None);
        for first in [1000, 2000, 3000] {
            let written_s = time_s[first + 10];
            for t in &mut time_s[first..first + 10] {
                *t += 0.98 * (written_s - *t);
            }
        }
        let faults = find_in(&time_s, &signals).causes;
        assert!(faults.iter().all(|fault| fault.kind != Kind::ClockFault), "{faults:?}");
    }

    /// Two of every five rows are missing.
    #[test]
    fn missing_rows_are_a_share_of_all_that_should_be_there() {
        let (time_s, signals) = record(0.0, None);
        let kept: Vec<usize> = (0..time_s.len()).filter(|k| k % 5 < 3).collect();
        let times: Vec<f64> = kept.iter().map(|k| time_s[*k]).collect();
        let signals = signals
            .each_ref()
            .map(|all| JointSignals::from_fn(2, kept.len(), |j, k| all.joint(j)[kept[k]]));
        let [q_rad, qd_rad_s, torque_nm] = &signals;
        let m = Measurement { source: "test", time_s: &times, q_rad, qd_rad_s, torque_nm };
        let cause = repeated_or_missing(&m, &[]).unwrap();
        assert!((cause.parameters["fraction"].value - 0.4).abs() < 1e-3);
    }

    #[test]
    fn a_clock_that_stalls_is_found_with_its_rhythm() {
        let faults = found(0.0, Some(250));
        let clock = faults.iter().find(|c| c.kind == Kind::ClockFault).unwrap();
        assert!((clock.parameters["lost_s"].value - 0.02).abs() < 1e-3);
        assert_eq!(clock.parameters["every_rows"].value, 250.0);
    }

    /// Lost time is given back: the last row is at its true time again.
    #[test]
    fn lost_time_is_given_back() {
        let (time_s, signals) = record(0.0, Some(250));
        let record = find_in(&time_s, &signals).record;
        let [shown, true_s] = [time_s[3999], time_s[3999] + 0.02 * 15.0];
        let given_back = record.time_s[3999];
        // Fifteen stalls, each known to better than a millisecond.
        assert!((given_back - true_s).abs() < 2e-3, "{shown} {given_back} {true_s}");
    }

    /// Every hundredth row is a copy of the one before: the copies are removed, and no other fault is found.
    #[test]
    fn rows_written_twice_are_taken_out() {
        let (time_s, signals) = record(0.0, None);
        let of = |k: usize| if k % 100 == 99 { k - 1 } else { k };
        let twice = signals.map(|s| JointSignals::from_fn(2, 4000, |j, k| s.joint(j)[of(k)]));
        let Faults { causes, record, .. } = find_in(&time_s, &twice);
        assert_eq!(causes.iter().map(|f| f.kind).collect::<Vec<_>>(), [Kind::DroppedSamples]);
        assert_eq!(causes[0].record_fault, Some(RecordFault::RepeatedRows));
        // Copies cannot be recognised where the arm is at rest.
        assert!((3960..3970).contains(&record.time_s.len()), "{}", record.time_s.len());
    }

    /// Of 4000 rows every hundredth is left out, a copy, or in turn one of both.
    #[test]
    fn missing_rows_are_told_from_copies() {
        let (time_s, signals) = record(0.0, None);
        let fault = |is_missing: fn(usize) -> bool, is_copy: fn(usize) -> bool| {
            let rows: Vec<usize> = (0..4000).filter(|k| !is_missing(*k)).collect();
            let time_s: Vec<f64> = rows.iter().map(|k| time_s[*k]).collect();
            let of = |k: usize| if is_copy(rows[k]) { rows[k] - 1 } else { rows[k] };
            let [q_rad, qd_rad_s, torque_nm] = &signals
                .each_ref()
                .map(|s| JointSignals::from_fn(2, rows.len(), |j, k| s.joint(j)[of(k)]));
            let m = Measurement { source: "test", time_s: &time_s, q_rad, qd_rad_s, torque_nm };
            repeated_or_missing(&m, &repeats(&m)).unwrap().record_fault.unwrap()
        };
        let is_hundredth = |k: usize| k % 100 == 99;
        assert_eq!(fault(is_hundredth, |_| false), RecordFault::MissingRows);
        assert_eq!(fault(|_| false, is_hundredth), RecordFault::RepeatedRows);
        let both = fault(|k| k % 200 == 99, |k| k % 200 == 199);
        assert_eq!(both, RecordFault::MissingOrRepeatedRows);
    }
}
