"""Fixed-size descriptions of what an agent sees, for learned rewards and policies; pure functions.

Everything is taken from an observation in the agent's own frame (see `socialnav_mj.observation`), so features do not
change when the scene is moved or turned. Pedestrians and other agents are people alike.
"""

from socialnav_mj.features.affinity import Affinity
from socialnav_mj.features.companions import Companions
from socialnav_mj.features.continuous import SIGHT, Continuous
from socialnav_mj.features.people import People
from socialnav_mj.features.risk import Risk
from socialnav_mj.features.sets import FEATURE_SETS, FeatureSet, feature_set
from socialnav_mj.features.states import (
    COLLISION_FLAG,
    GOAL_FLAG,
    N_FLAGS,
    absorbing_state,
    mirror_state,
    running_state,
)
from socialnav_mj.features.view import HORIZON, View, closest_approach, view_of

__all__ = [
    "COLLISION_FLAG",
    "FEATURE_SETS",
    "GOAL_FLAG",
    "HORIZON",
    "N_FLAGS",
    "SIGHT",
    "Affinity",
    "Companions",
    "Continuous",
    "FeatureSet",
    "People",
    "Risk",
    "View",
    "absorbing_state",
    "closest_approach",
    "feature_set",
    "mirror_state",
    "running_state",
    "view_of",
]
