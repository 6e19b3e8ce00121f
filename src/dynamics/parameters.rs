//! Names, order and units of the standard parameters: the columns of the full regressor.

use std::fmt;

use crate::robot::{Arm, LinkInertia};

/// The ten inertial parameters of a body in the paper's order (7).
pub const BODY_PARAMETERS: [&str; 10] = ["m", "mx", "my", "mz", "A", "B", "C", "D", "E", "F"];

/// Order of the standard parameters of an arm of N joints: body by body `m mx my mz A B C D E F`, then `Ia` (i_G²
/// C_M), `rv`, `rc` of all joints, then `off` (constant torque). These are the 13 N entries of the paper's (13),
/// followed by N offsets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParameterLayout {
    dof: usize,
}

/// The meaning of one standard parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// Entry `0…9` of [`BODY_PARAMETERS`] of a body (0-based).
    Body(usize, usize),
    /// Reflected rotor inertia of a joint (0-based).
    RotorInertia(usize),
    /// Viscous friction of a joint.
    Viscous(usize),
    /// Coulomb friction of a joint.
    Coulomb(usize),
    /// Constant torque of a joint.
    Offset(usize),
}

/// Name such as `mx3`, `Ia1`, `rv6`: the symbol and the number of the body or joint, from 1.
impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (symbol, j) = match *self {
            Self::Body(body, k) => (BODY_PARAMETERS[k], body),
            Self::RotorInertia(j) => ("Ia", j),
            Self::Viscous(j) => ("rv", j),
            Self::Coulomb(j) => ("rc", j),
            Self::Offset(j) => ("off", j),
        };
        write!(f, "{symbol}{}", j + 1)
    }
}

impl ParameterLayout {
    /// The layout for `dof` joints.
    pub fn new(dof: usize) -> Self {
        Self { dof }
    }

    /// Number of parameters with offsets: 14 N.
    pub fn count(&self) -> usize {
        14 * self.dof
    }

    /// Number of parameters of the paper's (13), without offsets: 13 N.
    pub fn count_without_offsets(&self) -> usize {
        13 * self.dof
    }

    /// The parameter at `index`.
    pub fn parameter(&self, index: usize) -> Parameter {
        let n = self.dof;
        match index {
            i if i < 10 * n => Parameter::Body(i / 10, i % 10),
            i if i < 11 * n => Parameter::RotorInertia(i - 10 * n),
            i if i < 12 * n => Parameter::Viscous(i - 11 * n),
            i if i < 13 * n => Parameter::Coulomb(i - 12 * n),
            i => Parameter::Offset(i - 13 * n),
        }
    }

    /// The index of `parameter`.
    pub fn index(&self, parameter: Parameter) -> usize {
        let n = self.dof;
        match parameter {
            Parameter::Body(body, k) => 10 * body + k,
            Parameter::RotorInertia(j) => 10 * n + j,
            Parameter::Viscous(j) => 11 * n + j,
            Parameter::Coulomb(j) => 12 * n + j,
            Parameter::Offset(j) => 13 * n + j,
        }
    }

    /// Name such as `mx3`, `Ia1`, `rv6`: the symbol and the number of the body or joint, from 1.
    pub fn name(&self, index: usize) -> String {
        self.parameter(index).to_string()
    }

    /// `arm` with the standard parameters `standard` (at least 13 N). Constant torques have no place in an [`Arm`]
    /// and are ignored.
    pub fn apply(&self, standard: &[f64], arm: &Arm) -> Arm {
        let value = |parameter| standard[self.index(parameter)];
        let mut arm = arm.clone();
        for (j, joint) in arm.joints.iter_mut().enumerate() {
            let parameters = std::array::from_fn(|k| value(Parameter::Body(j, k)));
            joint.link = LinkInertia { parameters };
            joint.drive.rotor_inertia_kg_m2 = value(Parameter::RotorInertia(j));
            joint.drive.viscous_nm_s_rad = value(Parameter::Viscous(j));
            joint.drive.coulomb_nm = value(Parameter::Coulomb(j));
        }
        arm
    }

    /// SI unit of the parameter at `index`.
    pub fn unit(&self, index: usize) -> &'static str {
        match self.parameter(index) {
            Parameter::Body(_, 0) => "kg",
            Parameter::Body(_, 1..=3) => "kg m",
            Parameter::Body(..) | Parameter::RotorInertia(_) => "kg m2",
            Parameter::Viscous(_) => "Nm s/rad",
            Parameter::Coulomb(_) | Parameter::Offset(_) => "Nm",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_and_parameter_are_inverse() {
        let layout = ParameterLayout::new(6);
        for index in 0..layout.count() {
            assert_eq!(layout.index(layout.parameter(index)), index);
        }
        assert_eq!(layout.name(0), "m1");
        assert_eq!(layout.name(24), "A3");
        assert_eq!(layout.name(60), "Ia1");
        assert_eq!(layout.name(77), "rc6");
        assert_eq!(layout.name(83), "off6");
    }

    #[test]
    fn an_arm_takes_its_own_parameters_without_change() {
        let arm = Arm::built_in("ur10e").unwrap();
        let standard = crate::dynamics::Model::new(&arm).standard_parameters();
        assert_eq!(ParameterLayout::new(6).apply(&standard, &arm), arm);
    }
}
