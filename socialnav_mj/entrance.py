"""Who may come in: agents wait until their place is free, people who appear on a robot pass through it."""

import numpy as np

from socialnav_mj.cast import Cast, SlotCrowd
from socialnav_mj.config import Scenario
from socialnav_mj.episode import IntArray
from socialnav_mj.geometry import Array


class AgentQueue:
    """Agents whose person has appeared, in that order, until they are let in."""

    def __init__(self, cast: Cast) -> None:
        """Nobody waits yet.

        Args:
            cast: Says when each agent's person appears.
        """
        self._appear_step = cast.agent_appear_step
        self._order = np.argsort(self._appear_step, kind="stable").tolist()
        self._next = 0
        self._waiting: list[int] = []

    def waiting(self, step: int) -> list[int]:
        """Agents whose person has appeared and who have not been let in.

        Args:
            step: The current control step; must not go back.

        Returns:
            Agent indices, those whose person appeared first in front.
        """
        while self._next < len(self._order) and self._appear_step[self._order[self._next]] <= step:
            self._waiting.append(self._order[self._next])
            self._next += 1
        return list(self._waiting)

    def let_in(self, agent: int) -> None:
        """Take an agent out of the queue.

        Args:
            agent: Index into the cast; one of those that `waiting` returned.
        """
        self._waiting.remove(agent)


class Ghosts:
    """Slots of people who appeared and are not yet known to be clear of all robots: they have no contacts."""

    def __init__(self) -> None:
        """Nobody is a ghost."""
        self._slots: set[int] = set()
        self.overlaps: set[tuple[int, int]] = set()
        """(agent, pedestrian) of every ghost that has passed through an agent so far."""

    def solidify(self, now: SlotCrowd, agents: IntArray, robots: Array, *, distance: float) -> IntArray:
        """Take in who has just appeared, and let go whom no robot overlaps.

        Args:
            now: The people at the current control step.
            agents: Indices of the agents in the scene, shape (k,).
            robots: Positions of their robots, shape (k, 2) [m].
            distance: Centre distance at which a robot and a person touch [m].

        Returns:
            Slots of those who may touch robots from now on, ascending.
        """
        if not (self._slots or now.changed.size):
            return now.changed
        changed = set(now.changed.tolist())
        self._slots = (self._slots - changed) | (changed & set(now.present.tolist()))
        pending = np.array(sorted(self._slots), dtype=np.int64)
        overlap = np.linalg.norm(now.position[pending][:, None] - robots, axis=-1) <= distance
        clear = ~overlap.any(axis=1)
        self._slots = set(pending[~clear].tolist())
        ghost, robot = np.nonzero(overlap)
        self.overlaps |= {*zip(agents[robot].tolist(), now.pedestrian[pending[ghost]].tolist(), strict=True)}
        return pending[clear]


def is_free(place: Array, *, people: Array, robots: Array, scenario: Scenario) -> bool:
    """Whether a robot can be put down with the scenario's clearance to everybody.

    Args:
        place: Shape (2,) [m].
        people: Positions of the people in the scene, shape (j, 2) [m].
        robots: Positions of the robots in the scene, shape (k, 2) [m].
        scenario: Gives radii and clearance.

    Returns:
        True if no body is too near.
    """
    clearance = scenario.spawn_clearance
    return bool(
        (np.linalg.norm(people - place, axis=1) >= scenario.contact_distance + clearance).all()
        and (np.linalg.norm(robots - place, axis=1) >= 2.0 * scenario.robot.radius + clearance).all()
    )
