# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from mobee.robot.load import load_robot
from services.robot_sim import choice
from services.robot_sim.choice import Name, choose
from services.robot_sim.kinematic import BackendUnavailable

ICUB, KATANA = load_robot("icub"), load_robot("katana")


@pytest.mark.parametrize(
    ("installed", "icub", "katana"),
    [
        ({"pybullet", "mujoco"}, "pybullet", "mujoco"),
        ({"mujoco"}, "mujoco", "mujoco"),
        ({"pybullet"}, "pybullet", "kinematic"),
        (set(), "kinematic", "kinematic"),
    ],
)
def test_auto_takes_physics_where_it_is_installed(monkeypatch: pytest.MonkeyPatch, installed: set[Name], icub: Name, katana: Name) -> None:
    monkeypatch.setattr(choice, "is_installed", lambda name: name in installed)
    for robot, expected in ((ICUB, icub), (KATANA, katana)):
        found = choose("auto", robot)
        assert found.name == expected
        assert ("mobee[sim]" in found.warning) == (expected == "kinematic")


def test_a_back_end_chosen_by_name_is_taken_or_refused() -> None:
    assert choose("kinematic", ICUB) == choice.Choice("kinematic")
    assert choose("mujoco", KATANA).name == "mujoco"
    with pytest.raises(BackendUnavailable, match="katana"):
        choose("pybullet", KATANA)
