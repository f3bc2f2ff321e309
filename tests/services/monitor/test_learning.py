# SPDX-License-Identifier: Apache-2.0
"""The monitor's view of an agent's transition model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import VERSION
from bus_schema.messages import Learned, Surprise, Transition
from mobee import Lattice, TransitionModel, load_robot
from mobee.learning.lattice import plane_layout
from services.agents.streams import surprises
from tests.services.robots import ARM as OWN

rr = pytest.importorskip("rerun")
from services.monitor.viewer.learning import MAX_DRAWN, Learning  # noqa: E402  # only where Rerun is
from services.monitor.viewer.scene import Poses  # noqa: E402  # only where Rerun is

ROBOT = load_robot("icub")
ARM = ["l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow"]
SPACE = Lattice(ROBOT, ARM, neighbours="equidistant")


class Notebook:
    """A recording stream that stores the newest logged data of each path."""

    def __init__(self) -> None:
        self.logged: dict[str, Any] = {}

    def log(self, path: str, *what: Any, static: bool = False) -> None:
        self.logged[path] = what[-1]


HEADER = {"v": VERSION, "run": "r", "src": "agent_left_arm", "seq": 0, "k": 0, "t": 0, "tw": 0}
STEP = Transition(
    **HEADER,
    agent="left_arm",
    n=1,
    s=0,
    a=0,
    goal=1,
    s_next=1,
    reward=0.1,
    value=0.1,
    probability=0.5,
    settled=True,
    duration=1.0,
    touched=[],
)


def learned(model: TransitionModel, **changes: Any) -> Learned:
    numbers = {"tries": model.tries.astype("<u4").tobytes(), "reward": model.reward.astype("<f4").tobytes()}
    fields = {"agent": "left_arm", "n": 3, "s": 0, "space": json.dumps(SPACE.settings), "value": numbers["reward"]}
    return Learned(**(HEADER | numbers | fields | {"surprises": surprises(model)} | changes))


def test_surprises_are_the_outcomes_that_are_no_goals_with_their_shares() -> None:
    model = TransitionModel(SPACE)
    goal = SPACE.goal(15, 2)
    for outcome in (goal, 3, 3, 15):
        model.observe(15, 2, outcome)
    model.observe(0, 0, SPACE.goal(0, 0))
    assert surprises(model) == [Surprise(15, 2, 15, 0.25), Surprise(15, 2, 3, 0.5)]


def test_the_knowledge_of_an_agent_of_another_robot_is_shown_too(tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text(OWN)
    robot = load_robot(tmp_path / "own.xml")
    space = Lattice(robot, ["pan", "bend"], neighbours=4)
    model, notebook = TransitionModel(space), Notebook()
    model.observe(0, 0, space.goal(0, 0))
    Learning(notebook, robot).log("arm", learned(model, agent="arm", space=json.dumps(space.settings)))
    assert set(notebook.logged) >= {"learning/arm/tries", "learning/arm/reward", "learning/arm/value"}


def test_what_surprised_is_an_arrow_and_what_worked_another() -> None:
    model, notebook = TransitionModel(SPACE), Notebook()
    model.observe(15, 2, 3)
    model.observe(0, 0, SPACE.goal(0, 0))
    Learning(notebook, ROBOT).log("left_arm", learned(model))
    assert len(notebook.logged["learning/left_arm/space/surprising"].vectors) == 1
    assert len(notebook.logged["learning/left_arm/space/sound"].vectors) == 1
    assert len(notebook.logged["learning/left_arm/space/states"].positions) == 81
    bars = notebook.logged["learning/left_arm/tries"].values.as_arrow_array().to_pylist()[0]["buffer"]
    assert len(bars) == SPACE.state_actions


@pytest.mark.parametrize("wrong", [{"space": "{}"}, {"space": "no json"}, {"tries": b"12345"}, {"surprises": [Surprise(500, 0, 1, 1.0)]}])
def test_what_does_not_fit_is_not_drawn_and_does_no_harm(wrong: dict[str, Any]) -> None:
    notebook = Notebook()
    Learning(notebook, ROBOT).log("left_arm", learned(TransitionModel(SPACE), **wrong))
    arrows = notebook.logged.get("learning/left_arm/space/surprising")
    assert arrows is None or len(arrows.vectors) == 0


def test_a_space_that_is_too_large_is_not_drawn_and_said_so_once() -> None:
    notebook = Notebook()
    learning = Learning(notebook, ROBOT)
    huge = learned(TransitionModel(SPACE), tries=bytes(4 * (MAX_DRAWN + 1)))
    learning.log("left_arm", huge)
    assert list(notebook.logged) == ["events"] and notebook.logged.pop("events").text
    learning.log("left_arm", huge)
    learning.log_step("left_arm", STEP)
    assert not notebook.logged


def test_of_too_many_surprises_the_likeliest_are_published(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.agents.streams.MAX_SURPRISES", 2)
    model = TransitionModel(SPACE)
    for s, shares in ((3, 1), (15, 2), (20, 3)):
        for outcome in [s] * shares + [SPACE.goal(s, 0)]:
            model.observe(s, 0, outcome)
    assert surprises(model) == [Surprise(15, 0, 15, pytest.approx(2 / 3)), Surprise(20, 0, 20, 0.75)]


def test_poses_add_up() -> None:
    notebook = Notebook()
    poses = Poses(notebook, ROBOT)
    poses.note(ROBOT.home)
    poses.note(ROBOT.home + 0.1)
    assert len(notebook.logged["scene/poses"].strips) == 4  # two arms, twice


def test_no_two_states_are_drawn_at_one_place() -> None:
    for space in (
        SPACE,
        Lattice(ROBOT, ARM, levels=(0.2, 0.4, 0.6, 0.8)),
        Lattice(ROBOT, ["torso_yaw", "torso_roll", "torso_pitch"], neighbours=8),
    ):
        distances = np.linalg.norm(plane_layout(space)[:, None] - plane_layout(space), axis=-1)
        assert distances[~np.eye(len(space), dtype=bool)].min() > 0.99
