#!/usr/bin/env python3
"""What Pinocchio and MuJoCo say about exported arms.

    ARMID_UPDATE=1 cargo test val_export::the_files            # writes exported_<arm>.urdf and .xml
    python3 tests/golden/export.py                             # needs: pip install pin mujoco numpy

loads the files and writes `export.bin`, little-endian, N = 6 joints, S = 1000 states, no padding:

    S x (q[N], qd[N], qdd[N])    f32    states: exact in f32 (|q| <= pi, |qd| <= 3, |qdd| <= 10)
    tilted:     S x torque[N]    f64    Pinocchio from the URDF, with the armature of the MJCF, without friction, Nm
                S x torque[N]    f64    MuJoCo from the MJCF, without friction, Nm
    identified: the same

Gravity is the MJCF's: a URDF has none. Also checked here: both programs read the friction that was written, and MuJoCo's
limits are the URDF's.
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
STATES, DOF = 1000, 6


def torques(arm, states):
    urdf, xml = HERE / f"exported_{arm}.urdf", HERE / f"exported_{arm}.xml"
    mj = mujoco.MjModel.from_xml_path(str(xml))
    model = pin.buildModelFromUrdf(str(urdf))
    model.gravity.linear = mj.opt.gravity.copy()
    model.armature = mj.dof_armature.copy()
    assert model.nv == mj.nv == DOF
    written = [joint for joint in ElementTree.parse(urdf).getroot().iter("joint") if joint.get("type") == "revolute"]
    value = lambda tag, key: np.array([float(joint.find(tag).get(key)) for joint in written])
    for ours, theirs in [
        (value("dynamics", "damping"), mj.dof_damping.ravel()[:DOF]),
        (value("dynamics", "friction"), mj.dof_frictionloss),
        (value("limit", "lower"), mj.jnt_range[:, 0]),
        (value("limit", "upper"), mj.jnt_range[:, 1]),
        (value("limit", "effort"), mj.actuator_ctrlrange[:, 1]),
        (value("limit", "lower"), model.lowerPositionLimit),
    ]:
        assert np.array_equal(ours, theirs), (arm, ours, theirs)
    assert model.existFrame("tool0") and mujoco.mj_name2id(mj, mujoco.mjtObj.mjOBJ_SITE, "tool0") >= 0

    mj.dof_damping[:] = 0.0
    mj.dof_frictionloss[:] = 0.0
    mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, mj_data = model.createData(), mujoco.MjData(mj)
    by_pinocchio, by_mujoco, worst_m = [], [], 0.0
    for q, qd, qdd in states.astype(float).reshape(STATES, 3, DOF):
        by_pinocchio.append(pin.rnea(model, data, q, qd, qdd).copy())
        mj_data.qpos[:], mj_data.qvel[:], mj_data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(mj, mj_data)
        by_mujoco.append(mj_data.qfrc_inverse.copy())
        pin.framesForwardKinematics(model, data, q)
        tool = data.oMf[model.getFrameId("tool0")].translation
        worst_m = max(worst_m, np.linalg.norm(tool - mj_data.site_xpos[0]))
    a, b = np.array(by_pinocchio), np.array(by_mujoco)
    apart = (np.linalg.norm(a - b, axis=1) / np.linalg.norm(a, axis=1)).max()
    print(f"{arm}: Pinocchio and MuJoCo agree to {apart:.1e} in torque and {worst_m:.1e} m in the tool")
    assert worst_m < 1e-12
    return a.astype("<f8").tobytes() + b.astype("<f8").tobytes()


if __name__ == "__main__":
    print(f"Pinocchio {pin.__version__}, MuJoCo {mujoco.__version__}")
    scale = np.repeat([np.pi, 3.0, 10.0], DOF)
    states = (np.random.default_rng(4).uniform(-1.0, 1.0, (STATES, 3 * DOF)) * scale * (1.0 - 1e-6)).astype("<f4")
    out = states.tobytes() + b"".join(torques(arm, states) for arm in ["tilted", "identified"])
    (HERE / "export.bin").write_bytes(out)
    print(f"{len(out)} bytes")
