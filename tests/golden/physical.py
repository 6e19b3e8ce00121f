#!/usr/bin/env python3
"""Physically consistent estimates by Clarabel through CVXPY, from regressors by Pinocchio.

    python3 tests/golden/physical.py        # needs: pip install pin numpy cvxpy clarabel

writes `physical.json`: for a few data sets about the UR5 the whitened triangle R and least-squares estimate of the base
parameters, the prior's weight, and Clarabel's standard parameters and objective for

    minimise 1/2 |W (Y x - tau)|^2 - (its unconstrained minimum) + weight/2 (sum_i |L_i^-1 (P_i - P0_i) L_i^-T|_F^2
             + sum_k ((x_k - x0_k) / x0_k)^2)
    subject to  P_i >= margin P0_i,  Ia, rv, rc >= 0

with P0_i = L_i L_i^T of the robot file. Y are all 78 columns of Pinocchio's regressor: no base map takes part. Prints the
time of Clarabel alone and with CVXPY's modelling. The cases:

    noisy       60 states, noise of the default scenario's size
    very noisy  60 states, five times as much
    wrong       the first with a torque of -3 kg m^2 qdd on every joint: rotor inertias come out negative
    prior       the second with a prior that counts
    entropic    the second with the entropic prior: weight (tr U_i - ln det U_i - 4) and weight (u_k - ln u_k - 1) with
                U_i = L_i^-1 P_i L_i^-T and u_k = x_k / x0_k, and 1e-4 of the squares above
"""

import json
import sys
import time
from pathlib import Path

import clarabel
import cvxpy as cp
import numpy as np

from pinocchio_arm import ROOT, Arm

HERE = Path(__file__).resolve().parent
NOISE_NM = np.array([1.0, 1.0, 0.7, 0.15, 0.15, 0.15])
MARGIN = 1e-4
STATES = 60


def pseudo_inertia(p):
    """4 x 4, linear in [m, mx, my, mz, A, B, C, D, E, F]; p may be numbers or CVXPY expressions."""
    m, x, y, z, a, b, c, d, e, f = p
    return [
        [(b + c - a) / 2, f, e, x],
        [f, (a + c - b) / 2, d, y],
        [e, d, (a + b - c) / 2, z],
        [x, y, z, m],
    ]


def data(arm, rng, noise, wrong):
    """Whitened columns of all 78 parameters and whitened torque."""
    rows, torques = [], []
    x = np.concatenate([arm.parameters(), arm.rotor, arm.viscous, arm.coulomb])
    for _ in range(STATES):
        q, qd, qdd = (rng.uniform(-b, b, arm.dof) for b in (np.pi, 2.0, 8.0))
        friction = [np.diag(qd), np.diag(np.tanh(qd / arm.epsilon))]
        row = np.hstack([arm.regressor(q, qd, qdd), np.diag(qdd), *friction])
        rows.append(row / NOISE_NM[:, None])
        torque = row @ x + noise * NOISE_NM * rng.standard_normal(arm.dof) - wrong * qdd
        torques.append(torque / NOISE_NM)
    return np.vstack(rows), np.concatenate(torques), x


def solve(y, tau, prior, weight, entropic):
    """Clarabel's x, objective above the unconstrained minimum, and times."""
    n = 6
    start = time.perf_counter()
    x = cp.Variable(13 * n)
    # The triangle of all columns stands for all rows.
    r = np.linalg.qr(np.column_stack([y, tau]), mode="r")
    cost = 0.5 * cp.sum_squares(r[:-1, :-1] @ x - r[:-1, -1])
    constraints = []
    square = 0.5 * weight * (1e-4 if entropic else 1.0)
    for i in range(n):
        p0 = np.array(pseudo_inertia(prior[10 * i : 10 * i + 10]))
        inverse = np.linalg.inv(np.linalg.cholesky(p0))
        scaled = inverse @ cp.bmat(pseudo_inertia([x[10 * i + k] for k in range(10)])) @ inverse.T
        u = cp.Variable((4, 4), symmetric=True)
        constraints += [u == scaled, u >> MARGIN * np.eye(4)]
        cost += square * cp.sum_squares(u - np.eye(4))
        if entropic:
            cost += weight * (cp.trace(u) - cp.log_det(u) - 4.0)
    drives = x[10 * n :] / prior[10 * n :]
    constraints.append(drives >= 0)
    cost += square * cp.sum_squares(drives - 1.0)
    if entropic:
        cost += weight * cp.sum(drives - cp.log(drives) - 1.0)
    problem = cp.Problem(cp.Minimize(cost), constraints)
    problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-9, tol_gap_rel=1e-10, tol_feas=1e-10)
    total = time.perf_counter() - start
    unconstrained = 0.5 * np.sum((r[:-1, :-1] @ np.linalg.lstsq(r[:-1, :-1], r[:-1, -1])[0] - r[:-1, -1]) ** 2)
    return x.value, problem.value - unconstrained, problem.status, problem.solver_stats.solve_time, total


def case(name, arm, kept, noise, wrong, weight, entropic=False):
    y, tau, prior = data(arm, np.random.default_rng(5), noise, wrong)
    base = y[:, kept]
    theta = np.linalg.lstsq(base, tau, rcond=None)[0]
    triangle = np.linalg.qr(base, mode="r")
    x, objective, status, seconds, total = solve(y, tau, prior, weight, entropic)
    print(f"{name}: {status}, objective {objective:.9f}, Clarabel {1e3 * seconds:.1f} ms, with CVXPY {1e3 * total:.0f} ms")
    return {
        "name": name,
        "weight": weight,
        "margin": MARGIN,
        "entropic": entropic,
        "triangle": [triangle[i, i:].tolist() for i in range(len(kept))],
        "theta": theta.tolist(),
        "standard": x.tolist(),
        "objective": objective,
    }


if __name__ == "__main__":
    print(f"CVXPY {cp.__version__}, Clarabel {clarabel.__version__}")
    arm = Arm(ROOT / "robots/ur5.toml")
    symbols = ["m", "mx", "my", "mz", "A", "B", "C", "D", "E", "F"]
    names = [f"{s}{i}" for i in range(1, 7) for s in symbols] + [f"{s}{i}" for s in ("Ia", "rv", "rc") for i in range(1, 7)]
    base = json.loads((HERE / "base.json").read_text())[0]
    kept = [names.index(c["name"]) for c in base["combinations"] if c["name"] in names]
    cases = [
        case("noisy", arm, kept, 1.0, 0.0, 1e-4),
        case("very noisy", arm, kept, 5.0, 0.0, 1e-4),
        case("wrong", arm, kept, 1.0, 3.0, 1e-4),
        case("prior", arm, kept, 5.0, 0.0, 1.0),
        case("entropic", arm, kept, 5.0, 0.0, 1.0, True),
    ]
    text = json.dumps(cases)
    if "--print" not in sys.argv:
        (HERE / "physical.json").write_text(text)
    print(f"{len(text)} bytes")
