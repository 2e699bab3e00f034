"""Configuration of a training; it travels in every checkpoint and policy card."""

from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from socialnav_mj.config import TurnLimit
from socialnav_mj.features import feature_set

Partition = Literal["fused", "importance", "segment"]
Reward = Literal["learned", "constant", "task"]
Matching = Literal["none", "density"]


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Everything that decides a training, apart from the recordings' contents."""

    datasets: tuple[str, ...] = ("plaza",)
    """Recordings that the crowd and the experts come from; their scenes take turns."""
    train_window: tuple[float, float] = (0.0, 0.6)
    """Part of each recording that is learned from, as shares of its duration."""
    validation_window: tuple[float, float] = (0.6, 0.7)
    """Part that the best checkpoint is chosen on."""
    test_window: tuple[float, float] = (0.7, 1.0)
    """Part that nothing is learned or chosen on; the card's held-out figures."""
    features: str = "continuous"
    """Feature set of policy and reward."""
    seed: int = 0
    """Of networks, exploration, sampling and draws."""

    turn_limit: TurnLimit = "per_step"
    """Reading of the paper's turn limit, in training and validation."""
    scene_steps: int = 15_000
    """Control steps of the training scene; every agent under way gives a transition at each."""
    shares: tuple[float, ...] = (0.1, 0.2, 0.3)
    """Shares of replaced people; the scenes take turns. Agents evade one another and people do not: among many agents
    less is learned about people."""
    n_slots: int = 64
    """Environments of the vector environment, at most as many agents at once; draws that need more are passed over."""
    robot_radius: float = 0.25
    """Of the robots in the training scene, larger than in the evaluation, so that the policy keeps a margin [m]."""
    pedestrian_radius: float = 0.31
    """Of people in the training scene, likewise [m]."""

    hidden: tuple[int, ...] = (64, 64)
    """Hidden layers of actor, critics and reward network."""
    gamma: float = 0.95
    """Discount of a control step."""
    learning_rate: float = 1e-3
    """Of SAC and reward, falling linearly to a tenth."""
    batch_size: int = 256
    """Of SAC and of either half of a reward step."""
    tau: float = 0.005
    """Polyak average of the target critics."""
    updates_per_scene_step: int = 4
    """SAC updates after each control step of the scene."""
    updates_per_reward_step: int = 4
    """SAC updates between two reward steps."""
    averaging_power: float = 8.0
    """Of the average of the actor's weights that is validated and kept: update t of SAC counts about as t to this
    power, so their mean age is a tenth of t (polynomial-decay averaging, Shamir and Zhang, ICML 2013)."""
    guided_scene_steps: int = 2500
    """Control steps before any update, in which the guide acts instead of the actor."""
    guide: str = "potential_field_capped"
    """Controller that fills the buffer at first; from uniformly random actions SAC learned to freeze before people."""
    guide_noise: float = 0.4
    """Standard deviation of the normal noise on the guide's actions, in [-1, 1] units."""
    target_entropy: float = -0.5
    """Of SAC's automatic temperature; SAC's own default for two actions is -2."""
    buffer_size: int = 300_000
    """Transitions that the shared replay buffer holds."""

    reward: Reward = "learned"
    """What SAC earns: the learned reward; "constant": `step_reward` at every step, `goal_reward` and `collision_reward`
    for ever in the absorbing states; "task": the tasks' own (progress, arrival, collision), once. The last two learn
    nothing from people and are there for comparison."""
    step_reward: float = 0.0
    """Of every step under way, for reward="constant"."""
    goal_reward: float = 0.35
    """Of every step at the goal, for reward="constant"; about what is learned."""
    collision_reward: float = -0.55
    """Of every step after a collision, for reward="constant"; about what is learned."""
    matching: Matching = "none"
    """Experts of a reward step: drawn from all, or for each state of the policy one at as many occupied sectors beyond
    1.5 m ("density"), so that the reward cannot tell people from agents by how full the place is."""
    companions_seen: bool = False
    """Whether experts see their companions, as they see everybody else or, with features="companions", apart."""
    spectral_norm: bool = False
    """Bound every layer of the reward network to gain 1 (Miyato et al. 2018, doi 10.48550/arXiv.1802.05957)."""
    partition: Partition = "fused"
    """Estimate of log Z, see `socialnav_mj.learning.reward`."""
    segment_length: int = 8
    """Control steps of a segment, for partition="segment"."""
    absorbing_share: float = 0.2
    """Share of absorbing states in the expert's and the policy's half of a reward batch."""
    gradient_penalty: float = 0.1
    """Weight of the squared gradient norm of the reward between the two halves."""
    output_penalty: float = 0.01
    """Weight of the mean squared reward."""
    weight_decay: float = 1e-3
    """Of the reward network."""
    expert_displacement: float = 2.0
    """People who move less are no experts [m]."""
    expert_contact_distance: float = 0.25
    """Recorded people collide when nearer than this to somebody who is no companion: 2 % of the experts of students003.
    At the robots' 0.32 m 14 % would, and demonstrate collisions that were none [m]."""

    expert_clearance: float = 0.56
    """People with somebody nearer than this show nothing: no agent of the training scene can be so near without a
    collision, and the reward would take nearness for what tells people from agents [m]."""

    checkpoint_every: int = 1500
    """Scene steps between checkpoints; each is validated."""
    kept_from: float = 0.8
    """Share of the scene steps after which a checkpoint is kept before any earlier one: validation flatters some early
    ones (docs/learning.md)."""
    validation_shares: tuple[float, ...] = (0.1, 0.1, 0.1, 0.1, 0.3, 0.3, 0.3, 0.9)
    """Scenes of a validation, with draws 0, 1, 2, ..."""
    intrusion_weight: float = 0.5
    """A checkpoint's score is its success - intrusion_weight * share of steps within 1.2 m. Of the late ones the last
    whose score is within one standard error of the best is kept (Breiman et al., Classification and Regression Trees,
    1984)."""

    def __post_init__(self) -> None:
        for name, kind in (
            ("partition", Partition),
            ("reward", Reward),
            ("matching", Matching),
            ("turn_limit", TurnLimit),
        ):
            if getattr(self, name) not in get_args(kind):
                raise ValueError(
                    f"{name} = {getattr(self, name)!r} is not allowed; allowed: {', '.join(get_args(kind))}"
                )
        for name in (
            "scene_steps",
            "n_slots",
            "batch_size",
            "updates_per_scene_step",
            "updates_per_reward_step",
            "checkpoint_every",
        ):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)} is not allowed; allowed: integers >= 1")
        feature_set(self.features)
        if self.matching == "density" and self.features not in ("continuous", "companions"):
            raise ValueError(
                f"matching = 'density' is not allowed with features = {self.features!r}, which do not tell how far "
                "people are; allowed: 'none'"
            )
        for name in ("gamma", "kept_from"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} = {getattr(self, name)} is not allowed; allowed: numbers in [0, 1)")
        for name in (
            "averaging_power",
            "guide_noise",
            "gradient_penalty",
            "output_penalty",
            "weight_decay",
            "expert_displacement",
            "expert_contact_distance",
            "expert_clearance",
            "intrusion_weight",
        ):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} = {getattr(self, name)} is not allowed; allowed: numbers >= 0")
        for name in ("train_window", "validation_window", "test_window"):
            begin, end = getattr(self, name)
            if not 0.0 <= begin < end <= 1.0:
                raise ValueError(f"{name} = {(begin, end)} is not allowed; allowed: 0 <= begin < end <= 1")
        if not self.datasets or not self.shares:
            raise ValueError("datasets and shares must not be empty")

    def as_dict(self) -> dict[str, Any]:
        """All fields as JSON values.

        Returns:
            A dictionary that `from_dict` reads back.
        """
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "TrainingConfig":
        """Inverse of `as_dict`, also after a trip through JSON.

        Args:
            values: As `as_dict` returns them.

        Returns:
            The configuration.
        """
        arguments: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        return cls(**arguments)
