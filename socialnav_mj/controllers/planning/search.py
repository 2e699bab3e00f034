"""The search for a good plan: a library, the plan of the step before, and random refinements of the best."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from socialnav_mj.controllers.planning.loops import bearing
from socialnav_mj.geometry import Array

HEADINGS = (0.0, 0.2, -0.2, 0.45, -0.45, 0.8, -0.8, 1.2, -1.2, 1.7, -1.7, 2.3, -2.3, np.pi)
"""From the goal's bearing, of the first leg [rad]."""
SPEEDS = (1.0, 0.5)
"""Of the first leg, as shares of the limit [1]."""
DURATIONS = (0.4, 1.0, 2.0)
"""Of the first leg [s]."""
PAUSES = (0.4, 1.2)
"""How long plans stand that stand first [s]."""
SAMPLES = 48
"""Plans a round of refinement."""
KEPT = (4, 3)
"""How many of the best plans each round refines."""
SPREAD = (0.25, 0.25, 0.4, 0.25, 0.25)
"""Standard deviations of psi_1 [rad], v_1 [share of the limit], t_1 [s], psi_2 and v_2 in the first round."""
NARROWING = 0.6
"""By which they are multiplied from round to round."""
LAST_PLAN_BONUS = 0.05
"""By which the plan of the step before is cheaper, so that plans as good as each other do not alternate [s]."""

Costs = Callable[[Array, Array], tuple[Array, Array]]
"""From plans (n, p, 5) and the least costs so far (n, b), as in `loops.loop_costs`, to costs and clearance costs."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """The best plan of each of n agents."""

    plan: Array
    """(n, 5) as in `arrays.plan_costs`."""
    cost: Array
    """(n,) what it costs, less the bonus if it was the last plan [s]."""
    clearance: Array
    """(n,) the part of it that is for clearance [s]."""


@lru_cache(maxsize=8)
def library(max_speed: float) -> Array:
    """Plans to begin with, their headings counted from the goal's bearing.

    Args:
        max_speed: [m/s].

    Returns:
        (p, 5), not to be written to; the first goes straight to the goal.
    """
    plans = [(h, s * max_speed, t, 0.0, max_speed) for h in HEADINGS for s in SPEEDS for t in DURATIONS]
    result = np.array([*plans, *((0.0, 0.0, t, 0.0, max_speed) for t in PAUSES)])
    result.flags.writeable = False
    return result


def search(costs: Costs, goal: Array, last: Array, *, noise: Array, max_speed: float) -> Choice:
    """Find a good plan for each agent.

    Args:
        costs: What plans cost.
        goal: (n, 2) in the agents' frames [m].
        last: (n, 5) plans of the step before as they look now; NaN where there is none.
        noise: (rounds, samples, 5) standard normal numbers of the refinements, the same for all agents.
        max_speed: [m/s].

    Returns:
        The cheapest of all plans tried; of equal ones the earliest.
    """
    n = len(goal)
    fresh = np.repeat(library(max_speed)[None], n, axis=0)
    fresh[..., 0] += bearing(goal[:, 1], goal[:, 0])[:, None]
    known = ~np.isnan(last[:, :1])
    kept = np.where(known, last, fresh[:, 0])[:, None]
    cost, clearance = costs(kept, np.full((n, 1), np.inf))
    cost = cost - LAST_PLAN_BONUS * known
    spread = np.array(SPREAD) * [1.0, max_speed, 1.0, 1.0, max_speed]
    for number, keep in enumerate((*KEPT[: len(noise)], 1)):
        best = np.full((n, keep), np.inf)
        best[:, : cost.shape[1]] = cost[:, :keep]
        new_cost, new_clearance = costs(fresh, best)
        cost = np.concatenate([cost, new_cost], axis=1)
        order = np.argsort(cost, axis=1, kind="stable")[:, :keep]
        agent = np.arange(n)[:, None]
        kept = np.concatenate([kept, fresh], axis=1)[agent, order]
        clearance = np.concatenate([clearance, new_clearance], axis=1)[agent, order]
        cost = cost[agent, order]
        if number < len(noise):
            fresh = kept[:, np.arange(noise.shape[1]) % keep] + NARROWING**number * spread * noise[number]
            fresh[..., [1, 4]] = np.clip(fresh[..., [1, 4]], 0.0, max_speed)
            fresh[..., 2] = np.maximum(fresh[..., 2], 0.0)
    return Choice(plan=kept[:, 0], cost=cost[:, 0], clearance=clearance[:, 0])
