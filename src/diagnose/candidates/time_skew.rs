//! Torque recorded later than the motion by a delay d: τ(t − d) − τ(t), of one joint or of all.
//!
//! d is both the shape and the coefficient, because the change that a delay causes is divided by the delay. Where the
//! two disagree, another effect looks like a delay of that shape: drives with slow feedback lead or lag slightly more
//! at one reversal than at another, which is a sixteenth of the change by a delay of half a sample.
//!
//! Where a delay was found, a low-pass of first order is tried in its place, as drives smooth the torque that they
//! report: to first order in its time constant it is a delay by that time.

use super::*;
use crate::diagnose::lateness::Lateness;

/// See the module.
pub struct TimeSkew;

/// Starting delays, s. Where the drive leads of the null model absorb the first-order change by a delay, the remainder
/// is proportional to its square, and a shape d reaches delays from d/√3 to √3 d.
const DELAYS_S: [f64; 12] = [
    -0.04,
    -0.015,
    -5.5e-3,
    -2e-3,
    -7e-4,
    -SHORTEST_S,
    SHORTEST_S,
    7e-4,
    2e-3,
    5.5e-3,
    0.015,
    0.04,
];
/// Below this delay, s, the change is proportional to the delay, up to (ω d)²/6 = 0.15 % at 60 Hz, the highest
/// frequency at which drives are examined.
const SHORTEST_S: f64 = 2.5e-4;
/// Variant in which the torque is low-passed with the time constant of the shape.
pub const LOW_PASS: usize = 1;
/// Time constants of low-passes that are tried, relative to the delay that was found.
const TIME_CONSTANTS: [f64; 5] = [0.5, 0.7, 1.0, 1.4, 2.0];
/// Largest ratio of coefficient to shape; its inverse is the smallest.
const AGREES: f64 = 3.0;

impl Candidate for TimeSkew {
    fn kind(&self) -> Kind {
        Kind::TimeSkew
    }

    fn sites(&self, joints: usize) -> Vec<Option<usize>> {
        arm_and_joints(joints)
    }

    fn is_sum_of_joints(&self) -> bool {
        true
    }

    fn prior_odds(&self, site: Option<usize>) -> f64 {
        // Joints are recorded together: that a single one of six is late is a third as likely as that the whole arm is.
        if site.is_some() { 0.06 } else { 1.0 }
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        // A row is recorded at one time. In a single run, the torque of one joint of several that seems late is
        // friction that builds up after its reversals.
        if site.is_some() && scene.joints() > 1 && !scene.periodic {
            return Vec::new();
        }
        DELAYS_S.map(|value| Shape { variant: 0, value }).to_vec()
    }

    fn finer_shapes(&self, scene: &Scene, _: Option<usize>, shape: Shape) -> Vec<Shape> {
        // The low-pass of a single run is slower than that of a drive, and no low-pass is early.
        if !scene.periodic || shape.value <= 0.0 {
            return Vec::new();
        }
        let low_pass = |factor| Shape { variant: LOW_PASS, value: factor * shape.value };
        TIME_CONSTANTS.map(low_pass).to_vec()
    }

    /// To first order, both forms are one: a low-pass is named where it is twenty times as likely as a delay.
    fn alternatives(&self, _: &Scene, _: Option<usize>, shape: Shape) -> Option<f64> {
        (shape.variant == LOW_PASS).then_some(20.0 * DELAYS_S.len() as f64)
    }

    fn shape_is_coefficient(&self) -> bool {
        true
    }

    fn search(&self) -> Search {
        Search::Straight
    }

    fn blurs_reversals(&self) -> bool {
        true
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let lateness = match shape.variant {
            LOW_PASS => Lateness::LowPass(shape.value),
            _ => Lateness::Delay(shape.value),
        };
        let change = |j: usize| {
            let change = scene.change_nm(j, lateness);
            change.into_iter().map(|change| change / shape.value).collect()
        };
        vec![Column { parts: joints_at(scene, site).map(|j| (j, change(j))).collect() }]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("delay_s", b[0], "s")]
    }

    fn is_possible(&self, shape: Shape, b: &[f64]) -> bool {
        let ratio = b[0] / shape.value;
        let least = if shape.value.abs() <= SHORTEST_S { 0.0 } else { 1.0 / AGREES };
        (least..=AGREES).contains(&ratio)
    }

    fn separating_experiment(&self) -> &'static str {
        "a sharp tap on the standing arm: both channels must show it in the same sample"
    }

    fn in_words(&self) -> &'static str {
        "torque that is recorded later than the motion"
    }

    fn in_words_of(&self, _: Shape, b: &[f64]) -> &'static str {
        match b {
            [delay_s, ..] if *delay_s < 0.0 => "torque that is recorded earlier than the motion",
            _ => self.in_words(),
        }
    }

    fn form(&self, _: &Scene, shape: Shape) -> Option<&'static str> {
        (shape.variant == LOW_PASS).then_some("a low-pass of first order with this time constant")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_negative_delay_is_early() {
        let shape = Shape { variant: 0, value: 0.0 };
        assert!(TimeSkew.in_words_of(shape, &[-1e-3]).contains("earlier"));
        assert_eq!(TimeSkew.in_words_of(shape, &[1e-3]), TimeSkew.in_words());
    }

    /// Whether the change is proportional to the delay or to its square, some starting shape accepts every delay up to
    /// 60 ms. No shape accepts a delay that is a sixteenth of it or has the other sign.
    #[test]
    fn every_delay_begins_somewhere() {
        let is_taken =
            |shape: f64, b: f64| TimeSkew.is_possible(Shape { variant: 0, value: shape }, &[b]);
        for step in 0..200 {
            let delay = 1e-5 * (0.06_f64 / 1e-5).powf(f64::from(step) / 199.0);
            for delay in [-delay, delay] {
                assert!(DELAYS_S.iter().any(|d| is_taken(*d, delay)), "{delay}");
                if delay.abs() > SHORTEST_S {
                    assert!(DELAYS_S.iter().any(|d| is_taken(*d, delay * delay / d)), "{delay}");
                }
            }
        }
        assert!(!is_taken(-4.5e-3, -2.8e-4) && !is_taken(2e-3, -2e-3) && !is_taken(2e-4, -1e-4));
    }
}
