"""IR-SIM: kinematic differential drives with ORCA, shapes checked for collisions; Python around pyrvo and shapely."""

import math
import tempfile
from pathlib import Path

import irsim
import yaml
from crowd import RADIUS, SPEED, WAY, Agent, Simulation, report

TIMESTEP = 0.1
"""Its default [s]."""


def build(agents: list[Agent]) -> Simulation:
    """See `crowd.report`."""
    size = 4.0 * WAY
    world = {
        "world": {
            "height": size,
            "width": size,
            "offset": [-0.5 * size, -0.5 * size],
            "step_time": TIMESTEP,
            "sample_time": TIMESTEP,
            "collision_mode": "unobstructed",
        },
        "robot": {
            "number": len(agents),
            "kinematics": {"name": "diff"},
            "distribution": {"name": "manual"},
            "state": [[*agent.start, math.atan2(-agent.start[1], -agent.start[0])] for agent in agents],
            "goal": [[*agent.goal, 0.0] for agent in agents],
            "shape": {"name": "circle", "radius": RADIUS},
            "vel_max": [SPEED, 2.618],
            "group_behavior": {"name": "orca", "neighborDist": 6.0, "timeHorizon": 2.0},
        },
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "world.yaml"
        path.write_text(yaml.safe_dump(world), encoding="utf-8")
        environment = irsim.make(str(path), headless=True, log_level="ERROR")
    return Simulation(step=environment.step, timestep=TIMESTEP)


if __name__ == "__main__":
    report("IR-SIM", build)
