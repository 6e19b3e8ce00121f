"""Logs of an arm that follows its motion perfectly: inverse dynamics in Pinocchio, one effect hidden or none, diagnosed.

    pip install numpy pin
    cargo build --release
    python3 scripts/another_simulator/perfect_tracking.py --seed 1 --rounds 8 --out reports/perfect_tracking.md

There is no drive, no controller and no integrator: angles are exact Fourier series, and the torque is what the arm takes
along them, read at an instant. Nothing of armid takes part but the robot file and two of the motions. Each log draws its
motion (designed or random), 4 or 8 periods of 10 s, 100, 125, 250 or 500 samples a second, white or coloured noise, other
friction and rotors than the file's in half of them, the effect's joint, size and shape.
"""

import argparse
import collections
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/golden"))
from pinocchio_arm import Arm  # noqa: E402

TORQUE_SD_NM = np.array([1.0, 1.0, 0.7, 0.15, 0.15, 0.15])
Q_SD_RAD, QD_SD_RAD_S = 2e-5, 1e-3
TICKS = 8  # per sample: where what has a memory is followed
PERIOD_S = 10.0
EPSILON = 0.02
LARGE = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2])  # sizes of effects at the wrist beside those of joints 1 to 3
# Coloured noise: shares of the variance and time constants; None is white.
COLOURS = [(0.5, None), (0.3, 0.02), (0.2, 1.0)]


def log_uniform(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_effect(rng, kind):
    """Parameters of `kind` in SI units; `joint` counts from 1, 0 is the arm as a whole."""
    j, sign = int(rng.integers(1, 7)), float(rng.choice([-1, 1]))
    large = LARGE[j - 1]
    u = lambda low, high: log_uniform(rng, low, high)
    either = lambda: int(rng.choice([0, j]))
    arm_only = {"base_tilt", "outliers", "dropped_samples"}
    effect = {"kind": kind, "joint": 0 if kind in arm_only else j}
    effect |= {
        "nothing": lambda: {},
        "stribeck": lambda: {"extra_nm": u(0.8, 3) * large, "vs_rad_s": u(0.05, 0.25)},
        "nonlinear_viscous": lambda: {"amplitude_nm": sign * u(1, 4) * large, "exponent": float(rng.choice([0.5, 2.0, 3.0]))},
        "asymmetric_friction": lambda: {"viscous_nm_s_rad": sign * u(0.3, 1) * large},
        "load_friction": lambda: {"mu": u(0.02, 0.1) if j in (2, 3) else u(0.08, 0.3)},
        "presliding": lambda: {"stiffness_per_rad": u(300, 3000)},
        "reversal_width": lambda: {"width_rad_s": float(rng.choice([0.003, 0.006, 0.04, 0.06])), "joint": either()},
        "position_friction": lambda: {"amplitude_nm": u(0.5, 1.5) * large},
        "thermal_drift": lambda: {"fraction": sign * u(0.03, 0.2), "time_constant_s": u(20, 200)},
        "ripple": lambda: {"amplitude_nm": u(0.2, 0.6) * large, "order_per_turn": float(rng.choice([50, 101, 202, 404]))},
        "torque_gain": lambda: {"error_fraction": sign * u(0.02, 0.08), "joint": int(rng.integers(2, 4))},
        "current_offset": lambda: {"offset_nm": sign * u(0.3, 1) * large},
        "saturation": lambda: {"share": rng.uniform(0.7, 0.95)},
        "time_skew": lambda: {"delay_s": sign * u(7e-4, 4e-3), "joint": either()},
        "velocity_lag": lambda: {"delay_s": u(2e-3, 8e-3), "joint": either()},
        "encoder_offset": lambda: {"offset_rad": sign * u(0.02, 0.05), "joint": int(rng.integers(2, 4))},
        "base_tilt": lambda: {"tilt_x_rad": 0.015 * rng.normal(), "tilt_y_rad": sign * u(0.008, 0.03)},
        "spring": lambda: {"stiffness_nm_rad": u(0.3, 1.5) * large, "rest_rad": 0.5 * rng.normal()},
        "contact": lambda: {"start_s": rng.uniform(5, 30), "length_s": u(0.1, 0.6), "peak_nm": sign * u(4, 20) * large},
        "outliers": lambda: {"fraction": 0.003},
        "dropped_samples": lambda: {"fraction": 0.03},
        "quantisation": lambda: {"step": 2.5 * large},
    }[kind]()
    return effect


KINDS = [
    "nothing", "nothing", "stribeck", "nonlinear_viscous", "asymmetric_friction", "load_friction", "presliding",
    "reversal_width", "position_friction", "thermal_drift", "ripple", "torque_gain", "current_offset", "saturation",
    "time_skew", "velocity_lag", "encoder_offset", "base_tilt", "spring", "contact", "outliers", "dropped_samples",
    "quantisation",
]  # fmt: skip


class Motion:
    """q' = sum of a cos + b sin of the harmonics."""

    def __init__(self, rng):
        if rng.random() < 0.5:
            self.name = str(rng.choice(["ur5_identification", "ur5_validation"]))
            file = json.loads((ROOT / f"trajectories/{self.name}.json").read_text())
            self.period_s = file["period_s"]
            self.q0, self.a, self.b = (np.array(file[key]) for key in ("q0_rad", "a_rad_s", "b_rad_s"))
            self.w = 2 * math.pi / self.period_s * np.arange(1, self.a.shape[1] + 1)
            return
        self.name, self.period_s = "random", PERIOD_S
        self.q0 = np.array([0.0, -math.pi / 2, 0.0, -math.pi / 2, 0.0, 0.0])
        self.w = 2 * math.pi / PERIOD_S * np.arange(1, 6)
        self.a, self.b = rng.normal(size=(2, 6, 5))
        q, v, acceleration = self.at(np.arange(2000) / 2000 * PERIOD_S)
        most = lambda y: np.abs(y).max(axis=1)
        reach = np.array([2.5, 1.0, 1.6, 2.5, 2.5, 3.0])
        fits = np.minimum.reduce([reach / most(q - self.q0[:, None]), 2.6 / most(v), 8.0 / most(acceleration)])
        fits *= rng.uniform(0.8, 1.0, 6)
        self.a, self.b = self.a * fits[:, None], self.b * fits[:, None]

    def at(self, t):
        s, c, w = np.sin(np.outer(self.w, t)), np.cos(np.outer(self.w, t)), self.w
        return self.q0[:, None] + (self.a / w) @ s - (self.b / w) @ c, self.a @ c + self.b @ s, (-self.a * w) @ s + (self.b * w) @ c


class Case:
    """One log: what is drawn, and the record."""

    def __init__(self, seed, kind):
        rng = self.rng = np.random.default_rng(seed)
        self.seed, self.effect = seed, draw_effect(rng, kind)
        self.kind, self.site = kind, self.effect["joint"] - 1
        self.motion = Motion(rng)
        self.periods, self.rate_hz = int(rng.choice([4, 8])), int(rng.choice([100, 125, 250, 500]))
        self.is_coloured = bool(rng.random() < 0.5)
        self.arm = Arm(ROOT / "robots/ur5.toml")
        if rng.random() < 0.5:
            self.arm.rotor = self.arm.model.armature = np.array([2.1, 2.1, 2.1, 0.45, 0.45, 0.45])
            self.arm.viscous = np.array([12, 12, 10, 2.5, 2.5, 2.5])
            self.arm.coulomb = np.array([8, 9, 7, 1.8, 1.8, 1.6])
        # A period is a whole number of samples, so that loads are worked out once.
        self.n = round(self.motion.period_s * self.rate_hz)
        self.motion.w *= self.motion.period_s * self.rate_hz / self.n
        self.rows = self.n * self.periods
        self.t = (np.arange((self.rows + 2 * self.before) * TICKS) - self.before * TICKS) / (self.rate_hz * TICKS)

    @property
    def before(self):
        """Samples on both sides of the log, for what is read early or late."""
        return self.rate_hz // 2

    def __str__(self):
        noise = "coloured" if self.is_coloured else "white"
        return f"{self.motion.name}, {self.periods} periods, {self.rate_hz} Hz, {noise} noise"

    def joints(self):
        return range(6) if self.site < 0 else [self.site]

    def rigid(self, arm, q, v, acceleration):
        return np.array([arm.torque(q[:, k], v[:, k], acceleration[:, k]) for k in range(q.shape[1])]).T

    def torque(self, effect):
        """Velocity as recorded and torque, at every tick."""
        arm, e, j, t = self.arm, effect, self.site, self.t
        kind = e["kind"]
        gravity = np.array([0, 0, -9.81])
        if kind == "base_tilt":
            x, y = e["tilt_x_rad"], e["tilt_y_rad"]
            gravity = 9.81 * np.array([math.sin(y), -math.sin(x) * math.cos(y), -math.cos(x) * math.cos(y)])
        arm.model.gravity.linear = gravity
        ticks = self.n * TICKS
        q, v, acceleration = self.motion.at(np.arange(ticks) / (self.rate_hz * TICKS))
        if kind == "encoder_offset":
            q[j] -= e["offset_rad"]
        phase = (np.arange(len(t)) - self.before * TICKS) % ticks
        load = self.rigid(arm, q, v, acceleration)[:, phase]
        q, v, acceleration = (y[:, phase] for y in self.motion.at(np.arange(ticks) / (self.rate_hz * TICKS)))
        sign = np.tanh(v / EPSILON)
        friction = arm.coulomb[:, None] * sign + arm.viscous[:, None] * v
        extra = np.zeros_like(load)
        if kind == "stribeck":
            extra[j] = e["extra_nm"] * np.exp(-((v[j] / e["vs_rad_s"]) ** 2)) * sign[j]
        elif kind == "nonlinear_viscous":
            extra[j] = e["amplitude_nm"] * np.abs(v[j]) ** e["exponent"] * np.sign(v[j])
        elif kind == "asymmetric_friction":
            extra[j] = e["viscous_nm_s_rad"] * np.abs(v[j])
        elif kind == "load_friction":
            # What the gear transmits: the rotor sits before it. In every second log the rotor's torque counts as well.
            before_gear = arm.rotor[j] * acceleration[j] if self.seed % 2 else 0.0
            extra[j] = e["mu"] * np.abs(load[j] - before_gear) * sign[j]
        elif kind == "presliding":
            way, bristle = np.diff(q[j], prepend=q[j, 0]), 1.0
            for k, step in enumerate(way):
                to = 1.0 if step >= 0 else -1.0
                bristle = to + (bristle - to) * math.exp(-e["stiffness_per_rad"] * abs(step))
                extra[j, k] = arm.coulomb[j] * (bristle - sign[j, k])
        elif kind == "reversal_width":
            for i in self.joints():
                extra[i] = arm.coulomb[i] * (np.tanh(v[i] / e["width_rad_s"]) - sign[i])
        elif kind == "position_friction":
            extra[j] = e["amplitude_nm"] * np.sin(q[j] + 0.5) * sign[j]
        elif kind == "thermal_drift":
            extra[j] = e["fraction"] * (1 - np.exp(-np.maximum(t, 0) / e["time_constant_s"])) * friction[j]
        elif kind == "ripple":
            extra[j] = e["amplitude_nm"] * np.sin(e["order_per_turn"] * q[j] + 0.7)
        elif kind == "spring":
            extra[j] = e["stiffness_nm_rad"] * (q[j] - e["rest_rad"])
        elif kind == "contact":
            way = np.clip((t - e["start_s"]) / e["length_s"], 0, 1)
            extra[j] = e["peak_nm"] * np.sin(math.pi * way) ** 2
        torque = load + friction + extra
        if kind == "torque_gain":
            torque[j] *= 1 + e["error_fraction"]
        elif kind == "current_offset":
            torque[j] += e["offset_nm"]
        elif kind == "saturation":
            e["limit_nm"] = float(e["share"] * np.abs(torque[j]).max())
            torque[j] = torque[j].clip(-e["limit_nm"], e["limit_nm"])
        elif kind == "time_skew":
            for i in self.joints():
                torque[i] = np.interp(t - e["delay_s"], t, torque[i])
        elif kind == "velocity_lag":
            share = (t[1] - t[0]) / (e["delay_s"] + t[1] - t[0])
            for i in self.joints():
                for k in range(1, len(t)):
                    v[i, k] = v[i, k - 1] + share * (v[i, k] - v[i, k - 1])
        return q, v, torque

    def log(self):
        rng, kind, e = self.rng, self.kind, self.effect
        at = self.before * TICKS + np.arange(self.rows) * TICKS
        q, v, torque = (y[:, at] for y in self.torque(e))
        shape = (6, self.rows)
        noise = self.coloured(rng, shape) if self.is_coloured else rng.normal(size=shape)
        torque = torque + noise * TORQUE_SD_NM[:, None]
        q, v = q + Q_SD_RAD * rng.normal(size=shape), v + QD_SD_RAD_S * rng.normal(size=shape)
        time = np.arange(self.rows) / self.rate_hz
        if kind == "outliers":
            struck = rng.random(shape) < e["fraction"]
            torque += struck * rng.choice([-30.0, 30.0], size=shape) * TORQUE_SD_NM[:, None]
        elif kind == "dropped_samples":
            kept = rng.random(self.rows) > e["fraction"]
            time, q, v, torque = time[kept], q[:, kept], v[:, kept], torque[:, kept]
        elif kind == "quantisation":
            torque[self.site] = np.round(torque[self.site] / e["step"]) * e["step"]
        return np.column_stack([time, q.T, v.T, torque.T])

    def coloured(self, rng, shape):
        noise = np.zeros(shape)
        for share, time_constant_s in COLOURS:
            white = rng.normal(size=shape)
            if time_constant_s is not None:
                r = math.exp(-1 / (self.rate_hz * time_constant_s))
                for k in range(1, shape[1]):
                    white[:, k] = r * white[:, k - 1] + math.sqrt(1 - r * r) * white[:, k]
            noise += math.sqrt(share) * white
        return noise

    def power(self):
        """Of the noise of one joint by frequency, over its variance: the squared length of white noise's coefficients is 1."""
        f = np.fft.rfftfreq(self.rows)
        total = np.zeros_like(f)
        for share, time_constant_s in COLOURS if self.is_coloured else [(1.0, None)]:
            r = 0.0 if time_constant_s is None else math.exp(-1 / (self.rate_hz * time_constant_s))
            total += share * (1 - r * r) / np.abs(1 - r * np.exp(-2j * math.pi * f)) ** 2
        return total

    def sqrt_lambda(self):
        """Length of the effect outside the null model in standard deviations of the torque's noise."""
        at = self.before * TICKS + np.arange(self.rows) * TICKS
        with_effect = self.torque(self.effect)[2][:, at]
        q, v, without = (y[:, at] for y in self.torque({"kind": "nothing"}))
        acceleration = self.motion.at(self.t[at])[2]
        of_one_period = [self.arm.regressor(q[:, k], v[:, k], acceleration[:, k]) for k in range(self.n)]
        rigid = np.tile(np.array(of_one_period), (self.periods, 1, 1))
        columns = [rigid[:, :, p].T for p in range(rigid.shape[2])]
        for j in range(6):
            for own in (acceleration, v, np.tanh(v / EPSILON)):
                column = np.zeros_like(v)
                column[j] = own[j]
                columns.append(column)
        weight = 1 / np.sqrt(self.power())
        white = lambda y: np.fft.irfft(np.fft.rfft(y / TORQUE_SD_NM[:, None]) * weight, self.rows).ravel()
        left, values, _ = np.linalg.svd(np.array([white(c) for c in columns]).T, full_matrices=False)
        q_null = left[:, values > 1e-9 * values[0]]
        d = white(with_effect - without)
        return float(np.linalg.norm(d - q_null @ (q_null.T @ d)))


def diagnose(program, case):
    with tempfile.TemporaryDirectory() as folder:
        log, out = Path(folder) / "log.csv", Path(folder) / "out.json"
        names = [f"actual_{what}_{j}" for what in ("q", "qd", "torque") for j in range(6)]
        np.savetxt(log, case.log(), delimiter=",", header=",".join(["timestamp", *names]), comments="", fmt="%.9g")
        done = subprocess.run([program, "diagnose", log, "--robot", "ur5", "--json", out], capture_output=True, text=True)
        # 3 is an answer as well: what is identified contradicts the arm.
        if done.returncode not in (0, 3) or not out.exists():
            raise SystemExit(f"{case.seed}: {done.stderr}")
        return json.loads(out.read_text())


def judge(case, answer):
    """right, silent, more (right and something else), unexplained or wrong."""
    causes, joint = answer["causes"], case.effect["joint"] or None
    if case.kind == "nothing":
        return "wrong" if causes else "unexplained" if answer["unexplained"] else "right"
    if not causes:
        return "unexplained" if answer["unexplained"] else "silent"

    def is_it(cause):
        if case.kind == cause["kind"] == "ripple":
            order = cause["parameters"]["order_per_turn"]["value"]
            return cause["joint"] == joint and abs(order / case.effect["order_per_turn"] - 1) < 0.01
        names = {(cause["kind"], cause["joint"])}
        for other in cause["class"]:
            kind, _, at = other.partition("@")
            names.add((kind, int(at) if at else cause["joint"]))
        # Outliers are counted joint by joint; who felt a touch is part of what is said of it.
        anywhere = case.kind in ("outliers", "contact")
        return any(kind == case.kind and (anywhere or at == joint) for kind, at in names)

    if all(map(is_it, causes)):
        return "right"
    return "more" if any(map(is_it, causes)) else "wrong"


def intervals(case, answer):
    """Of the hidden parameters that are told: name, truth, value, and whether its interval holds the truth."""
    out = []
    for cause in answer["causes"]:
        if cause["kind"] != case.kind or cause["joint"] != (case.effect["joint"] or None) or case.kind == "contact":
            continue
        for name, truth in case.effect.items():
            if name in cause["parameters"] and name != "fraction" or (name, cause["kind"]) == ("fraction", "thermal_drift"):
                told = cause["parameters"][name]
                low, high = told["ci95"]
                out.append((name, truth, told["value"], low <= truth <= high))
    return out


def words(effect):
    where = "" if effect["joint"] == 0 else f" {effect['joint']}"
    numbers = ", ".join(f"{k} {v:.3g}" for k, v in effect.items() if k not in ("kind", "joint"))
    return f"{effect['kind']}{where}" + (f": {numbers}" if numbers else "")


def said(answer):
    causes = [
        f"{c['kind']} {c['joint'] or ''}".strip() + ("" if c["confidence"] >= 0.99 else f" ({c['confidence']:.2f})")
        for c in answer["causes"]
    ]
    if answer["unexplained"]:
        rest = answer["unexplained"]
        causes.append(f"{'joints together' if rest['of_all_joints'] else 'joint'} {rest['joint']} unexplained")
    return ", ".join(causes) or "nothing"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=ROOT / "target/release/armid")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--out", default="/dev/stdout")
    args = parser.parse_args()
    readings = {"nothing", "outliers", "dropped_samples", "quantisation", "velocity_lag"}
    counts, misses = collections.defaultdict(collections.Counter), []
    for number in range(args.rounds):
        for place, kind in enumerate(args.kinds.split(",")):
            case = Case(100_000 * args.seed + 1000 * number + place, kind)
            strength = None if kind in readings else case.sqrt_lambda()
            answer = diagnose(args.program, case)
            verdict = judge(case, answer)
            print(case.seed, verdict, words(case.effect), case, strength and f"{strength:.1f}", said(answer), file=sys.stderr)
            small = strength is not None and strength < 8
            counts[kind]["small" if small else verdict] += 1
            counts[kind]["small, wrong"] += small and verdict == "wrong"
            counts[kind]["right, rest"] += not small and verdict == "right" and bool(answer["unexplained"])
            told = [] if small else intervals(case, answer)
            for name, truth, value, holds in told:
                counts[kind]["told"] += 1
                counts[kind]["held"] += holds
                if not holds:
                    print(f"    {name}: {value:.4g}, truth {truth:.4g}", file=sys.stderr)
            if verdict != "right" and not (small and verdict == "silent"):
                misses.append((words(case.effect), "–" if strength is None else f"{strength:.1f}", str(case), said(answer)))
    Path(args.out).write_text(report(args, counts, misses))


def report(args, counts, misses):
    verdicts = ["right", "more", "unexplained", "silent", "wrong"]
    total = sum((c for kind, c in counts.items() if kind != "nothing"), collections.Counter())
    seen, clean = sum(total[v] for v in verdicts), counts["nothing"]
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout.strip()
    lines = [
        "# Logs of an arm that follows its motion perfectly",
        "",
        "A UR5 in Pinocchio, none of whose equations are armid's: torques of the inverse dynamics along exact Fourier series, read",
        "at an instant, without drives or controllers. Motions (designed or random), 4 or 8 periods, 100 to 500 samples a second,",
        "white or coloured noise, friction and rotors are drawn log by log. Laws of friction, springs and ripple are added by their textbook formulas,",
        "which the diagnosis has as well: what is tried here are motions, rates and noise, not the laws. Written by",
        "",
        f"    python3 scripts/another_simulator/perfect_tracking.py --seed {args.seed} --rounds {args.rounds} --out reports/perfect_tracking.md",
        "",
        f"with the program of commit {commit}.",
        "",
        f"**Of {seen} logs with an effect of √λ ≥ 8 or a fault of the record {total['right']} name what was hidden and nothing else, {total['right, rest']} of these"
        f" with something left unexplained beside it; of"
        f" {sum(clean[v] for v in verdicts)} without any {clean['right']} are given nothing; the intervals hold {total['held']} of"
        f" {total['told']} of the hidden parameters.**",
        "",
        "√λ is the length of the effect outside the null model in standard deviations of the torque's noise; smaller ones are counted",
        "apart. “More”: named, and something else beside it.",
        "",
        "| hidden | " + " | ".join(verdicts) + " | √λ < 8 | of these wrong | intervals that hold |",
        "|---|" + "---:|" * (len(verdicts) + 3),
    ]
    for kind, c in counts.items():
        numbers = [str(c[v]) for v in [*verdicts, "small", "small, wrong"]]
        lines.append(f"| {' | '.join([kind, *numbers])} | " + (f"{c['held']} of {c['told']} |" if c["told"] else "– |"))
    lines += ["", "## What was not right", "", "| hidden | √λ | log | gets |", "|---|---:|---|---|"]
    lines += [f"| {' | '.join(miss)} |" for miss in misses]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
