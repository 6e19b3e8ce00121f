//! A body on the flange fitted to two logs together.

use super::super::clustered::{Equations, Solution, solve};
use super::super::error::DiagnoseError;
use super::super::setup::Setup;
use super::super::verdict::Estimate;
use super::Shared;
use super::body::{BODY, Body, STATIC};
use super::equations::{Layout, blocks, equations, joint_gains};
use crate::identify::Regression;

/// Rounds of the fit: some effects depend on the load on the gears, which is known better once the body is.
const ROUNDS: usize = 2;

/// What two logs, the second with a body on the flange, say together.
pub(super) struct Fit {
    joints: usize,
    layout: Layout,
    /// The equations of both logs.
    equations: Vec<Equations>,
    solution: Solution,
    /// The body's ten inertial parameters.
    body: Vec<f64>,
    /// Whether the joints tell each of them from all others.
    told: [bool; BODY],
}

impl Fit {
    /// Fits the logs of both regressions; `log` names the second in an error.
    pub(super) fn of(
        shared: &Shared,
        first: &Regression,
        second: &Regression,
        log: &str,
    ) -> Result<Self, DiagnoseError> {
        let Setup { arm, set, .. } = shared.setup;
        let joints = arm.dof();
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
                layout.add_body(e, &terms);
            }
            all.extend(loaded);
            let solution = solve(&all, joints, log)?;
            for (k, theta) in loaded_theta.iter_mut().enumerate() {
                let change: f64 =
                    (0..BODY).map(|c| terms[c][k] * solution.x[layout.body + c]).sum();
                *theta = solution.x[k] + change;
            }
            fit = Some((all, solution));
        }
        let Some((equations, solution)) = fit else {
            return Err(DiagnoseError::Singular { log: log.to_owned(), unknowns: layout.count });
        };
        let body = (0..BODY).map(|c| solution.x[layout.body + c]).collect();
        Ok(Self { joints, layout, equations, solution, body, told })
    }

    /// Mass of the body, kg.
    pub(super) fn mass_kg(&self) -> Estimate {
        if_told(self.told[0], self.estimate(self.body[0], &unit_vector(0), "kg"))
    }

    /// First moments of the body, kg m.
    pub(super) fn first_moment_kg_m(&self) -> [Estimate; 3] {
        let moment = |a: usize| self.estimate(self.body[a], &unit_vector(a), "kg m");
        [1, 2, 3].map(|a| if_told(self.told[a], moment(a)))
    }

    /// Centre of mass of the body, m.
    pub(super) fn com_m(&self) -> [Estimate; 3] {
        let (x, mass) = (&self.body, self.body[0]);
        [1, 2, 3].map(|a| {
            let mut g = [0.0; STATIC];
            g[a] = 1.0 / mass;
            g[0] = -x[a] / (mass * mass);
            if_told(self.told[0] && self.told[a], self.estimate(x[a] / mass, &g, "m"))
        })
    }

    /// Probability that chance alone gives a mass and first moments as large.
    pub(super) fn probability(&self) -> f64 {
        let told = (0..STATIC).filter(|c| self.told[*c]);
        let unknowns: Vec<usize> = told.map(|c| self.layout.body + c).collect();
        self.solution.probability(&unknowns)
    }

    /// Common scale of all drive gains with which the body's mass is `known_kg`.
    pub(super) fn gain_scale(&self, known_kg: f64) -> Estimate {
        let mass = self.body[0];
        self.estimate(known_kg / mass, &[-known_kg / (mass * mass), 0.0, 0.0, 0.0], "")
    }

    /// The scale of each joint's own drive gain, likewise; `log` names the second log in an error.
    pub(super) fn joint_gain_scales(
        &self,
        known_kg: f64,
        log: &str,
    ) -> Result<Vec<Estimate>, DiagnoseError> {
        joint_gains(&self.equations, &self.layout, self.joints, &self.body, known_kg, log)
    }

    /// Change of Coulomb friction per joint from the first log to the second, Nm.
    pub(super) fn coulomb_change_nm(&self) -> Vec<Estimate> {
        let change = |j: usize| {
            let at = self.layout.friction + 3 * j;
            self.solution.estimate(self.solution.x[at], at, &[1.0], "Nm")
        };
        (0..self.joints).map(change).collect()
    }

    /// `value`, a function of mass and first moments with the gradient `g`, with its interval.
    fn estimate(&self, value: f64, g: &[f64; STATIC], unit: &'static str) -> Estimate {
        self.solution.estimate(value, self.layout.body, g, unit)
    }
}

/// Gradient of the parameter number `at` of a body.
fn unit_vector(at: usize) -> [f64; STATIC] {
    let mut g = [0.0; STATIC];
    g[at] = 1.0;
    g
}

/// The estimate `known` of a quantity if the joints tell it; else NaN.
fn if_told(is_told: bool, known: Estimate) -> Estimate {
    match is_told {
        true => known,
        false => Estimate { value: f64::NAN, ci95: [f64::NAN; 2], ..known },
    }
}
