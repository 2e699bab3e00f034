"""The embedded recording is there, unharmed, and what its README says."""

import numpy as np
import pytest

from socialnav_mj.recordings import load_recording
from socialnav_mj.recordings.facts import facts, facts_table
from socialnav_mj.recordings.fetch import fetch
from socialnav_mj.resources import data_folder


def test_plaza_needs_no_data_directory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOCIALNAV_MJ_DATA", raising=False)
    plaza = load_recording("plaza")
    assert (plaza.name, plaza.variant, plaza.n_people, plaza.frame_rate) == ("plaza", "vsp", 434, 25.0)
    assert plaza.duration == 216.0


def test_plaza_is_like_students003() -> None:
    # Figures of students003, see data/plaza/README.md; the tolerances are what the README admits.
    found = facts(load_recording("plaza"))
    assert found.mean_present == pytest.approx(32.5, rel=0.05)
    assert found.speed[50] == pytest.approx(0.73, abs=0.03)
    assert found.standing_share == pytest.approx(0.10, abs=0.02)
    assert list(found.nearest_neighbour.values()) == pytest.approx([0.44, 0.58, 0.74, 1.08], rel=0.13)
    assert found.closer_than[0.32] == pytest.approx(0.10, abs=0.03)
    assert found.n_companion_people == pytest.approx(208, rel=0.06)


def test_plaza_readme_has_its_current_figures() -> None:
    readme = (data_folder() / "plaza" / "README.md").read_text(encoding="utf-8")
    for line in facts_table({"plaza": facts(load_recording("plaza"))}).splitlines()[2:]:
        assert line in readme


def test_people_of_plaza_walk_like_people() -> None:
    # students003's fastest moment, by the same interpolation: 2.96 m/s.
    plaza = load_recording("plaza")
    crowd = plaza.at(np.arange(0.0, plaza.duration, 0.1))
    assert np.hypot(*crowd.velocity[crowd.present].T).max() < 3.0


def test_fetch_of_the_embedded_recording_says_so() -> None:
    with pytest.raises(ValueError, match="'plaza' is embedded, there is nothing to fetch; can be fetched: students003"):
        fetch("plaza")
