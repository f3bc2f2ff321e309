# SPDX-License-Identifier: Apache-2.0
"""The scenario `push`: an agent continues offline learning with a cup that it sees, and that is put back when it has left its area."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import Transition
from bus_schema.rpc import Done, Empty, Place, World
from mobee import load_robot
from mobee.learning.object_space import ObjectSpace
from mobee.store import STORE, TransitionStore
from services.agents.config import Config
from services.common import rpc
from services.launcher.scenario import read_scenario
from tests.examples.test_documentation import blocks, run
from tests.system.live import Watcher, running, until

pytestmark = pytest.mark.system
pytest.importorskip("mujoco")

CONFIG = next(part.config for part in read_scenario("push").parts if isinstance(part.config, Config))
FIRST, AWAY, OFFLINE = np.array([-0.3, -0.155, -0.055]), [-0.3, 0.3, -0.055], 20


def cup(watcher: Watcher) -> tuple[str, np.ndarray] | None:
    """Role and place of the cup in the model's world; None if it is not seen."""
    found = rpc.call(watcher.session, "test", keys.world_rpc("list"), Empty, World, timeout=5.0, tries=3).objects
    return next(((one.role, np.array(one.position)) for one in found if one.name == "cup"), None)


def test_an_agent_continues_with_a_cup_that_vision_sees_and_that_is_put_back(tmp_path: Path) -> None:
    blocks("docs/agents.md", tmp_path)
    run(tmp_path, "offline_cup.py", str(OFFLINE))
    space = CONFIG.space(load_robot("icub"))
    assert isinstance(space, ObjectSpace)
    with running(tmp_path, "push", f"services.agent_left_arm.continues={tmp_path / 'cup.sqlite'}") as (system, watcher):
        made: list[Transition] = []
        watcher._subscribe(Transition.stream.key("left_arm"), Transition, made)
        place = {"name": "cup", "position": AWAY}
        rpc.call(watcher.session, "test", keys.sim("place"), Place, Done, timeout=5.0, tries=3, **place)
        until(lambda: "object_back" in [event.code for event in list(watcher.events)], 90.0, "the cup is back")
        role, seen = until(lambda: cup(watcher), 20.0, "the cup is seen")
        assert role == "ghost" and np.linalg.norm(seen - FIRST) < 0.1
        assert until(lambda: made, 90.0, "a transition")[0].s == space.state(CONFIG.aside, space.grid.cell_of(FIRST))
        with TransitionStore(system.run_dir / STORE, "left_arm", read_only=True) as store:
            assert store.settings()["continued"]["transitions"] == OFFLINE
            assert len(store.load()) >= OFFLINE + len(made) - 1
