"""The plant study: wheels, an ideal unicycle, a heavier base and a slippery floor."""

from socialnav_mj.studies.condition_files import Subject
from socialnav_mj.studies.conditions import conditions_of
from socialnav_mj.studies.plant.page import plant_page, verdict_rows

_RANKED = ("success", "intrusion_share_of_steps", "time_under_way")
PLANT = Subject(
    conditions=conditions_of("wheels", "unicycle", "heavy", "slippery"),
    measures=(
        *_RANKED,
        "first_hit_pedestrian",
        "first_hit_agent",
        "timed_out",
        "tracking_error",
        "side_slip",
        "unmet_share",
        "stopping_distance",
    ),
    ranked=_RANKED,
    slopes=(
        ("success", "share that succeeds"),
        ("time_under_way", "time, censored [s]"),
        ("tracking_error", "tracking error a step [m]"),
    ),
    page=plant_page,
    tables={"verdicts": verdict_rows},
)
