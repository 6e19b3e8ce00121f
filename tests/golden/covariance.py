"""Estimates and covariances of a small two-joint regression by statsmodels, for tests/val_covariance.rs; what it does not have
(seemingly unrelated equations, corrected blocks, what resampled blocks expect) by its formula.

    python3 tests/golden/covariance.py > tests/golden/covariance.json

Needs numpy, SciPy and statsmodels (made with statsmodels 0.15.0). The data are closed formulas, so that
only the results are stored.
"""
import json

import numpy as np
import statsmodels.api as sm
from scipy import signal
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


def seemingly_unrelated(designs, torques):
    """Zellner 1962 with the residuals of equations that are weighted twice by those before, each joint's variance over what its
    share of the parameters leaves of its rows; their correlation about zero. Where joints share no parameter the weights change
    nothing, and this is his own estimate (that of linearmodels 7.1 with debiased covariances).

    θ, (Xᵀ(Σ⁻¹ ⊗ 1)X)⁻¹, and the variance that the mixed equations are left with, of which one is expected.
    """
    joints, (rows, y) = len(designs), (np.vstack(designs), np.concatenate(torques))
    sigma = np.ones(joints)
    for _ in range(3):
        used, weighted = sigma, rows / np.repeat(sigma, N)[:, None]
        bread = np.linalg.inv(weighted.T @ weighted)
        e = (y - rows @ (bread @ weighted.T @ (y / np.repeat(sigma, N)))).reshape(joints, N)
        hat = np.sum(weighted @ bread * weighted, axis=1).reshape(joints, N)
        sigma = np.sqrt(np.sum(e**2, axis=1) / (N - hat.sum(axis=1)))
    length = np.linalg.norm(e, axis=1)
    inverse = np.linalg.inv(e @ e.T / np.outer(length, length) * np.outer(used, used))
    precision = np.kron(inverse, np.eye(N))
    covariance = np.linalg.inv(rows.T @ precision @ rows)
    estimate = covariance @ rows.T @ precision @ y
    left = y - rows @ estimate
    variance = left @ precision @ left / (len(y) - len(estimate))
    return {"theta": estimate.tolist(), "covariance": covariance.tolist(), "variance": variance}


both = [y[0], y[1] + 0.8 * noise(0)]
shared = seemingly_unrelated(X, both)
nothing = np.zeros_like(X[0])
own = seemingly_unrelated([np.hstack([X[0], nothing]), np.hstack([nothing, X[1]])], both)

# The first joint behind a low-pass, both passes together at 1/sqrt(2) at an eighth of the rate; its ends and three rows of four are
# left out.
ORDER, EVERY = 4, 4
warped = np.tan(np.pi / (2 * EVERY)) * (np.sqrt(2) - 1) ** (-0.5 / ORDER)
once = 2 * np.arctan(warped) / np.pi  # of one pass, in half the rate
slowest = np.abs(signal.butter(ORDER, once, output="zpk")[1]).max()
edge = min(int(np.ceil(np.log(0.01) / np.log(slowest))), N // 8)
sections = signal.butter(ORDER, once, output="sos")
thinned = [signal.sosfiltfilt(sections, v, axis=0)[edge : N - edge : EVERY] for v in (X[0], y[0])]
decimated = sm.OLS(thinned[1], thinned[0]).fit()


def resampled(joint):
    """Mean of δδᵀ for δ = (XᵀX)⁻¹Xᵀe* over all series e* that blocks of 16 of the residuals less their mean can make (Künsch 1989),
    the last one cut, in two periods of 125 rows with one X. Blocks are drawn one by one: their covariances add up, and their means.
    """
    block, k = 16, np.arange(250)
    rows = np.column_stack(
        [np.cos(0.05 * (joint + 1) * (2 * c + 1) * (k % 125) + 0.4 * c) for c in range(2)]
    )
    e = np.zeros(len(k))
    for i in k:
        e[i] = np.sin((0.37 + 0.11 * joint) * i * i + joint) + (0.6 * e[i - 1] if i else 0.0)
    bread = np.linalg.inv(rows.T @ rows)
    e -= rows @ (bread @ rows.T @ e)
    e -= e.mean()
    spread, mean = np.zeros((2, 2)), np.zeros(2)
    for start in range(0, len(k), block):
        part = rows[start : start + block]
        scores = [part.T @ e[u : u + len(part)] for u in range(len(k) - block + 1)]
        spread += np.cov(np.transpose(scores), bias=True)
        mean += np.mean(scores, axis=0)
    return bread @ (spread + np.outer(mean, mean)) @ bread


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
    "sur_shared": shared,
    "sur_own": own,
    "decimated_theta": decimated.params.tolist(),
    "decimated": decimated.cov_params().tolist(),
    "bootstrap": [resampled(joint)[np.triu_indices(2)].tolist() for joint in range(24)],
}, indent=1))
