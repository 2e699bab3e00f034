"""Bodies of the people, once they are touched: mocap bodies that nothing stops, or 75 kg with a limited force."""

from typing import Protocol

import mujoco
import numpy as np

from socialnav_mj.episode import IntArray
from socialnav_mj.geometry import Array
from socialnav_mj.scene_index import SceneIndex

PARKING_DEPTH = 20.0
"""How far below the floor bodies wait that are not in the scene [m]."""
PUSHING_FORCE = 130.0
"""Most that a person pushes with, beyond what its own mass needs to follow the recording: the quasi-static limit of
ISO/TS 15066, table A.2, for the lower leg, which meets the bumper. Pain begins there, and nobody pushes on into it. For
comparison: the driving force of somebody of 80 kg who wants to walk at 1 m/s and is held is m v / tau = 160 N in the
social force model (Helbing, Farkas and Vicsek 2000, tau = 0.5 s) [N]."""
RELAXATION_TIME = 0.5
"""In which somebody takes on the velocity that it wants: tau of the social force model [s]."""
CATCH_UP_TIME = 1.0
"""In which somebody who was held back wants to be where the recording is: twice that, so that it swings over by no more
than a twentieth [s]."""
CATCH_UP_SPEED = 0.5
"""But no faster than that beyond the recorded velocity: from 1.3 m/s, a usual walk, to 1.8 m/s, a brisk one [m/s]."""

JUMP_SPEED = 5.0
"""Whose recorded place moves faster than anybody runs in a crowd has jumped; the body is put there, not driven: the
blow of 75 kg at such a speed would be the recording's fault, and throws robots out of the numbers [m/s]."""


class People(Protocol):
    """How the people of a scene are moved; a row for every pedestrian slot."""

    @property
    def quaternion(self) -> Array:
        """(m, 4) of the headings, (w, x, y, z)."""
        ...

    def position(self) -> Array:
        """Where the bodies are, shape (m, 2) [m]."""
        ...

    def place(self, slots: IntArray, position: Array, velocity: Array, quaternion: Array) -> None:
        """Tell people where and how the recording has them now.

        Args:
            slots: Shape (k,).
            position: Shape (k, 2) [m].
            velocity: Shape (k, 2) [m/s].
            quaternion: (w, x, y, z), shape (k, 4).
        """

    def park(self, slots: IntArray) -> None:
        """Take people out of the scene.

        Args:
            slots: Shape (k,).
        """

    def follow(self, path: Array | None, velocity: Array | None, walk: Array | None, n_steps: int) -> None:
        """Prepare the motion of the next physics steps.

        Args:
            path: Position at the beginning of each, shape (n_steps, m, 2), NaN for who is not in the scene; None for
                people who stand [m].
            velocity: Recorded velocity at the same times and of the same shape [m/s].
            walk: Mean velocity in the physics step before these and in each of them, shape (n_steps + 1, m, 2); None to
                take it from path and velocity [m/s].
            n_steps: Number of physics steps.
        """

    def advance(self, step: int) -> None:
        """Move people, or let them push, in the physics step that comes.

        Args:
            step: Of those prepared, from 0.
        """

    def velocity(self, step: int, before: Array) -> Array:
        """Velocity with which people meet others in a physics step.

        Args:
            step: Of those prepared, from 0.
            before: `qvel` at its beginning.

        Returns:
            Shape (m, 2) [m/s].
        """

    def behind(self) -> Array:
        """How far people were from where the recording has them when the physics step began, shape (m,) [m]."""


class RigidPeople:
    """Mocap bodies: where the recording has them, whatever they meet; to the solver they are infinitely heavy."""

    def __init__(self, index: SceneIndex, data: mujoco.MjData) -> None:
        """Take over the mocap bodies of a scene.

        Args:
            index: Of the scene.
            data: Its state.
        """
        self._position, self._quaternion = data.mocap_pos, data.mocap_quat
        self._path: Array | None = None
        self._velocity = np.zeros((1, index.n_pedestrians, 2))
        self._behind = np.zeros(index.n_pedestrians)

    @property
    def quaternion(self) -> Array:
        """See `People`."""
        return self._quaternion

    def position(self) -> Array:
        """See `People`."""
        return self._position[:, :2].copy()

    def place(self, slots: IntArray, position: Array, velocity: Array, quaternion: Array) -> None:
        """See `People`; a mocap body has no velocity."""
        self._position[slots, :2] = position
        self._position[slots, 2] = 0.0
        self._quaternion[slots] = quaternion

    def park(self, slots: IntArray) -> None:
        """See `People`."""
        self._position[slots, 0] = 2.0 * slots
        self._position[slots, 1] = 2.0
        self._position[slots, 2] = -PARKING_DEPTH

    def follow(self, path: Array | None, velocity: Array | None, walk: Array | None, n_steps: int) -> None:
        """See `People`."""
        self._path = None if path is None else np.where(np.isnan(path), self._position[:, :2], path)
        self._velocity = np.zeros((n_steps, *self._behind.shape, 2)) if velocity is None else velocity

    def advance(self, step: int) -> None:
        """See `People`."""
        if self._path is not None:
            np.copyto(self._position[:, :2], self._path[step])

    def velocity(self, step: int, before: Array) -> Array:
        """See `People`; the recorded one, which the solver does not know."""
        return self._velocity[step]

    def behind(self) -> Array:
        """See `People`; 0."""
        return self._behind


class CompliantPeople:
    """Bodies that slide over the floor and are driven along the recording, with a force that is limited.

    In every physics step a body gets the force m a that the recorded acceleration a takes, so that who meets nobody is
    where the recording has them. Besides, it gets m (w - v) / `RELAXATION_TIME`, but no more than `PUSHING_FORCE`: v is
    its velocity, and w the one it wants, the recorded one and the way back to the recorded place in `CATCH_UP_TIME`, at
    `CATCH_UP_SPEED` at most. That is a spring and a damper. Who jumps in the recording is put where it jumps to.
    """

    def __init__(self, index: SceneIndex, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Take over the bodies of a scene.

        Args:
            index: Of the scene.
            model: The scene; headings and parking are written to it.
            data: Its state.
        """
        self._index, self._model, self._data = index, model, data
        self._origin = model.body_pos[index.pedestrian_carrier, :2].copy()
        self._mass = model.body_mass[index.pedestrian_carrier][:, None].copy()
        self._target = self._walk = self._inertia = np.zeros((1, index.n_pedestrians, 2))
        self._behind = np.zeros(index.n_pedestrians)
        self._jumps = np.zeros((1, index.n_pedestrians), dtype=bool)

    @property
    def quaternion(self) -> Array:
        """See `People`."""
        return self._model.body_quat[self._index.pedestrian_body]

    def position(self) -> Array:
        """See `People`."""
        return self._origin + self._data.qpos[self._index.pedestrian_qpos]

    def place(self, slots: IntArray, position: Array, velocity: Array, quaternion: Array) -> None:
        """See `People`; who is in the scene already is only turned."""
        index, model, data = self._index, self._model, self._data
        model.body_quat[index.pedestrian_body[slots]] = quaternion
        parked = model.body_pos[index.pedestrian_carrier[slots], 2] < 0.0
        come = slots[parked]
        model.body_pos[index.pedestrian_carrier[come], 2] = 0.0
        data.qpos[index.pedestrian_qpos[come]] = position[parked] - self._origin[come]
        data.qvel[index.pedestrian_qvel[come]] = velocity[parked]

    def park(self, slots: IntArray) -> None:
        """See `People`."""
        index, data = self._index, self._data
        self._model.body_pos[index.pedestrian_carrier[slots], 2] = -PARKING_DEPTH
        data.qpos[index.pedestrian_qpos[slots]] = 0.0
        for values in (data.qvel, data.qfrc_applied, data.qacc_warmstart):
            values[index.pedestrian_qvel[slots]] = 0.0

    def follow(self, path: Array | None, velocity: Array | None, walk: Array | None, n_steps: int) -> None:
        """See `People`."""
        here, timestep = self.position(), self._model.opt.timestep
        self._target = (
            np.broadcast_to(here, (n_steps, *here.shape)) if path is None else np.where(np.isnan(path), here, path)
        )
        if walk is None:
            recorded = np.zeros_like(self._target) if velocity is None else velocity
            inside = np.diff(self._target, axis=0) / timestep
            # Beyond both ends the path goes on as it came.
            before, after = inside[:1] if n_steps > 1 else recorded, inside[-1:] if n_steps > 1 else recorded
            walk = np.concatenate([2.0 * recorded[:1] - before, inside, 2.0 * recorded[-1:] - after])
        walk = np.nan_to_num(walk)
        self._walk = walk
        self._jumps = np.linalg.norm(walk, axis=2) > JUMP_SPEED
        self._inertia = self._mass * np.diff(walk, axis=0) / timestep

    def advance(self, step: int) -> None:
        """See `People`."""
        index, data = self._index, self._data
        lag = self._target[step] - self.position()
        self._behind = np.linalg.norm(lag, axis=1)
        # What the body had in the step before, if nobody held it.
        wanted = self._walk[step] + _limited(lag / CATCH_UP_TIME, CATCH_UP_SPEED)
        push = self._mass * (wanted - data.qvel[index.pedestrian_qvel]) / RELAXATION_TIME
        data.qfrc_applied[index.pedestrian_qvel] = self._inertia[step] + _limited(push, PUSHING_FORCE)
        jumped = np.flatnonzero(self._jumps[step] | self._jumps[step + 1])
        if jumped.size:
            velocity = np.where(self._jumps[step + 1][jumped, None], 0.0, self._walk[step + 1][jumped])
            data.qpos[index.pedestrian_qpos[jumped]] = self._target[step][jumped] - self._origin[jumped]
            data.qvel[index.pedestrian_qvel[jumped]] = velocity
            data.qfrc_applied[index.pedestrian_qvel[jumped]] = 0.0

    def velocity(self, step: int, before: Array) -> Array:
        """See `People`; the body's own."""
        return before[self._index.pedestrian_qvel]

    def behind(self) -> Array:
        """See `People`."""
        return self._behind


def people_of(index: SceneIndex, model: mujoco.MjModel, data: mujoco.MjData) -> People:
    """The people of a scene, of the kind that it was built with.

    Args:
        index: Of the scene.
        model: As `scene.build_model` compiles it.
        data: Its state.

    Returns:
        Rigid ones if the model has mocap bodies, else compliant ones.
    """
    return RigidPeople(index, data) if model.nmocap else CompliantPeople(index, model, data)


def _limited(vectors: Array, limit: float) -> Array:
    """Vectors of shape (m, 2), shortened where they are longer than a limit."""
    length = np.linalg.norm(vectors, axis=1)
    return vectors * np.minimum(1.0, limit / np.maximum(length, limit))[:, None]
