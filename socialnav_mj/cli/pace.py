"""How long a command will take."""

from collections import defaultdict
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
        self._waiting: dict[str, float] = defaultdict(float)
        for job in jobs:
            self._waiting[job.controller] += job.cost
        self._finished: dict[str, tuple[float, float]] = {}
        self._simulated = 0.0

    def note(self, done: Done) -> None:
        """Account for one job.

        Args:
            done: Of `evaluate`.
        """
        controller = done.job.controller
        self._waiting[controller] -= done.job.cost
        if done.simulated_time is not None:
            cost, spent = self._finished.get(controller, (0.0, 0.0))
            self._finished[controller] = cost + done.job.cost, spent + done.duration
            self._simulated += done.simulated_time
        self._last = monotonic()

    @property
    def rate(self) -> float | None:
        """Simulated over real time, all processes together; None before the first episode."""
        return self._simulated / (self._last - self._begin) if self._simulated else None

    @property
    def left(self) -> float | None:
        """Time to the end if each controller's rest costs what its finished episodes did [s].

        Controllers without one cost what the others do, in the mean. None before the first episode, and when the time
        is over and the end is not there.
        """
        if not self._finished:
            return None
        costs, times = (sum(values) for values in zip(*self._finished.values(), strict=True))
        at_once = max(1.0, times / max(self._last - self._begin, 1e-6))
        waiting = {name: cost for name, cost in self._waiting.items() if cost > 1e-6}
        rates = {name: spent / cost for name, (cost, spent) in self._finished.items()}
        total = sum(cost * rates.get(name, times / costs) for name, cost in waiting.items())
        left = total / at_once - (monotonic() - self._last)
        if not waiting:
            return 0.0
        return left if left > 0.0 else None
