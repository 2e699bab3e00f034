"""Run folder -> agents.parquet, summaries, reports, tables, figures and traces; everything but the episodes."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import groupby
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet

from socialnav_mj.episode import Episode
from socialnav_mj.files import csv_bytes, write_whole
from socialnav_mj.metrics.metric import Metric
from socialnav_mj.metrics.registry import METRICS
from socialnav_mj.report.agents import Source
from socialnav_mj.report.dialects import dialect_estimates
from socialnav_mj.report.estimates import Estimate, measures_of, summarise
from socialnav_mj.report.html import html_page
from socialnav_mj.report.own_metrics import own_metrics
from socialnav_mj.report.own_section import own_section
from socialnav_mj.report.page import report_page
from socialnav_mj.report.paired import paired_differences
from socialnav_mj.report.power import resolutions
from socialnav_mj.report.results import Results, read_results
from socialnav_mj.report.run_file import RUN_FILE, RunFile, read_run_file, write_run_file
from socialnav_mj.report.run_tables import run_blocks
from socialnav_mj.report.sections import draws_section, fault_section, paired_section, severity_section
from socialnav_mj.report.summary import summary_of

PAGE = "report.html"
"""Beside report.md."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """What was made of a run."""

    path: Path
    """Of report.md."""
    page: Path
    """Of report.html."""
    estimates: tuple[Estimate, ...]
    """In the order of the tables."""


def write_report(
    folder: str | Path, *, dialects: Sequence[str] = (), metrics: Sequence[str] = (), n_jobs: int = 1
) -> Report:
    """Make everything in a run folder again, except its episodes.

    All episodes are read and scored before the first file is replaced, and every file is replaced whole, so that a
    damaged episode or an interruption loses nothing. Equal episodes give equal bytes (traces excepted).

    Args:
        folder: The run; holds `episodes/*.npz` and, if known, `run.json`.
        dialects: Other benchmarks whose definitions of the metrics get a table of their own, see
            `metrics.dialects.DIALECTS`.
        metrics: Own metrics that the tables get too, as `own_metrics.own_metrics` takes them.
        n_jobs: Processes that read episodes.

    Returns:
        Where it is, and the estimates in it.

    Raises:
        FileNotFoundError: If there is no episode.
        EpisodeError: If an episode is damaged or does not fit the others; the file is named.
        ValueError: If run.json is not what is expected, or a dialect is unknown.
    """
    from socialnav_mj.report.paired_figure import draw_paired  # matplotlib is slow to import

    folder = Path(folder)
    run = read_run_file(folder / RUN_FILE)
    own = own_metrics(metrics)
    results = _results(folder, run, n_jobs, own=own)
    estimates = summarise(results.agents, measures_of((*METRICS, *own)))
    differences = paired_differences(results.agents)
    files = _tables(run, results, estimates, differences, own)
    for dialect in dialects:
        found = dialect_estimates(folder, results.sources, dialect, n_jobs=n_jobs)
        files[f"tables/dialect_{dialect}.csv"] = _csv(found)
    if run is not None and run.metrics != tuple(metrics):
        write_run_file(folder / RUN_FILE, replace(run, metrics=tuple(metrics)))
    for name, content in files.items():
        write_whole(folder / name, content)
    draw_paired(differences, folder / "figures")
    write_whole(folder / PAGE, _page(folder, run, results, estimates, differences, own))
    _write_traces(folder, results.sources)
    return Report(path=folder / "report.md", page=folder / PAGE, estimates=tuple(estimates))


def report_tables(folder: str | Path, *, metrics: Sequence[str] = (), n_jobs: int = 1) -> dict[str, bytes]:
    """The tables that `write_report` makes of the episodes of a run, all scored anew, without writing them.

    Args:
        folder: See `write_report`.
        metrics: See `write_report`.
        n_jobs: Processes that read episodes.

    Returns:
        Content by name of the file in the folder. The figures in report.html are those that are there.

    Raises:
        FileNotFoundError: If there is no episode.
        EpisodeError: See `write_report`.
        ValueError: If run.json is not what is expected.
    """
    run = read_run_file(Path(folder) / RUN_FILE)
    own = own_metrics(metrics)
    results = _results(Path(folder), run, n_jobs, own=own, anew=True)
    estimates = summarise(results.agents, measures_of((*METRICS, *own)))
    differences = paired_differences(results.agents)
    page = _page(Path(folder), run, results, estimates, differences, own)
    return _tables(run, results, estimates, differences, own) | {PAGE: page}


def _results(folder: Path, run: RunFile | None, n_jobs: int, *, own: tuple[Metric, ...], anew: bool = False) -> Results:
    metrics = (*METRICS, *own) if own else METRICS
    controllers = () if run is None else run.controllers
    return read_results(folder, controllers=controllers, metrics=metrics, n_jobs=n_jobs, anew=anew)


def _tables(
    run: RunFile | None,
    results: Results,
    estimates: Sequence[Estimate],
    differences: Sequence[Estimate],
    own: Sequence[Metric],
) -> dict[str, bytes]:
    summary = summary_of(results, estimates, None if run is None else run.command)
    sections = _sections(results, estimates, differences, own)
    return {
        "agents.parquet": _parquet(results.agents),
        "tables/collisions.parquet": _parquet(results.contacts),
        "tables/paired.csv": _csv(differences),
        "summary.csv": _csv(estimates),
        "summary.json": (json.dumps(summary, indent=1, sort_keys=True, allow_nan=False) + "\n").encode(),
        "report.md": report_page(summary, estimates, sections).encode(),
    }


def _sections(
    results: Results, estimates: Sequence[Estimate], differences: Sequence[Estimate], own: Sequence[Metric]
) -> list[str]:
    return [
        *own_section(estimates, measures_of(own)),
        *paired_section(differences, "figures/paired_humans.svg"),
        *fault_section(results.agents, results.contacts, results.overlaps),
        *severity_section(results.contacts),
        *draws_section(resolutions(results.agents)),
    ]


def _page(
    folder: Path,
    run: RunFile | None,
    results: Results,
    estimates: Sequence[Estimate],
    differences: Sequence[Estimate],
    own: Sequence[Metric],
) -> bytes:
    """report.html with the figures that are in the folder."""
    return html_page(run_blocks(results, estimates, _sections(results, estimates, differences, own), run), folder)


def _csv(estimates: Sequence[Estimate]) -> bytes:
    return csv_bytes([field.name for field in fields(Estimate)], map(asdict, estimates))


def _parquet(table: pa.Table) -> bytes:
    sink = pa.BufferOutputStream()
    pa.parquet.write_table(table, sink)
    return bytes(sink.getvalue().to_pybytes())


def _write_traces(folder: Path, sources: Sequence[Source]) -> None:
    """One trace for each scenario and controller, of its first draw, named after the episode."""
    from socialnav_mj.trace.writer import write_trace  # rerun is slow to import

    for _, group in groupby(sources, key=lambda s: s.group):
        first = next(group)
        write_trace(Episode.load(folder / "episodes" / first.file), folder / "traces" / f"{Path(first.file).stem}.rrd")
