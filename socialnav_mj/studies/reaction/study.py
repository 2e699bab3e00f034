"""The reaction study: replay, weak and yielding people, and what becomes of the ranking."""

from socialnav_mj.studies.condition_files import Subject
from socialnav_mj.studies.conditions import conditions_of
from socialnav_mj.studies.reaction.page import reaction_page

_RANKED = ("success", "intrusion_share_of_steps")
REACTION = Subject(
    conditions=conditions_of("replay", "weak", "yielding"),
    measures=(
        *_RANKED,
        "deviation_imposed",
        "delay_imposed",
        "time_under_way",
        "first_hit_pedestrian",
        "first_hit_agent",
        "timed_out",
    ),
    ranked=_RANKED,
    slopes=(
        ("success", "share that succeeds"),
        ("intrusion_share_of_steps", "share of steps within 1.2 m"),
        ("deviation_imposed", "imposed deviation [m]"),
        ("delay_imposed", "imposed delay [s]"),
    ),
    page=reaction_page,
)
