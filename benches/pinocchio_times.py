#!/usr/bin/env python3
"""Times Pinocchio's algorithms from Python on the UR5 and sets them beside `cargo bench --bench dynamics`.

Run by compare.sh. Same arm, same ranges of random states, one thread, state by state. A call from Python converts its
arguments; `difference` (two vectors in, one out, six subtractions) shows about what that costs, so the last column brackets
the ratio: with the call and without it.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/golden"))
from pinocchio_arm import Arm  # noqa: E402

STATES = 512
REPEATS = 40


def microseconds(call, states):
    """Best of the passes over all states: what the machine can do when nothing else runs."""
    best = float("inf")
    for _ in range(REPEATS):
        start = time.perf_counter_ns()
        for state in states:
            call(*state)
        best = min(best, time.perf_counter_ns() - start)
    return best / len(states) / 1e3


def criterion(target, name):
    """Mean time per state and its 95 % interval, us."""
    estimates = json.loads((target / "criterion/dynamics" / name / "new/estimates.json").read_text())
    mean = estimates["mean"]
    interval = mean["confidence_interval"]
    return [1e-3 * x for x in (mean["point_estimate"], interval["lower_bound"], interval["upper_bound"])]


def main():
    target = Path(sys.argv[1])
    arm = Arm(ROOT / "robots/ur5.toml")
    model, data = arm.model, arm.data
    rng = np.random.default_rng(1)
    states = [tuple(rng.uniform(-b, b, arm.dof) for b in (np.pi, 3.0, 10.0)) for _ in range(STATES)]

    call = microseconds(lambda q, qd, qdd: pin.difference(model, q, qd), states)
    theirs = {
        "rnea": microseconds(lambda q, qd, qdd: pin.rnea(model, data, q, qd, qdd), states),
        "computeJointTorqueRegressor": microseconds(
            lambda q, qd, qdd: pin.computeJointTorqueRegressor(model, data, q, qd, qdd), states
        ),
        "crba": microseconds(lambda q, qd, qdd: pin.crba(model, data, q), states),
        "aba": microseconds(lambda q, qd, qdd: pin.aba(model, data, q, qd, qdd), states),
    }
    rows = [
        ("inverse_dynamics", "rnea"),
        ("regressor_single", "computeJointTorqueRegressor"),
        ("regressor_block", "computeJointTorqueRegressor"),
        ("regressor_block_of_64", "computeJointTorqueRegressor"),
        ("mass_matrix", "crba"),
        ("forward_dynamics", "aba"),
    ]
    print(f"UR5, one thread, us per state; Pinocchio {pin.__version__} from Python, call overhead about {call:.2f} us\n")
    print("| armid | us | 95 % | Pinocchio | us | ratio | ratio without the call |")
    print("|---|---|---|---|---|---|---|")
    for ours, other in rows:
        mean, low, high = criterion(target, ours)
        them = theirs[other]
        bare = max(them - call, 0.0)
        print(
            f"| {ours} | {mean:.3f} | {low:.3f}-{high:.3f} | {other} | {them:.2f} | {them / mean:.1f} | {bare / mean:.1f} |"
        )
    print("\nOurs is the mean, Pinocchio's the best of the passes. Ours include friction (tanh) and rotors; Pinocchio's are rigid bodies and armature only.")


if __name__ == "__main__":
    main()
