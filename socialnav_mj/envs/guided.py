"""A crowd with a guide at hand, as stable-baselines3's environments see it, without a need for that library."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Robot, Scenario, TurnLimit
from socialnav_mj.controllers import make_controller
from socialnav_mj.envs.crowd import UNDER_WAY, Crowd, CrowdStep
from socialnav_mj.envs.spaces import row_of
from socialnav_mj.episode import Outcome
from socialnav_mj.features import FeatureSet
from socialnav_mj.features.seen import Flat, Values
from socialnav_mj.geometry import Array, twist_of_wheel_speed
from socialnav_mj.recordings import Recording


@dataclass(frozen=True, kw_only=True)
class CrowdSettings:
    """What scenes are drawn from, and who drives in them; the draws are the seed's."""

    recordings: Sequence[Recording]
    """Take turns."""
    features: FeatureSet
    """What an agent sees."""
    shares: Sequence[float]
    """Shares of replaced people; take turns."""
    n_slots: int
    """Agents at once, at most; draws that need more are passed over."""
    robot_radius: float = Robot.radius
    """[m]."""
    pedestrian_radius: float = Scenario.pedestrian_radius
    """[m]."""
    turn_limit: TurnLimit = "per_step"
    """Of the agents."""
    guide: str = "go_straight"
    """Controller that `guide_action` asks."""


class GuidedCrowd(Crowd):
    """A crowd that a controller can be asked about; a guide may have a memory, so what it was asked is kept."""

    render_mode: None = None
    """Nothing is drawn."""

    def __init__(self, settings: CrowdSettings, *, seed: int) -> None:
        """Build the first scene.

        Args:
            settings: Of all scenes.
            seed: Seed from which the seeds of all draws are taken.

        Raises:
            ValueError: If no draw has so few agents at once, or there is no such guide.
        """
        self._guide = make_controller(settings.guide)
        scenario = Scenario(
            robot=Robot(radius=settings.robot_radius),
            pedestrian_radius=settings.pedestrian_radius,
            turn_limit=settings.turn_limit,
            on_collision="retire",
        )
        super().__init__(
            settings.recordings,
            Flat(settings.features),
            scenario,
            shares=settings.shares,
            n_slots=settings.n_slots,
            seed=seed,
        )

    def next_scene(self) -> None:
        """Draw a scene; `begin` begins it."""
        super().next_scene()
        self._guide.reset(self.limits, seed=self.environment.task.scenario.seed)
        self._asked: list[bool] = []
        self._is_asked = False

    def begin(self) -> dict[str, Values]:
        """Begin the scene.

        Returns:
            What the agents see, (n_slots, ...).
        """
        self._asked = []
        return super().begin()

    def step(self, actions: Array) -> CrowdStep:
        """Step the scene; when its last run has ended, begin the next one.

        Args:
            actions: In [-1, 1], shape (n_slots, 2).

        Returns:
            What it did.
        """
        self._asked.append(self._is_asked)
        self._is_asked = False
        return super().step(actions)

    def guide_action(self) -> Array:
        """What the guide would do now.

        Returns:
            (speed, turn) in [-1, 1], shape (n_slots, 2); of no meaning in empty slots.
        """
        self._is_asked = True
        limits, task = self.limits, self.environment.task
        wheel_speed = self._guide.act(task.get_observation(self.environment.physics))
        twist = twist_of_wheel_speed(wheel_speed, wheel_radius=limits.wheel_radius, track=limits.track)
        action = np.zeros((self.n_slots, 2))
        action[: len(twist)] = limits.action_of_twist(twist)
        return action

    def state(self) -> dict[str, Any]:
        """All that brings this moment back: what the scene was drawn from, and what was done in it.

        Returns:
            Plain values and arrays for `bring_back`.
        """
        return {**super().state(), "asked": np.array(self._asked, dtype=bool)}

    def bring_back(self, state: Mapping[str, Any]) -> dict[str, Values]:
        """Draw a scene again and do in it what was done; simulations are repeatable to the bit.

        Args:
            state: As `state` returns it, of a crowd that was made alike.

        Returns:
            What the agents see then, (n_slots, ...).
        """
        self.restore(state)
        seen = self.begin()
        for action, asked in zip(np.asarray(state["actions"]), np.asarray(state["asked"]), strict=True):
            if asked:
                self.guide_action()  # a guide may have a memory
            seen = self.step(action).seen
        return seen

    def last_states(self, step: CrowdStep) -> Values:
        """The states in which runs ended: absorbing at the goal, collided or overturned.

        Args:
            step: What `step` returned.

        Returns:
            Shape (n_slots, state size); 0 where no run ended.
        """
        result = np.zeros_like(step.final[""])
        for slot in np.flatnonzero(step.outcome != UNDER_WAY):
            result[slot] = self.observer.ended(row_of(step.final, slot), int(step.outcome[slot]))[""]
        return result


def infos_of(active: NDArray[np.bool_], outcome: NDArray[np.int64], last_states: Values) -> list[dict[str, Any]]:
    """What stable-baselines3 is told of every slot beside state, reward and done.

    Args:
        active: The slot held an agent, whose action counted, shape (n,).
        outcome: How a run ended, else `UNDER_WAY`, shape (n,).
        last_states: The states in which runs ended, shape (n, state size).

    Returns:
        A dictionary a slot: active; and if its run ended, terminal_observation, TimeLimit.truncated and outcome.
    """
    infos: list[dict[str, Any]] = [{"active": held} for held in active.tolist()]
    for slot in np.flatnonzero(outcome != UNDER_WAY):
        how = int(outcome[slot])
        infos[slot]["terminal_observation"] = last_states[slot].copy()
        infos[slot]["TimeLimit.truncated"] = how == Outcome.TIMED_OUT
        infos[slot]["outcome"] = how
    return infos
