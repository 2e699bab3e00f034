"""The assembled scene: names, limits, cameras, and a robot file that contradicts the configuration."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from socialnav_mj.config import Robot, Scenario
from socialnav_mj.resources import assets_folder
from socialnav_mj.scene import agent_name, build_model, pedestrian_name
from socialnav_mj.scene_index import index_scene

LOW, HIGH = np.array([-2.0, 3.0]), np.array([6.0, 9.0])


def model_of(scenario: Scenario | None = None, n_agents: int = 3, n_pedestrians: int = 2, **more: Any) -> Any:
    return build_model(
        scenario or Scenario(), n_agent_slots=n_agents, n_pedestrian_slots=n_pedestrians, low=LOW, high=HIGH, **more
    )


def test_names_of_slots_sort_as_their_indices() -> None:
    assert (agent_name(7), pedestrian_name(123)) == ("agent_007/", "pedestrian_123/")
    names = [agent_name(i) for i in range(200)]
    assert names == sorted(names)


def test_scenario_decides_radii_limits_and_time_step() -> None:
    scenario = Scenario(robot=Robot(radius=0.2, max_speed=0.7), pedestrian_radius=0.1, turn_limit="per_second")
    model = model_of(scenario)
    assert model.opt.timestep == 0.01
    for slot in range(3):
        assert model.geom(agent_name(slot) + "bumper").size[0] == 0.2
        np.testing.assert_allclose(model.actuator(agent_name(slot) + "forward").ctrlrange, [0.0, 0.7])
        limit = np.pi / 6.0
        np.testing.assert_allclose(model.actuator(agent_name(slot) + "yaw").ctrlrange, [-limit, limit])
    assert model.actuator_ctrllimited.all()
    for slot in range(2):
        assert model.geom(pedestrian_name(slot) + "body").size[0] == 0.1
    assert (model.nmocap, model.nu, model.nv) == (2, 6, 24)


def test_people_who_yield_are_bodies_of_75_kg_that_slide_and_else_the_same() -> None:
    rigid, yielding = model_of(Scenario()), model_of(Scenario(pedestrian_body="compliant"))
    assert (yielding.nmocap, yielding.nu, yielding.nv) == (0, 6, 24 + 2 * 2)
    assert yielding.body_mass.sum() == pytest.approx(rigid.body_mass.sum() + 2 * 75.0)
    for field in ("type", "size", "contype", "conaffinity", "friction", "solref", "solimp"):
        geoms = [[getattr(m.geom(i), field) for i in range(m.ngeom)] for m in (rigid, yielding)]
        np.testing.assert_array_equal(*geoms)
    index = index_scene(yielding)
    assert index.pedestrian_qpos.shape == index.pedestrian_qvel.shape == (2, 2)
    assert index_scene(rigid).pedestrian_qpos.shape == (0, 2)


def test_model_carries_the_contact_rules_that_slots_and_touches_need() -> None:
    model = model_of(Scenario(contact_rearm_time=0.5))
    assert model.numeric("contact_rearm_time").data.tolist() == [0.5]
    np.testing.assert_array_equal(model.geom_user, np.stack([model.geom_contype, model.geom_conaffinity], axis=1))
    np.testing.assert_array_equal(model.geom_user[model.geom("agent_001/bumper").id], [2, 6])
    np.testing.assert_array_equal(model.geom_user[model.geom("pedestrian_001/body").id], [4, 0])


def test_robots_are_equal_but_for_their_names_and_wait_apart() -> None:
    model = model_of(n_agents=40, n_pedestrians=40)
    for field in ("body_mass", "body_inertia"):
        values = getattr(model, field)
        blocks = [values[model.body(agent_name(i) + "robot").id :][:3] for i in range(40)]
        assert all(np.array_equal(block, blocks[0]) for block in blocks)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert not (data.contact.geom > 0).all(axis=1).any()  # nothing but robots on the floor


def test_parked_robots_can_float_and_invalid_states_are_not_reset() -> None:
    model = model_of()
    assert model.ngravcomp == 3 * 3  # switched off in model fields later; MuJoCo skips it if it is zero when compiled
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET


def test_cameras_see_the_whole_crowd_and_one_follows_each_agent() -> None:
    model = model_of()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [model.camera(i).name for i in range(model.ncam)]
    assert {"top", "oblique", "agent_000/follow", "agent_002/follow"} <= set(names)
    corners = np.array([[x, y, z] for x in (LOW[0], HIGH[0]) for y in (LOW[1], HIGH[1]) for z in (0.0, 1.7)])
    top = model.camera("top").id
    assert np.abs((corners - data.cam_xpos[top])[:, :2]).max() <= 0.5 * model.cam_fovy[top]
    oblique = model.camera("oblique").id
    seen = (corners - data.cam_xpos[oblique]) @ data.cam_xmat[oblique].reshape(3, 3)
    height = np.tan(np.radians(0.5 * model.cam_fovy[oblique]))
    assert (seen[:, 2] < 0.0).all()
    assert np.abs(seen[:, 1] / seen[:, 2]).max() < height
    assert np.abs(seen[:, 0] / seen[:, 2]).max() < height * 4.0 / 3.0  # of a 4:3 picture
    for slot in range(3):
        camera = model.camera(agent_name(slot) + "follow")
        assert model.cam_bodyid[camera.id] == model.body(agent_name(slot) + "robot").id


def test_robot_file_that_does_not_exist_is_named() -> None:
    with pytest.raises(FileNotFoundError, match=r"Robot.model = 'tank.xml': there is no file .*tank\.xml"):
        model_of(Scenario(robot=Robot(model="tank.xml")))


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ({"track": 0.3}, r"robot.xml: track is 0\.24, but the Robot configuration says 0\.3"),
        ({"wheel_radius": 0.05}, r"robot.xml: wheel_radius is 0\.06, but the Robot configuration says 0\.05"),
    ],
)
def test_configuration_that_contradicts_the_robot_file_is_refused(robot: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        model_of(Scenario(robot=Robot(**robot)))


def test_another_robot_is_read_from_its_file_and_its_tendons_are_checked(tmp_path: Path) -> None:
    text = (assets_folder() / "robot.xml").read_text()
    good, bad = tmp_path / "heavy.xml", tmp_path / "bad.xml"
    good.write_text(text.replace('mass="7.4"', 'mass="9.4"'))
    bad.write_text(text.replace('coef="-0.25"', 'coef="0.25"'))
    model = model_of(Scenario(robot=Robot(model=str(good))))
    assert model.body_subtreemass[model.body("agent_001/robot").id] == pytest.approx(10.0)
    with pytest.raises(ValueError, match=r"yaw tendon's left_wheel coefficient is 0\.25, but"):
        model_of(Scenario(robot=Robot(model=str(bad))))


def test_files_are_read_once_however_large_the_pools_are(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    from_file = mujoco.MjSpec.from_file

    def note(path: str) -> Any:
        read.append(Path(path).name)
        return from_file(path)

    monkeypatch.setattr(mujoco.MjSpec, "from_file", staticmethod(note))
    model_of(n_agents=13, n_pedestrians=25)
    assert sorted(read) == ["arena.xml", "pedestrian.xml", "robot.xml"]


def test_pools_put_together_of_blocks_are_in_the_order_of_their_slots() -> None:
    for body in ("rigid", "compliant"):
        model = model_of(Scenario(pedestrian_body=body), n_agents=123, n_pedestrians=112)
        first = {"rigid": "pedestrian", "compliant": "carrier"}[body]
        for name, row, count in ((agent_name, 0.0, 123), (pedestrian_name, 2.0, 112)):
            bodies = [model.body(name(i) + ("robot" if name is agent_name else first)) for i in range(count)]
            assert np.unique(np.diff([one.id for one in bodies])).tolist() == [
                {agent_name: 3, pedestrian_name: 1 if body == "rigid" else 2}[name]
            ]
            np.testing.assert_array_equal([one.pos for one in bodies], [[2.0 * i, row, 0.0] for i in range(count)])
        actuators = [model.actuator(i).name for i in range(model.nu)]
        assert actuators == [agent_name(i) + what for i in range(123) for what in ("forward", "yaw")]


def test_a_robot_whose_classes_are_nested_keeps_what_they_say(tmp_path: Path) -> None:
    text = (assets_folder() / "robot.xml").read_text()
    inner = '<default class="inner"><geom rgba="0.1 0.2 0.3 1"/></default>'
    text = text.replace('<default class="caster">', f'<default class="caster">{inner}')
    text = text.replace('name="front_caster" class="caster"', 'name="front_caster" class="inner"')
    (tmp_path / "nested.xml").write_text(text)
    model = model_of(Scenario(robot=Robot(model=str(tmp_path / "nested.xml"))))
    for slot in range(3):
        caster = model.geom(agent_name(slot) + "front_caster")
        np.testing.assert_allclose(caster.rgba, [0.1, 0.2, 0.3, 1.0], rtol=1e-6)
        assert (caster.size[0], caster.contype[0], caster.condim[0]) == (0.02, 1, 1)


def test_a_scene_that_nobody_looks_at_has_colliders_alone_and_weighs_the_same() -> None:
    seen, bare = model_of(), model_of(is_drawn=False)
    assert bare.nsite == 0 and bare.ncam == 2 and bare.ngeom == 1 + 3 * 5 + 2
    assert all(bare.geom(i).contype or bare.geom(i).conaffinity for i in range(bare.ngeom))
    for name in ("body_mass", "body_inertia", "body_invweight0", "dof_invweight0", "qpos0", "actuator_gainprm"):
        np.testing.assert_array_equal(getattr(bare, name), getattr(seen, name))
    for i in range(bare.ngeom):
        same = seen.geom(bare.geom(i).name)
        assert (bare.geom(i).size == same.size).all() and (bare.geom(i).pos == same.pos).all()


def test_a_robot_that_measures_at_a_site_keeps_it_where_nobody_looks(tmp_path: Path) -> None:
    text = (assets_folder() / "robot.xml").read_text()
    sensor = '<sensor><gyro name="gyro" site="lidar"/></sensor></mujoco>'
    (tmp_path / "gyro.xml").write_text(text.replace("</mujoco>", sensor))
    model = model_of(Scenario(robot=Robot(model=str(tmp_path / "gyro.xml"))), is_drawn=False)
    assert model.nsensor == 3 and model.nsite == 3 * 9
