"""Controllers that choose among others, beside everybody they choose from: is a mixture better than its best part?"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from socialnav_mj.controllers import Controller, controller_config, make_controller
from socialnav_mj.controllers.registry import parts_of
from socialnav_mj.studies.leaderboard.board import RANKED, Board

SWITCH = "hybrid"
"""The paper's mixture, with which every other is compared as well."""
SUCCESS, NEARNESS = "success", "intrusion_share_of_steps"


@dataclass(frozen=True, kw_only=True)
class Family:
    """A controller that chooses, and its parts, all under their names on the board."""

    child: str
    parents: tuple[str, ...]
    """Without those that are not on the board."""
    missing: tuple[str, ...]
    """Names of the parts that are not on the board."""


def families_of(specs: Sequence[str]) -> tuple[Family, ...]:
    """Which controllers of a board are made of others.

    Args:
        specs: As `make_controller` takes them.

    Returns:
        In their order.
    """
    made = {spec: make_controller(spec) for spec in specs}
    known = {_identity(controller): spec for spec, controller in made.items()}
    families = []
    for spec, controller in made.items():
        parts = [part for name in parts_of(type(controller)) for part in _flat(getattr(controller, name))]
        if len(parts) < 2:
            continue
        found = [(known.get(_identity(part)), part.name) for part in parts]
        parents = [parent for parent, _ in found if parent is not None]
        parents += [SWITCH] * (SWITCH in specs and SWITCH not in (spec, *parents))
        missing = tuple(name for parent, name in found if parent is None)
        families.append(Family(child=spec, parents=tuple(parents), missing=missing))
    return tuple(families)


def there(families: Sequence[Family], board: Board) -> tuple[Family, ...]:
    """Those of the families that a board can compare.

    Args:
        families: Of a whole study.
        board: May have fewer controllers.

    Returns:
        Whose child is on the board, with the parents that are on it as well.
    """
    found = []
    for family in families:
        parents = tuple(parent for parent in family.parents if parent in board.controllers)
        if parents and family.child in board.controllers:
            found.append(Family(child=family.child, parents=parents, missing=family.missing))
    return tuple(found)


def _flat(parts: Any) -> Iterator[Controller]:
    yield from parts if isinstance(parts, list | tuple) else (parts,)


def _identity(controller: Controller) -> str:
    config = {key: value for key, value in controller_config(controller).items() if key != "name"}
    return repr(sorted(config.items()))


def compare(board: Board, family: Family) -> list[dict[str, Any]]:
    """A child beside each of its parents, in every scenario and measure.

    Args:
        board: That has them all.
        family: Whose.

    Returns:
        Rows of a table: difference of means, child minus parent; the draws' probability of improvement; and 1 if the
        child is distinguishably better, -1 if it is worse, 0 if they are tied, all pairs of the board together.
    """
    rows = []
    place = {name: k for k, name in enumerate(board.controllers)}
    child = place[family.child]
    for scenario in board.scenarios:
        for parent in family.parents:
            for measure in RANKED:
                ranks, other = board.ranks[scenario, measure], place[parent]
                rows.append(
                    {
                        "recording": board.recording,
                        "setting": board.setting,
                        "scenario": scenario,
                        "controller": family.child,
                        "parent": parent,
                        "measure": measure,
                        "difference": board.mean(scenario, child, measure) - board.mean(scenario, other, measure),
                        "probability_of_improvement": float(ranks.improvement[child, other]),
                        "verdict": int(ranks.better[child, other]) - int(ranks.better[other, child]),
                    }
                )
    return rows


def verdict(board: Board, family: Family, scenario: str) -> str:
    """Whether a mixture is better than the best of its parts.

    Args:
        board: That has them all.
        family: Whose.
        scenario: Name of a task.

    Returns:
        "success" or "nearness" if it is distinguishably better there than every parent; "front" if, for each parent, it
        is distinguishably better in one of the two and not distinguishably worse in the other; else "no".
    """
    rows = [row for row in compare(board, family) if row["scenario"] == scenario]
    by_parent = {
        parent: {row["measure"]: row["verdict"] for row in rows if row["parent"] == parent} for parent in family.parents
    }
    for name, measure in (("success", SUCCESS), ("nearness", NEARNESS)):
        if by_parent and all(found[measure] > 0 for found in by_parent.values()):
            return name
    apart = [sorted((found[SUCCESS], found[NEARNESS])) for found in by_parent.values()]
    return "front" if apart and all(low >= 0 and high > 0 for low, high in apart) else "no"
