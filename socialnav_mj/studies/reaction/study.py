"""The reaction study: replay, weak and yielding people, and what becomes of the ranking."""

from pathlib import Path

from socialnav_mj.studies.condition_files import write_conditions
from socialnav_mj.studies.conditions import ConditionStudy, conditions_of
from socialnav_mj.studies.reaction.page import reaction_page

LEVELS = conditions_of("replay", "weak", "yielding")
RANKED = ("success", "intrusion_share_of_steps")
"""Measures whose ranking of controllers is compared."""
MEASURES = (
    *RANKED,
    "deviation_imposed",
    "delay_imposed",
    "time_under_way",
    "first_hit_pedestrian",
    "first_hit_agent",
    "timed_out",
)
"""What is told of every controller and level."""
PUBLIC = ("README.md", "provenance.json", "tables", "figures")
"""What may travel with the project: no recordings, no episodes."""
_SLOPES = (
    ("success", "share that succeeds"),
    ("intrusion_share_of_steps", "share of steps\nwithin 1.2 m"),
    ("deviation_imposed", "imposed\ndeviation [m]"),
    ("delay_imposed", "imposed\ndelay [s]"),
)


def write_reaction(study: ConditionStudy, out: Path, *, command: str, n_jobs: int = -1) -> Path:
    """Make everything in the study's folder again, except its episodes.

    Args:
        study: That was run by `study.reproduce`; its conditions are `LEVELS`.
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
        figure="slopes",
        page=reaction_page,
        tables={},
        command=command,
        n_jobs=n_jobs,
    )
