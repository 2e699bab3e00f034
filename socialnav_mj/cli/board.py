"""The sub-command `leaderboard`."""

from dataclasses import dataclass
from pathlib import Path

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
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            seed=self.seed,
        )
        run_study(
            study,
            leaderboard.write_leaderboard,
            leaderboard.PUBLIC,
            out=self.out,
            jobs=self.jobs,
            publish_to=self.publish,
            making="tables and figure",
            label="leaderboard",
        )
