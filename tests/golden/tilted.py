#!/usr/bin/env python3
"""Writes `tilted.toml`: a six-joint arm without any structural convenience.

Every joint axis is tilted by random angles, every link has a dense inertia tensor and a centre of mass
off all axes, and gravity has three components. What cancels or vanishes on a UR arm does not here, so a
sign or an axis that is mixed up shows. Numbers are drawn once from a fixed seed and rounded to the digits
printed; the links stay physically consistent because they are point clouds with positive masses.

    python3 tests/golden/tilted.py          # rewrites tests/golden/tilted.toml
"""

from pathlib import Path

import numpy as np

SEED = 20240607


def link(rng):
    """Mass, centre of mass and central inertia of 12 random mass points in a box."""
    masses = rng.uniform(0.05, 0.6, 12)
    points = rng.uniform(-1.0, 1.0, (12, 3)) * [0.15, 0.1, 0.2] + rng.uniform(-0.15, 0.15, 3)
    mass = masses.sum()
    com = masses @ points / mass
    arms = points - com
    inertia = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms))
    return mass, com, inertia


def numbers(values, digits):
    return "[" + ", ".join(f"{v:.{digits}f}" for v in values) + "]"


def main():
    rng = np.random.default_rng(SEED)
    lines = [
        "# Written by tilted.py: random tilted axes, dense links, gravity off every axis. No real arm.",
        "",
        'name = "tilted"',
        "gravity_m_s2 = [2.3, -4.1, -8.6]",
        "friction_epsilon_rad_s = 0.05",
        "",
    ]
    for j in range(6):
        mass, com, i = link(rng)
        lines += [
            "[[joint]]",
            f'name = "tilted_{j + 1}"',
            f"xyz_m = {numbers(rng.uniform(-0.35, 0.35, 3), 3)}",
            f"rpy_rad = {numbers(rng.uniform(-2.8, 2.8, 3), 3)}",
            f"mass_kg = {mass:.4f}",
            f"com_m = {numbers(com, 4)}",
            "inertia_com_kg_m2 = { "
            + ", ".join(
                f"{name} = {i[r, c]:.6f}"
                for name, r, c in [("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2)]
            )
            + " }",
            f"rotor_inertia_kg_m2 = {rng.uniform(0.1, 1.5):.3f}",
            f"viscous_nm_s_rad = {rng.uniform(1.0, 12.0):.2f}",
            f"coulomb_nm = {rng.uniform(1.0, 9.0):.2f}",
            f"gear_ratio = {rng.integers(50, 160)}.0",
            f"torque_constant_nm_a = {rng.uniform(0.05, 0.2):.4f}",
            "position_rad = [-3.141592653589793, 3.141592653589793]",
            "velocity_rad_s = 3.0",
            "acceleration_rad_s2 = 10.0",
            "torque_nm = 200.0",
            "",
        ]
    Path(__file__).with_name("tilted.toml").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
