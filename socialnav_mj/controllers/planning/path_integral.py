"""Path-integral control: a better plan is the mean of noisy ones, weighted by what they cost.

Williams et al. 2017, doi 10.1109/ICRA.2017.7989202; with an uncontrolled share as in Williams et al. 2018, doi
10.1109/TRO.2018.2865891.
"""

import numpy as np

from socialnav_mj.elementary import exp
from socialnav_mj.geometry import Array

LEAST_WEIGHT = 30.0
"""Plans that cost so many temperatures more than the best count for nothing: their weight would be below 1e-13."""


def correlated(white: Array, correlation: float) -> Array:
    """Noise that lasts: each step keeps a share of the step before, with the variance unchanged.

    Args:
        white: (..., steps, 2) independent standard normal numbers.
        correlation: Of two steps that follow one another, in [0, 1).

    Returns:
        The same shape.
    """
    result, fresh = np.empty_like(white), np.sqrt(1.0 - correlation * correlation)
    result[..., 0, :] = white[..., 0, :]
    for k in range(1, white.shape[-2]):
        result[..., k, :] = correlation * result[..., k - 1, :] + fresh * white[..., k, :]
    return result


def whitened(controls: Array, correlation: float) -> Array:
    """The inverse of `correlated`.

    Args:
        controls: (..., steps, 2) in units of the noise's standard deviations.
        correlation: As there.

    Returns:
        The same shape.
    """
    result, fresh = controls.copy(), np.sqrt(1.0 - correlation * correlation)
    result[..., 1:, :] = (controls[..., 1:, :] - correlation * controls[..., :-1, :]) / fresh
    return result


def control_costs(nominal: Array, noise: Array, *, deviation: Array, correlation: float, weight: float) -> Array:
    """What noisy controls cost for leaving what an uncontrolled robot would do: weight x u' C^-1 e.

    Args:
        nominal: (n, steps, 2) controls u before the noise.
        noise: (n, p, steps, 2) e, as it was added.
        deviation: (2,) standard deviations of the noise; C is the covariance that they make with the correlation.
        correlation: Of two steps that follow one another.
        weight: The temperature times the uncontrolled share [s].

    Returns:
        (n, p) [s].
    """
    one, two = whitened(nominal / deviation, correlation), whitened(noise / deviation, correlation)
    return weight * np.einsum("nkd,npkd->np", one, two)


def weights_of(costs: Array, temperature: float) -> Array:
    """How much each plan counts: exp(-cost / temperature), with sum 1.

    Args:
        costs: (n, p), at least one of each row finite [s].
        temperature: > 0 [s].

    Returns:
        (n, p); 0 beyond `LEAST_WEIGHT` temperatures above the least cost.
    """
    above = (costs - costs.min(axis=1, keepdims=True)) / temperature
    counts = above <= LEAST_WEIGHT
    weight = np.zeros(costs.shape)
    weight[counts] = exp(-above[counts])
    total = np.zeros(len(costs))
    for k in range(costs.shape[1]):
        total = total + weight[:, k]
    return weight / total[:, None]


def improved(nominal: Array, noise: Array, weight: Array) -> Array:
    """The mean of the noisy plans.

    Args:
        nominal: (n, steps, 2).
        noise: (n, p, steps, 2).
        weight: (n, p) with sum 1.

    Returns:
        (n, steps, 2).
    """
    return nominal + np.einsum("np,npkd->nkd", weight, noise)
