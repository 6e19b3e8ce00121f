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


def by_blocks(corrected):
    """Of the weighted rows, block by block: (I − H_bb)^(−1/2) e_b in row space (Bell and McCaffrey 2002), and the degrees of
    freedom of every parameter (Imbens and Kolesár 2016); without the correction what statsmodels says."""
    root = np.sqrt(weights)
    rows, e = stacked * root[:, None], (torque - stacked @ wls.params) * root
    bread = np.linalg.inv(rows.T @ rows)
    left = np.eye(len(e)) - rows @ bread @ rows.T
    covariance, told = np.zeros((COLUMNS, COLUMNS)), []
    for block in np.unique(time // BLOCK):
        own = np.flatnonzero(time // BLOCK == block)
        value, vector = np.linalg.eigh(left[np.ix_(own, own)])
        power = value ** -0.5 if corrected else np.ones_like(value)
        weighing = (vector * power) @ vector.T @ rows[own] @ bread
        said = weighing.T @ e[own]
        covariance += np.outer(said, said)
        told.append(left[:, own] @ weighing)
    freedom = []
    for parameter in range(COLUMNS):
        z = np.array([block[:, parameter] for block in told])
        gamma = z @ z.T
        freedom.append(np.trace(gamma) ** 2 / np.sum(gamma**2))
    return covariance, COLUMNS / np.sum(1.0 / np.array(freedom))


assert np.allclose(by_blocks(False)[0], np.asarray(cluster.cov_params()), rtol=1e-9)
blocks, blocks_freedom = by_blocks(True)
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
    "blocks": blocks.tolist(),
    "blocks_freedom": blocks_freedom,
    "glsar_rho": rho.tolist(),
    "glsar_theta": glsar.params.tolist(),
    "glsar": np.asarray(glsar.cov_params()).tolist(),
    "iv_theta": iv.params.tolist(),
    "iv": np.asarray(iv.cov_params()).tolist(),
}, indent=1))
