"""Can any function of the motion do better on the wrist joints of the UR10e? (reports/ur10e_ceiling.md)

    pip install numpy scipy scikit-learn pin
    python reports/ur10e_ceiling.py FOLDER_WITH_UR10E_LOGS

Shares no code with armid: Pinocchio's regressor, least squares, and gradient-boosted trees on what is left. Which laws of
friction are named, the stiffness of the bristles and the orders of the ripple are those of reports/ur10e.md.
Rms errors of samples in which the joint moves, |qd| > 0.02 rad/s, behind a 10 Hz zero-phase low-pass.
"""

import itertools
import sys

import numpy as np
import pinocchio as pin
from scipy.signal import butter, filtfilt
from sklearn.ensemble import HistGradientBoostingRegressor

RATE_HZ, CUTOFF_HZ, EPSILON, MOVING, MARGIN = 100.0, 10.0, 0.02, 0.02, 150
GAIN_NM_A = np.array([11.98, 11.98, 9.84, 10.76, 10.76, 10.76])
SCALE_NM = np.array([1.5, 2.5, 1.0, 0.2, 0.25, 0.2])
# Rows (from 1) between which the arm moves, as the data's authors give them. The first run trains.
RUNS = {
    "ur-20_02_19_14harm50sec": (195, 4966),
    "ur-20_02_10-30sec_12harm": (635, 3510),
    "ur-20_02_12-50sec_12harm": (355, 5090),
    "ur-20_01_17-ptp_10_points": (700, 4200),
}
BRISTLES_PER_RAD = [26820, 63520, 29130, 3299, 2311, 5329]
NAMED_ORDERS = [(202,), (), (), (201,), (202, 808, 1212), ()]
ORDERS = (101, 202, 303, 404, 808, 1212)
TREES = ((4, 100), (12, 100), (12, 300))
NUMERATOR, DENOMINATOR = butter(4, CUTOFF_HZ / (RATE_HZ / 2))


def smooth(y):
    return filtfilt(NUMERATOR, DENOMINATOR, y, axis=0)


class Run:
    def __init__(self, folder, name, model):
        lines = (line.strip().split(",") for line in open(f"{folder}/{name}.csv"))
        rows = np.array([[float(v) for v in f[:19]] for f in lines if len(f) >= 19])
        first, last = RUNS[name]
        rows = rows[np.all(np.abs(rows) < 1e4, axis=1)][first - MARGIN : last + MARGIN]
        _, unique = np.unique(rows[:, 0], return_index=True)
        rows = rows[unique]
        count = int((rows[-1, 0] - rows[0, 0]) * RATE_HZ)
        time = rows[0, 0] + np.arange(count) / RATE_HZ
        even = lambda columns: np.stack([np.interp(time, rows[:, 0], rows[:, c]) for c in columns], 1)
        self.angle = even(range(1, 7))
        self.q, self.qd = smooth(self.angle), smooth(even(range(7, 13)))
        self.qdd = np.gradient(self.qd, 1 / RATE_HZ, axis=0)
        self.torque = smooth(even(range(13, 19)) * GAIN_NM_A)
        self.sign = np.tanh(self.qd / EPSILON)
        self.inside = np.zeros(count, bool)
        self.inside[MARGIN:-MARGIN] = True
        data = model.createData()
        regressor = [pin.computeJointTorqueRegressor(model, data, *s) for s in zip(self.q, self.qd, self.qdd)]
        self.rigid = smooth(np.array(regressor))

    def moving(self, j):
        return self.inside & (np.abs(self.qd[:, j]) > MOVING)

    def bristle(self, j, per_rad, play_rad=0.5e-4):
        """Dahl's bristle behind the rounded angle."""
        at, z = self.angle[0, j], np.zeros(len(self.angle))
        for k in range(1, len(z)):
            now = min(max(at, self.angle[k, j] - play_rad), self.angle[k, j] + play_rad)
            turn = now - at
            z[k] = np.sign(turn) - (np.sign(turn) - z[k - 1]) * np.exp(-per_rad * abs(turn))
            at = now
        return z

    def ripple(self, j, orders):
        return [f(order * self.q[:, j]) for order in orders for f in (np.cos, np.sin)]

    def friction(self, j, predicted):
        """Rotor, viscous, Coulomb, offset; where the rigid model's torque is given, the named laws as well."""
        qd, sign = self.qd[:, j], self.sign[:, j]
        columns = [self.qdd[:, j], qd, sign, np.ones(len(qd))]
        if predicted is not None:
            columns += [self.bristle(j, BRISTLES_PER_RAD[j])] + self.ripple(j, NAMED_ORDERS[j])
            if j == 0:
                columns.append(np.sign(qd) * np.sqrt(np.abs(qd)))
            if j in (1, 2):
                columns.append(np.abs(predicted[:, j]) * sign)
        return smooth(np.stack(columns, 1))


def linear_model(runs, rigid):
    """Torque of the linear model fitted to the first run, per run; with the named laws where `rigid` has that of the rigid one."""
    friction = [[run.friction(j, r) for j in range(6)] for run, r in zip(runs, rigid)]
    ends = 60 + np.cumsum([0] + [f.shape[1] for f in friction[0]])

    def rows(i, j):
        out = np.zeros((len(runs[i].q), ends[-1]))
        out[:, :60], out[:, ends[j] : ends[j + 1]] = runs[i].rigid[:, j], friction[i][j]
        return out

    inside = runs[0].inside
    matrix = np.vstack([rows(0, j)[inside] / SCALE_NM[j] for j in range(6)])
    torque = np.concatenate([runs[0].torque[inside, j] / SCALE_NM[j] for j in range(6)])
    scale = np.linalg.norm(matrix, axis=0) + 1e-9
    values, vectors = np.linalg.eigh((matrix / scale).T @ (matrix / scale))
    vectors, values = vectors[:, values > 1e-7 * values[-1]], values[values > 1e-7 * values[-1]]
    theta = vectors @ (vectors.T @ ((matrix / scale).T @ torque) / values) / scale
    return [np.stack([rows(i, j) @ theta for j in range(6)], 1) for i in range(len(runs))]


def inputs(run, j, predicted, kinds):
    others = [i for i in range(6) if i != j]
    columns = {
        "speed": [run.qd[:, j], run.qdd[:, j]],
        "bristles": [run.bristle(j, k) for k in (300, 1000, 3000, 10000)],
        "load": [predicted],
        "angle": [run.q[:, j]],
        "ripple": [c * s for c in run.ripple(j, ORDERS) for s in (1.0, run.sign[:, j])],
        "others": [x[:, i] for x in (run.qd, run.qdd) for i in others] + [run.bristle(i, 1000) for i in others],
    }
    return np.stack([column for kind in kinds for column in columns[kind]], 1)


def rms(y):
    return np.sqrt(np.mean(y**2))


def main():
    folder = sys.argv[1]
    model = pin.buildModelFromUrdf(f"{folder}/ur10e.urdf")
    runs = [Run(folder, name, model) for name in RUNS]
    rigid = linear_model(runs, [None] * len(runs))
    extended = linear_model(runs, rigid)
    others = lambda i: [k for k in range(len(runs)) if k != i]
    extra = ("bristles", "load", "angle", "ripple", "others")
    sets = [("speed",) + s for n in range(3) for s in itertools.combinations(extra, n)] + [("speed",) + extra]
    print("error removed on the held-out runs, %: mean (per run)")
    for j in (3, 4, 5):
        kept = [run.moving(j) for run in runs]
        own = [(run.torque[:, j] - e[:, j])[k] for run, e, k in zip(runs, extended, kept)]
        before = [rms((run.torque[:, j] - r[:, j])[k]) for run, r, k in zip(runs, rigid, kept)]
        gains = lambda left: [100 * (1 - rms(left[i]) / before[i]) for i in range(1, len(runs))]
        tell = lambda g: f"{np.mean(g):5.1f} ({', '.join(f'{v:.1f}' for v in g)})"
        one, three = [], []
        for kinds, (leaves, count) in itertools.product(sets, TREES):
            x = [inputs(run, j, e[:, j], kinds)[k] for run, e, k in zip(runs, extended, kept)]

            def left(teachers, i):
                trees = HistGradientBoostingRegressor(
                    max_iter=count, learning_rate=0.05, max_leaf_nodes=leaves, min_samples_leaf=60, random_state=0
                )
                trees.fit(np.vstack([x[k] for k in teachers]), np.concatenate([own[k] for k in teachers]))
                return own[i] - trees.predict(x[i])

            of = f"{' '.join(kinds)}, {count} trees of {leaves} leaves"
            one.append((gains([left([0], i) for i in range(len(runs))]), of))
            three.append((gains([left(others(i), i) for i in range(len(runs))]), of))
        print(f"joint {j + 1}: named laws {tell(gains(own))}")
        for name, results in (("the training run", one), ("the other three runs", three)):
            best = max(results, key=lambda r: np.mean(r[0]))
            print(f"    with the best of {len(results)} lots of trees, taught by {name}: {tell(best[0])} from {best[1]}", flush=True)


if __name__ == "__main__":
    main()
