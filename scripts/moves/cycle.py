"""Writes a cycle of point-to-point moves with pauses, as a trajectory file of armid.

    python3 scripts/moves/cycle.py trapezoidal trajectories/ur5_moves_trapezoidal.json
    python3 scripts/moves/cycle.py smooth trajectories/ur5_moves_smooth.json

All joints start and stop together. `trapezoidal`: constant speed between ramps of constant acceleration, whose corners
are rounded over 60 ms, as robot controllers do it; `smooth`: polynomials of fifth degree. The poses are drawn at random
about those of ur5_identification. Needs numpy.
"""

import json
import sys

import numpy as np

PERIOD_S, RATE_HZ, HIGHEST_HZ = 14.0, 1000, 20.0
POSES = 6
CENTRE = np.array([0.0, -1.6, 0.3, -1.5, 0.0, 0.0])
REACH = np.array([1.2, 0.8, 1.0, 1.2, 1.5, 1.5])
SPEED_RAD_S, ACCELERATION_RAD_S2, ROUNDED_S = 1.8, 5.0, 0.06


def smooth(distance):
    """Time and share of the way of a polynomial of fifth degree, whose greatest speed is 15/8 of the mean."""
    duration = 15 / 8 * distance / SPEED_RAD_S
    s = np.arange(round(duration * RATE_HZ) + 1) / round(duration * RATE_HZ)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def trapezoidal(distance):
    """Share of the way of a trapezoid of speed, averaged over ROUNDED_S."""
    speed = min(SPEED_RAD_S, np.sqrt(distance * ACCELERATION_RAD_S2))
    ramp = max(1, round(speed / ACCELERATION_RAD_S2 * RATE_HZ))
    flat = max(0, round(distance / speed * RATE_HZ) - ramp)
    rise = (np.arange(ramp) + 0.5) / ramp
    v = np.concatenate([rise, np.ones(flat), rise[::-1]])
    width = round(ROUNDED_S * RATE_HZ)
    v = np.convolve(v, np.ones(width) / width)
    return np.concatenate([[0.0], np.cumsum(v) / v.sum()])


def cycle(profile, seed):
    """One period of angles, `[sample, joint]`."""
    rng = np.random.default_rng(seed)
    poses = CENTRE + REACH * rng.uniform(-1, 1, (POSES, len(CENTRE)))
    moves = [(a, b) for a, b in zip(poses, np.roll(poses, -1, axis=0))]
    ways = [profile(np.abs(b - a).max()) for a, b in moves]
    samples = round(PERIOD_S * RATE_HZ)
    rest = samples - sum(len(way) for way in ways)
    if rest < 0:
        sys.exit(f"the moves take {-rest / RATE_HZ} s more than the period")
    print(f"pauses of {rest / POSES / RATE_HZ:.2f} s", file=sys.stderr)
    q = []
    for i, ((a, b), way) in enumerate(zip(moves, ways)):
        q.append(a + np.outer(way, b - a))
        pause = rest * (i + 1) // POSES - rest * i // POSES
        q.append(np.tile(b, (pause, 1)))
    return np.concatenate(q)


def main(name, out):
    q = cycle({"smooth": smooth, "trapezoidal": trapezoidal}[name], seed=1)
    order = round(HIGHEST_HZ * PERIOD_S)
    spectrum = np.fft.rfft(q, axis=0)[: order + 1] * 2 / len(q)
    omega = 2 * np.pi * np.arange(1, order + 1)[:, None] / PERIOD_S
    # q = q0 + sum of a/w sin - b/w cos: the real part of the spectrum is the cosine, the negative imaginary part the sine.
    a, b = -omega * spectrum[1:].imag, -omega * spectrum[1:].real
    rounded = lambda x: [[round(v, 9) for v in row] for row in x.T.tolist()]
    file = {
        "schema": "armid.trajectory/1",
        "period_s": PERIOD_S,
        "q0_rad": [round(v, 9) for v in (spectrum[0].real / 2).tolist()],
        "a_rad_s": rounded(a),
        "b_rad_s": rounded(b),
    }
    with open(out, "w") as f:
        json.dump(file, f)
        f.write("\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
