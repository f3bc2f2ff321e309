# SPDX-License-Identifier: Apache-2.0
"""A cup and clutter on the table at random places, and what the robot sees of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import mobee
from mobee import Geometry, World, box, cylinder
from mobee.arrays import Array
from mobee.behaviours.pick import Upright

CUP = "cup"
TOP = -0.1  # m, of the table
RADIUS, HEIGHT = 0.028, 0.13  # m, of the cup: thumb and fingers of the iCub enclose it
MASS, FRICTION = 0.15, 0.8  # kg, and coefficient
CLUTTER_MASS, CLUTTER_FRICTION = 0.3, 0.6
NEAR, FAR = np.array([-0.42, -0.05]), np.array([-0.27, 0.2])  # m, of the cup's places
CORNER, END = np.array([-0.55, -0.2]), np.array([-0.2, 0.28])  # m, of the clutter's
APART = 0.12, 0.09  # m, of clutter from the cup, and from other clutter
MOST = 3  # pieces of clutter
SEEN = 0.002  # m, standard deviation of a seen place along each axis, of calibrated cameras (docs/vision.md)
INFLATED = 0.005  # m, by which things are enlarged when motions are planned
COLOR = (0.05, 0.3, 0.85)
FALLEN = np.deg2rad(25.0)  # a thing that leans more was knocked over
_COLORS = ((0.1, 0.6, 0.15), (0.85, 0.7, 0.1), (0.6, 0.6, 0.65))


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A piece of clutter that stands on the table.

    `place`: (2,) m, root frame, x and y of its centre.  `height`: m.  `seen`: whether the cameras see it.
    """

    shape: Geometry
    place: Array
    height: float
    seen: bool


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """A scene: the place of the cup, (2,) m in the root frame (x and y), and the pieces of clutter by name."""

    cup: Array
    clutter: Mapping[str, Piece]


def placement(rng: np.random.Generator) -> Placement:
    """Draw a cup and 0 to 3 pieces of clutter at random places; if there is clutter, the cameras do not see the first piece."""
    cup, count = rng.uniform(NEAR, FAR), int(rng.integers(MOST + 1))
    found: dict[str, Piece] = {}
    while len(found) < count:
        place, kind = rng.uniform(CORNER, END), int(rng.integers(2))
        width, height = rng.uniform(0.05, 0.07), rng.uniform(0.06, 0.1)
        others = [piece.place for piece in found.values()]
        if np.linalg.norm(place - cup) < APART[0] or any(np.linalg.norm(place - other) < APART[1] for other in others):
            continue
        shape = box(width, width, height) if kind else cylinder(0.5 * width, height)
        found[f"clutter {len(found)}"] = Piece(shape, place, height, seen=bool(found))
    return Placement(cup, found)


def true_world(scene: Placement) -> World:
    """Return the world of the physics: table, cup and all clutter; cup and clutter move when they are pushed."""
    world = table()
    world.add(CUP, cylinder(RADIUS, HEIGHT), position=standing(scene.cup, HEIGHT), role="target", color=COLOR, mass=MASS, friction=FRICTION)
    for number, (name, piece) in enumerate(scene.clutter.items()):
        at = standing(piece.place, piece.height)
        world.add(name, piece.shape, position=at, role="target", color=_COLORS[number], mass=CLUTTER_MASS, friction=CLUTTER_FRICTION)
    return world


def table() -> World:
    """Return a new world with only the table."""
    world = mobee.load_world("table")
    world.remove("ball")
    return world


def standing(place: Array, height: float) -> Array:
    """Return the position (3,) m of the centre of a thing that stands on the table; `place`: (2,) m, x and y; `height`: of the thing, m."""
    return np.array([*place, TOP + 0.5 * height])


class Eyes:
    """What the cameras see of a scene: the places of the cup and of the visible clutter, with random errors of 2 mm along x and y."""

    def __init__(self, scene: Placement, seed: int) -> None:
        self._rng, self._scene = np.random.default_rng([seed, 434]), scene

    def cup(self, place: Array) -> Upright:
        """Return the cup as the cameras see it, with a new random error, when its true place is `place` (2,) m."""
        return Upright(place + SEEN * self._rng.standard_normal(2), RADIUS, HEIGHT, TOP)

    def show(self, world: World, cup: Upright, margin: float) -> None:
        """Add the cup, and the clutter that the cameras see, to a world.

        Each of these objects is enlarged by `margin` [m] on all sides, and has the role "target": it repels all links except a hand that
        reaches for it.  `cup`: the cup as `Eyes.cup` returns it.  The places of the clutter get new random errors.
        """
        world.add(CUP, cylinder(RADIUS, HEIGHT).grown(margin), position=standing(cup.place, HEIGHT), role="target")
        for name, piece in self._scene.clutter.items():
            if piece.seen:
                at = piece.place + SEEN * self._rng.standard_normal(2)
                world.add(name, piece.shape.grown(margin), position=standing(at, piece.height), role="target")
