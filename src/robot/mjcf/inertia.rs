//! Inertia of a body: as written, or from its geoms.

use nalgebra::{Matrix3, Vector3};
use urdf_rs::{Inertia, Inertial, Mass, Pose, Vec3};

use super::body::Part;
use super::compiler::{Compiler, FromGeoms};
use super::defaults::Defaults;
use super::element::{Element, ORIENTATIONS};
use super::fault::MjcfFault;
use super::geom::geom_inertia;
use super::pose::pose;
use crate::robot::arm::Placement;
use crate::robot::inertia::LinkInertia;

/// Mass, centre of mass, and the moments about it in the axes of the body.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BodyInertia {
    mass_kg: f64,
    com_m: Vector3<f64>,
    central_kg_m2: Matrix3<f64>,
}

impl BodyInertia {
    /// The inertia of the body `name` with these `parts`, in the body's frame.
    pub(super) fn of(
        name: &str,
        parts: &[Part<'_>],
        compiler: &Compiler,
        defaults: &Defaults,
    ) -> Result<Self, MjcfFault> {
        let written = parts.iter().find(|part| part.element.tag == "inertial");
        let as_written = || match written {
            Some(part) => Self::written(part.element, &part.frame, compiler),
            None => Ok(Self::default()),
        };
        let by_geoms = match compiler.from_geoms {
            FromGeoms::Always => true,
            FromGeoms::Auto => written.is_none(),
            FromGeoms::Never => false,
        };
        let inertia = if by_geoms {
            // Massless geoms do not replace a written inertia.
            match Self::of_geoms(name, parts, compiler, defaults)? {
                Some(inertia) => inertia,
                None => as_written()?,
            }
        } else {
            as_written()?
        };
        Ok(inertia.bounded(compiler))
    }

    fn written(
        inertial: &Element,
        frame: &Placement,
        compiler: &Compiler,
    ) -> Result<Self, MjcfFault> {
        inertial.required("pos")?;
        let mass_kg = inertial.required_numbers::<1>("mass")?[0];
        inertial.refuse_negative("mass", mass_kg)?;
        let placement = frame.compose(&pose(inertial, compiler)?);
        let own = match inertial.at_most_one(&["diaginertia", "fullinertia"])? {
            Some("fullinertia") => {
                for orientation in ORIENTATIONS {
                    inertial.at_most_one(&["fullinertia", orientation])?;
                }
                let [xx, yy, zz, xy, xz, yz] = inertial.required_numbers::<6>("fullinertia")?;
                Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
            }
            _ => {
                let moments = inertial.required_numbers::<3>("diaginertia")?;
                Matrix3::from_diagonal(&Vector3::from(moments))
            }
        };
        let central_kg_m2 = placement.rotation * own * placement.rotation.transpose();
        Ok(Self { mass_kg, com_m: placement.translation_m, central_kg_m2 })
    }

    /// The summed inertia of the geoms; `None` if none has mass.
    fn of_geoms(
        name: &str,
        parts: &[Part<'_>],
        compiler: &Compiler,
        defaults: &Defaults,
    ) -> Result<Option<Self>, MjcfFault> {
        let mut sum = LinkInertia::zero();
        for part in parts.iter().filter(|part| part.element.tag == "geom") {
            let geom = defaults.complete(part.element, part.childclass)?;
            if let Some(inertia) = geom_inertia(&geom, compiler, name)? {
                sum = sum.plus(&inertia.transformed(&part.frame));
            }
        }
        let parts = sum.com_m().zip(sum.inertia_com_kg_m2());
        Ok(parts.map(|(com_m, central_kg_m2)| Self {
            mass_kg: sum.mass_kg(),
            com_m,
            central_kg_m2,
        }))
    }

    /// Applies the lower bounds that the compiler sets for every body.
    fn bounded(mut self, compiler: &Compiler) -> Self {
        // A massless body stays a mere frame, although MuJoCo gives it the least mass as well.
        if self.mass_kg == 0.0 {
            return self;
        }
        self.mass_kg = self.mass_kg.max(compiler.least_mass_kg);
        if !compiler.balances && compiler.least_moment_kg_m2 == 0.0 {
            return self;
        }
        let principal = self.central_kg_m2.symmetric_eigen();
        let mut moments = principal.eigenvalues.map(|own| own.max(compiler.least_moment_kg_m2));
        if compiler.balances && 2.0 * moments.max() > moments.sum() {
            moments = Vector3::repeat(moments.mean());
        }
        let axes = principal.eigenvectors;
        self.central_kg_m2 = axes * Matrix3::from_diagonal(&moments) * axes.transpose();
        self
    }

    /// The inertial element for a frame with the same axes and its origin at `anchor_m`.
    pub(super) fn about(&self, anchor_m: &Vector3<f64>) -> Inertial {
        let i = &self.central_kg_m2;
        Inertial {
            origin: Pose { xyz: Vec3((self.com_m - anchor_m).into()), rpy: Vec3::default() },
            mass: Mass { value: self.mass_kg },
            inertia: Inertia {
                ixx: i[(0, 0)],
                ixy: i[(0, 1)],
                ixz: i[(0, 2)],
                iyy: i[(1, 1)],
                iyz: i[(1, 2)],
                izz: i[(2, 2)],
            },
        }
    }
}
