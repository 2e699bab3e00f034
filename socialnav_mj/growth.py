"""What an agent-step costs in crowds of any size: measured in one run, as ratios to the smallest."""

import resource
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from time import process_time

import numpy as np

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Controller, Limits, make_controller
from socialnav_mj.controllers.base import Observation
from socialnav_mj.environment import build_environment
from socialnav_mj.geometry import Array
from socialnav_mj.recordings import Recording
from socialnav_mj.rollout import rollout

DENSITY = 0.25
"""Robots in a square metre at the start, and as long as they go the same way."""


@dataclass(frozen=True, kw_only=True)
class Growth:
    """CPU times of a crowd of one size."""

    n_agents: int
    """All under way from the first step."""
    agent_steps: int
    """Control steps that they made in sum."""
    build_cpu: float
    """From the recording to the environment [s]."""
    cost: float
    """Of an agent-step, from reset to the finished `Episode` [s]."""
    physics_cost: float
    """The part of it in physics steps, touches included [s]."""
    act_cost: float
    """The part of it in the controller [s]."""
    ratio: float
    """Cost / cost in the smallest crowd."""
    peak_megabytes: float
    """Most memory that the process had until then, imports included; sizes are run from the smallest up."""


class _Watched:
    """A controller whose time is taken."""

    def __init__(self, controller: Controller) -> None:
        self.name, self.cpu, self._controller = controller.name, 0.0, controller
        self.sees_nearest = getattr(controller, "sees_nearest", None)

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        self._controller.reset(limits, seed=seed)

    def act(self, observation: Observation) -> Array:
        begin = process_time()
        action = self._controller.act(observation)
        self.cpu += process_time() - begin
        return action


def measure_growth(
    sizes: Sequence[int], *, controller: str = "potential_field", simulated_time: float = 20.0
) -> list[Growth]:
    """Run a made-up crowd of each size once, in one process, the smallest first.

    Args:
        sizes: Numbers of robots, >= 1.
        controller: As `make_controller` takes it.
        simulated_time: Length of an episode [s].

    Returns:
        A row a size, ascending.

    Raises:
        ValueError: If there is no size or one is below 1.
    """
    if not sizes or min(sizes) < 1:
        raise ValueError(f"sizes = {tuple(sizes)} is not allowed; allowed: one or more numbers >= 1")
    _run(1, controller, 1.0, None)  # compiles and loads what the controller needs
    rows: list[Growth] = []
    for size in sorted(set(sizes)):
        rows.append(_run(size, controller, simulated_time, rows[0].cost if rows else None))
    return rows


def _run(size: int, controller: str, simulated_time: float, least: float | None) -> Growth:
    begin = process_time()
    environment = build_environment(walking_crowd(size), Scenario(share=1.0), time_limit=simulated_time)
    build_cpu = process_time() - begin
    physics, in_physics = environment.physics, [0.0]
    step = physics.step

    def watched_step(nstep: int = 1) -> None:
        start = process_time()
        step(nstep)
        in_physics[0] += process_time() - start

    physics.step = watched_step
    watched = _Watched(make_controller(controller))
    begin = process_time()
    episode = rollout(environment, watched)
    cpu, steps = process_time() - begin, int(episode.agent_active.sum())
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return Growth(
        n_agents=size,
        agent_steps=steps,
        build_cpu=build_cpu,
        cost=cpu / steps,
        physics_cost=in_physics[0] / steps,
        act_cost=watched.cpu / steps,
        ratio=1.0 if least is None else cpu / steps / least,
        peak_megabytes=kilobytes / 1e3,
    )


def walking_crowd(size: int) -> Recording:
    """People on a square who walk 30 m at 1 m/s, all the same way within 45 degrees.

    Who goes the same way stays as dense, whatever the size of the crowd; and nobody arrives in the first 20 s.

    Args:
        size: Number of people, >= 1.

    Returns:
        A recording of 30 s.
    """
    random = np.random.default_rng(0)
    place = np.stack(np.divmod(np.arange(size), ceil(size**0.5)), axis=1) + random.uniform(-0.2, 0.2, (size, 2))
    angle = random.uniform(-np.pi / 4.0, np.pi / 4.0, size)
    way, times = np.stack([np.cos(angle), np.sin(angle)], axis=1), np.array([0.0, 15.0, 30.0])
    return Recording(
        name="walking",
        variant="text",
        frame_rate=25.0,
        ids=np.arange(1, size + 1),
        times=(times,) * size,
        positions=tuple(DENSITY**-0.5 * here + times[:, None] * there for here, there in zip(place, way, strict=True)),
        checksum="0" * 64,
    )
