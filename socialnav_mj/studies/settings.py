"""Settings in which studies run their controllers, by name."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from socialnav_mj.config import Scenario, TurnLimit


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What differs from the default scenarios."""

    title: str
    task_kwargs: Mapping[str, Any] = field(default_factory=dict)
    """Keyword arguments of the tasks."""

    @property
    def turn_limit(self) -> TurnLimit:
        """Under which its learned policies are to have been trained."""
        limit: TurnLimit = self.task_kwargs.get("turn_limit", Scenario.turn_limit)
        return limit


HEAVY = {"robot_model": "robot_heavy.xml", "robot_wheel_radius": 0.0985, "robot_track": 0.4044}
"""Keyword arguments of tasks with the heavier base; see assets/robot_heavy.xml."""
DEFAULT = "default"
SETTINGS: dict[str, Setting] = {
    DEFAULT: Setting(title="default"),
    "turn_per_second": Setting(
        title="turn limit per second, policies trained for it", task_kwargs={"turn_limit": "per_second"}
    ),
    "weak": Setting(title="people who give way weakly", task_kwargs={"pedestrians": "weak"}),
    "yielding": Setting(title="yielding people", task_kwargs={"pedestrians": "yielding"}),
    "unicycle": Setting(title="ideal unicycle", task_kwargs={"plant": "unicycle"}),
    "heavy": Setting(title="base of 28 kg, 1 m/s^2", task_kwargs=HEAVY),
    "slippery": Setting(title="floor friction 0.3", task_kwargs={"floor_friction": 0.3}),
    "radii_0.25": Setting(title="radii sum 0.25 m", task_kwargs={"pedestrian_radius": 0.08}),
    "radii_0.40": Setting(title="radii sum 0.40 m", task_kwargs={"pedestrian_radius": 0.23}),
    "retire": Setting(title="retire on collision", task_kwargs={"on_collision": "retire"}),
}
