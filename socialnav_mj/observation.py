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
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.elementary import cos, sin
from socialnav_mj.geometry import Array, turned_back


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

    Returns:
        The keys, shapes and units of this module's docstring.
    """
    n, m = len(active), len(pedestrian_position)
    rows = np.flatnonzero(active)
    result: dict[str, NDArray[Any]] = {
        "active": active.copy(),
        "person": np.where(active, person, -1),
        "position": np.zeros((n, 2)),
        "heading": np.zeros(n),
        "twist": np.zeros((n, 2)),
        "goal": np.zeros((n, 2)),
        "pedestrian_position": np.zeros((n, m, 2)),
        "pedestrian_velocity": np.zeros((n, m, 2)),
        "pedestrian_mask": np.zeros((n, m), dtype=bool),
        "agent_position": np.zeros((n, n, 2)),
        "agent_velocity": np.zeros((n, n, 2)),
        "agent_mask": np.zeros((n, n), dtype=bool),
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
    people = (rows[:, None], pedestrian_slots)
    result["pedestrian_mask"][people] = True
    result["pedestrian_position"][people] = turned_back(pedestrian_position[pedestrian_slots] - here[:, None], c, s)
    result["pedestrian_velocity"][people] = turned_back(pedestrian_velocity[pedestrian_slots], c, s)
    others = (rows[:, None], rows)
    seen = ~np.eye(len(rows), dtype=bool)
    result["agent_mask"][others] = seen
    result["agent_position"][others] = turned_back(here - here[:, None], c, s) * seen[..., None]
    result["agent_velocity"][others] = turned_back(moving, c, s) * seen[..., None]
    return result
