"""PySocialForce: the extended social force model, points that move, in numpy and numba."""

import contextlib
import io

import numpy as np
import pysocialforce
from crowd import Agent, Simulation, report

TIMESTEP = 0.1
"""Its own default is 1 s, at which its people overshoot [s]."""


def build(agents: list[Agent]) -> Simulation:
    """See `crowd.report`."""
    state = np.array([[*agent.start, 0.0, 0.0, *agent.goal] for agent in agents])
    with contextlib.redirect_stdout(io.StringIO()):
        simulator = pysocialforce.Simulator(state)
    simulator.peds.step_width = TIMESTEP
    return Simulation(step=simulator.step, timestep=TIMESTEP)


if __name__ == "__main__":
    report("PySocialForce", build)
