"""What tells a controller from what it was before somebody edited it, and how two of one class are told apart."""

import importlib
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from socialnav_mj.controllers import Limits, TwistController, controller_config, controller_of, make_controller, spec_of
from socialnav_mj.controllers.identity import json_value, sources_of

PLAIN = """
from helper import FACTOR

class Spin:
    name = "spin"

    def __init__(self, margin=0.5, table=None):
        self.margin, self.table, self.seen, self._hidden = margin, table, 3, 4

    def reset(self, limits, *, seed=0):
        self.limits, self.steps = limits, 0

    def act(self, observation):
        self.steps += 1
        return observation["goal"] * FACTOR
"""
TOLD = PLAIN.replace(
    "    def reset", "    def config(self):\n        return {'margin': self.margin}\n\n    def reset", 1
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder with a controller, a module that it imports, and one that it does not."""
    monkeypatch.syspath_prepend(tmp_path)
    for name, text in (("mine", PLAIN), ("helper", "FACTOR = 2.0\n"), ("other", "X = 1\n"), ("told", TOLD)):
        (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.delitem(sys.modules, name, raising=False)
    importlib.invalidate_caches()
    return tmp_path


def again(*names: str) -> None:
    """As in the next process: the modules are read anew."""
    for name in names:
        sys.modules.pop(name, None)
    importlib.invalidate_caches()


def test_configuration_of_a_plain_class_holds_settings_attributes_and_sources(folder: Path) -> None:
    config = controller_config(make_controller("mine:Spin(margin=0.25)"))
    assert (config["class"], config["margin"], config["table"]) == ("mine:Spin", 0.25, None)
    assert config["attributes"] == {"name": "mine:Spin(margin=0.25)", "seen": 3}
    assert list(config["sources"]) == ["mine:Spin in helper.py", "mine:Spin in mine.py"]
    assert controller_config(make_controller("mine:Spin")) == {
        **config,
        "margin": 0.5,
        "attributes": {"seen": 3},
    }
    told = controller_config(make_controller("told:Spin(margin=2)"))
    assert told["margin"] == 2 and "table" not in told and told["attributes"]["seen"] == 3


@pytest.mark.parametrize(
    ("file", "text", "changes"),
    [
        ("mine.py", PLAIN.replace("self.steps += 1", "self.steps += 2"), True),
        ("helper.py", "FACTOR = 3.0\n", True),
        ("other.py", "X = 2\n", False),
    ],
)
def test_an_edit_of_what_it_is_made_of_changes_the_configuration(
    folder: Path, file: str, text: str, changes: bool
) -> None:
    before = controller_config(make_controller("mine:Spin"))
    (folder / file).write_text(text)
    again("mine", "helper", "other")
    assert (controller_config(make_controller("mine:Spin")) != before) == changes


def test_package_is_followed_as_a_whole_and_installed_neighbours_are_not(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = folder / "pack"
    (package / "inner").mkdir(parents=True)
    for name in ("__init__.py", "inner/__init__.py"):
        (package / name).write_text("")
    (package / "inner" / "one.py").write_text(PLAIN.replace("from helper", "import helper\nfrom ..two"))
    (package / "two.py").write_text("from . import three\nFACTOR = 1\n")
    (package / "three.py").write_text("import pack.inner.one\n")
    (package / "four.py").write_text("")
    importlib.invalidate_caches()
    kind = type(make_controller("pack.inner.one:Spin"))
    names = {f"pack/{name}" for name in ("__init__.py", "inner/__init__.py", "inner/one.py", "two.py", "three.py")}
    assert set(sources_of(kind)) - {"pack/__init__.py", "pack/inner/__init__.py"} == names - {
        "pack/__init__.py",
        "pack/inner/__init__.py",
    }
    # A module of its own among installed packages is alone.
    monkeypatch.setattr("socialnav_mj.controllers.identity.sysconfig.get_paths", lambda: {"purelib": str(folder)})
    assert set(sources_of(type(make_controller("mine:Spin")))) == {"mine.py"}


def test_weights_that_a_setting_names_belong_to_it(folder: Path) -> None:
    weights = folder / "weights.bin"
    weights.write_bytes(b"1")
    spec = f"mine:Spin(table={str(weights)!r})"
    before = controller_config(make_controller(spec))
    weights.write_bytes(b"2")
    after = controller_config(make_controller(spec))
    assert {key for key in before if before[key] != after[key]} == {"sources"}
    assert {key for key in before["sources"] if before["sources"][key] != after["sources"][key]} == {str(weights)}


def test_parts_bring_their_sources_and_built_in_ones_have_none(folder: Path) -> None:
    @dataclass(kw_only=True)
    class Pair(TwistController):
        parts: tuple[object, ...] = field(default=(), metadata={"is_controller": True})
        name: str = "pair"

        def twist(self, observation):
            return np.zeros((len(observation["active"]), 2))

    pair = Pair(parts=(make_controller("mine:Spin"), make_controller("go_straight")))
    config = controller_config(pair)
    assert config["parts"] == ["mine:Spin", "go_straight"] and "mine:Spin in helper.py" in config["sources"]
    for name in ("hybrid", "mpc", "replay_irl"):
        assert not {"sources", "attributes"} & controller_config(make_controller(name)).keys()


def test_a_plain_class_is_made_again_from_its_configuration(folder: Path) -> None:
    for spec in ("mine:Spin", "mine:Spin(margin=2)", "fast=mine:Spin(margin=2)", "told:Spin(margin=3)"):
        config = controller_config(make_controller(spec))
        module = str(config["class"])
        made = controller_of(config, trusted=(module,))
        assert controller_config(made) == config
        assert controller_config(make_controller(spec_of(made))) == config
    with pytest.raises(ValueError, match="no setting 'margn'; allowed: margin, table"):
        controller_of({"class": "mine:Spin", "margn": 1}, trusted=("mine:Spin",))


@pytest.mark.parametrize(
    ("spec", "name"),
    [
        ("mine:Spin", "spin"),
        ("mine:Spin(margin=2)", "mine:Spin(margin=2)"),
        ("fast=mine:Spin(margin=2)", "fast"),
        ("fast=mine:Spin", "fast"),
        ("fast=potential_field(position_gain=2)", "fast"),
        ("slow = go_straight", "slow"),
    ],
)
def test_specs_name_their_controllers(folder: Path, spec: str, name: str) -> None:
    assert make_controller(spec).name == name


def test_a_name_that_cannot_be_set_is_told(folder: Path) -> None:
    (folder / "other.py").write_text(PLAIN.replace('name = "spin"', "name = property(lambda self: 'x')"))
    with pytest.raises(ValueError, match="'x' cannot be named 'fast'"):
        make_controller("fast=other:Spin")


def test_values_that_json_cannot_say_are_told_by_type_or_digest() -> None:
    assert json_value(np.arange(3.0)) == [0.0, 1.0, 2.0] and json_value((1, {"a": np.float64(2)})) == [1, {"a": 2.0}]
    assert json_value(float("nan")) == "builtins.float" and json_value(Limits) == "builtins.type"
    one, two = (json_value(np.arange(99.0) + shift) for shift in (0, 1))
    assert one != two and "(99,) sha256" in one
