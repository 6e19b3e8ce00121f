//! Possible differences between an arm and a simulation of it, and the torque that each of them adds.
//!
//! A body on the flange adds X K δ, with δ its ten inertial parameters and K the map to base parameters. Another
//! friction adds multiples of the friction columns, and a wrong torque constant a share of the recorded torque. A change
//! of gravity, tilt or length adds the difference that it makes to the inverse dynamics of the arm.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use crate::base::BaseSet;
use crate::diagnose::candidates::{Candidate, Quantity, Shape};
use crate::diagnose::delta_method::with_reach;
use crate::diagnose::image::Image;
use crate::diagnose::kind::Kind;
use crate::diagnose::scene::Scene;
use crate::diagnose::study::Study;
use crate::diagnose::verdict::Estimate;
use crate::dynamics::{Parameter, ParameterLayout};
use crate::robot::JointSignals;

/// Function from coefficients to physical parameters; `None` for coefficients that the data do not determine.
type Quantities<'a> = Box<dyn Fn(&[Option<f64>]) -> Vec<Quantity> + 'a>;

/// Function from the scene of the simulated arm and from coefficients to whitened columns; see [`Candidate::secants`].
type Secants<'a> = Box<dyn Fn(&Scene, &[f64]) -> Option<Vec<Image>> + 'a>;

/// A physical change that may have moved the parameters.
pub(super) struct Change<'a> {
    pub(super) kind: Kind,
    pub(super) site: Option<usize>,
    /// Whitened column of each coefficient; zero where it has no effect.
    pub(super) images: Vec<Image>,
    /// Base parameters that each coefficient adds to those of the arm; empty for changes that are no difference of its
    /// parameters.
    pub(super) base: Vec<Vec<f64>>,
    quantities: Quantities<'a>,
    /// Columns of a change of this size, for changes whose torque is not proportional to their size.
    pub(super) secants: Option<Secants<'a>>,
    pub(super) in_words: &'static str,
    /// The experiment that separates it from what looks alike.
    pub(super) separating_experiment: &'static str,
}

impl Change<'_> {
    /// Physical quantities of the coefficients `b`, with 95 % intervals by the delta method. `places` gives the
    /// position of each coefficient in the change, and whether the data determine it.
    pub(super) fn estimates(
        &self,
        (b, places): (&[f64], &[(usize, bool)]),
        covariance: &DMatrix<f64>,
        half: f64,
    ) -> BTreeMap<&'static str, Estimate> {
        let quantities = |b: &[f64]| {
            let mut all = vec![None; self.images.len()];
            for (b, (place, is_told)) in b.iter().zip(places) {
                all[*place] = is_told.then_some(*b);
            }
            (self.quantities)(&all)
        };
        let free: Vec<usize> = (0..b.len()).collect();
        let estimate = |(q, reach): (Quantity, f64)| {
            let ci95 = [q.value - reach, q.value + reach];
            (q.name, Estimate { value: q.value, unit: q.unit, ci95 })
        };
        with_reach(quantities, b, (&free, covariance), half).into_iter().map(estimate).collect()
    }
}

/// All changes that are looked for. `fitted_nm` is the recorded torque without what the extended model leaves of it, at
/// the samples of the regression: noise in a column of torque would count as explained.
pub(super) fn all<'a>(
    study: &'a Study<'a>,
    set: &BaseSet,
    fitted_nm: &JointSignals,
) -> Vec<Change<'a>> {
    let scene = &study.scene;
    let joints = scene.joints();
    let layout = ParameterLayout::new(joints);
    let base = |parameter: Parameter| {
        let mut standard = vec![0.0; layout.count()];
        standard[layout.index(parameter)] = 1.0;
        set.values(&standard)
    };
    let images = |base: &[Vec<f64>]| -> Vec<Image> {
        base.iter().map(|theta| combined(&study.null_columns, theta)).collect()
    };
    let last = joints - 1;
    let body: Vec<Vec<f64>> = (0..10).map(|k| base(Parameter::Body(last, k))).collect();
    let mut out = vec![Change {
        kind: Kind::Payload,
        site: None,
        images: images(&body),
        base: body,
        quantities: Box::new(payload),
        secants: None,
        in_words: "a body on the flange",
        separating_experiment: "the same motion with the flange bare",
    }];
    for j in 0..joints {
        let of_friction = [Parameter::Coulomb(j), Parameter::Viscous(j)].map(base);
        out.push(Change {
            kind: Kind::FrictionChange,
            site: Some(j),
            images: images(&of_friction),
            base: of_friction.into(),
            quantities: Box::new(friction),
            secants: None,
            in_words: "friction that is not what the simulation assumes",
            separating_experiment: "the same motion after half an hour of work",
        });
        out.push(Change {
            kind: Kind::TorqueGain,
            site: Some(j),
            images: vec![study.torque_on(j, fitted_nm.joint(j))],
            base: Vec::new(),
            // Of the recorded torque (1 + e) τ, the share e/(1 + e) is too much, whatever else changed.
            quantities: Box::new(|b| {
                let error = b[0].filter(|b| *b < 1.0).map(|b| b / (1.0 - b));
                told("error_fraction", error, "")
            }),
            secants: None,
            in_words: "a wrong torque constant",
            separating_experiment: "a known payload: it scales every torque constant",
        });
    }
    for family in study.families {
        let wanted = [
            Kind::BaseTilt,
            Kind::EncoderOffset,
            Kind::CurrentOffset,
            Kind::Spring,
            Kind::LinkLength,
            Kind::Gravity,
        ];
        if wanted.contains(&family.kind()) {
            out.extend(
                family
                    .sites(joints)
                    .into_iter()
                    .map(|site| of_family(study, family.as_ref(), site)),
            );
        }
    }
    out.retain(|c| study.looks_at(c.site) && c.images.iter().any(|i| i.square() > 0.0));
    out
}

/// A family of the catalogue as a change; unlike elsewhere, the null model may absorb its columns here.
fn of_family<'a>(
    study: &'a Study<'a>,
    family: &'a dyn Candidate,
    site: Option<usize>,
) -> Change<'a> {
    let scene = &study.scene;
    let shapes = family.shapes(scene, site);
    let shape = shapes.first().copied().unwrap_or(Shape { variant: 0, value: 0.0 });
    let columns = family.columns(scene, site, shape);
    Change {
        kind: family.kind(),
        site,
        images: columns.iter().map(|c| study.whitening.image(c)).collect(),
        base: Vec::new(),
        quantities: Box::new(move |b| of_told(b, |b| family.quantities(scene, site, shape, b))),
        secants: Some(Box::new(move |simulated, b| {
            let columns = family.secants(simulated, site, b)?;
            Some(columns.iter().map(|c| study.whitening.image(c)).collect())
        })),
        in_words: family.in_words(),
        separating_experiment: family.separating_experiment(),
    }
}

/// Σ b_k column_k.
pub(super) fn combined(columns: &[Image], b: &[f64]) -> Image {
    let mut sum = columns.first().cloned().unwrap_or_default();
    sum.scale(0.0);
    for (column, &b) in columns.iter().zip(b).filter(|(_, b)| **b != 0.0) {
        sum.add(b, column);
    }
    sum
}

/// The quantity of a coefficient; empty where the data do not determine it.
fn told(name: &'static str, value: Option<f64>, unit: &'static str) -> Vec<Quantity> {
    value.map(|value| Quantity { name, value, unit }).into_iter().collect()
}

/// A body described by its mass and centre of mass, or by its first moments where the mass is not determined.
fn payload(b: &[Option<f64>]) -> Vec<Quantity> {
    let (mass_kg, first_moment_kg_m) = (b[0], &b[1..4]);
    let names = match mass_kg {
        Some(_) => ["com_x_m", "com_y_m", "com_z_m"],
        None => ["moment_x_kg_m", "moment_y_kg_m", "moment_z_kg_m"],
    };
    let mut out = told("mass_kg", mass_kg, "kg");
    for (name, moment) in names.into_iter().zip(first_moment_kg_m) {
        out.extend(match mass_kg {
            Some(mass_kg) => told(name, moment.map(|moment| moment / mass_kg), "m"),
            None => told(name, *moment, "kg m"),
        });
    }
    out
}

fn friction(b: &[Option<f64>]) -> Vec<Quantity> {
    let both = [told("coulomb_nm", b[0], "Nm"), told("viscous_nm_s_rad", b[1], "Nm s/rad")];
    both.into_iter().flatten().collect()
}

/// The `quantities` of a family, as far as its coefficients `b` are determined.
fn of_told(b: &[Option<f64>], quantities: impl Fn(&[f64]) -> Vec<Quantity>) -> Vec<Quantity> {
    // Undetermined coefficients at the end are cut off, as families expect of absorbed columns; those in between become
    // NaN.
    let Some(last) = b.iter().rposition(Option::is_some) else { return Vec::new() };
    let b: Vec<f64> = b[..=last].iter().map(|b| b.unwrap_or(f64::NAN)).collect();
    quantities(&b).into_iter().filter(|quantity| !quantity.value.is_nan()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(quantities: Vec<Quantity>) -> Vec<(&'static str, f64)> {
        quantities.into_iter().map(|quantity| (quantity.name, quantity.value)).collect()
    }

    /// A single joint feels only moments across its axis; two parallel joints also feel the mass.
    #[test]
    fn a_body_is_told_as_far_as_the_joints_feel_it() {
        let moments = payload(&[None, Some(0.2), Some(0.1), None]);
        assert_eq!(numbers(moments), [("moment_x_kg_m", 0.2), ("moment_y_kg_m", 0.1)]);
        let in_a_plane = payload(&[Some(2.0), Some(0.2), Some(0.5), None]);
        assert_eq!(numbers(in_a_plane), [("mass_kg", 2.0), ("com_x_m", 0.1), ("com_y_m", 0.25)]);
    }

    /// A tilt about an axis that the arm does not feel is not confused with the one that it feels.
    #[test]
    fn a_coefficient_keeps_its_place() {
        let tilt = |b: &[f64]| -> Vec<Quantity> {
            let names = ["tilt_x_rad", "tilt_y_rad"].into_iter().zip(b);
            names.map(|(name, b)| Quantity { name, value: *b, unit: "rad" }).collect()
        };
        assert_eq!(numbers(of_told(&[None, Some(0.3)], tilt)), [("tilt_y_rad", 0.3)]);
        assert_eq!(numbers(of_told(&[Some(0.3), None], tilt)), [("tilt_x_rad", 0.3)]);
        assert!(of_told(&[None, None], tilt).is_empty());
    }
}
