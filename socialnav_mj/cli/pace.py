"""How long a command will take."""

from collections.abc import Sequence
from time import monotonic

from socialnav_mj.evaluation import Done, Job


class Pace:
    """How fast the episodes of an evaluation get done, and how long the rest will take."""

    def __init__(self, jobs: Sequence[Job]) -> None:
        """Start the clock.

        Args:
            jobs: All that are to be run or there already.
        """
        self._begin = self._last = monotonic()
        self._waiting = sum(job.cost for job in jobs)
        self._finished = self._simulated = 0.0

    def note(self, done: Done) -> None:
        """Account for one job.

        Args:
            done: Of `evaluate`.
        """
        self._waiting -= done.job.cost
        if done.simulated_time is not None:
            self._finished += done.job.cost
            self._simulated += done.simulated_time
        self._last = monotonic()

    @property
    def rate(self) -> float | None:
        """Simulated over real time, all processes together; None before the first episode."""
        return self._simulated / (self._last - self._begin) if self._simulated else None

    @property
    def left(self) -> float | None:
        """Time to the end if the rest costs what the finished episodes did [s]; None before the first episode."""
        if not self._finished:
            return None
        total = (self._last - self._begin) * self._waiting / self._finished
        return max(0.0, total - (monotonic() - self._last))
