"""The scene of an episode, posed as the record says at any time; nothing is simulated."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.episode import Episode, IntArray
from socialnav_mj.geometry import Array
from socialnav_mj.scene import build_model, pedestrian_name
from socialnav_mj.scene_index import index_scene
from socialnav_mj.slots import share_slots

Colour = tuple[float, float, float]

TOPS: tuple[Colour, ...] = (
    (0.35, 0.50, 0.68),
    (0.72, 0.30, 0.27),
    (0.36, 0.55, 0.38),
    (0.86, 0.78, 0.62),
    (0.25, 0.27, 0.33),
    (0.62, 0.48, 0.66),
    (0.87, 0.62, 0.30),
)
TROUSERS: tuple[Colour, ...] = ((0.20, 0.23, 0.32), (0.32, 0.27, 0.22), (0.45, 0.47, 0.50), (0.14, 0.15, 0.17))
SKINS: tuple[Colour, ...] = ((0.87, 0.70, 0.57), (0.62, 0.44, 0.32), (0.94, 0.78, 0.68))
HAIRS: tuple[Colour, ...] = (
    (0.23, 0.16, 0.11),
    (0.08, 0.07, 0.07),
    (0.55, 0.42, 0.25),
    (0.62, 0.62, 0.62),
    (0.40, 0.20, 0.10),
)
"""What people wear, by their number in the recording; the lengths share no factor, so that few look alike."""
_WORN = {"geom": ("torso", "head", "left_leg", "right_leg"), "site": ("shoulders", "left_arm", "right_arm", "hair")}
_AWAY = -50.0
"""Height of what is not in the scene, under the floor [m]."""


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Where everybody is at one time; NaN for who is not there."""

    agent: Array
    """(n, 2) [m]."""
    agent_heading: Array
    """(n,) [rad]."""
    pedestrian: Array
    """(m, 2) [m]."""
    pedestrian_heading: Array
    """(m,) [rad]."""


def poses_at(episode: Episode, time: float) -> Poses:
    """Poses between two samples, on the straight line between them.

    Args:
        episode: The record.
        time: [s]; before the first sample it is the first, after the last the last.

    Returns:
        Who is at one of the two samples alone is where that sample says.
    """
    place = float(np.clip(np.interp(time, episode.time, np.arange(len(episode.time))), 0, len(episode.time) - 1))
    before, part = int(place), place - int(place)
    after = min(before + 1, len(episode.time) - 1)

    def between(values: Array) -> Array:
        one, two = values[before], values[after]
        return np.where(np.isnan(one), two, np.where(np.isnan(two), one, one + part * (two - one)))

    def turned(values: Array) -> Array:
        one = values[before]
        two = one + np.mod(values[after] - one + np.pi, 2.0 * np.pi) - np.pi  # the short way round
        return np.where(np.isnan(one), values[after], np.where(np.isnan(two), one, one + part * (two - one)))

    return Poses(
        agent=between(episode.agent_position),
        agent_heading=turned(episode.agent_heading),
        pedestrian=between(episode.pedestrian_position),
        pedestrian_heading=turned(episode.pedestrian_heading),
    )


class Stage:
    """MuJoCo's model of an episode's scene, with as many bodies as are there at once."""

    def __init__(self, episode: Episode) -> None:
        """Compile the scene.

        Args:
            episode: Its configuration and record.
        """
        scenario = replace(Scenario.from_dict(episode.metadata["scenario"]), pedestrian_body="rigid")
        self._agent_slot, n_agents = _slots(np.isfinite(episode.agent_heading))
        self._pedestrian_slot, n_people = _slots(np.isfinite(episode.pedestrian_heading))
        places = np.concatenate([episode.agent_start, episode.agent_goal, _finite(episode.pedestrian_position)])
        low, high = (places.min(axis=0), places.max(axis=0)) if len(places) else (np.zeros(2), np.ones(2))
        self.model = build_model(scenario, n_agent_slots=n_agents, n_pedestrian_slots=n_people, low=low, high=high)
        self.model.vis.quality.offsamples = 4  # the simulation's own pictures do without, for speed
        self.data = mujoco.MjData(self.model)
        self._qpos = index_scene(self.model).qpos
        self._person = episode.pedestrian_person

    def pose(self, poses: Poses) -> None:
        """Put everybody in place, and dress the people.

        Args:
            poses: Of the same episode.
        """
        self.data.qpos[self._qpos + 2] = _AWAY
        self.data.mocap_pos[:, 2] = _AWAY
        for agent in np.flatnonzero(np.isfinite(poses.agent_heading)):
            address = self._qpos[self._agent_slot[agent]]
            self.data.qpos[address : address + 2] = poses.agent[agent]
            self.data.qpos[address + 2 : address + 7] = [0.0, *_upright(poses.agent_heading[agent])]
        for person in np.flatnonzero(np.isfinite(poses.pedestrian_heading)):
            slot = self._pedestrian_slot[person]
            self.data.mocap_pos[slot] = [*poses.pedestrian[person], 0.0]
            self.data.mocap_quat[slot] = _upright(poses.pedestrian_heading[person])
            self._dress(pedestrian_name(slot), int(self._person[person]))
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def _dress(self, prefix: str, person: int) -> None:
        top, trousers = TOPS[person % len(TOPS)], TROUSERS[person % len(TROUSERS)]
        skin, hair = SKINS[person % len(SKINS)], HAIRS[person % len(HAIRS)]
        colours = {"head": skin, "left_leg": trousers, "right_leg": trousers, "hair": hair}
        for kind, names in _WORN.items():
            for name in names:
                getattr(self.model, kind)(prefix + name).rgba[:3] = colours.get(name, top)


def _upright(heading: float) -> list[float]:
    return [float(np.cos(0.5 * heading)), 0.0, 0.0, float(np.sin(0.5 * heading))]


def _finite(positions: Array) -> Array:
    return positions[np.isfinite(positions[..., 0])]


def _slots(present: NDArray[np.bool_]) -> tuple[IntArray, int]:
    """Slot of everybody, shape (n,), and the number of slots, at least 1; present has shape (t, n)."""
    if not present.any():
        return np.zeros(present.shape[1], dtype=np.int64), 1
    there = present.any(axis=0)
    begin = np.argmax(present, axis=0)
    end = len(present) - 1 - np.argmax(present[::-1], axis=0)
    slot = np.zeros(present.shape[1], dtype=np.int64)
    # A pose between two samples is there until the sample after the last, so that intervals must not touch.
    slot[there] = share_slots(begin[there], end[there] + 1)
    return slot, int(slot.max()) + 1
