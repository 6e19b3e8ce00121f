#!/usr/bin/env python3
"""Golden dynamics from Pinocchio for the UR5, the UR10e and a random tilted arm.

    python3 tests/golden/tilted.py && python3 tests/golden/dynamics.py      # needs: pip install pin numpy

writes `dynamics_<arm>.bin` and `regressor_<arm>.bin`. Written with pin 4.1.0 and numpy; another version changes at
most the last bits. All numbers little-endian; N = 6 joints, S = 200 states, no padding.

dynamics_<arm>.bin
    8 bytes   "ARMIDDYN"
    3 x u32   format 1, N, S
    S x f32   q[N], qd[N], qdd[N]          inputs: exact in f32, so nothing is lost (|q| <= pi, |qd| <= 3, |qdd| <= 10)
    S x f64   torque[N]                    bodies and rotor inertias, no friction, Nm
              friction[N]                  rv qd + rc tanh(qd/eps), Nm
              mass[N (N + 1) / 2]          upper triangle by rows, with rotor inertias, kg m^2
              acceleration[N]              ABA at (q, qd) for the applied torque 5 kg m^2 x qdd, no friction, rad/s^2
              kinetic, potential           with rotor inertias; J

regressor_<arm>.bin
    8 bytes   "ARMIDREG"
    3 x u32   format 1, N, S
    S x f64   for joint j, for body i >= j: ten numbers d torque_j / d[m mx my mz A B C D E F]_i. Bodies i < j do not
              act on joint j, and on its own joint (i = j) neither m nor mz do: the two are left out.

In some states a joint stands still (qd = 0) or the whole arm does: where velocity products vanish and where tanh is 0.
"""

import struct
from pathlib import Path

import numpy as np

from pinocchio_arm import ROOT, Arm

HERE = Path(__file__).resolve().parent
STATES = 200
SEED = 1
APPLIED_KG_M2 = 5.0
OWN_JOINT_ZEROS = [0, 3]  # m and mz


def states(dof):
    """Random states, exact in f32; every tenth has a joint at rest, every fiftieth stands still."""
    rng = np.random.default_rng(SEED)
    scale = np.repeat([np.pi, 3.0, 10.0], dof)
    x = (rng.uniform(-1.0, 1.0, (STATES, 3 * dof)) * scale * (1.0 - 1e-6)).astype("<f4")
    for s in range(0, STATES, 10):
        x[s, dof + (s // 10) % dof] = 0.0
    x[::50, dof : 2 * dof] = 0.0
    return x


def write(path, magic, dof, *blocks):
    path.write_bytes(magic + struct.pack("<3I", 1, dof, STATES) + b"".join(b.tobytes() for b in blocks))
    print(f"{path.name}: {path.stat().st_size} bytes")


def golden(path):
    arm = Arm(path)
    n = arm.dof
    inputs = states(n)
    records, rows = [], []
    for state in inputs.astype(float):
        q, qd, qdd = state.reshape(3, n)
        torque = arm.torque(q, qd, qdd)
        regressor = arm.regressor(q, qd, qdd)

        # The permutation of parameters and of columns is one statement; this is its proof.
        closed = regressor @ arm.parameters() + arm.rotor * qdd
        assert np.linalg.norm(closed - torque) < 1e-12 * np.linalg.norm(torque), path

        mass = arm.mass_matrix(q)
        kinetic, potential = arm.energies(q, qd)
        assert abs(kinetic - 0.5 * qd @ mass @ qd) <= 1e-12 * (1.0 + kinetic), path
        acceleration = arm.acceleration(q, qd, APPLIED_KG_M2 * qdd)
        upper = mass[np.triu_indices(n)]
        records.append(np.concatenate([torque, arm.friction(qd), upper, acceleration, [kinetic, potential]]))

        blocks = regressor.reshape(n, n, 10)
        for j in range(n):
            assert not blocks[j, :j].any() and np.abs(blocks[j, j, OWN_JOINT_ZEROS]).max() < 1e-13
            rows.append(np.delete(blocks[j, j], OWN_JOINT_ZEROS))
            rows.append(blocks[j, j + 1 :].ravel())
    write(HERE / f"dynamics_{arm.name}.bin", b"ARMIDDYN", n, inputs, np.array(records, dtype="<f8"))
    write(HERE / f"regressor_{arm.name}.bin", b"ARMIDREG", n, np.concatenate(rows).astype("<f8"))


if __name__ == "__main__":
    for file in [ROOT / "robots/ur5.toml", ROOT / "robots/ur10e.toml", HERE / "tilted.toml"]:
        golden(file)
