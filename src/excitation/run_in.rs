//! Periods of a series, with smooth transitions from and to rest.

use super::error::{ExcitationError, positive};
use super::fourier::FourierSeries;
use super::limits::{Margin, Requirements, check};
use super::reference::Reference;
use crate::robot::Arm;

/// Durations tried for a run-in, s.
const RUN_INS_S: [f64; 8] = [0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0];

/// Whole periods of a series with a smooth start from rest.
///
/// The motion consists of a blend of `run_in_s`, then `periods` periods from phase 0 of the series, then a blend to
/// rest of `run_out_s` (0: the motion continues past the last period).
///
/// The blend of duration T leads from rest to the state (v, a) of the series at phase 0. Its velocity is the cubic with
/// q̇ = q̈ = 0 at the start and q̇ = v, q̈ = a at the end, with s = t/T:
///
/// ```text
/// q̇(s) = v (3s² − 2s³) + a T (s³ − s²)
/// q(s)  = q_start + T [ v (s³ − s⁴/2) + a T (s⁴/4 − s³/3) ]
/// ```
///
/// so the arm starts from q_start = q(0) − v T/2 + a T²/12, the pose from which only the speed has to be built up. The
/// run-out is the same blend backwards in time.
#[derive(Debug, Clone, PartialEq)]
pub struct Excitation {
    series: FourierSeries,
    run_in_s: f64,
    periods: usize,
    run_out_s: f64,
    join: State,
}

/// State of all joints at phase 0 of the series.
#[derive(Debug, Clone, PartialEq)]
struct State {
    q_rad: Vec<f64>,
    qd_rad_s: Vec<f64>,
    qdd_rad_s2: Vec<f64>,
}

impl Excitation {
    /// `periods` ≥ 1 periods of `series` after `run_in_s` > 0 seconds of run-in, no run-out.
    ///
    /// Limits are not checked here: see [`check`] and [`Excitation::fitted`].
    pub fn new(
        series: FourierSeries,
        run_in_s: f64,
        periods: usize,
    ) -> Result<Self, ExcitationError> {
        positive("run_in_s", run_in_s)?;
        positive("periods", periods as f64)?;
        let n = series.joints();
        let (mut q_rad, mut qd_rad_s, mut qdd_rad_s2) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        series.sample(0.0, &mut q_rad, &mut qd_rad_s, &mut qdd_rad_s2);
        let join = State { q_rad, qd_rad_s, qdd_rad_s2 };
        Ok(Self { series, run_in_s, periods, run_out_s: 0.0, join })
    }

    /// Chooses the run-in (and, with `run_out`, a run-out of the same duration) that keeps the largest fraction of the
    /// arm's limits free, among durations of 0.5 … 4 s.
    ///
    /// # Errors
    /// [`ExcitationError::PeriodPasses`] if the periods themselves exceed a limit of the arm,
    /// [`ExcitationError::NoRunIn`] if they do not but every run-in does.
    pub fn fitted(
        arm: &Arm,
        requirements: &Requirements,
        series: FourierSeries,
        periods: usize,
        run_out: bool,
    ) -> Result<Self, ExcitationError> {
        positive("periods", periods as f64)?;
        let (chosen, worst) = Self::calmest(arm, requirements, &series, 1, run_out)?;
        if worst.share >= 0.0 {
            return Ok(Self { periods, ..chosen });
        }
        let margins = check(arm, requirements, &series)?;
        if !margins.feasible() {
            let worst = margins.worst();
            return Err(ExcitationError::PeriodPasses {
                limit: worst.limit.to_string(),
                short: worst.shortfall_in_words(),
                time_s: worst.time_s,
                clearance_m: requirements.clearance_m,
                torque_percent: 100.0 * requirements.torque_share,
            });
        }
        let [shortest_s, .., longest_s] = RUN_INS_S;
        Err(ExcitationError::NoRunIn {
            shortest_s,
            longest_s,
            limit: worst.limit.to_string(),
            margin: worst.in_words(),
            time_s: worst.time_s,
        })
    }

    /// As [`Self::fitted`], for an arm that is only simulated.
    ///
    /// Nothing stops a simulated arm at a position, speed or acceleration limit (its drives still give no more than
    /// their torque). If the periods or all run-ins exceed a limit, the run-in is chosen by itself: the one with the
    /// largest margin or the smallest violation.
    pub fn fitted_without_limits(
        arm: &Arm,
        requirements: &Requirements,
        series: FourierSeries,
        periods: usize,
    ) -> Result<Self, ExcitationError> {
        match Self::fitted(arm, requirements, series.clone(), periods, false) {
            Err(ExcitationError::PeriodPasses { .. } | ExcitationError::NoRunIn { .. }) => {
                let (chosen, _) = Self::calmest(arm, requirements, &series, 0, false)?;
                Ok(Self { periods, ..chosen })
            }
            fitted => fitted,
        }
    }

    /// Finds the run-in (with `run_out` together with an equally long run-out) that, combined with `periods` periods or
    /// none, has the largest smallest margin; returns it with that margin.
    fn calmest(
        arm: &Arm,
        requirements: &Requirements,
        series: &FourierSeries,
        periods: usize,
        run_out: bool,
    ) -> Result<(Self, Margin), ExcitationError> {
        let candidate = |run_in_s: f64| -> Result<(Self, Margin), ExcitationError> {
            let mut candidate = Self { periods, ..Self::new(series.clone(), run_in_s, 1)? };
            if run_out {
                candidate = candidate.with_run_out(run_in_s)?;
            }
            let worst = check(arm, requirements, &candidate)?.worst().clone();
            Ok((candidate, worst))
        };
        let [first_s, longer_s @ ..] = RUN_INS_S;
        let mut best = candidate(first_s)?;
        for run_in_s in longer_s {
            let next = candidate(run_in_s)?;
            if next.1.share > best.1.share {
                best = next;
            }
        }
        Ok(best)
    }

    /// The same motion, brought to rest within `run_out_s` > 0 seconds after the last period.
    pub fn with_run_out(self, run_out_s: f64) -> Result<Self, ExcitationError> {
        positive("run_out_s", run_out_s)?;
        Ok(Self { run_out_s, ..self })
    }

    /// The same motion with `periods` periods, at least one.
    pub fn with_periods(self, periods: usize) -> Self {
        Self { periods: periods.max(1), ..self }
    }

    /// The periodic motion.
    pub fn series(&self) -> &FourierSeries {
        &self.series
    }

    /// Duration of the run-in, s.
    pub fn run_in_s(&self) -> f64 {
        self.run_in_s
    }

    /// Number of whole periods.
    pub fn periods(&self) -> usize {
        self.periods
    }

    /// Begin and end of the whole periods, s.
    pub fn periodic_window_s(&self) -> [f64; 2] {
        [self.run_in_s, self.run_in_s + self.periods as f64 * self.series.period_s]
    }

    /// The pose at rest from which the motion starts, rad.
    pub fn start_rad(&self) -> Vec<f64> {
        let mut state = self.join.clone();
        self.sample(0.0, &mut state.q_rad, &mut state.qd_rad_s, &mut state.qdd_rad_s2);
        state.q_rad
    }

    /// Evaluates the blend of `duration_s` at the time `left_s` before its moving end. Backwards in time (`direction` =
    /// −1) the velocity changes sign and the acceleration does not.
    fn blend(&self, duration_s: f64, left_s: f64, direction: f64, out: [&mut [f64]; 3]) {
        let [q, qd, qdd] = out;
        let s = (1.0 - left_s / duration_s).max(0.0);
        let (s2, s3, s4) = (s * s, s * s * s, s * s * s * s);
        for j in 0..q.len() {
            let v = direction * self.join.qd_rad_s[j];
            let at = self.join.qdd_rad_s2[j] * duration_s;
            // Both brackets of q are taken relative to s = 1, where q is that of the series.
            q[j] = self.join.q_rad[j]
                + duration_s
                    * (v * (s3 - s4 / 2.0 - 0.5) + at * (s4 / 4.0 - s3 / 3.0 + 1.0 / 12.0));
            qd[j] = direction * (v * (3.0 * s2 - 2.0 * s3) + at * (s3 - s2));
            qdd[j] = (v * 6.0 * (s - s2) + at * (3.0 * s2 - 2.0 * s)) / duration_s;
        }
    }
}

impl Reference for Excitation {
    fn joints(&self) -> usize {
        self.series.joints()
    }

    fn duration_s(&self) -> f64 {
        self.periodic_window_s()[1] + self.run_out_s
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        let [begin_s, end_s] = self.periodic_window_s();
        let out = [&mut *q_rad, &mut *qd_rad_s, &mut *qdd_rad_s2];
        if t_s < begin_s {
            self.blend(self.run_in_s, begin_s - t_s, 1.0, out);
        } else if t_s > end_s && self.run_out_s > 0.0 {
            self.blend(self.run_out_s, t_s - end_s, -1.0, out);
        } else {
            self.series.sample(t_s - begin_s, q_rad, qd_rad_s, qdd_rad_s2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn excitation() -> Excitation {
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        Excitation::new(series, 1.5, 2).unwrap().with_run_out(1.0).unwrap()
    }

    fn at(r: &impl Reference, t: f64) -> [Vec<f64>; 3] {
        let [mut q, mut qd, mut qdd] = std::array::from_fn(|_| vec![0.0; r.joints()]);
        r.sample(t, &mut q, &mut qd, &mut qdd);
        [q, qd, qdd]
    }

    #[test]
    fn starts_and_ends_at_rest() {
        let e = excitation();
        for t in [0.0, e.duration_s(), e.duration_s() + 3.0] {
            let [_, qd, qdd] = at(&e, t);
            assert!(qd.iter().chain(&qdd).all(|x| x.abs() < 1e-12), "t = {t}");
        }
        assert_eq!(e.start_rad(), at(&e, 0.0)[0]);
    }

    /// Across the joins q, q̇ and q̈ change by no more than the next derivative allows: with
    /// |q⃛| < 100 rad/s³ a step of 2e-9 s changes nothing by more than 2e-7.
    #[test]
    fn joins_without_a_jump() {
        let e = excitation();
        for t in e.periodic_window_s() {
            for (before, after) in at(&e, t - 1e-9).iter().zip(&at(&e, t + 1e-9)) {
                for (x, y) in before.iter().zip(after) {
                    assert!((x - y).abs() < 2e-7, "t = {t}: {x} {y}");
                }
            }
        }
    }

    /// Central differences with h = 1e-5 s, |q⃛| and |q⃜| below 1e3: truncation below 2e-8.
    #[test]
    fn velocity_and_acceleration_are_derivatives_in_the_blends() {
        let e = excitation();
        let h = 1e-5;
        let end = e.periodic_window_s()[1];
        for t in [0.2, 0.75, 1.3, end + 0.1, end + 0.5, end + 0.9] {
            let (before, now, after) = (at(&e, t - h), at(&e, t), at(&e, t + h));
            for j in 0..6 {
                for d in 0..2 {
                    let slope = (after[d][j] - before[d][j]) / (2.0 * h);
                    assert!((slope - now[d + 1][j]).abs() < 1e-7, "t = {t}, derivative {d}");
                }
            }
        }
    }

    #[test]
    fn every_period_is_the_same() {
        let e = excitation();
        let (first, second) = (at(&e, 1.5 + 3.3), at(&e, 1.5 + 3.3 + e.series().period_s));
        for (x, y) in first.iter().flatten().zip(second.iter().flatten()) {
            assert!((x - y).abs() < 1e-12);
        }
    }

    /// A period that exceeds the allowed part of the torque is refused for that reason, but can still be simulated.
    #[test]
    fn a_period_that_passes_a_limit_itself_is_named() {
        let arm = Arm::built_in("ur5").unwrap();
        let series = || FourierSeries::built_in("ur5_identification").unwrap();
        let strict = Requirements { torque_share: 0.1, ..Requirements::default() };
        let refused = Excitation::fitted(&arm, &strict, series(), 2, false).unwrap_err();
        assert!(matches!(refused, ExcitationError::PeriodPasses { .. }), "{refused}");
        let message = refused.to_string();
        assert!(message.contains("torque of joint") && message.contains("10 %"), "{message}");
        let simulated = Excitation::fitted_without_limits(&arm, &strict, series(), 2).unwrap();
        assert_eq!((simulated.series(), simulated.periods()), (&series(), 2));
        // If the limits are kept, both functions agree.
        let usual = Requirements::default();
        assert_eq!(
            Excitation::fitted_without_limits(&arm, &usual, series(), 2).unwrap(),
            Excitation::fitted(&arm, &usual, series(), 2, false).unwrap()
        );
    }

    /// Joint 1 oscillates by ±0.1 rad within ±0.105 rad and is fastest where the period begins: the shortest run-in
    /// starts v T/2 = 0.157 rad away.
    #[test]
    fn a_period_within_its_limits_that_none_leads_into_is_told_apart() {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[0].limits.position_rad = [-0.105, 0.105];
        let tau = std::f64::consts::TAU;
        let mut a = vec![vec![0.0]; 6];
        a[0] = vec![0.1 * tau];
        let q0 = vec![0.0, -1.2, 0.0, -1.5, 0.3, 0.0];
        let series = FourierSeries::new(1.0, q0, a, vec![vec![0.0]; 6]).unwrap();
        let requirements = Requirements::default();
        let refused = Excitation::fitted(&arm, &requirements, series.clone(), 1, false);
        assert!(matches!(refused, Err(ExcitationError::NoRunIn { .. })), "{refused:?}");
        let simulated = Excitation::fitted_without_limits(&arm, &requirements, series, 1).unwrap();
        assert_eq!(simulated.run_in_s(), 0.5);
    }

    #[test]
    fn impossible_durations_are_refused() {
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        for (run_in_s, periods) in [(0.0, 1), (-1.0, 1), (f64::NAN, 1), (1.0, 0)] {
            assert!(Excitation::new(series.clone(), run_in_s, periods).is_err());
        }
        assert!(excitation().with_run_out(0.0).is_err());
    }
}
