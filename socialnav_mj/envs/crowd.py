"""Agents of one scene after another, each in a slot: what all environments of many agents are made of."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.cast import NOBODY, cast_recording
from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Limits
from socialnav_mj.controllers.base import ActionKind
from socialnav_mj.environment import Environment, build_environment
from socialnav_mj.features.seen import Observer, Values
from socialnav_mj.geometry import Array
from socialnav_mj.recordings import Recording

_MOST_DRAWS = 1000
UNDER_WAY = -1
"""Stands in the place of an outcome while there is none."""


@dataclass(frozen=True, kw_only=True)
class CrowdStep:
    """What a control step did to every slot."""

    active: NDArray[np.bool_]
    """(n_slots,) the slot held an agent, whose action counted."""
    reward: NDArray[np.float32]
    """(n_slots,) the task's own; 0 where nobody was."""
    outcome: NDArray[np.int64]
    """(n_slots,) how a run ended in this step (`socialnav_mj.episode.Outcome`), else `UNDER_WAY`."""
    final: dict[str, Values]
    """Observations with the agents whose run ended still in them, (n_slots, ...)."""
    seen: dict[str, Values]
    """Observations to act on next, (n_slots, ...); 0 where nobody is."""
    under_way: NDArray[np.bool_]
    """(n_slots,) the slot holds an agent now, whom `seen` is of."""


class Crowd:
    """Scenes that follow one another; draws that need more slots than there are are passed over."""

    def __init__(
        self,
        recordings: Sequence[Recording],
        observer: Observer,
        scenario: Scenario,
        *,
        shares: Sequence[float],
        n_slots: int,
        action: ActionKind = "twist",
        seed: int,
    ) -> None:
        """Build the first scene.

        Args:
            recordings: Take turns.
            observer: What an agent sees.
            scenario: Decides all but share and draw.
            shares: Shares of replaced people; take turns.
            n_slots: Agents at once, at most.
            action: What an action means.
            seed: Seed from which the seeds of all draws are taken.

        Raises:
            ValueError: If no draw has so few agents at once.
        """
        self.recordings, self.shares, self.observer = tuple(recordings), tuple(shares), observer
        self.n_slots, self.action = n_slots, action
        self._scenario = scenario
        self.seed(seed)

    def seed(self, seed: int) -> None:
        """Begin again with the first scene of a seed.

        Args:
            seed: Seed from which the seeds of all draws are taken.
        """
        self._random = np.random.default_rng(seed)
        self._scenes = 0
        self.next_scene()

    def next_scene(self) -> None:
        """Draw a scene; `begin` begins it."""
        self._drawn_from = {"random": json.dumps(self._random.bit_generator.state), "scenes": self._scenes}
        recording = self.recordings[self._scenes % len(self.recordings)]
        share = self.shares[self._scenes // len(self.recordings) % len(self.shares)]
        self._scenes += 1
        for _ in range(_MOST_DRAWS):
            seed = int(self._random.integers(2**31))
            scenario = replace(self._scenario, share=share, seed=seed)
            if cast_recording(recording, scenario).n_agent_slots <= self.n_slots:
                break
        else:
            raise ValueError(
                f"no draw of recording {recording.name!r} at share {share} has at most n_slots = {self.n_slots} "
                "agents at once; allow more slots or a smaller share"
            )
        self.limits = Limits.of(scenario)
        self.environment: Environment = build_environment(recording, scenario, robots="likely")

    def begin(self) -> dict[str, Values]:
        """Begin the scene.

        Returns:
            What the agents see, (n_slots, ...).
        """
        self._past: list[Array] = []
        self.environment.reset()
        return self._look()[1]

    def step(self, actions: Array) -> CrowdStep:
        """Step the scene; when its last run has ended, begin the next one.

        Args:
            actions: In [-1, 1], shape (n_slots, 2).

        Returns:
            What it did.
        """
        task = self.environment.task
        count = task.cast.n_agent_slots
        before = task.slot_agent
        self._past.append(np.array(actions, dtype=float))
        time_step = self.environment.step(self.limits.wheel_speed_of_action(self._past[-1][:count], self.action))
        final, seen = self._look()
        reward = np.zeros(self.n_slots, dtype=np.float32)
        reward[:count] = time_step.reward
        active = np.zeros(self.n_slots, dtype=bool)
        active[:count] = before != NOBODY
        outcome = np.full(self.n_slots, UNDER_WAY)
        outcome[active] = task.outcome[before[active[:count]]]
        if time_step.last():
            self.next_scene()
            seen = self.begin()
        return CrowdStep(
            active=active, reward=reward, outcome=outcome, final=final, seen=seen, under_way=self.under_way()
        )

    def under_way(self) -> NDArray[np.bool_]:
        """Which slots hold an agent.

        Returns:
            Shape (n_slots,).
        """
        result = np.zeros(self.n_slots, dtype=bool)
        task = self.environment.task
        result[: task.cast.n_agent_slots] = task.slot_agent != NOBODY
        return result

    def _look(self) -> tuple[dict[str, Values], dict[str, Values]]:
        """What agents see whose run may just have ended, and what those under way see."""
        task = self.environment.task
        rows = np.flatnonzero(task.sample.agent != NOBODY)
        own = self.observer(task.final_observation(), rows)
        final = {key: np.zeros((self.n_slots, values.shape[1]), dtype=np.float32) for key, values in own.items()}
        for key, values in own.items():
            final[key][rows] = values
        there = self.under_way()[:, None]
        return final, {key: np.where(there, values, np.float32(0.0)) for key, values in final.items()}

    def state(self) -> dict[str, Any]:
        """All that brings this moment back: what the scene was drawn from, and what was done in it.

        Returns:
            Plain values and an array for `restore`.
        """
        return {**self._drawn_from, "actions": np.array(self._past).reshape(len(self._past), self.n_slots, 2)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Draw a scene again; simulations are repeatable to the bit, so doing in it what was done brings all back.

        Args:
            state: As `state` returns it, of a crowd that was made alike.
        """
        self._random.bit_generator.state = json.loads(state["random"])
        self._scenes = int(state["scenes"])
        self.next_scene()
