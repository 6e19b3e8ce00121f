//! Contribution of a geom to the inertia of its body.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use super::compiler::Compiler;
use super::element::Element;
use super::fault::MjcfFault;
use super::pose::{direction, from_z, pose};
use crate::robot::arm::Placement;
use crate::robot::inertia::LinkInertia;

/// Default density, kg/m³: that of water.
const USUAL_DENSITY_KG_M3: f64 = 1000.0;

/// A solid about its centre, with its axis of symmetry along z. Sizes are half lengths and radii, m.
pub(super) enum Solid {
    Ellipsoid([f64; 3]),
    Box([f64; 3]),
    Cylinder { radius_m: f64, half_m: f64 },
    Capsule { radius_m: f64, half_m: f64 },
}

/// The inertia of a geom in the frame of its parent, about that frame's origin; `None` for a geom without mass. `geom`
/// has the defaults of its class, `body` names the body in messages.
pub(super) fn geom_inertia(
    geom: &Element,
    compiler: &Compiler,
    body: &str,
) -> Result<Option<LinkInertia>, MjcfFault> {
    let [first, last] = compiler.groups;
    let group = geom.number("group")?.unwrap_or(0.0);
    let mass_kg = geom.number("mass")?;
    let density_kg_m3 = geom.number("density")?.unwrap_or(USUAL_DENSITY_KG_M3);
    geom.refuse_negative("mass", mass_kg.unwrap_or(0.0))?;
    geom.refuse_negative("density", density_kg_m3)?;
    if group < first || group > last || mass_kg.unwrap_or(density_kg_m3) == 0.0 {
        return Ok(None);
    }
    let kind = geom.text("type").unwrap_or("sphere");
    if matches!(kind, "plane" | "hfield") {
        return Ok(None);
    }
    // A primitive with a mesh is fitted to the mesh.
    if matches!(kind, "mesh" | "sdf") || geom.text("mesh").is_some() {
        return Err(MjcfFault::Mesh { body: body.to_owned(), geom: geom.line() });
    }
    if geom.switch("shellinertia")? == Some(true) {
        return Err(geom.unread("the inertia of shells is"));
    }
    let (placement, solid) = solid(geom, kind, compiler)?;
    let mass_kg = mass_kg.unwrap_or_else(|| density_kg_m3 * solid.volume_m3());
    let moments = Matrix3::from_diagonal(&(mass_kg * solid.moments_m2()));
    let about_centre = LinkInertia::from_com(mass_kg, Vector3::zeros(), moments);
    Ok(Some(about_centre.transformed(&placement)))
}

/// The solid of a geom of a primitive `kind`, and its pose.
pub(super) fn solid(
    geom: &Element,
    kind: &str,
    compiler: &Compiler,
) -> Result<(Placement, Solid), MjcfFault> {
    let (placement, half_m) = stretch(geom, kind, compiler)?;
    Ok((placement, Solid::of(geom, kind, half_m)?))
}

/// The pose of a geom (or site), and half its length, m, if it is given by two points.
pub(super) fn stretch(
    geom: &Element,
    kind: &str,
    compiler: &Compiler,
) -> Result<(Placement, Option<f64>), MjcfFault> {
    let Some([a, b, c, d, e, f]) = geom.numbers::<6>("fromto")? else {
        return Ok((pose(geom, compiler)?, None));
    };
    if kind == "sphere" {
        let choice = "those that fromto can stretch: capsule, cylinder, ellipsoid, box";
        return Err(geom.keyword("type", kind, choice));
    }
    let (from, to) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
    let rotation = from_z(direction(geom, "fromto", from - to)?);
    let placement = Placement { rotation, translation_m: (from + to) / 2.0 };
    Ok((placement, Some((from - to).norm() / 2.0)))
}

impl Solid {
    fn of(geom: &Element, kind: &str, half_m: Option<f64>) -> Result<Self, MjcfFault> {
        let size_m = geom.up_to("size", 3)?.unwrap_or_default();
        let size = |k: usize| -> Result<f64, MjcfFault> {
            let size_m = size_m.get(k).copied().unwrap_or(0.0);
            if size_m > 0.0 {
                return Ok(size_m);
            }
            Err(MjcfFault::Size { place: geom.place(), number: k + 1, size_m })
        };
        // A box between two points is as thick as it is wide.
        let sizes = || -> Result<[f64; 3], MjcfFault> {
            match half_m {
                Some(half_m) => Ok([size(0)?, size(0)?, half_m]),
                None => Ok([size(0)?, size(1)?, size(2)?]),
            }
        };
        let long = || half_m.map_or_else(|| size(1), Ok);
        match kind {
            "sphere" => Ok(Self::Ellipsoid([size(0)?; 3])),
            "ellipsoid" => Ok(Self::Ellipsoid(sizes()?)),
            "box" => Ok(Self::Box(sizes()?)),
            "cylinder" => Ok(Self::Cylinder { radius_m: size(0)?, half_m: long()? }),
            "capsule" => Ok(Self::Capsule { radius_m: size(0)?, half_m: long()? }),
            other => Err(geom.keyword(
                "type",
                other,
                "plane, hfield, sphere, capsule, ellipsoid, cylinder, box, mesh, sdf",
            )),
        }
    }

    fn volume_m3(&self) -> f64 {
        match *self {
            Self::Ellipsoid([a, b, c]) => 4.0 / 3.0 * PI * a * b * c,
            Self::Box([a, b, c]) => 8.0 * a * b * c,
            Self::Cylinder { radius_m: r, half_m } => PI * r * r * 2.0 * half_m,
            Self::Capsule { radius_m: r, half_m } => PI * r * r * (2.0 * half_m + 4.0 / 3.0 * r),
        }
    }

    /// Principal moments divided by the mass, m².
    fn moments_m2(&self) -> Vector3<f64> {
        match *self {
            Self::Ellipsoid([a, b, c]) => {
                Vector3::new(b * b + c * c, a * a + c * c, a * a + b * b) / 5.0
            }
            Self::Box([a, b, c]) => Vector3::new(b * b + c * c, a * a + c * c, a * a + b * b) / 3.0,
            Self::Cylinder { radius_m: r, half_m } => {
                let across = r * r / 4.0 + half_m * half_m / 3.0;
                Vector3::new(across, across, r * r / 2.0)
            }
            Self::Capsule { radius_m: r, half_m } => {
                let height = 2.0 * half_m;
                // Share of the two hemispheres in the volume; the rest is the cylinder between them.
                let spheres = 4.0 * r / (4.0 * r + 3.0 * height);
                let cylinder = 1.0 - spheres;
                // Steiner, with the centre of mass of a hemisphere 3r/8 from its flat side.
                let across = cylinder * (3.0 * r * r + height * height) / 12.0
                    + spheres * (0.4 * r * r + height * (3.0 * r + 2.0 * height) / 8.0);
                let along = cylinder * r * r / 2.0 + spheres * 0.4 * r * r;
                Vector3::new(across, across, along)
            }
        }
    }
}
