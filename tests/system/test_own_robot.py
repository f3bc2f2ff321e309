# SPDX-License-Identifier: Apache-2.0
"""A robot of a user's own, a URDF without masses, learns on MuJoCo in lockstep."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.services.robots import chain
from tests.system.live import launch

pytest.importorskip("mujoco")
pytestmark = [pytest.mark.system, pytest.mark.untimed]

SCENARIO = """
[shared]
robot = "{robot}"
gains = "default"
mode = "lock"
patience = 20

[services.robot_sim]
rate = 50

[services.model]
[services.controller]

[services.agent_all]
joints = ["joint_0", "joint_1", "joint_2"]
neighbours = 6
"""
TICKS = 600


def test_a_urdf_learns_with_physics_and_the_same_seed_makes_the_same_run(tmp_path: Path) -> None:
    robot, scenario = tmp_path / "chain.urdf", tmp_path / "chain.toml"
    robot.write_text(chain(3))
    scenario.write_text(SCENARIO.format(robot=robot))
    summaries = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        system = launch(tmp_path / name, str(scenario), ticks=TICKS)
        summaries.append(system.summary(timeout=240))
        assert "robot_sim is ready" in system.errors.read_text() and "mujoco 50 Hz" in system.errors.read_text()
        assert "the robot's file has no masses" in system.log("robot_sim")
    for summary in summaries:
        assert (summary["lockstep"]["ticks"], summary["lockstep"]["repeatable"]) == (TICKS, True)
        assert summary["agents"]["all"]["transitions"] >= 2
        assert summary["pairs_watched"] > 0
        assert summary["deepest_solid_contact_m"] < 0.002
    assert summaries[0]["lockstep"]["states_sha256"] == summaries[1]["lockstep"]["states_sha256"]
