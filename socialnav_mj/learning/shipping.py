"""From finished trainings to the policies that travel with the package, and how much their seeds matter."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from socialnav_mj.controllers.attention import AttentionPolicy, load_attention
from socialnav_mj.controllers.policy_card import PolicyError, read_card
from socialnav_mj.controllers.replay_irl import TrainedPolicy, load_policy
from socialnav_mj.files import write_json, write_whole
from socialnav_mj.learning.config import TrainingConfig

MEASURES = ("success", "intrusion_share", "time_under_way")
BEST = "best.safetensors"
ATTENTION = "attention"
"""Method in the card of such a policy, and the folder of the shipped ones."""


def ship(folders: Sequence[Path], target: Path) -> list[Path]:
    """Put the best policies of finished trainings among others, as DATASETS_FEATURES_seedSEED.

    Those of `attention` go into the target's folder of that name. A turn limit that is not the default one stands
    before the seed. Trainings that differ in nothing but their seed are a family. Every card of a family gets its
    `seed_spread`: mean, standard deviation, least and greatest of its members' metrics.

    Args:
        folders: Of `socialnav_mj.learning.training.train`.
        target: Gets or has .safetensors files with their cards.

    Returns:
        Paths of the weights that were put there.

    Raises:
        PolicyError: If a training has no policy yet or is not finished, or a policy of the same family's name in the
            target was trained with another configuration; then nothing is written.
    """
    of_attention = [folder for folder in folders if _is_attention(folder)]
    others = [folder for folder in folders if folder not in of_attention]
    paths = _ship(others, target, load_policy) if others else []
    return paths + (_ship(of_attention, target / ATTENTION, load_attention) if of_attention else [])


def _is_attention(folder: Path) -> bool:
    return bool(read_card((folder / BEST).with_suffix(".json")).get("method") == ATTENTION)


def _ship(folders: Sequence[Path], target: Path, load: Callable[[str], TrainedPolicy | AttentionPolicy]) -> list[Path]:
    found: dict[str, tuple[dict[str, Any], bytes | None]] = {
        path.stem: (load(str(path)).card, None) for path in sorted(target.glob("*.safetensors"))
    }
    shipped = []
    for folder in folders:
        card = load(str(folder / BEST)).card
        if "metrics" not in card:
            raise PolicyError(f"{folder}: the training is not finished; run it to its end first")
        config = card["config"]
        names = "_".join(Path(name).stem for name in config["datasets"])
        limit = "" if config["turn_limit"] == TrainingConfig.turn_limit else f"_{config['turn_limit']}"
        name = f"{names}_{config['features']}{limit}_seed{config['seed']}"
        found[name] = (card, (folder / BEST).read_bytes())
        shipped.append(name)
    families: dict[str, list[str]] = {}
    for name in found:
        families.setdefault(name.rpartition("_seed")[0], []).append(name)
    changed = {name.rpartition("_seed")[0] for name in shipped}
    for family in sorted(changed):
        _check_family({name: found[name][0]["config"] for name in families[family]}, target)
    for family in sorted(changed):
        spread = seed_spread([found[name][0]["metrics"] for name in families[family]])
        for name in families[family]:
            card, weights = found[name]
            if weights is not None:
                write_whole(target / f"{name}.safetensors", weights)
            write_json(target / f"{name}.json", {**card, "seed_spread": spread})
    return [target / f"{name}.safetensors" for name in shipped]


def _check_family(configs: Mapping[str, Mapping[str, Any]], target: Path) -> None:
    first, *others = configs
    for other in others:
        for key in sorted({*configs[first], *configs[other]} - {"seed"}):
            one, two = configs[first].get(key), configs[other].get(key)
            if one != two:
                raise PolicyError(
                    f"{target}: {first} was trained with {key} = {one!r}, {other} with {two!r}; allowed: one "
                    "configuration for all seeds of a family, so ship them together"
                )


def seed_spread(metrics: Sequence[Mapping[str, Mapping[str, Any]]]) -> dict[str, dict[str, dict[str, float | None]]]:
    """How trainings differ by their seeds alone.

    Args:
        metrics: Of each training's card: part of the recording (in_sample, validation, held_out): measures.

    Returns:
        Part: measure of `MEASURES`: n, mean, sd (None for a single training), least, greatest.
    """
    result: dict[str, dict[str, dict[str, float | None]]] = {}
    for part in metrics[0]:
        result[part] = {}
        for measure in MEASURES:
            values = np.array([own[part][measure] for own in metrics])
            result[part][measure] = {
                "n": len(values),
                "mean": float(values.mean()),
                "sd": float(values.std(ddof=1)) if len(values) > 1 else None,
                "least": float(values.min()),
                "greatest": float(values.max()),
            }
    return result
