"""Touches of two bodies, followed from physics step to physics step."""

from dataclasses import dataclass

import mujoco
import numpy as np

from socialnav_mj.contact import IMPACT_DURATION, Partner
from socialnav_mj.geometry import Array, yaw_of_quaternion
from socialnav_mj.people import People
from socialnav_mj.scene_index import SceneIndex


@dataclass(kw_only=True, slots=True)
class Touch:
    """A contact between an agent and another body, from its first to its last physics step."""

    agent: int
    """Slot of the agent; of two agents the lower."""
    kind: Partner
    """What it touched."""
    partner: int
    """Slot of the other agent or of the pedestrian."""
    time: float
    """First physics step [s]."""
    last_time: float
    """Last physics step that was seen so far [s]."""
    position: Array
    """(2,) at first touch [m]."""
    normal: Array
    """(2,) unit vector from the agent to its partner at first touch."""
    agent_heading: float
    """At first touch [rad]."""
    partner_heading: float
    """At first touch; a pedestrian's is that of the control step [rad]."""
    agent_velocity: Array
    """(2,) just before [m/s]."""
    partner_velocity: Array
    """(2,) just before; a rigid pedestrian's is the recorded one, which the solver does not know [m/s]."""
    impact_impulse: float = 0.0
    """Integral of the normal force over the physics steps that began within `IMPACT_DURATION` [N s]."""
    impact_force: float = 0.0
    """Largest normal force of one of these steps [N]."""
    push_duration: float = 0.0
    """Time in touch after them, so far [s]."""
    push_impulse: float = 0.0
    """Integral of the normal force after them, so far [N s]."""
    push_force: float = 0.0
    """Largest normal force after them, so far [N]."""
    peak_time: float = 0.0
    """When the largest force of all so far acted, after the first touch [s]."""
    squeeze: float = 0.0
    """Largest force so far by which either robot of the touch was squeezed, see `squeeze_force` [N]."""
    behind: float = 0.0
    """How far the pedestrian was from its recorded place at the first touch [m]."""
    held_back: float = 0.0
    """How much farther it was at most since then [m]."""

    def feel(self, force: float, *, time: float, timestep: float) -> None:
        """Take in the force of one physics step.

        Args:
            force: Normal force [N].
            time: At the beginning of the step [s].
            timestep: Its length [s].
        """
        since = time - self.time
        if force > max(self.impact_force, self.push_force):
            self.peak_time = since
        if since < IMPACT_DURATION - 1e-9:
            self.impact_impulse += force * timestep
            self.impact_force = max(self.impact_force, force)
        else:
            self.push_duration += timestep
            self.push_impulse += force * timestep
            self.push_force = max(self.push_force, force)


def squeeze_force(forces: Array) -> float:
    """How much of the forces on a body only presses it together: (sum |f_i| - |sum f_i|) / 2.

    Args:
        forces: Shape (k, 3) [N].

    Returns:
        0 for forces in one direction, F for two of size F that oppose each other [N].
    """
    return 0.5 * float(np.linalg.norm(forces, axis=1).sum() - np.linalg.norm(forces.sum(axis=0), axis=-1))


class TouchLog:
    """Which bodies touch, and what they felt; two that part for less than the re-arm time touch on.

    Bodies are numbered as in `SceneIndex.owner`, and a pair is known by its two numbers, the lower first.
    """

    def __init__(self, index: SceneIndex, *, rearm_time: float) -> None:
        """Begin without a touch.

        Args:
            index: Of the scene.
            rearm_time: Two bodies must have been apart this long before their next touch is a new one [s].
        """
        self.index, self._rearm_time = index, rearm_time
        self._wrench = np.zeros(6)
        self.forget()

    def forget(self) -> None:
        """Forget every touch, those included that nobody has asked for yet."""
        self._open: dict[tuple[int, int], Touch] = {}
        self._new: list[Touch] = []

    def end_of_agent(self, slot: int) -> None:
        """Let a robot's next touch be a new one, with whomever.

        Args:
            slot: Agent slot.
        """
        self._open = {pair: touch for pair, touch in self._open.items() if slot not in pair}

    def end_of_pedestrian(self, slot: int) -> None:
        """Let a person's next touch be a new one, with whomever.

        Args:
            slot: Pedestrian slot.
        """
        self._open = {pair: touch for pair, touch in self._open.items() if pair[1] != self.index.first_person + slot}

    def take_new(self) -> list[Touch]:
        """Touches that began since the last call; they go on growing while the bodies touch.

        Returns:
            In order of time.
        """
        touches, self._new = self._new, []
        return touches

    def note(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        *,
        time: float,
        velocity_before: Array,
        people: People,
        step: int,
    ) -> None:
        """Read the contacts of the physics step that was just made.

        Args:
            model: The scene.
            data: After the step.
            time: At the beginning of the step, which is where MuJoCo finds contacts [s].
            velocity_before: `qvel` at that time.
            people: As they were moved in that step.
            step: Which of theirs it was.
        """
        pairs = self.index.owner[data.contact.geom]
        timestep = model.opt.timestep
        forces: dict[tuple[int, int], float] = {}
        pushes: dict[tuple[int, int], Array] = {}
        for i in np.flatnonzero(pairs.min(axis=1) >= 0):
            pair = (int(min(pairs[i])), int(max(pairs[i])))
            mujoco.mj_contactForce(model, data, int(i), self._wrench)
            flip = pairs[i, 0] != pair[0]
            forces[pair] = forces.get(pair, 0.0) + float(self._wrench[0])
            pushes[pair] = pushes.get(pair, 0.0) + data.contact.frame[i, :3] * (
                self._wrench[0] * (-1.0 if flip else 1.0)
            )
            touch = self._open.get(pair)
            # The gap is between the last step's end and this one's beginning.
            if touch is None or time - touch.last_time - timestep >= self._rearm_time - 1e-9:
                touch = self._begin(data, pair, int(i), time, flip=flip, before=velocity_before)
                if touch.kind == Partner.PEDESTRIAN:
                    touch.partner_velocity = people.velocity(step, velocity_before)[touch.partner].copy()
                    touch.partner_heading = float(yaw_of_quaternion(people.quaternion[touch.partner]))
                    touch.behind = float(people.behind()[touch.partner])
                self._open[pair] = touch
                self._new.append(touch)
            touch.last_time = time
            if touch.kind == Partner.PEDESTRIAN:
                touch.held_back = max(touch.held_back, float(people.behind()[touch.partner]) - touch.behind)
        for pair, force in forces.items():
            self._open[pair].feel(force, time=time, timestep=timestep)
        if len(pushes) > 1:
            self._note_squeeze(pushes)

    def _note_squeeze(self, pushes: dict[tuple[int, int], Array]) -> None:
        """Let every touch know by how much its robots are squeezed.

        Args:
            pushes: Normal force of each pair on its second body [N].
        """
        felt: dict[int, list[Array]] = {}
        for (agent, other), push in pushes.items():
            felt.setdefault(agent, []).append(-push)
            if other < self.index.first_person:
                felt.setdefault(other, []).append(push)
        squeeze = {body: squeeze_force(np.array(forces)) for body, forces in felt.items() if len(forces) > 1}
        for pair in pushes:
            touch = self._open[pair]
            touch.squeeze = max(touch.squeeze, *(squeeze.get(body, 0.0) for body in pair))

    def _begin(
        self,
        data: mujoco.MjData,
        pair: tuple[int, int],
        contact: int,
        time: float,
        *,
        flip: bool,
        before: Array,
    ) -> Touch:
        """The touch as far as the robots know it; a pedestrian's heading and velocity are left at 0."""
        agent, other = pair
        index = self.index
        normal = data.contact.frame[contact, :2] * (-1.0 if flip else 1.0)
        length = float(np.linalg.norm(normal, axis=-1))
        heading = yaw_of_quaternion(data.qpos[index.quaternion])
        if other < index.first_person:
            kind, partner = Partner.AGENT, other
            partner_heading = float(heading[partner])
            partner_velocity = before[index.qvel[partner] : index.qvel[partner] + 2].copy()
        else:
            kind, partner = Partner.PEDESTRIAN, other - index.first_person
            partner_heading, partner_velocity = 0.0, np.zeros(2)
        return Touch(
            agent=agent,
            kind=kind,
            partner=partner,
            time=time,
            last_time=time,
            position=data.contact.pos[contact, :2].copy(),
            normal=normal / length if length > 0.0 else np.array([1.0, 0.0]),
            agent_heading=float(heading[agent]),
            partner_heading=partner_heading,
            agent_velocity=before[index.qvel[agent] : index.qvel[agent] + 2].copy(),
            partner_velocity=partner_velocity,
        )
