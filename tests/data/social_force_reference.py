"""Makes social_force_reference.json with PySocialForce 1.1.2 (python social_force_reference.py, in this folder)."""

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pysocialforce as psf

random = np.random.default_rng(0)
cases = []
while len(cases) < 20:
    state = np.zeros((5, 6))
    state[:, :2] = random.uniform(-3.0, 3.0, (5, 2))
    state[:, 2:4] = random.uniform(-1.0, 1.0, (5, 2))
    state[:, 4:] = 5.0
    (force,) = (
        f for f in psf.Simulator(state).make_forces(psf.Simulator(state).config) if type(f) is psf.forces.SocialForce
    )
    push = force.get_force()[0] / force.factor
    # It does not wrap the angle between two directions: cases that straddle pi are its own.
    towards = state[1:, :2] - state[0, :2]
    drive = 2.0 * (state[0, 2:4] - state[1:, 2:4]) + towards / np.linalg.norm(towards, axis=1)[:, None]
    angle = np.arctan2(-drive[:, 1], -drive[:, 0]) - np.arctan2(-towards[:, 1], -towards[:, 0])
    if np.abs(angle).max() < np.pi:
        cases.append({"state": state[:, :4].tolist(), "force": push.tolist()})
Path(__file__).with_suffix(".json").write_text(json.dumps({"pysocialforce": version("pysocialforce"), "cases": cases}))
