#!/usr/bin/env python3
"""What MuJoCo makes of an MJCF with everything the reader has to interpret.

    python3 tests/golden/mjcf.py        # needs: pip install mujoco numpy

reads `classes.xml` (nested default classes, all ways to write an orientation, joints beside the origin of their body and away
from zero, inertia as written and of geoms, frames, a tilted world, a gripper that is locked) and writes `classes.json`: what
MuJoCo compiled of each joint, and 20 random states with its torque (rotors are in it, friction is left out) and the pose of
the site `tip`.
"""

import json
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).resolve().parent
ARM = ["turn", "lift", "bend", "roll", "twist"]
# Where the gripper stands: its range does not reach zero.
SLIDE_M = 0.01


def main():
    model = mujoco.MjModel.from_xml_path(str(HERE / "classes.xml"))
    dof = {name: int(model.joint(name).dofadr[0]) for name in ARM + ["slide"]}
    joints = []
    for name in ARM:
        joint = model.joint(name)
        joints.append(
            {
                "name": name,
                "range_rad": joint.range.tolist() if model.jnt_limited[joint.id] else None,
                "rotor_inertia_kg_m2": float(model.dof_armature[dof[name]]),
                "viscous_nm_s_rad": float(model.dof_damping.reshape(model.nv, -1)[dof[name], 0]),
                "coulomb_nm": float(model.dof_frictionloss[dof[name]]),
            }
        )
    model.dof_damping[:] = 0.0
    model.dof_frictionloss[:] = 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    rng = np.random.default_rng(11)
    columns = [dof[name] for name in ARM]
    states = []
    for _ in range(20):
        q, qd, qdd = (rng.uniform(-b, b, len(ARM)).round(6) for b in (np.pi, 3.0, 10.0))
        data.qpos[:], data.qvel[:], data.qacc[:] = 0.0, 0.0, 0.0
        data.qpos[dof["slide"]] = SLIDE_M
        data.qpos[columns], data.qvel[columns], data.qacc[columns] = q, qd, qdd
        mujoco.mj_inverse(model, data)
        site = data.site("tip")
        states.append(
            {
                "q_rad": q.tolist(),
                "qd_rad_s": qd.tolist(),
                "qdd_rad_s2": qdd.tolist(),
                "torque_nm": data.qfrc_inverse[columns].tolist(),
                "tip_m": site.xpos.tolist(),
                "tip_x": site.xmat.reshape(3, 3)[:, 0].tolist(),
            }
        )
    golden = {"gravity_m_s2": model.opt.gravity.tolist(), "joints": joints, "states": states}
    (HERE / "classes.json").write_text(json.dumps(golden, indent=0) + "\n")
    print(f"MuJoCo {mujoco.__version__}: masses {model.body_mass}")


if __name__ == "__main__":
    main()
