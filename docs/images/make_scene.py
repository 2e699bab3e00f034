"""Draws the README's picture: scenario 2 of plaza, with each robot's goal and the last three seconds of its way.

Run `MUJOCO_GL=egl python docs/images/make_scene.py` (or osmesa); it writes scene.png beside itself.
"""

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

import socialnav_mj
from socialnav_mj.controllers import Limits, make_controller

TIME = 40.0  # [s]
TRAIL = 15  # control steps of 0.2 s
SIZE = (1920, 870)  # reduced afterwards, since the arena's MJCF switches multi-sampling off
PUBLISHED_SIZE = (1200, 544)
COLOURS = ([0.95, 0.45, 0.05], [0.85, 0.10, 0.20], [0.55, 0.15, 0.70], [0.05, 0.55, 0.40], [0.80, 0.65, 0.05])
CYLINDER, SPHERE = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_SPHERE


def add(scene: mujoco.MjvScene, kind: mujoco.mjtGeom, size: list[float], place: list[float], rgba: list[float]) -> None:
    """Add a shape to what is drawn; it takes no part in the physics."""
    orientation = np.eye(3).ravel()
    mujoco.mjv_initGeom(scene.geoms[scene.ngeom], kind, np.array(size), np.array(place), orientation, np.float32(rgba))
    scene.ngeom += 1


def main() -> None:
    """Step to TIME, then draw."""
    environment = socialnav_mj.load("scenario_2")
    task, physics = environment.task, environment.physics
    controller = make_controller("hybrid")
    controller.reset(Limits.of(task.scenario))
    time_step, trail = environment.reset(), []
    while task.time < TIME:
        time_step = environment.step(controller.act(time_step.observation))
        trail = [*trail[-TRAIL:], (task.slot_agent.copy(), time_step.observation["position"])]

    everywhere = np.concatenate(task.recording.positions)
    camera = mujoco.MjvCamera()
    camera.lookat = [*(0.5 * (everywhere.min(axis=0) + everywhere.max(axis=0))), 0.2]
    camera.distance, camera.azimuth, camera.elevation = 10.0, 60.0, -32.0
    renderer = mujoco.Renderer(physics.model.ptr, height=SIZE[1], width=SIZE[0], max_geom=10_000)
    renderer.update_scene(physics.data.ptr, camera)
    for slot in np.flatnonzero(time_step.observation["active"]):
        agent = task.slot_agent[slot]
        colour, goal = COLOURS[agent % len(COLOURS)], task.cast.agent_goal[agent]
        add(renderer.scene, CYLINDER, [0.30, 0.004, 0.0], [*goal, 0.004], [*colour, 0.35])
        add(renderer.scene, CYLINDER, [0.08, 0.006, 0.0], [*goal, 0.006], [*colour, 1.0])
        add(renderer.scene, CYLINDER, [0.25, 0.004, 0.0], [*trail[-1][1][slot], 0.004], [*colour, 0.6])
        for agents, positions in trail:
            if agents[slot] == agent:
                add(renderer.scene, SPHERE, [0.035, 0.0, 0.0], [*positions[slot], 0.01], [*colour, 1.0])
    picture = Image.fromarray(renderer.render()).resize(PUBLISHED_SIZE, Image.Resampling.LANCZOS)
    renderer.close()
    picture.save(Path(__file__).with_name("scene.png"), optimize=True)


if __name__ == "__main__":
    main()
