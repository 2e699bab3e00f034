"""The sub-commands of all controllers side by side: `leaderboard`, `reaction` and `plant`."""

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tyro

from socialnav_mj.cli.arguments import LOCAL, Folder, Scenarios, Where
from socialnav_mj.cli.console import say
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
    setting_controllers: tuple[str, ...] = ()
    """Those of the controllers that run in these; all by default."""
    other_draws: int | None = None
    """Draws on the other recordings and in the other settings; all by default."""
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
    where: Where = LOCAL
    out: Path = Path("leaderboard")
    """Folder of the results."""
    publish: Folder = None
    """Folder that gets a copy of tables, figure and page: all that holds no recording and no episode."""

    def run(self) -> None:
        """Run what is missing behind a bar, then write tables, figure and page, and copy them if asked to."""
        from socialnav_mj.studies.files import PUBLIC
        from socialnav_mj.studies.leaderboard import study as leaderboard
        from socialnav_mj.studies.study import CONTROLLERS

        study = leaderboard.Leaderboard(
            recordings=self.recordings,
            controllers=(*(self.controllers or CONTROLLERS), *self.also),
            data_dir=None if self.data_dir is None else str(self.data_dir),
            trainings=self.trainings,
            settings=self.settings,
            setting_controllers=self.setting_controllers,
            other_draws=self.other_draws,
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            seed=self.seed,
        )
        run_study(
            study,
            partial(leaderboard.write_leaderboard, costs=None if self.costs is None else read_costs(self.costs)),
            PUBLIC,
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


@dataclass(frozen=True, kw_only=True)
class _Conditions:
    """Options of both studies of conditions."""

    recordings: tuple[str, ...] = ("students003", "zara01", "plaza")
    """Names in the catalogue, or paths."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    controllers: tuple[str, ...] = ()
    """As in `evaluate`; those of the leaderboard by default."""
    also: tuple[str, ...] = ()
    """Controllers that join them."""
    scenarios: Scenarios = (1, 2, 3, 4)
    """Scenarios to run."""
    draws: int = 10
    """Random choices of the replaced people."""
    other_draws: int | None = None
    """Draws on the recordings behind the first; all by default."""
    seed: int = 100
    """Seed of the first draw; the others count up from it. Draws below 100 are for choosing, not for reporting."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL
    publish: Folder = None
    """Folder that gets a copy of tables, figures and page: all that holds no recording and no episode."""

    out: Path
    """Folder of the results."""

    def run_on(self, subject: Any) -> None:
        """Run what is missing behind a bar, then write tables, figures and page, and copy them if asked to.

        Args:
            subject: A `studies.condition_files.Subject`.
        """
        from socialnav_mj.studies.condition_files import write_conditions
        from socialnav_mj.studies.conditions import ConditionStudy
        from socialnav_mj.studies.files import PUBLIC
        from socialnav_mj.studies.study import CONTROLLERS

        study = ConditionStudy(
            recordings=self.recordings,
            conditions=subject.conditions,
            controllers=(*(self.controllers or CONTROLLERS), *self.also),
            data_dir=None if self.data_dir is None else str(self.data_dir),
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            other_draws=self.other_draws,
            seed=self.seed,
        )
        run_study(
            study,
            partial(write_conditions, subject),
            PUBLIC,
            out=self.out,
            jobs=self.jobs,
            publish_to=self.publish,
            making="tables and figures",
        )


@dataclass(frozen=True, kw_only=True)
class Reaction(_Conditions):
    """Run every controller among people who keep to the recording, give way weakly, and give way as to each other.

    Writes slope charts, tables and a page: what becomes of success, nearness and the ranking, and what robots cost the
    people. If a run is interrupted, repeat the command to resume it.
    """

    out: Path = Path("reaction")
    """Folder of the results."""

    def run(self) -> None:
        """Run the study."""
        from socialnav_mj.studies.reaction.study import REACTION

        self.run_on(REACTION)


@dataclass(frozen=True, kw_only=True)
class Plant(_Conditions):
    """Run every controller on wheels, on an ideal unicycle, on a heavier base and on a slippery floor.

    Writes charts, tables and a page: what a kinematic simulator would have told wrongly of each controller. If a run is
    interrupted, repeat the command to resume it.
    """

    out: Path = Path("plant")
    """Folder of the results."""

    def run(self) -> None:
        """Run the study."""
        from socialnav_mj.studies.plant.study import PLANT

        self.run_on(PLANT)


@dataclass(frozen=True, kw_only=True)
class PeopleAsRobots:
    """Let each person's own recorded track play a robot, and see how far its neighbours, who have reacted, are moved.

    Writes tables, a figure and a page; simulates no robots. Beside it the same tracks some seconds late, as strangers
    whom nobody has reacted to yet.
    """

    recordings: tuple[str, ...] = ("zara01", "zara02")
    """Names in the catalogue, or paths. The strengths are chosen on these two."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    strengths: tuple[float, ...] = ()
    """k of the push; those of the levels by default [m^2]."""
    late: float = 8.0
    """By which strangers are late [s]."""
    out: Path = Path("people_as_robots")
    """Folder of the results."""

    def run(self) -> None:
        """Compute, write, and print a line for each recording and strength."""
        from socialnav_mj.recordings import load_recording
        from socialnav_mj.studies.reaction.people_as_robots import write_test

        data_dir = None if self.data_dir is None else str(self.data_dir)
        recordings = [load_recording(name, data_dir=data_dir) for name in self.recordings]
        page, lines = write_test(recordings, self.out, strengths=self.strengths, late=self.late)
        for line in lines:
            say(line)
        say(f"report: {page}")
