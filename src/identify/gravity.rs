//! Checks whether the gravity torque of a log is that of the robot the log is said to come from.
//!
//! Robots of one family differ in little but scale: a rigid model fits the log of a larger sister as well, with
//! larger masses. The identified masses can, however, be compared with the robot's description, and with a body on
//! its flange:
//!
//! g ≈ g₀ + P (m, m c),
//!
//! where g are the identified first moments of the base set, g₀ their values by the description, and P the columns of
//! the last body's mass and first moments.

use nalgebra::{DMatrix, DVector};

use super::covariance::Covariance;
use super::doubt::CERTAIN;
use super::quality::tells_the_arm;
use crate::base::BaseSet;
use crate::dynamics::{Parameter, ParameterLayout};
use crate::robot::Arm;

/// Comparison of the identified gravity with the described one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GravityMatch {
    /// Ratio of found to described gravity, by least squares over all first moments.
    pub ratio: f64,
    /// σ of the ratio.
    pub ratio_sigma: f64,
    /// Mass on the flange that explains the difference best, kg; not positive where no mass helps.
    pub body_kg: f64,
    /// Difference that remains with that body on the flange, as a share of the described first moments.
    pub left: f64,
}

/// A remark about gravity that differs from the description's.
#[derive(Debug, Clone, PartialEq)]
pub struct GravityRemark {
    /// The remark in words.
    pub text: String,
    /// Whether gravity is, beyond doubt, the described one with the opposite sign: no arm mounted as described has
    /// such gravity.
    pub is_reversed: bool,
}

/// Factor between found and described gravity beyond which a remark is made. Tolerances of drive gains and usual
/// bodies on the flange stay below it.
const OFF: f64 = 1.5;
/// Tolerance of the logarithm to base 1000 within which a ratio counts as a factor of 1000: it may be twice or half
/// as much.
const OFF_THOUSAND: f64 = 0.1;
/// Share of the described gravity that may remain if a body on the flange is to count as the explanation. Published
/// drive gains of one arm differ by as much.
const LEFT: f64 = 0.2;
/// Number of standard parameters of the last body through which a body on the flange changes gravity: mass and three
/// first moments.
const BODY: usize = 4;

impl GravityMatch {
    /// Compares the base parameters `theta`, known to `covariance`, with the `nominal` ones; `None` for a description
    /// without masses.
    pub fn of(
        arm: &Arm,
        set: &BaseSet,
        nominal: &[f64],
        theta: &[f64],
        covariance: &DMatrix<f64>,
    ) -> Option<Self> {
        let layout = ParameterLayout::new(arm.dof());
        let rows: Vec<usize> = set.first_moments(&layout).collect();
        let described = DVector::from_iterator(rows.len(), rows.iter().map(|&k| nominal[k]));
        let found = DVector::from_iterator(rows.len(), rows.iter().map(|&k| theta[k]));
        let square = described.norm_squared();
        if square == 0.0 {
            return None;
        }
        let columns: Vec<DVector<f64>> = (0..BODY)
            .map(|s| {
                let mut standard = vec![0.0; layout.count()];
                standard[layout.index(Parameter::Body(arm.dof() - 1, s))] = 1.0;
                let values = set.values(&standard);
                DVector::from_iterator(rows.len(), rows.iter().map(|&k| values[k]))
            })
            .collect();
        let body = DMatrix::from_columns(&columns);
        let more = &found - &described;
        // Where gravity cannot tell the body's parameters apart, the SVD picks the smallest solution.
        let x = body.clone().svd(true, true).solve(&more, f64::EPSILON.sqrt()).ok()?;
        let rest = if x[0] > 0.0 { &more - body * &x } else { more };
        let of_moments = covariance.select_rows(&rows).select_columns(&rows);
        let variance = described.dot(&(of_moments * &described)).max(0.0) / (square * square);
        Some(Self {
            ratio: described.dot(&found) / square,
            ratio_sigma: variance.sqrt(),
            body_kg: x[0],
            left: (rest.norm_squared() / square).sqrt(),
        })
    }

    /// A remark, if the ratio is outside of 1/[`OFF`] … [`OFF`] by more than `quantile` of its own σ.
    fn remark(&self, robot: &str, quantile: f64) -> Option<GravityRemark> {
        let doubt = quantile * self.ratio_sigma;
        let is_as_described = self.ratio - doubt < OFF && self.ratio + doubt > 1.0 / OFF;
        (!is_as_described).then(|| GravityRemark {
            text: self.in_words(robot),
            is_reversed: self.is_reversed() && self.ratio + CERTAIN * self.ratio_sigma < 0.0,
        })
    }

    /// Whether gravity is about as large as described, with the opposite sign.
    fn is_reversed(&self) -> bool {
        (1.0 / OFF..OFF).contains(&-self.ratio)
    }

    fn in_words(&self, robot: &str) -> String {
        let Self { ratio, body_kg, left, .. } = *self;
        let times = if (0.01..100.0).contains(&ratio.abs()) {
            format!("{ratio:.2}")
        } else {
            format!("{ratio:.1e}")
        };
        let far = format!("gravity torque is {times} times what the description of {robot} says");
        let thousands = ratio.abs().log10() / 3.0;
        if (thousands.abs() - 1.0).abs() < OFF_THOUSAND {
            let unit = if thousands > 0.0 {
                "(mA for A, mNm for Nm)"
            } else {
                "(kA for A, kNm for Nm), or its layout divides by 1000 where it should not"
            };
            format!("{far}: a current or torque is logged in another unit {unit}")
        } else if self.is_reversed() {
            format!(
                "{far}: torques or angles are logged with the other sign, or the arm hangs upside down and its description does not"
            )
        } else if body_kg > 0.0 && left < LEFT {
            format!(
                "{far}: a body of {body_kg:.1} kg on the flange would explain it, or drive gains that are off"
            )
        } else {
            let nearest = if body_kg > 0.0 {
                format!("a body of {body_kg:.1} kg on the flange, which comes nearest, leaves")
            } else {
                "no body on the flange explains".to_owned()
            };
            format!(
                "{far}, and {nearest} {:.0} % of it: this is the log of another robot, something pulls at the arm, its torques are currents or those of the motors, its currents are torques already (Nm), or the drive gains are off",
                100.0 * left
            )
        }
    }
}

/// A remark where the gravity torque of the identified base parameters `theta` is not that of the arm's description;
/// `None` as well where the log does not identify the masses.
pub fn gravity_remark(
    arm: &Arm,
    set: &BaseSet,
    nominal: &[f64],
    theta: &[f64],
    covariance: &Covariance,
) -> Option<GravityRemark> {
    if !tells_the_arm(arm, set, covariance) {
        return None;
    }
    let gravity = GravityMatch::of(arm, set, nominal, theta, &covariance.matrix)?;
    gravity.remark(&arm.name, covariance.quantile_95())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::dynamics::Model;

    fn described(robot: &str) -> (Arm, BaseSet, Vec<f64>) {
        let arm = Arm::built_in(robot).unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), true)).unwrap();
        let standard = Model::new(&arm).standard_parameters();
        (arm, set, standard)
    }

    /// ‖first moments‖ of base parameters.
    fn length_of_moments(set: &BaseSet, values: &[f64]) -> f64 {
        let is_moment = |k: &usize| set.name(*k).starts_with('m');
        (0..set.rank()).filter(is_moment).map(|k| values[k].powi(2)).sum::<f64>().sqrt()
    }

    #[test]
    fn a_body_on_the_flange_is_told_from_a_larger_robot() {
        let (arm, set, standard) = described("ur5e");
        let nominal = set.values(&standard);
        let known = DMatrix::zeros(set.rank(), set.rank());
        let own = GravityMatch::of(&arm, &set, &nominal, &nominal, &known).unwrap();
        assert!((own.ratio - 1.0).abs() < 1e-12 && own.remark("ur5e", 1.96).is_none());

        let layout = ParameterLayout::new(arm.dof());
        let mut loaded = standard.clone();
        loaded[layout.index(Parameter::Body(5, 0))] += 6.0;
        loaded[layout.index(Parameter::Body(5, 3))] += 6.0 * 0.05;
        let loaded = set.values(&loaded);
        let with_body = GravityMatch::of(&arm, &set, &nominal, &loaded, &known).unwrap();
        assert!((with_body.body_kg - 6.0).abs() < 1e-6 && with_body.left < 1e-6, "{with_body:?}");
        let remark = |found: GravityMatch| found.remark("ur5e", 1.96).unwrap();
        assert!(remark(with_body).text.contains("a body of 6.0 kg"));

        let (_, larger, standard) = described("ur10e");
        assert!((0..set.rank()).all(|k| set.name(k) == larger.name(k)), "of one family");
        let larger = larger.values(&standard);
        let other = GravityMatch::of(&arm, &set, &nominal, &larger, &known).unwrap();
        let other = remark(other);
        assert!(other.text.contains("another robot") && !other.is_reversed, "{other:?}");

        let turned: Vec<f64> = nominal.iter().map(|value| -value).collect();
        let turned = GravityMatch::of(&arm, &set, &nominal, &turned, &known).unwrap();
        let turned = remark(turned);
        assert!(turned.text.contains("the other sign") && turned.is_reversed, "{turned:?}");

        for (factor, unit) in [(1e-3, "kNm for Nm"), (1.3e3, "mNm for Nm")] {
            let scaled: Vec<f64> = nominal.iter().map(|value| factor * value).collect();
            let scaled = GravityMatch::of(&arm, &set, &nominal, &scaled, &known).unwrap();
            let remark = remark(scaled).text;
            assert!(remark.contains("another unit") && !remark.contains("0.00 times"), "{remark}");
            // What is logged in mNm and read as Nm is too large, not too small.
            assert!(remark.contains(unit), "{remark}");
        }

        // Where the first moments are hardly known, twice the gravity proves nothing about the robot. A common σ of
        // all first moments makes the σ of the ratio σ/‖described‖.
        let vague = DMatrix::identity(set.rank(), set.rank()) * 100.0;
        let doubtful = GravityMatch::of(&arm, &set, &nominal, &larger, &vague).unwrap();
        let expected = 10.0 / length_of_moments(&set, &nominal);
        assert!((doubtful.ratio_sigma - expected).abs() < 1e-9, "{doubtful:?}");
        assert!(doubtful.remark("ur5e", 1.96).is_none(), "{doubtful:?}");
    }
}
