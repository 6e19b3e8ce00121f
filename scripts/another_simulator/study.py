"""Hides effects in the logs of another simulator and writes down what `armid diagnose` calls them.

    pip install mujoco==4.0.0 numpy
    cargo build --release
    python3 scripts/another_simulator/study.py --out reports/another_simulator.md

Logs go to --work and are kept. Two cases run at a time.
"""

import argparse
import json
import math
import subprocess
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from mujoco_ur5 import ROOT, Drive, Run, simulate, write

# What is hidden; names and units of parameters are those of sims/*.toml. Of gears the flanks are hidden as well.
EFFECTS = [
    {},
    {"kind": "stribeck", "joint": 3, "extra_nm": 1.0, "vs_rad_s": 0.08},
    {"kind": "stribeck", "joint": 5, "extra_nm": 0.25, "vs_rad_s": 0.06},
    {"kind": "load_friction", "joint": 2, "mu": 0.01},
    {"kind": "load_friction", "joint": 5, "mu": 0.1},
    {"kind": "presliding", "joint": 4, "stiffness_per_rad": 1000.0},
    {"kind": "presliding", "joint": 2, "stiffness_per_rad": 2000.0},
    {"kind": "reversal_width", "width_rad_s": 0.003},
    {"kind": "reversal_width", "width_rad_s": 0.04},
    {"kind": "reversal_width", "joint": 4, "width_rad_s": 0.005},
    # Another law than the one that is looked for, v / sqrt(v^2 + w^2), whose width is not the same number.
    {"kind": "reversal_width", "algebraic_width_rad_s": 0.01},
    {"kind": "reversal_width", "joint": 4, "algebraic_width_rad_s": 0.04},
    {"kind": "asymmetric_friction", "joint": 3, "viscous_nm_s_rad": 0.15},
    {"kind": "nonlinear_viscous", "joint": 4, "amplitude_nm": 0.2, "exponent": 0.4},
    {"kind": "nonlinear_viscous", "joint": 2, "amplitude_nm": 0.5, "exponent": 2.0},
    {"kind": "position_friction", "joint": 3, "amplitude_nm": 0.3},
    {"kind": "ripple", "joint": 4, "amplitude_nm": 0.06, "order_per_turn": 202.0},
    {"kind": "ripple", "joint": 1, "amplitude_nm": 0.3, "order_per_turn": 101.0},
    {"kind": "spring", "joint": 4, "stiffness_nm_rad": 0.1, "rest_rad": 0.5},
    {"kind": "contact", "joint": 3, "peak_nm": 8.0, "start_s": 33.3, "end_s": 33.6},
    {"kind": "torque_gain", "joint": 3, "error_fraction": 0.02},
    {"kind": "torque_gain", "joint": 4, "error_fraction": 0.05},
    {"kind": "current_offset", "joint": 5, "offset_nm": 0.04},
    {"kind": "time_skew", "delay_s": 0.0005},
    {"kind": "time_skew", "joint": 4, "delay_s": 0.002},
    {"kind": "velocity_lag", "delay_s": 0.003},
    {"kind": "elasticity", "joint": 2, "stiffness_nm_rad": 8000.0, "flank_nm_rad": 8000.0, "flank_nm_s_rad": 10.0},
    {"kind": "elasticity", "joint": 3, "stiffness_nm_rad": 4000.0, "flank_nm_rad": 4000.0, "flank_nm_s_rad": 6.0},
    {"kind": "backlash", "joint": 2, "gap_rad": 3e-4, "flank_nm_rad": 1e5, "flank_nm_s_rad": 90.0},
    {"kind": "backlash", "joint": 3, "gap_rad": 5e-4, "flank_nm_rad": 1e5, "flank_nm_s_rad": 50.0},
    {"kind": "encoder_offset", "joint": 3, "offset_rad": 0.03},
    {"kind": "base_tilt", "tilt_x_rad": 0.0, "tilt_y_rad": 0.015},
    {"kind": "outliers", "fraction": 0.003},
    {"kind": "dropped_samples", "fraction": 0.05},
]

# Drives as they are met: model and friction fed forward; half of the friction, slow feedback; gravity only.
SETTINGS = [
    ("model fed forward, 50 rad/s, 125 Hz", dict(drive=Drive(True, 1.0, 50.0))),
    (
        "half of the friction, 25 rad/s, 250 Hz, other motion",
        dict(drive=Drive(True, 0.5, 25.0), rate_hz=250, trajectory="ur5_validation"),
    ),
    ("gravity only, 50 rad/s, 125 Hz", dict(drive=Drive(False, 0.0, 50.0))),
]


def diagnosed(job):
    """The causes that `armid diagnose` names in one log."""
    work, armid, number, effect, setting = job
    log, answer = work / f"{number}.csv", work / f"{number}.json"
    # Sharp friction asks for short steps.
    widths = [v for k, v in effect.items() if k.endswith("width_rad_s")]
    step_s = min([1e-3] + [0.1 * width for width in widths])
    step_s = 1e-3 / math.ceil(1e-3 / step_s)
    write(log, simulate(Run(effect=effect, step_s=step_s, **setting)))
    done = subprocess.run([armid, "diagnose", log, "--robot", "ur5", "--json", answer], capture_output=True, text=True)
    # 3 is an answer as well: what is identified contradicts the arm.
    if done.returncode not in (0, 3) or not answer.exists():
        raise SystemExit(f"{hidden_in_words(effect)}: {done.stderr}")
    return json.loads(answer.read_text())


def number(value):
    return f"{value:.3g}"


def hidden_in_words(effect):
    if not effect:
        return "nothing"
    place = f" {effect['joint']}" if "joint" in effect else ""
    shown = {k: v for k, v in effect.items() if isinstance(v, float) and not k.startswith("flank")}
    return f"{effect['kind']}{place}: " + ", ".join(f"{k} {number(v)}" for k, v in shown.items())


def named_in_words(causes):
    out = []
    for c in causes:
        place = f" {c['joint']}" if c["joint"] else ""
        sure = "" if c["confidence"] >= 0.5 else " (not sure)"
        numbers = ", ".join(
            f"{name} {number(p['value'])} ({number(p['ci95'][0])} … {number(p['ci95'][1])})"
            for name, p in c["parameters"].items()
            if not name.endswith("phase_rad")
        )
        out.append(f"{c['kind']}{place}{sure}: {numbers}")
    return "; ".join(out) or "nothing"


def is_right(effect, causes):
    """Whether what was hidden is the only thing that is named. Outliers are named joint by joint."""
    if not effect or effect["kind"] == "outliers":
        return all(c["kind"] == effect.get("kind") for c in causes) and bool(causes) == bool(effect)
    return len(causes) == 1 and (
        causes[0]["kind"] == effect["kind"] or effect["kind"] in causes[0]["class"]
    ) and causes[0]["joint"] == effect.get("joint")


def held(effect, causes):
    """How many of the hidden parameters lie in the intervals of the cause, and of how many."""
    if len(causes) != 1 or causes[0]["kind"] != effect.get("kind"):
        return 0, 0
    pairs = [(effect[k], p["ci95"]) for k, p in causes[0]["parameters"].items() if k in effect]
    # Of contacts the margins in time are looked at, not the form of the push; fractions are counted, not estimated.
    if effect["kind"] in ("contact", "dropped_samples"):
        return 0, 0
    return sum(low <= truth <= high for truth, (low, high) in pairs), len(pairs)


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--armid", default=ROOT / "target/release/armid")
    options.add_argument("--work", type=Path, default=Path("/tmp/another_simulator"))
    options.add_argument("--out", type=Path, required=True)
    options = options.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    jobs = [
        (options.work, options.armid, len(EFFECTS) * s + e, effect, setting)
        for s, (_, setting) in enumerate(SETTINGS)
        for e, effect in enumerate(EFFECTS)
    ]
    with ProcessPoolExecutor(2) as pool:
        answers = list(pool.map(diagnosed, jobs))
    right = [is_right(job[3], answer["causes"]) for job, answer in zip(jobs, answers)]
    beside = sum(1 for is_it, answer in zip(right, answers) if is_it and unexplained(answer))
    counts = [held(job[3], answer["causes"]) for job, answer in zip(jobs, answers)]
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout.strip()
    lines = [
        "# Logs of another simulator",
        "",
        "A UR5 in MuJoCo, none of whose equations are armid's, moves with one hidden effect or none (80 s, white noise). Joint",
        "numbers count from 1; “gets” is what `armid diagnose` names, with 95 % intervals. Written by",
        "",
        "    python3 scripts/another_simulator/study.py --out reports/another_simulator.md",
        "",
        f"with the program of commit {commit}.",
        "",
        f"**What was hidden, and nothing else, is named in {sum(right)} of {len(right)} logs, in {beside} of them with something "
        f"left unexplained beside it; the intervals hold "
        f"{sum(c[0] for c in counts)} of {sum(c[1] for c in counts)} of the hidden parameters.**",
    ]
    for s, (name, _) in enumerate(SETTINGS):
        rows = range(len(EFFECTS) * s, len(EFFECTS) * (s + 1))
        lines += ["", f"## Drives: {name}", "", f"{sum(right[r] for r in rows)} of {len(rows)} right.", ""]
        lines += ["| hidden | gets | right |", "|---|---|---|"]
        for r in rows:
            rest = "; " + " and ".join(f"{place(u)} unexplained" for u in unexplained(answers[r])) \
                if unexplained(answers[r]) else ""
            lines.append(
                f"| {hidden_in_words(jobs[r][3])} | {named_in_words(answers[r]['causes'])}{rest} | {'yes' if right[r] else 'no'} |"
            )
    options.out.write_text("\n".join(lines) + "\n")
    print(next(line for line in lines if line.startswith("**")))


def unexplained(answer):
    """What the program says that it cannot explain, as a list."""
    found = answer["unexplained"]
    return found if isinstance(found, list) else [found] if found else []


def place(rest):
    joint = f"joint {rest['joint']}"
    return f"the joints together, {joint} most," if rest.get("of_all_joints") else joint


if __name__ == "__main__":
    main()
