"""Configuration of a training of `attention`; it travels in every checkpoint and card."""

from dataclasses import asdict, dataclass
from typing import Any

from socialnav_mj.config import TurnLimit
from socialnav_mj.features import People


@dataclass(frozen=True, kw_only=True)
class AttentionConfig:
    """Everything that decides a training, apart from the recordings' contents."""

    datasets: tuple[str, ...] = ("plaza",)
    """Recordings that the crowd comes from; their scenes take turns."""
    train_window: tuple[float, float] = (0.0, 0.6)
    """Part of each recording that is learned from, as shares of its duration."""
    validation_window: tuple[float, float] = (0.6, 0.7)
    """Part that the best checkpoint is chosen on."""
    test_window: tuple[float, float] = (0.7, 1.0)
    """Part that nothing is learned or chosen on; the card's held-out figures."""
    features: str = People.name
    """Feature set of the network; no other one has people one by one."""
    seed: int = 0
    """Of networks, exploration, sampling and draws."""
    turn_limit: TurnLimit = "per_step"
    """Reading of the paper's turn limit, in training and validation."""

    scene_steps: int = 30_720
    """Control steps of the training scene after the demonstrations; each agent under way gives a transition a step."""
    shares: tuple[float, ...] = (0.1, 0.2, 0.3)
    """Shares of replaced people; the scenes take turns."""
    n_slots: int = 40
    """Environments of the vector environment; draws that need more are passed over."""
    robot_radius: float = 0.25
    """Of the robots in the training scene, larger than in the evaluation, so that the policy keeps a margin [m]."""
    pedestrian_radius: float = 0.31
    """Of people in the training scene, likewise [m]."""

    guide: str = "orca"
    """Controller that demonstrates at first, as ORCA does for SARL."""
    demonstration_steps: int = 2_000
    """Control steps of the scene in which it does."""
    guide_noise: float = 0.2
    """Standard deviation of the normal noise on what it drives, in [-1, 1] units; what is imitated has none."""
    imitation_epochs: int = 20
    """Passes over the demonstrations, of which every other one is mirrored."""

    width: int = 48
    """Of each person's embedding and of the hidden layers."""
    learning_rate: float = 5e-4
    """Of PPO, falling linearly to a tenth; imitation takes twice as much."""
    gamma: float = 0.97
    """Discount of a control step."""
    gae_lambda: float = 0.95
    """Of the generalised advantage estimate."""
    rollout_steps: int = 256
    """Control steps of the scene between two updates."""
    epochs: int = 6
    """Passes over the transitions of a rollout."""
    batch_size: int = 256
    """Transitions of a gradient step."""
    entropy_weight: float = 0.0
    """Of the entropy in the loss."""
    initial_log_std: float = -1.0
    """Logarithm of the policy's standard deviation at first."""

    collision_penalty: float = 10.0
    """Taken from the task's reward for the collision that ends a run, besides its own 5."""
    step_penalty: float = 0.02
    """Taken at every step."""
    discomfort_distance: float = 1.2
    """Whoever is nearer is disturbed; CrowdNav's is 0.2 m between bodies [m]."""
    discomfort_weight: float = 0.05
    """Taken at every step, times the share of that distance that the nearest person is inside."""
    reward_scale: float = 0.1
    """Times all of this: values of about 1 are learned best."""

    checkpoint_every: int = 5_120
    """Scene steps between checkpoints; each is validated."""
    validation_shares: tuple[float, ...] = (0.1, 0.1, 0.1, 0.1, 0.3, 0.3)
    """Scenes of a validation, with draws 0, 1, 2, ..."""
    intrusion_weight: float = 0.5
    """A checkpoint's score is its success - intrusion_weight * share of steps within 1.2 m; the best is kept."""

    def __post_init__(self) -> None:
        if self.features != People.name:
            raise ValueError(f"features = {self.features!r} is not allowed; allowed: {People.name}")
        for name in (
            "scene_steps",
            "n_slots",
            "demonstration_steps",
            "imitation_epochs",
            "width",
            "rollout_steps",
            "epochs",
            "batch_size",
            "checkpoint_every",
        ):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)} is not allowed; allowed: integers >= 1")
        for name in ("scene_steps", "checkpoint_every"):
            if getattr(self, name) % self.rollout_steps:
                raise ValueError(
                    f"{name} = {getattr(self, name)} is not allowed; allowed: multiples of rollout_steps = "
                    f"{self.rollout_steps}"
                )
        if not 0.0 <= self.gamma < 1.0:
            raise ValueError(f"gamma = {self.gamma} is not allowed; allowed: numbers in [0, 1)")
        for name in ("train_window", "validation_window", "test_window"):
            begin, end = getattr(self, name)
            if not 0.0 <= begin < end <= 1.0:
                raise ValueError(f"{name} = {(begin, end)} is not allowed; allowed: 0 <= begin < end <= 1")
        if not self.datasets or not self.shares:
            raise ValueError("datasets and shares must not be empty")

    def as_dict(self) -> dict[str, Any]:
        """All fields as JSON values.

        Returns:
            Field: value.
        """
        return asdict(self)
