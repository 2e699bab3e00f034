"""Films of episodes: poses between samples, who wears what, what is marked, and files that play."""

import numpy as np
import pytest
from episodes import Agent, Pedestrian, Touch, build_episode, line

from socialnav_mj.film import film
from socialnav_mj.film.film import Shot, followed_agent, frames, times_of, write_film
from socialnav_mj.film.marks import FOLLOWED, TOUCHED, draw_marks
from socialnav_mj.film.stage import TOPS, Stage, poses_at

mujoco = pytest.importorskip("mujoco")
SMALL = {"width": 96, "height": 64, "rate": 5.0}


@pytest.fixture(scope="module")
def episode():
    """Two agents, the second comes 2 s after the first; three people of whom the last leaves; one touch after 0.6 s."""
    agents = [
        Agent(positions=line((0, 0), (4, 0), 20)),
        Agent(positions=line((0, 2), (0, 5), 15), spawn_step=10),
    ]
    people = [Pedestrian(positions=np.tile([(2.0, 1.0)], (31, 1))), Pedestrian(positions=line((3, 3), (1, 3), 30))]
    return build_episode(agents, people, [Touch(agent=0, partner=0, step=3.0)])


def test_poses_between_samples_are_on_the_line_between_them(episode):
    first, second = poses_at(episode, episode.time[4]), poses_at(episode, episode.time[5])
    between = poses_at(episode, 0.25 * episode.time[4] + 0.75 * episode.time[5])
    np.testing.assert_allclose(between.agent[0], 0.25 * first.agent[0] + 0.75 * second.agent[0])
    np.testing.assert_allclose(between.pedestrian, 0.25 * first.pedestrian + 0.75 * second.pedestrian)
    assert np.isnan(first.agent[1]).all()


def test_headings_turn_the_short_way(episode):
    heading = episode.agent_heading.copy()
    heading[0, 0], heading[1, 0] = np.pi - 0.1, -np.pi + 0.3
    object.__setattr__(one := build_like(episode), "agent_heading", heading)
    middle = poses_at(one, 0.5 * (one.time[0] + one.time[1])).agent_heading[0]
    assert np.cos(middle) == pytest.approx(np.cos(np.pi + 0.1)) and np.sin(middle) == pytest.approx(np.sin(np.pi + 0.1))


def build_like(episode):
    """A copy whose arrays may be put in without checks."""
    copy = object.__new__(type(episode))
    for name, value in vars(episode).items():
        object.__setattr__(copy, name, value)
    return copy


def test_stage_stands_everybody_where_the_record_says(episode):
    stage = Stage(episode)
    poses = poses_at(episode, episode.time[12])
    stage.pose(poses)
    robots = [stage.data.body(f"agent_{slot:03d}/robot").xpos for slot in range(2)]
    np.testing.assert_allclose(sorted(p[:2].tolist() for p in robots), sorted(poses.agent.tolist()), atol=1e-9)
    stage.pose(poses_at(episode, episode.time[0]))
    heights = [stage.data.body(f"agent_{slot:03d}/robot").xpos[2] for slot in range(2)]
    assert sorted(heights) == [pytest.approx(-50.0), pytest.approx(0.0)]


def test_people_wear_different_clothes(episode):
    stage = Stage(episode)
    stage.pose(poses_at(episode, episode.time[0]))
    worn = [stage.model.geom(f"pedestrian_{k:03d}/torso").rgba[:3] for k in range(2)]
    assert not np.allclose(*worn) and all(np.isclose(TOPS, own).all(axis=1).any() for own in worn)


def test_goals_trails_and_touches_are_marked(episode):
    stage = Stage(episode)
    time = float(episode.contact_time[0]) + 0.3
    poses = poses_at(episode, time)
    stage.pose(poses)
    scene = mujoco.MjvScene(stage.model, maxgeom=2000)
    draw_marks(scene, episode, time, poses, 0)
    marks = [scene.geoms[k] for k in range(scene.ngeom)]
    cylinders = [m for m in marks if m.type == mujoco.mjtGeom.mjGEOM_CYLINDER]
    np.testing.assert_allclose(cylinders[0].pos[:2], episode.agent_goal[0], atol=1e-6)
    trail = [m for m in marks if m.type == mujoco.mjtGeom.mjGEOM_SPHERE and np.allclose(m.rgba[:3], FOLLOWED)]
    assert len(trail) == int(np.sum((episode.time <= time) & (episode.time >= time - 3.0)))
    touches = [m for m in marks if np.allclose(m.rgba[:3], TOUCHED)]
    assert len(touches) == 1
    np.testing.assert_allclose(touches[0].pos[:2], episode.contact_position[0], atol=1e-6)
    full = mujoco.MjvScene(stage.model, maxgeom=2)
    draw_marks(full, episode, time, poses, 0)
    assert full.ngeom == 2


def test_times_are_those_of_the_followed_agent(episode):
    person = int(episode.agent_person[1])
    times = times_of(Shot(agent=person, rate=10.0), episode)
    window = episode.time[episode.window(1)]
    assert times[0] == pytest.approx(window[0] - 1.0) and times[-1] <= min(window[-1] + 1.0, episode.time[-1]) + 1e-9
    assert np.diff(times) == pytest.approx(0.1)
    assert followed_agent(Shot(), episode) == 0 and followed_agent(Shot(camera="top"), episode) is None
    assert len(times_of(Shot(camera="top", seconds=1.0, rate=5.0), episode)) == 6


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"camera": "side"}, "camera = 'side' is not allowed; allowed: follow, oblique, top"),
        ({"rate": 0.0}, "allowed: in \\(0, 100\\]"),
        ({"width": 4000}, "width = 4000 is not allowed; allowed: even numbers from 16 to 1920"),
        ({"height": 101}, "height = 101"),
    ],
)
def test_shots_that_make_no_sense_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Shot(**settings)


def test_unknown_agents_and_times_are_refused(episode):
    with pytest.raises(ValueError, match=r"agent = 99 is not there; there are \d+, \d+"):
        times_of(Shot(agent=99), episode)
    with pytest.raises(ValueError, match="begin = 1000 s is not allowed; allowed: 0 to"):
        times_of(Shot(camera="top", begin=1000.0), episode)


def test_without_a_drawing_library_the_package_of_debian_is_named(episode, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    with pytest.raises(RuntimeError, match=r"needs a display, or the library EGL \(Debian: libegl1 .* OSMesa"):
        next(frames(episode, Shot(**SMALL)))


def test_a_drawing_library_that_fails_is_told(episode, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("no EGL device")

    monkeypatch.setattr(film.mujoco, "Renderer", fail)
    monkeypatch.setenv("MUJOCO_GL", "egl")
    with pytest.raises(RuntimeError, match=r"Debian: libegl1.*MUJOCO_GL is 'egl', which says: no EGL device"):
        next(frames(episode, Shot(**SMALL)))


def test_frames_show_the_scene_and_move(episode, offscreen):
    drawn = list(frames(episode, Shot(seconds=1.0, **SMALL)))
    assert len(drawn) == 6 and drawn[0].shape == (64, 96, 3) and drawn[0].std() > 5.0
    assert np.abs(drawn[0].astype(int) - drawn[-1]).max() > 50


@pytest.mark.parametrize(("name", "count"), [("a.mp4", 6), ("a.gif", 6), ("a.png", 1)])
def test_files_hold_the_frames(name, count, episode, offscreen, tmp_path):
    imageio = pytest.importorskip("imageio.v3", reason="needs the extra 'render'")
    pytest.importorskip("imageio_ffmpeg", reason="needs the extra 'render'")
    assert list(write_film(episode, Shot(seconds=1.0, **SMALL), tmp_path / name))[-1] == count
    read = imageio.imread(tmp_path / name, index=None) if count > 1 else imageio.imread(tmp_path / name)[None]
    assert read.shape[:3] == (count, 64, 96)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_other_endings_are_refused(episode, tmp_path):
    with pytest.raises(ValueError, match=r"a\.avi ends in '\.avi', which is not allowed; allowed: \.mp4, \.gif, \.png"):
        next(write_film(episode, Shot(), tmp_path / "a.avi"))
