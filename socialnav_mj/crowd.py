"""People who react: the recording's, off their tracks for robots and back on them, at every physics step."""

from dataclasses import replace

import numpy as np

from socialnav_mj.cast import Cast, Replay, SlotCrowd
from socialnav_mj.config import Scenario
from socialnav_mj.geometry import Array
from socialnav_mj.reaction import STRENGTH, Deviation, Movers, deviate
from socialnav_mj.recordings import Recording


class ReactingCrowd:
    """A replay whose people decide at every control step how far they step off their tracks.

    Between two control steps offset and drift go over into one another by the cubic that has both at both ends. Where
    nobody deviates, the arrays are the replay's own.
    """

    def __init__(self, replay: Replay, scenario: Scenario) -> None:
        """Everybody is on the track.

        Args:
            replay: What the recording says; it is not changed.
            scenario: Gives the strength, the radii and the time steps.
        """
        self.replay = replay
        """The recording's people."""
        self._strength = STRENGTH[scenario.pedestrians]
        self._distance, self._body = scenario.contact_distance, 2.0 * scenario.pedestrian_radius
        self._timestep, self._fine = scenario.control_timestep, scenario.physics_timestep
        count = scenario.n_sub_steps
        share = np.arange(count + 1) / count
        # Of the offset and drift before, and those after: first for places, then for velocities.
        place = (
            (1.0 + 2.0 * share) * (1.0 - share) ** 2,
            self._timestep * share * (1.0 - share) ** 2,
            share * share * (3.0 - 2.0 * share),
            self._timestep * share * share * (share - 1.0),
        )
        pace = (
            6.0 * share * (share - 1.0) / self._timestep,
            (1.0 - share) * (1.0 - 3.0 * share),
            6.0 * share * (1.0 - share) / self._timestep,
            share * (3.0 * share - 2.0),
        )
        self._shares = np.stack([np.concatenate(both) for both in zip(place, pace, strict=True)])
        self.begin()

    def begin(self) -> None:
        """Put everybody back on the track of the recording's beginning."""
        people = self.replay.crowd(0)
        self._step = 0
        self._before = self._after = Deviation.none(len(people.pedestrian))
        self._walk = self._still = np.zeros((len(people.pedestrian), 2))

    def crowd(self, step: int) -> SlotCrowd:
        """Everybody in the scene at a control step.

        Args:
            step: Of the last `react`, or the one after it; at others people are where the recording has them.

        Returns:
            As `Replay.crowd`, off the tracks.
        """
        recorded = self.replay.crowd(step)
        if step == self._step:
            deviation = self._before
        elif step == self._step + 1:
            deviation = self._stayed(self._after, recorded)
        else:
            return recorded
        if not deviation.offset.any() and not deviation.drift.any():
            return recorded
        return replace(
            recorded, position=recorded.position + deviation.offset, velocity=recorded.velocity + deviation.drift
        )

    def react(self, step: int, people: SlotCrowd, robots: Movers) -> None:
        """Decide how people walk in the control step that comes.

        Args:
            step: The control step, one after the last.
            people: Where they are.
            robots: That are under way.
        """
        now, then = self.replay.crowd(step), self.replay.crowd(step + 1)
        if step != self._step:
            self._before = self._stayed(self._after, now)
            if now.changed.size and self._walk is not self._still:
                self._walk[now.changed] = 0.0
        self._step, self._after = step, self._before
        if not now.present.size or not (len(robots.position) or self._before.rows.size):
            return
        following = then.position
        if then.changed.size:
            following = following.copy()
            following[then.changed] = np.nan
        # Whoever is not there is NaN, and so meets nobody.
        self._after = deviate(
            self._before,
            people=Movers(position=people.position, velocity=people.velocity),
            recorded=Movers(position=now.position, velocity=now.velocity),
            following=following,
            facing=now.quaternion,
            robots=robots,
            strength=self._strength,
            timestep=self._timestep,
            distance=self._distance,
            body=self._body,
        )

    def motion(self, step: int) -> tuple[Array, Array, Array | None]:
        """How people move in the control step of the last `react`.

        Args:
            step: That control step.

        Returns:
            As `Replay.motion`, off the tracks.
        """
        position, velocity, walk = self.replay.motion(step)
        known = np.array((self._before.offset, self._before.drift, self._after.offset, self._after.drift))
        last, self._walk = self._walk, self._still
        if not known.any():
            return position, velocity, walk
        moved = np.einsum("kt,kmd->tmd", self._shares, known)
        offset, drift = moved[: len(moved) // 2], moved[len(moved) // 2 :]
        if walk is not None:
            steps = np.diff(offset, axis=0) / self._fine
            walk = walk + np.concatenate([last[None], steps])
            self._walk = steps[-1].copy()
        return position + offset[:-1], velocity + drift[:-1], walk

    def _stayed(self, deviation: Deviation, people: SlotCrowd) -> Deviation:
        """A deviation without that of people who have left; who comes is on the track."""
        if not people.changed.size:
            return deviation
        offset, drift = deviation.offset.copy(), deviation.drift.copy()
        offset[people.changed], drift[people.changed] = 0.0, 0.0
        return Deviation(offset=offset, drift=drift)


def crowd_of(recording: Recording, scenario: Scenario, cast: Cast) -> Replay | ReactingCrowd:
    """The people of an episode.

    Args:
        recording: Whose people they are.
        scenario: Says whether they react, and how.
        cast: Of both.

    Returns:
        The replay, or people who react.
    """
    replay = Replay(recording, scenario, cast)
    return replay if scenario.pedestrians == "replay" else ReactingCrowd(replay, scenario)
