//! The parameters of a model: all standard ones, or a chosen few in chosen frames.

use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

use crate::dynamics::{BODY_PARAMETERS, Parameter, ParameterLayout};
use crate::robot::{Arm, LinkInertia, Placement};

/// A linear combination of columns or parameters: `(index, coefficient)` terms.
pub type Terms = Vec<(usize, f64)>;

/// A linear parameterisation of the equations of motion.
///
/// Its parameters p̃ (k of them) span the standard ones, p = L p̃, so that its regressor is Θ L.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameterisation {
    /// Order of the standard parameters.
    pub layout: ParameterLayout,
    /// Name of each parameter.
    pub names: Vec<String>,
    /// SI unit of each parameter.
    pub units: Vec<&'static str>,
    /// Column of L for each parameter: terms over the standard parameters ([`ParameterLayout`]).
    pub to_standard: Vec<Terms>,
    /// Row of L's left inverse for each parameter: its value from the standard parameters.
    pub from_standard: Vec<Terms>,
}

/// The reason why a parameterisation does not exist for an arm.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ParameterisationError {
    /// `--reduced` names nothing known.
    #[error("unknown reduced parameter set \"{name}\": there is \"paper\"")]
    Unknown {
        /// What was asked for.
        name: String,
    },
    /// The paper's set is tied to the UR5's geometry.
    #[error(
        "the paper's reduced set is stated for the UR5: frame {body} should lie on axis {body} of \
         \"{robot}\" but is {distance_m:.4} m away"
    )]
    NotAUr5 {
        /// The arm.
        robot: String,
        /// Body whose frame is off (1-based).
        body: usize,
        /// Distance from the joint axis, m.
        distance_m: f64,
    },
    /// The paper's set is tied to the UR5's number of joints.
    #[error(
        "the paper's reduced set is stated for the UR5 with its {PAPER_DOF} joints: \"{robot}\" has {joints}"
    )]
    Joints {
        /// The arm.
        robot: String,
        /// Its joints.
        joints: usize,
    },
    /// The paper's set is tied to the directions of the UR5's axes.
    #[error(
        "the paper's reduced set is stated for the UR5: frame {body} of \"{robot}\" should be turned by right angles \
         against the paper's, and an entry of its rotation is {difference:.1e} off"
    )]
    Turned {
        /// The arm.
        robot: String,
        /// Body whose frame is turned otherwise (1-based).
        body: usize,
        /// Largest distance of an entry of the rotation from a whole number.
        difference: f64,
    },
}

impl Parameterisation {
    /// All standard parameters of `dof` joints, with or without the constant torques.
    pub fn full(dof: usize, with_offsets: bool) -> Self {
        let layout = ParameterLayout::new(dof);
        let count = if with_offsets { layout.count() } else { layout.count_without_offsets() };
        let unit_terms: Vec<Terms> = (0..count).map(|k| vec![(k, 1.0)]).collect();
        Self {
            layout,
            names: (0..count).map(|k| layout.name(k)).collect(),
            units: (0..count).map(|k| layout.unit(k)).collect(),
            to_standard: unit_terms.clone(),
            from_standard: unit_terms,
        }
    }

    /// All standard parameters of `arm`, or the reduced set named by `--reduced`.
    pub fn of(arm: &Arm, reduced: Option<&str>) -> Result<Self, ParameterisationError> {
        match reduced {
            Some(name) => Self::reduced(name, arm),
            None => Ok(Self::full(arm.dof(), arm.torque_offsets)),
        }
    }

    /// The reduced set named by `--reduced`.
    pub fn reduced(name: &str, arm: &Arm) -> Result<Self, ParameterisationError> {
        match name {
            "paper" => Self::paper(arm),
            _ => Err(ParameterisationError::Unknown { name: name.to_owned() }),
        }
    }

    /// The reduced set of section IV-A: no products of inertia, one coordinate of the centre of mass per body (2: z,
    /// 3: z, 4: y, 5: z, 6: y), and only C of body 1. It has 44 parameters in the order C₁; m, m·com, A, B, C of
    /// bodies 2…6; Ia, rv, rc.
    ///
    /// They refer to the paper's frames, which are parallel to each other with the arm upright (q₂ = q₄ = −π/2 in UR
    /// angles, others 0) and turned by π about z against the UR base frame.
    pub fn paper(arm: &Arm) -> Result<Self, ParameterisationError> {
        let frames = paper_frames(arm)?;
        let layout = ParameterLayout::new(PAPER_DOF);
        let mut set = Self {
            layout,
            names: Vec::new(),
            units: Vec::new(),
            to_standard: Vec::new(),
            from_standard: Vec::new(),
        };
        for (body, placement) in frames.iter().enumerate() {
            let back = placement.inverse();
            let wanted: &[usize] = match PAPER_COM_AXIS[body] {
                None => &[6],
                Some(2) => &[0, 2, 4, 5, 6],
                Some(_) => &[0, 3, 4, 5, 6],
            };
            for &k in wanted {
                let mut unit = LinkInertia::zero();
                unit.parameters[k] = 1.0;
                let column = unit.transformed(&back).parameters;
                let row = (0..10).map(|s| {
                    let mut standard = LinkInertia::zero();
                    standard.parameters[s] = 1.0;
                    standard.transformed(placement).parameters[k]
                });
                set.names.push(format!("{}{}", BODY_PARAMETERS[k], body + 1));
                set.units.push(layout.unit(10 * body + k));
                set.to_standard.push(terms(body, column));
                set.from_standard.push(terms(body, row));
            }
        }
        let drive: [fn(usize) -> Parameter; 3] =
            [Parameter::RotorInertia, Parameter::Viscous, Parameter::Coulomb];
        for kind in drive {
            for j in 0..PAPER_DOF {
                let index = layout.index(kind(j));
                set.names.push(layout.name(index));
                set.units.push(layout.unit(index));
                set.to_standard.push(vec![(index, 1.0)]);
                set.from_standard.push(vec![(index, 1.0)]);
            }
        }
        Ok(set)
    }

    /// Number of parameters k.
    pub fn count(&self) -> usize {
        self.names.len()
    }

    /// Values of this set's parameters for an arm with the given standard parameters.
    pub fn values(&self, standard: &[f64]) -> Vec<f64> {
        self.from_standard.iter().map(|row| evaluate(row, standard)).collect()
    }
}

/// Σ coefficient · values[index].
pub(super) fn evaluate(terms: &Terms, values: &[f64]) -> f64 {
    terms.iter().map(|&(index, coefficient)| coefficient * values[index]).sum()
}

fn terms(body: usize, coefficients: impl IntoIterator<Item = f64>) -> Terms {
    let indexed = coefficients.into_iter().enumerate().map(|(s, c)| (10 * body + s, c));
    indexed.filter(|&(_, c)| c.abs() > 1e-15).collect()
}

const PAPER_DOF: usize = 6;

/// Coordinate of the centre of mass that each body keeps: index into [`BODY_PARAMETERS`].
const PAPER_COM_AXIS: [Option<usize>; PAPER_DOF] =
    [None, Some(3), Some(3), Some(2), Some(3), Some(2)];

/// Origins of the paper's frames 2…6 in their parent frames, m, from the coefficients of (30): 0.11336² = 0.01285,
/// 0.39225² = 0.1539, 0.10915² = 0.01191, 0.09465² = 0.008959. Frame 2 is displaced along its own axis, as section
/// III-D explains, and frame 3 is back in the plane of axis 1.
const PAPER_ORIGINS_M: [[f64; 3]; PAPER_DOF] = [
    [0.0, 0.0, 0.0],
    [0.0, 0.11336, 0.0],
    [0.0, -0.11336, 0.425],
    [0.0, 0.0, 0.39225],
    [0.0, 0.10915, 0.0],
    [0.0, 0.0, 0.09465],
];

/// UR joint angles of the paper's zero pose, rad.
const PAPER_ZERO_RAD: [f64; PAPER_DOF] = {
    let quarter = std::f64::consts::FRAC_PI_2;
    [0.0, -quarter, 0.0, -quarter, 0.0, 0.0]
};

/// Tolerance within which frames of the UR5 count as the paper's, in m and in entries of rotations.
const ROUND_OFF: f64 = 1e-9;

/// Pose of each joint frame in the paper's frame of the same body.
fn paper_frames(arm: &Arm) -> Result<Vec<Placement>, ParameterisationError> {
    if arm.dof() != PAPER_DOF {
        let (robot, joints) = (arm.name.clone(), arm.dof());
        return Err(ParameterisationError::Joints { robot, joints });
    }
    let joint_frames = arm.frames(&PAPER_ZERO_RAD);
    let rotation = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
    let mut origin = joint_frames[0].translation_m;
    let mut out = Vec::with_capacity(PAPER_DOF);
    for (body, joint) in joint_frames.iter().enumerate() {
        origin += rotation * Vector3::from(PAPER_ORIGINS_M[body]);
        let frame = Placement { rotation, translation_m: origin };
        let mut relative = frame.inverse().compose(joint);
        // The frame's origin must lie on the joint axis; otherwise its parameters would have another meaning.
        let axis = joint.rotation.column(2).into_owned();
        let distance_m = (origin - joint.translation_m).cross(&axis).norm();
        if distance_m > ROUND_OFF {
            let robot = arm.name.clone();
            return Err(ParameterisationError::NotAUr5 { robot, body: body + 1, distance_m });
        }
        // All rotations here are quarter turns; rounding keeps cos(π/2) = 6e-17 out of the coefficients.
        let whole = relative.rotation.map(f64::round);
        let difference = (relative.rotation - whole).amax();
        if difference > ROUND_OFF {
            let robot = arm.name.clone();
            return Err(ParameterisationError::Turned { robot, body: body + 1, difference });
        }
        relative.rotation = whole;
        out.push(relative);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_set_is_of_the_ur5_alone() {
        let refused = |change: fn(&mut Arm)| {
            let mut arm = Arm::built_in("ur5").unwrap();
            change(&mut arm);
            Parameterisation::paper(&arm).unwrap_err()
        };
        let seven = refused(|arm| arm.joints.push(arm.joints[5].clone()));
        assert!(matches!(seven, ParameterisationError::Joints { joints: 7, .. }), "{seven}");
        assert!(seven.to_string().contains("6 joints: \"ur5\" has 7"), "{seven}");
        let longer = refused(|arm| arm.joints[2].placement.translation_m.x -= 0.1);
        assert!(matches!(longer, ParameterisationError::NotAUr5 { body: 3, .. }), "{longer}");
        // Joint 6 has another zero; the origin of its frame stays on its axis.
        let turned = refused(|arm| {
            let turn = Placement::from_xyz_rpy([0.0; 3], [0.0, 0.0, 0.3]);
            arm.joints[5].placement = arm.joints[5].placement.compose(&turn);
        });
        assert!(matches!(turned, ParameterisationError::Turned { body: 6, .. }), "{turned}");
    }
}
