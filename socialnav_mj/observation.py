"""What a controller sees: poses and velocities in each agent's frame; pure functions.

Keys of an observation, for n slots of agents and m slots of pedestrians:

| key | shape | meaning |
|---|---|---|
| active | (n,) bool | the slot holds an agent that is under way; other rows are zero |
| person | (n,) int64 | id of the person the agent replaces, -1 if inactive; changes when a slot is used again |
| position | (n, 2) | world [m] |
| heading | (n,) | world [rad] |
| twist | (n, 2) | measured forward speed [m/s] and yaw rate [rad/s] |
| goal | (n, 2) | agent's frame: ahead, left [m] |
| pedestrian_position | (n, m, 2) | agent's frame, relative [m] |
| pedestrian_velocity | (n, m, 2) | agent's frame's axes, the pedestrian's own velocity over ground [m/s] |
| pedestrian_mask | (n, m) bool | the pedestrian is there; other entries are zero |
| agent_position | (n, n, 2) | as above, for the other agents |
| agent_velocity | (n, n, 2) | |
| agent_mask | (n, n) bool | the other agent is there and is not oneself |

A controller that asks for the k nearest within a radius, by `sees_nearest = (k, radius)`, gets k columns in place of m
or of n once there are `FULL_BELOW` slots of that kind: the nearest first, whoever that is, so that a column is another
one in the next step; masked where there are fewer. Arrays for all grow with the square of the crowd.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from socialnav_mj.elementary import cos, sin
from socialnav_mj.geometry import Array, turned_back

Neighbours = tuple[int, float]
"""How many of the nearest are wanted, >= 1, and how near they have to be, > 0 [m]."""
FULL_BELOW = 100
"""With fewer slots everybody is shown, in the order of slots, whatever is asked for."""


def observe(
    *,
    active: NDArray[np.bool_],
    person: NDArray[np.int64],
    position: Array,
    heading: Array,
    velocity: Array,
    yaw_rate: Array,
    goal: Array,
    pedestrian_position: Array,
    pedestrian_velocity: Array,
    pedestrian_slots: NDArray[np.int64],
    neighbours: Neighbours | None = None,
) -> dict[str, NDArray[Any]]:
    """Turn the state of a scene in world coordinates into what every agent slot is shown.

    Args:
        active: (n,) which slots hold an agent under way.
        person: (n,) id of the person replaced.
        position: (n, 2) world [m].
        heading: (n,) world [rad].
        velocity: (n, 2) world [m/s].
        yaw_rate: (n,) [rad/s].
        goal: (n, 2) world [m].
        pedestrian_position: (m, 2) world [m].
        pedestrian_velocity: (m, 2) world [m/s].
        pedestrian_slots: (k,) slots of the pedestrians in the scene; the others may hold anything.
        neighbours: How many of the nearest to show, and how near; None for all.

    Returns:
        The keys, shapes and units of this module's docstring.
    """
    n, m = len(active), len(pedestrian_position)
    rows = np.flatnonzero(active)
    people_shown, agents_shown = (
        count if neighbours is None or count < FULL_BELOW else neighbours[0] for count in (m, n)
    )
    result: dict[str, NDArray[Any]] = {
        "active": active.copy(),
        "person": np.where(active, person, -1),
        "position": np.zeros((n, 2)),
        "heading": np.zeros(n),
        "twist": np.zeros((n, 2)),
        "goal": np.zeros((n, 2)),
        "pedestrian_position": np.zeros((n, people_shown, 2)),
        "pedestrian_velocity": np.zeros((n, people_shown, 2)),
        "pedestrian_mask": np.zeros((n, people_shown), dtype=bool),
        "agent_position": np.zeros((n, agents_shown, 2)),
        "agent_velocity": np.zeros((n, agents_shown, 2)),
        "agent_mask": np.zeros((n, agents_shown), dtype=bool),
    }
    if not rows.size:
        return result
    here, facing, moving = position[rows], heading[rows], velocity[rows]
    c, s = cos(facing), sin(facing)
    own = turned_back(moving, c, s)
    result["position"][rows] = here
    result["heading"][rows] = facing
    result["twist"][rows, 0] = own[:, 0]
    result["twist"][rows, 1] = yaw_rate[rows]
    result["goal"][rows] = turned_back(goal[rows] - here, c, s)
    c, s = c[:, None], s[:, None]
    if neighbours is not None and m >= FULL_BELOW:
        place, pace = pedestrian_position[pedestrian_slots], pedestrian_velocity[pedestrian_slots]
        chosen, there = nearest(here, place, neighbours, among_them=False)
        result["pedestrian_mask"][rows] = there
        result["pedestrian_position"][rows] = turned_back(place[chosen] - here[:, None], c, s) * there[..., None]
        result["pedestrian_velocity"][rows] = turned_back(pace[chosen], c, s) * there[..., None]
    else:
        people = (rows[:, None], pedestrian_slots)
        result["pedestrian_mask"][people] = True
        result["pedestrian_position"][people] = turned_back(pedestrian_position[pedestrian_slots] - here[:, None], c, s)
        result["pedestrian_velocity"][people] = turned_back(pedestrian_velocity[pedestrian_slots], c, s)
    if neighbours is not None and n >= FULL_BELOW:
        chosen, there = nearest(here, here, neighbours, among_them=True)
        result["agent_mask"][rows] = there
        result["agent_position"][rows] = turned_back(here[chosen] - here[:, None], c, s) * there[..., None]
        result["agent_velocity"][rows] = turned_back(moving[chosen], c, s) * there[..., None]
    else:
        others = (rows[:, None], rows)
        seen = ~np.eye(len(rows), dtype=bool)
        result["agent_mask"][others] = seen
        result["agent_position"][others] = turned_back(here - here[:, None], c, s) * seen[..., None]
        result["agent_velocity"][others] = turned_back(moving, c, s) * seen[..., None]
    return result


def nearest(
    here: Array, others: Array, neighbours: Neighbours, *, among_them: bool
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Who is nearest to whom, found with a k-d tree (scipy.spatial.cKDTree).

    Args:
        here: Who looks, shape (j, 2) [m].
        others: Whom they look at, shape (i, 2) [m].
        neighbours: How many of them, k, and how near they have to be.
        among_them: Whether `others` is `here`, and nobody is its own neighbour.

    Returns:
        Index into `others`, shape (j, k), the nearest first and of those equally near the lower one; and which of them
        are there; the rest are 0.
    """
    count, radius = neighbours
    if not len(others) or not len(here):
        return np.zeros((len(here), count), dtype=np.int64), np.zeros((len(here), count), dtype=bool)
    # In its own neighbourhood everybody is found first, or among those on the same spot.
    ranks = np.arange(1, count + 1 + among_them)
    found = np.sort(cKDTree(others).query(here, k=ranks, distance_upper_bound=radius)[1], axis=1)
    there = found < len(others)
    if among_them:
        there &= found != np.arange(len(here))[:, None]
    found = np.where(there, found, 0)
    apart = others[found] - here[:, None]
    order = np.argsort(np.where(there, apart[..., 0] ** 2 + apart[..., 1] ** 2, np.inf), axis=1, kind="stable")
    order = order[:, :count]
    return np.take_along_axis(found, order, axis=1), np.take_along_axis(there, order, axis=1)
