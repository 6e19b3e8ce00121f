//! The arm as a multibody of the physics engine: exact forward dynamics, no integration.

use nalgebra::{DMatrix, DVector, Matrix3};
use rapier3d::dynamics::{
    GenericJointBuilder, JointAxesMask, MassProperties, Multibody, MultibodyIndex, RigidBodyBuilder,
};
use rapier3d::math::DIM;
use rapier3d::pipeline::PhysicsWorld;

use super::engine_math;
use super::error::PlantError;
use crate::robot::{Arm, LinkInertia};

/// Step handed to the engine, s. Its velocity update v⁺ = v + h a solves
/// (M + h ∂c/∂q̇) a = τ − c − g, so a is the exact acceleration up to a relative error of h |∂c/∂q̇|/|M|:
/// with this h below the round-off of a double.
const INSTANT_S: f64 = 1e-15;

/// Index of the rotation about z among the engine's six joint coordinates.
const ABOUT_Z: usize = DIM + 2;

/// Stiffness of the spring through which a torque enters, Nm/rad. The engine has no public vector of
/// generalised forces; a joint spring k(rest − q) with rest = q + τ/k is one. With this k its
/// stiffness adds nothing (h² k = 1e-39 kg m² on the diagonal of the mass matrix), and τ is
/// reproduced to round-off because q is 10⁹ times smaller than τ/k.
const TORQUE_SPRING_NM_RAD: f64 = 1e-9;

/// Largest entry by which the engine's copy of an inertia tensor may differ, relative to its trace:
/// eigenvectors, quaternion and reciprocal each cost a few units of round-off.
const TENSOR_TOLERANCE: f64 = 1e-13;

/// An arm in rapier, in reduced coordinates: joint angles, speeds and torques in, accelerations out.
///
/// Rotor inertias enter as the engine's armature, a constant on the diagonal of the mass matrix.
/// Friction does not enter: it belongs to the [drivetrain](super::Drivetrain), and the torque given
/// here is what is left of the drive torque behind it. The engine's integrator, which is of first
/// order and dissipates energy, is not used.
///
/// The engine computes an acceleration only within a full step, which costs about 10 µs for six joints:
/// two fifths for the mass matrix and the Coriolis matrix of its implicit integrator (not used here,
/// and not to be switched off), a fifth for kinematics and Jacobians before and after the step, a
/// quarter for islands, solver stages and collision detection that find nothing to do. There are no
/// colliders, contacts or constraints to remove.
pub struct RapierArm {
    world: PhysicsWorld,
    multibody: MultibodyIndex,
    displacement: Vec<f64>,
    response: DVector<f64>,
}

impl std::fmt::Debug for RapierArm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RapierArm").field("dof", &self.dof()).finish_non_exhaustive()
    }
}

impl RapierArm {
    /// Builds the multibody. A link whose inertia no body can have is refused with its numbers, and
    /// so is a tensor that the engine does not keep.
    pub fn new(arm: &Arm) -> Result<Self, PlantError> {
        let mut world = PhysicsWorld::new();
        world.gravity = engine_math::vector(&arm.gravity_m_s2);
        let parameters = &mut world.integration_parameters;
        parameters.dt = INSTANT_S;
        parameters.num_solver_iterations = 1;
        parameters.num_internal_stabilization_iterations = 0;
        parameters.max_ccd_substeps = 0;

        let locked = JointAxesMask::LIN_AXES | JointAxesMask::ANG_X | JointAxesMask::ANG_Y;
        let mut parent = world.bodies.insert(RigidBodyBuilder::fixed());
        for (i, joint) in arm.joints.iter().enumerate() {
            let properties = mass_properties(&joint.link, i + 1)?;
            let body = world.bodies.insert(
                RigidBodyBuilder::dynamic().can_sleep(false).additional_mass_properties(properties),
            );
            let revolute =
                GenericJointBuilder::new(locked).local_frame1(engine_math::pose(&joint.placement));
            world.insert_multibody_joint(parent, body, revolute);
            world.bodies[body].recompute_mass_properties_from_colliders(&world.colliders);
            parent = body;
        }
        let multibody = world
            .multibody_joints
            .rigid_body_link(parent)
            .map(|link| link.multibody)
            .ok_or(PlantError::Joints { what: "the plant", found: 0, expected: 1 })?;

        let (displacement, response) = (vec![0.0; arm.dof()], DVector::zeros(arm.dof()));
        let mut built = Self { world, multibody, displacement, response };
        // Only after one pass of forward kinematics has the fixed base lost the six freedoms it is
        // born with, and do the vectors below have their final places.
        let PhysicsWorld { multibody_joints, bodies, .. } = &mut built.world;
        if let Some(mb) = multibody_joints.get_multibody_mut(multibody) {
            mb.forward_kinematics(bodies, true);
            mb.set_self_contacts_enabled(false);
            // Born with 0.1 Nm s/rad on every joint.
            mb.damping_mut().fill(0.0);
            for (i, joint) in arm.joints.iter().enumerate() {
                mb.armature_mut()[i] = joint.drive.rotor_inertia_kg_m2;
            }
        }
        Ok(built)
    }

    /// Number of joints N.
    pub fn dof(&self) -> usize {
        self.displacement.len()
    }

    /// q̈ = (M(q) + diag(Ia))⁻¹ (τ − c(q, q̇) − g(q)), rad/s², with τ the torque that reaches the
    /// link side (drive torque minus friction), Nm. All slices have length N.
    ///
    /// The result depends on the arguments alone, bit for bit, whatever was asked before. A state that
    /// is not finite gives a result that is not finite, and makes the engine set the links aside: the
    /// arm is of no use afterwards.
    pub fn forward_dynamics(
        &mut self,
        q_rad: &[f64],
        qd_rad_s: &[f64],
        joint_torque_nm: &[f64],
        qdd_rad_s2: &mut [f64],
    ) {
        let multibody = multibody_mut(&mut self.world, self.multibody);
        move_to(multibody, q_rad, &mut self.displacement);
        multibody.generalized_velocity_mut().copy_from_slice(qd_rad_s);
        for (link, (&q, &torque)) in
            multibody.links_mut().skip(1).zip(q_rad.iter().zip(joint_torque_nm))
        {
            let rest = q + torque / TORQUE_SPRING_NM_RAD;
            link.joint.set_spring(ABOUT_Z, TORQUE_SPRING_NM_RAD, rest);
        }
        self.world.step();
        let multibody = multibody_mut(&mut self.world, self.multibody);
        qdd_rad_s2.copy_from_slice(multibody.generalized_acceleration().as_slice());
    }

    /// Adds M⁻¹ Δτ to `qdd_rad_s2`, which [`Self::forward_dynamics`] has found last: what more torque, Δτ = `more_nm`, adds to it
    /// in the same state. The engine's factors of its mass matrix are those of that call, of whose work this is a small part.
    pub fn add_response(&mut self, more_nm: &[f64], qdd_rad_s2: &mut [f64]) {
        self.response.copy_from_slice(more_nm);
        let multibody = multibody_mut(&mut self.world, self.multibody);
        // Factors that are not finite solve nothing; nor is the acceleration finite then.
        if multibody.inv_augmented_mass().solve_mut(&mut self.response) {
            qdd_rad_s2.iter_mut().zip(&self.response).for_each(|(qdd, more)| *qdd += more);
        }
    }

    /// Accelerations at rest without any torque (rad/s²), and what a unit torque on each joint adds to
    /// them, column by column: M⁻¹, kg⁻¹ m⁻².
    pub(super) fn response(&mut self, q_rad: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let n = self.dof();
        let rest = vec![0.0; n];
        let mut idle = DVector::zeros(n);
        self.forward_dynamics(q_rad, &rest, &rest, idle.as_mut_slice());
        let mut inverse = DMatrix::zeros(n, n);
        for j in 0..n {
            let mut push = rest.clone();
            push[j] = 1.0;
            let mut pushed = DVector::zeros(n);
            self.forward_dynamics(q_rad, &rest, &push, pushed.as_mut_slice());
            inverse.set_column(j, &(pushed - &idle));
        }
        (idle, inverse)
    }

    /// Torques that hold the links still against gravity, Nm: M⁻¹ τ = −q̈(τ = 0). In a pose that is
    /// not finite there are none, and what is returned is not finite either.
    pub(super) fn holding_torque(&mut self, q_rad: &[f64]) -> DVector<f64> {
        let (idle, inverse) = self.response(q_rad);
        let none = DVector::repeat(self.dof(), f64::NAN);
        inverse.lu().solve(&-idle).unwrap_or(none)
    }

    /// Replaces the rotor inertia that the multibody carries at joint `j` (from 0), kg m². A
    /// drivetrain that moves a rotor on its own, behind an elastic gear, sets it to zero.
    pub fn set_rotor_inertia(&mut self, j: usize, rotor_inertia_kg_m2: f64) {
        multibody_mut(&mut self.world, self.multibody).armature_mut()[j] = rotor_inertia_kg_m2;
    }
}

/// The multibody, which `RapierArm::new` has put there and nothing removes.
fn multibody_mut(world: &mut PhysicsWorld, index: MultibodyIndex) -> &mut Multibody {
    world.multibody_joints.get_multibody_mut(index).expect("inserted when the arm was built")
}

/// Brings the joints to exactly `q_rad`. The engine only takes displacements, which round; the second
/// pass removes the rounding of the first (the difference of neighbouring doubles is exact), so that
/// no trace of the previous state remains.
fn move_to(multibody: &mut Multibody, q_rad: &[f64], displacement: &mut [f64]) {
    const PASSES: usize = 4;
    for _ in 0..PASSES {
        let mut there = true;
        for ((d, &q), link) in displacement.iter_mut().zip(q_rad).zip(multibody.links().skip(1)) {
            *d = q - link.joint().coords()[ABOUT_Z];
            there &= *d == 0.0;
        }
        if there {
            return;
        }
        multibody.apply_displacements(displacement);
    }
}

/// The link's mass, centre of mass and inertia tensor in the engine's form: principal moments and
/// the axes they belong to. (The engine's own decomposition of a tensor is wrong for a tilted tensor
/// with two equal smallest moments and for small links, so it is not used.)
fn mass_properties(link: &LinkInertia, joint: usize) -> Result<MassProperties, PlantError> {
    let margin = link.consistency_margin();
    let tensor = link.inertia_com_kg_m2().unwrap_or_else(Matrix3::zeros);
    let eigen = tensor.symmetric_eigen();
    if margin.is_nan() || margin <= 0.0 {
        let mut principal_kg_m2: [f64; 3] = eigen.eigenvalues.into();
        principal_kg_m2.sort_by(f64::total_cmp);
        let mass_kg = link.mass_kg();
        return Err(PlantError::Inertia { joint, mass_kg, principal_kg_m2, margin });
    }
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let com = link.com_m().unwrap_or_default();
    let properties = MassProperties::with_principal_inertia_frame(
        engine_math::vector(&com),
        link.mass_kg(),
        engine_math::vector(&eigen.eigenvalues),
        engine_math::rotation(&axes),
    );
    let kept = properties.reconstruct_inertia_matrix().to_cols_array();
    let difference_kg_m2 = (Matrix3::from_column_slice(&kept) - tensor).amax();
    if difference_kg_m2 > TENSOR_TOLERANCE * tensor.trace() {
        return Err(PlantError::InertiaNotKept { joint, difference_kg_m2 });
    }
    Ok(properties)
}
