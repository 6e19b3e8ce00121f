//! Tears: places in a log at which the angles jump, as no arm can, from one row to the next, because the rows of
//! another recording follow. They end a run as a gap in time does.

use std::ops::Range;

use super::resample::bridged_gap_s;
use crate::median::median_step;

/// A joint that is farther than this from where its speed can have led belongs to another recording, rad. When a log is
/// read, rows may be off by as much.
const OTHER_RECORDING_RAD: f64 = 0.05;
/// Acceleration up to which a motion is plausible over a step, rad/s²; arms stay below about 20.
const ACCELERATION_RAD_S2: f64 = 20.0;
/// A recorder that hangs loses up to this time without its clock showing it, s. The motion then goes on.
const LOST_S: f64 = 0.25;
/// Steps on either side of a step from which the speed of a joint is taken.
const BESIDE: usize = 2;

/// The tears of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Tears {
    /// Rows that do not follow from the row before them, in ascending order.
    rows: Vec<usize>,
    /// Number of rows of the log.
    samples: usize,
}

impl Tears {
    /// Finds the tears of a log with increasing times `time_s` (s) and the angles of its `joints` (rad).
    ///
    /// A row is torn off if a joint is farther from the row before than it goes, at the larger of its speeds beside it,
    /// in this step, a quarter of a second and the time for which its reading hung before. The speeds are slopes of the
    /// angles; recorded velocities may be late, or none. Where readings hang again and again, because the recorder is
    /// faster than the sensor, they are slopes from one new reading to the next. A row that is wild by itself is no tear,
    /// because it makes the speeds beside it large. A step that is too long to be interpolated is a gap already.
    pub fn of(time_s: &[f64], joints: &[impl AsRef<[f64]>]) -> Self {
        let samples = time_s.len();
        let longest_s = median_step(time_s).map_or(0.0, |step_s| bridged_gap_s(1.0 / step_s));
        let is_torn = |k: &usize| {
            let step_s = time_s[*k] - time_s[k - 1];
            step_s <= longest_s && joints.iter().any(|q| is_torn(time_s, q.as_ref(), *k))
        };
        let inner = BESIDE + 1..samples.saturating_sub(BESIDE);
        let mut rows: Vec<usize> = inner.filter(is_torn).collect();
        // Joints that jump one row after the other are torn once: a run has rows whose slopes it shows.
        rows.dedup_by(|row, before| *row <= *before + BESIDE);
        Self {
            rows: without_glitches(rows, |first, last| comes_back(time_s, joints, first, last)),
            samples,
        }
    }

    /// Number of tears.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// Whether a tear is between the rows `first` and `last`.
    pub fn are_between(&self, first: usize, last: usize) -> bool {
        self.rows.partition_point(|row| *row <= first)
            < self.rows.partition_point(|row| *row <= last)
    }

    /// The rows from tear to tear to which `row` belongs: three or more, if the log has as many.
    pub fn run_of(&self, row: usize) -> Range<usize> {
        let next = self.rows.partition_point(|torn| *torn <= row);
        let start = next.checked_sub(1).map_or(0, |before| self.rows[before]);
        start..self.rows.get(next).copied().unwrap_or(self.samples)
    }

    /// The longest run of rows without a tear; the first of several that are equally long.
    pub fn longest_run(&self) -> Range<usize> {
        let starts = std::iter::once(0).chain(self.rows.iter().copied());
        let runs = starts.map(|row| self.run_of(row));
        runs.reduce(|longest, run| if run.len() > longest.len() { run } else { longest })
            .unwrap_or(0..self.samples)
    }
}

/// The torn `rows` without those of readings that are off for a moment: the recording is the same before and behind.
fn without_glitches(rows: Vec<usize>, comes_back: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::with_capacity(rows.len());
    let mut is_open = false;
    for row in rows {
        match kept.last() {
            Some(&last) if is_open && comes_back(last, row) => {
                kept.pop();
                is_open = false;
            }
            _ => {
                kept.push(row);
                is_open = true;
            }
        }
    }
    kept
}

/// Whether the motion goes on in row `last`, within a quarter of a second, from where it was before row `first`.
fn comes_back(time_s: &[f64], joints: &[impl AsRef<[f64]>], first: usize, last: usize) -> bool {
    let passed_s = time_s[last] - time_s[first - 1];
    let goes_on = |q: &[f64]| {
        let speed_rad_s = |k: usize| (q[k] - q[k - 1]).abs() / (time_s[k] - time_s[k - 1]);
        let fastest_rad_s = speed_rad_s(first - 1).max(speed_rad_s(last + 1));
        (q[last] - q[first - 1]).abs() <= OTHER_RECORDING_RAD + fastest_rad_s * passed_s
    };
    passed_s <= LOST_S && joints.iter().all(|q| goes_on(q.as_ref()))
}

/// Whether the angle `q` jumps from row `k` − 1 to row `k`.
fn is_torn(time_s: &[f64], q: &[f64], k: usize) -> bool {
    let way_rad = |k: usize| (q[k] - q[k - 1]).abs();
    if way_rad(k) <= OTHER_RECORDING_RAD {
        return false;
    }
    let step_s = |k: usize| time_s[k] - time_s[k - 1];
    let beside = (k - BESIDE..k).chain(k + 1..=k + BESIDE);
    let from_row_to_row = beside.map(|k| way_rad(k) / step_s(k));
    let new_readings = [new_readings_before(q, k), new_readings_from(q, k)].into_iter().flatten();
    let between_readings = new_readings.map(|rows| slower_rad_s(time_s, q, rows));
    let speed_rad_s = from_row_to_row.chain(between_readings).fold(0.0, f64::max);
    // From rest to rest, an acceleration a carries a joint by a Δt²/4.
    let accelerated_rad = ACCELERATION_RAD_S2 * step_s(k).powi(2) / 4.0;
    let unseen_s = time_s[k] - time_s[hung_since(q, k - 1)] + LOST_S;
    way_rad(k) > OTHER_RECORDING_RAD + accelerated_rad + speed_rad_s * unseen_s
}

/// The first of the rows up to `k` that all have the reading of row `k`.
fn hung_since(q: &[f64], k: usize) -> usize {
    (0..k).rev().take_while(|i| q[*i] == q[k]).last().unwrap_or(k)
}

/// The rows of the last three new readings in front of row `k`.
fn new_readings_before(q: &[f64], k: usize) -> Option<[usize; 3]> {
    let before = |k: usize| Some(hung_since(q, k.checked_sub(1)?));
    let last = before(k)?;
    let middle = before(last)?;
    Some([before(middle)?, middle, last])
}

/// The row `k` and those of the next two new readings.
fn new_readings_from(q: &[f64], k: usize) -> Option<[usize; 3]> {
    let behind = |k: usize| (k + 1..q.len()).find(|i| q[*i] != q[k]);
    let middle = behind(k)?;
    Some([k, middle, behind(middle)?])
}

/// The slower of the speeds between three new readings, in these `rows`, rad/s: of a joint at rest that was torn once
/// already, one of the two is hardly any.
fn slower_rad_s(time_s: &[f64], q: &[f64], [first, middle, last]: [usize; 3]) -> f64 {
    let speed_rad_s = |i: usize, k: usize| (q[k] - q[i]).abs() / (time_s[k] - time_s[i]);
    speed_rad_s(first, middle).min(speed_rad_s(middle, last))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 400 rows at 125 Hz of a joint that swings at up to 2 rad/s and one at rest, of which the second jumps by
    /// `jump_rad` at row 150.
    fn log(jump_rad: f64) -> (Vec<f64>, [Vec<f64>; 2]) {
        let time_s: Vec<f64> = (0..400).map(|k| 0.008 * f64::from(k)).collect();
        let swing = time_s.iter().map(|t| (2.0 * t).sin()).collect();
        let rest = (0..400).map(|k| if k < 150 { 0.3 } else { 0.3 + jump_rad }).collect();
        (time_s, [swing, rest])
    }

    fn found(time_s: &[f64], joints: &[Vec<f64>]) -> Vec<usize> {
        Tears::of(time_s, joints).rows
    }

    #[test]
    fn a_jump_ends_a_run() {
        for jump_rad in [0.1, -3.0] {
            let (time_s, joints) = log(jump_rad);
            let tears = Tears::of(&time_s, &joints);
            assert_eq!((&tears.rows[..], tears.count()), (&[150][..], 1));
            assert_eq!((tears.run_of(149), tears.run_of(150)), (0..150, 150..400));
            assert_eq!(tears.longest_run(), 150..400);
            assert!(tears.are_between(149, 150) && tears.are_between(0, 399));
            assert!(!tears.are_between(150, 399) && !tears.are_between(0, 149));
        }
        // The other joint jumps a row later.
        let (time_s, mut joints) = log(0.1);
        joints[0][151..].iter_mut().for_each(|q| *q += 3.0);
        assert_eq!(found(&time_s, &joints), [150]);
        // A joint at rest that jumps twice.
        let (time_s, mut joints) = log(0.5);
        joints[1][300..].iter_mut().for_each(|q| *q -= 0.5);
        assert_eq!(found(&time_s, &joints), [150, 300]);
        let (time_s, joints) = log(0.0);
        let whole = Tears::of(&time_s, &joints);
        assert_eq!((whole.count(), whole.longest_run(), whole.run_of(7)), (0, 0..400, 0..400));
    }

    /// A row that is wild, rows that are missing, time that a recorder lost without showing it, and readings that hung
    /// are no tears.
    #[test]
    fn other_faults_are_no_tears() {
        let (time_s, joints) = log(0.0);
        let mut wild = joints.clone();
        wild[1][200] = 2.0;
        assert!(found(&time_s, &wild).is_empty());
        let without = |from: usize, to: usize, y: &[f64]| [&y[..from], &y[to..]].concat();
        let missing = joints.each_ref().map(|q| without(100, 108, q));
        assert!(found(&without(100, 108, &time_s), &missing).is_empty());
        // 0.2 s of the swing at 2 rad/s: 0.4 rad in a step.
        let lost = joints.each_ref().map(|q| without(185, 210, q));
        assert!(found(&time_s[..375], &lost).is_empty());
        // Readings of 0.4 s in which the joint goes 0.7 rad.
        let mut hung = joints.clone();
        hung[0][150..200].fill(joints[0][149]);
        assert!(found(&time_s, &hung).is_empty());
        // A sensor that has a new reading for every sixth row, up to 0.1 rad from the one before.
        let mut slow = joints.clone();
        slow[0] = (0..400).map(|k| joints[0][k - k % 6]).collect();
        assert!(found(&time_s, &slow).is_empty());
        // A joint at rest whose encoder is off for twelve rows.
        let mut off = joints.clone();
        off[1][150..162].iter_mut().for_each(|q| *q += 0.3);
        assert!(found(&time_s, &off).is_empty());
        // A gap of a second, in which the joint at rest went elsewhere.
        let later = |(k, t): (usize, &f64)| if k < 150 { *t } else { t + 1.0 };
        let gap_s: Vec<f64> = time_s.iter().enumerate().map(later).collect();
        assert!(found(&gap_s, &log(1.0).1).is_empty());
    }

    #[test]
    fn a_log_without_rows_has_no_tears() {
        let tears = Tears::of(&[], &[Vec::<f64>::new()]);
        assert_eq!((tears.count(), tears.longest_run()), (0, 0..0));
    }
}
