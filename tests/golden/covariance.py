"""Covariances of a small two-joint regression by statsmodels, for tests/val_covariance.rs.

    python3 tests/golden/covariance.py > tests/golden/covariance.json

Needs numpy and statsmodels (made with statsmodels 0.15.0). The data are closed formulas, so that
only the results are stored.
"""
import json

import numpy as np
import statsmodels.api as sm
from statsmodels.regression.linear_model import yule_walker

N, COLUMNS, JOINTS, BLOCK, LAGS = 240, 3, 2, 40, 9
t = np.arange(N)


def x(joint, column):
    return np.cos(0.013 * (joint + 1) * (2 * column + 1) * t + 0.4 * column)


def noise(joint):
    white = np.sin(0.7 * (joint + 1) * t * t + joint)
    e = np.zeros(N)
    for k in range(N):
        e[k] = white[k] + (0.6 * e[k - 1] if k else 0.0)
    return (0.5 + joint) * e


X = [np.column_stack([x(j, c) for c in range(COLUMNS)]) for j in range(JOINTS)]
theta = np.array([1.0, -2.0, 0.5])
y = [X[j] @ theta + noise(j) for j in range(JOINTS)]
stacked, torque = np.vstack(X), np.concatenate(y)
ols = sm.OLS(torque, stacked).fit()
weights = np.repeat([4.0, 0.25], N)  # w_j squared: w = 2, 0.5
wls = sm.WLS(torque, stacked, weights=weights).fit()
time = np.tile(t, JOINTS)
hac = wls.get_robustcov_results(
    "hac-groupsum", time=time, maxlags=LAGS, use_correction=False, df_correction=False
)
cluster = wls.get_robustcov_results(
    "cluster", groups=time // BLOCK, use_correction=False, df_correction=False
)
rho, _ = yule_walker(noise(0), order=2, method="mle", demean=True)
print(json.dumps({
    "ols_theta": ols.params.tolist(),
    "ols": ols.cov_params().tolist(),
    "wls_theta": wls.params.tolist(),
    "hac": np.asarray(hac.cov_params()).tolist(),
    "cluster": np.asarray(cluster.cov_params()).tolist(),
    "yule_walker": rho.tolist(),
}, indent=1))
