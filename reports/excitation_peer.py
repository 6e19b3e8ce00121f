#!/usr/bin/env python3
"""The peer of reports/excitation.md: SciPy's SLSQP on Pinocchio regressors, same problem, fewer constraints.

    python3 reports/excitation_peer.py SECONDS OUT.json      # needs: pip install pin numpy scipy

D-optimal UR5 motion, T = 10 s, order 5, noise 1/1/.7/.15/.15/.15 Nm, 100 samples of one period. Joint position, velocity
and acceleration limits as linear constraints; torque and clearance are left out, which makes the problem easier. Gradients by
forward differences, as SciPy takes them. Prints wall time, CPU time and the geometric mean of sigma when the best improves.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests/golden"))
from pinocchio_arm import ROOT, Arm  # noqa: E402

PERIOD, ORDER, SAMPLES, ROWS = 10.0, 5, 100, 80 * 125
SIGMA = np.array([1.0, 1.0, 0.7, 0.15, 0.15, 0.15])
LIMITS = np.pi * np.array([2, 2, 1, 2, 2, 2]), np.pi, 10.0

arm = Arm(ROOT / "robots/ur5.toml")
w = 2 * np.pi / PERIOD
l = np.arange(1, ORDER + 1)
phase = np.outer(np.arange(SAMPLES) * PERIOD / SAMPLES, w * l)
sin, cos, zero = np.sin(phase), np.cos(phase), np.zeros((SAMPLES, 1))
POSITION = np.hstack([zero + 1, sin / (w * l), -cos / (w * l)])
VELOCITY = np.hstack([zero, cos, sin])
ACCELERATION = np.hstack([zero, -w * l * sin, w * l * cos])


def theta(q, qd, qdd):
    friction = [np.diag(qdd), np.diag(qd), np.diag(np.tanh(qd / 0.02))]
    return np.hstack([arm.regressor(q, qd, qdd), *friction])


def base_columns():
    rng = np.random.default_rng(0)
    rows = [theta(*(rng.uniform(-s, s, 6) for s in (3, 3, 10))) for _ in range(200)]
    stacked, kept, q = np.vstack(rows), [], np.zeros((1200, 0))
    for c in range(stacked.shape[1]):
        rest = stacked[:, c] - q @ (q.T @ stacked[:, c])
        rest -= q @ (q.T @ rest)
        if np.linalg.norm(rest) > 1e-8 * max(np.linalg.norm(stacked[:, c]), 1e-6):
            kept.append(c)
            q = np.hstack([q, rest[:, None] / np.linalg.norm(rest)])
    return kept


BASE = base_columns()
assert len(BASE) == 52


def information(x):
    c = x.reshape(6, -1).T
    q, qd, qdd = POSITION @ c, VELOCITY @ c, ACCELERATION @ c
    rows = [theta(*state)[:, BASE] / SIGMA[:, None] for state in zip(q, qd, qdd)]
    stacked = np.vstack(rows)
    return stacked.T @ stacked * (ROWS / SAMPLES)


best, begun, evaluations = np.inf, time.monotonic(), 0


class Enough(Exception):
    pass


def objective(x):
    global best, evaluations
    evaluations += 1
    lam = information(x)
    sign, logdet = np.linalg.slogdet(lam)
    f = -logdet / 52 if sign > 0 else 1e3
    seconds = time.monotonic() - begun
    if f < best - 1e-2 and (constraint(x) > -1e-6).all():
        best = f
        objective.x = x.copy()
        geo = np.exp(0.5 * np.log(np.diag(np.linalg.inv(lam))).mean())
        cpu = time.process_time()
        print(f"{seconds:7.1f} s wall {cpu:7.1f} s CPU {evaluations:6d} evaluations: f {f:.4f} geometric mean sigma {geo:.6f}", flush=True)
    if seconds > float(sys.argv[1]):
        raise Enough
    return f


def rows(which, bound):
    return np.kron(np.eye(6), which), np.repeat(np.broadcast_to(bound, 6), SAMPLES)


PAIRS = [rows(POSITION, LIMITS[0]), rows(VELOCITY, LIMITS[1]), rows(ACCELERATION, LIMITS[2])]
A = np.vstack([p[0] for p in PAIRS])
B = np.concatenate([p[1] for p in PAIRS])
A, B = np.vstack([-A, A]), np.concatenate([B, B])


def constraint(x):
    return A @ x + B


rng = np.random.default_rng(1)
start = rng.uniform(-1, 1, (6, 1 + 2 * ORDER))
start = start.ravel()
start *= 0.8 * min(1.0, (B / np.abs(A @ start)).min())
try:
    minimize(objective, start, method="SLSQP", constraints={"type": "ineq", "fun": constraint, "jac": lambda x: A},
             options={"maxiter": 1000, "ftol": 1e-6})
    print("converged")
except Enough:
    print("out of time")
c = objective.x.reshape(6, -1)
json.dump({"schema": "armid.trajectory/1", "period_s": PERIOD, "q0_rad": c[:, 0].tolist(),
           "a_rad_s": c[:, 1 : ORDER + 1].tolist(), "b_rad_s": c[:, ORDER + 1 :].tolist()}, open(sys.argv[2], "w"), indent=1)
