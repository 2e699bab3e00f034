"""`medirl_sam`: maximum-entropy deep inverse reinforcement learning on social-affinity-map features."""

from dataclasses import dataclass

from socialnav_mj.controllers.replay_irl import ReplayIRL


@dataclass(kw_only=True)
class MEDIRLSAM(ReplayIRL):
    """Acts as `replay_irl` does, with a policy and a reward that see a social affinity map (`features/affinity.py`).

    After Fahad et al. (2018, "Learning how pedestrians navigate: a deep inverse reinforcement learning approach",
    IROS): their features, a reward network under the maximum-entropy likelihood. They compute its gradient by value
    iteration on a grid of places; here it is estimated on SAC's replay buffer, as `replay_irl`'s is, so that the
    features are all that differs between the two.
    """

    policy: str = "students003_sam_seed0"
    """Name of a shipped policy, or path of a .safetensors file."""
    name: str = "medirl_sam"
