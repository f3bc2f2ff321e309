# SPDX-License-Identifier: Apache-2.0
"""One robot_sim for the tests of its process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.services.harness import rig
from tests.services.robot_sim.bench import ROBOT, Bench


@pytest.fixture(scope="package")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with rig(tmp_path_factory.mktemp("robot_sim"), ROBOT) as bus:
        yield Bench(bus, "--backend", "kinematic")
