"""What an experiment says of the paper's claims: each holds, fails, or stays undecided."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from socialnav_mj.report.intervals import LEAST, Interval, components_of, interval_of
from socialnav_mj.report.power import fewest, resolved
from socialnav_mj.studies.claims import CLAIMS, Claim, Part
from socialnav_mj.studies.panel import COMMON, Panel

Verdict = Literal["holds", "fails", "undecided"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What an experiment says of a claim."""

    claim: Claim
    verdict: Verdict
    """For other draws and other trainings."""
    verdict_given: Verdict
    """For other draws of the trainings at hand."""
    parts: tuple[tuple[Part, Interval, Verdict], ...]
    """Each comparison with its interval and its own verdict; those that were run."""
    missing: tuple[str, ...]
    """Labels of comparisons whose scenarios or methods were not run."""
    would_take: tuple[int, int] | None
    """Draws and trainings (0 if nothing learns) that would decide it, were every difference as large as the one found;
    None if it is decided, if that were more than `power.MOST_DRAWS`, or if a comparison was not run."""
    same_agents: dict[str, tuple[int, int]]
    """Scenario: agents that every controller brought home, and all agents; empty if the claim is about all of them."""


def verdict_of(low: float, high: float) -> Verdict:
    """Verdict of one comparison.

    Args:
        low: Lower end of its interval; NaN if there is none.
        high: Upper end.

    Returns:
        "holds" above 0, "fails" below 0, else "undecided".
    """
    if low > 0.0:
        return "holds"
    return "fails" if high < 0.0 else "undecided"


def verdict_of_all(verdicts: Iterable[Verdict]) -> Verdict:
    """Verdict of a claim from those of its comparisons.

    Args:
        verdicts: One for each comparison.

    Returns:
        "holds" if all hold, "fails" if any fails, else "undecided".
    """
    listed = list(verdicts)
    if "fails" in listed:
        return "fails"
    return "holds" if listed and set(listed) == {"holds"} else "undecided"


def examine(panel: Panel, claims: Sequence[Claim] = CLAIMS) -> list[Finding]:
    """What an experiment says of each claim.

    Args:
        panel: Of the experiment.
        claims: To be examined.

    Returns:
        One finding a claim; comparisons that were not run leave it undecided unless another one fails.
    """
    return [_finding(panel, claim) for claim in claims]


def _finding(panel: Panel, claim: Claim) -> Finding:
    parts: list[tuple[Part, Interval, Verdict]] = []
    given: list[Verdict] = []
    missing = []
    undecided: list[tuple[NDArray[np.bool_], Interval]] = []
    for part in claim.parts:
        if not all(panel.has(term.method, term.scenario) for term in part.terms):
            missing.append(part.label)
            continue
        trained = any(panel.is_trained(term.method) for term in part.terms)
        cells = panel.contrast(part.terms)
        interval = interval_of(cells, trained=trained)
        parts.append((part, interval, verdict_of(interval.low, interval.high)))
        if parts[-1][-1] == "undecided" and interval.n_draws >= LEAST:
            undecided.append((resolved(components_of(cells), interval.mean, trained=trained), interval))
        given.append(verdict_of(interval.low_given, interval.high_given))
    lacking: list[Verdict] = ["undecided"] * len(missing)
    verdict = verdict_of_all([*(verdict for *_, verdict in parts), *lacking])
    common = [term.scenario for part in claim.parts for term in part.terms if term.measure.endswith(COMMON)]
    return Finding(
        claim=claim,
        verdict=verdict,
        verdict_given=verdict_of_all([*given, *lacking]),
        parts=tuple(parts),
        missing=tuple(missing),
        would_take=_would_take(undecided) if verdict == "undecided" and not missing else None,
        same_agents={s: panel.same_agents(s) for s in dict.fromkeys(common) if s in panel.scenarios},
    )


def _would_take(undecided: Sequence[tuple[NDArray[np.bool_], Interval]]) -> tuple[int, int] | None:
    """One comparison against the claim decides it; else all that are open have to be told from 0."""
    if not undecided:
        return None
    against = [resolves for resolves, interval in undecided if interval.mean < 0.0]
    enough = np.logical_or.reduce(against) if against else np.logical_and.reduce([r for r, _ in undecided])
    return fewest(
        enough,
        draws=max(interval.n_draws for _, interval in undecided),
        trainings=max(interval.n_trainings for _, interval in undecided),
    )
