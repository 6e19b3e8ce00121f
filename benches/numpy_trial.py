#!/usr/bin/env python3
"""One Monte Carlo trial in NumPy and Pinocchio beside this program's: same log, same estimator, one core each, in one run.

Usage: numpy_trial.py LOG.csv PROFILE.json        (written by compare_trial.sh)

The estimator is weighted least squares on the average motion: angle and velocity of eight periods are averaged and combined
harmonic by harmonic, differentiated as a Fourier series; the regressor of one period serves all; joints are weighted by their
residuals, twice; σ is the scatter of the eight single periods' estimates. NumPy is told the period and the number of
harmonics of every joint, which this program finds by itself. The estimates must agree before times are compared.
Times are those of the thread's own clock: what other programs take of the core does not count.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/golden"))
from pinocchio_arm import INDEX, SIGN, Arm  # noqa: E402

REPEATS = 15


def columns(arm, names):
    """Column of the standard regressor [10 parameters per body, Ia, rv, rc] for each base parameter's name."""
    body = ["m", "mx", "my", "mz", "A", "B", "C", "D", "E", "F"]
    order = [f"{p}{i + 1}" for i in range(arm.dof) for p in body]
    order += [f"{p}{j + 1}" for p in ("Ia", "rv", "rc") for j in range(arm.dof)]
    return np.array([order.index(name) for name in names])


class Trial:
    """Everything that stays the same from log to log."""

    def __init__(self, arm, names, period, periods, rate, harmonics):
        self.arm, self.columns = arm, columns(arm, names)
        self.n, self.periods, self.rate = period, periods, rate
        h = np.arange(period // 2 + 1)
        self.keep = h[:, None] <= np.array(harmonics)[None, :]
        self.omega = 2 * np.pi * rate / period * h[:, None]
        self.theta = np.zeros((6 * period, 78))

    def motion(self, q, qd):
        """Averaged angle, velocity and acceleration of one period."""
        fold = lambda x: np.fft.rfft(x.reshape(self.periods, self.n, -1), axis=1) / self.n
        q, qd = fold(q), fold(qd)
        scatter = lambda x: np.mean(np.var(np.abs(x - x.mean(0)), axis=0), axis=0)
        noise_q, noise_qd = scatter(q), scatter(qd)
        q, qd = q.mean(0), qd.mean(0)
        with np.errstate(divide="ignore", invalid="ignore"):
            from_qd = noise_q / (noise_q + noise_qd / self.omega**2)
            best = q + np.where(self.omega > 0, from_qd * (qd / (1j * self.omega) - q), 0)
        back = lambda x: np.fft.irfft(x * self.n, self.n, axis=0)
        moving = np.where(self.keep, best, 0)
        return back(best), back(1j * self.omega * best), back(-(self.omega**2) * moving)

    def regressor(self, q, qd, qdd):
        """Θ_B of all samples, rows joint by joint."""
        dof, arm, n = 6, self.arm, self.n
        full = np.zeros((n, dof, 78))
        for k in range(n):
            full[k, :, :60] = pin.computeJointTorqueRegressor(arm.model, arm.data, q[k], qd[k], qdd[k])
        blocks = full[:, :, :60].reshape(n, dof, dof, 10)
        full[:, :, :60] = (blocks[..., INDEX] * SIGN).reshape(n, dof, 60)
        for j in range(dof):
            full[:, j, 60 + j] = qdd[:, j]
            full[:, j, 66 + j] = qd[:, j]
            full[:, j, 72 + j] = np.tanh(qd[:, j] / arm.epsilon)
        return full[:, :, self.columns].transpose(1, 0, 2)

    def identify(self, q, qd, torque):
        x = self.regressor(*self.motion(q, qd))
        y = torque.reshape(self.periods, self.n, 6).transpose(2, 1, 0)
        b = x.shape[2]
        weights = np.ones(6)
        for _ in range(3):
            wx = (x * weights[:, None, None]).reshape(-1, b)
            wy = (y * weights[:, None, None]).reshape(-1, self.periods)
            qr, r = np.linalg.qr(wx)
            single = np.linalg.solve(r, qr.T @ wy)
            theta = single.mean(1)
            error = y - (x @ theta)[:, :, None]
            weights = 1 / np.sqrt((error**2).sum((1, 2)) / (self.n * self.periods - b / 6))
        sigma = single.std(1, ddof=1) / np.sqrt(self.periods)
        return theta, sigma


def median_ms(call, repeats=REPEATS):
    times = []
    for _ in range(repeats):
        begun = time.thread_time()
        call()
        times.append(1e3 * (time.thread_time() - begun))
    return float(np.median(times))


def machine():
    """Peaks of one core: dgemm, and a copy of arrays far larger than the caches."""
    a = np.random.default_rng(1).normal(size=(1000, 1000))
    ms = min(median_ms(lambda: a @ a, 3) for _ in range(3))
    big = np.ones(16_000_000)
    target = np.empty_like(big)
    copy = min(median_ms(lambda: np.copyto(target, big), 3) for _ in range(3))
    return 2e9 / (1e-3 * ms), 16 * big.size / (1e-3 * copy)


def main():
    log = np.loadtxt(sys.argv[1], delimiter=",", skiprows=1)
    profile = json.load(open(sys.argv[2]))
    header = open(sys.argv[1]).readline().strip().split(",")
    channel = lambda name: log[:, [header.index(f"{name}_{j}") for j in range(6)]]
    first, count = profile["first_sample"], profile["period_samples"] * profile["periods"]
    cut = slice(first, first + count)
    q, qd, torque = (np.ascontiguousarray(channel(c)[cut]) for c in ("actual_q", "actual_qd", "actual_torque"))
    arm = Arm(ROOT / "robots/ur5.toml")
    trial = Trial(arm, profile["names"], profile["period_samples"], profile["periods"], profile["rate_hz"], profile["harmonics"])
    theta, sigma = trial.identify(q, qd, torque)
    ours, our_sigma = np.array(profile["theta"]), np.array(profile["sigma"])
    off = np.abs(theta - ours) / our_sigma
    print(f"largest difference of an estimate: {off.max():.3f} σ; ratio of the σ, rms: {np.sqrt(np.mean((sigma / our_sigma) ** 2)):.3f}\n")
    if off.max() > 0.5:
        sys.exit("the estimates do not agree: times would compare different things")

    total = median_ms(lambda: trial.identify(q, qd, torque))
    motion = trial.motion(q, qd)
    parts = [
        ("averaging the periods", median_ms(lambda: trial.motion(q, qd))),
        ("regressor", median_ms(lambda: trial.regressor(*motion))),
    ]
    rng = np.random.default_rng(1)
    shape = (18, profile["samples"])
    noise = median_ms(lambda: rng.normal(size=shape))
    print("| one core, ms per trial | armid | NumPy + Pinocchio | ratio |\n|---|---:|---:|---:|")
    mine = profile["wls_periods_ms"]
    print(f"| **estimate and σ from a log in memory** | **{mine:.2f}** | **{total:.1f}** | **{total / mine:.1f}** |")
    stage = {s["name"]: s for s in profile["stages"]}
    find = stage["finding the period"]["ms"]
    print(f"| the same without finding the period, which NumPy is told | {mine - find:.2f} | {total:.1f} | {total / (mine - find):.1f} |")
    for name, key in (("averaging the periods", "averaging the periods"), ("regressor", "base regressor")):
        theirs = dict(parts)[name]
        print(f"| {name} | {stage[key]['ms']:.2f} | {theirs:.1f} | {theirs / stage[key]['ms']:.1f} |")
    rest = total - sum(ms for _, ms in parts)
    solve = stage["QR, weights, estimates of all periods"]["ms"]
    print(f"| least squares, weights, single periods | {solve:.2f} | {rest:.1f} | {rest / solve:.1f} |")
    our_noise = stage["noise of 18 channels"]["ms"]
    print(f"| noise of 18 channels | {our_noise:.2f} | {noise:.1f} | {noise / our_noise:.1f} |")

    flops, bandwidth = machine()
    print(f"\nOne core of this machine, measured in the same run: {flops / 1e9:.1f} GFLOP/s (dgemm), {bandwidth / 1e9:.1f} GB/s (copy), "
          f"{profile['raw_random_per_s'] / 1e6:.0f} million random 64-bit numbers/s (ChaCha8), "
          f"{profile['normal_random_per_s'] / 1e6:.0f} million normal ones/s.\n")
    whole = sum(s["ms"] for s in profile["stages"])
    print("| stage of a trial (weighted least squares) | ms | share | work | share of the peak it is bound by |\n|---|---:|---:|---:|---:|")
    peaks = {"floating-point operations": flops, "bytes written": bandwidth, "normal numbers": profile["normal_random_per_s"]}
    for s in profile["stages"]:
        rate = s["work"] / (1e-3 * s["ms"])
        peak = peaks.get(s["unit"])
        share = f"{100 * rate / peak:.0f} %" if peak else "–"
        print(f"| {s['name']} | {s['ms']:.2f} | {100 * s['ms'] / whole:.0f} % | {s['work'] / 1e6:.2f} million {s['unit']} | {share} |")
    print(f"\nThe default trial (spectral weights and covariance), noise included: {profile['default_trial_ms']:.2f} ms.")


if __name__ == "__main__":
    main()
