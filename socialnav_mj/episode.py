"""The record of everything that happened in one episode; all that comes later is made from it alone."""

import hashlib
import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.contact import Partner
from socialnav_mj.episode_checks import EpisodeError, check_arrays, check_values
from socialnav_mj.files import written_whole
from socialnav_mj.outcome import Outcome

__all__ = ["Array", "Episode", "EpisodeError", "IntArray", "Outcome", "Partner", "read_header"]

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

FORMAT = "socialnav_mj.episode/4"
MAX_BYTES = 1 << 30
"""An episode file whose arrays are larger is not read: a small file can ask for any amount of memory."""
_OPTIONAL = {"agent_scores", "pedestrian_deviation"}


@dataclass(frozen=True, kw_only=True)
class Episode:
    """One run of one controller in one scenario.

    Times are seconds since the recording's first frame. Everything sampled "per step" is taken at `time`, before the
    action of that step; values of agents and pedestrians that are not in the scene are NaN. n is the number of agents,
    m the number of replayed pedestrians, t the number of samples, k the number of contacts.
    """

    time: Array
    """(t,) evenly spaced by the control time step [s]."""

    agent_person: IntArray
    """(n,) id of the person each agent replaces; ascending, unique."""
    agent_start: Array
    """(n, 2) where that person appeared [m]."""
    agent_goal: Array
    """(n, 2) where that person's track ends [m]."""
    agent_appear_time: Array
    """(n,) first control step at or after the person's appearance [s]."""
    agent_spawn_time: Array
    """(n,) real spawn, delayed while the place is taken; NaN if it never was free [s]."""
    agent_deadline: Array
    """(n,) counted from the real spawn; NaN if there was none [s]."""
    agent_end_time: Array
    """(n,) sample at which its run ended, however it did; NaN if never spawned [s]."""
    agent_outcome: IntArray
    """(n,) values of `Outcome`."""
    agent_ghost_overlaps: IntArray
    """(n,) people who appeared on a robot and then, contact-free, overlapped this agent at a control step or more."""

    agent_position: Array
    """(t, n, 2) from the spawn's sample to the end's, both included [m]."""
    agent_heading: Array
    """(t, n) [rad]."""
    agent_velocity: Array
    """(t, n, 2) [m/s]."""
    agent_yaw_rate: Array
    """(t, n) [rad/s]."""
    agent_tilt: Array
    """(t, n) angle between the robot's upward axis and the vertical; 0 in the human row [rad]."""
    agent_wheel_speed: Array
    """(t, n, 2) (left, right) command that acts from this sample on; NaN at the end's sample [rad/s]."""
    agent_policy: IntArray
    """(t, n) index into `policies` of what chose that command; -1 where there is none."""

    pedestrian_person: IntArray
    """(m,) ids of the replayed people; ascending, unique."""
    pedestrian_position: Array
    """(t, m, 2) [m]."""
    pedestrian_heading: Array
    """(t, m) [rad]."""
    pedestrian_velocity: Array
    """(t, m, 2) [m/s]."""

    contact_agent: IntArray
    """(k,) agent index. Rows are ordered by time, then agent, then partner."""
    contact_partner_kind: IntArray
    """(k,) values of `Partner`."""
    contact_partner: IntArray
    """(k,) agent or pedestrian index. A touch between two agents stands in two rows, one from each side."""
    contact_time: Array
    """(k,) first physics step of the touch [s]."""
    contact_duration: Array
    """(k,) time from first to last touching physics step, both included [s]."""
    contact_position: Array
    """(k, 2) where the bodies met [m]."""
    contact_normal: Array
    """(k, 2) unit vector from the agent towards its partner at first touch."""
    contact_agent_heading: Array
    """(k,) at first touch [rad]."""
    contact_agent_velocity: Array
    """(k, 2) just before the touch [m/s]."""
    contact_partner_velocity: Array
    """(k, 2) just before the touch; a rigid pedestrian's is the recorded one [m/s]."""
    contact_impact_impulse: Array
    """(k,) integral of the normal force over the first 0.1 s after the first touch. It and the columns below are
    NaN where there is no physics (human row) [N s]."""
    contact_impact_force: Array
    """(k,) largest normal force of one physics step of the first 0.1 s [N]."""
    contact_push_duration: Array
    """(k,) time in touch after the first 0.1 s [s]."""
    contact_push_impulse: Array
    """(k,) integral of the normal force after the first 0.1 s [N s]."""
    contact_push_force: Array
    """(k,) largest normal force after the first 0.1 s; sideways it is chatter, see docs/metrics.md [N]."""
    contact_peak_time: Array
    """(k,) when the larger of the two largest forces acted, after the first touch [s]."""
    contact_squeeze: Array
    """(k,) largest force by which either robot of the touch was squeezed while it lasted: half of what the normal
    forces on it have in sum more than their resultant, which moves it [N]."""
    contact_held_back: Array
    """(k,) by how much a pedestrian's distance from its recorded place grew while it touched; 0 for rigid ones [m]."""

    policies: tuple[str, ...]
    """Names that `agent_policy` indexes; the controller's name alone if it never switches."""
    agent_scores: NDArray[np.float32] | None = None
    """(t, n, policies) what each would have cost, if the controller tells; NaN where `agent_policy` is -1."""
    pedestrian_deviation: Array | None = None
    """(t, m, 2) from the recorded place, of people who react or can be held back; None: all keep to it [m]."""
    metadata: dict[str, Any]
    """JSON values: controller, its configuration, scenario, recording with its checksum, versions, state_hash."""

    def __post_init__(self) -> None:
        check_arrays(self)
        check_values(self)

    @property
    def n_agents(self) -> int:
        """Number of agents, spawned or not."""
        return len(self.agent_person)

    @property
    def n_pedestrians(self) -> int:
        """Number of replayed people."""
        return len(self.pedestrian_person)

    @property
    def control_timestep(self) -> float:
        """Time between two samples [s]."""
        return float(self.metadata["scenario"]["control_timestep"])

    @property
    def agent_active(self) -> NDArray[np.bool_]:
        """(t, n) whether an agent is in the scene and under way: from its spawn up to, not including, its end."""
        return self.agent_policy >= 0

    @property
    def contact_closing_speed(self) -> Array:
        """(k,) speed at which the two bodies approached along the normal just before the touch [m/s]."""
        return np.einsum("kd,kd->k", self.contact_agent_velocity - self.contact_partner_velocity, self.contact_normal)

    def window(self, agent: int) -> slice:
        """Samples of one agent, from its spawn to its end.

        Args:
            agent: Agent index.

        Returns:
            A slice of the time axis; empty if the agent never spawned.
        """
        present = np.flatnonzero(np.isfinite(self.agent_heading[:, agent]))
        return slice(int(present[0]), int(present[-1]) + 1) if present.size else slice(0, 0)

    def save(self, path: str | Path) -> Path:
        """Write the episode to a compressed npz file; the file appears whole or not at all.

        Args:
            path: Target; folders are made.

        Returns:
            The path written.
        """
        arrays: dict[str, Any] = {f.name: v for f in fields(self) if isinstance(v := getattr(self, f.name), np.ndarray)}
        header = {"format": FORMAT, "policies": list(self.policies), "metadata": self.metadata}
        header["digest"] = _digest(arrays, header)
        with written_whole(path) as part:
            np.savez_compressed(part, header=np.array(json.dumps(header)), **arrays)
        return Path(path)

    @classmethod
    def load(cls, path: str | Path) -> "Episode":
        """Read an episode; never runs code from the file. Its digest tells of damage, `verification` of forgery.

        Args:
            path: An npz file written by `save`.

        Returns:
            The episode, equal to the one saved.

        Raises:
            EpisodeError: If the file is damaged or not an episode of this format.
        """
        expected = {f.name for f in fields(cls)} - {"policies", "metadata"} - _OPTIONAL
        with _reading(path) as (file, header):
            if missing := expected - set(file.files):
                raise EpisodeError(f"it lacks {', '.join(sorted(missing))}")
            if unknown := set(file.files) - expected - _OPTIONAL - {"header"}:
                raise EpisodeError(f"it has unknown arrays {', '.join(sorted(unknown))}")
            arrays = {name: _array(file, name) for name in expected | _OPTIONAL & set(file.files)}
            episode = cls(**arrays, policies=tuple(header["policies"]), metadata=header["metadata"])
            if header.get("digest") != _digest(arrays, header):
                raise EpisodeError("it was altered after it was written: its contents do not have the header's digest")
            return episode


MAX_NAME = 200
"""Longest name of a controller, scenario or recording [characters]."""


def check_name(key: str, name: Any) -> None:
    """Refuse what could not stand as a name in a table.

    Args:
        key: What is named.
        name: Its name.

    Raises:
        EpisodeError: If it is no text, too long, or holds a line break or another character that cannot be printed.
    """
    if not isinstance(name, str) or len(name) > MAX_NAME or not name.isprintable():
        raise EpisodeError(
            f"{key} is {str(name)[:MAX_NAME]!r}; allowed: up to {MAX_NAME} printable characters in one line"
        )


def read_header(path: str | Path) -> dict[str, Any]:
    """The small part of an episode file, without its arrays.

    Args:
        path: An npz file written by `Episode.save`.

    Returns:
        format, policies, metadata, digest.

    Raises:
        FileNotFoundError: If there is no such file.
        EpisodeError: If the file is damaged or not an episode of this format.
    """
    with _reading(path) as (_, header):
        return header


@contextmanager
def _reading(path: str | Path) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Open an episode file and its header; everything that can be wrong with it becomes an EpisodeError."""
    try:
        with np.load(path, allow_pickle=False) as file:
            if not hasattr(file, "files") or "header" not in file.files:
                raise EpisodeError("it has no header")
            if (size := sum(member.file_size for member in file.zip.infolist())) > MAX_BYTES:
                raise EpisodeError(f"its arrays take {size} bytes; allowed: up to {MAX_BYTES}")
            header = json.loads(str(_array(file, "header")))
            if header.get("format") != FORMAT:
                raise EpisodeError(f"its format is {header.get('format')!r}; this version reads {FORMAT!r}")
            if not isinstance(header.get("metadata"), dict) or not _are_names(header.get("policies")):
                raise EpisodeError("its header lacks metadata (an object) or policies (a list of names)")
            yield file, header
    except FileNotFoundError:
        raise
    except Exception as error:
        # Damage makes zipfile, zlib and numpy raise nearly anything, NotImplementedError and struct.error included.
        raise EpisodeError(f"{path} is not a readable episode: {error}") from error


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


def _array(file: Any, name: str) -> NDArray[Any]:
    """An array of an npz file; one that claims more bytes than the file holds is refused before they are asked for."""
    member = f"{name}.npy"
    with file.zip.open(member) as part:
        version = np.lib.format.read_magic(part)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(part)
    claimed, held = math.prod(shape) * dtype.itemsize, file.zip.getinfo(member).file_size
    if claimed > held:
        raise EpisodeError(f"{name} of {claimed} bytes in a file of {held}")
    return np.asarray(file[name])


def _digest(arrays: dict[str, NDArray[Any]], header: dict[str, Any]) -> str:
    """SHA-256 of all that an episode says: its arrays with names, types and shapes, its policies and metadata."""
    said = {key: header[key] for key in ("policies", "metadata")}
    digest = hashlib.sha256(json.dumps(said, sort_keys=True).encode())
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
