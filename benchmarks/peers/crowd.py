"""The same crowd for everybody: agents on a jittered grid who all cross its middle. Standard library only."""

import argparse
import json
import math
import random
import time
from collections.abc import Callable
from dataclasses import dataclass

DENSITY = 0.25
"""[1/m^2]"""
RADIUS = 0.17
"""Of an agent [m]."""
SPEED = 1.0
"""That agents want, and the fastest that they can [m/s]."""
WAY = 30.0
"""So long that nobody arrives [m]."""
WARM_UP = 1.0
"""Simulated before the clock runs, so that compilers have done their work [s]."""


@dataclass(frozen=True)
class Agent:
    """Where somebody begins and wants to be [m]."""

    start: tuple[float, float]
    goal: tuple[float, float]


@dataclass(frozen=True)
class Simulation:
    """What is timed."""

    step: Callable[[], object]
    """Takes one step, in which everybody chooses once where to go."""
    timestep: float
    """Time that it simulates [s]."""
    integration_steps: int = 1
    """Steps in which it does so."""


def crowd(count: int, *, seed: int = 0) -> list[Agent]:
    """Agents in a square around the origin.

    Args:
        count: How many.
        seed: Of the jitter and of which places are taken.

    Returns:
        Agents whose starts are at least 0.4 of a grid cell apart; each wants to go `WAY` through the middle.
    """
    draw = random.Random(seed)
    side = math.ceil(math.sqrt(count))
    cell = math.sqrt(count / DENSITY) / side
    places = [(i, j) for i in range(side) for j in range(side)]
    draw.shuffle(places)
    agents = []
    for i, j in places[:count]:
        x, y = ((k + 0.5 - 0.5 * side + draw.uniform(-0.3, 0.3)) * cell for k in (i, j))
        distance = math.hypot(x, y) or 1.0
        agents.append(Agent(start=(x, y), goal=(x - WAY * x / distance, y - WAY * y / distance)))
    return agents


def report(
    name: str,
    build: Callable[[list[Agent]], Simulation],
    parser: argparse.ArgumentParser | None = None,
) -> None:
    """Read the command line, run one simulation, and print what it cost as one line of JSON.

    Args:
        name: Of what is run.
        build: Makes the simulation of a crowd.
        parser: With options of the simulation's own.
    """
    parser = parser or argparse.ArgumentParser(description=f"Time {name}.")
    parser.add_argument("--agents", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True, help="simulated time that is measured")
    options = parser.parse_args()
    simulation = build(crowd(options.agents))
    for _ in range(math.ceil(WARM_UP / simulation.timestep)):
        simulation.step()
    count = round(options.seconds / simulation.timestep)
    begin = time.process_time()
    for _ in range(count):
        simulation.step()
    cpu = time.process_time() - begin
    steps = count * simulation.integration_steps
    result = {"agents": options.agents, "steps": steps, "timestep": options.seconds / steps, "cpu": cpu}
    print(json.dumps(result))
