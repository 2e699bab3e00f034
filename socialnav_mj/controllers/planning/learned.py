"""What a learned reward says of plans: formulas, for numbers and arrays alike, and loops that numba compiles.

The features are those of `socialnav_mj.features.continuous`, made of sums, products, quotients, roots and comparisons
alone, as in `loops`; formulas and loops share a file for the reason that is given there. `learned_arrays` calls the
formulas with arrays.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers.planning import loops
from socialnav_mj.controllers.planning.loops import _either, _larger, _root, _smaller
from socialnav_mj.geometry import Array

ASKED = 4
"""How often the reward is asked for along a plan of 3.2 s: it changes little in less than 0.8 s."""
SIGHT, _RISK_TIME, YAW_SCALE = 6.0, 4.0, 2.618
SECTORS = 12
# Tangents of 15 and 75 degrees; the other borders of sectors in a quadrant are at 45.
_FLAT, _STEEP = 2.0 - 3.0**0.5, 2.0 + 3.0**0.5
SIZE = 6 + 4 * SECTORS

Indices = NDArray[np.int64]
Layers = tuple[tuple[Array, Array], ...]
"""(weight (in, out), bias (out,)) of each layer."""


def decaying(x: Any) -> Any:
    """The exponential of -x, for x >= 0, to 1e-10: Taylor's series at a 1024th of it, squared ten times."""
    y = _smaller(x, 40.0) * (1.0 / 1024.0)
    e = 1.0 - y * (1.0 - y * (0.5 - y * (1.0 / 6.0 - y * (1.0 / 24.0))))
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


def passing(x: Any, y: Any, vx: Any, vy: Any) -> tuple[Any, Any, Any]:
    """Distance [m], closing and tangential speed [m/s] of one person."""
    distance = _root(x * x + y * y)
    inverse = 1.0 / _larger(distance, 1e-9)
    return distance, -(vx * x + vy * y) * inverse, (x * vy - y * vx) * inverse


def shortened(speed: Any) -> Any:
    """A speed as a feature."""
    return _smaller(_larger(0.5 * speed, -1.0), 1.0)


def risk_of(x: Any, y: Any, vx: Any, vy: Any, closing: Any) -> Any:
    """Risk of the encounter with one person, as a feature."""
    square = vx * vx + vy * vy
    time = _either(square > 1e-9, _larger(-(x * vx + y * vy), 0.0) / _larger(square, 1e-9), 0.0)
    dx, dy = x + time * vx, y + time * vy
    risk = decaying(0.5 * _smaller(time, _RISK_TIME) + 2.0 * _root(dx * dx + dy * dy))
    return _either((closing > 0.0) & (time < _RISK_TIME), risk, 0.0)


def sector_of(ahead: Any, left: Any) -> Any:
    """Which of twelve sectors of 30 degrees a place is in, as `socialnav_mj.features.view.sector_of` counts them."""
    a, b = abs(ahead), abs(left)
    within = _either(b > _STEEP * a, 3, _either(b > a, 2, _either(b > _FLAT * a, 1, 0)))
    back = _either(left < 0.0, 6 + within, 6 - within)
    return _either(ahead < 0.0, back, _either(left < 0.0, (12 - within) % 12, within))


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
    """What `learned_arrays.learned_costs` returns, of plans that can be among the best; called as `compiled` has it.

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
    n, p, often, _ = states.shape
    every = (x.shape[1] - 1) // often
    costs = np.full((n, p), np.inf)
    near, features = np.empty(SECTORS), np.empty(SIZE)
    widest = SIZE
    for number in range(len(layers)):
        widest = max(widest, len(layers[number][1]))
    used, packed, sums = np.empty(widest + 1, dtype=np.int64), np.empty(widest + 1), np.empty((2, widest))
    for i in range(n):
        order = np.argsort(base[i], kind="mergesort")
        for m in range(p):
            q = order[m]
            total = base[i, q]
            if total == np.inf or total > best[i, -1]:
                break
            for turn in range(often):
                if np.isnan(states[i, q, turn, 0]):
                    break
                own, k = states[i, q, turn], (turn + 1) * every
                cosine, sine, v = own[2], own[3], own[4]
                to_x, to_y = goal[i, 0] - own[0], goal[i, 1] - own[1]
                away = _root(to_x * to_x + to_y * to_y)
                inverse = 1.0 / _larger(away, 1e-9)
                features[:] = 0.0
                near[:] = np.inf
                features[0] = (cosine * to_x + sine * to_y) * inverse
                features[1] = (cosine * to_y - sine * to_x) * inverse
                features[2], features[3] = _smaller(away, 10.0) / 10.0, decaying(away)
                features[4], features[5] = v, own[5] / YAW_SCALE
                for j in range(x.shape[2]):
                    dx, dy = x[i, k, j] - own[0], y[i, k, j] - own[1]
                    if dx * dx + dy * dy > SIGHT * SIGHT + 1.0:
                        continue
                    ux, uy = (x[i, k, j] - x[i, k - 1, j]) / step, (y[i, k, j] - y[i, k - 1, j]) / step
                    ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
                    rel_x, rel_y = cosine * ux + sine * uy - v, cosine * uy - sine * ux
                    distance, closing, tangential = passing(ahead, left, rel_x, rel_y)
                    if distance >= SIGHT:
                        continue
                    s = sector_of(ahead, left)
                    # Nobody who moves away is a risk, and exponentials take most of the time.
                    if closing > 0.0:
                        risk = risk_of(ahead, left, rel_x, rel_y, closing)
                        features[6 + 3 * SECTORS + s] = _larger(features[6 + 3 * SECTORS + s], risk)
                    if distance < near[s]:
                        near[s] = distance
                        features[6 + SECTORS + s] = shortened(closing)
                        features[6 + 2 * SECTORS + s] = shortened(tangential)
                for s in range(SECTORS):
                    if near[s] < np.inf:
                        features[6 + s] = decaying(0.5 * near[s])
                values, count = features, SIZE
                for number in range(len(layers)):
                    weight, bias = layers[number]
                    # Of the first layer all inputs count, of others what the rectifier lets pass; 0 adds nothing.
                    count = _counted(values, count, number == 0, used, packed)
                    values = sums[number % 2]
                    _add_up(packed, used, count, weight, bias, values)
                    count = len(bias)
                total = total + scale[turn] * _larger(top - squashed(values[0]), 0.0)
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


def _counted(values: Array, size: int, is_signed: bool, used: Indices, packed: Array) -> int:
    """Put those of the first values that add something to a layer into `packed`, their places into `used`; how many."""
    count = 0
    for a in range(size):
        # Written in any case, which is faster than a branch that nothing foretells.
        used[count], packed[count] = a, values[a]
        if values[a] > 0.0 or (is_signed and values[a] < 0.0):
            count += 1
    return count


def _add_up(packed: Array, used: Indices, count: int, weight: Array, bias: Array, out: Array) -> None:
    """Output of a layer of these inputs."""
    if len(bias) == 1:
        total = bias[0]
        for c in range(count):
            total += packed[c] * weight[used[c], 0]
        out[0] = total
        return
    for b in range(len(bias)):
        out[b] = bias[b]
    # Four at a time, added in their order: fewer ways to the memory and back.
    c = 0
    while c + 4 <= count:
        one, two, three, four = weight[used[c]], weight[used[c + 1]], weight[used[c + 2]], weight[used[c + 3]]
        e, f, g, h = packed[c], packed[c + 1], packed[c + 2], packed[c + 3]
        for b in range(len(bias)):
            out[b] = (((out[b] + e * one[b]) + f * two[b]) + g * three[b]) + h * four[b]
        c += 4
    while c < count:
        one, e = weight[used[c]], packed[c]
        for b in range(len(bias)):
            out[b] += e * one[b]
        c += 1


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

    for formula in (decaying, squashed, passing, shortened, risk_of, sector_of, _counted, _add_up):
        register_jitable(formula)
    try:
        return numba.njit(cache=True)(loop_costs)
    except RuntimeError:  # no folder to keep it in may be written to
        return numba.njit(loop_costs)
