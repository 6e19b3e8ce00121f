//! Fills gaps in the log of a repeated motion with what the arm did at the same phase of other periods.
//!
//! A gap too long to be interpolated would end the record, and a log with five of them would keep only a fifth of its
//! rows. If the motion repeats, every missing row is replaced by the mean of the rows at its phase in the periods that
//! have them. Averaging over periods amounts to the same replacement, so the filled rows do not move any estimate. They
//! do reduce the scatter between periods by about the fraction of rows that are filled, a tenth at most, and the mean
//! is taken over fewer periods at these rows; see [`Prepared::count_filled`](crate::identify::Prepared::count_filled).

use std::f64::consts::SQRT_2;

use super::error::SignalError;
use super::instants::{Instants, linear_at};
use super::period::variance_of;
use super::period_search::find_period;
use super::resample::{Gap, Resampler, bridged_gap_s, gaps, natural_rate_hz};
use crate::median::robust_sigma;
use crate::robot::JointSignals;

/// Gaps shorter than this many usual steps are interpolated linearly. Longer ones can contain the reversal of a joint,
/// and then a straight line stands out against the other periods as a contact would.
const SHORT_STEPS: f64 = 2.5;
/// Largest fraction of the duration of a log that is filled.
const MOST: f64 = 0.1;
/// Shorter logs show no periods.
const FEWEST_ROWS: usize = 64;
/// Smallest number of other periods that provide a row. With a single one, the row would be a copy and the scatter
/// between the two periods zero.
const FEWEST: usize = 2;
/// Largest deviation of the arm from the other periods at both ends of a gap, relative to the rms of its angle about
/// the mean. If the deviation is larger, the arm waited during the gap or was driven elsewhere.
const REPEATS_WITHIN: f64 = 0.02;
/// The same relative to the noise of the angle, for a joint that is held and moves by nothing else; the larger of both
/// limits applies. Compared with the mean of three periods or more, one of the twelve readings at the ends of a gap
/// exceeds this limit in one of some 10⁴ gaps.
const REPEATS_BEYOND_NOISE: f64 = 5.0;

/// A log whose gaps are filled.
#[derive(Debug, Clone, PartialEq)]
pub struct Filled {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Angles, rad.
    pub q_rad: JointSignals,
    /// Velocities, rad/s.
    pub qd_rad_s: JointSignals,
    /// Torques, Nm.
    pub torque_nm: JointSignals,
    /// The gaps that have been filled.
    pub gaps: Vec<Gap>,
}

impl Filled {
    /// The message that tells a user what was filled.
    pub fn warning(&self) -> String {
        let length_s = |gap: &Gap| gap.end_s - gap.start_s;
        let longest = self.gaps.iter().max_by(|a, b| length_s(a).total_cmp(&length_s(b)));
        let from = longest.map_or_else(String::new, |gap| {
            format!(", the longest of {:.3} s from {:.2} s on", length_s(gap), gap.start_s)
        });
        format!(
            "{} gaps without samples, {:.2} s in all{from}: the mean of the other periods takes their place",
            self.gaps.len(),
            self.gaps.iter().map(length_s).sum::<f64>()
        )
    }
}

/// Fills the gaps of a log whose motion repeats.
///
/// `None` if no gap is too long to interpolate, or if the other periods cannot fill any.
///
/// Errors: time that does not increase, values that are not finite.
pub fn fill_gaps(
    time_s: &[f64],
    q_rad: &JointSignals,
    qd_rad_s: &JointSignals,
    torque_nm: &JointSignals,
) -> Result<Option<Filled>, SignalError> {
    if time_s.len() < FEWEST_ROWS || is_even(time_s) {
        return Ok(None);
    }
    let rate_hz = natural_rate_hz(time_s)?;
    let found = gaps(time_s, SHORT_STEPS / rate_hz);
    let missing_s: f64 = found.iter().map(|gap| gap.end_s - gap.start_s).sum();
    if found.is_empty() || missing_s > MOST * (time_s[time_s.len() - 1] - time_s[0]) {
        return Ok(None);
    }
    let angles = |longest_gap_s: f64| {
        let grid = Resampler::new(time_s, rate_hz, longest_gap_s)?;
        let angles = grid.instants().angles(q_rad, qd_rad_s)?;
        let longest = grid.longest_segment();
        Ok::<_, SignalError>((grid.time_s()[longest.start], angles.slice(longest)))
    };
    // The interpolation across a long gap may prevent the period from being found; the longest stretch without gaps may
    // be too short instead.
    let (mut start_s, bridged) = angles(f64::INFINITY)?;
    let mut period = find_period(&bridged)?;
    if period.is_none() {
        let longest;
        (start_s, longest) = angles(bridged_gap_s(rate_hz))?;
        period = if longest.samples() < FEWEST_ROWS { None } else { find_period(&longest)? };
    }
    let Some(period) = period else { return Ok(None) };
    let at_s = |sample: usize| start_s + sample as f64 / rate_hz;
    let log = Log {
        time_s,
        channels: [q_rad, qd_rad_s, torque_nm],
        gaps: &found,
        period_s: period.refined_samples / rate_hz,
        repeats_s: [at_s(period.window.start), at_s(period.window.end)],
        tolerance_rad: (0..q_rad.joints())
            .map(|j| tolerance_rad(bridged.joint(j), period.refined_samples))
            .collect(),
    };
    let patches: Vec<Patch> = found
        .iter()
        .filter_map(|gap| log.patch(gap, rate_hz).transpose())
        .collect::<Result<_, _>>()?;
    Ok((!patches.is_empty()).then(|| log.with(patches)))
}

/// How far the angles `q_rad` of a joint may deviate from those of other periods; a period has `samples` samples.
fn tolerance_rad(q_rad: &[f64], samples: f64) -> f64 {
    let repeating = (q_rad.len() as f64 - samples).max(0.0) as usize;
    let pairs = (0..repeating).map(|k| (q_rad[k] - linear_at(q_rad, k as f64 + samples)).abs());
    let noise = robust_sigma(&mut pairs.collect::<Vec<f64>>()) / SQRT_2;
    // The mean of equal numbers equals them only to within rounding.
    let largest = q_rad.iter().fold(0.0, |most: f64, q| most.max(q.abs()));
    let rounding = 8.0 * f64::EPSILON * largest;
    let moved = REPEATS_WITHIN * variance_of(q_rad).sqrt();
    moved.max(REPEATS_BEYOND_NOISE * noise).max(rounding)
}

/// Whether no step is a gap even compared with the shortest step, and hence none compared with the usual step. This
/// quick check settles most logs, of which thousands may be processed in a row.
fn is_even(time_s: &[f64]) -> bool {
    let ends = |[least, most]: [f64; 2], t: &[f64]| {
        let step_s = t[1] - t[0];
        [least.min(step_s), most.max(step_s)]
    };
    let [least_s, most_s] = time_s.windows(2).fold([f64::INFINITY, f64::NEG_INFINITY], ends);
    most_s <= SHORT_STEPS * least_s
}

/// The rows that fill one gap.
struct Patch {
    gap: Gap,
    time_s: Vec<f64>,
    /// Angles, velocities, torques.
    channels: [JointSignals; 3],
}

struct Log<'a> {
    time_s: &'a [f64],
    /// Angles, velocities, torques.
    channels: [&'a JointSignals; 3],
    gaps: &'a [Gap],
    period_s: f64,
    /// First and last time of the stretch that is known to repeat, s; run-in and rest lie outside.
    repeats_s: [f64; 2],
    /// Largest deviation of an angle that counts as repetition, per joint, rad.
    tolerance_rad: Vec<f64>,
}

impl Log<'_> {
    /// Computes the mean of the other periods in `gap`; `None` if too few have these rows, or if the arm did not repeat
    /// them.
    fn patch(&self, gap: &Gap, rate_hz: f64) -> Result<Option<Patch>, SignalError> {
        let steps = ((gap.end_s - gap.start_s) * rate_hz).round().max(1.0) as usize;
        let way = (gap.end_s - gap.start_s) / steps as f64;
        let instants: Vec<f64> = (0..=steps).map(|i| gap.start_s + i as f64 * way).collect();
        let [first, last] = self.repeats_s;
        // Negative if the gap itself lies before the repeated stretch, or after it.
        let before = ((gap.start_s - first) / self.period_s).floor() as i64;
        let after = ((last - gap.end_s) / self.period_s).floor() as i64;
        let mut sum =
            [(); 3].map(|()| JointSignals::zeros(self.tolerance_rad.len(), instants.len()));
        let mut periods = 0_usize;
        for shift in (-before..=after).filter(|shift| *shift != 0) {
            let shift_s = shift as f64 * self.period_s;
            let [start_s, end_s] = [gap.start_s + shift_s, gap.end_s + shift_s];
            let next = self.gaps.partition_point(|other| other.end_s <= start_s);
            if self.gaps.get(next).is_some_and(|other| other.start_s < end_s) {
                continue;
            }
            // Only the rows around the shifted gap are used: a log has many gaps, and each gap many periods.
            let begin = self.time_s.partition_point(|t| *t <= start_s).saturating_sub(1);
            let behind = self.time_s.partition_point(|t| *t < end_s) + 1;
            let rows = begin..behind.min(self.time_s.len());
            let shifted = instants.iter().map(|t| t + shift_s);
            let there = Instants::new(&self.time_s[rows.clone()], shifted)?;
            let [q_rad, qd_rad_s, torque_nm] =
                self.channels.map(|signals| signals.slice(rows.clone()));
            let values = [
                there.angles(&q_rad, &qd_rad_s)?,
                there.straight(&qd_rad_s)?,
                there.straight(&torque_nm)?,
            ];
            for (sum, values) in sum.iter_mut().zip(&values) {
                for j in 0..sum.joints() {
                    let both = sum.joint_mut(j).iter_mut().zip(values.joint(j));
                    both.for_each(|(sum, value)| *sum += value);
                }
            }
            periods += 1;
        }
        let mean = |sum: &JointSignals| {
            sum.map_joints(|_, y| y.iter().map(|v| v / periods as f64).collect())
        };
        let channels = sum.each_ref().map(mean);
        let repeats = [(0, gap.start_s), (steps, gap.end_s)].into_iter().all(|(i, t)| {
            let k = self.time_s.partition_point(|s| *s < t);
            let off = |j: usize| (channels[0].joint(j)[i] - self.channels[0].joint(j)[k]).abs();
            self.tolerance_rad.iter().enumerate().all(|(j, tolerance)| off(j) <= *tolerance)
        });
        if periods < FEWEST || !repeats {
            return Ok(None);
        }
        let inner = 1..steps;
        Ok(Some(Patch {
            gap: *gap,
            time_s: instants[inner.clone()].to_vec(),
            channels: channels.map(|signals| signals.slice(inner.clone())),
        }))
    }

    fn with(&self, patches: Vec<Patch>) -> Filled {
        // The origin of each row, the log or a patch, and its index there.
        let mut rows: Vec<(Option<&Patch>, usize)> = Vec::with_capacity(self.time_s.len());
        let mut next = patches.iter().peekable();
        for (k, t) in self.time_s.iter().enumerate() {
            rows.push((None, k));
            if let Some(patch) = next.next_if(|patch| patch.gap.start_s <= *t) {
                rows.extend((0..patch.time_s.len()).map(|i| (Some(patch), i)));
            }
        }
        let of = |channel: usize| {
            let whole = self.channels[channel];
            JointSignals::from_fn(whole.joints(), rows.len(), |j, row| match rows[row] {
                (None, k) => whole.joint(j)[k],
                (Some(patch), i) => patch.channels[channel].joint(j)[i],
            })
        };
        let time =
            |(patch, i): &(Option<&Patch>, usize)| patch.map_or(self.time_s, |p| &p.time_s)[*i];
        Filled {
            time_s: rows.iter().map(time).collect(),
            q_rad: of(0),
            qd_rad_s: of(1),
            torque_nm: of(2),
            gaps: patches.iter().map(|patch| patch.gap).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const RATE_HZ: f64 = 100.0;
    const PERIOD_S: f64 = 2.0;
    const ROWS: usize = 1000;

    /// One joint in a periodic motion of 2 s for 10 s, without the rows `left_out`; after row `paused` the motion is a
    /// tenth of a second late.
    fn log(left_out: &[std::ops::Range<usize>], paused: usize) -> (Vec<f64>, [JointSignals; 3]) {
        let kept: Vec<usize> =
            (0..ROWS).filter(|k| !left_out.iter().any(|gap| gap.contains(k))).collect();
        let w = std::f64::consts::TAU / PERIOD_S;
        let phase = |k: usize| w * (k as f64 / RATE_HZ - if k > paused { 0.1 } else { 0.0 });
        let of =
            |f: &dyn Fn(f64) -> f64| JointSignals::from_fn(1, kept.len(), |_, i| f(phase(kept[i])));
        let channels = [
            of(&|x| x.sin() + 0.3 * (2.0 * x).cos()),
            of(&|x| w * (x.cos() - 0.6 * (2.0 * x).sin())),
            of(&|x| 5.0 * (3.0 * x).sin()),
        ];
        (kept.iter().map(|k| *k as f64 / RATE_HZ).collect(), channels)
    }

    fn filled(left_out: &[std::ops::Range<usize>], paused: usize) -> Option<Filled> {
        let (time_s, [q, qd, torque]) = log(left_out, paused);
        fill_gaps(&time_s, &q, &qd, &torque).unwrap()
    }

    #[test]
    fn what_the_other_periods_have_is_put_in() {
        let gaps = [130..150, 517..560];
        let filled = filled(&gaps, ROWS).unwrap();
        let (time_s, whole) = log(&[], ROWS);
        assert_eq!(filled.gaps.len(), 2);
        assert_eq!(filled.time_s.len(), time_s.len());
        // The period is known to 1e-3 of a row, within which the torque changes by 5·3·π·1e-5 Nm.
        for (signals, whole) in [filled.q_rad, filled.qd_rad_s, filled.torque_nm].iter().zip(&whole)
        {
            let off = signals.joint(0).iter().zip(whole.joint(0)).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-3);
        }
        let off = filled.time_s.iter().zip(&time_s).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9);
    }

    /// The first 2 s, with the same motion at half the amplitude, do not count as a period.
    #[test]
    fn the_way_there_is_no_period() {
        let gap = 530..550;
        let (time_s, channels) = log(from_ref(&gap), ROWS);
        let [q, qd, torque] = channels.map(|signals| {
            let first = (PERIOD_S * RATE_HZ) as usize;
            let small = |k: usize, v: f64| if k < first { 0.5 * v } else { v };
            signals.map_joints(|_, y| y.iter().enumerate().map(|(k, v)| small(k, *v)).collect())
        });
        let filled = fill_gaps(&time_s, &q, &qd, &torque).unwrap().unwrap();
        let (_, [_, _, whole]) = log(&[], ROWS);
        for k in gap {
            let off = filled.torque_nm.joint(0)[k] - whole.joint(0)[k];
            assert!(off.abs() < 1e-3, "{off}");
        }
    }

    /// A joint that is held, with or without encoder noise, is no sign of a pause.
    #[test]
    fn a_joint_at_rest_repeats() {
        for noise_rad in [2e-5, 0.0] {
            let gaps = [130..150, 517..560];
            let (time_s, channels) = log(&gaps, ROWS);
            let mut rng = ChaCha8Rng::seed_from_u64(2);
            let mut held = |at: f64| -> Vec<f64> {
                let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
                time_s.iter().map(|_| at + noise_rad * noise()).collect()
            };
            let [q, qd, torque] = channels.map(|signals| {
                let both = [signals.joint(0).to_vec(), held(0.3)];
                JointSignals::from_fn(2, time_s.len(), |j, k| both[j][k])
            });
            let filled = fill_gaps(&time_s, &q, &qd, &torque).unwrap().unwrap();
            assert_eq!(filled.gaps.len(), 2);
        }
    }

    #[test]
    fn nothing_is_invented() {
        // A gap short enough for a straight line; too much missing; an arm that waited during the gap.
        assert_eq!(filled(from_ref(&(130..131)), ROWS), None);
        assert_eq!(filled(&[130..150, 300..400], ROWS), None);
        assert_eq!(filled(from_ref(&(500..530)), 515), None);
        // Four other periods have the rows of the first gap; only one has the rows that are missing in four of five
        // periods.
        let gaps = [105..118, 220..233, 420..433, 620..633, 820..833];
        let filled = filled(&gaps, ROWS).unwrap();
        assert_eq!(filled.gaps.len(), 1);
    }
}
