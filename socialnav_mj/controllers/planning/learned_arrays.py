"""What a learned reward says of plans, computed with numpy arrays: what the loops are held to, bit by bit."""

import numpy as np

from socialnav_mj.controllers.planning.learned import (
    SECTORS,
    SIGHT,
    SIZE,
    YAW_SCALE,
    Layers,
    decaying,
    passing,
    risk_of,
    sector_of,
    shortened,
    squashed,
)
from socialnav_mj.controllers.planning.loops import _larger, _root, _smaller
from socialnav_mj.geometry import Array


def learned_costs(
    base: Array,
    states: Array,
    goal: Array,
    x: Array,
    y: Array,
    step: float,
    scale: Array,
    top: float,
    layers: Layers,
) -> Array:
    """Add to plans' costs what the reward on the way is short of a greatest one: scale x max(top - reward, 0).

    Args:
        base: (n, p) costs without it; infinite ones stay [s].
        states: (n, p, s, 6) as `arrays.plan_costs` fills them; the reward is asked for in each.
        goal: (n, 2) [m].
        x: (n, steps + 1, k) others ahead, as in `terms.Crowd` [m].
        y: (n, steps + 1, k) to the left [m].
        step: Of a plan [s].
        scale: (s,) cost of a reward that is short by 1 [s].
        top: The greatest reward that counts.
        layers: Of the reward network.

    Returns:
        (n, p) [s].
    """
    costs = base.copy()
    every = (x.shape[1] - 1) // states.shape[2]
    for i in range(len(base)):
        for a in range(states.shape[2]):
            rows = np.flatnonzero(np.isfinite(base[i]) & ~np.isnan(states[i, :, a, 0]))
            k = (a + 1) * every
            features = _features(states[i, rows, a], goal[i], x[i, k - 1 : k + 1], y[i, k - 1 : k + 1], step)
            reward = squashed(_forward(features, layers))
            costs[i, rows] = costs[i, rows] + scale[a] * _larger(top - reward, 0.0)
    return costs


def _features(state: Array, goal: Array, x: Array, y: Array, step: float) -> Array:
    result = np.zeros((len(state), SIZE))
    own_x, own_y, cosine, sine, v, w = (state[:, None, c] for c in range(6))
    to_x, to_y = goal[0] - own_x[:, 0], goal[1] - own_y[:, 0]
    away = _root(to_x * to_x + to_y * to_y)
    inverse = 1.0 / _larger(away, 1e-9)
    result[:, 0] = (cosine[:, 0] * to_x + sine[:, 0] * to_y) * inverse
    result[:, 1] = (cosine[:, 0] * to_y - sine[:, 0] * to_x) * inverse
    result[:, 2], result[:, 3] = _smaller(away, 10.0) / 10.0, decaying(away)
    result[:, 4], result[:, 5] = v[:, 0], w[:, 0] / YAW_SCALE
    if not x.shape[1]:
        return result
    dx, dy = x[1] - own_x, y[1] - own_y
    ux, uy = (x[1] - x[0]) / step, (y[1] - y[0]) / step
    ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
    rel_x, rel_y = cosine * ux + sine * uy - v, cosine * uy - sine * ux
    distance, closing, tangential = passing(ahead, left, rel_x, rel_y)
    told = decaying(0.5 * distance), shortened(closing), shortened(tangential)
    risk = risk_of(ahead, left, rel_x, rel_y, closing)
    sector = sector_of(ahead, left)
    seen = distance < SIGHT
    every = np.arange(len(state))
    for s in range(SECTORS):
        here = seen & (sector == s)
        nearest = np.where(here, distance, np.inf).argmin(axis=1)
        for block in range(3):
            result[:, 6 + block * SECTORS + s] = np.where(here.any(axis=1), told[block][every, nearest], 0.0)
        result[:, 6 + 3 * SECTORS + s] = np.where(here, risk, 0.0).max(axis=1)
    return result


def _forward(values: Array, layers: Layers) -> Array:
    for number, (weight, bias) in enumerate(layers, start=1):
        total = np.repeat(bias[None], len(values), axis=0)
        # The two inputs beyond the features are the flags of absorbing states, 0 on the way.
        for a in range(values.shape[1]):
            total = total + values[:, a, None] * weight[a]
        values = np.maximum(total, 0.0) if number < len(layers) else total
    return values[:, 0]
