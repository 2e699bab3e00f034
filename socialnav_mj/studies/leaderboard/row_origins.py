"""Where each row of a leaderboard comes from: a command that makes it alone, and the hashes of its episodes."""

import shlex
from dataclasses import dataclass

from socialnav_mj.report.blocks import digest_of
from socialnav_mj.report.origins import PROGRAM
from socialnav_mj.report.results import Results
from socialnav_mj.studies.study import Run


@dataclass(frozen=True, kw_only=True)
class RowOrigin:
    """Of one row."""

    run: str
    """Name of the run, after recording and setting."""
    controller: str
    """Its name on the board."""
    command: str
    """Writes the same episodes, and a trace of each scenario's first draw."""
    digests: tuple[str, ...]
    """Of its episodes in each scenario, as `blocks.digest_of`, which the reports of runs show too."""


def origins_of(run: Run, results: Results) -> list[RowOrigin]:
    """Where the rows of a run come from.

    Args:
        run: Of the study.
        results: Its episodes.

    Returns:
        In the order of its roster.
    """
    specs: dict[str, list[str]] = {}
    names: dict[str, list[str]] = {}
    for entry, named in zip(run.roster, run.named_roster, strict=True):
        specs.setdefault(entry.method, []).append(entry.controller)
        names.setdefault(entry.method, []).append(named.controller)
    return [
        RowOrigin(
            run=run.name,
            controller=method,
            command=_command(run, [spec for spec in own if spec in run.evaluation.controllers]),
            digests=tuple(_digest(results, scenario, names[method]) for scenario in run.evaluation.scenarios),
        )
        for method, own in specs.items()
    ]


def _digest(results: Results, scenario: str, controllers: list[str]) -> str:
    own = [s for s in results.sources if s.group[2] == scenario and s.group[3] in controllers]
    return digest_of([str(source.metadata["state_hash"]) for source in own])


def _command(run: Run, controllers: list[str]) -> str:
    asked = run.evaluation
    words = [PROGRAM, "evaluate", "--dataset", asked.dataset, "--draws", str(asked.draws)]
    words += ["--seed", str(asked.seed), "--scenarios", *(name.removeprefix("scenario_") for name in asked.scenarios)]
    for name, value in asked.task_kwargs.items():
        words += [f"--{name.replace('_', '-')}", str(value)]
    # The human row comes with any other.
    return shlex.join([*words, "--controllers", *(controllers or asked.controllers[:1])])
