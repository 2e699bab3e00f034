"""A pool of robots that grows: a scene with more of them takes over the state of one with fewer."""

from typing import NamedTuple

import mujoco

from socialnav_mj.episode import IntArray
from socialnav_mj.scene_index import SceneIndex

GROWTH = 1.5
"""How many times as many robots there are after the pool was full."""


class World(NamedTuple):
    """A compiled scene and its state."""

    model: mujoco.MjModel
    data: mujoco.MjData
    scene: SceneIndex


def larger_pool(index: SceneIndex, slot: int) -> int:
    """Robots of the next pool.

    Args:
        index: Of the scene with too few.
        slot: That is to have a robot.

    Returns:
        `GROWTH` times as many as now, at least enough for the slot, at most one for each slot.
    """
    return min(max(slot + 1, int(GROWTH * index.n_agents)), index.first_person)


def carry_over(old: World, new: World, slots: IntArray) -> None:
    """Give a larger scene the state of a smaller one; everything that decides the steps to come is the same bits.

    Args:
        old: The smaller one.
        new: The same scene with more robots, all of them and all people parked.
        slots: Robots of the old one that are in use, shape (k,).
    """
    (model, data, index), (larger, state, target) = old, new
    state.time = data.time
    for here, there in (
        (index.agent_dofs[slots], target.agent_dofs[slots]),
        (index.pedestrian_qvel, target.pedestrian_qvel),
    ):
        for name in ("qvel", "qacc_warmstart", "qfrc_applied"):
            getattr(state, name)[there] = getattr(data, name)[here]
    state.qpos[target.agent_qpos[slots]] = data.qpos[index.agent_qpos[slots]]
    state.qpos[target.pedestrian_qpos] = data.qpos[index.pedestrian_qpos]
    state.ctrl[target.ctrl[slots]] = data.ctrl[index.ctrl[slots]]
    state.mocap_pos[:], state.mocap_quat[:] = data.mocap_pos, data.mocap_quat
    larger.tree_sleep_policy[target.agent_tree[slots]] = model.tree_sleep_policy[index.agent_tree[slots]]
    pairs = [(index.pedestrian_geom, target.pedestrian_geom)]
    for slot in slots:
        larger.body_gravcomp[target.agent_bodies[slot]] = model.body_gravcomp[index.agent_bodies[slot]]
        pairs.append((index.agent_geoms[slot], target.agent_geoms[slot]))
    for here, there in pairs:
        larger.geom_contype[there], larger.geom_conaffinity[there] = (
            model.geom_contype[here],
            model.geom_conaffinity[here],
        )
    for here, there in (
        (index.pedestrian_carrier, target.pedestrian_carrier),
        (index.pedestrian_body, target.pedestrian_body),
    ):
        larger.body_pos[there], larger.body_quat[there] = model.body_pos[here], model.body_quat[here]
