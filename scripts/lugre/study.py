#!/usr/bin/env python3
"""Hides LuGre friction in 18 logs of armid's own plant, and counts what `armid diagnose` makes of it.

The table in reports/blind_history.md ("Bristles that hold a Stribeck curve") is what this prints:

    cargo build --release --bin armid
    python3 scripts/lugre/study.py --armid target/release/armid --work /tmp/lugre
"""

import argparse
import json
import pathlib
import subprocess

COULOMB_NM = [7.0, 8.0, 6.0, 1.6, 1.5, 1.4]  # robots/ur5.toml
MOTIONS = ["ur5_identification", "ur5_validation"]
# Stiffness in 1/rad, height of the curve over Coulomb friction, v_s in rad/s, joint, damping in s.
LAWS = [
    (1000, 0.25, 0.1, 3, 0.0),
    (3000, 0.25, 0.1, 3, 0.0),
    (1000, 0.3, 0.15, 5, 0.0),
    (3000, 0.4, 0.05, 1, 0.001),
    (10000, 0.25, 0.1, 2, 0.0),
    (2000, 0.4, 0.2, 4, 0.0),
    (500, 0.25, 0.1, 1, 0.003),
]
# The same with one motion and the scenario's own seed.
MORE_LAWS = [
    (1000, 0.25, 0.05, 3, 0.0),
    (3000, 0.25, 0.05, 3, 0.0),
    (1000, 0.25, 0.1, 2, 0.0),
    (10000, 0.25, 0.03, 3, 0.0),
]


def cases():
    """Motion, seed and law of each log."""
    for m, motion in enumerate(MOTIONS):
        for k, law in enumerate(LAWS):
            yield motion, 901 + m * len(LAWS) + k, law
    for law in MORE_LAWS:
        yield MOTIONS[0], 20201109, law


def scenario(motion, seed, law):
    """sims/hidden.toml with this motion, seed and friction, and the truth by the names in a diagnosis."""
    stiffness, share, vs, joint, damping = law
    coulomb = COULOMB_NM[joint - 1]
    root = pathlib.Path(__file__).resolve().parents[2]
    head = (root / "sims/hidden.toml").read_text().split("[[effect]]")[0]
    head = head.replace(MOTIONS[0], motion).replace("seed = 20201109", f"seed = {seed}")
    text = head + "\n".join(
        [
            "[[effect]]",
            'kind = "presliding"',
            f"joint = {joint}",
            f"stiffness_per_rad = {stiffness}",
            f"damping_s = {damping}",
            "[[effect]]",
            'kind = "stribeck"',
            f"joint = {joint}",
            f"extra_nm = {share * coulomb}",
            f"vs_rad_s = {vs}",
            "",
        ]
    )
    truth = {
        "stiffness_per_rad": stiffness,
        "coulomb_nm": coulomb,
        "damping_s": damping,
        "extra_nm": share * coulomb,
        "vs_rad_s": vs,
    }
    return text, joint, truth


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--armid", required=True, type=pathlib.Path)
    options.add_argument("--work", required=True, type=pathlib.Path)
    options = options.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    armid = options.armid.resolve()
    logs = both = others = unexplained = 0
    held = {}
    for k, (motion, seed, law) in enumerate(cases()):
        text, joint, truth = scenario(motion, seed, law)
        files = [str(options.work / f"{k}.{kind}") for kind in ("toml", "csv", "json")]
        pathlib.Path(files[0]).write_text(text)
        simulate = [armid, "simulate", "--scenario", files[0], "--out", files[1]]
        subprocess.run(simulate, check=True, capture_output=True)
        diagnose = [armid, "diagnose", files[1], "--robot", "ur5", "--json", files[2]]
        subprocess.run(diagnose, check=True, capture_output=True)
        found = json.loads(pathlib.Path(files[2]).read_text())
        causes = [c for c in found["causes"] if c["confidence"] >= 0.05]
        own = {c["kind"] for c in causes if c["joint"] == joint} & {"presliding", "stribeck"}
        has_both = len(own) == 2
        logs += 1
        both += has_both
        others += len(causes) - len(own)
        unexplained += found["unexplained"] is not None
        for cause in causes:
            for name, estimate in cause["parameters"].items():
                low, high = estimate["ci95"]
                counts = held.setdefault((has_both, name), [0, 0])
                counts[0] += low <= truth[name] <= high
                counts[1] += 1
    print(f"{both} of {logs} with both laws; {others} other causes, {unexplained} with something unexplained")
    for (has_both, name), (count, of) in sorted(held.items(), reverse=True):
        print(f"{'both laws' if has_both else 'one law'}: {name} in {count} of {of} intervals")


if __name__ == "__main__":
    main()
