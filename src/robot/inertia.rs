//! Inertial parameters of one body, and the test whether any mass distribution can have them.

use nalgebra::{Matrix3, Matrix4, Vector3};

/// The ten inertial parameters of a body about its joint frame, in the paper's order (7):
/// `[m, mρx, mρy, mρz, A, B, C, D, E, F]` in kg, kg m and kg m².
///
/// The inertia matrix about the frame's origin is the paper's (8):
/// `[[A, −F, −E], [−F, B, −D], [−E, −D, C]]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkInertia {
    /// `[m, mρx, mρy, mρz, A, B, C, D, E, F]`.
    pub parameters: [f64; 10],
}

impl LinkInertia {
    /// From mass, centre of mass and the inertia matrix about the centre of mass (frame axes).
    ///
    /// Steiner: `J_O = J_c + m (|ρ|² 1 − ρ ρᵀ)`.
    pub fn from_com(mass_kg: f64, com_m: Vector3<f64>, inertia_com_kg_m2: Matrix3<f64>) -> Self {
        let about_origin = inertia_com_kg_m2
            + mass_kg * (com_m.norm_squared() * Matrix3::identity() - com_m * com_m.transpose());
        Self::from_moments(mass_kg, mass_kg * com_m, about_origin)
    }

    /// From mass, first moment m·ρ and the inertia matrix about the frame's origin.
    pub fn from_moments(mass_kg: f64, first_moment_kg_m: Vector3<f64>, j: Matrix3<f64>) -> Self {
        let h = first_moment_kg_m;
        Self {
            parameters: [
                mass_kg,
                h.x,
                h.y,
                h.z,
                j[(0, 0)],
                j[(1, 1)],
                j[(2, 2)],
                -j[(1, 2)],
                -j[(0, 2)],
                -j[(0, 1)],
            ],
        }
    }

    /// No mass at all.
    pub fn zero() -> Self {
        Self { parameters: [0.0; 10] }
    }

    /// Mass, kg.
    pub fn mass_kg(&self) -> f64 {
        self.parameters[0]
    }

    /// First moment m·ρ, kg m.
    pub fn first_moment_kg_m(&self) -> Vector3<f64> {
        Vector3::new(self.parameters[1], self.parameters[2], self.parameters[3])
    }

    /// Centre of mass, m; `None` for a body without mass.
    pub fn com_m(&self) -> Option<Vector3<f64>> {
        (self.mass_kg() != 0.0).then(|| self.first_moment_kg_m() / self.mass_kg())
    }

    /// Inertia matrix about the frame's origin, kg m².
    pub fn inertia_kg_m2(&self) -> Matrix3<f64> {
        let [_, _, _, _, a, b, c, d, e, f] = self.parameters;
        Matrix3::new(a, -f, -e, -f, b, -d, -e, -d, c)
    }

    /// Inertia matrix about the centre of mass, kg m²; `None` for a body without mass.
    pub fn inertia_com_kg_m2(&self) -> Option<Matrix3<f64>> {
        let c = self.com_m()?;
        let steiner = c.norm_squared() * Matrix3::identity() - c * c.transpose();
        Some(self.inertia_kg_m2() - self.mass_kg() * steiner)
    }

    /// Pseudo-inertia `[[½ tr(J) 1 − J, h], [hᵀ, m]]` (Wensing, Kim, Slotine 2018). Positive
    /// definite exactly when some positive mass density has these ten moments.
    pub fn pseudo_inertia(&self) -> Matrix4<f64> {
        let j = self.inertia_kg_m2();
        let h = self.first_moment_kg_m();
        let sigma = 0.5 * j.trace() * Matrix3::identity() - j;
        let mut p = Matrix4::zeros();
        p.fixed_view_mut::<3, 3>(0, 0).copy_from(&sigma);
        p.fixed_view_mut::<3, 1>(0, 3).copy_from(&h);
        p.fixed_view_mut::<1, 3>(3, 0).copy_from(&h.transpose());
        p[(3, 3)] = self.mass_kg();
        p
    }

    /// The body with this pseudo-inertia, whose upper left block is Σ: J = tr(Σ) 1 − Σ.
    pub fn from_pseudo_inertia(p: &Matrix4<f64>) -> Self {
        let sigma = p.fixed_view::<3, 3>(0, 0).into_owned();
        let h = p.fixed_view::<3, 1>(0, 3).into_owned();
        Self::from_moments(p[(3, 3)], h, sigma.trace() * Matrix3::identity() - sigma)
    }

    /// Smallest eigenvalue of the pseudo-inertia: positive for a body that can exist.
    pub fn consistency_margin(&self) -> f64 {
        self.pseudo_inertia().symmetric_eigenvalues().min()
    }

    /// The two bodies rigidly joined; parameters about the same frame add.
    pub fn plus(&self, other: &Self) -> Self {
        Self { parameters: std::array::from_fn(|k| self.parameters[k] + other.parameters[k]) }
    }

    /// The body of the same shape with `factor` times the mass.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { parameters: self.parameters.map(|parameter| factor * parameter) }
    }

    /// The remainder of the body without `part`, both about the same frame.
    pub fn minus(&self, part: &Self) -> Self {
        Self { parameters: std::array::from_fn(|k| self.parameters[k] - part.parameters[k]) }
    }

    /// The same body with its parameters about another frame: `placement` is the pose of the present frame in the new
    /// one.
    pub fn transformed(&self, placement: &super::Placement) -> Self {
        let (r, p) = (placement.rotation, placement.translation_m);
        let m = self.mass_kg();
        let h = r * self.first_moment_kg_m();
        let j = r * self.inertia_kg_m2() * r.transpose();
        // J about the new origin: ∫ (|x+p|² 1 − (x+p)(x+p)ᵀ) dm.
        let cross = 2.0 * h.dot(&p) * Matrix3::identity() - h * p.transpose() - p * h.transpose();
        let steiner = m * (p.norm_squared() * Matrix3::identity() - p * p.transpose());
        Self::from_moments(m, h + m * p, j + cross + steiner)
    }
}
/// Principal moments of a tensor, ascending.
pub(super) fn principal_moments(tensor: &Matrix3<f64>) -> [f64; 3] {
    let mut moments: [f64; 3] = tensor.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    moments
}
