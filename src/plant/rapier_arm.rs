//! The arm as a multibody of the physics engine, used for exact forward dynamics without the engine's integrator.

use nalgebra::{DMatrix, DVector, Matrix3};
use rapier3d::dynamics::{
    GenericJointBuilder, JointAxesMask, MassProperties, Multibody, MultibodyIndex, RigidBodyBuilder,
};
use rapier3d::math::DIM;
use rapier3d::pipeline::PhysicsWorld;

use super::engine_math;
use super::error::PlantError;
use crate::robot::{Arm, LinkInertia};

/// Time step h given to the engine, s. The engine's velocity update v⁺ = v + h a solves (M + h ∂c/∂q̇) a = τ − c − g,
/// so that a is the exact acceleration up to a relative error of h |∂c/∂q̇|/|M|. With this h the error is below the
/// round-off of a double.
const INSTANT_S: f64 = 1e-15;

/// Index of the rotation about z among the engine's six joint coordinates.
const ABOUT_Z: usize = DIM + 2;

/// Stiffness k of the spring through which a torque enters, Nm/rad. The engine has no public vector of generalised
/// forces, but a joint spring k (rest − q) with rest = q + τ/k has the same effect. With this k the spring's stiffness
/// is negligible (h² k = 1e-39 kg m² on the diagonal of the mass matrix), and τ is reproduced to round-off because q is
/// 10⁹ times smaller than τ/k.
const TORQUE_SPRING_NM_RAD: f64 = 1e-9;

/// Largest difference allowed in any entry between an inertia tensor and the engine's copy of it, relative to the
/// trace. Eigenvectors, quaternion and reciprocal each cost a few units of round-off.
const TENSOR_TOLERANCE: f64 = 1e-13;

/// An arm in rapier, in reduced coordinates: joint angles, speeds and torques in, accelerations out.
///
/// Rotor inertias enter as the engine's armature, a constant on the diagonal of the mass matrix. Friction does not
/// enter: it belongs to the [drivetrain](super::Drivetrain), and the torque given here is the part of the drive torque
/// that remains after friction. The engine's integrator, which is of first order and dissipates energy, is not used.
///
/// The engine computes an acceleration only as part of a full step, which takes about 10 µs for six joints. Two fifths
/// of the time go to the mass matrix and to the Coriolis matrix of the implicit integrator, which is not used here but
/// cannot be switched off; a fifth to kinematics and Jacobians before and after the step; and a quarter to islands,
/// solver stages and collision detection, which find nothing to do. There are no colliders, contacts or constraints to
/// remove.
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
    /// Builds the multibody. Refuses a link whose inertia no body can have, and an inertia tensor that the engine does
    /// not keep; both errors state the numbers.
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
        // Only one pass of forward kinematics removes the six degrees of freedom that the fixed base initially has,
        // and gives the vectors below their final layout.
        let PhysicsWorld { multibody_joints, bodies, .. } = &mut built.world;
        if let Some(mb) = multibody_joints.get_multibody_mut(multibody) {
            mb.forward_kinematics(bodies, true);
            mb.set_self_contacts_enabled(false);
            // By default the engine damps every joint with 0.1 Nm s/rad.
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

    /// Computes q̈ = (M(q) + diag(Ia))⁻¹ (τ − c(q, q̇) − g(q)), rad/s², with τ the torque that reaches the link side
    /// (drive torque minus friction), Nm. All slices have length N.
    ///
    /// The result depends on the arguments alone, bit for bit, regardless of previous calls. A state that is not finite
    /// gives a result that is not finite, and makes the engine disable the links, so that the arm cannot be used any
    /// more.
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

    /// Updates `qdd_rad_s2`, the result of the last call of [`Self::forward_dynamics`], for an additional torque Δτ =
    /// `more_nm` in the same state: adds M⁻¹ Δτ. This reuses the engine's factorisation of the mass matrix from that
    /// call and takes a small fraction of its time.
    pub fn add_response(&mut self, more_nm: &[f64], qdd_rad_s2: &mut [f64]) {
        self.response.copy_from_slice(more_nm);
        let multibody = multibody_mut(&mut self.world, self.multibody);
        // If the factors are not finite there is no solution, but then the acceleration is not finite either.
        if multibody.inv_augmented_mass().solve_mut(&mut self.response) {
            qdd_rad_s2.iter_mut().zip(&self.response).for_each(|(qdd, more)| *qdd += more);
        }
    }

    /// Accelerations at rest without any torque (rad/s²), and the matrix M⁻¹ (kg⁻¹ m⁻²), whose columns are the changes
    /// of acceleration due to a unit torque on each joint.
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

    /// Torques that hold the links still against gravity, Nm: M⁻¹ τ = −q̈(τ = 0). If the pose is not finite, the result
    /// is not finite either.
    pub(super) fn holding_torque(&mut self, q_rad: &[f64]) -> DVector<f64> {
        let (idle, inverse) = self.response(q_rad);
        let none = DVector::repeat(self.dof(), f64::NAN);
        inverse.lu().solve(&-idle).unwrap_or(none)
    }

    /// Replaces the rotor inertia that the multibody carries at joint `j` (from 0), kg m². A drivetrain that integrates
    /// the rotor itself, because of an elastic gear, sets it to zero.
    pub fn set_rotor_inertia(&mut self, j: usize, rotor_inertia_kg_m2: f64) {
        multibody_mut(&mut self.world, self.multibody).armature_mut()[j] = rotor_inertia_kg_m2;
    }
}

/// The multibody. `RapierArm::new` inserts it, and nothing removes it.
fn multibody_mut(world: &mut PhysicsWorld, index: MultibodyIndex) -> &mut Multibody {
    world.multibody_joints.get_multibody_mut(index).expect("inserted when the arm was built")
}

/// Moves the joints to exactly `q_rad`. The engine accepts displacements only, which are subject to round-off. The
/// second pass removes the round-off of the first (the difference of neighbouring doubles is exact), so that no trace
/// of the previous state remains.
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

/// The link's mass, centre of mass and inertia tensor in the engine's form, that is, with principal moments and axes.
/// The engine's own decomposition of a tensor is not used, because it is wrong for a tilted tensor whose two smallest
/// moments are equal, and for small links.
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
