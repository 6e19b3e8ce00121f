//! The constrained estimate with its σ, certificate and evidence.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::error::PhysicalError;
use super::evidence::{Evidence, bootstrap, noise_root};
use super::information::Information;
use super::program::{ConeProgram, ConeSolution, ProgramError};
use super::realisable::realisability;
use super::scatter::{FileError, Scatter, Sigma};
use super::structure::{Structure, Subject};
use super::weight::{CrossValidation, PriorMetric, PriorWeight, Pulling, cross_validate};
use crate::base::BaseSet;
use crate::identify::covariance::Covariance;
use crate::identify::fit::Fit;
use crate::robot::Arm;

/// How the constrained estimate is made.
#[derive(Debug, Clone, PartialEq)]
pub struct PhysicalOptions {
    /// How deviations from the prior are measured.
    pub metric: PriorMetric,
    /// γ, the weight of the prior.
    pub prior_weight: PriorWeight,
    /// ε: every pseudo-inertia is at least this share of the prior's.
    pub margin: f64,
    /// Draws of the parametric bootstrap behind the p-value; 0 for none.
    pub bootstrap: usize,
    /// Seed of those draws.
    pub seed: u64,
}

impl Default for PhysicalOptions {
    fn default() -> Self {
        Self {
            metric: PriorMetric::default(),
            prior_weight: PriorWeight::default(),
            margin: 1e-4,
            bootstrap: 199,
            seed: 1,
        }
    }
}

/// A physically consistent arm close to the data.
#[derive(Debug, Clone)]
pub struct PhysicalEstimate {
    /// Standard parameters in the order of [`ParameterLayout`](crate::dynamics::ParameterLayout):
    /// 14 N, offsets zero where they are not fitted.
    pub standard: Vec<f64>,
    /// Base parameters of these standard parameters.
    pub base: Vec<f64>,
    /// σ of both.
    pub scatter: Scatter,
    /// Effect of an error of the robot file on each standard parameter.
    pub file_errors: Vec<FileError>,
    /// The unconstrained base parameters θ̂.
    pub unconstrained: Vec<f64>,
    /// Their σ.
    pub unconstrained_sigma: Vec<f64>,
    /// Constraints that are active at the estimate.
    pub active: Vec<Subject>,
    /// How far the solver's answer is from optimal.
    pub certificate: Certificate,
    /// Whether the unconstrained estimate could have been an arm, and what the repair cost.
    pub evidence: Evidence,
    /// The pull to the prior.
    pub prior: Pulling,
    /// How its weight was chosen, where the data chose it.
    pub cross_validation: Option<CrossValidation>,
}

impl PhysicalEstimate {
    /// Relative error that the robot file may have: 1/√γ by its weight γ, but at most 1.
    pub fn file_error(&self) -> f64 {
        self.prior.weight.sqrt().recip().min(1.0)
    }

    /// Whether the robot file, rather than the data, determines standard parameter `k`. It does if more than half of
    /// the file's error remains in the estimate, or if a file that is as wrong as it may be moves the estimate by
    /// more than its σ. This σ accounts only for the noise of the data and would not be the parameter's uncertainty.
    pub fn is_prior(&self, k: usize) -> bool {
        let FileError { stays, share } = self.file_errors[k];
        share > 0.5 || self.file_error() * stays > self.scatter.released.standard[k]
    }
}

/// Proof of optimality.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// Value of the objective ½T + γD, in units of the noise's χ².
    pub objective: f64,
    /// Upper bound on the objective's distance from the minimum.
    pub duality_gap: f64,
    /// ‖∇objective − Aᵀz‖∞ over ‖c‖∞: remaining violation of stationarity.
    pub kkt_residual: f64,
    /// Newton steps.
    pub iterations: usize,
}

/// Estimates standard parameters from `fit`, which identified `set` on `arm`; the arm's own values (from the robot
/// file) are the prior.
pub fn solve(
    arm: &Arm,
    set: &BaseSet,
    fit: &Fit,
    covariance: &Covariance,
    options: &PhysicalOptions,
) -> Result<PhysicalEstimate, PhysicalError> {
    let solver = Solver::new(Structure::new(arm, set, arm, options.margin)?);
    solver.estimate(fit, covariance, options)
}

/// Solves the same arm for one data set after the other.
#[derive(Debug, Clone)]
pub struct Solver {
    structure: Structure,
}

/// One solved program.
#[derive(Debug, Clone)]
pub struct Constrained {
    /// The unknowns of the [`Structure`].
    pub y: DVector<f64>,
    /// T = ‖R (K y − θ̂)‖².
    pub distance: f64,
    /// Proof of optimality.
    pub certificate: Certificate,
    solution: ConeSolution,
}

/// Relative duality gap at which a solution counts as found: far below anything that an estimate's σ could show.
const GAP: f64 = 1e-8;
/// The same for solutions that enter sums only: bootstrap draws, and left-out periods.
pub(super) const ROUGH_GAP: f64 = 1e-6;

impl Solver {
    /// For data about the arm of `structure`.
    pub fn new(structure: Structure) -> Self {
        Self { structure }
    }

    /// Unknowns, base map, cones and prior.
    pub fn structure(&self) -> &Structure {
        &self.structure
    }

    /// The estimate with its certificate, evidence and σ.
    pub fn estimate(
        &self,
        fit: &Fit,
        covariance: &Covariance,
        options: &PhysicalOptions,
    ) -> Result<PhysicalEstimate, PhysicalError> {
        options.check()?;
        let information = Information::of(fit, covariance);
        let metric = options.metric;
        let (weight, cross_validation) = match options.prior_weight {
            PriorWeight::Fixed(weight) => (weight, None),
            PriorWeight::CrossValidated => {
                let chosen = cross_validate(self, &information, &fit.theta_periods, metric)?;
                (chosen.weight, Some(chosen))
            }
        };
        let prior = Pulling { metric, weight };
        let data = self.data(&information, prior);
        let constrained = self.solve(&data, &DVector::zeros(data.map.nrows()), GAP)?;
        let noise = information.noise(covariance);
        let realisable = realisability(&self.structure, &information.theta)?;
        let draws = bootstrap(self, &data, &constrained, &noise_root(&noise), options)?;
        let by_delta = |curvature: &Cholesky<f64, Dyn>| {
            Sigma::by_delta_method(&self.structure, curvature, &data.map, &noise)
        };
        // The entropic program has the prior's curvature in its barriers; the pull's curvature at the prior is used
        // for both metrics.
        let pulls = self.structure.pull_curvature();
        let curvature = data.map.tr_mul(&data.map) + weight * &pulls;
        let curvature = Cholesky::new(curvature).ok_or(ProgramError::NotConvex)?;
        let exceeded = draws.as_ref().map(|draws| draws.exceeded);
        let scatter = Scatter {
            held: by_delta(&constrained.solution.stiffness),
            released: by_delta(&curvature),
            drawn: draws.map(|draws| draws.sigma),
        };
        Ok(PhysicalEstimate {
            standard: self.structure.standard(&constrained.y),
            file_errors: FileError::of(&self.structure, &curvature, &pulls, weight),
            base: (&self.structure.base_map * &constrained.y).as_slice().to_vec(),
            scatter,
            unconstrained: fit.theta.clone(),
            unconstrained_sigma: covariance.sigma(),
            active: constrained.active(&self.structure),
            certificate: constrained.certificate,
            evidence: Evidence { realisable, distance: constrained.distance, exceeded },
            prior,
            cross_validation,
        })
    }

    /// The estimate alone.
    pub fn constrained(
        &self,
        information: &Information,
        prior: Pulling,
    ) -> Result<Constrained, PhysicalError> {
        let data = self.data(information, prior);
        self.solve(&data, &DVector::zeros(data.map.nrows()), GAP)
    }

    /// The program of the data in `information` with the pull `prior`.
    pub(super) fn data(&self, information: &Information, prior: Pulling) -> Data {
        let Self { structure } = self;
        let Pulling { metric, weight } = prior;
        let n = structure.unknowns();
        let map = &information.root * &structure.base_map;
        let mut pulls = DMatrix::zeros(n, n);
        let mut pull = DVector::zeros(n);
        let mut constraints = structure.constraints.clone();
        let constant = match metric {
            PriorMetric::PullBack => structure.add_pulls(weight, &mut pulls, &mut pull),
            PriorMetric::Entropic => {
                structure.add_divergences(weight, &mut pulls, &mut pull, &mut constraints)
            }
        };
        // The quadratic form is expanded about unknowns with K y = θ̂, where the data's part of the objective is
        // zero.
        let centre = structure.with_base(&information.theta);
        let pulled = &pulls * &centre;
        let constant = constant + centre.dot(&(0.5 * &pulled - &pull));
        let hessian = pulls + map.tr_mul(&map);
        let program = ConeProgram { hessian, linear: pull - pulled, centre, constraints };
        Data { map, constant, program }
    }

    /// Solves, to a relative duality gap, for base parameters θ whose whitened difference δ = R (θ − θ̂) from those
    /// of `data` is `deviation`.
    pub(super) fn solve(
        &self,
        data: &Data,
        deviation: &DVector<f64>,
        gap: f64,
    ) -> Result<Constrained, PhysicalError> {
        let mut program = data.program.clone();
        program.linear += data.map.tr_mul(deviation);
        let constant = 0.5 * deviation.norm_squared() + data.constant;
        let solution = program.solve(self.structure.start.clone(), constant, gap)?;
        Ok(Constrained {
            distance: (data.whitened(&solution.y) - deviation).norm_squared(),
            certificate: Certificate {
                objective: solution.objective + constant,
                duality_gap: solution.gap,
                kkt_residual: solution.dual_residual,
                iterations: solution.iterations,
            },
            y: solution.y.clone(),
            solution,
        })
    }
}

/// A program that can be solved for any base parameters near those of its data.
#[derive(Debug, Clone)]
pub(super) struct Data {
    /// R K, b × n.
    pub map: DMatrix<f64>,
    /// Objective at the program's centre.
    constant: f64,
    program: ConeProgram,
}

impl Data {
    /// R (K y − θ̂).
    pub fn whitened(&self, y: &DVector<f64>) -> DVector<f64> {
        &self.map * (y - &self.program.centre)
    }
}

impl Constrained {
    /// Constraints active at the solution: those whose multiplier exceeds their margin (the product of both is the
    /// same tiny number for all constraints).
    fn active(&self, structure: &Structure) -> Vec<Subject> {
        let ConeSolution { multipliers, margins, .. } = &self.solution;
        let found = structure.subjects.iter().zip(multipliers.iter().zip(margins));
        found
            .filter(|(_, (z, margin))| z.iter().map(|z| z * z).sum::<f64>().sqrt() > **margin)
            .map(|(subject, _)| *subject)
            .collect()
    }
}

impl PhysicalOptions {
    fn check(&self) -> Result<(), PhysicalError> {
        let fault = |name, value, requirement| PhysicalError::Setting { name, value, requirement };
        if !(self.margin > 0.0 && self.margin < 1.0) {
            return Err(fault("margin", self.margin, "must lie between 0 and 1"));
        }
        match self.prior_weight {
            PriorWeight::Fixed(w) if !(w > 0.0 && w.is_finite()) => {
                Err(fault("prior weight", w, "must be positive"))
            }
            _ => Ok(()),
        }
    }
}
