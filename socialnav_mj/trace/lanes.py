"""When each agent changed its state or its policy: the lanes of a time line."""

from dataclasses import dataclass

import numpy as np

from socialnav_mj.episode import Episode, Outcome
from socialnav_mj.geometry import Array

ENDS: dict[Outcome, str] = {
    Outcome.ARRIVED: "arrived",
    Outcome.TIMED_OUT: "timed out",
    Outcome.COLLIDED: "taken out",
    Outcome.UNFINISHED: "stopped",
    Outcome.NEVER_SPAWNED: "never spawned",
    Outcome.OVERTURNED: "overturned",
}


@dataclass(frozen=True, kw_only=True)
class Change:
    """A state begins; the empty state ends the lane."""

    time: float
    """[s]."""
    state: str


def first_touch_time(episode: Episode) -> Array:
    """Time of each agent's first collision.

    Args:
        episode: Whose contacts are searched.

    Returns:
        Shape (n_agents,), seconds since the recording's first frame; inf for agents without a collision [s].
    """
    first = np.full(episode.n_agents, np.inf)
    np.minimum.at(first, episode.contact_agent, episode.contact_time)
    return first


def state_changes(episode: Episode, *, linger: float) -> list[list[Change]]:
    """States of each agent: waiting, driving, collided (from its first collision on), and how its trip ended.

    Args:
        episode: Whose appearances, spawns, ends and contacts decide the states.
        linger: How long the last state stays in view after the end of the trip [s].

    Returns:
        For each agent its changes in order of time; the last one is empty.
    """
    touched = first_touch_time(episode)
    result = []
    for i in range(episode.n_agents):
        appear, spawn = float(episode.agent_appear_time[i]), float(episode.agent_spawn_time[i])
        outcome = Outcome(episode.agent_outcome[i])
        if outcome is Outcome.NEVER_SPAWNED:
            end = max(appear, float(episode.time[-1]))
            changes = [(appear, "waiting"), (end, ENDS[outcome]), (end + linger, "")]
        else:
            end = float(episode.agent_end_time[i])
            collided = touched[i] <= end
            ending = "arrived after collision" if collided and outcome is Outcome.ARRIVED else ENDS[outcome]
            changes = [(appear, "waiting")] if appear < spawn else []
            changes.append((spawn, "driving"))
            if collided:
                changes.append((float(touched[i]), "collided"))
            changes += [(end, ending), (end + linger, "")]
        result.append([Change(time=time, state=state) for time, state in changes])
    return result


def policy_changes(episode: Episode) -> list[list[Change]]:
    """Policies that acted for each agent, from `Episode.agent_policy`.

    Args:
        episode: Of a controller with one policy or several.

    Returns:
        For each agent its changes in order of time; the last one is empty, and agents that never acted have none.
    """
    policy = episode.agent_policy
    steps, agents = np.nonzero(np.diff(policy, axis=0, prepend=np.full((1, episode.n_agents), -1)))
    result: list[list[Change]] = [[] for _ in range(episode.n_agents)]
    for step, agent in zip(steps.tolist(), agents.tolist(), strict=True):
        index = policy[step, agent]
        state = episode.policies[index] if index >= 0 else ""
        result[agent].append(Change(time=float(episode.time[step]), state=state))
    return result
