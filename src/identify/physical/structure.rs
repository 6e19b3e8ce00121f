//! Conditions on the standard parameters of an arm, independent of the data.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix4, RowDVector};

use super::cone::{Cone, svec};
use super::error::PhysicalError;
use super::program::Constraint;
use crate::base::{BaseSet, Parameterisation, Terms};
use crate::dynamics::{Parameter, ParameterLayout};
use crate::robot::{Arm, LinkInertia};

/// Unknowns, base map, cones and prior of an arm.
///
/// The unknowns y are the parameters of the base set's parameterisation, followed by standard parameters on which no
/// torque depends (such as those of body 1, whose axis is vertical). x = E y are all standard parameters, θ = K y the
/// base parameters.
#[derive(Debug, Clone)]
pub struct Structure {
    layout: ParameterLayout,
    /// Columns of E over the standard parameters.
    to_standard: Vec<Terms>,
    /// K, b × n.
    pub base_map: DMatrix<f64>,
    /// The constraints: every link, then friction and rotor inertias, then bounds.
    pub constraints: Vec<Constraint>,
    /// Subject of each constraint.
    pub subjects: Vec<Subject>,
    /// The pulls to the prior.
    pub pulls: Vec<Pull>,
    /// The prior, moved inside the cones where it lies on their boundary.
    pub start: DVector<f64>,
}

/// Subject of a constraint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// Pseudo-inertia of a body (0-based).
    Link(usize),
    /// A drive's parameter that cannot be negative.
    Drive(Parameter),
    /// A bound of the robot file on a body's mass.
    Mass(usize),
    /// A bound of the robot file on a body's centre of mass.
    CentreOfMass(usize),
}

impl std::fmt::Display for Subject {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Link(body) => write!(f, "pseudo-inertia of body {}", body + 1),
            Self::Drive(parameter) => write!(f, "{parameter} ≥ 0"),
            Self::Mass(body) => write!(f, "bound on the mass of body {}", body + 1),
            Self::CentreOfMass(body) => {
                write!(f, "bound on the centre of mass of body {}", body + 1)
            }
        }
    }
}

/// A pull of a few entries of y to the prior: A y is to be near a.
#[derive(Debug, Clone)]
pub struct Pull {
    columns: Vec<usize>,
    map: DMatrix<f64>,
    target: DVector<f64>,
    /// The cone whose unit element a is; `None` where the prior is zero, or so small that it counts as unknown.
    cone: Option<Cone>,
}

impl Pull {
    /// Adds weight·½‖A y − a‖² to ½ yᵀH y − cᵀy; returns weight·½‖a‖².
    fn add_square(&self, weight: f64, h: &mut DMatrix<f64>, c: &mut DVector<f64>) -> f64 {
        let Self { columns, map, target, .. } = self;
        for (a, &row) in columns.iter().enumerate() {
            c[row] += weight * map.column(a).dot(target);
            for (b, &column) in columns.iter().enumerate() {
                h[(row, column)] += weight * map.column(a).dot(&map.column(b));
            }
        }
        0.5 * weight * target.norm_squared()
    }
}

/// Share of the squared pull that is added to the entropic pull.
pub const ENTROPIC_CURVATURE: f64 = 1e-4;
/// Deviation that counts as 100 % for a drive parameter whose prior is zero (a URDF has no rotor inertia), in kg m²,
/// Nm s/rad and Nm. It is as large as in the first joints of an arm of 20 kg, so that the prior does not pull any
/// drive parameter to zero.
const UNKNOWN_ROTOR_INERTIA: f64 = 1.0;
const UNKNOWN_FRICTION: f64 = 10.0;
/// A prior of a drive parameter below this share of that size was not measured (a URDF's damping of 0.1), and pulls
/// as gently as a missing one.
const PLACEHOLDER: f64 = 0.02;
/// Torque offset that counts as a deviation of 100 %, Nm: as gentle a pull as that of unknown friction.
const USUAL_OFFSET_NM: f64 = 10.0;
/// A drive's prior below this share of its size counts as lying on the boundary.
const ON_BOUNDARY: f64 = 1e-2;

impl Structure {
    /// The structure for the base set of `arm`. Every pseudo-inertia is to be at least `margin` times that of
    /// `prior`, whose bodies must be physically possible.
    pub fn new(arm: &Arm, set: &BaseSet, prior: &Arm, margin: f64) -> Result<Self, PhysicalError> {
        let layout = ParameterLayout::new(arm.dof());
        let extra = unobservable(arm, set)?;
        let mut to_standard = set.parameterisation.to_standard.clone();
        to_standard.extend(extra.iter().map(|&k| vec![(k, 1.0)]));
        let mut base_map = DMatrix::zeros(set.rank(), to_standard.len());
        for (row, terms) in set.combinations.iter().enumerate() {
            for &(column, coefficient) in terms {
                base_map[(row, column)] = coefficient;
            }
        }
        let mut structure = Self {
            layout,
            to_standard,
            base_map,
            constraints: Vec::new(),
            subjects: Vec::new(),
            pulls: Vec::new(),
            start: DVector::zeros(0),
        };
        let standard = crate::dynamics::Model::new(prior).standard_parameters();
        let mut start = set.parameterisation.values(&standard);
        start.extend(extra.iter().map(|&k| standard[k]));
        structure.start = DVector::from_vec(start);
        for (body, joint) in prior.joints.iter().enumerate() {
            structure.add_link(body, &joint.link, margin)?;
        }
        for j in 0..arm.dof() {
            structure.add_drive(Parameter::RotorInertia(j), &standard, UNKNOWN_ROTOR_INERTIA);
            structure.add_drive(Parameter::Viscous(j), &standard, UNKNOWN_FRICTION);
            structure.add_drive(Parameter::Coulomb(j), &standard, UNKNOWN_FRICTION);
            structure.add_offset(j);
        }
        for (body, joint) in arm.joints.iter().enumerate() {
            structure.add_bounds(body, joint);
        }
        structure.check_start()?;
        Ok(structure)
    }

    /// Number of unknowns n.
    pub fn unknowns(&self) -> usize {
        self.to_standard.len()
    }

    /// The unknown after which each base parameter is named: no other base parameter contains it, and its coefficient
    /// is 1.
    pub fn kept(&self) -> Vec<usize> {
        let first = |row: RowDVector<f64>| row.iter().position(|&a| a != 0.0).unwrap_or_default();
        self.base_map.row_iter().map(|row| first(row.into_owned())).collect()
    }

    /// Unknowns with K y = θ, obtained from the prior by changing only the kept unknowns.
    pub fn with_base(&self, theta: &DVector<f64>) -> DVector<f64> {
        let mut y = self.start.clone();
        let missing = theta - &self.base_map * &y;
        self.kept().iter().zip(missing.iter()).for_each(|(&k, m)| y[k] += m);
        y
    }

    /// All standard parameters x = E y in the order of [`ParameterLayout`]; those that the
    /// parameterisation does not have are zero.
    pub fn standard(&self, y: &DVector<f64>) -> Vec<f64> {
        let mut x = vec![0.0; self.layout.count()];
        for (terms, value) in self.to_standard.iter().zip(y.iter()) {
            for &(k, coefficient) in terms {
                x[k] += coefficient * value;
            }
        }
        x
    }

    /// E, standard parameters × n.
    pub fn standard_map(&self) -> DMatrix<f64> {
        let mut map = DMatrix::zeros(self.layout.count(), self.unknowns());
        for (column, terms) in self.to_standard.iter().enumerate() {
            for &(k, coefficient) in terms {
                map[(k, column)] = coefficient;
            }
        }
        map
    }

    /// Adds weight·½‖A y − a‖² of every pull to ½ yᵀH y − cᵀy; returns weight·½‖a‖².
    pub fn add_pulls(&self, weight: f64, h: &mut DMatrix<f64>, c: &mut DVector<f64>) -> f64 {
        self.pulls.iter().map(|pull| pull.add_square(weight, h, c)).sum()
    }

    /// Σ AᵀA of the pulls, n × n: the curvature of the pull at the prior, per unit of its weight.
    pub fn pull_curvature(&self) -> DMatrix<f64> {
        let mut pulls = DMatrix::zeros(self.unknowns(), self.unknowns());
        self.add_pulls(1.0, &mut pulls, &mut DVector::zeros(self.unknowns()));
        pulls
    }

    /// Adds weight·D of every pull, D = tr(A y) − ln det(A y) − d. The logarithm becomes a barrier among
    /// `constraints`, the trace a part of −cᵀy; returns −Σ weight·d. Where the prior is zero there is no logarithm,
    /// and the pull is the square. H also gets `ENTROPIC_CURVATURE` of the square, because the data alone leave it
    /// singular.
    pub fn add_divergences(
        &self,
        weight: f64,
        h: &mut DMatrix<f64>,
        c: &mut DVector<f64>,
        constraints: &mut Vec<Constraint>,
    ) -> f64 {
        let mut constant = 0.0;
        for pull in &self.pulls {
            let Some(cone) = pull.cone else {
                constant += pull.add_square(weight, h, c);
                continue;
            };
            constant += pull.add_square(ENTROPIC_CURVATURE * weight, h, c);
            constant -= weight * cone.degree() as f64;
            for (&row, column) in pull.columns.iter().zip(pull.map.column_iter()) {
                c[row] -= weight * column.dot(&pull.target);
            }
            constraints.push(Constraint {
                cone,
                columns: pull.columns.clone(),
                map: pull.map.clone(),
                offset: DVector::zeros(cone.dimension()),
                barrier: weight,
            });
        }
        constant
    }

    /// The unknowns on which the standard parameters in `range` depend, and the corresponding block of E.
    fn block(&self, range: std::ops::Range<usize>) -> (Vec<usize>, DMatrix<f64>) {
        let touches = |terms: &Terms| terms.iter().any(|(k, _)| range.contains(k));
        let columns: Vec<usize> =
            (0..self.unknowns()).filter(|&c| touches(&self.to_standard[c])).collect();
        let mut block = DMatrix::zeros(range.len(), columns.len());
        for (a, &column) in columns.iter().enumerate() {
            for &(k, coefficient) in &self.to_standard[column] {
                if range.contains(&k) {
                    block[(k - range.start, a)] = coefficient;
                }
            }
        }
        (columns, block)
    }

    /// Adds the constraint and the pull of a link: svec(L₀⁻¹ P L₀⁻ᵀ) − margin·svec(1) ∈ semidefinite, with the
    /// prior's pseudo-inertia P₀ = L₀L₀ᵀ. In these coordinates the prior is the unit matrix and the pull-back
    /// tr(P₀⁻¹ΔP P₀⁻¹ΔP) is the squared Euclidean distance.
    fn add_link(
        &mut self,
        body: usize,
        prior: &LinkInertia,
        margin: f64,
    ) -> Result<(), PhysicalError> {
        let impossible = || PhysicalError::ImpossiblePrior {
            body: body + 1,
            smallest: prior.consistency_margin(),
        };
        let factor = Cholesky::new(prior.pseudo_inertia()).ok_or_else(impossible)?;
        let inverse = factor.l().try_inverse().ok_or_else(impossible)?;
        let mut coordinates = DMatrix::zeros(10, 10);
        for (k, mut column) in coordinates.column_iter_mut().enumerate() {
            let mut unit = LinkInertia::zero();
            unit.parameters[k] = 1.0;
            column.copy_from(&svec(&(inverse * unit.pseudo_inertia() * inverse.transpose())));
        }
        let (columns, block) = self.block(10 * body..10 * body + 10);
        let map = coordinates * block;
        let unit = DVector::from_column_slice(svec(&Matrix4::identity()).as_slice());
        self.pulls.push(Pull {
            columns: columns.clone(),
            map: map.clone(),
            target: unit.clone(),
            cone: Some(Cone::Semidefinite),
        });
        self.push(Subject::Link(body), Cone::Semidefinite, columns, map, -margin * unit);
        Ok(())
    }

    /// Adds a drive parameter: parameter / size ≥ 0, pulled to prior / size.
    fn add_drive(&mut self, parameter: Parameter, standard: &[f64], unknown: f64) {
        let index = self.layout.index(parameter);
        let prior = standard[index].max(0.0);
        let is_known = prior >= PLACEHOLDER * unknown;
        let size = if is_known { prior } else { unknown };
        let (columns, mut map) = self.block(index..index + 1);
        if columns.is_empty() {
            return;
        }
        map /= size;
        if let ([only], true) = (&columns[..], prior < ON_BOUNDARY * size) {
            self.start[*only] = size;
        }
        let target = DVector::from_element(1, prior / size);
        let cone = is_known.then_some(Cone::NonNegative);
        self.pulls.push(Pull { columns: columns.clone(), map: map.clone(), target, cone });
        self.push(Subject::Drive(parameter), Cone::NonNegative, columns, map, DVector::zeros(1));
    }

    fn add_offset(&mut self, joint: usize) {
        let index = self.layout.index(Parameter::Offset(joint));
        let (columns, map) = self.block(index..index + 1);
        if !columns.is_empty() {
            let map = map / USUAL_OFFSET_NM;
            let target = DVector::zeros(1);
            self.pulls.push(Pull { columns, map, target, cone: None });
        }
    }

    /// Adds the robot file's bounds: on the mass, and on the centre of mass as m·low ≤ m·ρ ≤ m·high.
    fn add_bounds(&mut self, body: usize, joint: &crate::robot::Joint) {
        let (columns, block) = self.block(10 * body..10 * body + 10);
        let mass_kg = joint.link.mass_kg();
        if let Some([low, high]) = joint.bounds.mass_kg {
            for (sign, bound) in [(1.0, low), (-1.0, high)] {
                let map = block.rows(0, 1) * (sign / mass_kg);
                let offset = DVector::from_element(1, -sign * bound / mass_kg);
                self.push(Subject::Mass(body), Cone::NonNegative, columns.clone(), map, offset);
            }
        }
        for (axis, [low, high]) in joint.bounds.com_m.iter().flatten().enumerate() {
            let size = mass_kg * (high - low);
            for (sign, bound) in [(1.0, low), (-1.0, high)] {
                let map = (block.rows(1 + axis, 1) - block.rows(0, 1) * *bound) * (sign / size);
                let subject = Subject::CentreOfMass(body);
                self.push(subject, Cone::NonNegative, columns.clone(), map, DVector::zeros(1));
            }
        }
    }

    fn push(
        &mut self,
        subject: Subject,
        cone: Cone,
        columns: Vec<usize>,
        map: DMatrix<f64>,
        offset: DVector<f64>,
    ) {
        self.subjects.push(subject);
        self.constraints.push(Constraint { cone, columns, map, offset, barrier: 0.0 });
    }

    /// Checks that the prior itself satisfies every constraint.
    fn check_start(&self) -> Result<(), PhysicalError> {
        for (constraint, &subject) in self.constraints.iter().zip(&self.subjects) {
            let margin = constraint.margin(&self.start);
            if margin.is_nan() || margin <= 0.0 {
                return Err(PhysicalError::PriorOutside { what: subject.to_string(), margin });
            }
        }
        Ok(())
    }
}

/// Standard parameters of the bodies on which no torque of `arm` depends and which the base set's parameterisation
/// leaves out. A reduced set drops them together with the parameters that it sets to zero, but these are free.
fn unobservable(arm: &Arm, set: &BaseSet) -> Result<Vec<usize>, PhysicalError> {
    let layout = ParameterLayout::new(arm.dof());
    if set.parameterisation.count() >= layout.count_without_offsets() {
        return Ok(Vec::new());
    }
    let full = BaseSet::find(arm, Parameterisation::full(arm.dof(), false))?;
    let mut free = vec![true; 10 * arm.dof()];
    let observed = full.combinations.iter().flatten().map(|&(k, _)| k);
    let present = set.parameterisation.to_standard.iter().flatten().map(|&(k, _)| k);
    observed.chain(present).filter(|&k| k < 10 * arm.dof()).for_each(|k| free[k] = false);
    Ok((0..free.len()).filter(|&k| free[k]).collect())
}
