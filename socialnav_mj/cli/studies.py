"""The sub-commands of many runs: `fit-prediction`, `reproduce`, `leave-one-out`, `gains`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from socialnav_mj.cli.arguments import LOCAL, Folder, Scenarios, Where
from socialnav_mj.cli.console import say
from socialnav_mj.cli.study import run_study


@dataclass(frozen=True, kw_only=True)
class FitPrediction:
    """Fit where people will be, a linear function of their last velocities, to recordings; controllers plan with it."""

    datasets: tuple[str, ...] = ("zara01", "zara02")
    """Recordings to learn from, two or more: names in the catalogue, or paths."""
    judged_on: tuple[str, ...] = ()
    """Recordings on which it is judged besides."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    out: Path = Path("linear.json")
    """File to write."""

    def run(self) -> None:
        """Fit, write the file, and print how far predictions err on recordings that they did not learn from."""
        from socialnav_mj.learning.prediction import fit_prediction

        data_dir = None if self.data_dir is None else str(self.data_dir)
        card = fit_prediction(self.datasets, self.out, judged_on=self.judged_on, data_dir=data_dir)
        for name, own in card["held_out_error"].items():
            linear, plain = own["linear"][15], own["constant_velocity"][15]
            say(f"{name}: mean displacement error after 3.2 s {linear:.3f} m, constant velocity {plain:.3f} m")
        say(f"prediction: {self.out}\nuse it: --controllers \"mpc(prediction='{self.out}')\"")


@dataclass(frozen=True, kw_only=True)
class Reproduce:
    """Run the paper's study: potential field, ReplayIRL and hybrid of each training, and the recorded people.

    Writes figures, tables and claims.md, with a verdict on every claim of the paper. If a run is interrupted, repeat
    the command to resume it.
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
    draws: int = 20
    """Random choices of the replaced people."""
    seed: int = 100
    """Seed of the first draw; the others count up from it. Draws below 100 are for choosing, not for reporting."""
    variants: tuple[str, ...] = ()
    """Run other settings as well: turn_per_second, capped (field in the hybrid), yielding (people), unicycle,
    radii_0.25, radii_0.40, retire, switch_anyone, switch_sweep; or all."""
    variant_draws: int | None = None
    """Draws of them, but for turn_per_second and capped; all by default."""
    variant_trainings: int | None = None
    """Trainings of the same; all by default."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL
    out: Path = Path("reproduction")
    """Folder of the results."""
    publish: Folder = None
    """Folder that gets a copy of figures, tables and pages: all that holds no recording and no episode."""

    def run(self) -> None:
        """Run what is missing behind a bar, then write figures, tables and pages, and copy them if asked to."""
        from socialnav_mj.studies.paper.outputs import PUBLIC, write_outputs
        from socialnav_mj.studies.paper.plan import OTHERS, Experiment, shipped_for

        experiment = Experiment(
            dataset=self.dataset,
            policies=self.policies or shipped_for(self.dataset, self.features),
            data_dir=None if self.data_dir is None else str(self.data_dir),
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            seed=self.seed,
            variants=OTHERS if self.variants == ("all",) else self.variants,
            variant_draws=self.variant_draws,
            variant_trainings=self.variant_trainings,
        )
        folders: dict[str, Any] = {"out": self.out, "jobs": self.jobs, "publish_to": self.publish}
        claims = f"\nclaims: {self.out / 'claims.md'}"
        run_study(experiment, write_outputs, PUBLIC, making="tables and figures", also=claims, **folders)


@dataclass(frozen=True, kw_only=True)
class LeaveOneOut:
    """Run policies that learned from all recordings but one on each recording: in-sample and held out side by side.

    Writes tables over the agents that replace people whom the in-sample policies learned from. If a run is interrupted,
    repeat the command to resume it.
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
    """Seed of the first draw; the others count up from it."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL
    out: Path = Path("leave_one_out")
    """Folder of the results."""
    publish: Folder = None
    """Folder that gets a copy of tables and page: all that holds no recording and no episode."""

    def run(self) -> None:
        """Run what is missing behind a bar, then write tables and the page, and copy them if asked to."""
        from socialnav_mj.studies.leave_one_out import study as leave_one_out

        study = leave_one_out.LeaveOneOut(
            recordings=self.recordings,
            policies=self.policies or leave_one_out.shipped_leaving_one_out(self.recordings, self.features),
            data_dir=None if self.data_dir is None else str(self.data_dir),
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            seed=self.seed,
        )
        folders: dict[str, Any] = {"out": self.out, "jobs": self.jobs, "publish_to": self.publish}
        run_study(study, leave_one_out.write_leave_one_out, leave_one_out.PUBLIC, making="tables", **folders)


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Run both potential fields over the ranges of their gains, beside the learned controllers, on draws for choosing.

    Writes a figure, tables and a page: where each form stands in its own range, and which claims of the paper about the
    potential field depend on its gains. If a run is interrupted, repeat the command to resume it.
    """

    recordings: tuple[str, ...] = ("students003", "zara01")
    """Names in the catalogue, or paths."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    policies: tuple[str, ...] = ()
    """Names of shipped policies, or paths of .safetensors files; the first three of students003 by default."""
    settings: int = 40
    """Gains drawn for each form, beside the default ones."""
    scenarios: Scenarios = (1, 2, 3, 4)
    """Scenarios to run."""
    draws: int = 2
    """Random choices of the replaced people."""
    seed: int = 0
    """Seed of the first draw; the others count up from it, those below 100 are for choosing."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL
    out: Path = Path("gains")
    """Folder of the results."""
    publish: Folder = None
    """Folder that gets a copy of tables, figure and page: all that holds no recording and no episode."""

    def run(self) -> None:
        """Run what is missing behind a bar, then write tables, figure and page, and copy them if asked to."""
        from socialnav_mj.studies.files import PUBLIC
        from socialnav_mj.studies.gains.study import GainSweep, write_gain_sweep
        from socialnav_mj.studies.paper.plan import shipped_for

        study = GainSweep(
            recordings=self.recordings,
            policies=self.policies or shipped_for("students003", turn_limit="per_step")[:3],
            settings=self.settings,
            data_dir=None if self.data_dir is None else str(self.data_dir),
            scenarios=tuple(f"scenario_{number}" for number in self.scenarios),
            draws=self.draws,
            seed=self.seed,
        )
        folders: dict[str, Any] = {"out": self.out, "jobs": self.jobs, "publish_to": self.publish}
        run_study(study, write_gain_sweep, PUBLIC, making="tables and figure", **folders)
