"""The rules of the house that no single module can hold: who imports whom, what imports do, what git carries."""

import ast
import hashlib
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("socialnav_mj", "tasks")

# Top to bottom: a room may import from its own row and from the rows above it; `studies.paper` is a room of its own.
# `episode` stands above the simulator although it is filled after it: it is a record of numpy arrays, and physics and
# task share its Outcome and Partner.
ROWS = (
    {
        "resources",
        "sources",
        "elementary",
        "geometry",
        "config",
        "files",
        "cluster",
        "processes",
        "slots",
        "robot_files",
    },
    {"recordings"},
    {"contact", "outcome", "episode_checks", "observation", "episode", "features", "provenance"},
    {
        "action",
        "cast",
        "crowd",
        "reaction",
        "scene",
        "scene_index",
        "people",
        "plant",
        "touch",
        "pool",
        "robots",
        "physics",
        "sample",
        "collision",
        "entrance",
        "task",
        "environment",
    },
    {"suite"},
    {"tasks"},
    {"controllers"},
    {"parting", "parts", "recorder", "rollout", "human", "resumption", "evaluation"},
    {"metrics"},
    {"trace", "film", "export"},
    {"report"},
    {"envs"},
    {"learning"},
    {"studies"},
    {"studies.paper", "studies.leave_one_out"},
    {"studies.gains", "studies.leaderboard", "studies.reaction", "studies.plant"},
    {"benchmark", "growth", "throughput", "comparison", "resimulation", "verification", "cli", "__main__"},
)
# A study uses what all studies share, and no other study.
STUDIES = {room for row in ROWS for room in row if room.startswith("studies.")}
# Controllers own no simulator: most rows above are closed to them.
CONTROLLERS_MAY_IMPORT = {
    "resources",
    "sources",
    "elementary",
    "geometry",
    "config",
    "observation",
    "features",
    "controllers",
}
# `socialnav_mj.load` imports the suite when it is called.
EXCEPTIONS = {("socialnav_mj", "suite")}
# Rooms that may use a heavy library; every other room keeps clear of it. `rollout` and the package itself name
# dm_control's Environment in their signatures, `benchmark` times bare mj_step calls, `cli` reports PhysicsError.
ONLY_IN = {
    "mujoco": {
        "scene",
        "scene_index",
        "people",
        "plant",
        "touch",
        "pool",
        "robots",
        "physics",
        "task",
        "environment",
        "suite",
        "benchmark",
        "film",
    },
    "dm_control": {
        "scene",
        "robots",
        "physics",
        "task",
        "environment",
        "suite",
        "rollout",
        "benchmark",
        "cli",
        "socialnav_mj",
    },
    "matplotlib": {"report", "studies", "studies.paper", "studies.gains", "studies.leaderboard"},
    "rerun": {"trace"},
    "torch": {"learning"},
    "stable_baselines3": {"envs", "learning", "controllers", "throughput"},
    "gymnasium": {"envs", "learning"},
    "pettingzoo": {"envs"},
    "numba": {"controllers"},
    "ray": {"cluster"},
}
LAZY = ("torch", "rerun", "stable_baselines3", "gymnasium", "pettingzoo", "matplotlib", "pyarrow", "numba", "ray")

# sha256 of the UCY files that may not travel with the project: annotations, homographies, groups.
UCY_SUMS = {
    "4efaab962b9acd3d318d9370e8e34eb7703e544edd1d720686f45bd85676012e",  # students03/H.txt
    "4bdb5ce1bbeccc66c74aa35e2fbd0e1ecc0bdc650d7f5382e704cc07cbb47838",  # students03/annotation.vsp
    "93f1c1d59e089de38ca9d3a81d1592f8add87fac92130abdedcc3a8267177e02",  # students03/groups.txt
    "d9fd7048eab7d3d9550d7ac4f59b19d97a87612310e8c8e48cf3aaf59764ff80",  # students03/obsmat.txt
    "2172a470ff902891063c6fb914cc86257d61fbe44711359bf33361263581b8be",  # zara01/H.txt
    "20ddd7a32b249315cdb9420dee07ed61ff2068f7032406dbf9fdf5725c2dc739",  # zara01/annotation.vsp
    "13e43c938e01cd8c3dca4e3144aa0acaf6adfe75c4374bc41bbfbfbc199b3a89",  # zara01/groups.txt
    "bd999ebcfbc506821fa5032a10b9101e150defcff85f1ef037d09ce7c6a8c2aa",  # zara01/obsmat.txt
    "e8498fa91f3d83785ff3a767800b868a6abde82a49711a6a35c516890f281861",  # zara02/annotation.vsp
    "8ae568fe9e62bf5be886bce898abda4ce82dd52bf4b09d4d89a4d6b105f1b1f5",  # zara02/groups.txt
    "0b29bdacd54b971299b741f291d9b0eac0ce9aeec9901e75576c529a39523e9b",  # zara02/obsmat.txt
}
MAX_LINES = 300
"""Of a module."""
MAX_SHARE = 0.2
"""Of all lines, in one room with the rooms in it."""
MAX_BYTES = 1_000_000
MAY_BE_LARGE = ("assets/policies/", "data/plaza/")


def modules() -> Iterator[tuple[str, Path]]:
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def room_of(module: str) -> str:
    """`socialnav_mj.metrics.paper` is in room `metrics`, `socialnav_mj.studies.paper.plan` in `studies.paper`.

    `tasks` and the package itself are their own rooms.
    """
    parts = module.split(".")
    if parts[0] != "socialnav_mj" or len(parts) == 1:
        return parts[0]
    inner = ".".join(parts[1:3])
    return inner if inner in set().union(*ROWS) else parts[1]


def imported_modules(tree: ast.AST, module: str, path: Path) -> Iterator[tuple[int, str]]:
    """Line and absolute name of every import, also those inside functions and under TYPE_CHECKING."""
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*base, *(node.module.split(".") if node.module else [])])
            if source == "socialnav_mj":
                yield from ((node.lineno, f"{source}.{alias.name}") for alias in node.names)
            else:
                yield node.lineno, source


def dotted(node: ast.AST) -> str:
    """`np.random.rand` for that expression; empty for anything that is no chain of names."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def sources() -> Iterator[tuple[str, Path, ast.AST]]:
    for module, path in modules():
        yield module, path, ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def fresh_interpreter(code: str, folder: Path) -> list[str]:
    """Words that the code prints when it is run in a folder by a Python that has imported nothing."""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=folder, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


def tracked_files() -> list[str]:
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True)
    return [name for name in listing.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_every_module_has_a_room():
    known = set().union(*ROWS) | {"socialnav_mj"}
    homeless = [module for module, _ in modules() if room_of(module) not in known]
    assert not homeless, f"modules without a row in the table of rooms: {homeless}"


def test_imports_only_point_upwards():
    row = {room: index for index, rooms in enumerate(ROWS) for room in rooms}
    # The package itself is above everything: it imports nothing of ours, `load` apart.
    row["socialnav_mj"] = -1
    wrong = []
    for module, path, tree in sources():
        room = room_of(module)
        for line, target in imported_modules(tree, module, path):
            if target.split(".")[0] not in PACKAGES:
                continue
            other = room_of(target)
            if (module, other) in EXCEPTIONS:
                continue
            closed = room == "controllers" and other not in CONTROLLERS_MAY_IMPORT
            closed = closed or (room in STUDIES and other in STUDIES - {room})
            if closed or row.get(other, -1) > row.get(room, -1):
                wrong.append(f"{path.relative_to(ROOT)}:{line} {room} imports {other}")
    assert not wrong, "\n".join(wrong)


def test_nothing_imports_the_top_level_tasks_which_a_users_file_may_shadow():
    found = [
        f"{path}:{line}"
        for module, path, tree in sources()
        for line, name in imported_modules(tree, module, path)
        if name.split(".")[0] == "tasks"
    ]
    assert not found, found


def test_heavy_libraries_stay_in_their_rooms():
    wrong = [
        f"{path.relative_to(ROOT)}:{line} {room_of(module)} imports {target}"
        for module, path, tree in sources()
        for line, target in imported_modules(tree, module, path)
        if (top := target.split(".")[0]) in ONLY_IN and room_of(module) not in ONLY_IN[top]
    ]
    assert not wrong, "\n".join(wrong)


def test_no_module_and_no_room_is_too_long_to_be_read():
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for _, path in modules()}
    long = [f"{path.relative_to(ROOT)}: {count} lines" for path, count in lines.items() if count > MAX_LINES]
    assert not long, long
    of_room: Counter[str] = Counter()
    for module, path in modules():
        of_room[room_of(module).split(".")[0]] += lines[path]
    ((largest, count),) = of_room.most_common(1)
    assert count < MAX_SHARE * sum(lines.values()), f"{largest} holds {count} of {sum(lines.values())} lines"


def test_import_of_the_package_brings_in_no_heavy_library():
    code = f"import sys, socialnav_mj, tasks; print(*[name for name in {LAZY} if name in sys.modules])"
    assert fresh_interpreter(code, ROOT) == []


def test_import_of_any_module_opens_no_asset_and_writes_nothing(tmp_path):
    """Every room but those whose libraries are extras is imported under an audit of opened files."""
    names = [name for name, _ in modules() if room_of(name) not in {"learning", "envs"}]
    code = f"""
import importlib, os, sys
root = {str(ROOT)!r}
guarded = tuple(os.path.join(root, name) + os.sep for name in ("assets", "data"))
opened = []
def audit(event, args):
    if event == "open" and isinstance(args[0], str):
        path = os.path.abspath(args[0])
        if path.startswith(guarded) or path.startswith(os.getcwd() + os.sep):
            opened.append(path)
sys.addaudithook(audit)
for name in {names!r}:
    importlib.import_module(name)
print(*opened)
"""
    assert fresh_interpreter(code, tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def test_modules_print_nothing():
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for module, path, tree in sources()
        if room_of(module) != "cli"
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and dotted(node.func) in {"print", "pprint", "pprint.pprint"}
    ]
    assert not wrong, wrong


def test_no_module_uses_numpys_global_random_state():
    own_state = {"default_rng", "Generator", "SeedSequence", "RandomState", "PCG64", "BitGenerator"}
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno} {dotted(node)}"
        for _, path, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and dotted(node.value) in {"np.random", "numpy.random"}
        and node.attr not in own_state
    ]
    assert not wrong, wrong


def test_no_module_but_the_command_reads_the_current_directory():
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno} {dotted(node)}"
        for module, path, tree in sources()
        if room_of(module) != "cli"
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr in {"cwd", "getcwd", "getcwdb"}
    ]
    assert not wrong, wrong


# Whose last bit numpy or BLAS chooses by the processor; `elementary` and `np.einsum` stand for them.
PROCESSORS_OWN = {
    *("exp", "tanh", "sin", "cos", "tan", "arctan2", "arctan", "arcsin", "arccos", "log", "expm1", "log1p", "power"),
    *("sinh", "cosh", "cbrt", "exp2", "log2", "log10", "dot", "matmul", "inner", "vdot", "tensordot"),
}
STATES_DEPEND_ON = {
    *(
        "geometry",
        "recordings",
        "observation",
        "features",
        "action",
        "cast",
        "crowd",
        "reaction",
        "sample",
        "entrance",
        "slots",
        "people",
        "plant",
        "touch",
        "pool",
        "robots",
        "physics",
    ),
    *("task", "environment", "controllers", "rollout", "human"),
}


def test_what_states_depend_on_rounds_alike_on_every_processor():
    wrong = []
    for module, path, tree in sources():
        if room_of(module) not in STATES_DEPEND_ON or module.endswith((".check", ".facts", ".companions")):
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
                wrong.append(f"{path.relative_to(ROOT)}:{node.lineno} @")
            elif isinstance(node, ast.Attribute) and dotted(node.value) in {"np", "numpy"}:
                wrong += [f"{path.relative_to(ROOT)}:{node.lineno} np.{node.attr}"] * (node.attr in PROCESSORS_OWN)
            elif isinstance(node, ast.Call) and dotted(node.func) == "np.linalg.norm":
                # Without an axis it is a product of BLAS's.
                flat = "axis" not in {keyword.arg for keyword in node.keywords}
                wrong += [f"{path.relative_to(ROOT)}:{node.lineno} np.linalg.norm without axis"] * flat
    assert not wrong, "\n".join(wrong)


def test_git_carries_no_large_file_outside_the_known_places():
    large = [
        f"{name}: {size} bytes"
        for name in tracked_files()
        if (size := (ROOT / name).stat().st_size) > MAX_BYTES and not name.startswith(MAY_BE_LARGE)
    ]
    assert not large, large


def test_git_carries_no_file_of_the_ucy_data():
    found = [n for n in tracked_files() if hashlib.sha256((ROOT / n).read_bytes()).hexdigest() in UCY_SUMS]
    assert not found, found
