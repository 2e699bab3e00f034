"""The four scenarios of the paper as a dm_control domain: a face of `socialnav_mj.suite`.

Nothing of socialnav_mj imports this name, so that a file `tasks.py` in somebody's folder stands in nobody's way.
"""

from socialnav_mj.config import SHARES
from socialnav_mj.suite import (
    ALL_TASKS,
    DOMAIN,
    SUITE,
    load,
    register_with_dm_control,
    scenario_1,
    scenario_2,
    scenario_3,
    scenario_4,
)

__all__ = [
    "ALL_TASKS",
    "DOMAIN",
    "SHARES",
    "SUITE",
    "load",
    "register_with_dm_control",
    "scenario_1",
    "scenario_2",
    "scenario_3",
    "scenario_4",
]
