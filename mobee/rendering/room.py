# SPDX-License-Identifier: Apache-2.0
"""A room around the robot and flat clutter on its table: backgrounds in which objects cannot be found by colour alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mobee.arrays import Array
from mobee.model.world_object import WorldObject
from mobee.rendering.mesh import Piece, mesh_of
from mobee.rendering.solid import Color, Solid, SolidKind

_STREAM = 0x726F6F6D  # of random numbers
FAR, HALF, FLOOR, CEILING = 2.2, 2.5, -0.95, 1.6  # m: the wall ahead, the walls aside, and the heights of floor and ceiling
BEFORE, SHEET = 0.01, 0.001  # m, of pictures before their wall, and the thickness of paper
PICTURES, THINGS, SHEETS = 14, 16, 22  # on each wall; before the walls; on a table
RED: Color = (0.78, 0.10, 0.10)
EDGE = 0.03  # m, at the edge of a table that stays free


def room(seed: int, colors: Sequence[Color] = (RED,)) -> list[Solid]:
    """Return the solids of a room: a floor, three walls with pictures on them, and things near the walls, out of the robot's reach.

    `colors`: colours (red, green, blue, 0 to 1) of the objects that vision has to find. On average, a quarter of the pictures and things
    have one of them; a sphere never has one. `seed`: seed of the random choices.
    """
    rng = np.random.default_rng([seed, _STREAM])
    low, high = FLOOR, CEILING
    solids = [
        _wall((-FAR, -HALF, low), (0.0, 2.0 * HALF, 0.0), (0.0, 0.0, high - low), (0.62, 0.64, 0.60)),
        _wall((-FAR, -HALF, low), (2.0 * FAR, 0.0, 0.0), (0.0, 0.0, high - low), (0.55, 0.58, 0.64)),
        _wall((-FAR, HALF, low), (2.0 * FAR, 0.0, 0.0), (0.0, 0.0, high - low), (0.66, 0.61, 0.55)),
        _wall((-FAR, -HALF, low), (2.0 * FAR, 0.0, 0.0), (0.0, 2.0 * HALF, 0.0), (0.42, 0.38, 0.34)),
    ]
    for _ in range(PICTURES):
        wide, tall = rng.uniform(0.15, 0.6, 2)
        z = rng.uniform(FLOOR + 0.4, CEILING - 0.4)
        ahead, aside = rng.uniform(-HALF + 0.4, HALF - 0.4), rng.uniform(-FAR + 0.4, 0.5)
        solids.append(_wall((-FAR + BEFORE, ahead, z), (0.0, wide, 0.0), (0.0, 0.0, tall), _color(rng, colors)))
        side = float(rng.choice((-1.0, 1.0))) * (HALF - BEFORE)
        solids.append(_wall((aside, side, z), (wide, 0.0, 0.0), (0.0, 0.0, tall), _color(rng, colors)))
    for _ in range(THINGS):
        at = np.array([rng.uniform(-FAR + 0.3, -1.2), rng.uniform(-1.6, 1.6), rng.uniform(FLOOR + 0.3, 0.6)])
        solids.append(_thing(rng, at, rng.uniform(0.03, 0.15), colors))
    return solids


def clutter(objects: Iterable[WorldObject], seed: int, colors: Sequence[Color] = (RED,)) -> list[Solid]:
    """Return sheets and discs of paper, 1 mm thick, that lie on the obstacles of kind "box" among the world's `objects`.

    They are only drawn and have no contacts. `colors`: colours (red, green, blue, 0 to 1) of the objects that vision has to find. On
    average, a quarter of the sheets and discs have one of them. `seed`: seed of the random choices.
    """
    rng = np.random.default_rng([seed, _STREAM, 1])
    solids = []
    for item in objects:
        if item.kind != "box" or item.role != "obstacle":
            continue
        half = 0.5 * np.array(item.size)
        for number in range(SHEETS):
            wide, long = rng.uniform(0.02, 0.12, 2)
            aside = rng.uniform(-1.0, 1.0, 2) * np.maximum(half[:2] - 0.5 * np.hypot(wide, long) - EDGE, 0.0)
            at = item.position + item.rotation @ np.array([*aside, half[2] + (number + 1) * 0.1 * SHEET])
            if rng.uniform() < 0.4:
                solids.append(Solid("cylinder", (0.5 * wide, SHEET), at, item.rotation, _color(rng, colors)))
            else:
                solids.append(_block(at, (wide, long, SHEET), _color(rng, colors), item.rotation @ _turned(rng)))
    return solids


def _thing(rng: np.random.Generator, at: Array, size: float, colors: Sequence[Color]) -> Solid:
    kinds: tuple[tuple[SolidKind, tuple[float, ...]], ...] = (
        ("sphere", (0.5 * size,)),
        ("cylinder", (0.4 * size, size)),
        ("box", (size, 0.7 * size, 1.3 * size)),
        ("capsule", (0.3 * size, size)),
    )
    kind, numbers = kinds[int(rng.integers(len(kinds)))]
    color = _color(rng, colors)
    if kind == "sphere" and color in colors:  # a red sphere is a ball, wherever it is
        color = (0.15, 0.35, 0.62)
    return Solid(kind, numbers, at, _turned(rng), color)


def _wall(corner: tuple[float, float, float], one: tuple[float, float, float], other: tuple[float, float, float], color: Color) -> Solid:
    """Return a parallelogram at a corner (3,) m with two edges (3,) m."""
    a, u, v = np.array(corner), np.array(one), np.array(other)
    mesh = mesh_of(Piece(np.array([a, a + u, a + u + v, a + v]), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.intp)))
    return Solid("mesh", (), np.zeros(3), np.eye(3), color, mesh=mesh)


def _block(at: Array | tuple[float, float, float], size: tuple[float, float, float], color: Color, turned: Array | None = None) -> Solid:
    return Solid("box", size, np.array(at), np.eye(3) if turned is None else turned, color)


def _color(rng: np.random.Generator, colors: Sequence[Color]) -> Color:
    if rng.uniform() < 0.25:
        return colors[0] if len(colors) == 1 else colors[int(rng.integers(len(colors)))]
    red, green, blue = (float(one) for one in rng.uniform(0.1, 0.9, 3))
    return red, green, blue


def _turned(rng: np.random.Generator) -> Array:
    """Return a rotation (3, 3) about the vertical by a random angle."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
