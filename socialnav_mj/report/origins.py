"""Where each row of a page comes from: command, hash of the simulated states, and a trace."""

import shlex
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

from socialnav_mj.report.agents import Source
from socialnav_mj.report.blocks import Origin, Row, Table, cell_of, digest_of
from socialnav_mj.report.paired import HUMAN
from socialnav_mj.report.results import Results
from socialnav_mj.report.run_file import RunFile

PROGRAM = "socialnav-mj"


def origins(sources: Sequence[Source], run: RunFile | None) -> dict[tuple[str, str, str, str], Origin]:
    """Origin of the row of each scenario and controller of a run.

    Args:
        sources: All episodes, those of one row one after another.
        run: What run.json says; None if there is none.

    Returns:
        By dataset, variant, scenario and controller. The command runs the row's episodes into a folder of their own.
    """
    result = {}
    for key, group in groupby(sources, key=lambda s: s.group):
        own = list(group)
        trace = f"traces/{Path(own[0].file).stem}.rrd"
        result[key] = Origin(
            digest=digest_of([str(source.metadata["state_hash"]) for source in own]),
            command="" if run is None else command_of_row(run, key[2], key[3]),
            trace=trace,
            view=f"{PROGRAM} view {shlex.quote(trace)}",
        )
    return result


def command_of_row(run: RunFile, scenario: str, controller: str) -> str:
    """Command that runs the episodes of one row again.

    Args:
        run: What run.json says.
        scenario: Such as "scenario_1".
        controller: As tables name it.

    Returns:
        The run's own command for this scenario and controller alone; the run's own as it is if it is none of
        `evaluate`.
    """
    try:
        words = shlex.split(run.command)
    except ValueError:  # run.json is a file that anybody may have written
        return run.command
    if len(words) < 2 or words[1] != "evaluate":
        return run.command
    options = _options(words[2:])
    specs = options.pop("--controllers", list(run.controllers))
    named = dict(zip((name for name in run.controllers if name != HUMAN), specs, strict=False))
    options.pop("--out", None)
    options["--scenarios"] = [scenario.removeprefix("scenario_")]
    if controller != HUMAN:  # the recorded people are scored with whatever controller
        options["--controllers"] = [named.get(controller, controller)]
    kept = [word for option, values in options.items() for word in (option, *values)]
    return shlex.join([PROGRAM, "evaluate", *(word for word in kept if word)])


def origins_table(results: Mapping[str, Results], folder: str, command: str) -> Table:
    """Rows of a study, one for each run, scenario and controller, with where they come from.

    Args:
        results: By name of the run.
        folder: Of an episode of a run, beside the page, with `{run}` and `{file}`.
        command: That made the study.

    Returns:
        A table with origins.
    """
    rows = []
    for name, own in results.items():
        for key, group in groupby(own.sources, key=lambda s: s.group):
            sources = list(group)
            origin = Origin(
                digest=digest_of([str(source.metadata["state_hash"]) for source in sources]),
                command=command,
                view=f"{PROGRAM} view {shlex.quote(folder.format(run=name, file=sources[0].file))}",
            )
            texts = (name, f"{key[0]} ({key[1]})", key[2], key[3], str(len(sources)))
            rows.append(Row(cells=tuple(cell_of(text) for text in texts), origin=origin))
    return Table(headings=("run", "recording", "scenario", "controller", "draws"), rows=tuple(rows))


def _options(words: Sequence[str]) -> dict[str, list[str]]:
    """Option: its values; what stands before the first option is under the empty name."""
    options: dict[str, list[str]] = {}
    name = ""
    for word in words:
        if word.startswith("--"):
            name, equals, value = word.partition("=")
            options[name] = [value] if equals else []
        else:
            options.setdefault(name, []).append(word)
    return options
