"""What is true of the robots: a pool of slots, each in use or parked below the floor."""

from collections.abc import Callable

import mujoco
import numpy as np
from dm_control.mujoco import Physics as MujocoPhysics
from dm_control.mujoco.wrapper import MjData, MjModel

from socialnav_mj.elementary import arccos
from socialnav_mj.episode import IntArray
from socialnav_mj.geometry import Array, quaternion_of_yaw, yaw_of_quaternion
from socialnav_mj.people import PARKING_DEPTH
from socialnav_mj.pool import World, carry_over, larger_pool
from socialnav_mj.scene import REARM_TIME
from socialnav_mj.scene_index import index_scene
from socialnav_mj.touch import TouchLog

_SLEEP = mujoco.mjtSleepPolicy


class RobotPool(MujocoPhysics):
    """Robots of a crowd, one row a slot in everything that is read and set.

    A pool that grows has robots for the first slots alone, and compiles the scene anew when a slot beyond is used.
    """

    _build: Callable[[int], mujoco.MjModel] | None = None

    def _reload_from_data(self, data: MjData) -> None:
        model = data.model.ptr
        self._index = index_scene(model)
        self._bits = np.array(model.geom_user[:, :2], dtype=np.int32)
        self._touches = TouchLog(self._index, rearm_time=float(model.numeric(REARM_TIME).data[0]))
        super()._reload_from_data(data)

    @property
    def n_agents(self) -> int:
        """Slots; robots are in the pool for the first of them, and for all if it does not grow."""
        return self._index.first_person

    def agent_position(self) -> Array:
        """Floor point under the axle's centre.

        Returns:
            Shape (n_agents, 2) [m].
        """
        return self._of_slots(self.data.qpos[self._index.position])

    def agent_heading(self) -> Array:
        """Direction the robots face.

        Returns:
            Shape (n_agents,) [rad].
        """
        return self._of_slots(yaw_of_quaternion(self._agent_quaternion()))

    def agent_velocity(self) -> Array:
        """Velocity over ground.

        Returns:
            Shape (n_agents, 2) [m/s].
        """
        return self._of_slots(self.data.qvel[self._index.velocity])

    def agent_yaw_rate(self) -> Array:
        """Angular velocity about the robots' own upward axis.

        Returns:
            Shape (n_agents,) [rad/s].
        """
        return self._of_slots(self.data.qvel[self._index.qvel + 5])

    def agent_tilt(self) -> Array:
        """Angle between the robots' upward axis and the vertical.

        Returns:
            Shape (n_agents,) [rad].
        """
        _, x, y, _ = self._agent_quaternion().T
        return self._of_slots(arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))

    def _agent_quaternion(self) -> Array:
        return self.data.qpos[self._index.quaternion]

    def _of_slots(self, values: Array) -> Array:
        """Rows of the robots, and rows of zeros for the slots beyond the pool."""
        beyond = self.n_agents - len(values)
        return np.concatenate([values, np.zeros((beyond, *values.shape[1:]))]) if beyond else values

    def state(self, slots: IntArray) -> Array:
        """Everything from which the simulation of some robots, and of people who yield, goes on.

        Args:
            slots: Agent slots, shape (k,).

        Returns:
            Their rows of `qpos` and `qvel`, then those of the people if they have any, in one row.
        """
        index, data = self._index, self.data
        people = (data.qpos[index.pedestrian_qpos], data.qvel[index.pedestrian_qvel])
        robots = (data.qpos[index.agent_qpos[slots]], data.qvel[index.agent_dofs[slots]])
        return np.concatenate([values.ravel() for values in (*robots, *people)])

    def set_twist(self, twist: Array) -> None:
        """Command the tendon actuators; MuJoCo clips to their ctrlrange.

        Args:
            twist: (forward speed [m/s], yaw rate [rad/s]), shape (n_agents, 2).
        """
        self.data.ctrl[self._index.ctrl] = twist[: self._index.n_agents]

    def place_agent(self, slot: int, position: Array, heading: float) -> None:
        """Put a robot at rest on the floor and into contact with the world; the pool grows if it has to.

        Args:
            slot: Agent slot.
            position: Shape (2,) [m].
            heading: [rad].
        """
        if slot >= self._index.n_agents:
            self._grow(slot)
        self._set_agent_state(slot, (*position, 0.0), heading, present=True)

    def park_agent(self, slot: int) -> None:
        """Take a robot out of the scene and end its touches.

        Args:
            slot: Agent slot.
        """
        self._set_agent_state(slot, (2.0 * slot, 0.0, -PARKING_DEPTH), 0.0, present=False)
        self._touches.end_of_agent(slot)

    def _set_agent_state(self, slot: int, position: tuple[float, ...], heading: float, *, present: bool) -> None:
        model, data = self.model, self.data
        address = self._index.qpos[slot]
        data.qpos[self._index.agent_qpos[slot]] = 0.0
        data.qpos[address : address + 3] = position
        data.qpos[address + 3 : address + 7] = quaternion_of_yaw(heading)
        data.qvel[self._index.agent_dofs[slot]] = 0.0
        data.qacc_warmstart[self._index.agent_dofs[slot]] = 0.0
        data.ctrl[self._index.ctrl[slot]] = 0.0
        model.body_gravcomp[self._index.agent_bodies[slot]] = 0.0 if present else 1.0
        self._set_contacts(self._index.agent_geoms[slot], present)
        tree = self._index.agent_tree[slot]
        # Only who is parked may sleep, since a sleeping robot would not listen to its command; its new place wakes it.
        model.ptr.tree_sleep_policy[tree] = _SLEEP.mjSLEEP_NEVER if present else _SLEEP.mjSLEEP_ALLOWED

    def _grow(self, slot: int) -> None:
        """Compile the scene with half as many robots again, at least with one for the slot, and go on in it."""
        if self._build is None:
            raise ValueError(f"slot {slot} has no robot, and this copy of the physics cannot build one")
        old, touches = World(self.model.ptr, self.data.ptr, self._index), self._touches
        in_use = np.flatnonzero(self.model.ptr.tree_sleep_policy[old.scene.agent_tree] == _SLEEP.mjSLEEP_NEVER)
        self._reload_from_data(MjData(MjModel(self._build(larger_pool(self._index, slot)))))
        self.reset()
        carry_over(old, World(self.model.ptr, self.data.ptr, self._index), in_use)
        touches.index, self._touches = self._index, touches

    def _set_contacts(self, geoms: IntArray, enabled: bool) -> None:
        bits = self._bits[geoms] if enabled else np.zeros((len(geoms), 2), dtype=self._bits.dtype)
        self.model.geom_contype[geoms] = bits[:, 0]
        self.model.geom_conaffinity[geoms] = bits[:, 1]
