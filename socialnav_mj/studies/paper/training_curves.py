"""Figure 9: validation success, intrusions and collided trips over each training, from the policies' cards."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from socialnav_mj.report.markdown import head, row
from socialnav_mj.report.style import new_figure, save, style
from socialnav_mj.studies.looks import LINES, MARKERS, SHADES

_PANELS = (
    ("success", "validation success"),
    ("intrusion_share", "share of steps within 1.2 m"),
    ("training_collided", "training trips that collide"),
)
_PARTS = (("in_sample", "in-sample"), ("validation", "validation"), ("held_out", "held out"))


def draw_training_curves(cards: Mapping[int, Mapping[str, Any]], folder: Path) -> list[Path]:
    """A line for each training over its scene steps; a ring marks the checkpoint that was kept.

    Args:
        cards: Training seed: card of the policy, with a `history`.
        folder: Gets a PNG and an SVG.

    Returns:
        Paths of the files.
    """
    with style():
        figure = new_figure(2.5)
        for axes, (key, label) in zip(figure.subplots(1, len(_PANELS)), _PANELS, strict=True):
            for k, (seed, card) in enumerate(cards.items()):
                steps = [entry["scene_steps"] / 1000.0 for entry in card["history"]]
                values = [entry[key] for entry in card["history"]]
                look = {"color": SHADES[k % 4], "marker": MARKERS[k % 4], "linestyle": LINES[k % 4]}
                axes.plot(steps, values, label=f"training {seed}", markersize=3.0, clip_on=False, **look)
                kept = [(x, y) for x, y in zip(steps, values, strict=True) if x == card["scene_steps"] / 1000.0]
                for x, y in kept:
                    axes.plot(x, y, marker="o", markersize=9.0, fillstyle="none", color=SHADES[k % 4], clip_on=False)
            axes.set_xlabel("thousand scene steps")
            axes.set_ylabel(label)
            # Room for the rings; what lies on an axis is drawn whole.
            axes.margins(x=0.07)
            axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4)
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
