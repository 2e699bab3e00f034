"""The sub-command `leaderboard`."""

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from socialnav_mj.cli.arguments import Folder, Scenarios
from socialnav_mj.cli.study import run_study


@dataclass(frozen=True, kw_only=True)
class Leaderboard:
    """Run every controller on several recordings, and rank them as surely as the draws allow.

    Writes tables, a figure and a page: levels with intervals, rank sets that hold together, fronts of success against
    nearness to people and against time. If a run is interrupted, repeat the command to resume it.
    """

    recordings: tuple[str, ...] = ("students003", "zara01", "zara02", "plaza")
    """Names in the catalogue, or paths."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    controllers: tuple[str, ...] = ()
    """As in `evaluate`; all built-in ones by default."""
    also: tuple[str, ...] = ()
    """Controllers that join them."""
    trainings: int = 3
    """Of controllers that learned and have as many, those with the least seeds."""
    settings: tuple[str, ...] = ()
    """Other settings in which the first recording is run: turn_per_second, radii_0.25, radii_0.40, retire."""
    setting_draws: int | None = None
    """Draws in these; all by default."""
    costs: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """JSON file of `bench --controllers ... --out FILE`: what each controller costs stands beside its results."""
    scenarios: Scenarios = (1, 2, 3, 4)
    """Scenarios to run."""
    draws: int = 20
    """Random choices of the replaced people."""
    seed: int = 100
    """Seed of the first draw; the others count up from it. Draws below 100 are for choosing, not for reporting."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    out: Path = Path("leaderboard")
    """Folder of the results."""
    publish: Folder = None
    """Folder that gets a copy of tables, figure and page: all that holds no recording and no episode."""

    def run(self) -> None:
        """Run what is missing behind a bar, then write tables, figure and page, and copy them if asked to."""
        from socialnav_mj.studies.leaderboard import study as leaderboard

        study = leaderboard.Leaderboard(
            recordings=self.recordings,
            controllers=(*(self.controllers or leaderboard.CONTROLLERS), *self.also),
            data_dir=None if self.data_dir is None else str(self.data_dir),
            trainings=self.trainings,
            settings=self.settings,
            setting_draws=self.setting_draws,
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            seed=self.seed,
        )
        run_study(
            study,
            partial(leaderboard.write_leaderboard, costs=None if self.costs is None else read_costs(self.costs)),
            leaderboard.PUBLIC,
            out=self.out,
            jobs=self.jobs,
            publish_to=self.publish,
            making="tables and figure",
            label="leaderboard",
        )


def read_costs(path: Path) -> dict[str, float]:
    """What controllers cost, from a file of `bench --controllers ... --out FILE`.

    Args:
        path: The file.

    Returns:
        Controller: its CPU time over that of the physics.

    Raises:
        ValueError: If the file is not one of those.
        FileNotFoundError: If it is not there.
    """
    try:
        return {str(row["controller"]): float(row["ratio"]) for row in json.loads(path.read_text())["controllers"]}
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(
            f"{path} is not a file of `socialnav-mj bench --controllers ... --out FILE`: {error!r}"
        ) from error
