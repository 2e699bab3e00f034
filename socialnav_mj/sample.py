"""Truth about every slot at one control step."""

from dataclasses import dataclass, fields, replace

import numpy as np

from socialnav_mj.cast import NOBODY, SlotCrowd
from socialnav_mj.episode import IntArray
from socialnav_mj.geometry import Array
from socialnav_mj.physics import Physics


@dataclass(frozen=True, kw_only=True)
class Sample:
    """Where the agents are at one control step, before those whose run has ended leave; its arrays are read-only."""

    agent: IntArray
    """(n_slots,) index of the agent that is there, -1 for nobody."""
    position: Array
    """(n_slots, 2) [m]."""
    heading: Array
    """(n_slots,) [rad]."""
    velocity: Array
    """(n_slots, 2) [m/s]."""
    yaw_rate: Array
    """(n_slots,) [rad/s]."""
    tilt: Array
    """(n_slots,) angle between the robot's upward axis and the vertical [rad]."""

    def __post_init__(self) -> None:
        for field in fields(self):
            getattr(self, field.name).flags.writeable = False

    @classmethod
    def of(cls, physics: Physics, agent: IntArray) -> "Sample":
        """State of the robots in all slots as the simulator has it now.

        Args:
            physics: With as many robots as there are slots.
            agent: Index of the agent in each slot, -1 for nobody, shape (n_slots,).

        Returns:
            The sample; slots without an agent hold what the parked robot does.
        """
        return cls(
            agent=agent.copy(),
            position=physics.agent_position(),
            heading=physics.agent_heading(),
            velocity=physics.agent_velocity(),
            yaw_rate=physics.agent_yaw_rate(),
            tilt=physics.agent_tilt(),
        )

    @classmethod
    def nobody(cls, n_slots: int) -> "Sample":
        """An empty scene.

        Args:
            n_slots: Agent slots.

        Returns:
            The sample, zeros in place of a state.
        """
        return cls(
            agent=np.full(n_slots, NOBODY, dtype=np.int64),
            position=np.zeros((n_slots, 2)),
            heading=np.zeros(n_slots),
            velocity=np.zeros((n_slots, 2)),
            yaw_rate=np.zeros(n_slots),
            tilt=np.zeros(n_slots),
        )

    def updated(self, other: "Sample", slots: IntArray) -> "Sample":
        """This sample with some slots taken from another one.

        Args:
            other: Of the same slots.
            slots: Shape (k,).

        Returns:
            A new sample.
        """
        values = {field.name: getattr(self, field.name).copy() for field in fields(self)}
        for name, value in values.items():
            value[slots] = getattr(other, name)[slots]
        return Sample(**values)


def people_of(physics: Physics, recorded: SlotCrowd) -> SlotCrowd:
    """The people where their bodies are; for rigid ones that is where the recording has them.

    Args:
        physics: After the people were told where the recording has them.
        recorded: The people at the current control step.

    Returns:
        `recorded`, with position and velocity of the bodies if they yield.
    """
    velocity = physics.pedestrian_velocity()
    if velocity is None:
        return recorded
    absent = np.isnan(recorded.position)
    position = np.where(absent, np.nan, physics.pedestrian_position())
    return replace(recorded, position=position, velocity=np.where(absent, np.nan, velocity))
