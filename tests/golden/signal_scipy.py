"""Reference values of SciPy for tests/val_signal.rs.

    python3 tests/golden/signal_scipy.py > tests/golden/signal.json

The input is made from integers so that both sides start from the same bits.
"""
import json

import numpy as np
import scipy
from scipy import signal
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

RATE = 125.0


def series(n):
    """A deterministic rough series: integers of a linear congruential generator over 2^16."""
    state, out = 12345, []
    for k in range(n):
        state = (1103515245 * state + 12345) % 2**31
        out.append((state >> 15) / 65536.0 + 0.25 * ((k // 50) % 3))
    return np.array(out)


x = series(400)
filters = []
for order in range(1, 9):
    for cutoff in (2.0, 10.0, 45.0):
        sos = signal.butter(order, cutoff, fs=RATE, output="sos")
        filters.append({"order": order, "cutoff_hz": cutoff, "y": list(signal.sosfiltfilt(sos, x)[::5])})

k = np.tan(np.pi * 10.0 / RATE)
a = [1.0, (k - 1.0) / (k + 1.0)]
b = 2.0 * RATE * k / (1.0 + k)
literal = signal.filtfilt([b, -b], a, x)
low = signal.filtfilt([k / (1.0 + k)] * 2, a, x)
fourth = (low[:-4] - 8 * low[1:-3] + 8 * low[3:-1] - low[4:]) * RATE / 12.0

# Jittered time stamps, in steps of 1/1024 s: exact in binary.
steps = 8 + (np.floor(series(60) * 4) % 5)
t = np.concatenate([[0.0], np.cumsum(steps)])[:60] / 1024.0
y = series(60)
slope = 3.0 * (series(60)[::-1] - 0.5)
grid = np.arange(0, int(np.floor(t[-1] * 250.0)) + 1) / 250.0
resample = {
    "time_s": list(t),
    "slope": list(slope),
    "hermite": list(CubicHermiteSpline(t, y, slope)(grid)),
    "monotone": list(PchipInterpolator(t, y)(grid)),
    "linear": list(np.interp(grid, t, y)),
}

print(
    json.dumps(
        {
            "scipy": scipy.__version__,
            "filters": filters,
            "literal": list(literal),
            "intended_interior": list(fourth),
            "resample": resample,
        }
    )
)
