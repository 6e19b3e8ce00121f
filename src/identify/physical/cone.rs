//! The two cones of the problem, with their parts of an interior-point step: non-negative numbers and positive
//! semidefinite 4 × 4 matrices, scaled by Nesterov and Todd's point.
//!
//! A symmetric matrix is stored as the vector svec of its ten entries, the off-diagonal ones times √2, so that ⟨A,
//! B⟩ = tr(AB) is the scalar product of the vectors.

use nalgebra::{Cholesky, Matrix4, SVector};

/// svec of a symmetric 4 × 4 matrix.
pub type Svec = SVector<f64, 10>;

/// Row and column of each entry of [`Svec`].
const ENTRIES: [(usize, usize); 10] =
    [(0, 0), (1, 1), (2, 2), (3, 3), (0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// svec of a symmetric matrix.
pub fn svec(matrix: &Matrix4<f64>) -> Svec {
    Svec::from_fn(|k, _| {
        let (i, j) = ENTRIES[k];
        if i == j { matrix[(i, i)] } else { std::f64::consts::SQRT_2 * matrix[(i, j)] }
    })
}

/// The symmetric matrix of an svec.
pub fn smat(vector: &[f64]) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    for (&(i, j), &value) in ENTRIES.iter().zip(vector) {
        let entry = if i == j { value } else { value * std::f64::consts::FRAC_1_SQRT_2 };
        matrix[(i, j)] = entry;
        matrix[(j, i)] = entry;
    }
    matrix
}

/// A closed cone that is its own dual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cone {
    /// Numbers ≥ 0.
    NonNegative,
    /// Symmetric 4 × 4 matrices without negative eigenvalue, as svec.
    Semidefinite,
}

impl Cone {
    /// Number of entries of a point.
    pub fn dimension(self) -> usize {
        match self {
            Self::NonNegative => 1,
            Self::Semidefinite => 10,
        }
    }

    /// Contribution to the duality gap on the central path, in units of the barrier parameter: 1 for a number, the
    /// order for a matrix.
    pub fn degree(self) -> usize {
        match self {
            Self::NonNegative => 1,
            Self::Semidefinite => 4,
        }
    }

    /// Smallest eigenvalue of a point: > 0 inside the cone.
    pub fn margin(self, point: &[f64]) -> f64 {
        match self {
            Self::NonNegative => point[0],
            Self::Semidefinite => smat(point).symmetric_eigenvalues().min(),
        }
    }

    /// Logarithm of the number or of the determinant; NaN outside the cone.
    pub fn log_det(self, point: &[f64]) -> f64 {
        match self {
            Self::NonNegative => point[0].ln(),
            Self::Semidefinite => Cholesky::new(smat(point))
                .map_or(f64::NAN, |factor| 2.0 * factor.l().diagonal().map(f64::ln).sum()),
        }
    }

    /// z = s⁻¹ for a point inside, written into `z`.
    pub fn invert(self, s: &[f64], z: &mut [f64]) {
        match self {
            Self::NonNegative => z[0] = 1.0 / s[0],
            Self::Semidefinite => {
                // A point that has left the cone has no inverse; NaN stops the iteration.
                let inverse = smat(s).try_inverse().unwrap_or(Matrix4::repeat(f64::NAN));
                z.copy_from_slice(svec(&inverse).as_slice());
            }
        }
    }

    /// The scaling at a primal and a dual point inside the cone; `None` where one of them is outside.
    pub fn scaling(self, s: &[f64], z: &[f64]) -> Option<Scaling> {
        match self {
            Self::NonNegative => {
                let inside = s[0] > 0.0 && z[0] > 0.0;
                inside.then(|| Scaling::NonNegative {
                    w: (s[0] / z[0]).sqrt(),
                    lambda: (s[0] * z[0]).sqrt(),
                })
            }
            Self::Semidefinite => {
                // S = L₁L₁ᵀ, Z = L₂L₂ᵀ, L₂ᵀL₁ = U Λ Vᵀ: R⁻¹ = Λ^-½ Uᵀ L₂ᵀ.
                let l1 = Cholesky::new(smat(s))?.unpack();
                let l2 = Cholesky::new(smat(z))?.unpack();
                let svd = (l2.transpose() * l1).svd(true, false);
                let lambda = svd.singular_values;
                let root = Matrix4::from_diagonal(&lambda.map(|x| 1.0 / x.sqrt()));
                Some(Scaling::Semidefinite {
                    r_inverse: root * svd.u?.transpose() * l2.transpose(),
                    lambda: lambda.into(),
                })
            }
        }
    }
}

/// Nesterov and Todd's scaling W of a pair (s, z): W⁻ᵀs = W z = λ.
#[derive(Debug, Clone)]
pub enum Scaling {
    /// Of two numbers.
    NonNegative {
        /// √(s/z).
        w: f64,
        /// √(s z).
        lambda: f64,
    },
    /// Of two matrices: W z = RᵀZR, W⁻ᵀs = R⁻¹SR⁻ᵀ, both diagonal.
    Semidefinite {
        /// R⁻¹.
        r_inverse: Matrix4<f64>,
        /// The diagonal λ.
        lambda: [f64; 4],
    },
}

impl Scaling {
    /// W⁻ᵀ s: a primal direction in scaled space.
    pub fn primal(&self, s: &[f64], out: &mut [f64]) {
        match self {
            Self::NonNegative { w, .. } => out[0] = s[0] / w,
            Self::Semidefinite { r_inverse, .. } => {
                let scaled = r_inverse * smat(s) * r_inverse.transpose();
                out.copy_from_slice(svec(&scaled).as_slice());
            }
        }
    }

    /// W⁻¹ z̃: a scaled dual direction back in the dual's own space.
    pub fn dual(&self, z: &[f64], out: &mut [f64]) {
        match self {
            Self::NonNegative { w, .. } => out[0] = z[0] / w,
            Self::Semidefinite { r_inverse, .. } => {
                let unscaled = r_inverse.transpose() * smat(z) * r_inverse;
                out.copy_from_slice(svec(&unscaled).as_slice());
            }
        }
    }

    /// λ \ (target − λ∘λ − a∘b), with target = γ + σμ on the diagonal: the right-hand side of the complementarity
    /// equation after division by λ.
    pub fn complementarity(&self, target: f64, a: &[f64], b: &[f64], out: &mut [f64]) {
        match self {
            Self::NonNegative { lambda, .. } => {
                out[0] = (target - lambda * lambda - a[0] * b[0]) / lambda;
            }
            Self::Semidefinite { lambda, .. } => {
                let (a, b) = (smat(a), smat(b));
                let mut d = 0.5 * (a * b + b * a);
                d.neg_mut();
                for i in 0..4 {
                    d[(i, i)] += target - lambda[i] * lambda[i];
                }
                let quotient = Matrix4::from_fn(|i, j| 2.0 * d[(i, j)] / (lambda[i] + lambda[j]));
                out.copy_from_slice(svec(&quotient).as_slice());
            }
        }
    }

    /// Longest step α with λ + α·direction still in the cone; infinite where there is no limit.
    pub fn longest_step(&self, direction: &[f64]) -> f64 {
        let smallest = match self {
            Self::NonNegative { lambda, .. } => direction[0] / lambda,
            Self::Semidefinite { lambda, .. } => {
                let mut d = smat(direction);
                for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
                    d[(i, j)] /= (lambda[i] * lambda[j]).sqrt();
                }
                d.symmetric_eigenvalues().min()
            }
        };
        if smallest < 0.0 { -1.0 / smallest } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn definite(shift: f64) -> Matrix4<f64> {
        let a = Matrix4::from_fn(|i, j| ((3 * i + 5 * j) as f64 + shift).sin());
        a * a.transpose() + 0.1 * Matrix4::identity()
    }

    #[test]
    fn the_scaling_takes_both_points_to_the_same_diagonal() {
        let (s, z) = (svec(&definite(0.0)), svec(&definite(1.0)));
        let scaling = Cone::Semidefinite.scaling(s.as_slice(), z.as_slice()).unwrap();
        let Scaling::Semidefinite { r_inverse, lambda } = &scaling else { unreachable!() };
        let r = r_inverse.try_inverse().unwrap();
        let expected = Matrix4::from_diagonal(&(*lambda).into());
        let mut scaled = [0.0; 10];
        scaling.primal(s.as_slice(), &mut scaled);
        // Condition numbers below 100: a few hundred roundings.
        assert!((smat(&scaled) - expected).norm() < 1e-12);
        assert!((r.transpose() * smat(z.as_slice()) * r - expected).norm() < 1e-12);
        let mut back = [0.0; 10];
        scaling.dual(&scaled, &mut back);
        assert!((svec(&definite(1.0)) - Svec::from_column_slice(&back)).norm() < 1e-12);
    }

    #[test]
    fn the_longest_step_ends_on_the_boundary() {
        let (s, z) = (definite(0.3), definite(2.0));
        let scaling = Cone::Semidefinite.scaling(svec(&s).as_slice(), svec(&z).as_slice());
        let scaling = scaling.unwrap();
        let direction = svec(&Matrix4::from_fn(|i, j| -1.0 - f64::from(i == j)));
        let mut scaled = [0.0; 10];
        scaling.primal(direction.as_slice(), &mut scaled);
        let step = scaling.longest_step(&scaled);
        let end = s + step * smat(direction.as_slice());
        assert!(end.symmetric_eigenvalues().min().abs() < 1e-12, "step {step}");
    }

    #[test]
    fn a_point_outside_has_no_scaling() {
        let mut outside = definite(0.0);
        outside[(2, 2)] = -1.0;
        let inside = svec(&definite(0.0));
        assert!(Cone::Semidefinite.scaling(svec(&outside).as_slice(), inside.as_slice()).is_none());
        assert!(Cone::NonNegative.scaling(&[1.0], &[0.0]).is_none());
    }
}
