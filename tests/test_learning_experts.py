"""Demonstrations of small crowds made by hand."""

import numpy as np
import pytest
from scenes import TINY, recording_of, stand, walk

from socialnav_mj.config import Scenario
from socialnav_mj.features import FEATURE_SETS, Continuous
from socialnav_mj.learning.experts import Demonstrations, ExpertSampler, demonstrate, occupied_sectors
from socialnav_mj.recordings import load_recording

PROXIMITY, CLOSING = 6, 18
GOAL, COLLISION = [1.0, 0.0], [0.0, 1.0]


def demonstrations(
    *walks, features=None, contact_distance=0.25, clearance=0.0, minimum_displacement=2.0, companions_seen=False
) -> Demonstrations:
    return demonstrate(
        recording_of(*walks),
        features or Continuous(),
        Scenario(),
        minimum_displacement=minimum_displacement,
        contact_distance=contact_distance,
        clearance=clearance,
        companions_seen=companions_seen,
    )


def test_lonely_walk_is_the_closed_form():
    """4 m at 0.8 m/s: 3.5 m are left behind at 4.375 s, so the states are those of 0, 0.2, ..., 4.2 s."""
    found = demonstrations(walk([(0.0, 0.0), (4.0, 0.0)], 0.8))
    left = 4.0 - 0.8 * 0.2 * np.arange(22)
    expected = np.zeros((22, 56))
    expected[:, 0], expected[:, 2], expected[:, 3], expected[:, 4] = 1.0, left / 10.0, np.exp(-left), 0.8
    np.testing.assert_allclose(found.running, expected, atol=1e-9)
    np.testing.assert_array_equal(found.absorbed, [[0.0] * 54 + GOAL])


def test_head_on_meeting_ends_both_runs_in_a_collision():
    """6 m at 1 m/s each, 0.1 m aside: 0.41 m apart at 2.8 s, 0.1 m at 3.0 s: 15 states each, and two collisions."""
    walks = walk([(0.0, 0.0), (6.0, 0.0)], 1.0), walk([(6.0, 0.1), (0.0, 0.1)], 1.0)
    found = demonstrations(*walks)
    assert found.running.shape == (30, 56)
    assert found.absorbed[:, -2:].tolist() == [COLLISION, COLLISION]
    apart = demonstrations(*walks, contact_distance=0.09)
    assert apart.absorbed[:, -2:].tolist() == [GOAL, GOAL]


def test_contact_counts_before_arrival_as_for_an_agent():
    """Somebody stands 0.2 m beside the goal: within the goal radius already at 0.4 m, without any contact."""
    walker, bystander = walk([(0.0, 0.0), (4.0, 0.0)], 1.0), stand((4.0, 0.2), 0.0, 4.0)
    assert demonstrations(walker, bystander).absorbed[:, -2:].tolist() == [GOAL]
    assert demonstrations(walker, bystander, contact_distance=0.6).absorbed[:, -2:].tolist() == [COLLISION]


def test_states_without_clearance_are_left_out_and_the_run_goes_on():
    """Head on, 0.5 m aside, 2 m/s relative: below 0.9 m while 0.75 m or less before or after; the rest stays."""
    walks = walk([(0.0, 0.0), (6.0, 0.0)], 1.0), walk([(6.0, 0.5), (0.0, 0.5)], 1.0)
    every, clear = demonstrations(*walks), demonstrations(*walks, clearance=0.9)
    ahead = np.abs(6.0 - 2.0 * 0.2 * np.arange(len(every.running) // 2))
    kept = np.repeat(np.hypot(ahead, 0.5) >= 0.9, 2)
    assert 0 < (~kept).sum() < len(kept)
    np.testing.assert_array_equal(clear.running, every.running[kept])
    np.testing.assert_array_equal(clear.absorbed, every.absorbed)
    side_by_side = walk([(0.0, 0.0), (6.0, 0.0)], 0.8), walk([(0.0, 0.5), (6.0, 0.5)], 0.8)  # companions
    assert len(demonstrations(*side_by_side, clearance=0.9).running) == len(demonstrations(*side_by_side).running)


def test_experts_who_are_never_clear_are_told():
    walks = walk([(0.0, 0.0), (6.0, 0.0)], 1.0), walk([(6.0, 0.5), (0.0, 0.5)], 1.0)
    with pytest.raises(ValueError, match=r"is ever 99\.0 m clear of strangers; there is no state"):
        demonstrations(*walks, clearance=99.0)


def test_companions_do_not_see_each_other_but_see_strangers():
    """Two side by side at 0.2 m have the features of one alone; a stranger ahead is seen by both."""
    pair = walk([(0.0, 0.0), (6.0, 0.0)], 0.8), walk([(0.0, 0.2), (6.0, 0.2)], 0.8)
    alone, both = demonstrations(pair[0]), demonstrations(*pair)
    assert both.absorbed[:, -2:].tolist() == [GOAL, GOAL]
    for states in (both.running[::2], both.running[1::2]):
        np.testing.assert_allclose(states, alone.running, atol=1e-9)
    seen = demonstrations(*pair, stand((3.0, 1.0), 0.0, 7.0))
    assert (seen.running[:, PROXIMITY : PROXIMITY + 12].max(axis=1) > 0.0).all()


def test_strangers_who_walk_abreast_for_a_moment_see_each_other():
    found = demonstrations(walk([(0.0, 0.0), (4.0, 0.0)], 1.0), walk([(4.0, 1.0), (0.0, 1.0)], 1.0))
    assert (found.running[:, PROXIMITY : PROXIMITY + 12] > 0.0).any()


def test_speed_is_clipped_to_the_robots_also_in_relative_velocities():
    """At 1.6 m/s towards somebody who stands: forward speed 1, closing speed 1 m/s of 2."""
    found = demonstrations(walk([(0.0, 0.0), (8.0, 0.0)], 1.6), stand((4.0, 0.6), 0.0, 5.0))
    np.testing.assert_allclose(found.running[:, 4], 1.0, atol=1e-9)
    np.testing.assert_allclose(found.running[0, CLOSING], 0.5 * 4.0 / np.hypot(4.0, 0.6), atol=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turn_to_the_left_is_a_positive_yaw_rate(side):
    """A quarter circle of 4 m radius at 0.8 m/s: 0.2 rad/s all the way, but for a PCHIP's flat ends."""
    angle = np.linspace(0.0, np.pi / 2.0, 40)
    found = demonstrations(walk(4.0 * np.stack([np.sin(angle), side * (1.0 - np.cos(angle))], axis=1), 0.8))
    np.testing.assert_allclose(found.running[2:-2, 5] * 2.618, side * 0.2, atol=0.06)
    np.testing.assert_allclose(found.running[2:-2, 5].mean() * 2.618, side * 0.2, atol=0.002)


def test_turn_on_the_spot_is_clipped_to_the_robots_limit():
    found = demonstrations(walk([(0.0, 0.0), (3.0, 0.0), (3.0, 3.0)], 1.0))
    assert found.running[:, 5].max() == pytest.approx(Scenario().max_yaw_rate / 2.618, rel=1e-12)


def test_people_who_go_nowhere_are_seen_but_are_no_experts():
    found = demonstrations(walk([(0.0, 0.0), (4.0, 0.0)], 1.0), walk([(2.0, 2.0), (3.5, 2.0)], 0.5))
    assert len(found.absorbed) == 1 and len(found.running) == 18
    with pytest.raises(ValueError, match=r"nobody in recording 'made' moves 2\.0 m; there is no expert"):
        demonstrations(stand((0.0, 0.0), 0.0, 5.0))


def test_joined_is_one_after_the_other():
    one, other = (demonstrations(walk([(0.0, 0.0), (x, 0.0)], 1.0)) for x in (3.0, 4.0))
    both = Demonstrations.joined([one, other])
    np.testing.assert_array_equal(both.running, np.concatenate([one.running, other.running]))
    assert len(both.absorbed) == 2


@pytest.mark.parametrize("features", FEATURE_SETS.values(), ids=FEATURE_SETS)
def test_demonstrations_do_not_change_when_the_crowd_is_turned_and_moved(features):
    recording = load_recording(TINY)
    turn, shift = np.array([[0.6, 0.8], [-0.8, 0.6]]), np.array([7.0, -3.0])
    turned = type(recording)(
        **{**vars_of(recording), "positions": tuple(x @ turn + shift for x in recording.positions)}
    )
    expected, found = (
        demonstrate(r, features, Scenario(), minimum_displacement=2.0, contact_distance=0.25, clearance=0.0)
        for r in (recording, turned)
    )
    assert expected.running.shape[1] == features.size + 2 and len(expected.absorbed) == 3
    np.testing.assert_allclose(found.running, expected.running, atol=1e-8)
    np.testing.assert_array_equal(found.absorbed, expected.absorbed)


def vars_of(recording):
    return {name: getattr(recording, name) for name in recording.__dataclass_fields__}


def test_companions_are_seen_only_if_asked_for_and_told_apart_by_their_own_features():
    """Two walk side by side, 0.6 m apart; a stranger stands ahead of them."""
    walks = (
        walk([(0.0, 0.0), (6.0, 0.0)], 1.0),
        walk([(0.0, 0.6), (6.0, 0.6)], 1.0),
        stand((9.0, 0.0), 0.0, 6.0),
    )
    of_features = {name: FEATURE_SETS[name] for name in ("continuous", "companions")}
    hidden = demonstrations(*walks, features=of_features["continuous"])
    seen = demonstrations(*walks, features=of_features["continuous"], companions_seen=True)
    apart = demonstrations(*walks, features=of_features["companions"], companions_seen=True)
    beside = PROXIMITY + 3  # the sector at the left
    assert not hidden.running[0, beside] and seen.running[0, beside] == pytest.approx(np.exp(-0.3))
    np.testing.assert_array_equal(apart.running[:, :54], hidden.running[:, :54])
    assert apart.running[0, 54 + 3] == pytest.approx(np.exp(-0.3))
    assert np.count_nonzero(apart.running[0, 54:66]) == 1
    unseen = demonstrations(*walks, features=of_features["companions"])
    assert not unseen.running[:, 54:66].any()


def test_matched_experts_have_as_many_occupied_sectors():
    """Experts with 0 or 3 occupied sectors; a neighbour at arm's length counts for none."""
    free, full, near = np.zeros((3, 56))
    full[PROXIMITY : PROXIMITY + 3] = np.exp(-1.5)
    near[PROXIMITY] = np.exp(-0.5)
    np.testing.assert_array_equal(occupied_sectors(np.stack([free, full, near])), [0, 3, 0])
    experts = Demonstrations(running=np.stack([free, full, full, full]), absorbed=np.eye(56)[-2:-1])
    sampler = ExpertSampler(experts, Continuous())
    random = np.random.default_rng(0)
    like = np.stack([full] * 10 + [free] * 40 + [full] * 50)
    np.testing.assert_array_equal(occupied_sectors(sampler(100, 0.1, random, like)[10:]), [0] * 40 + [3] * 50)
    np.testing.assert_array_equal(sampler(100, 0.1, random, like)[:10], np.tile(np.eye(56)[-2], (10, 1)))
    assert abs((occupied_sectors(sampler(1000, 0.0, random)) == 3).mean() - 0.75) < 0.05
