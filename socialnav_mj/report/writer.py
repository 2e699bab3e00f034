"""Run folder -> agents.parquet, summaries, report.md, tables, figures and traces; everything but the episodes."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import groupby
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from socialnav_mj.episode import Episode
from socialnav_mj.files import csv_bytes, write_whole
from socialnav_mj.report.agents import Results, Source, read_results, scenario_configuration
from socialnav_mj.report.estimates import Estimate, summarise
from socialnav_mj.report.markdown import bounds, code, head, number, plain, row
from socialnav_mj.report.paired import paired_differences
from socialnav_mj.report.paired_figure import paired_figure
from socialnav_mj.report.power import resolutions
from socialnav_mj.report.sections import draws_section, fault_section, paired_section, severity_section

SUMMARY_FORMAT = "socialnav_mj.summary/1"
RUN_FILE = "run.json"
"""Written beside the episodes by whoever made them; see `RunFile`."""
_FIGURE = "figures/paired_humans"

_COLUMNS = (
    ("success", "success", 3),
    ("hit first by a pedestrian", "first_hit_pedestrian", 3),
    ("hit first by an agent", "first_hit_agent", 3),
    ("timed out", "timed_out", 3),
    ("time of successes [s]", "completion_time_success", 1),
    ("time, censored [s]", "time_under_way", 1),
    ("path / displacement", "distance_to_displacement", 3),
    ("intimate intrusions [steps]", "intimate_intrusions", 1),
    ("share of steps within 1.2 m", "intrusion_share_of_steps", 3),
    ("speed [m/s]", "average_speed", 3),
)
"""Heading, measure and digits of the columns of report.md; all measures are in summary.csv."""

_TERMINAL_COLUMNS = (
    ("success", "success", 3),
    ("hit by\npeople", "first_hit_pedestrian", 3),
    ("hit by\nagent", "first_hit_agent", 3),
    ("timed\nout", "timed_out", 3),
    ("time\n[s]", "time_under_way", 1),
    ("path\nratio", "distance_to_displacement", 2),
    ("steps\n<1.2 m", "intimate_intrusions", 1),
    ("speed\n[m/s]", "average_speed", 2),
)
"""Fewer, for 80 characters; the first alone shows its error."""

_HOW_TO_READ = """\
Every cell is the mean over draws ± its standard error; a draw is one random choice of the people who are replaced, \
and its mean over agents is one number. The 95 % interval is a bootstrap over draws (none for fewer than 3 draws, too \
narrow for fewer than about 10). Controllers that share draws drove the same agents, so compare them draw by draw \
(`agents.parquet`). All other measures, defined in docs/metrics.md, are in `summary.csv`; every collision is a row of \
`tables/collisions.parquet`.

- **human**: the recorded people themselves, each on its own track instead of the agent that replaced it, scored by \
the same code. Their contacts come from geometry at the same radii. It is the row to compare with, not a target of 1.
- **success**: arrived, and touched nobody on the way, whoever was at fault; over all agents.
- **hit first by**: share of all agents whose first touch was with a replayed pedestrian, or with another agent.
- **timed out**: share of all agents whose deadline passed.
- **time of successes**: spawn to arrival, over successes alone. It flatters fragile controllers, whose successes are \
the short trips; **time, censored** is over everybody who spawned and takes the time watched where an agent did not \
arrive, a lower bound.
- **path / displacement**: path traced over the straight distance from start to goal, over arrivals. The path ends \
within the goal radius, so a straight run scores a little less than 1.
- **intimate intrusions**: control steps with a replayed pedestrian's centre nearer than 1.2 m (the paper's number and \
name; Hall's *personal* distance), per agent; **share** is over all steps under way. Other agents do not count.
- **speed**: path over time under way, arrived or not.
"""


@dataclass(frozen=True, kw_only=True)
class RunFile:
    """What run.json says of the episodes beside it."""

    command: str
    """That made them."""
    controllers: tuple[str, ...]
    """Their order in tables."""
    episodes: tuple[str, ...]
    """Names of all files that belong to the run."""


def write_report(folder: str | Path, *, console: Console | None = None, n_jobs: int = 1) -> Path:
    """Make everything in a run folder again, except its episodes.

    All episodes are read and scored before the first file is replaced, and every file is replaced whole, so that a
    damaged episode or an interruption loses nothing. Equal episodes give equal bytes (traces excepted).

    Args:
        folder: The run; holds `episodes/*.npz` and, if known, `run.json`.
        console: Where to print the tables; nowhere if None.
        n_jobs: Processes that read episodes.

    Returns:
        Path of report.md.

    Raises:
        FileNotFoundError: If there is no episode.
        EpisodeError: If an episode is damaged or does not fit the others; the file is named.
        ValueError: If run.json is not what is expected.
    """
    folder = Path(folder)
    run = read_run_file(folder / RUN_FILE)
    results = _results(folder, run, n_jobs)
    estimates = summarise(results.agents)
    differences = paired_differences(results.agents)
    files = _tables(run, results, estimates, differences)
    files |= {f"{_FIGURE}.{kind}": content for kind, content in paired_figure(differences).items()}
    for name, content in files.items():
        write_whole(folder / name, content)
    _write_traces(folder, results.sources)
    if console is not None:
        for table in terminal_tables(estimates):
            console.print(table)
    return folder / "report.md"


def report_tables(folder: str | Path, *, n_jobs: int = 1) -> dict[str, bytes]:
    """The tables that `write_report` makes of the episodes of a run, without writing them.

    Args:
        folder: See `write_report`.
        n_jobs: Processes that read episodes.

    Returns:
        Content by name of the file in the folder.

    Raises:
        FileNotFoundError: If there is no episode.
        EpisodeError: See `write_report`.
        ValueError: If run.json is not what is expected.
    """
    run = read_run_file(Path(folder) / RUN_FILE)
    results = _results(Path(folder), run, n_jobs)
    return _tables(run, results, summarise(results.agents), paired_differences(results.agents))


def _results(folder: Path, run: RunFile | None, n_jobs: int) -> Results:
    return read_results(folder, controllers=() if run is None else run.controllers, n_jobs=n_jobs)


def _tables(
    run: RunFile | None, results: Results, estimates: Sequence[Estimate], differences: Sequence[Estimate]
) -> dict[str, bytes]:
    summary = _summary(results, estimates, None if run is None else run.command)
    sections = [
        *paired_section(differences, f"{_FIGURE}.svg"),
        *fault_section(results.agents, results.contacts, results.overlaps),
        *severity_section(results.contacts),
        *draws_section(resolutions(results.agents)),
    ]
    return {
        "agents.parquet": _parquet(results.agents),
        "tables/collisions.parquet": _parquet(results.contacts),
        "tables/paired.csv": _csv(differences),
        "summary.csv": _csv(estimates),
        "summary.json": (json.dumps(summary, indent=1, sort_keys=True, allow_nan=False) + "\n").encode(),
        "report.md": _markdown(summary, estimates, sections).encode(),
    }


def terminal_tables(estimates: Sequence[Estimate]) -> list[Table]:
    """One table for each scenario, for a terminal.

    Args:
        estimates: Of `estimates.summarise`.

    Returns:
        Tables with a row for each controller, in the estimates' order.
    """
    tables = []
    for (dataset, variant, scenario), rows in _by_scenario(estimates):
        n_draws = max(row["success"].n_draws for _, row in rows)
        table = Table(
            title=Text(f"{dataset} ({variant}), {scenario}"),
            caption=f"means over {n_draws} draw(s), ± standard error; times count time-outs",
            box=box.SIMPLE_HEAD,
            padding=0,
        )
        table.add_column("controller", overflow="fold")
        for heading, _, _ in _TERMINAL_COLUMNS:
            table.add_column(Text(heading), justify="right")
        for controller, own in rows:
            means = [f"{own[measure].mean:.{digits}f}" for _, measure, digits in _TERMINAL_COLUMNS[1:]]
            table.add_row(Text(controller), _cell(own["success"], _TERMINAL_COLUMNS[0][2]), *means)
        tables.append(table)
    return tables


def _by_scenario(
    estimates: Sequence[Estimate],
) -> Iterator[tuple[tuple[str, str, str], list[tuple[str, dict[str, Estimate]]]]]:
    for scenario, group in groupby(estimates, key=lambda e: (e.dataset, e.variant, e.scenario)):
        rows = groupby(group, key=lambda e: e.controller)
        yield scenario, [(controller, {e.measure: e for e in row}) for controller, row in rows]


def _cell(estimate: Estimate, digits: int) -> str:
    error = "" if math.isnan(estimate.standard_error) else f" ± {number(estimate.standard_error, digits)}"
    return number(estimate.mean, digits) + error


def _summary(results: Results, estimates: Sequence[Estimate], command: str | None) -> dict[str, Any]:
    """The JSON form: estimates of every group, and where they come from."""
    groups = []
    for key, group in groupby(results.sources, key=lambda s: s.group):
        sources = list(group)
        own = [e for e in estimates if (e.dataset, e.variant, e.scenario, e.controller) == key]
        groups.append(
            {
                **dict(zip(("dataset", "variant", "scenario", "controller"), key, strict=True)),
                "scenario_configuration": scenario_configuration(sources[0]),
                "controller_configuration": sources[0].metadata["controller_config"],
                "recording": sources[0].metadata["recording"],
                "n_agents": max((e.n_agents for e in own), default=0),
                "draws": [s.draw for s in sources],
                "episodes": [{"file": s.file, "draw": s.draw, "state_hash": s.metadata["state_hash"]} for s in sources],
                "estimates": {e.measure: _estimate_json(e) for e in own},
            }
        )
    return {
        "format": SUMMARY_FORMAT,
        "command": command,
        "versions": _distinct(s.metadata.get("versions", {}) for s in results.sources),
        "recordings": _distinct(s.metadata["recording"] for s in results.sources),
        "groups": groups,
        "warnings": _warnings(results.sources),
    }


def _estimate_json(estimate: Estimate) -> dict[str, Any]:
    values = {name: getattr(estimate, name) for name in ("mean", "standard_error", "low", "high")}
    clean: dict[str, Any] = {name: None if math.isnan(value) else value for name, value in values.items()}
    return clean | {"n_draws": estimate.n_draws, "n_agents": estimate.n_agents, "note": estimate.note}


def _distinct(values: Any) -> list[Any]:
    return [json.loads(text) for text in sorted({json.dumps(value, sort_keys=True) for value in values})]


def _warnings(sources: Sequence[Source]) -> list[str]:
    warnings = []
    if len(_distinct(s.metadata.get("versions", {}) for s in sources)) > 1:
        warnings.append("the episodes were made by different versions of the software")
    for scenario, group in groupby(sources, key=lambda s: s.group[:3]):
        draws: dict[str, list[int]] = {}
        for source in group:
            draws.setdefault(source.group[3], []).append(source.draw)
        if len({tuple(d) for d in draws.values()}) > 1:
            listed = "; ".join(f"{name}: {', '.join(map(str, d))}" for name, d in draws.items())
            warnings.append(f"the rows of {' / '.join(scenario)} have different draws ({listed})")
    return warnings


def _markdown(summary: dict[str, Any], estimates: Sequence[Estimate], sections: Sequence[str]) -> str:
    lines = ["# Report", ""]
    lines += [f"Command: {code(summary['command'])}" if summary["command"] else "Command: not recorded (no run.json)."]
    lines += ["", "Made from the episode files alone; `socialnav-mj report FOLDER` makes it again.", ""]
    lines += [f"**Warning**: {plain(warning)}.\n" for warning in summary["warnings"]]
    headings = ["controller", "success", "95 % interval", *(heading for heading, _, _ in _COLUMNS[1:])]
    for (dataset, variant, scenario), rows in _by_scenario(estimates):
        share = next(
            g["scenario_configuration"]["share"]
            for g in summary["groups"]
            if (g["dataset"], g["variant"], g["scenario"]) == (dataset, variant, scenario)
        )
        lines += [f"## {plain(f'{dataset} ({variant}), {scenario}')}: {100 * share:g} % of the people replaced", ""]
        lines += head([*headings, "draws", "agents"])
        for controller, own in rows:
            cells = [_cell(own[measure], digits) for _, measure, digits in _COLUMNS]
            counts = [str(own["success"].n_draws), str(own["success"].n_agents)]
            lines.append(
                row([controller, cells[0], bounds(own["success"].low, own["success"].high), *cells[1:], *counts])
            )
        lines.append("")
    lines += sections
    lines += ["## How to read it", "", _HOW_TO_READ, "## Traceability", "", "Recordings:", ""]
    recordings = (f"{r['name']}, variant {r['variant']}, checksum {r['checksum']}" for r in summary["recordings"])
    lines += [f"- {plain(text)}" for text in recordings]
    lines += ["", "Versions:", ""]
    versions = (", ".join(f"{name} {version}" for name, version in v.items()) for v in summary["versions"])
    lines += [f"- {plain(text)}" for text in versions]
    lines += ["", "Configurations (the draw's seed apart):", ""]
    configurations: dict[str, Any] = {}
    for group in summary["groups"]:
        dataset = f"{group['dataset']} ({group['variant']})"
        configurations[f"{group['scenario']} of {dataset}"] = group["scenario_configuration"]
        configurations[f"{group['controller']} on {dataset}"] = group["controller_configuration"]
    lines += [
        f"- {plain(name)}: {code(json.dumps(value, sort_keys=True))}" for name, value in sorted(configurations.items())
    ]
    lines += ["", "Episodes:", "", *head(["file", "draw", "state hash"])]
    lines += [
        row([e["file"], str(e["draw"]), e["state_hash"]]) for group in summary["groups"] for e in group["episodes"]
    ]
    return "\n".join(lines) + "\n"


def _csv(estimates: Sequence[Estimate]) -> bytes:
    return csv_bytes([field.name for field in fields(Estimate)], map(asdict, estimates))


def _parquet(table: pa.Table) -> bytes:
    sink = pa.BufferOutputStream()
    pa.parquet.write_table(table, sink)
    return bytes(sink.getvalue().to_pybytes())


def read_run_file(path: Path) -> RunFile | None:
    """Read run.json.

    Args:
        path: The file.

    Returns:
        What it says; None if there is no such file.

    Raises:
        ValueError: If it is not what is expected; says what is.
    """
    if not path.exists():
        return None
    try:
        run = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not JSON: {error}") from error
    lists = ("controllers", "episodes")
    if (
        not isinstance(run, dict)
        or not isinstance(run.get("command"), str)
        or not all(isinstance(run.get(key), list) and all(isinstance(v, str) for v in run[key]) for key in lists)
    ):
        expected = '{"command": a string, "controllers": [names in their order], "episodes": [names of files]}'
        raise ValueError(f"{path}: expected {expected}; given {str(run)[:200]}")
    return RunFile(command=run["command"], controllers=tuple(run["controllers"]), episodes=tuple(run["episodes"]))


def _write_traces(folder: Path, sources: Sequence[Source]) -> None:
    """One trace for each scenario and controller, of its first draw, named after the episode."""
    from socialnav_mj.trace.writer import write_trace  # rerun is slow to import

    for _, group in groupby(sources, key=lambda s: s.group):
        first = next(group)
        write_trace(Episode.load(folder / "episodes" / first.file), folder / "traces" / f"{Path(first.file).stem}.rrd")
