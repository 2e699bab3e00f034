"""The command `socialnav-mj`: sub-commands, and nothing that another module could do."""

import json
import shlex
import sys
from dataclasses import asdict, dataclass
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from dm_control.rl.control import PhysicsError
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column, Table
from rich.text import Text

from socialnav_mj.config import OnCollision, Robot, Scenario, TurnLimit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from socialnav_mj.evaluation import Done, Job, Pace

_console = Console()
_errors = Console(stderr=True)

Scenarios = Annotated[tuple[Literal[1, 2, 3, 4], ...], tyro.conf.arg(metavar="{1,2,3,4} ...")]
Name = Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")]
Folder = Annotated[Path | None, tyro.conf.arg(metavar="FOLDER", help_behavior_hint="")]


def _print(text: str, console: Console = _console, style: str = "") -> None:
    """Plain text, which the terminal wraps by itself, so that paths stay whole in a copy or a file."""
    console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)


def _counted_progress() -> Progress:
    """A bar for work in equal pieces, with the time left."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, TextColumn("left"), TimeRemainingColumn(), console=_errors)


class _PaceColumn(ProgressColumn):
    """Simulated time per real time, and the time left."""

    def __init__(self, pace: "Pace") -> None:
        super().__init__(table_column=Column(no_wrap=True))
        self._pace = pace

    def render(self, task: Task) -> Text:
        rate, left = self._pace.rate, self._pace.left
        if rate is None or left is None:
            return Text("")
        return Text(f"{rate:.0f} x real time, {timedelta(seconds=round(left))} left", style="progress.remaining")


def _follow(episodes: "Iterator[Done]", jobs: "list[Job]") -> None:
    """Run episodes behind a bar with their rate and the time left; tell at once what went wrong."""
    from socialnav_mj.evaluation import Pace

    pace = Pace(jobs)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        _PaceColumn(pace),
    )
    with Progress(*columns, console=_errors) as progress:
        bar = progress.add_task("episodes", total=len(jobs))
        for done in episodes:
            pace.note(done)
            progress.update(bar, advance=1)
            if done.error is not None:
                _print(f"{done.job.file_name}: {done.error}", progress.console, style="red")


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Run scenarios with controllers, score them beside the recorded people, and write tables and traces.

    Run again after an interruption, the same command goes on where it was.
    """

    dataset: str = "plaza"
    """Name in the catalogue (see `list`), or path of a recording's file or folder."""
    variant: Name = None
    """Which annotation of the recording (see `data list`); the first by default."""
    data_dir: Folder = None
    """Where recordings are looked for first; then in $SOCIALNAV_MJ_DATA, then in the user cache."""
    scenarios: Scenarios = (1, 2, 3, 4)
    """Scenarios that replace 10, 30, 70, 90 % of the people."""
    controllers: tuple[str, ...] = ("potential_field", "go_straight")
    """Names (see `list`), package.module:Class, or either with settings: 'potential_field(attraction_limit=None)'.
    replay_irl and hybrid act with the shipped policy that learned from the recording, if there is one, else with
    plaza's."""
    draws: int = 3
    """Random choices of the replaced people; 10 or more for figures to publish."""
    seed: int = 0
    """Seed of the first draw; the others count up from it."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    out: Folder = None
    """Folder of the results; runs/DATASET by default."""
    robot_radius: float = Robot.radius
    """[m]"""
    pedestrian_radius: float = Scenario.pedestrian_radius
    """[m]"""
    turn_limit: TurnLimit = Scenario.turn_limit
    """Reading of the paper's pi/6: a turn per control step, or rad/s."""
    on_collision: OnCollision = Scenario.on_collision
    """What an agent does after a collision; its success is void either way."""
    control_timestep: float = Scenario.control_timestep
    """Time between two actions [s]."""

    def run(self) -> None:
        """Evaluate, then report."""
        from socialnav_mj.analysis.report import write_report
        from socialnav_mj.controllers import with_policy_of
        from socialnav_mj.evaluation import Evaluation, evaluate, jobs_of

        names = ("robot_radius", "pedestrian_radius", "turn_limit", "on_collision", "control_timestep")
        evaluation = Evaluation(
            dataset=self.dataset,
            variant=self.variant,
            data_dir=None if self.data_dir is None else str(self.data_dir),
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            controllers=tuple(with_policy_of(spec, self.dataset) for spec in self.controllers),
            draws=self.draws,
            seed=self.seed,
            task_kwargs={name: getattr(self, name) for name in names},
        )
        out = self.out or Path("runs") / Path(self.dataset).resolve().stem
        episodes = evaluate(evaluation, out, command=shlex.join(sys.argv), n_jobs=self.jobs)
        _follow(episodes, jobs_of(evaluation))
        with _errors.status("tables and traces"):
            report = write_report(out, console=_console, n_jobs=self.jobs)
        _print(f"report: {report}\ntraces: {out / 'traces'} (open with: rerun FILE.rrd)")


@dataclass(frozen=True, kw_only=True)
class Report:
    """Make the tables, the report and the traces of a run again from its episodes."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FOLDER")]
    """Of `evaluate`."""
    jobs: int = -1
    """Processes; -1 for one a core."""

    def run(self) -> None:
        """Report."""
        from socialnav_mj.analysis.report import write_report

        path = write_report(self.folder, console=_console, n_jobs=self.jobs)
        _print(f"report: {path}\ntraces: {self.folder / 'traces'} (open with: rerun FILE.rrd)")


@dataclass(frozen=True, kw_only=True)
class Verify:
    """Run stored episodes again and compare the hashes of their states; exit code 1 if one differs."""

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")]
    """Folder of `evaluate`, an episode (.npz), or a trace (.rrd)."""
    dataset: Name = None
    """Name or path of the recording; by default the name that each file gives."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    jobs: int = -1
    """Processes; -1 for one a core."""

    def run(self) -> None:
        """Verify."""
        from socialnav_mj.verification import files_of, verify

        total, wrong = len(files_of(self.path)), 0
        with _counted_progress() as progress:
            bar = progress.add_task("files", total=total)
            data_dir = None if self.data_dir is None else str(self.data_dir)
            for verdict in verify(self.path, dataset=self.dataset, data_dir=data_dir, n_jobs=self.jobs):
                progress.advance(bar)
                wrong += not verdict.same
                if verdict.error is not None:
                    result = verdict.error
                elif verdict.same:
                    result = f"same {verdict.hash[:16]}"
                else:
                    result = f"DIFFERS: stored {verdict.stored_hash[:16]}, now {verdict.hash[:16]}"
                    if verdict.other_versions:
                        result += f" (then and now: {'; '.join(verdict.other_versions)})"
                _print(f"{verdict.path.name}: {result}")
        _print(f"{total - wrong} of {total} files give the same states again")
        if wrong:
            sys.exit(1)


@dataclass(frozen=True, kw_only=True)
class Draws:
    """How many draws it takes to tell two controllers apart by a given difference, from the spread in a run."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FOLDER")]
    """Of `evaluate`, with two draws or more."""
    measure: str = "success"
    """A measure of summary.csv."""
    difference: float = 0.05
    """To be resolved at 95 %, in the measure's unit."""

    def run(self) -> None:
        """Print a table."""
        import pyarrow.parquet

        from socialnav_mj.analysis.draws import resolutions

        agents = pyarrow.parquet.read_table(self.folder / "agents.parquet")
        table = Table(title=f"draws that resolve {self.difference:g} of {self.measure} at 95 %", title_justify="left")
        for heading in ("scenario", "controllers", "draws here", "spread", "for the interval", "for 80 % power"):
            table.add_column(heading)
        for r in resolutions(agents, {self.measure: self.difference}):
            needed = (str(r.n_draws), f"{r.spread:.4f}", str(r.draws), str(r.draws_for_power))
            table.add_row(r.scenario, " - ".join(r.controllers), *needed)
        _console.print(table)


@dataclass(frozen=True, kw_only=True)
class List:
    """Show the tasks, controllers and recordings that there are."""

    def run(self) -> None:
        """Print three tables."""
        import tasks
        from socialnav_mj.controllers import available
        from socialnav_mj.recordings.catalogue import catalogue

        table = Table("task", "replaced", title="tasks", title_justify="left")
        for name in tasks.ALL_TASKS:
            table.add_row(name, f"{tasks.SHARES[name]:.0%}")
        _console.print(table)
        table = Table("controller", title="controllers", title_justify="left")
        for name in available():
            table.add_row(name)
        table.add_row("package.module:Class")
        _console.print(table)
        table = Table("recording", "variants", "what it is", title="recordings", title_justify="left")
        for name, row in catalogue().items():
            table.add_row(name, ", ".join(row.variants), row.title)
        _console.print(table)


@dataclass(frozen=True, kw_only=True)
class DataList:
    """Known recordings: source, licence, checksums, frame rate, scale, and whether they are on this machine."""

    data_dir: Folder = None
    """Where recordings are looked for first."""

    def run(self) -> None:
        """Print the catalogue."""
        from socialnav_mj.recordings.catalogue import catalogue, load_recording

        for name, row in catalogue().items():
            table = Table(show_header=False, title=f"{name}: {row.title}", title_justify="left")
            table.add_column()
            table.add_column(overflow="fold")
            for label in ("source", "licence", "scale"):
                table.add_row(label, getattr(row, label))
            table.add_row("frame rate", f"{row.frame_rate:g} Hz")
            for variant, files in row.variants.items():
                for file, checksum in files.items():
                    table.add_row(f"{variant}: {file}", f"sha256 {checksum}")
            try:
                load_recording(name, data_dir=self.data_dir)
                table.add_row("here", "yes")
            except FileNotFoundError:
                table.add_row("here", f"no: socialnav-mj data fetch {name}")
            _console.print(table)


@dataclass(frozen=True, kw_only=True)
class DataInfo:
    """Facts of a recording: people, concurrency, speeds, distances, and who comes how near."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """Name in the catalogue, or path of a recording."""
    variant: Name = None
    """Which annotation; the first by default."""
    data_dir: Folder = None
    """Where recordings are looked for first."""

    def run(self) -> None:
        """Print the facts."""
        from rich.markdown import Markdown

        from socialnav_mj.recordings import load_recording
        from socialnav_mj.recordings.facts import facts, facts_table

        recording = load_recording(self.name, variant=self.variant, data_dir=self.data_dir)
        _console.print(Markdown(facts_table({recording.name: facts(recording)})))
        _print(f"variant {recording.variant}, checksum {recording.checksum}")


@dataclass(frozen=True, kw_only=True)
class DataFetch:
    """Download a recording from its public source and verify its checksum."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """Name in the catalogue."""
    data_dir: Folder = None
    """Where to put it; the user cache by default."""

    def run(self) -> None:
        """Download."""
        from socialnav_mj.recordings.fetch import fetch

        with _errors.status(f"downloading {self.name}"):
            paths = fetch(self.name, data_dir=self.data_dir)
        for path in paths:
            _print(str(path))


@dataclass(frozen=True, kw_only=True)
class Data:
    """Recordings: list, info, fetch."""

    action: tyro.conf.OmitSubcommandPrefixes[
        Annotated[DataList, tyro.conf.subcommand("list")]
        | Annotated[DataInfo, tyro.conf.subcommand("info")]
        | Annotated[DataFetch, tyro.conf.subcommand("fetch")]
    ]

    def run(self) -> None:
        """Do what was asked for."""
        self.action.run()


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure what episodes cost on one core, beside bare `mj_step` calls, as ratios."""

    dataset: str = "plaza"
    """Name in the catalogue, or path of a recording."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    scenarios: Scenarios = (1, 4)
    """Scenarios to measure."""
    controller: str = "potential_field"
    """See `evaluate`."""
    seed: int = 0
    """Seed of the draw."""
    repetitions: int = 3
    """Episodes and bare runs, in turn; the median is shown."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """JSON file to write, with package versions and the recording's checksum."""

    def run(self) -> None:
        """Measure and print."""
        from socialnav_mj.benchmark import measure
        from socialnav_mj.files import write_whole
        from socialnav_mj.recordings import load_recording
        from socialnav_mj.rollout import PACKAGES, package_versions

        recording = load_recording(self.dataset, data_dir=self.data_dir)
        costs = []
        for number in self.scenarios:
            with _errors.status(f"scenario {number}"):
                cost = measure(
                    recording,
                    f"scenario_{number}",
                    controller=self.controller,
                    seed=self.seed,
                    repetitions=self.repetitions,
                )
            costs.append(cost)
        table = Table(title=f"{recording.name}, {self.controller}, CPU time on one core", title_justify="left")
        table.add_column("")
        rows: dict[str, list[str]] = {}
        for cost in costs:
            table.add_column(cost.scenario, justify="right")
            for label, text in {
                "agents": f"{cost.n_agents}",
                "simulated [s]": f"{cost.simulated_time:.1f}",
                "episode CPU [s]": f"{cost.episode_cpu:.2f}",
                "bare mj_step CPU [s]": f"{cost.physics_cpu:.2f}",
                "episode / mj_step": f"{cost.ratio:.2f} ({cost.ratio_low:.2f} to {cost.ratio_high:.2f})",
                "real-time factor": f"{cost.real_time_factor:.1f}",
                "saving / episode": f"{cost.save_share:.1%}",
                "trace / episode": f"{cost.trace_share:.1%}",
                "trace [MB]": f"{cost.trace_megabytes:.2f}",
            }.items():
                rows.setdefault(label, []).append(text)
        for label, cells in rows.items():
            table.add_row(label, *cells)
        _console.print(table)
        if self.out is not None:
            content = {
                "command": shlex.join(sys.argv),
                "recording": {"name": recording.name, "variant": recording.variant, "checksum": recording.checksum},
                "versions": package_versions(PACKAGES),
                "costs": [asdict(cost) for cost in costs],
            }
            write_whole(self.out, (json.dumps(content, indent=1) + "\n").encode())


@dataclass(frozen=True, kw_only=True)
class Train:
    """Learn a reward and a policy from recorded people; goes on with a training that was stopped."""

    method: tyro.conf.Positional[Literal["replay-irl"]]
    """What to train."""
    dataset: tuple[str, ...] = ("plaza",)
    """Recordings to learn from: names in the catalogue, or paths."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    features: Literal["continuous", "risk"] = "continuous"
    """Feature set of policy and reward."""
    partition: Literal["fused", "importance", "segment"] = "fused"
    """Estimate of the partition function."""
    seed: int = 0
    """Of networks, exploration, sampling and draws."""
    scene_steps: int | None = None
    """Control steps of the training scene; the committed configuration's by default."""
    out: Folder = None
    """Folder of the training; runs/train/DATASET_FEATURES_seedSEED by default."""

    def run(self) -> None:
        """Train."""
        try:
            from socialnav_mj.learning.config import TrainingConfig
            from socialnav_mj.learning.training import Progress as Step
            from socialnav_mj.learning.training import train
        except ImportError as error:
            raise RuntimeError(
                f"training needs the extra 'train' (pip install 'socialnav-mj[train]'): {error}"
            ) from error
        config = TrainingConfig(
            datasets=self.dataset,
            features=self.features,
            partition=self.partition,
            seed=self.seed,
            scene_steps=self.scene_steps or TrainingConfig.scene_steps,
        )
        label = "+".join(Path(name).stem for name in self.dataset)
        out = self.out or Path("runs") / "train" / f"{label}_{self.features}_seed{self.seed}"
        with _counted_progress() as progress:
            bar = progress.add_task("scene steps", total=config.scene_steps)

            def report(step: Step) -> None:
                progress.update(bar, completed=step.scene_steps)
                if step.validation is not None:
                    v = step.validation
                    _print(
                        f"{step.scene_steps} scene steps, {step.transitions} transitions: validation success "
                        f"{v['success']:.3f}, share of steps within 1.2 m {v['intrusion_share']:.3f}",
                        progress.console,
                    )

            best = train(config, out, data_dir=None if self.data_dir is None else str(self.data_dir), progress=report)
        _print(f"policy: {best}\nuse it: --controllers \"replay_irl(policy='{best}')\"")


@dataclass(frozen=True, kw_only=True)
class Reproduce:
    """Run the paper's experiment: potential field, ReplayIRL of each training, both mixed, and the recorded humans.

    Writes figures, tables and claims.md, with a verdict on every sentence of the paper's results. Run again after an
    interruption, the same command goes on where it was.
    """

    dataset: str = "students003"
    """Name in the catalogue, or path of a recording."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    policies: tuple[str, ...] = ()
    """Names of shipped policies, or paths of .safetensors files; those trained on the recording by default."""
    features: Literal["continuous", "risk"] = "continuous"
    """Feature set of the shipped policies to take."""
    scenarios: Scenarios = (1, 2, 3, 4)
    """Scenarios to run; most claims are about all four."""
    draws: int = 10
    """Random choices of the replaced people."""
    seed: int = 0
    """Seed of the first draw."""
    variants: bool = False
    """Run the variants of the setting and the sweep of the switch distance as well."""
    variant_draws: int | None = None
    """Draws of the variants and the sweep; as many as of the default setting by default."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    out: Path = Path("reproduction")
    """Folder of the results."""
    publish: Folder = None
    """Folder that gets a copy of figures, tables and pages: all that holds no recording and no episode."""

    def run(self) -> None:
        """Run, then draw and write."""
        from socialnav_mj.reproduction.outputs import PUBLIC, write_outputs
        from socialnav_mj.reproduction.plan import Experiment, shipped_for
        from socialnav_mj.reproduction.record import publish
        from socialnav_mj.reproduction.study import reproduce

        experiment = Experiment(
            dataset=self.dataset,
            policies=self.policies or shipped_for(self.dataset, self.features),
            data_dir=None if self.data_dir is None else str(self.data_dir),
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            seed=self.seed,
            variants=self.variants,
            variant_draws=self.variant_draws,
        )
        command = shlex.join(["socialnav-mj", *sys.argv[1:]])
        _follow(reproduce(experiment, self.out, command=command, n_jobs=self.jobs), experiment.jobs())
        with _errors.status("tables and figures"):
            page = write_outputs(experiment, self.out, command=command, n_jobs=self.jobs)
        _print(f"report: {page}\nclaims: {self.out / 'claims.md'}")
        if self.publish is not None:
            _print(f"to be committed: {publish(self.out, self.publish, PUBLIC)}")


@dataclass(frozen=True, kw_only=True)
class LeaveOneOut:
    """Run policies that learned from all recordings but one on each recording: in-sample and held out side by side.

    Writes tables over the agents that replace people whom the in-sample policies learned from. Run again after an
    interruption, the same command goes on where it was.
    """

    recordings: tuple[str, ...] = ("students003", "zara01", "zara02")
    """Names in the catalogue, or paths."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    policies: tuple[str, ...] = ()
    """Names of shipped policies, or paths of .safetensors files; those that left one recording out by default."""
    features: Literal["continuous", "risk"] = "continuous"
    """Feature set of the shipped policies to take."""
    scenarios: Scenarios = (1, 2)
    """Scenarios to run."""
    draws: int = 10
    """Random choices of the replaced people."""
    seed: int = 0
    """Seed of the first draw."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    out: Path = Path("leave_one_out")
    """Folder of the results."""
    publish: Folder = None
    """Folder that gets a copy of tables and page: all that holds no recording and no episode."""

    def run(self) -> None:
        """Run, then write."""
        from socialnav_mj.reproduction import leave_one_out
        from socialnav_mj.reproduction.record import publish
        from socialnav_mj.reproduction.study import reproduce

        study = leave_one_out.LeaveOneOut(
            recordings=self.recordings,
            policies=self.policies or leave_one_out.shipped_leaving_one_out(self.recordings, self.features),
            data_dir=None if self.data_dir is None else str(self.data_dir),
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            seed=self.seed,
        )
        command = shlex.join(["socialnav-mj", *sys.argv[1:]])
        _follow(reproduce(study, self.out, command=command, n_jobs=self.jobs), study.jobs())
        with _errors.status("tables"):
            page = leave_one_out.write_leave_one_out(study, self.out, command=command, n_jobs=self.jobs)
        _print(f"report: {page}")
        if self.publish is not None:
            _print(f"to be committed: {publish(self.out, self.publish, leave_one_out.PUBLIC)}")


Command = (
    Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[Verify, tyro.conf.subcommand("verify")]
    | Annotated[Draws, tyro.conf.subcommand("draws")]
    | Annotated[List, tyro.conf.subcommand("list")]
    | Annotated[Data, tyro.conf.subcommand("data")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[LeaveOneOut, tyro.conf.subcommand("leave-one-out")]
)


def main(args: list[str] | None = None) -> None:
    """Entry point; bad input ends in one clear message and exit code 2, an interruption in 130.

    Args:
        args: Command line without the program's name; sys.argv by default.
    """
    command = tyro.cli(
        Command,
        prog="socialnav-mj",
        description="Social navigation in recorded crowds, as a MuJoCo physics benchmark.",
        args=args,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
    )
    # As `python -m` does, so that package.module:Class finds what lies here; last, so that it hides nothing.
    sys.path.append(str(Path.cwd()))
    try:
        command.run()
    except KeyboardInterrupt:
        _print("interrupted; the same command goes on where it was", _errors)
        sys.exit(130)
    except (ValueError, OSError, RuntimeError, PhysicsError) as error:
        _print(f"error: {error}", _errors, style="red")
        sys.exit(2)
