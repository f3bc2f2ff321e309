# SPDX-License-Identifier: Apache-2.0
"""An agent whose state holds where a cup is, with all services in lockstep: its transitions are those of the offline plant."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from experiments.kit.live.launch import summary_of
from mobee import Gains, Model, OfflinePlant, cylinder, load_robot, load_world
from tests.system.onlooker.script import ACTIONS, PLACES, perform

pytestmark = pytest.mark.system

WORLD = """<World version="2.0" name="cup">
 <box name="table" width="0.6" height="1.5" depth="0.5" px="-0.44" pz="-0.35"/>
 <cylinder name="cup" radius="0.035" height="0.09" px="{}" py="{}" pz="{}" hz="1" role="ghost"/>
</World>"""
SCENARIO = """title = "An arm beside a cup"

[shared]
robot = "icub"
world = "{}"
gains = "default"
seed = 3
mode = "lock"
patience = 20

[services.robot_sim]
backend = "kinematic"
rate = 50

[services.model]
[services.controller]
[services.onlooker]
module = "tests.system.onlooker"
"""


@pytest.mark.untimed
def test_the_state_of_an_agent_follows_a_cup_in_the_world_of_the_model(tmp_path: Path) -> None:
    (tmp_path / "cup.xml").write_text(WORLD.format(*PLACES[0]))
    scenario = tmp_path / "cup.toml"
    scenario.write_text(SCENARIO.format(tmp_path / "cup.xml"))
    summary = summary_of(str(scenario), [], ticks=1500, runs=tmp_path / "runs")
    live = json.loads((Path(summary["run"]) / "transitions.json").read_text())
    assert [cell for *_, cell in live] == [0] * (ACTIONS // 2) + [1] * (ACTIONS // 2)
    robot, world = load_robot("icub"), load_world("table")
    world.remove("ball")
    world.add("cup", cylinder(0.035, 0.09), position=PLACES[0], role="ghost")
    plant = OfflinePlant(Model(robot, world), seed=3, gains=Gains.default(), dt=0.02)
    offline = perform(plant, lambda: {"cup": world.objects["cup"].position}, lambda place: world.move("cup", position=place))
    assert live == offline
