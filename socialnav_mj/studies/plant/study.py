"""The plant study: wheels, an ideal unicycle, a heavier base and a slippery floor."""

from pathlib import Path

from socialnav_mj.recordings import load_recording
from socialnav_mj.studies.conditions import ConditionStudy, compare, conditions_of
from socialnav_mj.studies.files import write_csv, write_pages, write_provenance
from socialnav_mj.studies.plant.page import plant_page, verdict_rows
from socialnav_mj.studies.slopes import draw_slopes
from socialnav_mj.studies.study import read_runs

PLANTS = conditions_of("wheels", "unicycle", "heavy", "slippery")
RANKED = ("success", "intrusion_share_of_steps", "time_under_way")
"""Measures whose ranking of controllers is compared."""
MEASURES = (
    *RANKED,
    "first_hit_pedestrian",
    "first_hit_agent",
    "timed_out",
    "tracking_error",
    "side_slip",
    "unmet_share",
    "stopping_distance",
)
"""What is told of every controller and plant."""
PUBLIC = ("README.md", "provenance.json", "tables", "figures")
"""What may travel with the project: no recordings, no episodes."""
_SLOPES = (
    ("success", "share that succeeds"),
    ("time_under_way", "time, censored [s]"),
    ("tracking_error", "tracking error\na step [m]"),
)


def write_plant(study: ConditionStudy, out: Path, *, command: str, n_jobs: int = -1) -> Path:
    """Make everything in the study's folder again, except its episodes.

    Args:
        study: That was run by `study.reproduce`; its conditions are `PLANTS`.
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
    found = [compare(study, results, recording, MEASURES, RANKED) for recording in study.recordings]
    write_csv(out / "tables" / "levels.csv", [row for own in found for row in own.level_rows()])
    write_csv(out / "tables" / "differences.csv", [row for own in found for row in own.difference_rows()])
    write_csv(out / "tables" / "ranking.csv", [row for own in found for row in own.tau_rows()])
    write_csv(out / "tables" / "verdicts.csv", verdict_rows(found))
    for own in found:
        draw_slopes(own, _SLOPES, out / "figures", f"plants_{own.recording}")
    recordings = [load_recording(recording, data_dir=study.data_dir) for recording in study.recordings]
    provenance = write_provenance(study, results, recordings, out, command=command)
    return write_pages(out, plant_page(found, provenance=provenance), results, command=command)
