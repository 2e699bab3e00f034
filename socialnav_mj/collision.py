"""Touches of slots, told as collisions of agents and people."""

from collections.abc import Iterable
from dataclasses import dataclass

from socialnav_mj.episode import IntArray, Partner
from socialnav_mj.touch import Touch


@dataclass(frozen=True, kw_only=True)
class Collision:
    """A touch with those behind the slots; indices into the task's cast."""

    touch: Touch
    """What the physics saw; it grows while the bodies touch."""
    agent: int
    """Index of the agent; of two agents the one in the lower slot."""
    partner: int
    """Index of the other agent or of the pedestrian."""

    @property
    def agent_slots(self) -> tuple[int, ...]:
        """Slots of all agents that took part."""
        return (self.touch.agent, self.touch.partner) if self.touch.kind == Partner.AGENT else (self.touch.agent,)


def collisions_of(touches: Iterable[Touch], *, agent: IntArray, pedestrian: IntArray) -> list[Collision]:
    """Look up who was in the slots that touched.

    Args:
        touches: Of one control step.
        agent: Index of the agent in each slot during that step, shape (n_agent_slots,).
        pedestrian: Index of the pedestrian in each slot, shape (n_pedestrian_slots,).

    Returns:
        One collision a touch, in the same order.
    """
    return [
        Collision(
            touch=touch,
            agent=int(agent[touch.agent]),
            partner=int((agent if touch.kind == Partner.AGENT else pedestrian)[touch.partner]),
        )
        for touch in touches
    ]
