# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee.model import World, sphere
from mobee.robot.robot import Robot, Visual
from tests.mobee.check.arm import arm

rr = pytest.importorskip("rerun")
from mobee.rendering import palette  # noqa: E402  # only where Rerun is
from services.monitor.viewer.figure import Figure  # noqa: E402  # only where Rerun is


class Notebook:
    """A recording stream that stores the logged data with their times."""

    def __init__(self) -> None:
        self.stream = rr.RecordingStream("test")
        self.now = 0.0
        self.logged: dict[str, list[tuple[float, Any]]] = {}
        self.columns: list[str] = []
        self.stream.log = self._log
        self.stream.set_time = self._set_time
        self.stream.send_columns = lambda path, times, columns: self.columns.append(path)

    def _log(self, path: str | list[object], what: Any, static: bool = False) -> None:
        name = path if isinstance(path, str) else "/".join(map(str, path))
        self.logged.setdefault(name, []).append((self.now, what))

    def _set_time(self, timeline: str, *, duration: float) -> None:
        self.now = duration


def color(shape: Any) -> int:
    return int(shape.colors.as_arrow_array().to_pylist()[0])


def packed(red: int, green: int, blue: int, opacity: int) -> int:
    return red << 24 | green << 16 | blue << 8 | opacity


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return arm(tmp_path)


def test_a_solid_is_red_while_it_touches(robot: Robot) -> None:
    """The forearm turns with pan into a ball that lies behind a quarter turn."""
    world = World()
    world.add("ball", sphere(0.05), position=(0.0, -0.373, 0.1))
    notebook = Notebook()
    poses = np.array([robot.home, [np.pi / 2, robot.home[1]], robot.home])
    Figure(notebook.stream, robot, world).move(0.0, 1.0, poses)
    shown = [(when, color(shape)) for when, shape in notebook.logged["robot/bend/solids/fore"]]
    grey = packed(*palette.SOLIDS[0], 255)
    assert shown == [(0.0, grey), (1.0, packed(*palette.COLLIDING)), (2.0, grey)]
    events = [what.text.as_arrow_array().to_pylist()[0] for _, what in notebook.logged["events"]]
    assert "solid: fore meets ball" in events


def test_a_solid_hidden_by_visuals_is_shown_while_it_touches(robot: Robot) -> None:
    world = World()
    world.add("ball", sphere(0.05), position=(0.0, -0.373, 0.1))
    link = next(shape.link for shape in robot.shapes if shape.name == "fore")
    drawn = replace(robot, visuals=(Visual(link, "sphere", (0.04,), np.zeros(3), np.eye(3), (0.0, 0.0, 1.0, 1.0)),))
    notebook = Notebook()
    Figure(notebook.stream, drawn, world).move(0.0, 1.0, np.array([robot.home, [np.pi / 2, robot.home[1]], robot.home]))
    ((when, look),) = notebook.logged["robot/bend/visuals/volume_0"]
    assert (when, color(look)) == (0.0, packed(0, 0, 255, 255))
    (begin, solid), (end, gone) = notebook.logged["robot/bend/solids/fore"]
    assert (begin, color(solid), end, type(gone)) == (1.0, packed(*palette.TOUCHED), 2.0, rr.Clear)
    solids = Notebook()
    Figure(solids.stream, drawn, world, solids=True)
    assert "robot/bend/solids/fore" in solids.logged and "robot/bend/visuals/volume_0" not in solids.logged


def test_arrows_stand_where_it_touches_and_go(robot: Robot) -> None:
    world = World()
    world.add("ball", sphere(0.05), position=(0.0, -0.373, 0.1))
    notebook = Notebook()
    Figure(notebook.stream, robot, world).move(0.0, 1.0, np.array([[np.pi / 2, robot.home[1]], robot.home]))
    counts = [(when, len(arrows.vectors.as_arrow_array())) for when, arrows in notebook.logged["contacts"]]
    assert counts == [(0.0, 2), (1.0, 0)]  # a solid and its field


def test_every_link_moves_and_every_shape_is_drawn_once(robot: Robot) -> None:
    notebook = Notebook()
    Figure(notebook.stream, robot, None).move(0.0, 20.0, np.tile(robot.home, (3, 1)))
    assert set(notebook.columns) == {*(f"/robot/{link}" for link in robot.links), "/plots/contacts", "/plots/motors"}
    drawn = {path: len(times) for path, times in notebook.logged.items() if "/solids/" in path or "/fields/" in path}
    assert drawn == {f"robot/{robot.links[shape.link]}/{shape.role}s/{shape.name}": 1 for shape in robot.shapes}
    assert "robot/bend/markers" in notebook.logged
