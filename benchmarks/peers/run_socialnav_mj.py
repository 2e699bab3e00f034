"""socialnav_mj: robots with wheels in contact physics, or on ideal unicycles, each driven by social force."""

import argparse
import sys

import numpy as np
from crowd import SPEED, WAY, Agent, Simulation, report

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import Limits, make_controller
from socialnav_mj.environment import build_environment
from socialnav_mj.recordings import Recording


def build(agents: list[Agent]) -> Simulation:
    """See `crowd.report`: a recording of people who walk straight, all of them replaced."""
    recording = Recording(
        name="straight walkers",
        variant="made up",
        frame_rate=1.0,
        ids=np.arange(len(agents)),
        times=(np.array([0.0, WAY / SPEED]),) * len(agents),
        positions=tuple(np.array([agent.start, agent.goal]) for agent in agents),
        checksum="",
    )
    scenario = Scenario(share=1.0, plant="unicycle" if "unicycle" in sys.argv else "wheels")
    environment = build_environment(recording, scenario)
    controller = make_controller("social_force")
    controller.reset(Limits.of(scenario))
    time_step = environment.reset()

    def step() -> None:
        nonlocal time_step
        time_step = environment.step(controller.act(time_step.observation))
        if not time_step.observation["active"].all():
            raise RuntimeError("somebody has arrived, or was not let in")

    return Simulation(step=step, timestep=scenario.control_timestep, integration_steps=scenario.n_sub_steps)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Time socialnav_mj.")
    parser.add_argument("--plant", choices=["wheels", "unicycle"], default="wheels")
    report("socialnav_mj", build, parser)
