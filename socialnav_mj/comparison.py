"""Two files of bench side by side: what costs more or less than before, beyond what repetitions differ by."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from socialnav_mj.provenance import differences

Row = Mapping[str, Any]


def _ratios(over: Sequence[float], under: Sequence[float]) -> list[float]:
    return [a / b for a, b in zip(over, under, strict=True)]


# What the files of `bench` have of each case: the values of its repetitions, or one that all of them share.
_EPISODES: dict[str, Callable[[Row], Sequence[float]]] = {
    "episode CPU [s]": lambda row: row["episode_cpus"],
    "bare mj_step CPU [s]": lambda row: row["physics_cpus"],
    "episode / mj_step": lambda row: _ratios(row["episode_cpus"], row["physics_cpus"]),
    "robots built": lambda row: [row["n_robots"]],
    "trace [MB]": lambda row: [row["trace_megabytes"]],
}
_CONTROLLERS: dict[str, Callable[[Row], Sequence[float]]] = {
    "controller [us]": lambda row: [1e6 * seconds for seconds in row["act_cpus"]],
    "mj_step [us]": lambda row: [1e6 * seconds for seconds in row["physics_cpus"]],
    "controller / mj_step": lambda row: _ratios(row["act_cpus"], row["physics_cpus"]),
}
_KINDS = {"costs": ("scenario", _EPISODES), "controllers": ("controller", _CONTROLLERS)}


@dataclass(frozen=True, kw_only=True)
class Change:
    """One figure of one case, before and after."""

    case: str
    """Scenario, or controller."""
    measure: str
    before: tuple[float, ...]
    """Of each repetition, one or more, > 0; less is better."""
    after: tuple[float, ...]

    @property
    def ratio(self) -> float:
        """Median after over median before."""
        return median(self.after) / median(self.before)

    @property
    def ratio_low(self) -> float:
        """The least after over the greatest before."""
        return min(self.after) / max(self.before)

    @property
    def ratio_high(self) -> float:
        """The greatest after over the least before."""
        return max(self.after) / min(self.before)

    @property
    def verdict(self) -> str:
        """More or less, if every repetition after lies beyond every one before; else nothing is said."""
        return "more" if self.ratio_low > 1.0 else "less" if self.ratio_high < 1.0 else "-"

    def exceeds(self, at_most: float) -> bool:
        """Whether it grew beyond a bound, and not by what repetitions differ by alone.

        Args:
            at_most: Allowed `ratio`.

        Returns:
            True if every repetition after is above every one before, and the medians' ratio above the bound.
        """
        return self.verdict == "more" and self.ratio > at_most


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What became of every figure of a file of `bench`."""

    changes: tuple[Change, ...]
    notes: tuple[str, ...]
    """Versions and machines that differ: then the code is not the only reason."""


def compare(before: Path, after: Path) -> Comparison:
    """Set two files of `bench --out` side by side.

    Args:
        before: Of the same scenarios or controllers,
        after: with the same settings.

    Returns:
        A change for each case and measure.

    Raises:
        ValueError: If one is not a file of `bench`, or they do not measure the same.
        FileNotFoundError: If one is not there.
    """
    old, new = _read(before), _read(after)
    kind = next(kind for kind in _KINDS if kind in old)
    if kind not in new:
        raise ValueError(f"{before} has {kind} and {after} has none; compare two of episodes or two of controllers")
    for key in ("recording", "settings"):
        if found := differences(old.get(key), new.get(key), key):
            raise ValueError(f"{before} and {after} do not measure the same: {'; '.join(found)}")
    label, measures = _KINDS[kind]
    cases = [{row[label]: row for row in content[kind]} for content in (old, new)]
    if list(cases[0]) != list(cases[1]):
        first, second = (", ".join(own) for own in cases)
        raise ValueError(f"{before} has {first}, but {after} has {second}; measure the same {label}s")
    changes = tuple(
        Change(case=case, measure=name, before=tuple(values(row)), after=tuple(values(cases[1][case])))
        for case, row in cases[0].items()
        for name, values in measures.items()
    )
    notes = tuple(
        note for key in ("versions", "platform") for note in differences(old.get(key), new.get(key), key) if note
    )
    return Comparison(changes=changes, notes=notes)


def _read(path: Path) -> dict[str, Any]:
    """A file of `bench`, of which every figure that is compared is there and positive."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        kind = next(kind for kind in _KINDS if kind in content)
        label, measures = _KINDS[kind]
        for row in content[kind]:
            values = [value for measure in measures.values() for value in measure(row)]
            if not isinstance(row[label], str) or not values or not all(value > 0.0 for value in values):
                raise ValueError(f"figures of {row[label]!r} are not numbers > 0")
    except StopIteration:
        lacks = f"it has no {' or '.join(_KINDS)}"
        raise ValueError(f"{path} is not a file of `socialnav-mj bench --out FILE`: {lacks}") from None
    except (ValueError, KeyError, TypeError, ZeroDivisionError) as error:
        raise ValueError(f"{path} is not a file of `socialnav-mj bench --out FILE`: {error!r}") from error
    return dict(content)
