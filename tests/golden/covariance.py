"""Covariances of a small two-joint regression, and one with autoregressive noise, by statsmodels, for tests/val_covariance.rs.

    python3 tests/golden/covariance.py > tests/golden/covariance.json

Needs numpy and statsmodels (made with statsmodels 0.15.0). The data are closed formulas, so that
only the results are stored.
"""
import json

import numpy as np
import statsmodels.api as sm
from statsmodels.regression.linear_model import yule_walker
from statsmodels.sandbox.regression.gmm import IV2SLS

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
# The first joint alone, its noise an autoregression of the order of least BIC (0 … n/10).
residual = sm.OLS(y[0], X[0]).fit().resid


def bic(order):
    if order == 0:
        return N * np.log(np.var(residual))
    _, sigma = yule_walker(residual, order, method="mle", demean=True, result_object=False)
    return N * np.log(sigma**2) + order * np.log(N)


order = min(range(N // 10 + 1), key=bic)
rho, _ = yule_walker(residual, order, method="mle", demean=True, result_object=False)
glsar = sm.GLSAR(y[0], X[0], rho=rho).fit()
# The same with instruments that resemble the columns.
Z = X[0] + 0.2 * np.column_stack([np.sin(0.11 * t + c) for c in range(COLUMNS)])
iv = IV2SLS(y[0], X[0], instrument=Z).fit()
print(json.dumps({
    "ols_theta": ols.params.tolist(),
    "ols": ols.cov_params().tolist(),
    "wls_theta": wls.params.tolist(),
    "hac": np.asarray(hac.cov_params()).tolist(),
    "cluster": np.asarray(cluster.cov_params()).tolist(),
    "glsar_rho": rho.tolist(),
    "glsar_theta": glsar.params.tolist(),
    "glsar": np.asarray(glsar.cov_params()).tolist(),
    "iv_theta": iv.params.tolist(),
    "iv": np.asarray(iv.cov_params()).tolist(),
}, indent=1))
