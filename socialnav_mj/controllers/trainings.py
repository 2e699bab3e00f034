"""Which trained policy a learned controller acts with: the recording's own, and that of another training seed."""

import re
from functools import partial
from typing import Any

from socialnav_mj.config import Scenario, TurnLimit
from socialnav_mj.controllers.registry import BUILT_IN, parse, parts_of, split_label
from socialnav_mj.controllers.replay_irl import DEFAULT_POLICY, policy_of, shipped_policies
from socialnav_mj.controllers.specs import controller_config, each, text_of

LEARNED = ("replay_irl", "irl_mpc")
"""Built-in controllers that a field `policy` lets act with a trained policy."""


def with_policy_of(spec: str, dataset: str, turn_limit: TurnLimit = Scenario.turn_limit) -> str:
    """Let a learned controller act with the policy that learned from the recording it is to be judged on.

    Args:
        spec: As `make_controller` takes it.
        dataset: Name of the recording.
        turn_limit: Under which the policy is to have been trained, if there is one that was.

    Returns:
        The spec with the recording's shipped policy wherever one of `LEARNED` stands without one; unchanged if it names
        its policies, learns nothing, or no shipped policy learned from this recording alone.

    Raises:
        ValueError: If the spec cannot be read.
    """
    policy = policy_of(dataset, turn_limit)
    label, plain = split_label(spec)
    name, config = parse(plain)
    found: dict[str, Any] = {}
    if name in LEARNED and "policy" not in config and policy != DEFAULT_POLICY:
        found = {"policy": policy}
    elif name in BUILT_IN and parts_of(BUILT_IN[name]):
        default = controller_config(BUILT_IN[name]())
        parts = {part: config.get(part, default[part]) for part in parts_of(BUILT_IN[name])}
        own = {
            part: each(old, partial(with_policy_of, dataset=dataset, turn_limit=turn_limit))
            for part, old in parts.items()
        }
        found = {part: new for part, new in own.items() if new != parts[part]}
    if not found:
        return spec
    return ("" if label is None else f"{label}=") + text_of(name, config | found)


def with_training(spec: str, seed: int) -> str | None:
    """Let a learned controller act with the policy of another training seed.

    Args:
        spec: As `make_controller` takes it.
        seed: Of the training.

    Returns:
        The spec with NAME_seedSEED wherever a shipped policy NAME_seedN stands, in its parts too; None if nothing in it
        is learned, or there is no such training.

    Raises:
        ValueError: If the spec cannot be read.
    """
    label, plain = split_label(spec)
    name, config = parse(plain)
    if name not in BUILT_IN:
        return None
    default = controller_config(BUILT_IN[name]())
    found: dict[str, Any] = {}
    policy = config.get("policy", default.get("policy"))
    if isinstance(policy, str) and re.search(r"_seed\d+$", policy):
        found["policy"] = re.sub(r"_seed\d+$", f"_seed{seed}", policy)
        if found["policy"] not in shipped_policies():
            return None
    for part in parts_of(BUILT_IN[name]):
        old = config.get(part, default[part])
        is_trained: list[bool] = []

        def trained(one: str, known: list[bool] = is_trained) -> str:
            new = with_training(one, seed)
            known.append(new is not None)
            return new or one

        new = each(old, trained)
        found |= {part: new} if any(is_trained) else {}
    return ("" if label is None else f"{label}=") + text_of(name, config | found) if found else None
