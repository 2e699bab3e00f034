"""From keyword arguments to a scenario, and from a scenario to a dm_control environment."""

from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from dm_control.rl import control
from dm_env import specs

from socialnav_mj.config import OnCollision, Robot, Scenario, TurnLimit
from socialnav_mj.physics import Physics
from socialnav_mj.recordings import Recording, load_recording
from socialnav_mj.scene import build_model
from socialnav_mj.task import CrowdTask


def make_scenario(
    *,
    share: float,
    seed: int = Scenario.seed,
    robot_radius: float = Robot.radius,
    pedestrian_radius: float = Scenario.pedestrian_radius,
    turn_limit: TurnLimit = Scenario.turn_limit,
    on_collision: OnCollision = Scenario.on_collision,
    control_timestep: float = Scenario.control_timestep,
) -> Scenario:
    """The resolved scenario of the keyword arguments that `make_environment` shares with it.

    Args:
        share: See `make_environment`, like all others.
        seed: Of the draw.
        robot_radius: [m].
        pedestrian_radius: [m].
        turn_limit: "per_step" or "per_second".
        on_collision: "continue" or "retire".
        control_timestep: [s].

    Returns:
        The scenario.

    Raises:
        ValueError: If a value is not allowed.
    """
    return Scenario(
        share=share,
        seed=seed,
        robot=Robot(radius=robot_radius),
        pedestrian_radius=pedestrian_radius,
        turn_limit=turn_limit,
        on_collision=on_collision,
        control_timestep=control_timestep,
    )


class Environment(control.Environment):
    """A dm_control environment with one reward a slot; dm_control's own specifies a single number."""

    def reward_spec(self) -> specs.Array:
        """One reward a slot.

        Returns:
            Shape (n_slots,).
        """
        return self.task.reward_spec(self.physics)


def make_environment(
    *,
    share: float,
    dataset: str | Path | Recording = "plaza",
    variant: str | None = None,
    data_dir: str | Path | None = None,
    seed: int | None = None,
    robot_radius: float = Robot.radius,
    pedestrian_radius: float = Scenario.pedestrian_radius,
    turn_limit: TurnLimit = Scenario.turn_limit,
    on_collision: OnCollision = Scenario.on_collision,
    control_timestep: float = Scenario.control_timestep,
    time_limit: float = float("inf"),
    random: int | np.random.RandomState | None = None,
    environment_kwargs: dict[str, Any] | None = None,
) -> Environment:
    """A scenario as a dm_control environment.

    Args:
        share: Share of the people who are replaced by agents, in (0, 1].
        dataset: Name in the catalogue, path of a recording, or a recording.
        variant: Which annotation of the recording; None is the default one.
        data_dir: Where recordings are looked for first; None means SOCIALNAV_MJ_DATA, then the user cache.
        seed: Of the draw. Scenarios of one seed are nested.
        robot_radius: [m].
        pedestrian_radius: [m].
        turn_limit: "per_step" (pi/6 a control step) or "per_second" (pi/6 rad/s).
        on_collision: "continue" or "retire".
        control_timestep: A whole multiple of the physics step of 0.01 s [s].
        time_limit: The episode is cut after this time; by default it ends when the last agent's run has [s].
        random: As in dm_control. An integer is another name for `seed`, None for 0.
        environment_kwargs: Passed to `dm_control.rl.control.Environment`.

    Returns:
        An environment whose task is a `CrowdTask` and whose physics is a `Physics`.

    Raises:
        ValueError: If a value is not allowed, or seed and an integer random are both given.
        FileNotFoundError: If the recording is not there.
    """
    if isinstance(random, Integral) and seed is not None:
        raise ValueError(f"seed = {seed} and random = {random} are both given; they name the same thing, give one")
    if not (isinstance(time_limit, Real) and time_limit > 0.0):
        raise ValueError(f"time_limit = {time_limit!r} is not allowed; allowed: numbers > 0")
    scenario = make_scenario(
        share=share,
        seed=random if isinstance(random, Integral) else 0 if seed is None else seed,
        robot_radius=robot_radius,
        pedestrian_radius=pedestrian_radius,
        turn_limit=turn_limit,
        on_collision=on_collision,
        control_timestep=control_timestep,
    )
    recording = (
        dataset if isinstance(dataset, Recording) else load_recording(dataset, variant=variant, data_dir=data_dir)
    )
    return build_environment(
        recording, scenario, time_limit=time_limit, random=random, environment_kwargs=environment_kwargs
    )


def build_environment(
    recording: Recording,
    scenario: Scenario,
    *,
    time_limit: float = float("inf"),
    random: int | np.random.RandomState | None = None,
    environment_kwargs: dict[str, Any] | None = None,
) -> Environment:
    """A resolved scenario as a dm_control environment.

    Args:
        recording: The crowd.
        scenario: The resolved scenario.
        time_limit: The episode is cut after this time [s].
        random: As in dm_control.
        environment_kwargs: Passed to `dm_control.rl.control.Environment`.

    Returns:
        An environment whose task is a `CrowdTask` and whose physics is a `Physics`.
    """
    task = CrowdTask(recording, scenario, random=random)
    everywhere = np.concatenate(recording.positions)
    model = build_model(
        scenario,
        n_agent_slots=task.cast.n_agent_slots,
        n_pedestrian_slots=task.cast.n_pedestrian_slots,
        low=everywhere.min(axis=0),
        high=everywhere.max(axis=0),
    )
    return Environment(
        Physics.from_mujoco(model),
        task,
        control_timestep=scenario.control_timestep,
        time_limit=time_limit,
        **(environment_kwargs or {}),
    )
