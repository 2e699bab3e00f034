"""pyrvo: discs that take the velocity that ORCA chooses, in C++; preferred velocities are set from Python."""

import math

import pyrvo
from crowd import RADIUS, SPEED, Agent, Simulation, report

TIMESTEP = 0.1
"""[s]"""


def build(agents: list[Agent]) -> Simulation:
    """See `crowd.report`."""
    simulator = pyrvo.RVOSimulator()
    simulator.set_time_step(TIMESTEP)
    for agent in agents:
        # Sight, neighbours, horizon among agents and to obstacles, radius, speed.
        simulator.add_agent(list(agent.start), 6.0, 10, 2.0, 2.0, RADIUS, SPEED)

    def step() -> None:
        for number, agent in enumerate(agents):
            here = simulator.get_agent_position(number)
            x, y = agent.goal[0] - here.x, agent.goal[1] - here.y
            size = SPEED / (math.hypot(x, y) or 1.0)
            simulator.set_agent_pref_velocity(number, [size * x, size * y])
        simulator.do_step()

    return Simulation(step=step, timestep=TIMESTEP)


if __name__ == "__main__":
    report("pyrvo", build)
