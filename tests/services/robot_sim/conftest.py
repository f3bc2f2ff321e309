# SPDX-License-Identifier: Apache-2.0
"""One robot_sim for the tests of its process; the physics engines, for tests that hold for each."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.services.harness import rig
from tests.services.robot_sim.bench import ROBOT, Bench
from tests.services.robot_sim.engines import Engine


@pytest.fixture(scope="package")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with rig(tmp_path_factory.mktemp("robot_sim"), ROBOT) as bus:
        yield Bench(bus, "--backend", "kinematic")


@pytest.fixture(params=["pybullet", "mujoco"])
def engine(request: pytest.FixtureRequest) -> Engine:
    pytest.importorskip(request.param)
    if request.param == "pybullet":
        from services.robot_sim.bullet import BulletBackend

        return BulletBackend
    from services.robot_sim.mujoco_backend import MujocoBackend

    return MujocoBackend
