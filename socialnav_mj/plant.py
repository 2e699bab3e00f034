"""An ideal plant: unicycles that do as they are told, in the place of wheels with motors, mass and grip."""

import mujoco
import numpy as np

from socialnav_mj.elementary import cos, sin
from socialnav_mj.geometry import arc, quaternion_of_yaw, wheel_speed_of_twist, yaw_of_quaternion
from socialnav_mj.scene import UNICYCLE, agent_name
from socialnav_mj.scene_index import SceneIndex


class Unicycles:
    """Robots that follow the commanded twist exactly, along arcs, whatever they meet.

    The bodies are those of the wheels, and touch as they do; after every physics step each robot under way is put where
    the command has it, upright on the floor, with its wheels rolling. What a touch exerts on it is forgotten.
    """

    def __init__(self, index: SceneIndex, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Take over the robots of a scene.

        Args:
            index: Of the scene.
            model: The scene.
            data: Its state.
        """
        self._index, self._model, self._data = index, model, data
        self._geometry = _wheel_geometry(model)
        self._trunk = np.array([bodies[0] for bodies in index.agent_bodies], dtype=np.int64)
        wheels = [
            [model.joint(agent_name(slot) + name).dofadr[0] for name in ("left_wheel", "right_wheel")]
            for slot in range(index.n_agents)
        ]
        self._wheel_qvel = np.array(wheels, dtype=np.int64)

    def follow(self, n_steps: int) -> None:
        """Take in the commands in `ctrl` for the next physics steps, of robots that are not parked.

        Args:
            n_steps: Number of physics steps.
        """
        index, model, data = self._index, self._model, self._data
        rows = np.flatnonzero(model.body_gravcomp[self._trunk] == 0.0)
        low, high = model.actuator_ctrlrange[index.ctrl[rows]].transpose(2, 0, 1)
        twist = np.clip(data.ctrl[index.ctrl[rows]], low, high)
        place = data.qpos[index.qpos[rows, None] + np.arange(7)]
        time = model.opt.timestep * np.arange(n_steps + 1)[:, None]
        position, heading = arc(place[:, :2], yaw_of_quaternion(place[:, 3:]), twist, time)
        self._pose, self._speed = np.zeros((*heading.shape, 7)), np.zeros((*heading.shape, 6))
        self._pose[..., :2], self._pose[..., 3:] = position, quaternion_of_yaw(heading)
        self._speed[..., 0], self._speed[..., 1] = twist[:, 0] * cos(heading), twist[:, 0] * sin(heading)
        self._speed[..., 5] = twist[:, 1]
        self._rolling = wheel_speed_of_twist(twist, **self._geometry)
        self._rows = rows
        self._put(0)

    def settle(self, step: int) -> None:
        """Put robots where their commands have them at the end of a physics step.

        Args:
            step: Of those prepared, from 0.
        """
        self._put(step + 1)

    def _put(self, step: int) -> None:
        index, rows, data = self._index, self._rows, self._data
        data.qpos[index.qpos[rows, None] + np.arange(7)] = self._pose[step]
        data.qvel[index.qvel[rows, None] + np.arange(6)] = self._speed[step]
        data.qvel[self._wheel_qvel[rows]] = self._rolling


def unicycles_of(index: SceneIndex, model: mujoco.MjModel, data: mujoco.MjData) -> Unicycles | None:
    """The ideal plant of a scene, if it was built with one.

    Args:
        index: Of the scene.
        model: As `scene.build_model` compiles it.
        data: Its state.

    Returns:
        None if MuJoCo drives the robots by their wheels.
    """
    named = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, UNICYCLE) >= 0
    return Unicycles(index, model, data) if named else None


def _wheel_geometry(model: mujoco.MjModel) -> dict[str, float]:
    """wheel_radius and track [m], from the tendons that `scene` checks against the configuration."""
    tendons = (model.tendon(agent_name(0) + name).id for name in ("forward", "yaw"))
    of_speed, of_turn = (abs(float(model.wrap_prm[model.tendon_adr[tendon]])) for tendon in tendons)
    return {"wheel_radius": 2.0 * of_speed, "track": 2.0 * of_speed / of_turn}
