"""The replay buffer that SAC and the reward step share."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from gymnasium import spaces  # noqa: E402

from socialnav_mj.features import COLLISION_FLAG, GOAL_FLAG, N_FLAGS, feature_set, mirror_state  # noqa: E402
from socialnav_mj.learning.config import TrainingConfig  # noqa: E402
from socialnav_mj.learning.mirror import Mirror  # noqa: E402
from socialnav_mj.learning.reward import RewardNet, reward_for  # noqa: E402
from socialnav_mj.learning.shared_buffer import SharedReplayBuffer  # noqa: E402

FEATURES = feature_set("continuous")
SIZE = FEATURES.size + N_FLAGS
GAMMA = 0.9
REWARD = 0.1
"""The task's own reward, per tag."""
TAG = 2
"""A feature that mirroring leaves alone, the distance to the goal: here it says which state this is."""


class Tagged(torch.nn.Module):
    """Reward a * tag."""

    def __init__(self, scale: float) -> None:
        super().__init__()
        self.scale = scale

    def forward(self, state):
        return self.scale * state[..., TAG]


def buffer_of(n_slots=3, size=50, reward_net=None, **changes) -> SharedReplayBuffer:
    buffer = SharedReplayBuffer(
        size,
        spaces.Box(-np.inf, np.inf, (SIZE,), np.float32),
        spaces.Box(-1.0, 1.0, (2,), np.float32),
        "cpu",
        n_envs=n_slots,
        features=FEATURES,
        seed=0,
    )
    buffer.reward_of = reward_for(TrainingConfig(gamma=GAMMA, **changes), reward_net or Tagged(1.0))
    return buffer


def tagged(tags) -> np.ndarray:
    """Random states that carry tags."""
    states = np.random.default_rng(1).normal(size=(len(tags), SIZE)).astype(np.float32)
    states[:, TAG] = tags
    return states


def put(buffer, before, after, *, active=None, done=None, truncated=None, log_prob=None):
    """Store one step of every slot, with states known by their tags."""
    n = len(after)
    active, done, truncated = ([False] * n if x is None else x for x in (active or [True] * n, done, truncated))
    infos = [{"active": a, "TimeLimit.truncated": t} for a, t in zip(active, truncated, strict=True)]
    action = np.random.default_rng(2).uniform(-1.0, 1.0, (n, 2)).astype(np.float32)
    log_prob = np.zeros(n) if log_prob is None else np.asarray(log_prob)
    buffer.store(tagged(before), tagged(after), action, np.asarray(done), infos, log_prob, REWARD * np.asarray(after))
    return action


def test_only_slots_that_held_an_agent_are_stored():
    buffer = buffer_of()
    put(buffer, [0, 1, 2], [10, 11, 12], active=[True, False, True], log_prob=[-1.0, -2.0, -3.0])
    assert buffer.size() == 2 and not buffer.full
    assert buffer.next_observations[:2, 0, TAG].tolist() == [10.0, 12.0]
    assert buffer.observations[:2, 0, TAG].tolist() == [0.0, 2.0]
    assert buffer.log_probs[:2].tolist() == [-1.0, -3.0]
    put(buffer, [0, 1, 2], [20, 21, 22], active=[False, False, False])
    assert buffer.size() == 2


def test_rewards_change_with_the_network_and_nothing_else_does():
    """The same draw twice, before and after a step of the network: rewards are the network's of the next state."""
    torch.manual_seed(0)
    network = RewardNet(SIZE, (8,))
    buffer = buffer_of(reward_net=network)
    for k in range(5):
        put(buffer, np.arange(3) + k, np.arange(3) + k + 1)
    samples = []
    for _ in range(2):
        buffer.random = np.random.default_rng(7)
        samples.append(buffer.sample(32))
        with torch.no_grad():
            expected = network(samples[-1].next_observations)
        torch.testing.assert_close(samples[-1].rewards[:, 0], expected)
        optimizer = torch.optim.SGD(network.parameters(), lr=0.1)
        network(samples[-1].next_observations).sum().backward()
        optimizer.step()
    first, second = samples
    for name in ("observations", "actions", "next_observations", "dones"):
        torch.testing.assert_close(getattr(first, name), getattr(second, name), rtol=0.0, atol=0.0)
    assert (first.rewards != second.rewards).all()
    assert first.rewards.shape == (32, 1) and not first.rewards.requires_grad


def test_absorbing_states_are_worth_their_reward_for_ever_and_deadlines_bootstrap():
    """Tags 1, 2, 3 on the way, absorbed and late: rewards 1, 2 / (1 - 0.9), 3; dones 0, 1, 0."""
    buffer = buffer_of()
    put(buffer, [0, 0, 0], [1, 2, 3], done=[False, True, True], truncated=[False, False, True])
    samples = buffer.sample(64)
    by_tag = {}
    for tag, reward, done in zip(samples.next_observations[:, TAG], samples.rewards, samples.dones, strict=True):
        by_tag.setdefault(int(tag), set()).add((round(float(reward), 4), float(done)))
    assert by_tag == {1: {(1.0, 0.0)}, 2: {(20.0, 1.0)}, 3: {(3.0, 0.0)}}


def test_plain_rewards_are_the_tasks_own_or_constants():
    """Tags 1, 2, 3 on the way, arrived and collided; a constant is paid for ever in the absorbing states."""
    for changes, expected in (
        ({"reward": "task"}, {1: 0.1, 2: 0.2, 3: 0.3}),
        (
            {"reward": "constant", "step_reward": -0.02, "goal_reward": 0.3, "collision_reward": -0.5},
            {1: -0.02, 2: 3.0, 3: -5.0},
        ),
    ):
        buffer = buffer_of(**changes)
        put(buffer, [0, 0, 0], [1, 2, 3], done=[False, True, True])
        buffer.next_observations[1, 0, GOAL_FLAG] = buffer.next_observations[2, 0, COLLISION_FLAG] = 1.0
        buffer.next_observations[0, 0, [GOAL_FLAG, COLLISION_FLAG]] = 0.0
        buffer.next_observations[1, 0, COLLISION_FLAG] = buffer.next_observations[2, 0, GOAL_FLAG] = 0.0
        samples = buffer.sample(64)
        tags = samples.next_observations[:, TAG].long().tolist()
        found = dict(zip(tags, samples.rewards[:, 0].tolist(), strict=True))
        assert found == pytest.approx(expected, abs=1e-5)


def test_samples_are_mirrored_as_a_whole_half_of_the_time():
    """State, action and next state together; a turn to the left becomes one to the right."""
    buffer = buffer_of()
    action = put(buffer, [0, 1, 2], [10, 11, 12])
    before, after = tagged([0, 1, 2]), tagged([10, 11, 12])
    samples = buffer.sample(400)
    turned = 0
    for state, act, following in zip(samples.observations, samples.actions, samples.next_observations, strict=True):
        row = int(state[TAG])
        straight = (before[row], action[row], after[row])
        other = (mirror_state(FEATURES, before[row]), action[row] * [1, -1], mirror_state(FEATURES, after[row]))
        found = (state.numpy(), act.numpy(), following.numpy())
        is_straight = all(np.allclose(a, b, atol=1e-6) for a, b in zip(found, straight, strict=True))
        is_turned = all(np.allclose(a, b, atol=1e-6) for a, b in zip(found, other, strict=True))
        assert is_straight != is_turned
        turned += is_turned
    assert 150 < turned < 250  # standard deviation 10


def test_mirror_turns_the_chosen_rows_only_and_keeps_its_input():
    states = tagged([0, 1, 2])
    kept = states.copy()
    found = Mirror(FEATURES)(states, np.array([False, True, False]))
    np.testing.assert_array_equal(states, kept)
    np.testing.assert_array_equal(found[[0, 2]], states[[0, 2]])
    np.testing.assert_array_equal(found[1], mirror_state(FEATURES, states[1]).astype(np.float32))
    assert found.dtype == np.float32


def test_states_for_the_reward_hold_the_share_of_absorbed_ones():
    """Of 100 at least 20 ended in an absorbing state; late ones are no absorbing states; without any: all is drawn."""
    buffer = buffer_of(size=500)
    for _ in range(100):
        put(buffer, [0, 0, 0], [1, 1, 1])
    states, _ = buffer.sample_states(100, 0.2)
    assert set(states[:, TAG]) == {1.0}
    put(buffer, [0, 0, 0], [5, 6, 1], done=[True, True, False], truncated=[False, True, False], log_prob=[-5, -6, 0])
    states, log_prob = buffer.sample_states(100, 0.2)
    assert states.shape == (100, SIZE) and log_prob.shape == (100,)
    assert 20 <= (states[:, TAG] == 5.0).sum() <= 25 and (states[:20, TAG] == 5.0).all()
    assert (log_prob[states[:, TAG] == 5.0] == -5.0).all()
    assert (states[:, TAG] == 6.0).sum() <= 5


def interleaved(buffer, n_steps, *, seed=0):
    """Runs of random lengths in three slots with gaps; a state's tag is 1000 * run + step, its log density minus that.

    Returns:
        Length of every run so far.
    """
    random = np.random.default_rng(seed)
    run, step, begun = [1, 2, 3], [0, 0, 0], 3
    for _ in range(n_steps):
        active = random.random(3) < 0.8
        done = active & (random.random(3) < 0.15)
        tag = [1000 * r + s for r, s in zip(run, step, strict=True)]
        after = [t + 1 for t in tag]
        put(
            buffer,
            tag,
            after,
            active=active.tolist(),
            done=done.tolist(),
            truncated=(done & (random.random(3) < 0.5)).tolist(),
            log_prob=[-float(t) for t in after],
        )
        for slot in range(3):
            step[slot] += int(active[slot])
            if done[slot]:
                begun += 1
                run[slot], step[slot] = begun, 0


@pytest.mark.parametrize("size", [1000, 60], ids=["never full", "overwritten"])
def test_segments_follow_one_run_backwards(size):
    buffer = buffer_of(size=size)
    interleaved(buffer, 200)
    assert buffer.full == (size == 60)
    states, log_prob = buffer.sample_segments(200, 6)
    assert states.shape == (200, 6, SIZE) and log_prob.shape == (200, 6)
    run, step = np.divmod(states[..., TAG].astype(int), 1000)
    assert (run == run[:, :1]).all()
    back = step[:, :-1] - step[:, 1:]
    assert set(np.unique(back)) <= {0, 1}
    assert (np.diff(back, axis=1) <= 0).all()  # padding, once begun, goes on to the end
    known = np.concatenate([np.ones((200, 1), dtype=bool), back == 1], axis=1)
    np.testing.assert_array_equal(log_prob, np.where(known, -states[..., TAG], 0.0))
    if size == 1000:
        # Nothing was overwritten: a segment is short only where its run began.
        assert (step[np.arange(200), known.sum(axis=1) - 1][~known[:, -1]] == 1).all()
    assert known.all(axis=1).sum() > 20


def test_a_full_buffer_forgets_the_oldest():
    buffer = buffer_of(n_slots=1, size=4)
    for k in range(6):
        put(buffer, [k], [k + 1])
    assert buffer.full and buffer.size() == 4
    assert buffer.next_observations[:, 0, TAG].tolist() == [5.0, 6.0, 3.0, 4.0]


def test_state_brings_back_transitions_samples_and_the_runs_under_way():
    buffer, other = buffer_of(size=100), buffer_of(size=100)
    interleaved(buffer, 25)
    buffer.sample(7)
    other.restore(buffer.state())
    assert (other.size(), other.pos, other.full) == (buffer.size(), buffer.pos, buffer.full)
    for one, two in zip(buffer.sample(32), other.sample(32), strict=True):
        if one is not None:
            torch.testing.assert_close(one, two, rtol=0.0, atol=0.0)
    size = other.size()
    for each in (buffer, other):
        put(each, [0, 0, 0], [1, 2, 3])
    for name, values in buffer.state().items():
        np.testing.assert_array_equal(other.state()[name], values, err_msg=name)
    assert (other.previous[size : size + 3] >= 0).any()


def test_state_of_a_full_buffer_goes_on_where_it_was():
    buffer, other = buffer_of(n_slots=1, size=4), buffer_of(n_slots=1, size=4)
    for k in range(6):
        put(buffer, [k], [k + 1])
    other.restore(buffer.state())
    put(other, [6], [7])
    assert other.next_observations[:, 0, TAG].tolist() == [5.0, 6.0, 7.0, 4.0]
