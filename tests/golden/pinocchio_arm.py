"""Robot files (`robots/*.toml`) as Pinocchio models, and the two conventions that differ.

Shared by the scripts that write goldens and by the benchmark against Pinocchio. Reads the TOML itself: nothing of
this program takes part, so a wrong frame or a wrong sign cannot be wrong on both sides.

Parameter order. Pinocchio's dynamic parameters of a body are, about the joint frame,
    [m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz]        with I the matrix entries;
ours are
    [m, mx, my, mz, A, B, C, D, E, F]                       with I = [[A, -F, -E], [-F, B, -D], [-E, -D, C]],
so that A = Ixx, B = Iyy, C = Izz, D = -Iyz, E = -Ixz, F = -Ixy. A regressor column belongs to a parameter: where
the parameter changes sign the column does.
"""

import tomllib
from pathlib import Path

import numpy as np
import pinocchio as pin

ROOT = Path(__file__).resolve().parents[2]

# ours[k] = SIGN[k] * theirs[INDEX[k]], for parameters and for regressor columns alike.
INDEX = np.array([0, 1, 2, 3, 4, 6, 9, 8, 7, 5])
SIGN = np.array([1, 1, 1, 1, 1, 1, 1, -1, -1, -1], dtype=float)


class Arm:
    """A robot file: its Pinocchio model and the friction that Pinocchio does not have."""

    def __init__(self, path):
        spec = tomllib.loads(Path(path).read_text())
        self.name = spec["name"]
        self.model = pin.Model()
        self.model.name = self.name
        parent = 0
        for joint in spec["joint"]:
            rotation = pin.rpy.rpyToMatrix(*map(float, joint["rpy_rad"]))
            placement = pin.SE3(rotation, np.array(joint["xyz_m"], dtype=float))
            parent = self.model.addJoint(parent, pin.JointModelRZ(), placement, joint["name"])
            t = joint["inertia_com_kg_m2"]
            inertia = np.array([[t["xx"], t["xy"], t["xz"]], [t["xy"], t["yy"], t["yz"]], [t["xz"], t["yz"], t["zz"]]])
            body = pin.Inertia(float(joint["mass_kg"]), np.array(joint["com_m"], dtype=float), inertia)
            self.model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        column = lambda key: np.array([float(joint[key]) for joint in spec["joint"]])
        self.rotor = column("rotor_inertia_kg_m2")
        self.viscous = column("viscous_nm_s_rad")
        self.coulomb = column("coulomb_nm")
        self.epsilon = float(spec.get("friction_epsilon_rad_s", 0.02))
        self.model.armature = self.rotor
        self.model.gravity.linear = np.array(spec.get("gravity_m_s2", [0.0, 0.0, -9.81]), dtype=float)
        self.data = self.model.createData()

    @property
    def dof(self):
        return self.model.nv

    def torque(self, q, qd, qdd):
        """Rigid bodies and rotor inertias, without friction, Nm."""
        return pin.rnea(self.model, self.data, q, qd, qdd).copy()

    def friction(self, qd):
        """rv q' + rc tanh(q'/eps), Nm."""
        return self.viscous * qd + self.coulomb * np.tanh(qd / self.epsilon)

    def regressor(self, q, qd, qdd):
        """N x 10 N, bodies in order, our parameter order; rigid bodies only."""
        theirs = pin.computeJointTorqueRegressor(self.model, self.data, q, qd, qdd)
        blocks = theirs.reshape(self.dof, self.dof, 10)
        return (blocks[:, :, INDEX] * SIGN).reshape(self.dof, 10 * self.dof)

    def parameters(self):
        """Inertial parameters of all bodies in our order."""
        return np.concatenate([i.toDynamicParameters()[INDEX] * SIGN for i in list(self.model.inertias)[1:]])

    def mass_matrix(self, q):
        """With armature, kg m^2."""
        upper = np.triu(pin.crba(self.model, self.data, q))
        return upper + np.triu(upper, 1).T

    def acceleration(self, q, qd, torque):
        """Articulated-body algorithm, without friction, rad/s^2."""
        return pin.aba(self.model, self.data, q, qd, torque).copy()

    def energies(self, q, qd):
        """Kinetic energy with the rotors' share, and potential energy, J.

        Whether Pinocchio's kinetic energy counts the armature depends on its version, so the bodies' energy is taken
        with the armature set to zero and the rotors' added here.
        """
        self.model.armature = np.zeros(self.dof)
        bodies = pin.computeKineticEnergy(self.model, self.data, q, qd)
        self.model.armature = self.rotor
        kinetic = bodies + 0.5 * float(self.rotor @ qd**2)
        return kinetic, pin.computePotentialEnergy(self.model, self.data, q)
