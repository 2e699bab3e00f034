"""What plans cost, computed with numpy arrays: the definition that the compiled loops are held to, bit by bit."""

import numpy as np

from socialnav_mj.controllers.planning.loops import (
    at_entrance,
    bearing,
    closest,
    compiled,
    driven,
    inside,
    lacking,
    sine_cosine,
    small_sine_cosine,
    yaw_command,
)
from socialnav_mj.controllers.planning.terms import Crowd, Terms
from socialnav_mj.geometry import Array

NOT_WANTED: Array = np.empty((0, 0, 0, 0))
"""For `states`, of whoever asks for costs alone."""


def costs_of(
    plans: Array,
    speed: Array,
    yaw_rate: Array,
    goal: Array,
    crowd: Crowd,
    terms: Terms,
    best: Array,
    slack: float = 0.0,
    states: Array = NOT_WANTED,
) -> tuple[Array, Array]:
    """Costs by the compiled loops if there are any, else by arrays.

    Args:
        plans: As `plan_costs` takes them.
        speed: The same.
        yaw_rate: The same.
        goal: The same.
        crowd: The same.
        terms: The same.
        best: (n, b) least costs so far, as `loops.loop_costs` takes them; it may be changed.
        slack: Plans that cost more than this above the greatest of `best` may be given up [s].
        states: As `plan_costs` fills them.

    Returns:
        Cost, and the part of it that is for clearance, both (n, p), infinite for plans that were given up [s].
    """
    loops = compiled()
    if loops is None:
        return plan_costs(plans, speed, yaw_rate, goal, crowd, terms, states)
    return loops(plans, speed, yaw_rate, goal, crowd, terms, best, slack, states)


def plan_costs(
    plans: Array,
    speed: Array,
    yaw_rate: Array,
    goal: Array,
    crowd: Crowd,
    terms: Terms,
    states: Array = NOT_WANTED,
) -> tuple[Array, Array]:
    """Cost of each plan of each agent, rolled out in the agent's frame.

    A plan of five numbers heads for psi_1 at speed v_1 until t_1, then for the goal's bearing plus psi_2 at v_2; one of
    two numbers a step commands these speeds and yaw rates. Its cost is the time
    to the goal, or the horizon with what is left of the way at full speed and a little for not facing the goal; half
    the sum and half the maximum, over others, of the worst lack of clearance; the time that each person is in the
    zone, and the time where somebody may appear.

    Args:
        plans: (n, p, 5) psi_1 [rad], v_1 [m/s], t_1 [s], psi_2 [rad], v_2 [m/s]; or (n, p, 2 x steps) speed [m/s] and
            yaw rate [rad/s] of the first step, of the second, and so on.
        speed: (n,) measured [m/s].
        yaw_rate: (n,) measured [rad/s].
        goal: (n, 2) [m].
        crowd: Around each agent, for as many steps as there are terms.
        terms: Limits, motion and shapes of the costs.
        states: (n, p, s, 6), s a divisor of steps, filled with place [m], cosine and sine of the heading, speed [m/s]
            and yaw rate [rad/s] at the end of every (steps / s)-th step, NaN after the arrival; or `NOT_WANTED`.

    Returns:
        Cost, and the part of it that is for clearance, both (n, p) [s].
    """
    sequence = plans.shape[2] != 5
    psi_1, v_1, t_1, psi_2, v_2 = np.moveaxis(plans[..., :5], 2, 0)
    first_y, first_x = sine_cosine(psi_1)
    offset_y, offset_x = sine_cosine(psi_2)
    shape = psi_1.shape
    x, y, cosine, sine = np.zeros(shape), np.zeros(shape), np.ones(shape), np.zeros(shape)
    v, w = np.broadcast_to(speed[:, None], shape), np.broadcast_to(yaw_rate[:, None], shape)
    to_x, to_y = np.broadcast_to(goal[:, :1], shape), np.broadcast_to(goal[:, 1:], shape)
    time, within, remaining = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    under_way = np.ones(shape, dtype=bool)
    worst = np.zeros((*shape, crowd.contact.shape[1]))
    every = len(terms.margin) // max(states.shape[2], 1)
    for k in range(len(terms.margin)):
        first = k * terms.step < t_1
        head_x = np.where(first, first_x, offset_x * to_x - offset_y * to_y)
        head_y = np.where(first, first_y, offset_x * to_y + offset_y * to_x)
        error = bearing(cosine * head_y - sine * head_x, cosine * head_x + sine * head_y)
        command = plans[..., 2 * k + 1] if sequence else yaw_command(error, terms)
        commanded = plans[..., 2 * k] if sequence else np.where(first, v_1, v_2)
        way, turn, v, w = driven(commanded, command, v, w, terms)
        half_sine, half_cosine = small_sine_cosine(0.5 * turn)
        cosine, sine = cosine * half_cosine - sine * half_sine, sine * half_cosine + cosine * half_sine
        next_x, next_y = x + way * cosine, y + way * sine
        cosine, sine = cosine * half_cosine - sine * half_sine, sine * half_cosine + cosine * half_sine
        distance = closest(
            crowd.x[:, None, k] - x[..., None],
            crowd.y[:, None, k] - y[..., None],
            crowd.x[:, None, k + 1] - next_x[..., None],
            crowd.y[:, None, k + 1] - next_y[..., None],
        )
        lack = terms.clearance_decay[k] * lacking(distance, crowd.contact[:, None], terms.margin[k], terms)
        counted = np.maximum(worst, crowd.clearance_weight[:, None] * lack)
        worst = np.where(under_way[..., None], counted, worst)
        weighted = _sum(crowd.zone_weight[:, None] * inside(distance, terms))
        for e in range(crowd.entrance_x.shape[1]):
            there = at_entrance(crowd.entrance_x[:, e, None] - next_x, crowd.entrance_y[:, e, None] - next_y, terms)
            weighted = weighted + crowd.entrance_weight[:, e, None] * there
        within = np.where(under_way, within + weighted * terms.zone_time[k], within)
        x, y = next_x, next_y
        if states.size and (k + 1) % every == 0:
            now = np.stack([x, y, cosine, sine, v, w], axis=-1)
            states[:, :, k // every] = np.where(under_way[..., None], now, np.nan)
        to_x, to_y = goal[:, :1] - x, goal[:, 1:] - y
        time = np.where(under_way, (k + 1) * terms.step, time)
        remaining = np.where(under_way, np.sqrt(to_x * to_x + to_y * to_y), remaining)
        under_way = under_way & (remaining > terms.arrival_distance)
    error = bearing(cosine * to_y - sine * to_x, cosine * to_x + sine * to_y)
    facing = np.where(under_way, terms.heading_weight * np.abs(error), 0.0)
    clearance = 0.5 * (_sum(worst) + worst.max(axis=2, initial=0.0))
    cost = time + (remaining - terms.arrival_distance) / terms.max_speed + facing + clearance + within
    return cost, clearance


def _sum(values: Array) -> Array:
    """Over the last axis, from its beginning: numpy's own sum adds in an order that depends on the count."""
    total = np.zeros(values.shape[:-1])
    for j in range(values.shape[-1]):
        total = total + values[..., j]
    return total
