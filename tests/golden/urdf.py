#!/usr/bin/env python3
"""A URDF with everything the reader has to interpret, and what Pinocchio's own URDF reader makes of it.

    python3 tests/golden/urdf.py        # needs: pip install pin numpy

writes `interpreted.urdf` (five joints about tilted and negative axes, links fixed ahead of the first joint, between joints
and behind the last, with and without mass, dense inertias in turned inertial frames) and `interpreted.json` (20 random
states with Pinocchio's torque; friction and rotors are left out on both sides).
"""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
AXES = ["0 1 0", "0 0 -1", "0.48 -0.6 0.64", "-1 0 0", "0.6 0 -0.8"]


def text(values):
    return " ".join(f"{v:.4f}" for v in values)


def inertial(rng):
    points = rng.uniform(-0.2, 0.2, (10, 3))
    masses = rng.uniform(0.1, 0.5, 10)
    arms = points - masses @ points / masses.sum()
    i = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms))
    pose = f'<origin xyz="{text(rng.uniform(-0.2, 0.2, 3))}" rpy="{text(rng.uniform(-1.4, 1.4, 3))}"/>'
    entries = [("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2)]
    tensor = " ".join(f'{name}="{i[r, c]:.6f}"' for name, r, c in entries)
    return f'<inertial>{pose}<mass value="{masses.sum():.4f}"/><inertia {tensor}/></inertial>'


def main():
    rng = np.random.default_rng(7)
    lines = ['<?xml version="1.0"?>', "<!-- Written by urdf.py; no real arm. -->", '<robot name="interpreted">']

    def add(link, parent, kind, body, axis=None):
        lines.append(f'  <link name="{link}">{inertial(rng) if body else ""}</link>')
        pose = f'<origin xyz="{text(rng.uniform(-0.3, 0.3, 3))}" rpy="{text(rng.uniform(-1.4, 1.4, 3))}"/>'
        more = f'<axis xyz="{axis}"/><limit lower="-3" upper="3" effort="90" velocity="2"/>' if axis else ""
        lines.append(
            f'  <joint name="{link}_joint" type="{kind}">{pose}<parent link="{parent}"/><child link="{link}"/>{more}</joint>'
        )

    lines.append('  <link name="world"/>')
    add("pedestal", "world", "fixed", True)
    add("base", "pedestal", "fixed", False)
    parent = "base"
    for k, axis in enumerate(AXES, start=1):
        add(f"link{k}", parent, "revolute", k != 3, axis)
        parent = f"link{k}"
        if k in (2, 3):
            add(f"adapter{k}", parent, "fixed", True)
            add(f"plate{k}", f"adapter{k}", "fixed", k == 2)
            parent = f"plate{k}"
    add("flange", parent, "fixed", False)
    add("gripper", "flange", "fixed", True)
    add("camera", "flange", "fixed", True)
    add("tool0", "gripper", "fixed", False)
    lines.append("</robot>")
    urdf = "\n".join(lines) + "\n"
    (HERE / "interpreted.urdf").write_text(urdf)

    model = pin.buildModelFromXML(urdf)
    model.armature = np.zeros(model.nv)
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    data = model.createData()
    states = []
    for _ in range(20):
        q, qd, qdd = (rng.uniform(-b, b, model.nv).round(6) for b in (np.pi, 3.0, 10.0))
        torque = pin.rnea(model, data, q, qd, qdd).copy()
        pin.framesForwardKinematics(model, data, q)
        tool = data.oMf[model.getFrameId("tool0")]
        states.append(
            {
                "q_rad": q.tolist(),
                "qd_rad_s": qd.tolist(),
                "qdd_rad_s2": qdd.tolist(),
                "torque_nm": torque.tolist(),
                "tool0_m": tool.translation.tolist(),
                "tool0_x": tool.rotation[:, 0].tolist(),
            }
        )
    (HERE / "interpreted.json").write_text(json.dumps(states, indent=0) + "\n")


if __name__ == "__main__":
    main()
