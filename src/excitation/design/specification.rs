//! The specification of a design, checked before anything runs.

use faer::Mat;

use super::criterion::Criterion;
use super::error::DesignError;
use super::prediction::Experiment;
use super::space::Variables;
use crate::excitation::error::{positive, readable};
use crate::excitation::{ClearanceModel, FourierSeries, Requirements, check};
use crate::robot::Arm;

/// Specification of a design.
#[derive(Debug, Clone, PartialEq)]
pub struct Specification {
    /// The criterion that is minimised.
    pub criterion: Criterion,
    /// The variables over which it is minimised.
    pub variables: Variables,
    /// Requirements beyond the limits of the arm.
    pub requirements: Requirements,
    /// The experiment that the design is for.
    pub experiment: Experiment,
    /// Prior information on the base parameters: the inverse of their covariance, in the order of the base set, with
    /// rows and columns of zeros for unknown parameters.
    pub prior: Option<Mat<f64>>,
    /// Number of random starts.
    pub starts: usize,
    /// Number of starts that are refined to the end.
    pub finalists: usize,
    /// Seed of the starts.
    pub seed: u64,
}

/// Largest number of samples of a period; more would be of no use: this is 1000 s at 1 kHz.
const MOST_SAMPLES: f64 = 1e6;
/// Largest order; higher ones would be of no use: with six joints this is 1200 variables.
const HIGHEST_ORDER: usize = 100;
/// Largest number of starts; this many take hours.
const MOST_STARTS: usize = 100_000;
/// Smallest and largest torque noise, Nm: beyond that of any drive. Its weights 1/σ² can still be calculated with.
const NOISE_NM: [f64; 2] = [1e-9, 1e9];
/// Longest data, s: one day, whose samples fill gigabytes.
pub const LONGEST_S: f64 = 86_400.0;

impl Specification {
    /// Checks that the specification can be met by `arm`.
    pub fn check(&self, arm: &Arm) -> Result<(), DesignError> {
        let v = &self.variables;
        positive("the period", v.period_s)?;
        positive("the length of the data", self.experiment.data_s)?;
        positive("the sampling rate", self.experiment.rate_hz)?;
        let longest_s = v.period_range_s.map_or(v.period_s, |[_, high]| high.max(v.period_s));
        let samples = longest_s * self.experiment.rate_hz;
        if samples > MOST_SAMPLES {
            let (what, must) = (
                "the number of samples of a period".to_owned(),
                format!("at most {MOST_SAMPLES:.0}"),
            );
            return Err(DesignError::Value { what, value: samples, must });
        }
        let data_s = self.experiment.data_s;
        if data_s > LONGEST_S {
            let (what, must) =
                ("the length of the data".to_owned(), format!("at most {LONGEST_S:.0} s"));
            return Err(DesignError::Value { what, value: data_s, must });
        }
        at_least("the order", v.order, if v.rest_start { 2 } else { 1 })?;
        at_least("the number of starts", self.starts, 1)?;
        at_most("the number of starts", self.starts, MOST_STARTS, "")?;
        at_least("the number of finalists", self.finalists, 1)?;
        if let Some([low, high]) = v.period_range_s {
            positive("the shortest period", low)?;
            if !(low..=high).contains(&v.period_s) || low >= high {
                return Err(DesignError::Value {
                    what: "the period".into(),
                    value: v.period_s,
                    must: format!("inside its range of {} … {} s", readable(low), readable(high)),
                });
            }
        }
        let shortest_s = v.period_range_s.map_or(v.period_s, |[low, _]| low);
        let rate_hz = self.experiment.rate_hz;
        // At half the sampling rate the samples show no sine component, so the order must stay below that harmonic.
        let seen = ((0.5 * rate_hz * shortest_s - 1e-9).ceil() as usize).saturating_sub(1);
        let [rate, shortest] = [rate_hz, shortest_s].map(readable);
        let why = format!(": {rate} Hz show no higher harmonics of {shortest} s");
        at_most("the order", v.order, seen, &why)?;
        at_most("the order", v.order, HIGHEST_ORDER, "")?;
        if self.prior.is_some() && !self.criterion.whitened() {
            return Err(DesignError::PriorUnused);
        }
        let clearance_m = self.requirements.clearance_m;
        if !(clearance_m >= 0.0 && clearance_m.is_finite()) {
            let (what, must) = ("the clearance".to_owned(), "finite and not negative".to_owned());
            return Err(DesignError::Value { what, value: clearance_m, must });
        }
        if let Some((limit, most_m)) = ClearanceModel::new(arm).never_kept(arm, clearance_m) {
            let limit = limit.to_string();
            return Err(DesignError::NeverClear { limit, most_m, clearance_m });
        }
        let share = self.requirements.torque_share;
        if !(share > 0.0 && share <= 1.0) {
            let what = "the share of the torque".to_owned();
            return Err(DesignError::Value { what, value: share, must: "in (0, 1]".into() });
        }
        per_joint(arm, "torque noise", self.experiment.torque_noise_nm.len())?;
        for (j, &sigma) in self.experiment.torque_noise_nm.iter().enumerate() {
            let what = format!("the torque noise of joint {}", j + 1);
            positive(&what, sigma)?;
            let [least, most] = NOISE_NM;
            if !(least..=most).contains(&sigma) {
                let must = format!("in {least:e} … {most:e} Nm");
                return Err(DesignError::Value { what, value: sigma, must });
            }
        }
        per_joint(arm, "offsets", v.fixed_offsets_rad.len())?;
        for (j, (offset, joint)) in v.fixed_offsets_rad.iter().zip(&arm.joints).enumerate() {
            let [low, high] = joint.limits.position_rad;
            if let Some(value) = *offset
                && !(low..=high).contains(&value)
            {
                return Err(DesignError::Value {
                    what: format!("the offset of joint {}", j + 1),
                    value,
                    must: format!("inside the joint's limits of {low:.4} … {high:.4} rad"),
                });
            }
        }
        self.check_fixed_pose(arm)
    }

    /// Checks the pose given by the offsets if all of them are fixed: the motion passes near that pose, so if the arm
    /// may not stand there, no amplitude is small enough.
    fn check_fixed_pose(&self, arm: &Arm) -> Result<(), DesignError> {
        let fixed: Option<Vec<f64>> = self.variables.fixed_offsets_rad.iter().copied().collect();
        let Some(q0_rad) = fixed else { return Ok(()) };
        let still = vec![vec![]; arm.dof()];
        let pose = FourierSeries::new(1.0, q0_rad, still.clone(), still)?;
        let margins = check(arm, &self.requirements, &pose)?;
        if margins.feasible() {
            return Ok(());
        }
        let worst = margins.worst();
        let short = worst.shortfall_in_words();
        Err(DesignError::FixedPose { limit: worst.limit.clone(), short })
    }
}

fn at_least(what: &str, value: usize, least: usize) -> Result<(), DesignError> {
    if value >= least {
        return Ok(());
    }
    let must = format!("at least {least}");
    Err(DesignError::Value { what: what.to_owned(), value: value as f64, must })
}

fn at_most(what: &str, value: usize, most: usize, why: &str) -> Result<(), DesignError> {
    if value <= most {
        return Ok(());
    }
    let must = format!("at most {most}{why}");
    Err(DesignError::Value { what: what.to_owned(), value: value as f64, must })
}

fn per_joint(arm: &Arm, what: &'static str, found: usize) -> Result<(), DesignError> {
    if found == arm.dof() {
        return Ok(());
    }
    Err(DesignError::Length { what, found, arm: arm.name.clone(), dof: arm.dof() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(change: impl Fn(&mut Specification)) -> Option<String> {
        let arm = Arm::built_in("ur5").unwrap();
        let mut spec = Specification {
            criterion: Criterion::D,
            variables: Variables {
                order: 5,
                period_s: 10.0,
                period_range_s: None,
                fixed_offsets_rad: vec![None; 6],
                rest_start: false,
            },
            requirements: Requirements::default(),
            experiment: Experiment { data_s: 80.0, rate_hz: 125.0, torque_noise_nm: vec![1.0; 6] },
            prior: None,
            starts: 48,
            finalists: 4,
            seed: 1,
        };
        change(&mut spec);
        spec.check(&arm).err().map(|error| error.to_string())
    }

    /// Half of 125 Hz is the 25th harmonic of a period of 0.4 s, and the shortest period decides.
    #[test]
    fn harmonics_that_no_sample_shows_are_refused() {
        let of = |order: usize, period_s: f64, period_range_s: Option<[f64; 2]>| {
            refused(|spec| {
                spec.variables.order = order;
                spec.variables.period_s = period_s;
                spec.variables.period_range_s = period_range_s;
            })
        };
        assert_eq!(of(24, 0.4, None), None);
        let above = of(25, 0.4, None).unwrap();
        assert!(above.contains("the order = 25 must be at most 24: 125 Hz"), "{above}");
        assert_eq!(of(25, 0.408, None), None);
        assert_eq!(of(24, 10.0, Some([0.4, 20.0])), None);
        assert!(of(25, 10.0, Some([0.4, 20.0])).unwrap().contains("at most 24"));
    }

    #[test]
    fn noise_that_no_drive_has_is_refused() {
        let of = |sigma: f64| refused(|spec| spec.experiment.torque_noise_nm[3] = sigma);
        for sigma in NOISE_NM {
            assert_eq!(of(sigma), None);
        }
        let expected =
            |value: &str| format!("the torque noise of joint 4 = {value} must be in 1e-9 … 1e9 Nm");
        assert_eq!(of(1e-300).unwrap(), expected("1.00000e-300"));
        assert_eq!(of(1e300).unwrap(), expected("1.00000e300"));
    }

    #[test]
    fn what_would_fill_the_memory_is_refused() {
        assert_eq!(refused(|spec| spec.variables.order = HIGHEST_ORDER), None);
        let order = refused(|spec| spec.variables.order = HIGHEST_ORDER + 1).unwrap();
        assert!(order.contains("the order = 101 must be at most 100"), "{order}");
        let starts = refused(|spec| spec.starts = usize::MAX).unwrap();
        assert!(starts.contains("the number of starts"), "{starts}");
    }
}
