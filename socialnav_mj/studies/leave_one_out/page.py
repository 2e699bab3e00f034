"""README.md of leave-one-recording-out: in-sample and held-out policies side by side."""

from collections.abc import Mapping, Sequence
from typing import Any

from socialnav_mj.report.intervals import LEAST, ONE_RECORDING
from socialnav_mj.report.markdown import table
from socialnav_mj.studies.cells import interval_cell
from socialnav_mj.studies.files import traceability
from socialnav_mj.studies.leave_one_out.comparison import DIFFERENCES, SideBySide
from socialnav_mj.studies.levels import LevelTable
from socialnav_mj.studies.looks import LOOKS, SCENARIO_TITLES
from socialnav_mj.studies.panel import REPLAY_IRL

_COLUMNS = (
    ("success", "success"),
    ("share of steps within 1.2 m", "intrusion_share_of_steps"),
    ("first collision with a pedestrian", "first_hit_pedestrian"),
    ("timed out", "timed_out"),
)
_HOW_TO_READ = f"""\
Every policy learned from all recordings but one; on the recording that it left out it is *held out*, on the others \
*in-sample*. All rows of a scenario are about the same agents, those that replace people whom the in-sample policies \
learned from: a held-out row as good as the in-sample rows says that what was learned holds for people never seen, a \
worse one that part of it holds for those people alone. Brackets: 95 % interval for other draws and, given {LEAST} \
or more, other training seeds; all numbers are in tables/leave_one_out.csv. {ONE_RECORDING}
"""
_DIFFERENCES = """\
Taken agent by agent and training seed by training seed, over the seeds that both have; *- in-sample* is minus the \
mean of all in-sample policies. Held out is worse if its success is below 0, or its share of steps within 1.2 m above; \
an interval that covers 0 leaves it open.
"""


def leave_one_out_page(compared: Sequence[SideBySide], *, provenance: Mapping[str, Any]) -> str:
    """Text of the study's README.md: differences first, then the levels on each recording.

    Args:
        compared: One for each recording.
        provenance: Command, experiment, recordings, policies, runs.

    Returns:
        Markdown.
    """
    names = [side.recording for side in compared]
    lines = [f"# Leave one recording out: {', '.join(names)}", "", f"Command: `{provenance['command']}`", ""]
    lines += [_HOW_TO_READ, "## Held out minus in-sample", "", _DIFFERENCES, *_differences(compared)]
    for side in compared:
        begin, end = (f"{100.0 * share:g}" for share in side.window)
        lines += [f"## {side.recording}, people who appear in {begin} to {end} % of its duration", "", *_levels(side)]
    return "\n".join([*lines, *traceability(provenance, provenance["recordings"])]) + "\n"


def _differences(compared: Sequence[SideBySide]) -> list[str]:
    rows = []
    for side in compared:
        found = LevelTable(rows=side.differences)
        for scenario in found.scenarios:
            for name in dict.fromkeys(level.method for level in side.differences):
                own = [found.find(scenario, name, measure) for measure in DIFFERENCES]
                cells = [interval_cell(level, "+") for level in own if level is not None]
                rows.append([side.recording, SCENARIO_TITLES.get(scenario, scenario), _label(name), *cells])
    return table(
        ["recording", "scenario", "difference", *(heading for heading, _ in _COLUMNS[: len(DIFFERENCES)])], rows
    )


def _levels(side: SideBySide) -> list[str]:
    rows = []
    for scenario in side.levels.scenarios:
        for method in side.methods:
            success = side.levels.find(scenario, method, "success")
            if success is None:
                continue
            cells = [interval_cell(side.levels.find(scenario, method, measure)) for _, measure in _COLUMNS]
            trainings = success.interval.n_trainings
            agents = f"{success.n_values // max(trainings, 1)}" + (f" x {trainings} trainings" if trainings > 1 else "")
            title = SCENARIO_TITLES.get(scenario, scenario)
            rows.append([title, _label(method), side.role(method) or "-", *cells, agents])
    return table(["scenario", "controller", "to this recording", *(h for h, _ in _COLUMNS), "agents"], rows)


def _label(method: str) -> str:
    return LOOKS[method].label if method in LOOKS else method.replace(f"{REPLAY_IRL}(", f"{LOOKS[REPLAY_IRL].label}(")
