"""What edge checks are measured on: a map like the thesis' pre-grasp map, a palm above the table every few millimetres, k = 8."""

from __future__ import annotations

from collections import deque

import numpy as np

import mobee
from mobee.roadmap.neighbours import nearest
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.robot import Array

MARKER = "right_palm"
MOTORS = ("torso", "right_arm")
ABOVE = 0.05  # m, of the palm above the table
X, Y = (-0.74, -0.14), (-0.3, 0.75)  # m
START = (-0.32, 0.16)
NEIGHBOURS = 8


def scene() -> mobee.Model:
    """The iCub at its table, with nothing on it."""
    world = mobee.load_world("table")
    world.remove("ball")
    return mobee.Model(mobee.load_robot("icub"), world)


def palm_map(model: mobee.Model, spacing: float) -> Roadmap:
    """Postures with the palm down wherever it comes to above the table, from neighbour to neighbour, each joined to the nearest 8."""
    place = [np.arange(*X, spacing), np.arange(*Y, spacing)]
    first = tuple(int(np.abs(one - at).argmin()) for one, at in zip(place, START, strict=True))
    found = {first: _posture(model, place[0][first[0]], place[1][first[1]], None)}
    tried, waiting = {first}, deque([first])
    while waiting:
        i, j = waiting.popleft()
        for cell in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if cell in tried or not (0 <= cell[0] < len(place[0]) and 0 <= cell[1] < len(place[1])):
                continue
            tried.add(cell)
            q = _posture(model, place[0][cell[0]], place[1][cell[1]], found[i, j])
            if q is not None:
                found[cell] = q
                waiting.append(cell)
    q = np.array(list(found.values()))
    y = np.array([(place[0][i], place[1][j]) for i, j in found])
    return Roadmap(model, q, y, nearest(y, spacing, NEIGHBOURS), np.array([spacing, spacing]), {"names": ["x", "y"]})


def _posture(model: mobee.Model, x: float, y: float, start: Array | None) -> Array | None:
    table = model.world.objects["table"]
    height = float(table.position[2]) + 0.5 * table.size[2] + ABOVE
    wanted = [
        mobee.costs.position(MARKER, (x, y, height), tolerance=0.002),
        mobee.costs.orientation(MARKER, (0.0, 0.0, -1.0)),
        mobee.costs.collision(),
    ]
    ik = mobee.solve_ik(model, wanted, start, motors=MOTORS, method="least_squares")
    return ik.q if ik.reached else None
