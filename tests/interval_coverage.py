"""How often the interval of the tables covers what it estimates, on made studies of this project's size and spread.

Run `python tests/interval_coverage.py` after a change of `socialnav_mj.report.intervals`: it writes the table of
docs/results.md, which the slow test of `test_intervals.py` computes again.

An agent's latent score is threshold + draw + training + person + rest, the last with variance 1, all normal; it
succeeds if the score is positive. So the mean over all draws and trainings is known: the normal distribution function
of threshold / sqrt(sum of variances). Two controllers of one draw share the draw and the persons.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import norm

from socialnav_mj.report.intervals import interval_of

PAGE = Path(__file__).resolve().parents[1] / "docs" / "results.md"
BEGIN = "<!-- coverage: python tests/interval_coverage.py -->\n"
END = "<!-- end of coverage -->"
DRAWS, TRAININGS = (3, 5, 10, 20), (1, 3, 5, 10)
STUDIES = 2000


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is estimated, and how it varies; shares are turned into latent thresholds."""

    name: str
    agents: int
    """Of a draw."""
    share: float
    """Mean of the controller."""
    less: float | None = None
    """Mean of what is subtracted from it, agent by agent; None for a level."""
    both_learn: bool = False
    """Whether what is subtracted has the same trainings."""
    draw: float = 0.15
    """Standard deviations of the latent score."""
    training: float = 0.1
    person: float = 0.6
    own: float = 0.1
    """Of one controller in one draw."""
    seconds: bool = False
    """Not the share but a time of those that succeed: 12 s minus the latent score without its threshold."""


CASES = (
    Case(name="success .70, 43 agents", agents=43, share=0.70),
    Case(name="success .95, 390 agents", agents=390, share=0.95, draw=0.05, own=0.02, training=0.1),
    Case(name="time-outs .005, 43 agents", agents=43, share=0.005),
    Case(name="success .79 - .68, 43 agents", agents=43, share=0.79, less=0.68),
    Case(name="success .81 - .75, 130 agents", agents=130, share=0.81, less=0.75),
    Case(name="success .79 - .77, both learned, 43 agents", agents=43, share=0.79, less=0.77, both_learn=True),
    Case(name="time of about 17 of 43 agents", agents=43, share=0.4, seconds=True),
)


def studies_of(case: Case, n_draws: int, n_trainings: int, number: int, random: np.random.Generator) -> np.ndarray:
    """Cells of many studies, shape (number, n_draws, n_trainings)."""
    learns = n_trainings > 1
    shape = (number, n_draws, 1, case.agents)
    shared = case.draw * random.standard_normal((number, n_draws, 1, 1)) + case.person * random.standard_normal(shape)
    training = case.training * learns

    def score(share: float, trainings: int, varied: float) -> np.ndarray:
        total = 1.0 + case.draw**2 + case.person**2 + case.own**2 + varied**2
        latent = shared + case.own * random.standard_normal((number, n_draws, 1, 1))
        latent = latent + varied * random.standard_normal((number, 1, trainings, 1))
        latent = latent + random.standard_normal((number, n_draws, trainings, case.agents))
        return latent + norm.ppf(share) * np.sqrt(total)

    one = score(case.share, n_trainings, training)
    if case.seconds:
        arrived = one > 0.0
        arrived[..., 0] |= ~arrived.any(axis=-1)
        return np.where(arrived, 12.0 - one, 0.0).sum(axis=-1) / arrived.sum(axis=-1)
    means = (one > 0.0).mean(axis=-1)
    if case.less is None:
        return means
    trainings = n_trainings if case.both_learn else 1
    return means - (score(case.less, trainings, training * case.both_learn) > 0.0).mean(axis=-1)


def truth_of(case: Case, n_trainings: int) -> float:
    """What a study with endless draws and trainings finds."""
    if case.seconds:
        cells = studies_of(case, 1, 2 if n_trainings > 1 else 1, 60_000, np.random.default_rng(9))
        return float(cells.mean())
    return case.share - (case.less or 0.0)


def coverage(case: Case, n_draws: int, n_trainings: int, number: int = STUDIES) -> float:
    """Share of studies whose interval holds the truth."""
    random = np.random.default_rng([n_draws, n_trainings, case.agents])
    truth, covered = truth_of(case, n_trainings), 0
    agents = n_draws * case.agents if case.less is None and not case.seconds else None
    for begin in range(0, number, 200):
        for cells in studies_of(case, n_draws, n_trainings, min(200, number - begin), random):
            interval = interval_of(cells, trained=n_trainings > 1, agents=agents)
            covered += interval.low <= truth <= interval.high
    return covered / number


def table(number: int = STUDIES) -> dict[str, dict[tuple[int, int], float]]:
    """Case: (draws, trainings): coverage."""
    return {case.name: {(d, t): coverage(case, d, t, number) for d in DRAWS for t in TRAININGS} for case in CASES}


def markdown(found: dict[str, dict[tuple[int, int], float]]) -> str:
    """A row for each number of draws and trainings, a column for each case, their mean last."""
    lines = [" | ".join(["| draws x trainings", *found, "mean |"]), "|" + "---|" * (len(found) + 2)]
    for draws, trainings in ((d, t) for d in DRAWS for t in TRAININGS):
        cells = [own[draws, trainings] for own in found.values()]
        texts = [f"{value:.3f}".removeprefix("0") for value in (*cells, float(np.mean(cells)))]
        lines.append(f"| {draws} x {trainings} | {' | '.join(texts)} |")
    return "\n".join(lines) + "\n"


def with_table(page: str, text: str) -> str:
    """A page with its table written anew."""
    before, rest = page.split(BEGIN)
    return before + BEGIN + text + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), markdown(table())), encoding="utf-8")
