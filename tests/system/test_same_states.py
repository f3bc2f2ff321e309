"""One idea holds the project together: the same agent on the offline plant and on the bus (DESIGN section 2)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, load_robot, load_world
from tests.system.live import running, transitions, until

pytestmark = pytest.mark.system

ACTIONS = 30
SEED = 4


def test_thirty_actions_end_in_the_same_states(tmp_path: Path) -> None:
    scenario = Path(__file__).with_name("one_arm.toml")
    with running(tmp_path, str(scenario), f"shared.seed={SEED}", "services.robot_sim.speed=4.0") as (system, _):
        until(lambda: len(transitions(system.run_dir)["left_arm"]) >= ACTIONS, 150.0, f"{ACTIONS} actions on the bus")
        live = transitions(system.run_dir)["left_arm"][:ACTIONS]
    robot = load_robot("icub")
    space = Lattice(robot, ["l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow"])
    plant = OfflinePlant(Model(robot, load_world("table")), gains=Gains.published_2014(), motors=MotorParameters(encoder_noise=0.0))
    agent = CuriousAgent(space, plant, seed=SEED)
    offline = []
    for _ in range(ACTIONS):
        agent.step()
        assert agent.last is not None
        offline.append((agent.last.n, agent.last.s, agent.last.a, agent.last.s_next))
    print("differing durations, s:", np.round([row[6] for row in live], 2))
    assert [row[:4] for row in live] == offline
