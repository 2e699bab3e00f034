"""JuPedSim: discs, collision-free speed model, in C++."""

import jupedsim
from crowd import RADIUS, SPEED, WAY, Agent, Simulation, report

TIMESTEP = 0.01
"""Its default [s]."""


def build(agents: list[Agent]) -> Simulation:
    """See `crowd.report`."""
    edge = 3.0 * WAY
    simulation = jupedsim.Simulation(
        model=jupedsim.CollisionFreeSpeedModel(),
        geometry=[(-edge, -edge), (edge, -edge), (edge, edge), (-edge, edge)],
        dt=TIMESTEP,
    )
    for agent in agents:
        stage = simulation.add_waypoint_stage(agent.goal, 0.5)
        journey = simulation.add_journey(jupedsim.JourneyDescription([stage]))
        simulation.add_agent(
            jupedsim.CollisionFreeSpeedModelAgentParameters(
                position=agent.start, journey_id=journey, stage_id=stage, desired_speed=SPEED, radius=RADIUS
            )
        )
    return Simulation(step=simulation.iterate, timestep=TIMESTEP)


if __name__ == "__main__":
    report("JuPedSim", build)
