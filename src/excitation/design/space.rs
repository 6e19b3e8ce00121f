//! The variables of a design, the paper's (26), and the motion that they describe.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use crate::dot::dot;
use crate::dynamics::Motion;
use crate::excitation::FourierSeries;

/// Which parts of the series (24) are free.
#[derive(Debug, Clone, PartialEq)]
pub struct Variables {
    /// Order L of the series.
    pub order: usize,
    /// Period 2π/ω, s: the fixed value, or the starting value of the search.
    pub period_s: f64,
    /// Shortest and longest period, s, if it is free. All joints share one frequency, since the motion is periodic only
    /// then.
    pub period_range_s: Option<[f64; 2]>,
    /// Offsets q_j0 (rad) that are fixed, joint by joint; `None` for free ones.
    pub fixed_offsets_rad: Vec<Option<f64>>,
    /// Whether the motion passes through rest: q̇(0) = q̈(0) = 0, i.e. Σ a_l = 0 and Σ l b_l = 0.
    pub rest_start: bool,
}

/// The map from the vector x of free variables to the motion at N equidistant times of one period.
///
/// For every joint x holds the offset (if free) and the coefficients y of c = Z y: Z is the identity, or an orthonormal
/// basis of the series that pass through rest. With τ = ω t,
///
/// ```text
/// q = q₀ + (1/ω) S_q c,   q̇ = S_v c,   q̈ = ω S_a c
/// ```
///
/// so for a fixed period all three are linear in x. A free period enters as the last variable ln T.
#[derive(Debug, Clone)]
pub struct DesignSpace {
    variables: Variables,
    samples: usize,
    /// Z, 2L × m.
    null_space: DMatrix<f64>,
    /// S_q Z, S_v Z, S_a Z, N × m.
    shapes: [DMatrix<f64>; 3],
    /// Position of each joint's offset (if free) and first coefficient in x.
    offset_at: Vec<Option<usize>>,
    coefficients_at: Vec<usize>,
    count: usize,
}

impl DesignSpace {
    /// The space of `variables`, sampled at `samples` times.
    pub fn new(variables: Variables, samples: usize) -> Self {
        let order = variables.order;
        let null_space = if variables.rest_start {
            let ones = DVector::from_element(order, 1.0);
            let ramp = DVector::from_fn(order, |l, _| (l + 1) as f64);
            block_diagonal(&complement(&ones), &complement(&ramp))
        } else {
            DMatrix::identity(2 * order, 2 * order)
        };
        let shape = |f: fn(f64, f64, f64) -> (f64, f64)| {
            DMatrix::from_fn(samples, 2 * order, |k, c| {
                let l = (c % order + 1) as f64;
                let (sin, cos) = (l * TAU * k as f64 / samples as f64).sin_cos();
                let (of_a, of_b) = f(l, sin, cos);
                if c < order { of_a } else { of_b }
            }) * &null_space
        };
        let shapes = [
            shape(|l, sin, cos| (sin / l, -cos / l)),
            shape(|_, sin, cos| (cos, sin)),
            shape(|l, sin, cos| (-l * sin, l * cos)),
        ];
        let mut count = 0;
        let (mut offset_at, mut coefficients_at) = (Vec::new(), Vec::new());
        for fixed in &variables.fixed_offsets_rad {
            offset_at.push(fixed.is_none().then_some(count));
            count += usize::from(fixed.is_none());
            coefficients_at.push(count);
            count += null_space.ncols();
        }
        count += usize::from(variables.period_range_s.is_some());
        Self { variables, samples, null_space, shapes, offset_at, coefficients_at, count }
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.coefficients_at.len()
    }

    /// Length of x.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number N of sampling times.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// The free variables.
    pub fn variables(&self) -> &Variables {
        &self.variables
    }

    /// Longest period that x may have, s, which determines the distance between samples.
    pub fn longest_period_s(&self) -> f64 {
        self.variables.period_range_s.map_or(self.variables.period_s, |[_, longest]| longest)
    }

    /// ω L h, the phase the fastest harmonic advances between two samples h apart, rad.
    pub fn finest_phase_rad(&self) -> f64 {
        TAU * self.variables.order as f64 / self.samples as f64
    }

    /// The position of ln T in x, if the period is free.
    pub fn log_period_at(&self) -> Option<usize> {
        self.variables.period_range_s.map(|_| self.count - 1)
    }

    /// Period of x, s.
    pub fn period_s(&self, x: &[f64]) -> f64 {
        self.log_period_at().map_or(self.variables.period_s, |at| x[at].exp())
    }

    fn offset_rad(&self, x: &[f64], joint: usize) -> f64 {
        match (self.offset_at[joint], self.variables.fixed_offsets_rad[joint]) {
            (Some(at), _) => x[at],
            (None, fixed) => fixed.unwrap_or_default(),
        }
    }

    fn coefficients<'a>(&self, x: &'a [f64], joint: usize) -> &'a [f64] {
        let at = self.coefficients_at[joint];
        &x[at..at + self.null_space.ncols()]
    }

    /// The series described by x.
    pub fn series(&self, x: &[f64]) -> FourierSeries {
        let order = self.variables.order;
        let rows: Vec<DVector<f64>> = (0..self.joints())
            .map(|j| &self.null_space * DVector::from_column_slice(self.coefficients(x, j)))
            .collect();
        FourierSeries {
            period_s: self.period_s(x),
            q0_rad: (0..self.joints()).map(|j| self.offset_rad(x, j)).collect(),
            a_rad_s: rows.iter().map(|c| c.as_slice()[..order].to_vec()).collect(),
            b_rad_s: rows.iter().map(|c| c.as_slice()[order..].to_vec()).collect(),
        }
    }

    /// The x of this space closest to `series`: exact if the series lies in the space, otherwise a projection onto it.
    pub fn project(&self, series: &FourierSeries) -> Vec<f64> {
        let order = self.variables.order;
        let mut x = vec![0.0; self.count];
        for j in 0..self.joints() {
            if let Some(at) = self.offset_at[j] {
                x[at] = series.q0_rad[j];
            }
            let take = |row: &[f64], l: usize| row.get(l).copied().unwrap_or_default();
            let c = DVector::from_fn(2 * order, |k, _| {
                if k < order {
                    take(&series.a_rad_s[j], k)
                } else {
                    take(&series.b_rad_s[j], k - order)
                }
            });
            let y = self.null_space.tr_mul(&c);
            let at = self.coefficients_at[j];
            x[at..at + y.len()].copy_from_slice(y.as_slice());
        }
        if let Some(at) = self.log_period_at() {
            x[at] = series.period_s.ln();
        }
        x
    }

    /// x with every coefficient multiplied by `factor`: the same motion about its offsets, scaled in size.
    pub fn scaled(&self, x: &[f64], factor: f64) -> Vec<f64> {
        let mut out = x.to_vec();
        for &at in &self.coefficients_at {
            out[at..at + self.null_space.ncols()].iter_mut().for_each(|c| *c *= factor);
        }
        out
    }

    /// Writes the motion of x into `motion` (N samples).
    pub fn motion(&self, x: &[f64], motion: &mut Motion) {
        let omega = TAU / self.period_s(x);
        for j in 0..self.joints() {
            let c = self.coefficients(x, j);
            let q = motion.q_rad.joint_mut(j);
            q.fill(self.offset_rad(x, j));
            add_product(&self.shapes[0], c, 1.0 / omega, q);
            let qd = motion.qd_rad_s.joint_mut(j);
            qd.fill(0.0);
            add_product(&self.shapes[1], c, 1.0, qd);
            let qdd = motion.qdd_rad_s2.joint_mut(j);
            qdd.fill(0.0);
            add_product(&self.shapes[2], c, omega, qdd);
        }
    }

    /// The derivatives of q, q̇, q̈ of joint `joint` (N × n_j each) by the variables on which it depends, and the
    /// positions of these variables in x. `motion` is that of `x`.
    pub fn basis(
        &self,
        x: &[f64],
        motion: &Motion,
        joint: usize,
    ) -> ([DMatrix<f64>; 3], Vec<usize>) {
        let omega = TAU / self.period_s(x);
        let m = self.null_space.ncols();
        let at = self.coefficients_at[joint];
        let places: Vec<usize> = self.offset_at[joint]
            .into_iter()
            .chain(at..at + m)
            .chain(self.log_period_at())
            .collect();
        let first = usize::from(self.offset_at[joint].is_some());
        let factors = [1.0 / omega, 1.0, omega];
        let mut out: [DMatrix<f64>; 3] = std::array::from_fn(|d| {
            let mut basis = DMatrix::zeros(self.samples, places.len());
            basis.columns_mut(first, m).copy_from(&(&self.shapes[d] * factors[d]));
            basis
        });
        if first == 1 {
            out[0].column_mut(0).fill(1.0);
        }
        if self.log_period_at().is_some() {
            // At a fixed phase, q − q₀ is proportional to T and q̈ to 1/T.
            let last = places.len() - 1;
            let offset = self.offset_rad(x, joint);
            for k in 0..self.samples {
                out[0][(k, last)] = motion.q_rad.joint(joint)[k] - offset;
                out[2][(k, last)] = -motion.qdd_rad_s2.joint(joint)[k];
            }
        }
        (out, places)
    }

    /// Adds to `gradient` (by x) the contribution of `bar` (derivatives by q, q̇, q̈ at every sample).
    pub fn pull_back(&self, x: &[f64], motion: &Motion, bar: &Motion, gradient: &mut [f64]) {
        let omega = TAU / self.period_s(x);
        let m = self.null_space.ncols();
        for j in 0..self.joints() {
            let (q, qd, qdd) = (bar.q_rad.joint(j), bar.qd_rad_s.joint(j), bar.qdd_rad_s2.joint(j));
            if let Some(at) = self.offset_at[j] {
                gradient[at] += q.iter().sum::<f64>();
            }
            let at = self.coefficients_at[j];
            for c in 0..m {
                let column = |d: usize| self.shapes[d].column(c);
                gradient[at + c] += dot(column(0).as_slice(), q) / omega
                    + dot(column(1).as_slice(), qd)
                    + dot(column(2).as_slice(), qdd) * omega;
            }
            if let Some(at) = self.log_period_at() {
                let offset = self.offset_rad(x, j);
                let angle = motion.q_rad.joint(j).iter().zip(q).map(|(q, bar)| (q - offset) * bar);
                gradient[at] += angle.sum::<f64>() - dot(motion.qdd_rad_s2.joint(j), qdd);
            }
        }
    }
}

/// `out += factor · matrix · x`.
fn add_product(matrix: &DMatrix<f64>, x: &[f64], factor: f64, out: &mut [f64]) {
    for (column, &value) in matrix.column_iter().zip(x) {
        for (out, entry) in out.iter_mut().zip(column.as_slice()) {
            *out += factor * value * entry;
        }
    }
}

/// Orthonormal basis of the vectors orthogonal to `normal` (n × (n − 1)): the last columns of the
/// Householder reflection that maps it onto the first axis.
fn complement(normal: &DVector<f64>) -> DMatrix<f64> {
    let n = normal.len();
    let mut u = normal.normalize();
    u[0] += 1.0;
    let reflection = DMatrix::identity(n, n) - &u * u.transpose() * (2.0 / u.norm_squared());
    reflection.columns(1, n - 1).into_owned()
}

fn block_diagonal(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(a.nrows() + b.nrows(), a.ncols() + b.ncols());
    out.view_mut((0, 0), a.shape()).copy_from(a);
    out.view_mut(a.shape(), b.shape()).copy_from(b);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::Reference;

    fn space(rest_start: bool, free_period: bool) -> DesignSpace {
        DesignSpace::new(
            Variables {
                order: 4,
                period_s: 8.0,
                period_range_s: free_period.then_some([5.0, 20.0]),
                fixed_offsets_rad: vec![None, Some(-1.5), None],
                rest_start,
            },
            40,
        )
    }

    fn some_x(space: &DesignSpace) -> Vec<f64> {
        let mut x: Vec<f64> = (0..space.count()).map(|k| (1.7 * k as f64 + 0.3).sin()).collect();
        if let Some(at) = space.log_period_at() {
            x[at] = 9f64.ln();
        }
        x
    }

    #[test]
    fn the_motion_is_that_of_the_series_and_rest_is_rest() {
        for (rest, free) in [(false, false), (true, false), (true, true)] {
            let space = space(rest, free);
            let x = some_x(&space);
            let mut motion = Motion::at_rest(3, 40);
            space.motion(&x, &mut motion);
            let series = space.series(&x);
            let back = space.project(&series);
            let [mut q, mut qd, mut qdd] = [[0.0; 3]; 3];
            for k in 0..40 {
                series.sample(series.period_s * k as f64 / 40.0, &mut q, &mut qd, &mut qdd);
                for j in 0..3 {
                    assert!((q[j] - motion.q_rad.joint(j)[k]).abs() < 1e-12);
                    assert!((qd[j] - motion.qd_rad_s.joint(j)[k]).abs() < 1e-12);
                    assert!((qdd[j] - motion.qdd_rad_s2.joint(j)[k]).abs() < 1e-12);
                    if rest && k == 0 {
                        assert!(qd[j].abs() < 1e-13 && qdd[j].abs() < 1e-13);
                    }
                }
            }
            for (a, b) in x.iter().zip(&back) {
                assert!((a - b).abs() < 1e-12);
            }
        }
    }

    /// The motion is linear in x (period aside): with h = 1e-6, differences of the motion are exact
    /// to round-off 1e-10, and to h for the period.
    #[test]
    fn basis_and_pull_back_are_the_derivatives_of_the_motion() {
        let space = space(true, true);
        let x = some_x(&space);
        let (mut motion, mut up, mut down) =
            (Motion::at_rest(3, 40), Motion::at_rest(3, 40), Motion::at_rest(3, 40));
        space.motion(&x, &mut motion);
        let h = 1e-6;
        let bar = motion.clone();
        let mut pulled = vec![0.0; x.len()];
        space.pull_back(&x, &motion, &bar, &mut pulled);
        for v in 0..x.len() {
            let mut moved = x.clone();
            moved[v] += h;
            space.motion(&moved, &mut up);
            moved[v] -= 2.0 * h;
            space.motion(&moved, &mut down);
            let mut sum = 0.0;
            for j in 0..3 {
                let (basis, places) = space.basis(&x, &motion, j);
                let column = places.iter().position(|&p| p == v);
                let pairs = [
                    (&up.q_rad, &down.q_rad, &bar.q_rad),
                    (&up.qd_rad_s, &down.qd_rad_s, &bar.qd_rad_s),
                    (&up.qdd_rad_s2, &down.qdd_rad_s2, &bar.qdd_rad_s2),
                ];
                for (d, (up, down, bar)) in pairs.into_iter().enumerate() {
                    for k in 0..40 {
                        let slope = (up.joint(j)[k] - down.joint(j)[k]) / (2.0 * h);
                        let stated = column.map_or(0.0, |c| basis[d][(k, c)]);
                        assert!((slope - stated).abs() < 1e-7, "variable {v}");
                        sum += slope * bar.joint(j)[k];
                    }
                }
            }
            assert!((sum - pulled[v]).abs() < 1e-5, "variable {v}: {sum} {}", pulled[v]);
        }
    }
}
