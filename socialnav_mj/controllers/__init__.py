"""Controllers: what commands the agents, the protocol that it keeps, and how it is named."""

from socialnav_mj.controllers.base import Controller, Limits, Observation, TwistController
from socialnav_mj.controllers.go_straight import GoStraight
from socialnav_mj.controllers.hybrid import Hybrid
from socialnav_mj.controllers.mpc import MPC
from socialnav_mj.controllers.potential_field import PotentialField, PotentialFieldCapped
from socialnav_mj.controllers.registry import (
    BUILT_IN,
    available,
    class_path,
    factory_of,
    make_controller,
    split_label,
)
from socialnav_mj.controllers.replay_irl import ReplayIRL
from socialnav_mj.controllers.specs import controller_config, controller_of, described_settings, spec_of
from socialnav_mj.controllers.trainings import with_policy_of, with_training

__all__ = [
    "BUILT_IN",
    "MPC",
    "Controller",
    "GoStraight",
    "Hybrid",
    "Limits",
    "Observation",
    "PotentialField",
    "PotentialFieldCapped",
    "ReplayIRL",
    "TwistController",
    "available",
    "class_path",
    "controller_config",
    "controller_of",
    "described_settings",
    "factory_of",
    "make_controller",
    "spec_of",
    "split_label",
    "with_policy_of",
    "with_training",
]
