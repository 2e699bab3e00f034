"""The sub-commands of one run: `evaluate`, `report`, `verify` and `draws`."""

import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.table import Table

from socialnav_mj.cli.arguments import LOCAL, Folder, Name, Scenarios, Where
from socialnav_mj.cli.console import console, counted_progress, errors, follow, say
from socialnav_mj.cli.recordings import describe
from socialnav_mj.cli.settings import Settings, changes
from socialnav_mj.recordings import DEFAULT_READING, Reading

if TYPE_CHECKING:
    from socialnav_mj.verification import Verdict


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Run scenarios with controllers, score them beside the recorded people, and write tables and traces.

    If a run is interrupted, repeat the command to resume it.
    """

    dataset: str = "plaza"
    """Name in the catalogue (see `list`), or path of a recording's file or folder."""
    variant: Name = None
    """Which annotation of the recording (see `data list`); the first by default."""
    data_dir: Folder = None
    """Where recordings are looked for first; then in $SOCIALNAV_MJ_DATA, then in the user cache."""
    reading: Reading = DEFAULT_READING
    scenarios: Scenarios = (1, 2, 3, 4)
    """Scenarios that replace 10, 30, 70, 90 % of the people."""
    controllers: tuple[str, ...] = ("potential_field", "go_straight")
    """Names (see `list`), package.module:Class, sb3:policy.zip, or any with settings:
    'potential_field(repulsion_gain=3.0)'.
    replay_irl and hybrid act with the shipped policy that learned from the recording, if there is one, else with
    plaza's."""
    trust: tuple[str, ...] = ()
    """Policies of stable-baselines3 among the controllers, as sb3:policy.zip; reading them runs the code in them."""
    draws: int = 3
    """Random choices of the replaced people; 10 or more for figures to publish."""
    seed: int = 0
    """Number of the first draw; the others count up from it. Draws below 100 are for choosing, others for reporting."""
    part: float | None = None
    """Write each episode in parts of so many seconds or a little more, for recordings of hours: no more than a part is
    ever in memory. Nothing that is simulated depends on it."""
    robot: Name = None
    """Robot: turtlebot4, jackal, or the path of an MJCF file with its limits in a TOML beside it."""
    metrics: tuple[str, ...] = ()
    """Own metrics that the tables get too: package.module:function of an Episode that gives a number for each agent."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL
    out: Folder = None
    """Folder of the results; runs/DATASET by default."""
    again: bool = False
    """Run episodes anew whose controller was edited since; the old ones move to superseded/."""
    keep: bool = False
    """Keep them, and run the edited controller beside them under a name of its own."""
    settings: Annotated[object, tyro.conf.arg(constructor=Settings)] = field(default_factory=Settings)
    """Settings of every scenario that is run."""

    def run(self) -> None:
        """Run what is missing behind a bar, write tables, report and traces, and print the main columns."""
        from socialnav_mj.cli.terminal import show
        from socialnav_mj.controllers import with_policy_of
        from socialnav_mj.controllers.specs import with_trust
        from socialnav_mj.evaluation import Evaluation, evaluate, jobs_of, recording_of
        from socialnav_mj.report.own_metrics import own_metrics
        from socialnav_mj.report.writer import write_report
        from socialnav_mj.resumption import ChangedError
        from socialnav_mj.robot_files import robot_settings

        if self.again and self.keep:
            raise ValueError("--again and --keep are both given; give one")
        own = [metric.name for metric in own_metrics(self.metrics)]
        evaluation = Evaluation(
            dataset=self.dataset,
            variant=self.variant,
            data_dir=None if self.data_dir is None else str(self.data_dir),
            reading=self.reading,
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            controllers=tuple(with_trust(with_policy_of(spec, self.dataset), self.trust) for spec in self.controllers),
            draws=self.draws,
            seed=self.seed,
            part=self.part,
            task_kwargs=({} if self.robot is None else robot_settings(self.robot)) | changes(self.settings),
        )
        out = self.out or Path("runs") / Path(self.dataset).resolve().stem
        say(describe(recording_of(evaluation)), errors)
        on_change: Any = "again" if self.again else "keep" if self.keep else "refuse"
        try:
            episodes = evaluate(evaluation, out, command=shlex.join(sys.argv), n_jobs=self.jobs, on_change=on_change)
        except ChangedError as error:
            raise ValueError(f"{error.told}; --again runs them anew, --keep keeps both") from error
        follow(episodes, jobs_of(evaluation))
        if not errors.is_terminal:
            say("tables and traces", errors)
        with errors.status("tables and traces"):
            report = write_report(out, metrics=self.metrics, n_jobs=self.jobs)
        show(report.estimates, own)
        say(_told_where(report.page, out))


@dataclass(frozen=True, kw_only=True)
class Report:
    """Make the tables, the report and the traces of a run again from its episodes."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FOLDER")]
    """Folder that `evaluate` wrote."""
    dialect: tuple[str, ...] = ()
    """Other benchmarks (paper, socnavbench, hunavsim, francis2023, crowdnav): tables/dialect_NAME.csv tells the metrics
    as they define them, see docs/metrics.md."""
    metrics: tuple[str, ...] = ()
    """Own metrics that the tables get too: package.module:function."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL

    def run(self) -> None:
        """Write everything that is computed from the episodes, and print the main columns."""
        from socialnav_mj.cli.terminal import show
        from socialnav_mj.report.own_metrics import own_metrics
        from socialnav_mj.report.writer import write_report

        own = [metric.name for metric in own_metrics(self.metrics)]
        report = write_report(self.folder, dialects=self.dialect, metrics=self.metrics, n_jobs=self.jobs)
        show(report.estimates, own)
        say(_told_where(report.page, self.folder))


def _told_where(page: Path, folder: Path) -> str:
    return f"report: {page} (report.md beside it)\ntraces: socialnav-mj view {shlex.quote(str(folder))}"


@dataclass(frozen=True, kw_only=True)
class Verify:
    """Run stored episodes again and compare everything that they say; exit code 1 if something differs."""

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")]
    """Folder that `evaluate` wrote, an episode (.npz), or a trace (.rrd)."""
    dataset: Name = None
    """Name or path of the recording; by default the one in the catalogue that each file names."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    trust: tuple[str, ...] = ()
    """package.module:Class or sb3:policy.zip that the files may have run, package.module:function of own metrics in
    tables; importing them runs their code. Built-in ones and those of installed packages need none."""
    trust_robot: tuple[Path, ...] = ()
    """MJCF files of robots, outside of the package's assets, that the files may name."""
    max_duration: float = Reading.max_duration
    """Longer recordings are refused [s]."""
    max_gap: float = Reading.max_gap
    """Recordings with a longer gap between two positions of one person are refused [s]."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL

    def run(self) -> None:
        """Print a line for each file and how many agree; exit with 1 if one does not."""
        from socialnav_mj.resimulation import Trust
        from socialnav_mj.verification import files_of, verify

        data_dir = None if self.data_dir is None else str(self.data_dir)
        trust = Trust(controllers=self.trust, metrics=self.trust, robots=self.trust_robot)
        bounds = Reading(max_duration=self.max_duration, max_gap=self.max_gap)
        checked, wrong = 0, 0
        files = []
        with counted_progress() as progress:
            total = len(files_of(self.path))
            bar = progress.add_task("files", total=total)
            for verdict in verify(
                self.path, dataset=self.dataset, data_dir=data_dir, trust=trust, bounds=bounds, n_jobs=self.jobs
            ):
                checked, wrong = checked + 1, wrong + (not verdict.same)
                progress.update(bar, completed=checked, total=max(total, checked))  # tables come after the files
                say(f"{verdict.path.name}: {_told(verdict)}")
                told = {"differences": verdict.differences, "error": verdict.error}
                files.append({"file": verdict.path.name, "same": verdict.same, **told})
        console.tell(files=files)
        say(f"{checked - wrong} of {checked} files say what their re-simulation says")
        if wrong:
            sys.exit(1)


def _told(verdict: "Verdict") -> str:
    if verdict.error is not None:
        return verdict.error
    if verdict.same:
        return f"same {verdict.state_hash[:16]}".rstrip()
    result = f"DIFFERS: {'; '.join(verdict.differences)}"
    if verdict.other_versions:
        result += f" (then and now: {'; '.join(verdict.other_versions)})"
    return result


@dataclass(frozen=True, kw_only=True)
class Draws:
    """How many draws it takes to tell two controllers apart by a given difference, from the spread in a run."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FOLDER")]
    """Folder that `evaluate` wrote, with two draws or more."""
    measure: str = "success"
    """Name of a measure in summary.csv."""
    difference: float = 0.05
    """Difference that is to be resolved at 95 %, in the measure's unit."""

    def run(self) -> None:
        """Print a row for every scenario and pair of controllers."""
        import pyarrow.parquet

        from socialnav_mj.report.power import resolutions, told

        agents = pyarrow.parquet.read_table(self.folder / "agents.parquet")
        table = Table(title=f"draws that resolve {self.difference:g} of {self.measure} at 95 %", title_justify="left")
        for heading in ("scenario", "controllers", "draws here", "spread", "for the interval", "for 80 % power"):
            table.add_column(heading)
        for r in resolutions(agents, {self.measure: self.difference}):
            needed = (str(r.n_draws), f"{r.spread:.4f}", told(r.draws), told(r.draws_for_power))
            table.add_row(r.scenario, " - ".join(r.controllers), *needed)
        console.print(table)
