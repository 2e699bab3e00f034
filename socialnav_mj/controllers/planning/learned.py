"""What a learned reward says of plans: formulas and loops that numba compiles, and the same with arrays, bit by bit.

The features are those of `socialnav_mj.features.continuous`, made of sums, products, quotients, roots and comparisons
alone, as in `loops`; formulas and loops share a file for the reason that is given there.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from socialnav_mj.controllers.planning import loops
from socialnav_mj.controllers.planning.loops import _either, _larger, _root, _smaller
from socialnav_mj.elementary import cos, sin
from socialnav_mj.geometry import Array

STRIDE = 4
"""Every how many steps of a plan the reward is asked for: it changes little in less than 0.8 s."""
_SIGHT, _RISK_TIME, _YAW_SCALE = 6.0, 4.0, 2.618
_SECTORS = 12
_CENTRES = 2.0 * np.pi / _SECTORS * np.arange(_SECTORS)
_AHEAD, _LEFT = cos(_CENTRES).round(12), sin(_CENTRES).round(12)
_SIZE = 6 + 4 * _SECTORS

Layers = tuple[tuple[Array, Array], ...]
"""(weight (in, out), bias (out,)) of each layer."""


def decaying(x: Any) -> Any:
    """The exponential of -x, for x >= 0, to 1e-10: Taylor's series at a 1024th of it, squared ten times."""
    y = _smaller(x, 40.0) / 1024.0
    e = 1.0 - y * (1.0 - y / 2.0 * (1.0 - y / 3.0 * (1.0 - y / 4.0)))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


def squashed(x: Any) -> Any:
    """Hyperbolic tangent, to 1e-10."""
    e = decaying(2.0 * abs(x))
    t = (1.0 - e) / (1.0 + e)
    return _either(x < 0.0, -t, t)


def encounter(x: Any, y: Any, vx: Any, vy: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Distance [m], proximity, closing and tangential speed and risk of one person, as features."""
    distance = _root(x * x + y * y)
    inverse = 1.0 / _larger(distance, 1e-9)
    closing = -(vx * x + vy * y) * inverse
    tangential = (x * vy - y * vx) * inverse
    square = vx * vx + vy * vy
    time = _either(square > 1e-9, _larger(-(x * vx + y * vy), 0.0) / _larger(square, 1e-9), 0.0)
    dx, dy = x + time * vx, y + time * vy
    risk = decaying(0.5 * _smaller(time, _RISK_TIME) + 2.0 * _root(dx * dx + dy * dy))
    risk = _either((closing > 0.0) & (time < _RISK_TIME), risk, 0.0)
    closing = _smaller(_larger(0.5 * closing, -1.0), 1.0)
    tangential = _smaller(_larger(0.5 * tangential, -1.0), 1.0)
    return distance, decaying(0.5 * distance), closing, tangential, risk


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
        states: (n, p, steps, 6) as `arrays.plan_costs` fills them.
        goal: (n, 2) [m].
        x: (n, steps + 1, k) others ahead, as in `terms.Crowd` [m].
        y: (n, steps + 1, k) to the left [m].
        step: Of a plan [s].
        scale: (steps,) cost of a reward that is short by 1; asked for at every `STRIDE`-th step [s].
        top: The greatest reward that counts.
        layers: Of the reward network.

    Returns:
        (n, p) [s].
    """
    costs = base.copy()
    for i in range(len(base)):
        for k in range(STRIDE - 1, states.shape[2], STRIDE):
            rows = np.flatnonzero(np.isfinite(base[i]) & ~np.isnan(states[i, :, k, 0]))
            features = _features(states[i, rows, k], goal[i], x[i, k : k + 2], y[i, k : k + 2], step)
            reward = squashed(_forward(features, layers))
            costs[i, rows] = costs[i, rows] + scale[k] * _larger(top - reward, 0.0)
    return costs


def _features(state: Array, goal: Array, x: Array, y: Array, step: float) -> Array:
    result = np.zeros((len(state), _SIZE))
    own_x, own_y, cosine, sine, v, w = (state[:, None, c] for c in range(6))
    to_x, to_y = goal[0] - own_x[:, 0], goal[1] - own_y[:, 0]
    away = _root(to_x * to_x + to_y * to_y)
    inverse = 1.0 / _larger(away, 1e-9)
    result[:, 0] = (cosine[:, 0] * to_x + sine[:, 0] * to_y) * inverse
    result[:, 1] = (cosine[:, 0] * to_y - sine[:, 0] * to_x) * inverse
    result[:, 2], result[:, 3] = _smaller(away, 10.0) / 10.0, decaying(away)
    result[:, 4], result[:, 5] = v[:, 0], w[:, 0] / _YAW_SCALE
    if not x.shape[1]:
        return result
    dx, dy = x[1] - own_x, y[1] - own_y
    ux, uy = (x[1] - x[0]) / step, (y[1] - y[0]) / step
    ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
    distance, *told = encounter(ahead, left, cosine * ux + sine * uy - v, cosine * uy - sine * ux)
    sector = (_AHEAD * ahead[..., None] + _LEFT * left[..., None]).argmax(axis=2)
    seen = distance < _SIGHT
    every = np.arange(len(state))
    for s in range(_SECTORS):
        here = seen & (sector == s)
        nearest = np.where(here, distance, np.inf).argmin(axis=1)
        for block in range(3):
            result[:, 6 + block * _SECTORS + s] = np.where(here.any(axis=1), told[block][every, nearest], 0.0)
        result[:, 6 + 3 * _SECTORS + s] = np.where(here, told[3], 0.0).max(axis=1)
    return result


def _forward(values: Array, layers: Layers) -> Array:
    for number, (weight, bias) in enumerate(layers, start=1):
        total = np.repeat(bias[None], len(values), axis=0)
        # The two inputs beyond the features are the flags of absorbing states, 0 on the way.
        for a in range(values.shape[1]):
            total = total + values[:, a, None] * weight[a]
        values = np.maximum(total, 0.0) if number < len(layers) else total
    return values[:, 0]


def loop_costs(
    base: Array,
    states: Array,
    goal: Array,
    x: Array,
    y: Array,
    step: float,
    scale: Array,
    top: float,
    layers: Layers,
    best: Array,
) -> Array:
    """What `learned_costs` returns, of the plans that can be among the best; to be called as `compiled` returns it.

    The cheapest plans without it come first. Nothing more is asked about as soon as the next one alone costs more than
    the worst of the plans that are kept, and nothing more of a plan that already does.

    Args:
        base: As there.
        states: As there.
        goal: As there.
        x: As there.
        y: As there.
        step: As there.
        scale: As there.
        top: As there.
        layers: As there.
        best: (n, b) least costs of each agent so far, ascending, infinite if there are fewer; brought up to date.

    Returns:
        As there; infinite for plans that are not among the best.
    """
    n, p, steps, _ = states.shape
    costs = np.full((n, p), np.inf)
    near, features = np.empty(_SECTORS), np.empty(_SIZE)
    widest = _SIZE
    for number in range(len(layers)):
        widest = max(widest, len(layers[number][1]))
    used = np.empty(widest, dtype=np.int64)
    for i in range(n):
        order = np.argsort(base[i], kind="mergesort")
        for m in range(p):
            q = order[m]
            total = base[i, q]
            if total == np.inf or total > best[i, -1]:
                break
            for k in range(STRIDE - 1, steps, STRIDE):
                if np.isnan(states[i, q, k, 0]):
                    break
                own = states[i, q, k]
                cosine, sine, v = own[2], own[3], own[4]
                to_x, to_y = goal[i, 0] - own[0], goal[i, 1] - own[1]
                away = _root(to_x * to_x + to_y * to_y)
                inverse = 1.0 / _larger(away, 1e-9)
                features[:] = 0.0
                near[:] = np.inf
                features[0] = (cosine * to_x + sine * to_y) * inverse
                features[1] = (cosine * to_y - sine * to_x) * inverse
                features[2], features[3] = _smaller(away, 10.0) / 10.0, decaying(away)
                features[4], features[5] = v, own[5] / _YAW_SCALE
                for j in range(x.shape[2]):
                    dx, dy = x[i, k + 1, j] - own[0], y[i, k + 1, j] - own[1]
                    if dx * dx + dy * dy > _SIGHT * _SIGHT + 1.0:
                        continue
                    ux, uy = (x[i, k + 1, j] - x[i, k, j]) / step, (y[i, k + 1, j] - y[i, k, j]) / step
                    ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
                    distance, proximity, closing, tangential, risk = encounter(
                        ahead, left, cosine * ux + sine * uy - v, cosine * uy - sine * ux
                    )
                    if distance >= _SIGHT:
                        continue
                    s, most = 0, _AHEAD[0] * ahead + _LEFT[0] * left
                    for other in range(1, _SECTORS):
                        along = _AHEAD[other] * ahead + _LEFT[other] * left
                        if along > most:
                            s, most = other, along
                    features[6 + 3 * _SECTORS + s] = _larger(features[6 + 3 * _SECTORS + s], risk)
                    if distance < near[s]:
                        near[s] = distance
                        features[6 + s] = proximity
                        features[6 + _SECTORS + s] = closing
                        features[6 + 2 * _SECTORS + s] = tangential
                values = features
                for number in range(len(layers)):
                    weight, bias = layers[number]
                    out, count = bias.copy(), 0
                    for a in range(len(values)):
                        if values[a] > 0.0 or (number == 0 and values[a] < 0.0):
                            used[count] = a
                            count += 1
                    # Four at a time, added in their order: fewer ways to the memory and back.
                    c = 0
                    while c + 4 <= count:
                        e, f, g, h = used[c], used[c + 1], used[c + 2], used[c + 3]
                        one, two, three, four = values[e], values[f], values[g], values[h]
                        for b in range(len(out)):
                            out[b] = (
                                ((out[b] + one * weight[e, b]) + two * weight[f, b]) + three * weight[g, b]
                            ) + four * weight[h, b]
                        c += 4
                    while c < count:
                        e = used[c]
                        for b in range(len(out)):
                            out[b] += values[e] * weight[e, b]
                        c += 1
                    values = out
                total = total + scale[k] * _larger(top - squashed(values[0]), 0.0)
                if total > best[i, -1]:
                    break
            if total > best[i, -1]:
                continue
            costs[i, q] = total
            place = best.shape[1] - 1
            if total < best[i, place]:
                while place > 0 and total < best[i, place - 1]:
                    best[i, place] = best[i, place - 1]
                    place -= 1
                best[i, place] = total
    return costs


@cache
def compiled() -> Callable[..., Array] | None:
    """`loop_costs` as machine code.

    Returns:
        None if numba, the extra `fast`, is not installed.
    """
    if loops.compiled() is None:
        return None
    import numba
    from numba.extending import register_jitable

    for formula in (decaying, squashed, encounter):
        register_jitable(formula)
    try:
        return numba.njit(cache=True)(loop_costs)
    except RuntimeError:  # no folder to keep it in may be written to
        return numba.njit(loop_costs)
