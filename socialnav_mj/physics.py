"""What is true in the scene: poses, velocities and contacts of robots and people."""

from collections.abc import Callable

import mujoco
import numpy as np
from dm_control.mujoco.wrapper import MjData, MjModel
from dm_control.rl.control import PhysicsError
from numpy.typing import NDArray

from socialnav_mj.episode import IntArray
from socialnav_mj.geometry import Array
from socialnav_mj.people import people_of
from socialnav_mj.plant import unicycles_of
from socialnav_mj.robots import RobotPool
from socialnav_mj.scene_index import first_invalid
from socialnav_mj.touch import Touch

_SLEEP = mujoco.mjtSleepPolicy


class Physics(RobotPool):
    """A crowd of robots and replayed people.

    Every body is in a slot, and a slot is either in use or parked below the floor, out of contact. People are moved
    and contacts read at every physics step. All getters return arrays that the caller owns, one row a slot.
    A copy has the same state, but has seen no touches yet.
    """

    @classmethod
    def from_mujoco(cls, model: mujoco.MjModel, *, build: Callable[[int], mujoco.MjModel] | None = None) -> "Physics":
        """Physics of a model of `scene.build_model`.

        Args:
            model: The compiled scene.
            build: Compiles the same scene with more robots, for a pool that grows when a slot beyond it is used.

        Returns:
            The physics with every slot parked.
        """
        physics = cls(MjData(MjModel(model)))
        physics._build = build
        with physics.reset_context():
            pass
        return physics

    def _reload_from_data(self, data: MjData) -> None:
        super()._reload_from_data(data)
        model = data.model.ptr
        self._people = people_of(self._index, model, data.ptr)
        self._unicycles = unicycles_of(self._index, model, data.ptr)
        self._velocity_before = np.zeros(model.nv)
        self._path: tuple[Array | None, Array | None, Array | None] = (None, None, None)

    @property
    def n_pedestrians(self) -> int:
        """People in the pool."""
        return self._index.n_pedestrians

    def reset(self, keyframe_id: int | None = None) -> None:
        """Park every slot and forget every contact.

        Args:
            keyframe_id: See dm_control.
        """
        super().reset(keyframe_id)
        self._touches.forget()
        self._path = (None, None, None)
        for slot in range(self._index.n_agents):
            self.park_agent(slot)
        self.park_pedestrians(np.arange(self.n_pedestrians))

    # Pedestrians

    def pedestrian_position(self) -> Array:
        """Where people are: where the recording has them, or where their bodies were held if they yield.

        Returns:
            Shape (n_pedestrians, 2) [m].
        """
        return self._people.position()

    def pedestrian_velocity(self) -> Array | None:
        """Velocity of the bodies of people who yield.

        Returns:
            Shape (n_pedestrians, 2) [m/s]; None for rigid people, whose mocap bodies have none.
        """
        address = self._index.pedestrian_qvel
        return self.data.qvel[address] if len(address) else None

    def set_pedestrian_pose(
        self, slots: IntArray, position: Array, quaternion: Array, velocity: Array | None = None
    ) -> None:
        """Tell people where the recording has them: rigid ones, and who was parked, are there at once; others turn.

        Args:
            slots: Pedestrian slots, shape (k,).
            position: Shape (k, 2) [m].
            quaternion: (w, x, y, z), shape (k, 4).
            velocity: Recorded one, shape (k, 2); None for standing people [m/s].
        """
        self._people.place(slots, position, np.zeros_like(position) if velocity is None else velocity, quaternion)

    def park_pedestrians(self, slots: IntArray) -> None:
        """Take people out of the scene.

        Args:
            slots: Pedestrian slots, shape (k,).
        """
        self._people.park(slots)
        self.set_pedestrian_contacts(slots, np.zeros(len(slots), dtype=bool))

    def set_pedestrian_path(self, position: Array, velocity: Array, walk: Array | None = None) -> None:
        """Say how people move during the next call of `step`; see `People.follow`.

        Args:
            position: At the beginning of each physics step, shape (n_sub_steps, n_pedestrians, 2), NaN for those who
                are not in the scene [m].
            velocity: Recorded velocity at the same times and of the same shape [m/s].
            walk: Mean velocity in the physics step before and in each, shape (n_sub_steps + 1, n_pedestrians, 2) [m/s].
        """
        self._path = position, velocity, walk

    def set_pedestrian_contacts(self, slots: IntArray, enabled: NDArray[np.bool_]) -> None:
        """Let people touch robots, or pass through them.

        Args:
            slots: Pedestrian slots, shape (k,).
            enabled: Shape (k,).
        """
        for slot, present in zip(slots, enabled, strict=True):
            self._set_contacts(self._index.pedestrian_geom[slot : slot + 1], bool(present))
            if not present:
                self._touches.end_of_pedestrian(int(slot))

    # Time

    def step(self, nstep: int = 1) -> None:
        """Advance by physics steps, moving people before and reading contacts after each.

        Args:
            nstep: Number of physics steps.

        Raises:
            PhysicsError: If the state became invalid; names the time and the robot.
        """
        model, data = self.model.ptr, self.data.ptr
        qvel, before, contact = data.qvel, self._velocity_before, data.contact
        people, unicycles, (path, velocity, walk) = self._people, self._unicycles, self._path
        if path is not None and len(path) != nstep:
            raise ValueError(f"the pedestrians' path has {len(path)} positions for {nstep} physics steps")
        people.follow(path, velocity, walk, nstep)
        if unicycles is not None:
            unicycles.follow(nstep)
        time, kinds_of_warning = data.time, np.count_nonzero(self._warnings)
        try:
            with self.check_invalid_state():
                for k in range(nstep):
                    people.advance(k)
                    np.copyto(before, qvel)
                    time = data.time
                    mujoco.mj_step(model, data)
                    # The floor is geom 0, and MuJoCo names it first: all else is a touch of two bodies.
                    if np.count_nonzero(contact.geom1):
                        self._touches.note(model, data, time=time, velocity_before=before, people=people, step=k)
                    if unicycles is not None:
                        unicycles.settle(k)
                    # One step later an invalid number has spread to all robots and nobody can tell whose it was.
                    if np.count_nonzero(self._warnings) != kinds_of_warning:
                        break
        except PhysicsError as error:
            culprit = first_invalid(self._index, data, self._new_warnings)
            raise PhysicsError(f"at {time:.2f} s: {error}{culprit}") from error
        self._path = (None, None, None)

    def refresh_poses(self) -> None:
        """Bring the poses of bodies, geoms and cameras up to date, which `step` leaves one physics step behind."""
        mujoco.mj_kinematics(self.model.ptr, self.data.ptr)
        mujoco.mj_camlight(self.model.ptr, self.data.ptr)

    # Contacts

    def new_touches(self) -> list[Touch]:
        """Touches that began since the last call; they go on growing while the bodies touch.

        Returns:
            In order of time.
        """
        return self._touches.take_new()
