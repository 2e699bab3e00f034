"""One agent of a scenario as a Gymnasium environment; the others drive by themselves, or are people."""

from collections.abc import Mapping
from dataclasses import replace
from numbers import Integral
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from socialnav_mj.controllers import Controller, Limits, make_controller
from socialnav_mj.environment import Environment, build_environment
from socialnav_mj.envs.settings import Settings
from socialnav_mj.envs.spaces import Seen, action_space, bare, observation_space, row_of
from socialnav_mj.episode import Outcome
from socialnav_mj.geometry import Array
from socialnav_mj.recordings.draw import replaced_people
from socialnav_mj.recordings.window import excerpt

PEOPLE = "people"
"""In place of a controller: nobody else is replaced."""


class CrowdEnv(gymnasium.Env[Seen, NDArray[np.float32]]):
    """A draw of a scenario, seen and driven by one of its agents, from its appearance to the end of its run.

    The scene begins when the agent's person appears; whoever is there then begins where it is.
    An episode terminates at the goal, at a collision (unless on_collision="continue") or when the robot has fallen,
    and is truncated at the agent's deadline. The reward is the task's: metres of progress, +5 at the goal, -5 for each
    collision.
    """

    # Pictures are the business of `socialnav-mj view` and `render`; 1 / 0.2 s control steps a second.
    metadata: dict[str, Any] = {"render_modes": [], "render_fps": 5}  # noqa: RUF012

    def __init__(
        self, *, scenario: int = 1, others: str = "potential_field", render_mode: None = None, **settings: Any
    ) -> None:
        """Load the recording.

        Args:
            scenario: 1 to 4.
            others: Controller of the other agents of the draw, or "people": everybody else is replayed.
            render_mode: None: there are no pictures.
            **settings: Of `socialnav_mj.envs.settings.Settings.of`.

        Raises:
            ValueError: If something is unknown or not allowed.
            FileNotFoundError: If the recording is not there.
        """
        self.settings = Settings.of(scenario, **settings)
        self.render_mode = render_mode
        self._others: Controller | None = None if others == PEOPLE else make_controller(others)
        self.observation_space = observation_space(self.settings.observer)
        self.action_space = action_space()
        self._environment: Environment | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin the run of an agent of a draw.

        Args:
            seed: From which draws and agents are drawn; None goes on drawing.
            options: "draw": that draw instead of a random one; "person": that agent of it, by its person's id.

        Returns:
            Observation, and info: draw, person, and time since the recording's first frame [s].

        Raises:
            ValueError: If an option is unknown, or the draw does not replace that person.
        """
        super().reset(seed=seed)
        options = options or {}
        if unknown := sorted(set(options) - {"draw", "person"}):
            raise ValueError(f"unknown options {', '.join(unknown)}; available: draw, person")
        for name, value in options.items():
            if not isinstance(value, Integral) or value < 0:
                raise ValueError(f"option {name} = {value!r} is not allowed; allowed: integers >= 0")
        recording = self.settings.recording
        draw = int(options.get("draw", self.np_random.integers(2**31)))
        scenario = replace(self.settings.scenario, seed=draw)
        replaced = replaced_people(
            recording, share=scenario.share, seed=draw, minimum_displacement=scenario.minimum_displacement
        )
        ids = recording.ids[replaced]
        self._person = int(options.get("person", self.np_random.choice(ids)))
        if self._person not in ids:
            raise ValueError(f"draw {draw} does not replace person {self._person}; it replaces {ids.tolist()}")
        index = int(np.searchsorted(recording.ids, self._person))
        step = scenario.control_timestep
        self._begin = float(np.floor(recording.start_time[index] / step + 1e-6) * step)
        distance = float(np.hypot(*(recording.end[index] - recording.start[index])))
        # A moment may pass before the agent's place is free.
        end = self._begin + (scenario.allowed_steps(distance) + 1) * step + scenario.deadline_base
        scene = excerpt(recording, self._begin, end)
        robots = np.isin(scene.ids, self._person if self._others is None else ids)
        environment = build_environment(scene, scenario, replaced=np.flatnonzero(robots), robots="likely")
        self._environment = environment
        self._limits = Limits.of(scenario)
        if self._others is not None:
            self._others.reset(self._limits, seed=draw)
        environment.reset()
        self._agent = int(np.flatnonzero(environment.task.cast.agent_person == self._person)[0])
        while not (slots := np.flatnonzero(environment.task.slot_agent == self._agent)).size:
            environment.step(self._wheel_speed())
        self._slot, self._collisions = int(slots[0]), 0
        observer = self.settings.observer
        seen = observer(environment.task.get_observation(environment.physics), slots)
        return bare(row_of(seen, 0)), {"draw": draw, **self._info()}

    def step(self, action: NDArray[np.float32]) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Drive for a control step.

        Args:
            action: Two numbers in [-1, 1], see `Limits.wheel_speed_of_action`.

        Returns:
            Observation, reward, whether the run ended at goal or collision, whether its deadline passed, and info:
            person, time, its collisions so far, and at the end the outcome.

        Raises:
            gymnasium.error.ResetNeeded: If there is no run under way.
        """
        environment = self._environment
        if environment is None or environment.task.outcome[self._agent] >= 0:
            raise gymnasium.error.ResetNeeded("there is no run under way; call reset first")
        task = environment.task
        wheel_speed = self._wheel_speed()
        own = self._limits.wheel_speed_of_action(np.reshape(action, (1, 2)), self.settings.action)
        wheel_speed[self._slot] = own[0]
        before = len(task.collisions)
        time_step = environment.step(wheel_speed)
        self._collisions += sum(self._slot in collision.agent_slots for collision in task.collisions[before:])
        seen = row_of(self.settings.observer(task.final_observation(), np.array([self._slot])), 0)
        outcome, info = int(task.outcome[self._agent]), self._info()
        if outcome >= 0:
            seen = self.settings.observer.ended(seen, outcome)
            info["outcome"] = Outcome(outcome).name.lower()
        late = outcome == Outcome.TIMED_OUT
        return bare(seen), float(time_step.reward[self._slot]), outcome >= 0 and not late, late, info

    def _wheel_speed(self) -> Array:
        """What the others do, and nothing for oneself."""
        assert self._environment is not None
        task, physics = self._environment.task, self._environment.physics
        if self._others is None:
            return np.zeros((task.cast.n_agent_slots, 2))
        observation: Mapping[str, NDArray[Any]] = task.get_observation(physics)
        return np.array(self._others.act(observation), dtype=float)

    def _info(self) -> dict[str, Any]:
        assert self._environment is not None
        time = self._begin + self._environment.task.time
        return {"person": self._person, "time": time, "collisions": self._collisions}
