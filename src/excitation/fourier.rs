//! The paper's finite Fourier series (24).

use std::f64::consts::TAU;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::error::{ExcitationError, positive};
use super::reference::Reference;
use crate::input::{read_text, without_mark};
use crate::robot::JointSignals;

/// Schema of trajectory files.
pub const TRAJECTORY_SCHEMA: &str = "armid.trajectory/1";

/// Fraction of the rms velocity that the omitted last harmonics of a fitted series may hold.
const LEFT_OUT: f64 = 1e-3;

/// Built-in trajectories, by the name given instead of a file.
const BUILT_IN: [(&str, &str); 2] = [
    ("ur5_identification", include_str!("../../trajectories/ur5_identification.json")),
    ("ur5_validation", include_str!("../../trajectories/ur5_validation.json")),
];

/// Names of the built-in trajectories.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

/// A periodic motion of all joints, the paper's (24) with one base frequency ω = 2π / period:
///
/// ```text
/// q_j(t) = q_j0 + Σ_l a_jl/(ω l) sin(ω l t) − b_jl/(ω l) cos(ω l t),   l = 1 … L
/// q̇_j(t) =        Σ_l a_jl cos(ω l t) + b_jl sin(ω l t)
/// q̈_j(t) =        Σ_l ω l (b_jl cos(ω l t) − a_jl sin(ω l t))
/// ```
///
/// `a` and `b` are velocities (rad/s), so position, velocity and acceleration are linear in the
/// coefficients, and every joint has the same order L.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FourierSeries {
    /// 2π/ω, s.
    pub period_s: f64,
    /// Offsets q_j0, rad.
    pub q0_rad: Vec<f64>,
    /// Cosine coefficients of the velocity, `[joint][l − 1]`, rad/s.
    pub a_rad_s: Vec<Vec<f64>>,
    /// Sine coefficients of the velocity, `[joint][l − 1]`, rad/s.
    pub b_rad_s: Vec<Vec<f64>>,
}

/// The contents of a trajectory file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TrajectoryFile {
    schema: String,
    period_s: f64,
    q0_rad: Vec<f64>,
    a_rad_s: Vec<Vec<f64>>,
    b_rad_s: Vec<Vec<f64>>,
    /// The program that wrote the file, and how the series was designed: information for readers of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    program: Option<serde_json::Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    design: Option<serde_json::Value>,
}

impl FourierSeries {
    /// Creates a series after checking its values: a positive period, finite coefficients, the same order for all
    /// joints.
    pub fn new(
        period_s: f64,
        q0_rad: Vec<f64>,
        a_rad_s: Vec<Vec<f64>>,
        b_rad_s: Vec<Vec<f64>>,
    ) -> Result<Self, ExcitationError> {
        positive("period_s", period_s)?;
        finite("q0_rad", &q0_rad)?;
        let expect = |what: String, found: usize, expected: usize| {
            if found == expected {
                Ok(())
            } else {
                Err(ExcitationError::Length { what, found, expected })
            }
        };
        expect("q0_rad".to_owned(), q0_rad.len(), a_rad_s.len().max(1))?;
        expect("a_rad_s".to_owned(), a_rad_s.len(), q0_rad.len())?;
        expect("b_rad_s".to_owned(), b_rad_s.len(), q0_rad.len())?;
        let order = a_rad_s[0].len();
        for (name, rows) in [("a_rad_s", &a_rad_s), ("b_rad_s", &b_rad_s)] {
            for (j, row) in rows.iter().enumerate() {
                let what = format!("{name} of joint {}", j + 1);
                finite(&what, row)?;
                expect(what, row.len(), order)?;
            }
        }
        Ok(Self { period_s, q0_rad, a_rad_s, b_rad_s })
    }

    /// Fits a series to one period of angles (n samples at `rate_hz`), with harmonics up to `highest_hz`. The last
    /// harmonics are left out if together they hold less than a thousandth of every joint's rms velocity.
    pub fn of_period(
        q_rad: &JointSignals,
        rate_hz: f64,
        highest_hz: f64,
    ) -> Result<Self, ExcitationError> {
        let n = q_rad.samples();
        let period_s = n as f64 / rate_hz;
        // If the product is a whole number, rounding must not lose the last harmonic.
        let order = ((highest_hz * period_s + 1e-9) as usize).min(n.saturating_sub(1) / 2);
        let coefficient = |j: usize, l: usize| {
            let (mut sine, mut cosine) = (0.0, 0.0);
            for (k, q) in q_rad.joint(j).iter().enumerate() {
                let (sin, cos) = (TAU * ((l * k) % n) as f64 / n as f64).sin_cos();
                sine += q * sin;
                cosine += q * cos;
            }
            let to_velocity = TAU * l as f64 / period_s * 2.0 / n as f64;
            (to_velocity * sine, -to_velocity * cosine)
        };
        let all: Vec<Vec<(f64, f64)>> =
            (0..q_rad.joints()).map(|j| (1..=order).map(|l| coefficient(j, l)).collect()).collect();
        let power = |harmonics: &[(f64, f64)]| -> f64 {
            harmonics.iter().map(|(a, b)| a * a + b * b).sum()
        };
        let enough = |joint: &Vec<(f64, f64)>, order: usize| {
            power(&joint[order..]) <= LEFT_OUT.powi(2) * power(joint)
        };
        let order = (0..order).find(|&l| all.iter().all(|joint| enough(joint, l))).unwrap_or(order);
        let pick = |part: fn(&(f64, f64)) -> f64| -> Vec<Vec<f64>> {
            all.iter().map(|joint| joint[..order].iter().map(part).collect()).collect()
        };
        let mean = |j: usize| q_rad.joint(j).iter().sum::<f64>() / n as f64;
        let q0_rad = (0..q_rad.joints()).map(mean).collect();
        Self::new(period_s, q0_rad, pick(|c| c.0), pick(|c| c.1))
    }

    /// Loads a built-in trajectory.
    pub fn built_in(name: &str) -> Result<Self, ExcitationError> {
        let (_, text) = BUILT_IN
            .iter()
            .find(|(known, _)| *known == name)
            .ok_or_else(|| ExcitationError::UnknownName { name: name.to_owned() })?;
        Self::from_json(text, name)
    }

    /// Loads a trajectory from a built-in name or a `.json` file.
    pub fn load(name_or_path: &str) -> Result<Self, ExcitationError> {
        let extension = Path::new(name_or_path).extension();
        if extension.is_none_or(|e| !e.eq_ignore_ascii_case("json")) {
            return Self::built_in(name_or_path);
        }
        let text = read_text(name_or_path)
            .map_err(|source| ExcitationError::File { file: name_or_path.to_owned(), source })?;
        Self::from_json(&text, name_or_path)
    }

    /// Parses the text of a trajectory file; `source` names it in messages.
    pub fn from_json(text: &str, source: &str) -> Result<Self, ExcitationError> {
        let text = without_mark(text);
        let json = |e: serde_json::Error| ExcitationError::Json {
            file: source.to_owned(),
            message: e.to_string(),
        };
        let value: serde_json::Value = serde_json::from_str(text).map_err(json)?;
        let found = value.get("schema").and_then(|s| s.as_str()).unwrap_or_default();
        if found != TRAJECTORY_SCHEMA {
            let found = found.to_owned();
            return Err(ExcitationError::Schema { file: source.to_owned(), found });
        }
        // Parsed again from the text, so that a wrong key is reported with its line.
        let file: TrajectoryFile = serde_json::from_str(text).map_err(json)?;
        Self::new(file.period_s, file.q0_rad, file.a_rad_s, file.b_rad_s)
    }

    /// The text of a trajectory file.
    pub fn to_json(&self) -> String {
        let file = TrajectoryFile {
            schema: TRAJECTORY_SCHEMA.to_owned(),
            period_s: self.period_s,
            q0_rad: self.q0_rad.clone(),
            a_rad_s: self.a_rad_s.clone(),
            b_rad_s: self.b_rad_s.clone(),
            program: None,
            design: None,
        };
        // The file holds only numbers and strings, so serialisation cannot fail.
        serde_json::to_string_pretty(&file).unwrap_or_default() + "\n"
    }

    /// Order L.
    pub fn order(&self) -> usize {
        self.a_rad_s[0].len()
    }

    /// Base frequency ω, rad/s.
    pub fn omega_rad_s(&self) -> f64 {
        TAU / self.period_s
    }

    /// The same motion with its start moved by `shift_s` into the period: `shifted.q(t) = q(t + shift_s)`.
    ///
    /// With φ = ω l shift: a' = a cos φ + b sin φ, b' = b cos φ − a sin φ.
    pub fn shifted(&self, shift_s: f64) -> Self {
        let mut out = self.clone();
        for (a_row, b_row) in out.a_rad_s.iter_mut().zip(&mut out.b_rad_s) {
            for (l, (a, b)) in a_row.iter_mut().zip(b_row.iter_mut()).enumerate() {
                let (sin, cos) = (self.omega_rad_s() * (l + 1) as f64 * shift_s).sin_cos();
                (*a, *b) = (*a * cos + *b * sin, *b * cos - *a * sin);
            }
        }
        out
    }
}

fn finite(what: &str, values: &[f64]) -> Result<(), ExcitationError> {
    match values.iter().find(|v| !v.is_finite()) {
        None => Ok(()),
        Some(&value) => {
            Err(ExcitationError::Value { what: what.to_owned(), value, must: "finite" })
        }
    }
}

impl Reference for FourierSeries {
    fn joints(&self) -> usize {
        self.q0_rad.len()
    }

    /// One period.
    fn duration_s(&self) -> f64 {
        self.period_s
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        q_rad.copy_from_slice(&self.q0_rad);
        qd_rad_s.fill(0.0);
        qdd_rad_s2.fill(0.0);
        for l in 0..self.order() {
            let wl = self.omega_rad_s() * (l + 1) as f64;
            let (sin, cos) = (wl * t_s).sin_cos();
            for j in 0..q_rad.len() {
                let (a, b) = (self.a_rad_s[j][l], self.b_rad_s[j][l]);
                q_rad[j] += (a * sin - b * cos) / wl;
                qd_rad_s[j] += a * cos + b * sin;
                qdd_rad_s2[j] += wl * (b * cos - a * sin);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_joints() -> FourierSeries {
        let a = vec![vec![0.3, -0.2, 0.1], vec![0.0, 0.5, -0.4]];
        let b = vec![vec![-0.1, 0.4, 0.2], vec![0.6, 0.0, 0.3]];
        FourierSeries::new(4.0, vec![0.5, -1.0], a, b).unwrap()
    }

    fn at(series: &impl Reference, t: f64) -> [[f64; 2]; 3] {
        let (mut q, mut qd, mut qdd) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        series.sample(t, &mut q, &mut qd, &mut qdd);
        [q, qd, qdd]
    }

    #[test]
    fn a_joint_without_coefficients_is_refused() {
        let refused = FourierSeries::new(4.0, vec![0.5], Vec::new(), Vec::new());
        assert!(matches!(refused, Err(ExcitationError::Length { found: 0, expected: 1, .. })));
    }

    /// Central differences of q and q̇ at h = 1e-5: truncation h²/6·max|q⁽³⁾| ≈ 1e-9 and round-off
    /// 1e-16/h = 1e-11, so 1e-8 is passed only by the true derivatives.
    #[test]
    fn velocity_and_acceleration_are_derivatives_of_the_position() {
        let series = two_joints();
        let h = 1e-5;
        for k in 0..50 {
            let t = 0.173 * k as f64;
            let (before, now, after) = (at(&series, t - h), at(&series, t), at(&series, t + h));
            for j in 0..2 {
                for d in 0..2 {
                    let slope = (after[d][j] - before[d][j]) / (2.0 * h);
                    assert!((slope - now[d + 1][j]).abs() < 1e-8, "t = {t}, derivative {d}");
                }
            }
        }
    }

    /// The paper's (24) typed out once more by hand, for one joint and one time.
    #[test]
    fn the_series_is_equation_24() {
        let series = FourierSeries::new(TAU, vec![0.25], vec![vec![1.0]], vec![vec![2.0]]).unwrap();
        let (mut q, mut qd, mut qdd) = ([0.0], [0.0], [0.0]);
        series.sample(TAU / 12.0, &mut q, &mut qd, &mut qdd);
        let (s, c) = (0.5, 3f64.sqrt() / 2.0);
        assert!((q[0] - (0.25 + s - 2.0 * c)).abs() < 1e-14);
        assert!((qd[0] - (c + 2.0 * s)).abs() < 1e-14);
        assert!((qdd[0] - (2.0 * c - s)).abs() < 1e-14);
    }

    /// Sums over a whole period are orthogonal to round-off.
    #[test]
    fn a_sampled_series_is_found_again() {
        let series = two_joints();
        let (rate_hz, n) = (50.0, 200);
        let q = JointSignals::from_fn(2, n, |j, k| at(&series, k as f64 / rate_hz)[0][j]);
        let found = FourierSeries::of_period(&q, rate_hz, 10.0).unwrap();
        assert_eq!((found.order(), found.period_s), (3, 4.0));
        let both = [(&found.a_rad_s, &series.a_rad_s), (&found.b_rad_s, &series.b_rad_s)];
        for (found, truth) in both {
            for (x, y) in found.iter().flatten().zip(truth.iter().flatten()) {
                assert!((x - y).abs() < 1e-13, "{x} {y}");
            }
        }
    }

    /// 0.29 Hz times 100 s is 28.999999999999996.
    #[test]
    fn the_highest_harmonic_is_not_lost_to_rounding() {
        let (rate_hz, n) = (1.0, 100);
        let highest = |k: usize| (TAU * 29.0 * k as f64 / n as f64).sin();
        let q = JointSignals::from_fn(1, n, |_, k| highest(k));
        assert!(0.29 * (n as f64 / rate_hz) < 29.0);
        let found = FourierSeries::of_period(&q, rate_hz, 0.29).unwrap();
        assert_eq!(found.order(), 29);
    }

    #[test]
    fn a_file_in_capitals_is_one() {
        let file = tempfile::Builder::new().suffix(".JSON").tempfile().unwrap();
        std::fs::write(file.path(), two_joints().to_json()).unwrap();
        let read = FourierSeries::load(file.path().to_str().unwrap()).unwrap();
        assert_eq!(read, two_joints());
    }

    #[test]
    fn a_shift_is_the_same_motion_started_later() {
        let series = two_joints();
        let later = series.shifted(1.3);
        for k in 0..20 {
            let t = 0.4 * k as f64;
            for (x, y) in at(&later, t).iter().flatten().zip(at(&series, t + 1.3).iter().flatten())
            {
                assert!((x - y).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn a_file_read_back_is_bit_for_bit_the_same_series() {
        let series = two_joints();
        assert_eq!(FourierSeries::from_json(&series.to_json(), "x").unwrap(), series);
        let marked = format!("\u{feff}{}", series.to_json());
        assert_eq!(FourierSeries::from_json(&marked, "x").unwrap(), series);
    }

    fn message_after(from: &str, to: &str) -> String {
        let text = two_joints().to_json();
        assert!(text.contains(from));
        FourierSeries::from_json(&text.replacen(from, to, 1), "x.json").unwrap_err().to_string()
    }

    #[test]
    fn bad_files_are_refused_with_the_reason() {
        assert!(message_after("\"period_s\": 4.0", "\"period_s\": 0.0").contains("positive"));
        assert!(message_after("period_s", "period").contains("line"));
        assert!(message_after("trajectory/1", "trajectory/0").contains("armid.trajectory/0"));
        assert!(message_after("0.3,\n", "").contains("joint"));
        assert!(message_after("0.3", "1e999").contains("x.json"));
        assert!(message_after("{", "").contains("x.json"));
        assert!(FourierSeries::from_json("[]", "x.json").is_err());
        assert!(FourierSeries::load("ur6").unwrap_err().to_string().contains("ur5_validation"));
        assert!(FourierSeries::load("no/such.json").is_err());
        assert!(FourierSeries::new(1.0, vec![], vec![], vec![]).is_err());
        assert!(FourierSeries::new(1.0, vec![f64::NAN], vec![vec![]], vec![vec![]]).is_err());
    }
}
