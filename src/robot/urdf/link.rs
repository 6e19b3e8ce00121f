//! Reading of the inertia of a link.

use nalgebra::Matrix3;
use urdf_rs::{Inertial, Link};

use super::fault::{UrdfFault, finite, quoted};
use super::read::Reader;
use crate::robot::inertia::{LinkInertia, principal_moments};

impl Reader {
    /// Inertia of a link about its own frame; `None` for a link without mass.
    pub(super) fn link_inertia(&mut self, link: &Link) -> Result<Option<LinkInertia>, UrdfFault> {
        let Inertial { origin, mass, inertia: i } = &link.inertial;
        let place = quoted("link", &link.name);
        let tensor = [
            ("ixx", i.ixx),
            ("ixy", i.ixy),
            ("ixz", i.ixz),
            ("iyy", i.iyy),
            ("iyz", i.iyz),
            ("izz", i.izz),
        ];
        finite(&place, "mass", mass.value)?;
        for (quantity, value) in tensor {
            finite(&place, quantity, value)?;
        }
        if mass.value < 0.0 {
            return Err(UrdfFault::Negative { place, quantity: "mass", value: mass.value });
        }
        if mass.value == 0.0 {
            let empty = tensor.iter().all(|(_, value)| *value == 0.0);
            let fault = UrdfFault::InertiaWithoutMass { link: link.name.clone() };
            return if empty { Ok(None) } else { Err(fault) };
        }
        let central = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
        possible(&link.name, &central)?;
        let frame = self.placement(origin, &place)?;
        let turned = frame.rotation * central * frame.rotation.transpose();
        Ok(Some(LinkInertia::from_com(mass.value, frame.translation_m, turned)))
    }
}

/// Share of the largest moment by which the others may miss it because of rounding.
const ROUNDING: f64 = 1e-9;

/// Checks that the principal moments are positive and obey the triangle inequality.
fn possible(link: &str, central: &Matrix3<f64>) -> Result<(), UrdfFault> {
    let principal_kg_m2 = principal_moments(central);
    let [small, middle, large] = principal_kg_m2;
    let link = link.to_owned();
    if small <= 0.0 {
        Err(UrdfFault::NotPositiveDefinite { link, principal_kg_m2 })
    } else if small + middle <= large && small + middle >= (1.0 - ROUNDING) * large {
        Err(UrdfFault::InfinitelyThin { link, principal_kg_m2 })
    } else if small + middle <= large {
        Err(UrdfFault::Triangle { link, principal_kg_m2 })
    } else {
        Ok(())
    }
}
