"""navground: ORCA on differential drives, kinematic, in C++."""

from crowd import RADIUS, SPEED, Agent, Simulation, report
from navground import core, sim

TIMESTEP = 0.1
"""[s]"""
SIGHT = 5.0
"""[m]"""


def build(agents: list[Agent]) -> Simulation:
    """See `crowd.report`."""
    world = sim.World()
    for agent in agents:
        kinematics = core.kinematics.TwoWheelsDifferentialDriveKinematics(SPEED, 0.24)
        behavior = core.Behavior.make_type("ORCA")
        behavior.optimal_speed = SPEED
        behavior.horizon = SIGHT
        task = sim.tasks.WaypointsTask([agent.goal], loop=False, tolerance=0.5)
        body = sim.Agent(RADIUS, behavior, kinematics, task, [sim.state_estimations.BoundedStateEstimation(SIGHT)])
        body.pose = core.Pose2(agent.start)
        world.add_agent(body)
    return Simulation(step=lambda: world.update(TIMESTEP), timestep=TIMESTEP)


if __name__ == "__main__":
    report("navground", build)
