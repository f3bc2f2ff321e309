# SPDX-License-Identifier: Apache-2.0
"""The libraries for all levels of processors give the same bits."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from mobee._core import FORCED
from mobee._core.levels import library_file, possible_levels, processor_flags

EVALUATE = """
import hashlib, numpy as np, mobee
from tests.mobee.model.random_scenes import loaded, posed, random_world

rng, found = np.random.default_rng(7), hashlib.sha256()
for name in ("icub", "icub_2014", "katana"):
    robot = loaded(name)
    model, q = mobee.Model(robot, random_world(rng, robot, 130, 0.6)), posed(rng, robot, 40)
    pose = model.evaluate(q)
    path = model.track().evaluate(robot.home + np.linspace(0.0, 0.3, 60)[:, None])
    for array in (pose.transforms, pose.table.numbers, pose.table.reals, pose.projection, path.table.reals, path.projection):
        found.update(np.ascontiguousarray(array).tobytes())
print(found.hexdigest())
"""


def test_all_levels_give_the_same_bits() -> None:
    found = {}
    for level in possible_levels(processor_flags()):
        if library_file(level).exists():
            run = subprocess.run([sys.executable, "-c", EVALUATE], env={**os.environ, FORCED: level}, capture_output=True, text=True)
            assert run.returncode == 0, run.stderr
            found[level] = run.stdout
    if len(found) < 2:
        pytest.skip("there is only one library that runs here")
    assert len(set(found.values())) == 1, found
