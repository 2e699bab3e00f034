"""What is drawn into the scene besides bodies: goals, trails and touches."""

import mujoco
import numpy as np

from socialnav_mj.episode import Episode
from socialnav_mj.film.stage import Colour, Poses
from socialnav_mj.geometry import Array

TRAIL = 3.0
"""How far back trails reach [s]."""
TOUCH = 1.0
"""How long a touch is shown after it began [s]."""
OTHERS: tuple[Colour, ...] = (
    (0.95, 0.45, 0.05),
    (0.55, 0.15, 0.70),
    (0.05, 0.55, 0.40),
    (0.80, 0.65, 0.05),
    (0.10, 0.40, 0.75),
)
"""Of an agent's goal and trail, by its index."""
FOLLOWED: Colour = (0.85, 0.05, 0.45)
TOUCHED: Colour = (0.90, 0.10, 0.05)
_CYLINDER, _SPHERE = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_SPHERE


def draw_marks(scene: mujoco.MjvScene, episode: Episode, time: float, poses: Poses, followed: int | None) -> None:
    """Add goals, trails and touches to what is drawn.

    Args:
        scene: Of a renderer that has just been given the bodies.
        episode: The record.
        time: [s].
        poses: Of that time.
        followed: Index of the agent that the camera follows; it has a colour of its own. None for none.
    """
    radius = float(episode.metadata["scenario"]["goal_radius"])
    recent = np.flatnonzero((episode.time <= time) & (episode.time >= time - TRAIL))
    for agent in np.flatnonzero(np.isfinite(poses.agent_heading)):
        colour = FOLLOWED if agent == followed else OTHERS[agent % len(OTHERS)]
        strength = 0.5 if agent == followed else 0.25
        _add(scene, _CYLINDER, [radius, 0.004, 0.0], episode.agent_goal[agent], 0.004, (*colour, strength))
        _add(scene, _CYLINDER, [0.08, 0.006, 0.0], episode.agent_goal[agent], 0.006, (*colour, 1.0))
        _add(scene, _CYLINDER, [0.25, 0.004, 0.0], poses.agent[agent], 0.005, (*colour, strength))
        for place in episode.agent_position[recent, agent]:
            if np.isfinite(place[0]):
                _add(scene, _SPHERE, [0.035, 0.0, 0.0], place, 0.01, (*colour, 1.0))
    for row in np.flatnonzero((episode.contact_time <= time) & (episode.contact_time >= time - TOUCH)):
        fading = 1.0 - (time - episode.contact_time[row]) / TOUCH
        size = 0.08 + 0.12 * min(1.0, max(0.0, float(episode.contact_closing_speed[row])))
        _add(scene, _SPHERE, [size, 0.0, 0.0], episode.contact_position[row], 0.35, (*TOUCHED, 0.3 + 0.6 * fading))


def _add(
    scene: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    size: list[float],
    place: Array,
    height: float,
    colour: tuple[float, float, float, float],
) -> None:
    if scene.ngeom >= scene.maxgeom:
        return  # a picture without some dots is better than none
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom, kind, np.array(size), np.array([*place, height]), np.eye(3).ravel(), np.array(colour, dtype=np.float32)
    )
    scene.ngeom += 1
