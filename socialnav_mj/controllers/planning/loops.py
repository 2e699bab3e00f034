"""Formulas of a roll-out, for numbers and arrays alike, and loops over them that numba compiles.

The formulas are elementwise, of sums, products, quotients, roots and comparisons alone, which round alike on every
processor. `arrays.plan_costs` calls them with arrays, `loop_costs` with numbers and in the same order: the same bits.
Formulas and loops share a file because numba compiles anew only when the file of the loops has changed.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from socialnav_mj.controllers.planning.terms import Crowd, Terms
from socialnav_mj.geometry import Array

_TINY = 1e-12
# Taylor's coefficients; products of them, since a quotient takes as long as ten.
_S = tuple(1.0 / math.factorial(k) for k in (3, 5, 7, 9, 11))
_C = tuple(1.0 / math.factorial(k) for k in (2, 4, 6, 8, 10))


def _smaller(a: Any, b: Any) -> Any:
    return np.minimum(a, b)


def _larger(a: Any, b: Any) -> Any:
    return np.maximum(a, b)


def _either(condition: Any, a: Any, b: Any) -> Any:
    return np.where(condition, a, b)


def _root(a: Any) -> Any:
    return np.sqrt(a)


def sine_cosine(angle: Any) -> Any:
    """Sine and cosine of angles up to 4 rad, to 1e-9: Taylor's series of a quarter of the angle, doubled twice."""
    sine, cosine = small_sine_cosine(0.25 * angle)
    sine, cosine = 2.0 * sine * cosine, cosine * cosine - sine * sine
    return 2.0 * sine * cosine, cosine * cosine - sine * sine


def small_sine_cosine(angle: Any) -> Any:
    """Sine and cosine of angles up to 1 rad, to 1e-9: Taylor's series."""
    z = angle * angle
    sine = angle * (1.0 - z * (_S[0] - z * (_S[1] - z * (_S[2] - z * (_S[3] - z * _S[4])))))
    cosine = 1.0 - z * (_C[0] - z * (_C[1] - z * (_C[2] - z * (_C[3] - z * _C[4]))))
    return sine, cosine


def bearing(y: Any, x: Any) -> Any:
    """Angle of a point from the x axis, in [-pi, pi], to 2e-8 (Abramowitz and Stegun 1964, formula 4.4.49) [rad]."""
    a, b = abs(y), abs(x)
    r = _smaller(a, b) / _larger(_larger(a, b), 1e-300)
    z = r * r
    p = 0.0429096138 + z * (-0.0161657367 + z * 0.0028662257)
    p = -0.1420889944 + z * (0.1065626393 + z * (-0.07528964 + z * p))
    p = r + r * (z * (-0.3333314528 + z * (0.1999355085 + z * p)))
    angle = _either(a > b, 0.5 * np.pi - p, p)
    angle = _either(x < 0.0, np.pi - angle, angle)
    return _either(y < 0.0, -angle, angle)


def yaw_command(error: Any, terms: Terms) -> Any:
    """Yaw rate that removes a heading error [rad] in a step, within the limit, and from which it can stop [rad/s]."""
    lost = 0.5 * terms.motion.yaw_acceleration * terms.step
    most = _smaller(_root(lost * lost + 2.0 * terms.motion.yaw_acceleration * abs(error)) - lost, terms.max_yaw_rate)
    return _smaller(_larger(error / terms.step, -most), most)


def yaw_reached(command: Any, yaw_rate: Any, terms: Terms) -> Any:
    """Yaw rate at the end of a step [rad/s]."""
    nearest = _smaller(_larger(command, yaw_rate - terms.motion.yaw_change), yaw_rate + terms.motion.yaw_change)
    return _either(abs(command - yaw_rate) <= terms.motion.yaw_change, command, nearest)


def turn_made(reached: Any, yaw_rate: Any, terms: Terms) -> Any:
    """Turn in a step: as reached, less what is lost until the robot has that yaw rate [rad]."""
    change = reached - yaw_rate
    return reached * terms.step - change * (0.5 * abs(change) / terms.motion.yaw_acceleration + terms.motion.yaw_delay)


def speed_gained(command: Any, speed: Any, terms: Terms) -> Any:
    """Change of speed in a step [m/s]."""
    change = terms.motion.speed_response * (command - speed)
    return _smaller(_larger(change, -terms.motion.speed_change), terms.motion.speed_change)


def driven(speed_command: Any, yaw_command: Any, speed: Any, yaw_rate: Any, terms: Terms) -> tuple[Any, Any, Any, Any]:
    """Way [m] and turn [rad] in a step, speed [m/s] and yaw rate [rad/s] at its end."""
    reached, gained = yaw_reached(yaw_command, yaw_rate, terms), speed_gained(speed_command, speed, terms)
    way = (speed + terms.motion.mean_speed * gained) * terms.step
    return way, turn_made(reached, yaw_rate, terms), speed + gained, reached


def closest(x0: Any, y0: Any, x1: Any, y1: Any) -> Any:
    """Least distance to the origin on the straight way from one point to another."""
    dx, dy = x1 - x0, y1 - y0
    share = _smaller(_larger(-(x0 * dx + y0 * dy) / (dx * dx + dy * dy + _TINY), 0.0), 1.0)
    x, y = x0 + share * dx, y0 + share * dy
    return _root(x * x + y * y)


def lacking(distance: Any, contact: Any, margin: Any, terms: Terms) -> Any:
    """Square of the share of the free clearance that is missing: 0 beyond it, 1 a little inside of contact."""
    lack = _smaller(_larger((contact + margin - distance) / (margin + terms.overlap), 0.0), terms.most_lacking)
    return lack * lack


def inside(distance: Any, terms: Terms) -> Any:
    """Whether somebody is in the zone: 0 at its edge, rising to 1."""
    return _smaller(_larger((terms.zone - distance) / terms.zone_width, 0.0), 1.0)


def at_entrance(x: Any, y: Any, terms: Terms) -> Any:
    """Whether a place is where somebody may appear: 1 there, falling to 0 at the radius, by distances (x, y)."""
    q = _larger(1.0 - (x * x + y * y) / (terms.entrance_radius * terms.entrance_radius), 0.0)
    return (q * q) * (q * q)


def loop_costs(
    plans: Array,
    speed: Array,
    yaw_rate: Array,
    goal: Array,
    crowd: Crowd,
    terms: Terms,
    best: Array,
    slack: float,
    states: Array,
) -> tuple[Array, Array]:
    """What `arrays.plan_costs` returns, number by number; to be called as `compiled` returns it.

    What it leaves out changes no other result: others who are out of reach at a step, and the rest of plans that can
    no longer be among the best, since no cost falls and nobody comes nearer to the goal than at full speed.

    Args:
        plans: As there.
        speed: As there.
        yaw_rate: As there.
        goal: As there.
        crowd: As there.
        terms: As there.
        best: (n, b) least costs of each agent so far, ascending, infinite if there are fewer; brought up to date.
        slack: What whoever asks may add to a cost: a plan is given up when it must cost more than `best` held at first,
            or more than this above the greatest of `best` [s].
        states: As there.

    Returns:
        As there; both are infinite for plans that were given up.
    """
    n, p, _ = plans.shape
    steps, others, entrances = len(terms.margin), crowd.contact.shape[1], crowd.entrance_x.shape[1]
    sequence = plans.shape[2] != 5
    square = terms.entrance_radius * terms.entrance_radius
    every = steps // _larger(states.shape[2], 1)
    costs, clearances = np.full((n, p), np.inf), np.full((n, p), np.inf)
    near, count = np.empty((steps, others), dtype=np.int64), np.empty(steps, dtype=np.int64)
    cut, worst = np.empty((steps, others)), np.empty(others)
    for i in range(n):
        worst_kept = best[i, -1]
        stride = _larger(abs(speed[i]), terms.max_speed) * terms.step + 1e-6
        for k in range(steps):
            count[k] = 0
            for j in range(others):
                if crowd.clearance_weight[i, j] <= 0.0 and crowd.zone_weight[i, j] <= 0.0:
                    continue
                x, y = crowd.x[i, k, j], crowd.y[i, k, j]
                dx, dy = crowd.x[i, k + 1, j] - x, crowd.y[i, k + 1, j] - y
                range_ = crowd.contact[i, j] + terms.margin[k]
                if crowd.zone_weight[i, j] > 0.0:
                    range_ = _larger(range_, terms.zone)
                # Who is farther away than this when a step begins is out of range until it ends.
                distance = range_ + stride + _root(dx * dx + dy * dy)
                if _root(x * x + y * y) <= distance + stride * k:
                    cut[k, j] = distance * distance
                    near[k, count[k]] = j
                    count[k] += 1
        for q in range(p):
            first_y, first_x = sine_cosine(plans[i, q, 0])
            offset_y, offset_x = sine_cosine(plans[i, q, 3])
            x, y, cosine, sine, v, w = 0.0, 0.0, 1.0, 0.0, speed[i], yaw_rate[i]
            to_x, to_y = goal[i, 0], goal[i, 1]
            total, most, within, time, remaining, facing = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            worst[:] = 0.0
            arrived, given_up = False, False
            for k in range(steps):
                head_x, head_y, commanded = first_x, first_y, plans[i, q, 1]
                if k * terms.step >= plans[i, q, 2]:
                    head_x, head_y = offset_x * to_x - offset_y * to_y, offset_x * to_y + offset_y * to_x
                    commanded = plans[i, q, 4]
                if sequence:
                    commanded, command = plans[i, q, 2 * k], plans[i, q, 2 * k + 1]
                else:
                    error = bearing(cosine * head_y - sine * head_x, cosine * head_x + sine * head_y)
                    command = yaw_command(error, terms)
                way, turn, v, w = driven(commanded, command, v, w, terms)
                half_sine, half_cosine = small_sine_cosine(0.5 * turn)
                cosine, sine = cosine * half_cosine - sine * half_sine, sine * half_cosine + cosine * half_sine
                next_x, next_y = x + way * cosine, y + way * sine
                cosine, sine = cosine * half_cosine - sine * half_sine, sine * half_cosine + cosine * half_sine
                weighted = 0.0
                for m in range(count[k]):
                    j = near[k, m]
                    from_x, from_y = crowd.x[i, k, j] - x, crowd.y[i, k, j] - y
                    if from_x * from_x + from_y * from_y > cut[k, j]:
                        continue
                    distance = closest(from_x, from_y, crowd.x[i, k + 1, j] - next_x, crowd.y[i, k + 1, j] - next_y)
                    lack = terms.clearance_decay[k] * lacking(distance, crowd.contact[i, j], terms.margin[k], terms)
                    lack = crowd.clearance_weight[i, j] * lack
                    if lack > worst[j]:
                        total, most = total + (lack - worst[j]), _larger(most, lack)
                        worst[j] = lack
                    weighted = weighted + crowd.zone_weight[i, j] * inside(distance, terms)
                for e in range(entrances):
                    from_x, from_y = crowd.entrance_x[i, e] - next_x, crowd.entrance_y[i, e] - next_y
                    if from_x * from_x + from_y * from_y < square:
                        weighted = weighted + crowd.entrance_weight[i, e] * at_entrance(from_x, from_y, terms)
                within = within + weighted * terms.zone_time[k]
                x, y = next_x, next_y
                if states.shape[0] > 0 and (k + 1) % every == 0:
                    own = states[i, q, k // every]
                    own[0], own[1], own[2], own[3], own[4], own[5] = x, y, cosine, sine, v, w
                to_x, to_y = goal[i, 0] - x, goal[i, 1] - y
                time = (k + 1) * terms.step
                remaining = _root(to_x * to_x + to_y * to_y)
                if remaining <= terms.arrival_distance:
                    arrived = True
                    break
                # A robot that was thrown is faster than its limit: then the way that is left promises nothing.
                left = remaining if v <= terms.max_speed else 0.0
                least = time + (left - terms.arrival_distance) / terms.max_speed + 0.5 * (total + most) + within
                if least > _smaller(worst_kept, best[i, -1] + slack) + 1e-6:
                    given_up = True
                    break
            if given_up:
                continue
            if not arrived:
                error = bearing(cosine * to_y - sine * to_x, cosine * to_x + sine * to_y)
                facing = terms.heading_weight * abs(error)
            total = 0.0
            for j in range(others):
                total = total + worst[j]
            clearance = 0.5 * (total + most)
            cost = time + (remaining - terms.arrival_distance) / terms.max_speed + facing + clearance + within
            costs[i, q], clearances[i, q] = cost, clearance
            place = best.shape[1] - 1
            if cost < best[i, place]:
                while place > 0 and cost < best[i, place - 1]:
                    best[i, place] = best[i, place - 1]
                    place -= 1
                best[i, place] = cost
    return costs, clearances


@cache
def compiled() -> Callable[..., tuple[Array, Array]] | None:
    """`loop_costs` as machine code, kept beside this file or in numba's cache; the first call of all takes seconds.

    Returns:
        None if numba, the extra `fast`, is not installed.
    """
    try:
        import numba
        from numba.extending import overload, register_jitable
    except ImportError:
        return None
    # Of numbers, numpy's own functions are slow to compile and slow to run.
    overload(_smaller)(lambda a, b: lambda a, b: a if a < b else b)
    overload(_larger)(lambda a, b: lambda a, b: a if a > b else b)
    overload(_either)(lambda condition, a, b: lambda condition, a, b: a if condition else b)
    overload(_root)(lambda a: lambda a: math.sqrt(a))
    formulas = (
        sine_cosine,
        small_sine_cosine,
        bearing,
        yaw_command,
        yaw_reached,
        turn_made,
        speed_gained,
        driven,
        closest,
        lacking,
        inside,
        at_entrance,
    )
    for formula in formulas:
        register_jitable(formula)
    try:
        return numba.njit(cache=True)(loop_costs)
    except RuntimeError:  # no folder to keep it in may be written to
        return numba.njit(loop_costs)
