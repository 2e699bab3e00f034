"""The sub-commands `bench` and `step-size`: what the physics costs, and how much hangs on its step."""

import json
import shlex
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import tyro
from rich.table import Table

from socialnav_mj.cli.arguments import LOCAL, Folder, Scenarios, Where
from socialnav_mj.cli.console import console, errors, follow, say
from socialnav_mj.config import Pedestrians, Scenario


@dataclass(frozen=True, kw_only=True)
class StepSize:
    """Run the same agents at several physics steps: what changes?

    If it is interrupted, repeat the command to resume it.
    """

    dataset: str = "students003"
    """Name in the catalogue, or path of a recording."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    scenarios: Scenarios = (1,)
    """Scenarios to run."""
    controllers: tuple[str, ...] = ("potential_field_capped", "replay_irl")
    """As in `evaluate`."""
    draws: int = 10
    """Random choices of the replaced people."""
    seed: int = 0
    """Number of the first draw; the others count up from it."""
    steps: tuple[float, ...] = (0.01, 0.2 / 21, 0.005, 0.0025)
    """Physics steps, the one to compare with first [s]."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL
    out: Path = Path("runs/step_size")
    """Folder of the results."""

    def run(self) -> None:
        """Run what is missing behind a bar, and print the table as Markdown."""
        from socialnav_mj.controllers import with_policy_of
        from socialnav_mj.evaluation import Evaluation
        from socialnav_mj.studies import step_size

        evaluation = Evaluation(
            dataset=self.dataset,
            data_dir=None if self.data_dir is None else str(self.data_dir),
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            controllers=tuple(with_policy_of(spec, self.dataset) for spec in self.controllers),
            draws=self.draws,
            seed=self.seed,
        )
        planned = step_size.evaluations(evaluation, self.steps)
        follow(
            step_size.run(planned, self.out, command=shlex.join(sys.argv), n_jobs=self.jobs), step_size.jobs(planned)
        )
        say(step_size.step_table(step_size.compare(planned, self.out, n_jobs=self.jobs)).rstrip())


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure what episodes, or controllers, cost on one core, beside bare `mj_step` calls, as ratios.

    With --compare it measures nothing, and sets two files that it wrote side by side.
    """

    dataset: str = "plaza"
    """Name in the catalogue, or path of a recording."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    scenarios: Scenarios = (1, 4)
    """Scenarios to measure."""
    controller: str = "potential_field"
    """Name, or package.module:Class, with settings if need be, as in `evaluate`."""
    pedestrians: Pedestrians = Scenario.pedestrians
    """Whether people react to robots."""
    controllers: tuple[str, ...] = ()
    """Controllers whose own cost for 60 agents is measured, in a made-up crowd; then no episodes are."""
    growth: tuple[int, ...] = ()
    """Sizes of made-up crowds of robots in which an agent-step is measured, once each; then no episodes are."""
    scenes: tuple[int, ...] = ()
    """Numbers of scenes, each in a worker process, beside the same in one; needs the extra `train`."""
    seed: int = 0
    """Seed of the draw."""
    repetitions: int = 3
    """Episodes and bare runs, in turn; the median is shown."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """JSON file to write, with package versions and the recording's checksum."""
    compare: Annotated[tuple[Path, Path] | None, tyro.conf.arg(metavar="BEFORE AFTER", help_behavior_hint="")] = None
    """Two such files to compare, of the same scenarios or controllers."""
    at_most: Annotated[float | None, tyro.conf.arg(metavar="RATIO", help_behavior_hint="")] = None
    """With --compare: exit code 1 if a figure is more than so many times what it was, beyond what repetitions differ
    by."""

    def run(self) -> None:
        """Measure what is asked for, or compare, print a table, and write the file if one is named."""
        if self.at_most is not None and (self.compare is None or not self.at_most > 0.0):
            raise ValueError(f"--at-most {self.at_most:g} is not allowed; allowed: numbers > 0, with --compare")
        if self.compare is not None:
            self._compare(*self.compare)
        elif self.growth:
            self._measure_growth()
        elif self.scenes:
            self._measure_scenes()
        elif self.controllers:
            self._measure_controllers()
        else:
            self._measure_episodes()

    def _measure_growth(self) -> None:
        from socialnav_mj.growth import measure_growth

        with errors.status(f"{max(self.growth)} robots"):
            rows = measure_growth(self.growth, controller=self.controller)
        table = Table(title=f"{self.controller}, CPU time on one core", title_justify="left")
        for heading in (
            "robots",
            "build [s]",
            "agent-step [us]",
            "physics [us]",
            "controller [us]",
            "ratio",
            "peak [MB]",
        ):
            table.add_column(heading, justify="right")
        for row in rows:
            times = (f"{1e6 * seconds:.0f}" for seconds in (row.cost, row.physics_cost, row.act_cost))
            ends = f"{row.ratio:.2f}", f"{row.peak_megabytes:.0f}"
            table.add_row(f"{row.n_agents}", f"{row.build_cpu:.2f}", *times, *ends)
        console.print(table)
        self._write({"growth": [asdict(row) for row in rows]})

    def _measure_scenes(self) -> None:
        from socialnav_mj.provenance import recording_metadata
        from socialnav_mj.recordings import load_recording
        from socialnav_mj.throughput import measure_scenes

        recording = load_recording(self.dataset, data_dir=self.data_dir)
        measured = []
        for number in self.scenarios:
            for count in self.scenes:
                with errors.status(f"scenario {number}, scenes: {count}"):
                    measured.append(
                        measure_scenes(
                            recording, f"scenario_{number}", count, seed=self.seed, repetitions=self.repetitions
                        )
                    )
        table = Table(title=f"{recording.name}, random actions, agent-steps a second", title_justify="left")
        table.add_column("")
        rows: dict[str, list[str]] = {}
        for found in measured:
            table.add_column(f"{found.scenario}\nscenes: {found.n_scenes}", justify="right")
            for label, text in {
                "one process [1/s]": f"{found.one.middle:.0f}",
                "a worker each [1/s]": f"{found.workers.middle:.0f}",
                "ratio": str(found.ratio),
                "one process [1/CPU s]": f"{found.one_cpu.middle:.0f}",
                "a worker each [1/CPU s]": f"{found.workers_cpu.middle:.0f}",
                "ratio of these": str(found.cpu_ratio),
            }.items():
                rows.setdefault(label, []).append(text)
        for label, cells in rows.items():
            table.add_row(label, *cells)
        console.print(table)
        content = {"settings": {"seed": self.seed}, "scenes": [asdict(found) for found in measured]}
        self._write({"recording": recording_metadata(recording), **content})

    def _compare(self, before: Path, after: Path) -> None:
        from socialnav_mj.comparison import compare

        found = compare(before, after)
        table = Table(title=f"{after} beside {before}: medians (least to greatest repetition)", title_justify="left")
        for heading in ("", "before", "after", "after / before", ""):
            table.add_column(heading, justify="right" if heading else "left")
        case = None
        for change in found.changes:
            if change.case != case:
                table.add_section()
                table.add_row(case := change.case)
            ratio = f"{change.ratio:.2f}"
            if (change.ratio_low, change.ratio_high) != (change.ratio, change.ratio):
                ratio += f" ({change.ratio_low:.2f} to {change.ratio_high:.2f})"
            sides = (f"{median(values):.4g}" for values in (change.before, change.after))
            table.add_row(f"  {change.measure}", *sides, ratio, change.verdict)
        console.print(table)
        for note in found.notes:
            say(f"not only the code differs: {note}")
        if self.at_most is not None:
            over = [change for change in found.changes if change.exceeds(self.at_most)]
            for change in over:
                say(
                    f"{change.case}: {change.measure} is {change.ratio:.2f} times what it was; at most {self.at_most:g}"
                )
            if over:
                sys.exit(1)

    def _measure_controllers(self) -> None:
        from socialnav_mj.benchmark import measure_controllers

        costs = []
        for spec in self.controllers:
            with errors.status(spec):
                costs += measure_controllers([spec], repetitions=self.repetitions)
        table = Table(title="CPU time for an agent and control step, on one core", title_justify="left")
        for heading in ("controller", "agents", "controller [us]", "mj_step [us]", "controller / mj_step"):
            table.add_column(heading, justify="left" if heading == "controller" else "right")
        for cost in costs:
            ratio = f"{cost.ratio:.2f} ({cost.ratio_low:.2f} to {cost.ratio_high:.2f})"
            times = (f"{1e6 * seconds:.0f}" for seconds in (cost.act_cpu, cost.physics_cpu))
            table.add_row(cost.controller, f"{cost.n_agents:.0f}", *times, ratio)
        console.print(table)
        self._write({"settings": {}, "controllers": [asdict(cost) for cost in costs]})

    def _measure_episodes(self) -> None:
        from socialnav_mj.benchmark import measure
        from socialnav_mj.provenance import recording_metadata
        from socialnav_mj.recordings import load_recording

        recording = load_recording(self.dataset, data_dir=self.data_dir)
        costs = []
        for number in self.scenarios:
            with errors.status(f"scenario {number}"):
                cost = measure(
                    recording,
                    f"scenario_{number}",
                    controller=self.controller,
                    pedestrians=self.pedestrians,
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
                "slots / robots built / in use at once": f"{cost.n_slots} / {cost.n_robots} / {cost.n_used}",
                "simulated [s]": f"{cost.simulated_time:.1f}",
                "episode CPU [s]": f"{cost.episode_cpu:.2f}",
                "bare mj_step CPU [s]": f"{cost.physics_cpu:.2f}",
                "episode / mj_step": f"{cost.ratio:.2f} ({cost.ratio_low:.2f} to {cost.ratio_high:.2f})",
                "real-time factor": f"{cost.real_time_factor:.1f}",
                "as built, with parked / mj_step": f"{cost.parked_ratio:.2f}",
                "people's reaction / mj_step": f"{cost.reaction_ratio:.2f}",
                "saving / episode": f"{cost.save_share:.1%}",
                "trace / episode": f"{cost.trace_share:.1%}",
                "trace [MB]": f"{cost.trace_megabytes:.2f}",
            }.items():
                rows.setdefault(label, []).append(text)
        for label, cells in rows.items():
            table.add_row(label, *cells)
        console.print(table)
        settings = {"controller": self.controller, "pedestrians": self.pedestrians, "seed": self.seed}
        measured = {"settings": settings, "costs": [asdict(cost) for cost in costs]}
        self._write({"recording": recording_metadata(recording), **measured})

    def _write(self, content: dict[str, Any]) -> None:
        """Write the measurements with the command and the versions, if a file is named."""
        from socialnav_mj.files import write_whole
        from socialnav_mj.provenance import PACKAGES, package_versions, platform_facts

        if self.out is not None:
            origin = {"versions": package_versions((*PACKAGES, "numba")), "platform": platform_facts()}
            whole = {"command": shlex.join(sys.argv), **origin, **content}
            write_whole(self.out, (json.dumps(whole, indent=1) + "\n").encode())
