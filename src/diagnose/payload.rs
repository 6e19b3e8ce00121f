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

use serde::Serialize;

use nalgebra::{DMatrix, DVector};

use super::candidates::Candidate;
use super::chance;
use super::clustered::{Equations, Solution, solve};
use super::error::DiagnoseError;
use super::extension::Extension;
use super::image::{Column, Image, Span};
use super::kind::Kind;
use super::scene::Scene;
use super::verdict::{Cause, Estimate};
use super::whitening::{RunWhitening, Whitening};
use crate::base::BaseSet;
use crate::dynamics::{Parameter, ParameterLayout};
use crate::identify::{Options, Regression};
use crate::number::significant;
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

/// Number of inertial parameters of a body.
const BODY: usize = 10;
/// How many of them are mass and first moments, which no body is without.
const STATIC: usize = 4;
/// Length of the blocks of time for the covariance, s.
const BLOCK_S: f64 = 2.0;
/// Most rows kept per joint and log.
const MOST_ROWS: usize = 8000;
/// Rounds of the fit: some effects depend on the load on the gears, which is known better once the body is.
const ROUNDS: usize = 2;
/// Gauss–Newton steps for the gains and the body's other parameters together.
const STEPS: usize = 4;

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
    let mut fit: Option<(Vec<Equations>, Solution)> = None;
    for _ in 0..ROUNDS {
        let mut all = unloaded.clone();
        let mut loaded = equations(shared, &layout, second, &loaded_theta, offset)?;
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
    /// The finding as a cause, if a body is named.
    pub fn cause(&self) -> Option<Cause> {
        if !self.is_named {
            return None;
        }
        let sigma = 0.25 * (self.mass_kg.ci95[1] - self.mass_kg.ci95[0]);
        let [x, y, z] = self.com_m.clone();
        let all =
            [("mass_kg", self.mass_kg.clone()), ("com_x_m", x), ("com_y_m", y), ("com_z_m", z)];
        let parameters = all.into_iter().filter(|(_, estimate)| !estimate.value.is_nan());
        Some(Cause {
            kind: Kind::Payload,
            joint: None,
            class: Vec::new(),
            confidence: 1.0 - self.probability,
            parameters: parameters.collect(),
            peak_joint: None,
            gain_fraction: None,
            separating_experiment: None,
            strength: self.mass_kg.value / sigma,
            in_words: "a body on the flange".to_owned(),
            form: None,
            may_be_none: false,
            rivals: Vec::new(),
        })
    }

    /// The sentences about the finding: that no body is named, and what a known mass says about the drives.
    pub fn sentences(&self) -> Vec<String> {
        let mut out = Vec::new();
        if !self.is_named {
            out.push(self.no_body());
        }
        if self.was_touched {
            out.push(
                "Something touched the arm along the log with the body; that was taken out before."
                    .to_owned(),
            );
        }
        if let Some(scale) = &self.gain_scale {
            out.push(format!(
                "With the mass known, the drive gains are to be multiplied by {}, if one factor is right for all drives.",
                with_interval(scale)
            ));
        }
        if let Some(scales) = &self.joint_gain_scales {
            let told: Vec<String> = scales
                .iter()
                .enumerate()
                .map(|(j, scale)| {
                    if is_told(scale) {
                        format!("joint {}: {}", j + 1, with_interval(scale))
                    } else {
                        format!("joint {}: not told by these motions", j + 1)
                    }
                })
                .collect();
            out.push(format!("Joint by joint: {}.", told.join(", ")));
            out.extend(self.apart().map(|joints| {
                format!("One scale for all drives does not fit joint {joints}: take those of the joints.")
            }));
        }
        out
    }

    /// Joints whose own scale of gains differs from the common one (their 95 % intervals do not overlap).
    fn apart(&self) -> Option<String> {
        let (all, own) = self.gain_scale.as_ref().zip(self.joint_gain_scales.as_ref())?;
        let is_apart = |scale: &Estimate| {
            is_told(scale) && (scale.ci95[1] < all.ci95[0] || scale.ci95[0] > all.ci95[1])
        };
        let joints = (1..).zip(own).filter(|(_, scale)| is_apart(scale));
        let joints: Vec<String> = joints.map(|(j, _)| j.to_string()).collect();
        (!joints.is_empty()).then(|| joints.join(", "))
    }

    /// The sentence if no body is named.
    fn no_body(&self) -> String {
        let Self { reference, probability, mass_kg, .. } = self;
        let axes = ["x", "y", "z"].into_iter().zip(&self.first_moment_kg_m);
        let moments: Vec<String> = axes
            .filter(|(_, moment)| !moment.value.is_nan())
            .map(|(axis, moment)| format!("{axis} {}", with_interval(moment)))
            .collect();
        let moments = moments.join(", ");
        let by_chance = *probability >= chance::PAYLOAD;
        let chance = significant(*probability, 2);
        if mass_kg.value.is_nan() {
            let first = "These motions cannot tell a mass on the flange";
            return match (moments.is_empty(), by_chance) {
                (true, _) => format!("{first}, nor its first moments."),
                (false, true) => format!(
                    "{first}. First moments are those of {reference}: {moments} kg m more, which chance explains (p = \
                     {chance})."
                ),
                (false, false) => format!(
                    "{first}. First moments are not those of {reference}: {moments} kg m more."
                ),
            };
        }
        let mass = with_interval(mass_kg);
        if by_chance {
            return format!(
                "No body on the flange beside {reference}: {mass} kg, which chance explains (p = {chance})."
            );
        }
        if mass_kg.ci95[1] < 0.0 {
            return format!(
                "No body on the flange beside {reference}, but less of one: {mass} kg. The first log carries more than the \
                 second; were they swapped?"
            );
        }
        format!(
            "The same mass on the flange as in {reference}, {mass} kg more, but with other first moments: {moments} kg m \
             more. Was a body turned, moved or exchanged for one as heavy?"
        )
    }
}

/// Value ± half of the 95 % interval.
fn with_interval(estimate: &Estimate) -> String {
    format!("{:.3} ± {:.3}", estimate.value, 0.5 * (estimate.ci95[1] - estimate.ci95[0]))
}

/// A scale of gains counts as told if its 95 % interval is within ± this share of it: two sources rarely differ by
/// less.
const TOLD_WITHIN: f64 = 0.1;

/// Whether the motions tell this scale of gains well enough to be stated.
fn is_told(scale: &Estimate) -> bool {
    0.5 * (scale.ci95[1] - scale.ci95[0]) < TOLD_WITHIN * scale.value
}

/// Positions of the unknowns in the columns of the least-squares problem.
struct Layout {
    base: usize,
    /// Position of the body's first parameter.
    body: usize,
    /// Position of the first change of friction; each joint has three, of Coulomb friction, viscous friction and
    /// offset.
    friction: usize,
    /// Per joint, the base parameters that these three change.
    friction_base: Vec<[Option<usize>; 3]>,
    count: usize,
}

impl Layout {
    fn new(set: &BaseSet, extension: &Extension, joints: usize) -> Self {
        let base = set.rank();
        let effects: usize = extension.effects.iter().map(|e| e.coefficients.len()).sum();
        let body = base + effects;
        let friction = body + BODY;
        let friction_base = (0..joints)
            .map(|j| {
                [Parameter::Coulomb(j), Parameter::Viscous(j), Parameter::Offset(j)]
                    .map(|own| set.index_of(own))
            })
            .collect();
        Self { base, body, friction, friction_base, count: friction + 3 * joints }
    }

    fn add_friction_change(&self, e: &mut Equations) {
        for (c, base) in self.friction_base[e.joint].iter().enumerate() {
            if let Some(base) = base {
                let column = e.columns.column(*base).into_owned();
                e.columns.set_column(self.friction + 3 * e.joint + c, &column);
            }
        }
    }
}

/// The ten inertial parameters of a body on the last link, as they show in the base parameters.
struct Body {
    /// Each parameter in terms of base parameters; zero where the joints do not feel it, or where parameters before it
    /// have the same effect together.
    terms: Vec<Vec<f64>>,
    /// Whether the joints tell each parameter from all others.
    told: [bool; BODY],
}

impl Body {
    fn new(set: &BaseSet, joints: usize) -> Self {
        let layout = ParameterLayout::new(joints);
        let of = |k: usize| {
            let mut standard = vec![0.0; layout.count()];
            standard[layout.index(Parameter::Body(joints - 1, k))] = 1.0;
            set.values(&standard)
        };
        Self::felt((0..BODY).map(of).collect())
    }

    /// Keeps those of `all` terms that are linearly independent of the ones before them, and sets the others to zero.
    fn felt(all: Vec<Vec<f64>>) -> Self {
        let image = |terms: &Vec<f64>| Image { mean: terms.clone(), contrast: Vec::new() };
        let images: Vec<Image> = all.iter().map(image).collect();
        let (_, taken) = Span::telling(&Span::default(), &images);
        let mut terms: Vec<Vec<f64>> = all.iter().map(|terms| vec![0.0; terms.len()]).collect();
        let mut told = [false; BODY];
        for (k, is_told) in taken {
            terms[k].clone_from(&all[k]);
            told[k] = is_told;
        }
        Self { terms, told }
    }
}

/// Σ_k terms_k column_k of the base parameters' columns.
fn combination(columns: &DMatrix<f64>, terms: &[f64]) -> DVector<f64> {
    let mut sum = DVector::zeros(columns.nrows());
    for (k, term) in terms.iter().enumerate().filter(|(_, t)| **t != 0.0) {
        sum.axpy(*term, &columns.column(k), 1.0);
    }
    sum
}

fn blocks(equations: &[Equations]) -> usize {
    equations.iter().flat_map(|e| &e.block_of).max().map_or(0, |b| b + 1)
}

/// Equations of the base parameters and effects along one log, restricted to samples in which the joint moves.
fn equations(
    shared: &Shared,
    layout: &Layout,
    regression: &Regression,
    theta: &[f64],
    first_block: usize,
) -> Result<Vec<Equations>, DiagnoseError> {
    let Shared { arm, set, options, families, extension } = shared;
    let prepared = &regression.prepared;
    let problem = &regression.problem;
    let scene = extension.telling(families, Scene::new(arm, set, theta, prepared));
    let whitening = if scene.periodic {
        None
    } else {
        let weights = vec![1.0; arm.dof()];
        Some(Whitening::Run(RunWhitening::new(regression, options, &weights)?))
    };
    let moving = RunWhitening::moving_rows(regression);
    let (n, periods) = (problem.samples, problem.periods);
    let thin = (n * periods).div_ceil(MOST_ROWS).max(1);
    let block_rows = ((BLOCK_S * problem.rate_hz) as usize).max(1);
    let effects = extension.effects.iter();
    let (laws, off): (Vec<_>, Vec<_>) = effects
        .map(|effect| (effect.columns(families, &scene), effect.off_columns(families, &scene)))
        .unzip();
    let on_joint = |j: usize, column: &Column| -> Vec<Vec<f64>> {
        let own = column.parts.iter().filter(|(joint, _)| *joint == j);
        let as_regressed = |y: &Vec<f64>| {
            whitening.as_ref().map_or_else(|| y.clone(), |whitening| whitening.as_regressed(y))
        };
        own.map(|(_, y)| as_regressed(y)).collect()
    };
    let mut out = Vec::with_capacity(problem.joints());
    for (j, panel) in problem.panels.iter().enumerate() {
        let rows: Vec<usize> =
            (0..n * periods).step_by(thin).filter(|row| moving[j][row % n]).collect();
        let mut columns = DMatrix::zeros(rows.len(), layout.count);
        for (base, x) in problem.plan.base_indices(j).zip(panel.x.chunks_exact(n)) {
            for (value, row) in columns.column_mut(base).iter_mut().zip(&rows) {
                *value = x[row % n];
            }
        }
        let mut first = layout.base;
        for (effect, law) in extension.effects.iter().zip(&laws) {
            // A single run has no columns of what a drive feeds forward.
            for (at, (column, _)) in (first..).zip(law) {
                for y in on_joint(j, column) {
                    for (value, row) in columns.column_mut(at).iter_mut().zip(&rows) {
                        *value = y[row % y.len()];
                    }
                }
            }
            first += effect.coefficients.len();
        }
        let mut torque_nm =
            DVector::from_iterator(rows.len(), rows.iter().map(|row| panel.y[*row]));
        for (column, b) in off.iter().flatten() {
            for y in on_joint(j, column) {
                for (value, row) in torque_nm.iter_mut().zip(&rows) {
                    *value -= b * y[row % y.len()];
                }
            }
        }
        out.push(Equations {
            joint: j,
            columns,
            torque_nm,
            block_of: rows.iter().map(|row| first_block + row / block_rows).collect(),
        });
    }
    Ok(out)
}

/// Scale 1/a_j of every joint's drive gain, where the body's mass is `known_kg`.
fn joint_gains(
    all: &[Equations],
    layout: &Layout,
    joints: usize,
    body: &[f64],
    known_kg: f64,
    log: &str,
) -> Result<Vec<Estimate>, DiagnoseError> {
    let mut factors = vec![body[0] / known_kg; joints];
    // The body's other nine parameters, rescaled to what they are if the mass is the known one.
    let mut rest: Vec<f64> = body[1..].iter().map(|p| p * known_kg / body[0]).collect();
    let mut scales = Vec::new();
    for _ in 0..STEPS {
        let mut linear = all.to_vec();
        for (e, original) in linear.iter_mut().zip(all) {
            let columns = |c: usize| original.columns.column(layout.body + c);
            let mut torque = columns(0) * known_kg;
            for (c, value) in rest.iter().enumerate() {
                torque.axpy(*value, &columns(c + 1), 1.0);
                let scaled = columns(c + 1) * factors[e.joint];
                e.columns.set_column(layout.body + c + 1, &scaled);
            }
            e.columns.column_mut(layout.body).fill(0.0);
            let rows = e.columns.nrows();
            e.columns = std::mem::replace(&mut e.columns, DMatrix::zeros(0, 0)).resize(
                rows,
                layout.count + joints,
                0.0,
            );
            e.columns.set_column(layout.count + e.joint, &torque);
        }
        let solution = solve(&linear, joints, log)?;
        for (c, value) in rest.iter_mut().enumerate() {
            *value += solution.x[layout.body + c + 1];
        }
        scales.clear();
        for (j, factor) in factors.iter_mut().enumerate() {
            *factor = solution.x[layout.count + j];
            let slope = -factor.powi(-2);
            scales.push(solution.estimate(1.0 / *factor, layout.count + j, &[slope], ""));
        }
    }
    Ok(scales)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;

    fn told(joints: usize) -> [bool; BODY] {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints.truncate(joints);
        let set = BaseSet::find(&arm, Parameterisation::full(joints, false)).unwrap();
        Body::new(&set, joints).told
    }

    /// A vertical joint feels an inertia alone. A second joint across it, on the same point, also feels the moments in
    /// its plane, but no mass. Six joints feel all ten parameters.
    #[test]
    fn an_arm_tells_what_its_joints_feel_of_a_body() {
        assert_eq!(told(1)[..STATIC], [false; STATIC]);
        assert_eq!(told(2)[..STATIC], [false, true, true, false]);
        assert_eq!(told(6), [true; BODY]);
    }

    /// Of two parameters that the joints feel alike, neither is told, and the second is left out.
    #[test]
    fn what_adds_up_to_the_same_is_not_told() {
        let mut all = vec![vec![0.0; 3]; BODY];
        (all[0], all[1], all[2]) = (vec![1.0, 0.0, 0.5], vec![0.0, 2.0, 0.0], vec![0.0, -1.0, 0.0]);
        let Body { terms, told } = Body::felt(all.clone());
        assert_eq!(told[..3], [true, false, false]);
        assert_eq!(terms[..3], [all[0].clone(), all[1].clone(), vec![0.0; 3]]);
    }

    /// What is said of a second log with this mass and first moment more on the flange, at this probability that chance
    /// explains them.
    fn said(mass_kg: f64, moment_kg_m: f64, probability: f64) -> String {
        let known_to = |half: f64| {
            move |value: f64| Estimate { value, unit: "", ci95: [value - half, value + half] }
        };
        let finding = PayloadFinding {
            reference: "bare.csv".to_owned(),
            mass_kg: known_to(0.02)(mass_kg),
            first_moment_kg_m: [moment_kg_m, 0.0, f64::NAN].map(known_to(0.004)),
            com_m: [0.0; 3].map(known_to(0.01)),
            probability,
            is_named: false,
            gain_scale: None,
            joint_gain_scales: None,
            coulomb_change_nm: Vec::new(),
            was_touched: false,
        };
        finding.sentences().join(" ")
    }

    /// Chance is named only where it explains the difference: a gripper that was turned, or exchanged for one as heavy,
    /// is no accident.
    #[test]
    fn chance_is_named_where_it_explains_a_difference() {
        let chance = |mass_kg, moment_kg_m, probability| {
            said(mass_kg, moment_kg_m, probability).contains("chance explains")
        };
        assert!(chance(0.01, 0.002, 0.4) && chance(-0.03, 0.0, 0.02) && chance(f64::NAN, 0.0, 0.4));
        let turned = said(0.01, 0.1, 1e-9);
        assert!(turned.starts_with("The same mass on the flange as in bare.csv"), "{turned}");
        assert!(turned.contains("x 0.100 ± 0.004, y 0.000 ± 0.004 kg m"), "{turned}");
        assert!(said(-2.0, 0.1, 1e-9).contains("swapped"));
        let unknown = said(f64::NAN, 0.1, 1e-9);
        assert!(unknown.starts_with("These motions cannot tell a mass"), "{unknown}");
        assert!(unknown.contains("are not those of bare.csv: x 0.100 ± 0.004"), "{unknown}");
    }
}
