"""Elementary functions and episodes that are the same whatever kernels numpy and BLAS choose for the processor."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from socialnav_mj import elementary

VALUES = np.concatenate([np.linspace(-20.0, 20.0, 401), [0.0, -0.0, 1e-300, -1e-9]]).reshape(15, 27)


@pytest.mark.parametrize("name", ["exp", "tanh", "sin", "cos", "arccos"])
def test_functions_are_numpys_but_for_the_last_bit(name):
    values = VALUES / 20.0 if name == "arccos" else VALUES
    found = getattr(elementary, name)(values)
    assert found.dtype == float and found.shape == values.shape
    np.testing.assert_allclose(found, getattr(np, name)(values), rtol=1e-15, atol=1e-16)
    assert getattr(elementary, name)(0.25).shape == () and getattr(elementary, name)(np.zeros((0, 3))).shape == (0, 3)


def test_arctan2_is_numpys_but_for_the_last_bit_and_broadcasts():
    y, x = VALUES[:, None], VALUES[None, :, ::-1]
    np.testing.assert_allclose(elementary.arctan2(y, x), np.arctan2(y, x), rtol=1e-15)
    assert elementary.arctan2([0.0, -0.0, 1.0], -1.0).tolist() == [np.pi, -np.pi, np.arctan2(1.0, -1.0)]


CODE = """
import hashlib, json, os
import numpy as np
from socialnav_mj.controllers import make_controller
from socialnav_mj.environment import make_environment
from socialnav_mj.recordings import load_recording
from socialnav_mj.rollout import rollout

found = {}
for spec in ("potential_field", "replay_irl", "hybrid", "mpc"):
    environment = make_environment(dataset="plaza", share=0.3, time_limit=5.0)
    found[spec] = rollout(environment, make_controller(spec)).metadata["state_hash"]
if os.environ.get("SOCIALNAV_MJ_DATA"):  # the recordings whose homography turns
    positions = np.concatenate(load_recording("zara01").positions)
    found["zara01"] = hashlib.sha256(positions.tobytes()).hexdigest()
print(json.dumps(found))
"""


def test_states_do_not_depend_on_the_kernels_that_numpy_and_blas_choose():
    """BLAS as on older processors, numpy and numba without the vector kernels that this one has."""
    vectors = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    settings = [
        {},
        {"OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": " ".join(vectors), "NUMBA_CPU_NAME": "generic"},
        {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": " ".join(vectors)},
    ]
    found = []
    for setting in settings:
        environment = {k: v for k, v in {**os.environ, **setting}.items() if v}
        result = subprocess.run(
            [sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, check=False
        )
        if setting and result.returncode < 0:
            continue  # a kernel that this processor cannot run
        assert result.returncode == 0, result.stderr
        found.append(json.loads(result.stdout))
    assert len(found) > 1 and all(own == found[0] for own in found)
