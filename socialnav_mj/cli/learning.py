"""The sub-commands of learning: `train`, `ship` and `reward-maps`."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import mean
from typing import Annotated, Any

import tyro
from rich.table import Table

from socialnav_mj.cli.arguments import LOCAL, Folder, Where
from socialnav_mj.cli.console import console, counted_progress, say
from socialnav_mj.cli.settings import AttentionSettings, TrainingSettings
from socialnav_mj.files import check_output
from socialnav_mj.learning.attention_config import AttentionConfig
from socialnav_mj.learning.config import TrainingConfig
from socialnav_mj.processes import in_processes
from socialnav_mj.resources import install_hint

_COMPANY = (0.5, 1.0, 2.0)
"""Distances of a walker that `reward-maps` tells of [m]."""


@dataclass(frozen=True, kw_only=True)
class TrainReplayIRL:
    """Learn a reward and a policy from recorded people."""

    dataset: tuple[str, ...] = ("plaza",)
    """Recordings to learn from: names in the catalogue, or paths."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    settings: Annotated[object, tyro.conf.arg(constructor=TrainingSettings)] = field(default_factory=TrainingSettings)
    """Settings of the training."""
    seeds: tuple[int, ...] = ()
    """Several trainings, with these seeds in place of --seed, in processes or on a cluster."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL
    out: Folder = None
    """Folder of the training; runs/train/DATASET_FEATURES_seedSEED by default; with --seeds each has OUT/seedSEED."""

    def run(self) -> None:
        """Train behind a bar, print every validation, and say where the chosen policy is."""
        try:
            from socialnav_mj.learning.training import train
        except ImportError as error:
            raise RuntimeError(_needed(error)) from error
        config = TrainingConfig(datasets=self.dataset, **vars(self.settings))
        _run(self, train, config, controller="replay_irl")


@dataclass(frozen=True, kw_only=True)
class TrainAttention:
    """Learn a policy that weighs the people around it, by reinforcement in a recorded crowd."""

    dataset: tuple[str, ...] = ("plaza",)
    """Recordings to learn in: names in the catalogue, or paths."""
    data_dir: Folder = None
    """Where recordings are looked for first."""
    settings: Annotated[object, tyro.conf.arg(constructor=AttentionSettings)] = field(default_factory=AttentionSettings)
    """Settings of the training."""
    seeds: tuple[int, ...] = ()
    """Several trainings, with these seeds in place of --seed, in processes or on a cluster."""
    jobs: int = -1
    """Processes; -1 for one a core."""
    where: Where = LOCAL
    out: Folder = None
    """Folder of the training; runs/train/DATASET_people_seedSEED by default; with --seeds each has OUT/seedSEED."""

    def run(self) -> None:
        """Train behind a bar, print every validation, and say where the chosen policy is."""
        try:
            from socialnav_mj.learning.attention_training import train_attention
        except ImportError as error:
            raise RuntimeError(_needed(error)) from error
        config = AttentionConfig(datasets=self.dataset, **vars(self.settings))
        _run(self, train_attention, config, controller="attention")


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train a policy. If it is interrupted, repeat the command to resume it."""

    method: tyro.conf.OmitSubcommandPrefixes[
        Annotated[TrainReplayIRL, tyro.conf.subcommand("replay-irl")]
        | Annotated[TrainAttention, tyro.conf.subcommand("attention")]
    ]

    @property
    def where(self) -> Where:
        """Where the trainings are run."""
        return self.method.where

    def run(self) -> None:
        """Run one of the trainings."""
        self.method.run()


def _needed(error: ImportError) -> str:
    return f"training needs the extra 'train' ({install_hint('train')}): {error}"


def _folder(config: TrainingConfig | AttentionConfig) -> Path:
    label = "+".join(Path(name).stem for name in config.datasets)
    return Path("runs") / "train" / f"{label}_{config.features}_seed{config.seed}"


def _run(
    asked: TrainReplayIRL | TrainAttention,
    train: Callable[..., Path],
    config: TrainingConfig | AttentionConfig,
    controller: str,
) -> None:
    if len(set(asked.seeds)) < len(asked.seeds):
        raise ValueError(f"seeds = {asked.seeds} is not allowed; allowed: each once")
    data_dir = None if asked.data_dir is None else str(asked.data_dir)
    if not asked.seeds and asked.where == LOCAL:
        check_output(out := asked.out or _folder(config))
        _tell(_run_here(train, config, out, data_dir), controller)
        return
    planned = []
    for seed in asked.seeds or (config.seed,):
        own = replace(config, seed=seed)
        out = _folder(own) if asked.out is None else asked.out / f"seed{seed}" if asked.seeds else asked.out
        check_output(out)
        planned.append((train, own, out, data_dir))
    with counted_progress() as progress:
        bar = progress.add_task("trainings", total=len(planned))
        for best in in_processes(_run_there, planned, n_jobs=asked.jobs):
            progress.advance(bar)
            _tell(best, controller)


def _run_there(
    train: Callable[..., Path], config: TrainingConfig | AttentionConfig, out: Path, data_dir: str | None
) -> Path:
    """Train in a process of its own, from the last checkpoint if there is one."""
    return train(config, out, data_dir=data_dir)


def _run_here(
    train: Callable[..., Path], config: TrainingConfig | AttentionConfig, out: Path, data_dir: str | None
) -> Path:
    with counted_progress() as progress:
        bar = progress.add_task("scene steps", total=config.scene_steps)

        def report(step: Any) -> None:
            progress.update(bar, completed=step.scene_steps)
            if step.validation is not None:
                v = step.validation
                say(
                    f"{v['scene_steps']} scene steps: validation success {v['success']:.3f}, "
                    f"share of steps within 1.2 m {v['intrusion_share']:.3f}",
                    progress.console,
                )

        return train(config, out, data_dir=data_dir, progress=report)


def _tell(best: Path, controller: str) -> None:
    say(f"policy: {best}\nuse it: --controllers \"{controller}(policy='{best}')\"")


@dataclass(frozen=True, kw_only=True)
class Ship:
    """Put finished trainings among the shipped policies, as DATASETS_FEATURES_seedSEED.

    Every card states how the trainings that differ by their seed alone spread.
    """

    folders: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FOLDER")]
    """Folders that `train` wrote."""
    out: Folder = None
    """Folder of policies; the package's own by default."""

    def run(self) -> None:
        """Copy weights and cards, and print the paths."""
        from socialnav_mj.controllers.replay_irl import policies_folder
        from socialnav_mj.learning.shipping import ship

        for path in ship(self.folders, self.out or policies_folder()):
            say(f"policy: {path}")


@dataclass(frozen=True, kw_only=True)
class RewardMaps:
    """Show what learned rewards say of one walker around an agent: a table, and maps as PNG and SVG."""

    policies: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="POLICY")]
    """Shipped policies by name, or weights by path; as TITLE=POLICY under a title, those of one title as their mean."""
    out: Path = Path("runs/reward_maps")
    """Folder of the figure."""

    def run(self) -> None:
        """Print what company is worth at some distances, and draw the maps."""
        from socialnav_mj.controllers.replay_irl import load_policy
        from socialnav_mj.studies.paper.reward_map import MOTIONS, draw_reward_maps, worth_of_company

        check_output(self.out)
        rows: dict[str, list[Any]] = {}
        for given in self.policies:
            title, is_titled, policy = given.partition("=")
            rows.setdefault(title, []).append(load_policy(policy if is_titled else title))
        heads = [f"{motion}\n{_at(_COMPANY)}" for motion in MOTIONS]
        table = Table(
            "reward", *heads, title="what a walker adds to the learned reward of a step, mean over directions"
        )
        for title, own in rows.items():
            worth = [[mean(worth_of_company(p, motion, at) for p in own) for at in _COMPANY] for motion in MOTIONS]
            table.add_row(f"{title} ({len(own)})" if len(own) > 1 else title, *(_signed(each) for each in worth))
        console.print(table)
        for path in draw_reward_maps(rows, self.out, "reward_maps"):
            say(f"figure: {path}")


def _at(distances: tuple[float, ...]) -> str:
    return " / ".join(f"{distance:g}" for distance in distances) + " m"


def _signed(values: list[float]) -> str:
    return " / ".join(f"{value:+.3f}" for value in values)
