# SPDX-License-Identifier: Apache-2.0
"""One model for all tests of the package, each in a run of its own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from mobee import load_robot
from tests.services.harness import rig
from tests.services.model.stage import Stage, staged


@pytest.fixture(scope="package")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    with rig(tmp_path_factory.mktemp("model"), load_robot("icub")) as made:
        yield staged(made, "--ghosts", "saucer")


@pytest.fixture
def run(stage: Stage) -> Stage:
    """The stage in a new run, at home."""
    stage.sim.new_run()
    stage.sim.silent = set()
    stage.tick()
    return stage
