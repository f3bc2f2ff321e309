# SPDX-License-Identifier: Apache-2.0
"""One idea holds the project together: the same agent on the offline plant and on the bus (DESIGN section 2)."""

from __future__ import annotations

from pathlib import Path

import pytest

from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, load_robot, load_world
from tests.system.live import running, transitions, until

pytestmark = pytest.mark.system

ACTIONS = 3
SEED = 4
GAINS = "default"
ATTEMPTS = 5

Row = tuple[int, int, int, int]  # n, s, a, s'


@pytest.mark.timeout(500)
def test_live_actions_end_in_the_same_states(tmp_path: Path) -> None:
    live = None
    for attempt in range(ATTEMPTS):
        live = on_the_bus(tmp_path / str(attempt))
        if live is not None:
            break
    assert live is not None, f"a stall of this machine interrupted an action in each of {ATTEMPTS} attempts"
    assert live == offline()
    assert len({row[3] for row in live}) > 2


def on_the_bus(folder: Path) -> list[Row] | None:
    """The transitions of the agent's process; None if an action was interrupted, which is no outcome on either plant."""
    folder.mkdir()
    scenario = str(Path(__file__).with_name("one_arm.toml"))
    with running(folder, scenario, f"shared.seed={SEED}", f"shared.gains={GAINS}") as (system, watcher):

        def made() -> int:
            return len(transitions(system.run_dir)["left_arm"])

        until(lambda: made() >= ACTIONS or watcher.stat("agent_left_arm").numbers["interrupted"], 100.0, f"{ACTIONS} actions on the bus")
        if made() < ACTIONS:
            print("interrupted, once more:", [event.text for event in watcher.events if event.level != "info"])
            return None
        return [row[:4] for row in transitions(system.run_dir)["left_arm"][:ACTIONS]]


def offline() -> list[Row]:
    robot = load_robot("icub")
    world = load_world("table")
    world.remove("ball")  # no camera sees it in this scenario
    space = Lattice(robot, ["l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow"])
    plant = OfflinePlant(Model(robot, world), gains=Gains.named(GAINS), motors=MotorParameters(encoder_noise=0.0))
    agent = CuriousAgent(space, plant, seed=SEED)
    rows: list[Row] = []
    for _ in range(ACTIONS):
        agent.step()
        assert agent.last is not None
        rows.append((agent.last.n, agent.last.s, agent.last.a, agent.last.s_next))
    return rows
