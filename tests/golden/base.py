#!/usr/bin/env python3
"""Base parameters of the golden arms from Pinocchio's regressor: ranks and left-to-right combinations.

    python3 tests/golden/base.py        # needs: pip install pin numpy

writes `base.json`. Ranks are those of the singular values of the leading columns, scaled to unit length; the kept columns and
the coefficients come from least squares (SVD) of each column on those kept before it. Neither is how this program finds
them (Gram-Schmidt), and the random states are others.
"""

import json
from pathlib import Path

import numpy as np

from pinocchio_arm import ROOT, Arm

HERE = Path(__file__).resolve().parent
SYMBOLS = ["m", "mx", "my", "mz", "A", "B", "C", "D", "E", "F"]
STATES = 300
# Printed by the script: independent columns stand 0.17 of their length and more off the others, dependent ones 1e-14 and less.
THRESHOLD = 1e-9


def stacked(arm, rng):
    """All columns: inertial, Ia, rv, rc, off; and their names."""
    n = arm.dof
    rows = []
    for _ in range(STATES):
        q, qd, qdd = (rng.uniform(-b, b, n) for b in (np.pi, 3.0, 10.0))
        friction = [np.diag(qd), np.diag(np.tanh(qd / arm.epsilon))]
        rows.append(np.hstack([arm.regressor(q, qd, qdd), np.diag(qdd), *friction, np.eye(n)]))
    numbers = range(1, n + 1)
    names = [f"{s}{i}" for i in numbers for s in SYMBOLS]
    names += [f"{s}{i}" for s in ("Ia", "rv", "rc", "off") for i in numbers]
    return np.vstack(rows), names


def rank(matrix):
    length = np.linalg.norm(matrix, axis=0)
    present = length > THRESHOLD * length.max()
    values = np.linalg.svd(matrix[:, present] / length[present], compute_uv=False)
    return int((values > THRESHOLD * values[0]).sum())


def base_set(matrix, names):
    """Kept columns from left to right, each with the later columns that depend on it."""
    kept, dependent = [], []
    ratios = {"independent": [], "dependent": []}
    for c, column in enumerate(matrix.T):
        length = np.linalg.norm(column)
        if length < THRESHOLD * np.linalg.norm(matrix, axis=0).max():
            continue
        beta = np.linalg.lstsq(matrix[:, kept], column, rcond=None)[0] if kept else np.zeros(0)
        ratio = np.linalg.norm(column - matrix[:, kept] @ beta) / length
        if ratio > THRESHOLD:
            ratios["independent"].append(ratio)
            kept.append(c)
        else:
            ratios["dependent"].append(ratio)
            dependent.append((c, beta))
    combinations = []
    for k, c in enumerate(kept):
        terms = [{"parameter": names[c], "coefficient": 1.0}]
        for d, beta in dependent:
            if k < len(beta) and abs(beta[k]) > 1e-9:
                terms.append({"parameter": names[d], "coefficient": float(f"{beta[k]:.12g}")})
        combinations.append({"name": names[c], "terms": terms})
    print(f"  kept ratios >= {min(ratios['independent']):.1e}, dropped <= {max(ratios['dependent']):.1e}")
    return combinations


def main():
    golden = []
    for file in [ROOT / "robots/ur5.toml", ROOT / "robots/ur10e.toml", HERE / "tilted.toml"]:
        arm = Arm(file)
        matrix, names = stacked(arm, np.random.default_rng(11))
        n = arm.dof
        ranks = {str(k * n): rank(matrix[:, : k * n]) for k in (10, 11, 13, 14)}
        print(arm.name, ranks)
        combinations = base_set(matrix, names)
        assert len(combinations) == ranks[str(14 * n)]
        golden.append({"robot": arm.name, "rank_of_first_columns": ranks, "combinations": combinations})
    (HERE / "base.json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
