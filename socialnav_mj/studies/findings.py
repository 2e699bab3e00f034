"""What an experiment says of the paper's claims: each holds, fails, or stays undecided."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from socialnav_mj.report.intervals import Interval, interval_of
from socialnav_mj.studies.claims import CLAIMS, Claim, Part
from socialnav_mj.studies.panel import Panel

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
    for part in claim.parts:
        if not all(panel.has(term.method, term.scenario) for term in part.terms):
            missing.append(part.label)
            continue
        trained = any(panel.is_trained(term.method) for term in part.terms)
        interval = interval_of(panel.contrast(part.terms), trained=trained)
        parts.append((part, interval, verdict_of(interval.low, interval.high)))
        given.append(verdict_of(interval.low_given, interval.high_given))
    lacking: list[Verdict] = ["undecided"] * len(missing)
    return Finding(
        claim=claim,
        verdict=verdict_of_all([*(verdict for *_, verdict in parts), *lacking]),
        verdict_given=verdict_of_all([*given, *lacking]),
        parts=tuple(parts),
        missing=tuple(missing),
    )
