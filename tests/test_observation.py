"""What an agent sees: by hand, and unchanged when the world is moved, turned or renumbered."""

from typing import Any

import numpy as np
import pytest
from scenes import busy_crowd, environment_of, unit_vector

from socialnav_mj.config import Scenario
from socialnav_mj.controllers import GoStraight, Limits, PotentialField
from socialnav_mj.controllers.base import neighbours_of
from socialnav_mj.environment import build_environment
from socialnav_mj.growth import walking_crowd
from socialnav_mj.observation import FULL_BELOW, nearest, observe
from socialnav_mj.rollout import rollout

WORLD = ("position", "heading")
"""Keys that name places and directions of the world; all others are the agents' own view."""


def scene(seed: int = 0, n: int = 4, m: int = 5) -> dict[str, Any]:
    """A random scene in which agent slot 1 and pedestrian slots 0 and 3 are empty."""
    random = np.random.default_rng(seed)
    people = random.normal(size=(2, m, 2))
    people[:, [0, 3]] = np.nan
    return {
        "active": np.arange(n) != 1,
        "person": np.arange(n, dtype=np.int64) + 10,
        "position": random.normal(size=(n, 2)),
        "heading": random.uniform(-np.pi, np.pi, n),
        "velocity": random.normal(size=(n, 2)),
        "yaw_rate": random.normal(size=n),
        "goal": random.normal(size=(n, 2)),
        "pedestrian_position": people[0],
        "pedestrian_velocity": people[1],
        "pedestrian_slots": np.array([1, 2, 4]),
    }


def test_view_of_an_agent_that_faces_north_has_the_figures_of_hand_calculation() -> None:
    north = np.pi / 2.0
    seen = observe(
        active=np.array([True, True]),
        person=np.array([7, 9]),
        position=np.array([[1.0, 1.0], [0.0, 1.0]]),
        heading=np.array([north, 0.0]),
        velocity=np.array([[0.0, 0.5], [0.25, 0.1]]),
        yaw_rate=np.array([0.1, -0.2]),
        goal=np.array([[1.0, 4.0], [0.0, 0.0]]),
        pedestrian_position=np.array([[3.0, 1.0]]),
        pedestrian_velocity=np.array([[0.0, -1.0]]),
        pedestrian_slots=np.array([0]),
    )
    close = {"atol": 1e-12}
    assert seen["person"].tolist() == [7, 9]
    # The second one slips sideways at 0.1 m/s, which is no forward speed.
    np.testing.assert_allclose(seen["twist"], [[0.5, 0.1], [0.25, -0.2]], **close)
    np.testing.assert_allclose(seen["goal"], [[3.0, 0.0], [0.0, -1.0]], **close)
    np.testing.assert_allclose(seen["pedestrian_position"], [[[0.0, -2.0]], [[3.0, 0.0]]], **close)
    np.testing.assert_allclose(seen["pedestrian_velocity"], [[[-1.0, 0.0]], [[0.0, -1.0]]], **close)
    np.testing.assert_allclose(seen["agent_position"][0], [[0.0, 0.0], [0.0, 1.0]], **close)
    np.testing.assert_allclose(seen["agent_velocity"][0], [[0.0, 0.0], [0.1, -0.25]], **close)
    np.testing.assert_allclose(seen["agent_position"][1], [[1.0, 0.0], [0.0, 0.0]], **close)
    np.testing.assert_allclose(seen["agent_velocity"][1], [[0.0, 0.5], [0.0, 0.0]], **close)
    assert seen["agent_mask"].tolist() == [[False, True], [True, False]]


@pytest.mark.parametrize("angle", [0.3, -2.0, np.pi])
def test_own_view_does_not_change_when_the_world_is_moved_and_turned(angle: float) -> None:
    given, turn = scene(), np.stack([unit_vector(angle), unit_vector(angle + np.pi / 2.0)])
    moved = {**given, "heading": given["heading"] + angle}
    for name in ("position", "goal", "pedestrian_position"):
        moved[name] = given[name] @ turn + (30.0, -20.0)
    for name in ("velocity", "pedestrian_velocity"):
        moved[name] = given[name] @ turn
    before, after = observe(**given), observe(**moved)
    for name in before.keys() - set(WORLD):
        np.testing.assert_allclose(after[name], before[name], atol=1e-12, err_msg=name)


def test_mirrored_world_is_seen_with_left_and_right_exchanged() -> None:
    given, flip = scene(), np.array([1.0, -1.0])
    mirrored = {name: value * flip if np.ndim(value) == 2 else value for name, value in given.items()}
    mirrored |= {"heading": -given["heading"], "yaw_rate": -given["yaw_rate"]}
    before, after = observe(**given), observe(**mirrored)
    for name in ("goal", "twist", "pedestrian_position", "pedestrian_velocity", "agent_position", "agent_velocity"):
        np.testing.assert_allclose(after[name], before[name] * flip, atol=1e-12, err_msg=name)


def test_renumbered_slots_are_seen_renumbered() -> None:
    given = scene()
    agents, people = np.array([2, 0, 3, 1]), np.array([4, 0, 2, 1, 3])
    renumbered = {name: value[agents] for name, value in given.items() if not name.startswith("pedestrian")}
    renumbered |= {name: given[name][people] for name in ("pedestrian_position", "pedestrian_velocity")}
    renumbered["pedestrian_slots"] = np.flatnonzero(np.isin(people, given["pedestrian_slots"]))
    before, after = observe(**given), observe(**renumbered)
    for name, value in before.items():
        expected = value[agents]
        if name.startswith("pedestrian"):
            expected = expected[:, people]
        elif name.startswith("agent"):
            expected = expected[:, agents]
        np.testing.assert_allclose(after[name], expected, atol=1e-12, err_msg=name)


def test_absent_ones_are_masked_and_zero() -> None:
    seen = observe(**scene())
    assert seen["active"].tolist() == [True, False, True, True]
    assert seen["person"].tolist() == [10, -1, 12, 13]
    present = np.array([False, True, True, False, True])
    np.testing.assert_array_equal(seen["pedestrian_mask"], seen["active"][:, None] & present)
    others = seen["active"][:, None] & seen["active"] & ~np.eye(4, dtype=bool)
    np.testing.assert_array_equal(seen["agent_mask"], others)
    for name in ("position", "heading", "twist", "goal"):
        assert not seen[name][1].any()
    for kind in ("pedestrian", "agent"):
        for name in (f"{kind}_position", f"{kind}_velocity"):
            assert not seen[name][~seen[f"{kind}_mask"]].any()
            assert seen[name][seen[f"{kind}_mask"]].all()
    assert all(np.isfinite(value).all() for value in seen.values())


def test_nobody_active_and_nobody_present_give_the_same_shapes() -> None:
    given = scene()
    full = observe(**given)
    for changes in ({"active": np.zeros(4, dtype=bool)}, {"pedestrian_slots": np.array([], dtype=np.int64)}):
        seen = observe(**{**given, **changes})
        assert {k: (v.shape, v.dtype) for k, v in seen.items()} == {k: (v.shape, v.dtype) for k, v in full.items()}
        assert not seen["pedestrian_mask"].any() and not seen["pedestrian_position"].any()


def test_observation_is_its_own_and_the_scene_is_left_alone() -> None:
    given = scene()
    copies = {name: np.copy(value) for name, value in given.items()}
    for value in observe(**given).values():
        value[...] = 1
    for name, value in given.items():
        np.testing.assert_array_equal(value, copies[name])


def test_observation_of_a_run_agrees_with_the_truth_of_the_physics() -> None:
    """An independent calculation from the bodies' poses, while agents and people come and go."""
    environment = environment_of(*busy_crowd(), agents=[1, 3, 4, 6, 7])
    task, physics, controller = environment.task, environment.physics, GoStraight()
    controller.reset(Limits.of(task.scenario))
    time_step, seen_people, seen_agents = environment.reset(), 0, 0
    while not time_step.last():
        seen, crowd = time_step.observation, task.recording.at([task.time])
        here, facing = physics.agent_position(), physics.agent_heading()
        np.testing.assert_array_equal(seen["active"], task.slot_agent >= 0)
        for slot in np.flatnonzero(seen["active"]):
            frame = np.stack([unit_vector(facing[slot]), unit_vector(facing[slot] + np.pi / 2.0)], axis=-1)
            person = int(np.searchsorted(task.recording.ids, seen["person"][slot]))
            goal = (task.recording.end[person] - here[slot]) @ frame
            np.testing.assert_allclose(seen["goal"][slot], goal, atol=1e-9)
            shown = np.sort(
                (seen["pedestrian_position"][slot] @ frame.T + here[slot])[seen["pedestrian_mask"][slot]], 0
            )
            replayed = np.isin(task.recording.ids, task.cast.pedestrian_person) & crowd.present[0]
            np.testing.assert_allclose(shown, np.sort(crowd.position[0, replayed], 0), atol=1e-9)
            others = seen["agent_mask"][slot]
            np.testing.assert_allclose(
                seen["agent_position"][slot][others] @ frame.T + here[slot], here[others], atol=1e-9
            )
            seen_people, seen_agents = seen_people + len(shown), seen_agents + int(others.sum())
        time_step = environment.step(controller.act(seen))
    assert seen_people > 50 and seen_agents > 50


def large_scene(n: int, m: int) -> dict[str, Any]:
    """People and agents at about one a square metre, of whom some are not there."""
    random = np.random.default_rng(3)
    there = np.flatnonzero(random.random(m) < 0.9)
    people = np.full((2, m, 2), np.nan)
    people[:, there] = random.uniform(0.0, 10.0, (2, len(there), 2))
    return {
        **scene(n=n, m=m),
        "active": random.random(n) < 0.9,
        "position": random.uniform(0.0, 10.0, (n, 2)),
        "pedestrian_position": people[0],
        "pedestrian_velocity": people[1],
        "pedestrian_slots": there,
    }


def test_nearest_are_those_that_sorting_all_distances_gives() -> None:
    random = np.random.default_rng(0)
    here, others = random.uniform(0.0, 5.0, (40, 2)), random.uniform(0.0, 5.0, (60, 2))
    others[7] = others[3]  # equally near to everybody
    for among_them, whom in ((False, others), (True, here)):
        chosen, there = nearest(here, whom, (6, 1.0), among_them=among_them)
        assert chosen.shape == there.shape == (40, 6)
        for i in range(40):
            distance = np.hypot(*(whom - here[i]).T)
            order = [
                j for j in np.argsort(distance, kind="stable") if distance[j] < 1.0 and not (among_them and i == j)
            ]
            assert chosen[i][there[i]].tolist() == order[:6]
            assert there[i].tolist() == [True] * min(len(order), 6) + [False] * max(6 - len(order), 0)
    chosen, there = nearest(here, np.zeros((0, 2)), (6, 1.0), among_them=False)
    assert chosen.shape == (40, 6) and not there.any()


def test_nearest_neighbours_are_a_part_of_the_full_arrays() -> None:
    given = large_scene(FULL_BELOW + 10, FULL_BELOW + 30)
    full, near = observe(**given), observe(**given, neighbours=(5, 1.2))
    assert near["agent_position"].shape == near["pedestrian_velocity"].shape == (110, 5, 2)
    for kind in ("agent", "pedestrian"):
        seen = 0
        for i in range(110):
            distance = np.where(full[f"{kind}_mask"][i], np.hypot(*full[f"{kind}_position"][i].T), np.inf)
            wanted = [j for j in np.argsort(distance, kind="stable")[:5] if distance[j] < 1.2]
            mask = near[f"{kind}_mask"][i]
            assert mask.sum() == len(wanted)
            for what in ("position", "velocity"):
                np.testing.assert_array_equal(near[f"{kind}_{what}"][i][mask], full[f"{kind}_{what}"][i][wanted])
                assert not near[f"{kind}_{what}"][i][~mask].any()
            seen += len(wanted)
        assert 110 < seen < 5 * 110
    for name in full.keys() - {
        f"{kind}_{what}" for kind in ("agent", "pedestrian") for what in ("position", "velocity", "mask")
    }:
        np.testing.assert_array_equal(near[name], full[name])


def test_below_100_slots_everybody_is_shown_whatever_is_asked_for() -> None:
    given = large_scene(FULL_BELOW - 1, FULL_BELOW - 1)
    for name, value in observe(**given).items():
        np.testing.assert_array_equal(observe(**given, neighbours=(5, 1.2))[name], value)


def test_potential_field_is_pushed_by_its_neighbours_as_by_everybody() -> None:
    given, field = large_scene(FULL_BELOW, FULL_BELOW), PotentialField()
    everybody, near = observe(**given), observe(**given, neighbours=field.sees_nearest)
    assert near["agent_mask"].shape == (100, 32)
    np.testing.assert_allclose(field.force(near), field.force(everybody), rtol=1e-9, atol=1e-12)


def test_rollout_shows_a_controller_whom_it_asks_for_and_the_next_one_everybody() -> None:
    class Short(GoStraight):
        sees_nearest = (3, 2.0)

        def act(self, observation: Any) -> Any:
            shapes.append(observation["agent_position"].shape)
            return super().act(observation)

    class Tall(Short):
        sees_nearest = None

    environment = build_environment(walking_crowd(FULL_BELOW), Scenario(share=1.0), time_limit=0.3)
    shapes: list[tuple[int, ...]] = []
    rollout(environment, Short())
    rollout(environment, Tall())
    assert shapes == [(100, 3, 2)] * (len(shapes) // 2) + [(100, 100, 2)] * (len(shapes) // 2)


@pytest.mark.parametrize("wrong", [(0, 1.0), (3, 0.0), 5, (3,), ("3", 1.0)])
def test_a_wrong_request_for_neighbours_is_refused_with_what_is_allowed(wrong: Any) -> None:
    class Wrong(GoStraight):
        sees_nearest = wrong

    with pytest.raises(
        ValueError, match=r"sees_nearest = .* of controller 'go_straight'; allowed: None, or \(k, radius\)"
    ):
        neighbours_of(Wrong())
