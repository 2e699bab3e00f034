"""Figure 9: validation success, intrusions and collided trips over each training, from the policies' cards."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from socialnav_mj.report.markdown import head, row
from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.looks import SHADES

_PANELS = (
    ("success", "validation success"),
    ("intrusion_share", "share of steps within 1.2 m"),
    ("training_collided", "training trips that collide"),
)
_PARTS = (("in_sample", "in-sample"), ("validation", "validation"), ("held_out", "held out"))


def draw_training_curves(cards: Mapping[int, Mapping[str, Any]], folder: Path) -> list[Path]:
    """A thin line for each training over its scene steps, a thick one for their mean; rings mark what was kept.

    Args:
        cards: Training seed: card of the policy, with a `history`.
        folder: Gets a PNG and an SVG.

    Returns:
        Paths of the files.
    """
    with style():
        figure = new_figure(2.3)
        for axes, (key, label) in zip(figure.subplots(1, len(_PANELS)), _PANELS, strict=True):
            at: dict[float, list[float]] = {}
            thin: dict[str, Any] = {"color": SHADES[2], "linewidth": 0.7, "clip_on": False}
            for number, card in enumerate(cards.values()):
                first = "_" if number else ""
                curve = {entry["scene_steps"] / 1000.0: entry[key] for entry in card["history"]}
                for step, value in curve.items():
                    at.setdefault(step, []).append(value)
                axes.plot([*curve], [*curve.values()], label=f"{first}each training", **thin)
                kept = card["scene_steps"] / 1000.0
                if kept in curve:
                    ring = {"marker": "o", "markersize": 6.0, "fillstyle": "none", "linestyle": "", "color": SHADES[1]}
                    axes.plot(kept, curve[kept], clip_on=False, label=f"{first}kept", **ring)
            steps = sorted(step for step, values in at.items() if len(values) == len(cards))
            mean = [float(np.mean(at[step])) for step in steps]
            axes.plot(steps, mean, color=SHADES[0], linewidth=2.0, clip_on=False, label=f"mean of {len(cards)}")
            axes.set_xlabel("thousand scene steps")
            axes.set_ylabel(label)
            # Room for the rings; what lies on an axis is drawn whole.
            axes.margins(x=0.07)
            axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
        return save(figure, folder, "figure_9_training")


def training_table(cards: Mapping[int, Mapping[str, Any]]) -> list[str]:
    """What the cards say of the trainings.

    Args:
        cards: Training seed: card of the policy.

    Returns:
        Lines of Markdown; cards that say nothing give dashes.
    """
    titles = [f"{title}: success / share of steps within 1.2 m" for _, title in _PARTS]
    lines = head(["training", "scene steps", "transitions", *titles, "SAC / reward / physics and the rest"])
    for seed, card in cards.items():
        found = card.get("metrics", {})
        parts = [
            f"{found[part]['success']:.3f} / {found[part]['intrusion_share']:.3f}" if part in found else "-"
            for part, _ in _PARTS
        ]
        counts = [str(card.get(key, "-")) for key in ("scene_steps", "transitions")]
        lines.append(row([str(seed), *counts, *parts, _time(card.get("history", []))]))
    return lines


def _time(history: Sequence[Mapping[str, Any]]) -> str:
    if not history:
        return "-"
    seconds = history[-1]["seconds"]
    everything = seconds["all"]
    shares = [seconds["sac"] / everything, seconds["reward"] / everything]
    return " / ".join(f"{share:.0%}" for share in (*shares, 1.0 - sum(shares))) + f" of {everything / 60.0:.1f} min"
