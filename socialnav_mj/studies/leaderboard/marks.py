"""What a strong controller reaches: marks set before it was run, with paired intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

from socialnav_mj.report.intervals import Interval, interval_of
from socialnav_mj.studies.panel import POTENTIAL_FIELD, REPLAY_IRL, Panel, Term

HIGH_SUCCESS, FAIR_SUCCESS = 0.97, 0.95
STEPS, TIME, SUCCESS = "intimate_intrusions", "time_under_way", "success"


@dataclass(frozen=True, kw_only=True)
class Mark:
    """One controller in one scenario, beside ReplayIRL and the paper's potential field."""

    scenario: str
    controller: str
    success: Interval
    steps: Interval
    """Control steps within 1.2 m of a person for each agent, minus ReplayIRL's."""
    half: Interval
    """The same, minus half of ReplayIRL's."""
    time: Interval
    """Censored time under way, minus the potential field's [s]."""

    @property
    def is_strong(self) -> bool:
        """Success of at least `HIGH_SUCCESS`, surely fewer steps than ReplayIRL, surely less time than the field."""
        return self.success.mean >= HIGH_SUCCESS and self.steps.high < 0.0 and self.time.high < 0.0

    @property
    def is_calm(self) -> bool:
        """Success of at least `FAIR_SUCCESS`, and surely at most half of ReplayIRL's steps."""
        return self.success.mean >= FAIR_SUCCESS and self.half.high <= 0.0


def marks_of(panel: Panel, controllers: Sequence[str]) -> tuple[Mark, ...]:
    """All marks of a recording.

    Args:
        panel: Of its agents.
        controllers: Their names on the board.

    Returns:
        By scenario and controller; none if ReplayIRL or the potential field is not on the board.
    """
    if not {REPLAY_IRL, POTENTIAL_FIELD} <= {*controllers}:
        return ()
    return tuple(_mark(panel, scenario, name) for scenario in panel.scenarios for name in controllers)


def _mark(panel: Panel, scenario: str, name: str) -> Mark:
    def paired(measure: str, other: str, factor: float) -> Interval:
        terms = [Term(factor=1.0, method=name, scenario=scenario, measure=measure)]
        terms += [Term(factor=-factor, method=other, scenario=scenario, measure=measure)]
        trained = panel.is_trained(name) or panel.is_trained(other)
        return interval_of(panel.contrast(terms), trained=trained)

    alone = panel.contrast([Term(factor=1.0, method=name, scenario=scenario, measure=SUCCESS)])
    return Mark(
        scenario=scenario,
        controller=name,
        success=interval_of(alone, trained=panel.is_trained(name)),
        steps=paired(STEPS, REPLAY_IRL, 1.0),
        half=paired(STEPS, REPLAY_IRL, 0.5),
        time=paired(TIME, POTENTIAL_FIELD, 1.0),
    )
