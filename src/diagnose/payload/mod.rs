//! What changed between two logs of the same arm: a body on the flange.
//!
//! Both logs share the base parameters and the effects that were found in the first. The second may have a body on the
//! flange (ten inertial parameters, about the last joint's frame) and friction of another size, because it may be from
//! another day. The motions need not be the same.
//!
//! A known mass M gives the scale of the drive gains: if all gains are off by a common factor, so is every identified
//! mass m̂, and the true gain is M/m̂ times the assumed one. Joint by joint, the torque of the body enters with a
//! factor a_j of its own (Gautier and Briot 2014, with the mass as the known quantity); 1/a_j is the scale of that
//! joint's gain.

mod body;
mod equations;
mod words;

use body::{BODY, Body, STATIC};
use equations::{Layout, blocks, combination, equations, joint_gains};
use serde::Serialize;

use super::candidates::Candidate;
use super::chance;
use super::clustered::{Equations, Solution, solve};
use super::error::DiagnoseError;
use super::extension::Extension;
use super::kind::Kind;
use super::verdict::{Cause, Estimate};
use crate::base::BaseSet;
use crate::identify::{Options, Regression};
use crate::robot::Arm;

/// What a second log says about a body on the flange.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PayloadFinding {
    /// The log without the body.
    pub reference: String,
    /// Mass, kg; NaN (null) where the joints of this arm do not tell it from the body's other parameters.
    pub mass_kg: Estimate,
    /// First moments m·c about the last joint's frame, kg m; NaN (null) where the joints do not tell them.
    pub first_moment_kg_m: [Estimate; 3],
    /// Centre of mass in the last joint's frame, m; meaningful where the body is named.
    pub com_m: [Estimate; 3],
    /// Probability that chance alone gives a mass and first moments as large.
    pub probability: f64,
    /// Whether a body is named.
    pub is_named: bool,
    /// Common scale of all drive gains that follows from the known mass; null where no mass was given or no body is
    /// named.
    pub gain_scale: Option<Estimate>,
    /// The scale of each joint's own drive gain, likewise.
    pub joint_gain_scales: Option<Vec<Estimate>>,
    /// Change of Coulomb friction per joint from the first log to the second, Nm.
    pub coulomb_change_nm: Vec<Estimate>,
    /// Whether something touched the arm along the second log; the rows were taken out.
    #[serde(skip)]
    pub was_touched: bool,
}

/// What stays the same for both logs.
pub(super) struct Shared<'a> {
    pub(super) arm: &'a Arm,
    pub(super) set: &'a BaseSet,
    pub(super) options: &'a Options,
    pub(super) families: &'a [Box<dyn Candidate>],
    /// Base parameters and effects found in the first log.
    pub(super) extension: &'a Extension,
}

/// Rounds of the fit: some effects depend on the load on the gears, which is known better once the body is.
const ROUNDS: usize = 2;

/// Compares the log of the regression `second` with that of `first`; `names` are the names of the two logs.
pub(super) fn between(
    shared: &Shared,
    first: &Regression,
    second: &Regression,
    names: [&str; 2],
    known_mass_kg: Option<f64>,
) -> Result<PayloadFinding, DiagnoseError> {
    let set = shared.set;
    let joints = shared.arm.dof();
    let Body { terms, told } = Body::new(set, joints);
    let mut loaded_theta = shared.extension.theta.clone();
    let layout = Layout::new(set, shared.extension, joints);
    let unloaded = equations(shared, &layout, first, &shared.extension.theta, 0)?;
    let offset = blocks(&unloaded);
    let elsewhere = shared.extension.elsewhere(shared.families);
    let beside_body = Shared { extension: &elsewhere, ..*shared };
    let mut fit: Option<(Vec<Equations>, Solution)> = None;
    for _ in 0..ROUNDS {
        let mut all = unloaded.clone();
        let mut loaded = equations(&beside_body, &layout, second, &loaded_theta, offset)?;
        for e in &mut loaded {
            layout.add_friction_change(e);
            for (c, terms) in terms.iter().enumerate() {
                let column = combination(&e.columns, terms);
                e.columns.set_column(layout.body + c, &column);
            }
        }
        all.extend(loaded);
        let solution = solve(&all, joints, names[1])?;
        for (k, theta) in loaded_theta.iter_mut().enumerate() {
            let change: f64 = (0..BODY).map(|c| terms[c][k] * solution.x[layout.body + c]).sum();
            *theta = solution.x[k] + change;
        }
        fit = Some((all, solution));
    }
    let Some((all, solution)) = fit else {
        return Err(DiagnoseError::Singular { log: names[1].to_owned(), unknowns: layout.count });
    };
    let x: Vec<f64> = (0..BODY).map(|c| solution.x[layout.body + c]).collect();
    let mass = x[0];
    let unit_vector = |at: usize| {
        let mut g = [0.0; STATIC];
        g[at] = 1.0;
        g
    };
    let estimate =
        |value: f64, g: &[f64], unit: &'static str| solution.estimate(value, layout.body, g, unit);
    let if_told = |is_told: bool, known: Estimate| match is_told {
        true => known,
        false => Estimate { value: f64::NAN, ci95: [f64::NAN; 2], ..known },
    };
    let mass_kg = if_told(told[0], estimate(mass, &unit_vector(0), "kg"));
    let first_moment_kg_m =
        [1, 2, 3].map(|a| if_told(told[a], estimate(x[a], &unit_vector(a), "kg m")));
    let com_m = [1, 2, 3].map(|a| {
        let mut g = [0.0; STATIC];
        g[a] = 1.0 / mass;
        g[0] = -x[a] / (mass * mass);
        if_told(told[0] && told[a], estimate(x[a] / mass, &g, "m"))
    });
    let unknowns: Vec<usize> = (0..STATIC).filter(|c| told[*c]).map(|c| layout.body + c).collect();
    let probability = solution.probability(&unknowns);
    let is_named = probability < chance::PAYLOAD && mass_kg.ci95[0] > 0.0;
    let gain_scale = known_mass_kg
        .filter(|_| is_named)
        .map(|known| estimate(known / mass, &[-known / (mass * mass), 0.0, 0.0, 0.0], ""));
    let joint_gain_scales = match known_mass_kg.filter(|_| is_named) {
        Some(known) => Some(joint_gains(&all, &layout, joints, &x, known, names[1])?),
        None => None,
    };
    let coulomb_change_nm = (0..joints)
        .map(|j| {
            let at = layout.friction + 3 * j;
            solution.estimate(solution.x[at], at, &[1.0], "Nm")
        })
        .collect();
    Ok(PayloadFinding {
        reference: names[0].to_owned(),
        mass_kg,
        first_moment_kg_m,
        com_m,
        probability,
        is_named,
        gain_scale,
        joint_gain_scales,
        coulomb_change_nm,
        was_touched: false,
    })
}

impl PayloadFinding {
    /// Whether the second log carries something else than the first, beyond what chance explains.
    pub fn differs(&self) -> bool {
        self.probability < chance::PAYLOAD
    }

    /// The finding as a cause, if a body is named.
    pub fn cause(&self) -> Option<Cause> {
        if !self.is_named {
            return None;
        }
        let sigma = 0.25 * (self.mass_kg.ci95[1] - self.mass_kg.ci95[0]);
        let [x, y, z] = self.com_m.clone();
        let all =
            [("mass_kg", self.mass_kg.clone()), ("com_x_m", x), ("com_y_m", y), ("com_z_m", z)];
        let parameters: Vec<_> =
            all.into_iter().filter(|(_, estimate)| !estimate.value.is_nan()).collect();
        let strength = self.mass_kg.value / sigma;
        Some(Cause {
            confidence: 1.0 - self.probability,
            ..Cause::certain(Kind::Payload, None, "a body on the flange", strength, &parameters)
        })
    }
}
