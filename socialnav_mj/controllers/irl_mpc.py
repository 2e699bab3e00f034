"""`irl_mpc`: the planner `mpc` with a learned reward in place of the hand-made cost of nearness."""

from dataclasses import dataclass, field

import numpy as np

from socialnav_mj.controllers.base import Limits
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.controllers.planning import learned
from socialnav_mj.controllers.planning.arrays import costs_of
from socialnav_mj.controllers.planning.learned_arrays import learned_costs
from socialnav_mj.controllers.planning.planner import STEPS, Preset
from socialnav_mj.controllers.planning.search import Costs
from socialnav_mj.controllers.planning.terms import Crowd
from socialnav_mj.controllers.policy_card import PolicyError
from socialnav_mj.controllers.replay_irl import DEFAULT_POLICY, TrainedPolicy, load_policy
from socialnav_mj.controllers.weights import checked_checksum
from socialnav_mj.features import GOAL_FLAG, absorbing_state
from socialnav_mj.geometry import Array

FEATURES = "continuous"
"""The only feature set whose values along a plan are computed."""


@dataclass(kw_only=True)
class IRLMPC(MPC):
    """Weighs plans by time, clearance and entrances as `mpc` does, and by what ReplayIRL's reward network says.

    The reward is asked for every 0.8 s along a plan, of the state that the agent would see then. What it is short of
    the reward of being at the goal costs `learned_weight` times as much a second, decaying with the time ahead as the
    zone's cost does.
    """

    preset: Preset = "free"
    """As in `mpc`; "free" has no hand-made cost of nearness."""
    policy: str = DEFAULT_POLICY
    """Whose reward: name of a shipped policy, or path of a .safetensors file; its features are to be "continuous"."""
    checksum: str | None = None
    """sha256 that the weights must have; None takes them as they are. It travels in every episode."""
    learned_weight: float = 1.0
    """Cost of a second in which the reward is 1 less than at the goal, >= 0 [1]."""
    name: str = "irl_mpc"
    _trained: TrainedPolicy = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        weight = self.learned_weight
        if not (isinstance(weight, (int, float)) and 0.0 <= weight < np.inf):
            raise ValueError(f"learned_weight = {weight!r} is not allowed; allowed: numbers >= 0")
        self._trained = load_policy(self.policy)
        self.checksum = checked_checksum(self.policy, self._trained.checksum, self.checksum)
        if self._trained.features.name != FEATURES:
            raise PolicyError(
                f"policy {self.policy!r} has features {self._trained.features.name!r}; irl_mpc needs {FEATURES!r}"
            )

    def reset(self, limits: Limits, *, seed: int = 0) -> None:
        """Forget everything and take the limits of the episode to come.

        Args:
            limits: What the robots of that episode can do.
            seed: Of the random samples.
        """
        super().reset(limits, seed=seed)
        self._layers = tuple((np.ascontiguousarray(weight.T), bias) for weight, bias in self._trained.reward)
        at_goal = absorbing_state(self._trained.features.size, GOAL_FLAG)[None]
        self._top = float(self._trained.reward_of(at_goal)[0])
        every = STEPS // learned.ASKED
        self._scale: Array = self.learned_weight * every * self._terms.zone_time[every - 1 :: every]

    def _costs(self, speed: Array, yaw_rate: Array, goal: Array, crowd: Crowd) -> Costs:
        most = float(self._scale.sum()) * (1.0 + self._top)

        def costs(plans: Array, best: Array) -> tuple[Array, Array]:
            states = np.full((*plans.shape[:2], learned.ASKED, 6), np.nan)
            # The reward may turn the order by as much as it can cost.
            base, clearance = costs_of(plans, speed, yaw_rate, goal, crowd, self._terms, best.copy(), most, states)
            asked = (base, states, goal, crowd.x, crowd.y, self._terms.step, self._scale, self._top, self._layers)
            loops = learned.compiled()
            return (learned_costs(*asked) if loops is None else loops(*asked, best.copy())), clearance

        return costs
