# SPDX-License-Identifier: Apache-2.0
"""One controller for all tests of the package, each in a run of its own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from bus_schema import keys
from bus_schema.rpc import Done, Empty
from tests.services.controller.stage import HEAD, PARTS, ROBOT, Stage, staged
from tests.services.harness import rig


@pytest.fixture(scope="package")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    folder = tmp_path_factory.mktemp("controller")
    settings = folder / "controller.toml"
    settings.write_text(f"[posture]\nhead = {HEAD}\n")
    with rig(folder, ROBOT) as made:
        yield staged(made, "--config", str(settings))


@pytest.fixture
def run(stage: Stage) -> Iterator[Stage]:
    """The stage in a new run with all parts under control."""
    stage.sim.frozen, stage.sim.silent, stage.sim.refuses_to_arm = False, set(), set()
    stage.model.silent, stage.model.behind, stage.model.touched, stage.model.part_age = False, 0, {}, dict.fromkeys(PARTS, 0)
    stage.model.collision[:] = 0.0
    stage.sim.new_run()
    stage.under_control()
    stage.rig.call(keys.service_rpc("controller", "mark"), Empty, Done)
    yield stage
    for who, instance in list(stage.owned):
        stage.leave(who, instance)
