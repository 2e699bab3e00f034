"""Who is replaced and who is replayed, on the grid of control steps and with a slot for everybody."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.config import Scenario
from socialnav_mj.episode import IntArray
from socialnav_mj.geometry import Array, quaternion_of_yaw
from socialnav_mj.reaction import Movers
from socialnav_mj.recordings import Recording
from socialnav_mj.recordings.draw import replaced_people
from socialnav_mj.slots import share_slots

NOBODY = -1
"""Index that stands for an empty slot."""

LIKELY_TIME = 1.6
"""With it a pool fits the controllers of the project on students003: 48 robots in scenario 4 where 42 are used [-]."""

WINDOW = 250
"""Control steps that a replay evaluates at once: 50 s, three times as long as people are there on the average."""

_GRID_TOLERANCE = 1e-6
"""Times this near a control step, as a share of it, are on it."""


@dataclass(frozen=True, kw_only=True)
class Cast:
    """The people of a recording, split by a draw into n agents and m pedestrians.

    Steps count control steps from the recording's first frame. A person is in the scene from the first step at or
    after its appearance to the last step at or before its disappearance.
    """

    agent_index: IntArray
    """(n,) index into the recording, ascending."""
    agent_person: IntArray
    """(n,) id."""
    agent_start: Array
    """(n, 2) [m]."""
    agent_goal: Array
    """(n, 2) [m]."""
    agent_heading: Array
    """(n,) recorded heading at the start [rad]."""
    agent_appear_step: IntArray
    """(n,)"""
    agent_allowed_steps: IntArray
    """(n,) from the real spawn to the deadline."""
    n_agent_slots: int
    """Agents that can be in the scene at once."""
    n_likely_agents: int
    """Agents that are in the scene at once if they need `LIKELY_TIME` times as long as at full speed straight ahead."""
    pedestrian_index: IntArray
    """(m,) index into the recording, ascending."""
    pedestrian_person: IntArray
    """(m,) id."""
    pedestrian_first_step: IntArray
    """(m,)"""
    pedestrian_last_step: IntArray
    """(m,) included."""
    pedestrian_slot: IntArray
    """(m,) fixed for the episode."""
    n_pedestrian_slots: int
    """Pedestrians that can be in the scene at once; at least 1."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def n_agents(self) -> int:
        """n, the length of the `agent_*` arrays."""
        return len(self.agent_index)

    @property
    def n_pedestrians(self) -> int:
        """m, the length of the `pedestrian_*` arrays."""
        return len(self.pedestrian_index)


def cast_recording(recording: Recording, scenario: Scenario, *, replaced: IntArray | None = None) -> Cast:
    """Split a recording's people by the scenario's draw, or by a list.

    Args:
        recording: Its people become agents or pedestrians; of those not replaced, whoever is there at no control step
            is left out.
        scenario: Gives share, seed, minimum displacement, control time step and deadlines.
        replaced: Indices of the people who become agents, ascending; those of the draw by default.

    Returns:
        Agents and pedestrians in the order of the recording; slots are given out so that as few as can be are needed.

    Raises:
        ValueError: If the draw has no agents.
    """
    dt = scenario.control_timestep
    first = np.ceil(recording.start_time / dt - _GRID_TOLERANCE).astype(np.int64)
    last = np.floor(recording.end_time / dt + _GRID_TOLERANCE).astype(np.int64)
    agents = replaced
    if agents is None:
        agents = replaced_people(
            recording, share=scenario.share, seed=scenario.seed, minimum_displacement=scenario.minimum_displacement
        )
    if not len(agents):
        raise ValueError(
            f"share = {scenario.share} of the {recording.n_people} people of recording {recording.name!r} leaves no "
            f"agent; allowed: shares that replace at least one person who moves {scenario.minimum_displacement} m"
        )
    pedestrians = np.setdiff1d(np.flatnonzero(last >= first), agents)
    start, goal = recording.start[agents], recording.end[agents]
    distance = np.linalg.norm(goal - start, axis=1)
    allowed = np.array([scenario.allowed_steps(d) for d in distance], dtype=np.int64)
    likely = np.ceil(LIKELY_TIME * distance / scenario.robot.max_speed / dt).astype(np.int64)
    heading = np.array([recording.person(i).at(recording.start_time[i : i + 1])[2][0] for i in agents])
    agent_slot = share_slots(first[agents], first[agents] + allowed)
    slot = share_slots(first[pedestrians], last[pedestrians])
    return Cast(
        agent_index=agents,
        agent_person=recording.ids[agents],
        agent_start=start,
        agent_goal=goal,
        agent_heading=heading,
        agent_appear_step=first[agents],
        agent_allowed_steps=allowed,
        n_agent_slots=int(agent_slot.max()) + 1,
        n_likely_agents=int(share_slots(first[agents], first[agents] + np.minimum(likely, allowed)).max()) + 1,
        pedestrian_index=pedestrians,
        pedestrian_person=recording.ids[pedestrians],
        pedestrian_first_step=first[pedestrians],
        pedestrian_last_step=last[pedestrians],
        pedestrian_slot=slot,
        n_pedestrian_slots=int(slot.max(initial=0)) + 1,
    )


@dataclass(frozen=True, kw_only=True)
class SlotCrowd:
    """The people in the pedestrian slots at one control step; NaN in empty slots."""

    pedestrian: IntArray
    """(n_slots,) index of the pedestrian, -1 for nobody."""
    position: Array
    """(n_slots, 2) [m]."""
    velocity: Array
    """(n_slots, 2) [m/s]."""
    heading: Array
    """(n_slots,) [rad]."""
    quaternion: Array
    """(n_slots, 4) of the heading, (w, x, y, z)."""
    present: IntArray
    """Slots that are not empty, shape (k,)."""
    changed: IntArray
    """Slots that do not hold whom they held at the step before, shape (k,)."""


@dataclass(frozen=True, kw_only=True)
class _Window:
    """The people at w control steps on end and at one more before and after them, a row each, c physics steps long."""

    begin: int
    """Control step of the first row."""
    pedestrian: IntArray
    """(w + 2, n_slots), see `SlotCrowd`."""
    position: Array
    """((w + 2) c, n_slots, 2), NaN where nobody is [m]."""
    velocity: Array
    """((w + 2) c, n_slots, 2) [m/s]."""
    heading: Array
    """(w + 2, n_slots) [rad]."""
    quaternion: Array
    """(w + 2, n_slots, 4)"""
    changed: NDArray[np.bool_]
    """(w + 2, n_slots) whether somebody else was there at the step before; the first row is not set."""


class Replay:
    """How the pedestrians of a cast move, evaluated at every physics step, some seconds at a time.

    Who is in the scene at a control step stays until the next: a person whose track ends in between waits at its end.
    No number depends on where a window begins, and none is kept for long: the memory does not grow with the recording.
    """

    def __init__(self, recording: Recording, scenario: Scenario, cast: Cast) -> None:
        """Evaluate nothing yet.

        Args:
            recording: Its tracks are evaluated when they are asked for.
            scenario: Gives the control and the physics time step.
            cast: Of this recording and scenario; says who is replayed, in which slot, from when to when.
        """
        self._count = scenario.n_sub_steps
        self._timestep, self._yield = scenario.physics_timestep, scenario.pedestrian_body == "compliant"
        self._recording, self._cast = recording, cast
        # After the last person's end comes one more step, an empty scene, for all the time after.
        self._steps = int(cast.pedestrian_last_step.max(initial=-1)) + 1
        self._windows: dict[int, _Window] = {}
        self._crowds: dict[int, SlotCrowd] = {}

    def _window_of(self, step: int) -> tuple[_Window, int]:
        """The window that a control step is in, and its row there; of the others the latest is kept."""
        number = step // WINDOW
        if number not in self._windows:
            self._windows = dict([*self._windows.items()][-1:])
            self._windows[number] = self._evaluated(number * WINDOW - 1)
        window = self._windows[number]
        return window, step - window.begin

    def _evaluated(self, begin: int) -> _Window:
        count, slots, rows = self._count, self._cast.n_pedestrian_slots, WINDOW + 2
        pedestrian = np.full((rows, slots), NOBODY, dtype=np.int64)
        position, heading = np.full((rows * count, slots, 2), np.nan), np.full((rows, slots), np.nan)
        velocity = np.full_like(position, np.nan)
        first, last = self._cast.pedestrian_first_step, self._cast.pedestrian_last_step
        for i in np.flatnonzero((first < begin + rows) & (last >= begin)):
            slot, since, end = self._cast.pedestrian_slot[i], max(first[i], begin), min(last[i] + 1, begin + rows)
            times = np.arange(since * count, end * count) * self._timestep
            track = self._recording.person(int(self._cast.pedestrian_index[i]))
            here, fine = slice(since - begin, end - begin), slice((since - begin) * count, (end - begin) * count)
            pedestrian[here, slot] = i
            position[fine, slot], velocity[fine, slot] = track.motion(times)
            heading[here, slot] = track.heading(times[::count], velocity[fine, slot][::count])
        changed = np.zeros(pedestrian.shape, dtype=bool)
        changed[1:] = pedestrian[1:] != pedestrian[:-1]
        return _Window(
            begin=begin,
            pedestrian=pedestrian,
            position=position,
            velocity=velocity,
            heading=heading,
            quaternion=quaternion_of_yaw(heading),
            changed=changed,
        )

    def crowd(self, step: int) -> SlotCrowd:
        """Everybody in the scene at a control step.

        Args:
            step: Control step >= 0; there is nobody after the recording's end.

        Returns:
            A row for every pedestrian slot; its arrays are views of this object's and must not be written to.
        """
        if step in self._crowds:
            return self._crowds[step]
        within = min(step, self._steps)
        window, row = self._window_of(within)
        pedestrian = window.pedestrian[row]
        self._crowds = {k: crowd for k, crowd in self._crowds.items() if k == step - 1}
        self._crowds[step] = SlotCrowd(
            pedestrian=pedestrian,
            position=window.position[row * self._count],
            velocity=window.velocity[row * self._count],
            heading=window.heading[row],
            quaternion=window.quaternion[row],
            present=np.flatnonzero(pedestrian != NOBODY),
            changed=np.flatnonzero(window.changed[row] & (step == within)),
        )
        return self._crowds[step]

    def begin(self) -> None:
        """Nothing: a replay is the same every time."""

    def react(self, step: int, people: SlotCrowd, robots: Movers) -> None:
        """Nothing: people of a recording do not see robots.

        Args:
            step: Not used.
            people: Not used.
            robots: Not used.
        """

    def motion(self, step: int) -> tuple[Array, Array, Array | None]:
        """Positions and velocities at the beginning of every physics step of a control step.

        Args:
            step: Control step >= 0.

        Returns:
            Position [m] and velocity [m/s], both of shape (n_sub_steps, n_slots, 2); and for people who yield the mean
            velocity in the physics step before and in each, shape (n_sub_steps + 1, n_slots, 2), else None [m/s].
        """
        window, row = self._window_of(min(step, self._steps))
        rows = slice(row * self._count, (row + 1) * self._count)
        return window.position[rows], window.velocity[rows], self._walk(window, row) if self._yield else None

    def _walk(self, window: _Window, row: int) -> Array:
        """Mean velocity from place to place; the recorded one where a person has just come, or is about to leave."""
        first, end = row * self._count, (row + 1) * self._count
        rows = np.arange(first - 1, end + 1)
        same = window.pedestrian[rows // self._count] == window.pedestrian[row]
        walk = np.diff(np.where(same[..., None], window.position[rows], np.nan), axis=0) / self._timestep
        return np.where(np.isnan(walk), window.velocity[rows[:-1].clip(first, end - 1)], walk)
