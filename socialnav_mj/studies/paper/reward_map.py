"""Figure 7: a learned reward as a function of where, and which way, one walker walks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from socialnav_mj.controllers.replay_irl import TrainedPolicy
from socialnav_mj.features import View, running_state
from socialnav_mj.geometry import Array
from socialnav_mj.metrics import INTIMATE_DISTANCE
from socialnav_mj.report.style import new_figure, save, style

FIGURE = "figure_7_learned_reward"
AGENT_SPEED, WALKER_SPEED, GOAL_DISTANCE = 0.8, 1.0, 5.0
"""The agent drives ahead, its goal ahead [m/s], [m/s], [m]."""
REACH, N_GRID = 3.0, 121
"""Half the side of the map [m], and points along it."""
SHOWN = 3
"""Trainings that have a row of their own, the first ones."""
_DIRECTIONS = 120
"""In which `worth_of_company` looks."""


def _approaching(ahead: Array) -> Array:
    return -ahead


def _crossing(ahead: Array) -> Array:
    return np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)


def _receding(ahead: Array) -> Array:
    return ahead


MOTIONS: dict[str, Callable[[Array], Array]] = {
    "approaching": _approaching,
    "crossing": _crossing,
    "receding": _receding,
}
"""Unit vector from the agent to the walker, (..., 2): direction in which it walks; crossing is counter-clockwise."""


@dataclass(frozen=True, kw_only=True)
class RewardMap:
    """Learned reward with one walker at each point of a square around the agent."""

    x: Array
    """(n,) ahead of the agent [m]."""
    y: Array
    """(n,) to its left [m]."""
    reward: Array
    """(n, n) by y and x, in (-1, 1)."""
    alone: float
    """Reward of the same state with nobody there."""


def reward_map(policy: TrainedPolicy, motion: str) -> RewardMap:
    """Evaluate the reward network on a grid of walkers.

    Args:
        policy: Trained.
        motion: Of `MOTIONS`.

    Returns:
        The map.

    Raises:
        ValueError: If the motion is unknown.
    """
    axis = np.linspace(-REACH, REACH, N_GRID)
    position = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 1, 2)
    reward = _with_a_walker(policy, motion, position)
    return RewardMap(x=axis, y=axis, reward=reward.reshape(N_GRID, N_GRID), alone=_alone(policy))


def worth_of_company(policy: TrainedPolicy, motion: str, distance: float) -> float:
    """What a walker at a distance adds to the learned reward of a step, the mean over all directions.

    Args:
        policy: Trained.
        motion: Of `MOTIONS`.
        distance: > 0 [m].

    Returns:
        The difference to nobody, in (-2, 2): above 0 the reward prefers company, below it solitude.

    Raises:
        ValueError: If the motion is unknown.
    """
    angle = 2.0 * np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    ahead = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]
    return float(np.mean(_with_a_walker(policy, motion, distance * ahead))) - _alone(policy)


def _with_a_walker(policy: TrainedPolicy, motion: str, position: Array) -> Array:
    """Reward with one walker at each place of (n, 1, 2), shape (n,)."""
    if motion not in MOTIONS:
        raise ValueError(f"unknown motion {motion!r}; available: {', '.join(MOTIONS)}")
    distance = np.maximum(np.linalg.norm(position, axis=-1, keepdims=True), 1e-9)
    velocity = WALKER_SPEED * MOTIONS[motion](position / distance) - (AGENT_SPEED, 0.0)
    return _reward(policy, position, velocity)


def _alone(policy: TrainedPolicy) -> float:
    """Reward with nobody there."""
    return float(_reward(policy, np.zeros((1, 0, 2)), np.zeros((1, 0, 2)))[0])


def _reward(policy: TrainedPolicy, position: Array, velocity: Array) -> Array:
    n = len(position)
    view = View(
        goal=np.tile([GOAL_DISTANCE, 0.0], (n, 1)),
        twist=np.tile([AGENT_SPEED, 0.0], (n, 1)),
        position=position,
        velocity=velocity,
        present=np.ones(position.shape[:2], dtype=bool),
    )
    return policy.reward_of(running_state(policy.features(view)))


def _mean(maps: Sequence[RewardMap]) -> RewardMap:
    reward, alone = (np.mean([getattr(each, name) for each in maps], axis=0) for name in ("reward", "alone"))
    return RewardMap(x=maps[0].x, y=maps[0].y, reward=reward, alone=float(alone))


def rows_of(policies: Mapping[str, TrainedPolicy]) -> dict[str, list[TrainedPolicy]]:
    """Rows of a figure of many trainings: their mean, and the first ones.

    Args:
        policies: Title: policy.

    Returns:
        Title: policies, for `draw_reward_maps`.
    """
    mean = {f"mean of {len(policies)}": [*policies.values()]} if len(policies) > 1 else {}
    return mean | {title: [policies[title]] for title in [*policies][:SHOWN]}


def draw_reward_maps(rows: Mapping[str, Sequence[TrainedPolicy]], folder: Path, name: str = FIGURE) -> list[Path]:
    """Heat maps: a row for the mean of some policies' rewards, a column for each motion of the walker.

    A white line runs where a walker changes nothing; the same value is marked "alone" on the scale.

    Args:
        rows: Title: policies, one or more.
        folder: Gets a PNG and an SVG.
        name: Of both, without ending.

    Returns:
        Paths of the files.
    """
    maps = {title: [_mean([reward_map(p, motion) for p in of]) for motion in MOTIONS] for title, of in rows.items()}
    with style():
        figure = new_figure(1.05 + 1.95 * len(maps))
        figure.suptitle(
            f"Learned reward of an agent at {AGENT_SPEED:g} m/s with its goal {GOAL_DISTANCE:g} m ahead, by where "
            f"one walker is ({WALKER_SPEED:g} m/s along the arrows)\n"
            f"white line: the same reward as with nobody there; dashed circle: {INTIMATE_DISTANCE:g} m",
            fontsize=8.0,
        )
        grid = figure.subplots(len(maps), len(MOTIONS), sharex=True, sharey=True, squeeze=False)
        for axes, motion in zip(grid[0], MOTIONS, strict=True):
            axes.set_title(f"walker {motion}")
        for (title, row), axes_row in zip(maps.items(), grid, strict=True):
            low = min(*(float(m.reward.min()) for m in row), row[0].alone)
            high = max(*(float(m.reward.max()) for m in row), row[0].alone)
            for motion, one, axes in zip(MOTIONS, row, axes_row, strict=True):
                drawn = axes.pcolormesh(
                    one.y, one.x, one.reward.T, cmap="cividis", vmin=low, vmax=high, rasterized=True, shading="nearest"
                )
                if low < one.alone < high:
                    axes.contour(
                        one.y,
                        one.x,
                        one.reward.T,
                        levels=[one.alone],
                        colors="white",
                        linestyles="solid",
                        linewidths=0.9,
                    )
                _furnish(axes, motion)
            axes_row[0].set_ylabel(f"{title}\nahead [m]")
            bar = figure.colorbar(drawn, ax=list(axes_row), label="learned reward", shrink=0.9)
            bar.ax.axhline(row[0].alone, color="white", linewidth=2.0)
            bar.ax.annotate(
                "alone", (0.0, row[0].alone), (-2, 0), textcoords="offset points", ha="right", va="center", fontsize=6.5
            )
        for axes in grid[-1]:
            axes.set_xlabel("to the left [m]")
        return save(figure, folder, name)


def _furnish(axes: Axes, motion: str) -> None:
    """The agent, the 1.2 m around it, and the walker's direction here and there; left is left, ahead is up."""
    axes.add_patch(Polygon([(0.0, 0.3), (0.17, -0.17), (-0.17, -0.17)], facecolor="white", edgecolor="black"))
    axes.add_patch(Circle((0.0, 0.0), INTIMATE_DISTANCE, fill=False, edgecolor="black", linestyle="--", linewidth=0.8))
    angle = np.arange(8) * np.pi / 4.0 + np.pi / 8.0
    place = 2.25 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    heading = MOTIONS[motion](place / 2.25)
    axes.quiver(
        place[:, 1],
        place[:, 0],
        heading[:, 1],
        heading[:, 0],
        color="white",
        edgecolor="black",
        linewidth=0.4,
        angles="xy",
        scale=11.0,
        width=0.014,
    )
    axes.set_xlim(REACH, -REACH)
    axes.set_ylim(-REACH, REACH)
    axes.set_aspect("equal")
    axes.grid(False)
