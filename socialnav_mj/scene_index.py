"""Where the robots and people of a scene are in MuJoCo's arrays; names are looked up once, never in the step loop."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from socialnav_mj.episode import IntArray
from socialnav_mj.scene import AGENT_PREFIX, AGENT_SLOTS, PEDESTRIAN_PREFIX, agent_name, pedestrian_name


@dataclass(frozen=True, kw_only=True)
class SceneIndex:
    """Addresses and ids, a row or an entry for every slot. n is the number of robots, m that of pedestrians."""

    qpos: IntArray
    """(n,) first address of each robot's free joint in `qpos`: 3 of position, 4 of the quaternion."""
    qvel: IntArray
    """(n,) the same in `qvel`: 3 of velocity, 3 of angular velocity."""
    position: IntArray
    """(n, 2) addresses of each robot's x and y in `qpos`."""
    quaternion: IntArray
    """(n, 4) addresses of each robot's quaternion in `qpos`."""
    velocity: IntArray
    """(n, 2) addresses of each robot's velocity along x and y in `qvel`."""
    ctrl: IntArray
    """(n, 2) actuators of forward speed and yaw rate."""
    agent_bodies: tuple[IntArray, ...]
    """Bodies of each robot."""
    agent_geoms: tuple[IntArray, ...]
    """Geoms of each robot."""
    agent_qpos: IntArray
    """(n, nq) all addresses of each robot in `qpos`."""
    agent_dofs: IntArray
    """(n, nv) its degrees of freedom."""
    agent_tree: IntArray
    """(n,) kinematic tree of each robot."""
    pedestrian_geom: IntArray
    """(m,) collider of each pedestrian; mocap bodies have the slots' order."""
    pedestrian_body: IntArray
    """(m,) body of each, which has the heading."""
    pedestrian_carrier: IntArray
    """(m,) body that bears its mass; (0,) for mocap bodies, as the two below."""
    pedestrian_qpos: IntArray
    """(m, 2) addresses of x and y in `qpos`, from the carrier's place in the model."""
    pedestrian_qvel: IntArray
    """(m, 2) the same in `qvel`."""
    first_person: int
    """Number of slots for robots, >= n; whoever is numbered from it on is a person."""
    owner: IntArray
    """(ngeom,) whose collider a geom is: 0 to n - 1 for bumpers, from `first_person` on for people, -1 for others."""

    @property
    def n_agents(self) -> int:
        """n, the robots in the pool."""
        return len(self.qpos)

    @property
    def n_pedestrians(self) -> int:
        """m, the people in the pool."""
        return len(self.pedestrian_geom)


def index_scene(model: mujoco.MjModel) -> SceneIndex:
    """Addresses and ids of a compiled scene, looked up by the names that `scene` gives.

    Args:
        model: As `scene.build_model` compiles it.

    Returns:
        Good for this model and every copy of it.

    Raises:
        ValueError: If the floor is not the first geom or there are mocap bodies and they are not the pedestrians, in
            this order.
    """
    names = [model.body(i).name for i in range(model.nbody)]
    agents = [agent_name(i) for i in range(_count(names, AGENT_PREFIX, "/robot"))]
    people = [pedestrian_name(i) for i in range(_count(names, PEDESTRIAN_PREFIX, "/pedestrian"))]
    body = np.array([model.body(name + "pedestrian").id for name in people], dtype=np.int64)
    yielding = [] if model.nmocap else people
    mocap = model.body_mocapid[body]
    if (model.nmocap and not np.array_equal(mocap, np.arange(model.nmocap))) or model.geom("floor").id != 0:
        raise ValueError("the scene must have the floor as its first geom and the pedestrians as its mocap bodies")
    root = np.asarray(model.body_rootid)
    robots = [model.body(name + "robot").id for name in agents]

    def belonging(body_of_each: IntArray) -> tuple[IntArray, ...]:
        return tuple(np.flatnonzero(root[body_of_each] == body) for body in robots)

    sizes = np.diff(model.jnt_qposadr, append=model.nq)
    owner_of_qpos = np.repeat(model.jnt_bodyid, sizes)
    bumpers = np.array([model.geom(name + "bumper").id for name in agents])
    bodies = np.array([model.geom(name + "body").id for name in people])
    owner = np.full(model.ngeom, -1, dtype=np.int64)
    owner[bumpers] = np.arange(len(agents))
    first_person = int(model.numeric(AGENT_SLOTS).data[0])
    owner[bodies] = first_person + np.arange(len(people))
    qpos = np.array([model.joint(name + "root").qposadr[0] for name in agents], dtype=np.int64)
    qvel = np.array([model.joint(name + "root").dofadr[0] for name in agents], dtype=np.int64)
    return SceneIndex(
        qpos=qpos,
        qvel=qvel,
        position=qpos[:, None] + (0, 1),
        quaternion=qpos[:, None] + (3, 4, 5, 6),
        velocity=qvel[:, None] + (0, 1),
        ctrl=np.array([[model.actuator(name + what).id for what in ("forward", "yaw")] for name in agents]),
        agent_tree=np.asarray(model.body_treeid)[robots].astype(np.int64),
        agent_bodies=belonging(np.arange(model.nbody)),
        agent_geoms=belonging(model.geom_bodyid),
        agent_qpos=np.array(belonging(owner_of_qpos)),
        agent_dofs=np.array(belonging(model.dof_bodyid)),
        pedestrian_geom=bodies,
        pedestrian_body=body,
        pedestrian_carrier=np.array([model.body(name + "carrier").id for name in yielding], dtype=np.int64),
        pedestrian_qpos=_addresses([[model.joint(name + axis).qposadr[0] for axis in "xy"] for name in yielding]),
        pedestrian_qvel=_addresses([[model.joint(name + axis).dofadr[0] for axis in "xy"] for name in yielding]),
        first_person=first_person,
        owner=owner,
    )


def first_invalid(index: SceneIndex, data: mujoco.MjData, warned: NDArray[np.bool_]) -> str:
    """Name whose state MuJoCo found invalid first, if that is what it warns of.

    Args:
        index: Of the scene.
        data: After the warnings.
        warned: Which kinds of warning there were, by `mjtWarning`.

    Returns:
        End of a sentence; empty if no state was invalid.
    """
    warning = mujoco.mjtWarning
    for kind, robots, people in (
        (warning.mjWARN_BADQPOS, index.qpos, index.pedestrian_qpos),
        (warning.mjWARN_BADQVEL, index.qvel, index.pedestrian_qvel),
        (warning.mjWARN_BADQACC, index.qvel, index.pedestrian_qvel),
    ):
        if warned[int(kind)]:
            first = data.warning[int(kind)].lastinfo
            agent, person = np.searchsorted(robots, first, side="right") - 1, np.flatnonzero((people == first).any(1))
            name = pedestrian_name(int(person[0])) if person.size else agent_name(int(agent))
            return f"; first invalid in {name.rstrip('/')}"
    return ""


def _addresses(pairs: list[list[int]]) -> IntArray:
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _count(names: list[str], prefix: str, suffix: str) -> int:
    return sum(name.startswith(prefix) and name.endswith(suffix) for name in names)
