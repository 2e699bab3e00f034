"""Learning which policy to let act, from trials of each: a contextual bandit with known propensities.

In real episodes a policy drawn evenly among the candidates acts for `HOLD` seconds, again and again, for each agent on
its own. What came of each trial is its cost; a ridge regression (Hoerl and Kennard 1970, doi
10.1080/00401706.1970.10488634) of that on the situation, one a policy, says what each would cost, and the switch takes
the least: the direct method of policy learning from logged choices (Dudik et al. 2014, doi 10.1214/14-STS500). Since
the draw is even, no confounding has to be undone, and what the switch is worth is estimated from trials of left-out
draws that happened to agree with it. A short horizon with the distance that is left as what is to come keeps the
cost of one trial from hanging on the choices after it. Linear, because a few thousand trials whose outcomes are mostly
chance do not carry more, and because its weights can be read.
"""

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from socialnav_mj.controllers.situation import NAMES
from socialnav_mj.files import write_json, write_whole
from socialnav_mj.geometry import Array
from socialnav_mj.learning.trials import COLLISION_COST, HOLD, NEARNESS_COST, collect
from socialnav_mj.provenance import package_versions

RIDGES = (1.0, 10.0, 100.0, 1000.0)
"""Of which the one with the least error on left-out episodes is taken, in trials."""
PACKAGES = ("socialnav-mj", "mujoco", "dm-control", "numpy")


def fit(
    choice: NDArray[np.int64], numbers: Array, cost: Array, *, candidates: int, ridge: float
) -> tuple[Array, Array]:
    """Regress cost on the situation, for each candidate on its own trials.

    Args:
        choice: (k,) who acted.
        numbers: (k, f) situations.
        cost: (k,) what came of it [s].
        candidates: How many there are; each needs a trial.
        ridge: Weight of the penalty on slopes, in trials.

    Returns:
        Weight (candidates, f) and bias (candidates,) [s].
    """
    middle, spread = numbers.mean(axis=0), np.maximum(numbers.std(axis=0), 1e-6)
    weight, bias = np.zeros((candidates, numbers.shape[1])), np.zeros(candidates)
    for k in range(candidates):
        own = choice == k
        design = (numbers[own] - middle) / spread
        offset = design.mean(axis=0)
        design = design - offset
        slope = np.linalg.solve(
            design.T @ design + ridge * np.eye(len(middle)), design.T @ (cost[own] - cost[own].mean())
        )
        weight[k] = slope / spread
        bias[k] = cost[own].mean() - slope @ offset - weight[k] @ middle
    return weight, bias


def train_selector(
    folder: Path,
    candidates: Sequence[str],
    *,
    dataset: str,
    shares: Sequence[float],
    draws: int,
    data_dir: str | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Path:
    """Collect trials, choose the ridge on left-out draws, fit, and write weights with their card.

    Args:
        folder: Gets the trials, selector.safetensors and selector.json.
        candidates: Specs of the policies.
        dataset: Name or path of the recording.
        shares: Of the people who are replaced.
        draws: How many draws of each, from draw 0 on.
        data_dir: Where recordings are looked for first.
        progress: Told what was done.

    Returns:
        Path of the weights.

    Raises:
        ValueError: If a setting is not allowed, or a candidate was never tried.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = collect(folder, candidates, dataset=dataset, shares=shares, draws=draws, data_dir=data_dir)
    files = [dict(np.load(path)) for path in paths]
    choice, numbers, cost = (np.concatenate([f[name] for f in files]) for name in ("choice", "situation", "cost"))
    group = np.repeat([int(path.stem[-3:]) for path in paths], [len(f["cost"]) for f in files])
    count = len(candidates)
    if missing := sorted({*range(count)} - {*choice.tolist()}):
        raise ValueError(f"candidate {candidates[missing[0]]!r} was never tried in {len(cost)} trials; run more draws")
    judged = {ridge: left_out(choice, numbers, cost, group, candidates=count, ridge=ridge) for ridge in RIDGES}
    ridge = min(RIDGES, key=lambda one: judged[one]["error"])
    progress(f"{len(cost)} trials, ridge {ridge:g}: {judged[ridge]}")
    weight, bias = fit(choice, numbers, cost, candidates=count, ridge=ridge)
    content = save({"outcomes.0.weight": weight.astype(np.float32), "outcomes.0.bias": bias.astype(np.float32)})
    card: dict[str, Any] = {
        "candidates": list(candidates),
        "features": list(NAMES),
        "dataset": dataset,
        "shares": list(shares),
        "draws": draws,
        "hold": HOLD,
        "collision_cost": COLLISION_COST,
        "nearness_cost": NEARNESS_COST,
        "ridge": ridge,
        "trials": np.bincount(choice, minlength=count).tolist(),
        "mean_cost": [float(cost[choice == k].mean()) for k in range(count)],
        "left_out": judged[ridge],
        "versions": package_versions(PACKAGES),
        "sha256": hashlib.sha256(content).hexdigest(),
    }
    write_whole(folder / "selector.safetensors", content)
    write_json(folder / "selector.json", card)
    return folder / "selector.safetensors"


def left_out(
    choice: NDArray[np.int64],
    numbers: Array,
    cost: Array,
    group: NDArray[np.int64],
    *,
    candidates: int,
    ridge: float,
) -> dict[str, float]:
    """How well costs of draws are told that were not learned from, and what the switch costs in their trials.

    Args:
        choice: (k,) who acted.
        numbers: (k, f) situations.
        cost: (k,) what came of it [s].
        group: (k,) draw of each trial.
        candidates: How many there are.
        ridge: As `fit` takes it.

    Returns:
        error: root mean squared error; constant: that of each candidate's mean; switch: doubly robust estimate (Dudik
        et al. 2014) of the mean cost of a trial if the switch chose who acts; best: that of the candidate which costs
        least in the trials of the other draws; difference and standard_error: of the switch to that candidate, over the
        same trials. All NaN with a single draw [s].
    """
    expected, constant = np.full((len(cost), candidates), np.nan), np.full((len(cost), candidates), np.nan)
    for one in np.unique(group) if len(np.unique(group)) > 1 else ():
        rest, own = group != one, group == one
        weight, bias = fit(choice[rest], numbers[rest], cost[rest], candidates=candidates, ridge=ridge)
        expected[own] = numbers[own] @ weight.T + bias
        constant[own] = [cost[rest & (choice == k)].mean() for k in range(candidates)]
    every = np.arange(len(cost))
    surprise = cost - expected[every, choice]

    def value(chosen: NDArray[np.int64]) -> Array:
        # Expected, and corrected by the trials that agree, whose propensity is one in as many as there are candidates.
        return expected[every, chosen] + candidates * (choice == chosen) * surprise

    switch, best = value(expected.argmin(axis=1)), value(constant.argmin(axis=1))
    return {
        "error": float(np.sqrt(np.mean(surprise**2))),
        "constant": float(np.sqrt(np.mean((constant[every, choice] - cost) ** 2))),
        "switch": float(switch.mean()),
        "best": float(best.mean()),
        "difference": float((switch - best).mean()),
        "standard_error": float((switch - best).std() / np.sqrt(len(cost))),
    }
