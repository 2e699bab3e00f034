"""What a study of conditions leaves behind, whatever its conditions are."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from socialnav_mj.recordings import load_recording
from socialnav_mj.studies.conditions import Comparison, Condition, ConditionStudy, compare
from socialnav_mj.studies.files import write_csv, write_pages, write_provenance
from socialnav_mj.studies.ranking import TURNED, turned_rows
from socialnav_mj.studies.slopes import draw_slopes
from socialnav_mj.studies.study import read_runs


@dataclass(frozen=True, kw_only=True)
class Subject:
    """What a study of conditions is about, and how it is told."""

    conditions: tuple[Condition, ...]
    """The first is what the others are compared with."""
    measures: Sequence[str]
    """What is told of every controller and condition."""
    ranked: Sequence[str]
    """Of these, by which the ranking of controllers is compared."""
    slopes: Sequence[tuple[str, str]]
    """Measure and label of the axis of each figure, in the order of the page."""
    page: Callable[..., str]
    """Text of README.md, of the comparisons, `figures` (recording: Markdown lines) and `provenance`."""
    tables: Mapping[str, Callable[[Sequence[Comparison]], Sequence[Mapping[str, Any]]]] = field(default_factory=dict)
    """Name of a table beside those of all studies: its rows."""


def write_conditions(subject: Subject, study: ConditionStudy, out: Path, *, command: str, n_jobs: int = -1) -> Path:
    """Make everything in the study's folder again, except its episodes.

    Args:
        subject: What it is about.
        study: That was run by `study.reproduce`; its conditions are the subject's.
        out: Its folder; gets tables/, figures/, README.md, report.html and provenance.json.
        command: That made it.
        n_jobs: Processes that score episodes.

    Returns:
        Path of README.md.

    Raises:
        FileNotFoundError: If a run has no episodes.
        EpisodeError: If an episode is damaged or does not fit the others.
    """
    results = read_runs(study, out, n_jobs=n_jobs)
    found = [compare(study, results, recording, subject.measures, subject.ranked) for recording in study.recordings]
    write_csv(out / "tables" / "levels.csv", [row for own in found for row in own.level_rows()])
    write_csv(out / "tables" / "differences.csv", [row for own in found for row in own.difference_rows()])
    write_csv(out / "tables" / "ranking.csv", [row for own in found for row in own.tau_rows()])
    write_csv(out / "tables" / "turned_over.csv", turned_rows(found), TURNED)
    for name, rows in subject.tables.items():
        write_csv(out / "tables" / f"{name}.csv", rows(found))
    figures = {own.recording: _draw(subject, own, out / "figures") for own in found}
    recordings = [load_recording(recording, data_dir=study.data_dir) for recording in study.recordings]
    provenance = write_provenance(study, results, recordings, out, command=command)
    return write_pages(out, subject.page(found, figures=figures, provenance=provenance), results, command=command)


def _draw(subject: Subject, own: Comparison, folder: Path) -> list[str]:
    """Draw all figures of a recording; the lines of Markdown that show them."""
    lines = []
    for measure, label in subject.slopes:
        name = f"{measure}_{own.recording}"
        draw_slopes(own, measure, label, folder, name)
        lines += [f"![{label}, {own.recording}]({folder.name}/{name}.png)", ""]
    return lines
