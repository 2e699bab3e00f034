"""The plant study: wheels, an ideal unicycle, a heavier base and a slippery floor."""

from pathlib import Path

from socialnav_mj.studies.condition_files import write_conditions
from socialnav_mj.studies.conditions import ConditionStudy, conditions_of
from socialnav_mj.studies.plant.page import plant_page, verdict_rows

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
    return write_conditions(
        study,
        out,
        measures=MEASURES,
        ranked=RANKED,
        slopes=_SLOPES,
        figure="plants",
        page=plant_page,
        tables={"verdicts": verdict_rows},
        command=command,
        n_jobs=n_jobs,
    )
