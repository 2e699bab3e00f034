"""What the environments of a scenario have in common: recording, scenario, and how agents see and act."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from socialnav_mj.config import SHARES, Scenario
from socialnav_mj.controllers.base import ActionKind
from socialnav_mj.envs import SCENARIOS
from socialnav_mj.features.seen import Kind, Observer, observer_of
from socialnav_mj.recordings import Recording, load_recording


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Resolved settings of an environment."""

    recording: Recording
    """Whose people are replaced and replayed."""
    scenario: Scenario
    """All but the draw."""
    observer: Observer
    """What an agent sees."""
    action: ActionKind
    """What an action means."""

    @classmethod
    def of(
        cls,
        scenario: int,
        *,
        dataset: str | Path | Recording = "plaza",
        variant: str | None = None,
        data_dir: str | Path | None = None,
        observation: Kind = "flat",
        features: str = "continuous",
        people: int = 12,
        action: ActionKind = "twist",
        **changes: Any,
    ) -> "Settings":
        """Resolve keyword arguments of an environment.

        Args:
            scenario: 1 to 4, the paper's; it gives the share of replaced people.
            dataset: Name in the catalogue, path of a recording, or a recording.
            variant: Which annotation of the recording; None is the default one.
            data_dir: Where recordings are looked for first.
            observation: "flat" for one array of features, "dict" for arrays by name.
            features: Feature set of a flat observation, see `socialnav_mj.features`.
            people: Nearest people in a dictionary.
            action: "twist" for (speed, turn), "wheels" for (left, right).
            **changes: Settings of `socialnav_mj.config.Scenario` that differ, as for `tasks.load`; a collision ends a
                run unless on_collision="continue".

        Returns:
            The settings.

        Raises:
            ValueError: If something is unknown or not allowed.
            FileNotFoundError: If the recording is not there.
        """
        if scenario not in SCENARIOS:
            raise ValueError(f"scenario = {scenario!r} is not allowed; allowed: {', '.join(map(str, SCENARIOS))}")
        if action not in get_args(ActionKind):
            raise ValueError(f"action = {action!r} is not allowed; allowed: {', '.join(get_args(ActionKind))}")
        if "seed" in changes:
            raise ValueError("seed is not allowed here; allowed: reset(seed=...), or the option draw")
        own = {"share": SHARES[f"scenario_{scenario}"], "on_collision": "retire", **changes}
        if not isinstance(dataset, Recording):
            dataset = load_recording(dataset, variant=variant, data_dir=data_dir)
        return cls(
            recording=dataset,
            scenario=Scenario().changed(**own),
            observer=observer_of(observation, features=features, people=people),
            action=action,
        )
