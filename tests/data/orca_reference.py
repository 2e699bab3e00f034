"""Makes orca_reference.json with pyrvo 0.4.3 (python orca_reference.py, in this folder)."""

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pyrvo

RADIUS, HORIZON, TIME_STEP, MAX_SPEED = 0.17, 3.0, 0.2, 1.0
random = np.random.default_rng(0)
cases = []
for number in range(40):
    n, side = int(random.integers(2, 9)), (3.0, 1.2, 0.6)[number % 3]
    position, velocity = random.uniform(-side, side, (n, 2)), random.uniform(-0.7, 0.7, (n, 2))
    wanted = random.uniform(-1.0, 1.0, (n, 2))
    simulator = pyrvo.RVOSimulator(TIME_STEP, 50.0, 20, HORIZON, HORIZON, RADIUS, MAX_SPEED)
    for k in range(n):
        simulator.add_agent(tuple(position[k]))
        simulator.set_agent_velocity(k, tuple(velocity[k]))
        simulator.set_agent_pref_velocity(k, tuple(wanted[k]))
    simulator.do_step()
    found = simulator.get_agent_velocity(0)
    result = [found.x, found.y] if hasattr(found, "x") else [float(found[0]), float(found[1])]
    cases.append(
        {"position": position.tolist(), "velocity": velocity.tolist(), "wanted": wanted[0].tolist(), "result": result}
    )
content = {
    "pyrvo": version("pyrvo"),
    "radius": RADIUS,
    "horizon": HORIZON,
    "time_step": TIME_STEP,
    "max_speed": MAX_SPEED,
}
Path(__file__).with_suffix(".json").write_text(json.dumps({**content, "cases": cases}))
