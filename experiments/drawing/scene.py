"""What there is to be drawn of a robot and its world, in its colours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from experiments.drawing.solid import Color, Solid, ball, tube
from mobee.arrays import Array
from mobee.model.pose import Pose
from mobee.model.world_object import WorldObject
from services.monitor import palette

TRAIL, TIP = 0.005, 0.009  # m, radii
PIECE = 0.006  # m, the shortest piece of a trail
OLD, NEW = np.array([1.0, 0.90, 0.55]), np.array([0.96, 0.62, 0.0])  # colours of a trail
VEILED = 0.35
PALE = 0.72  # share of white in what does not matter
WORLD = 1000  # first group of world objects


def robot_solids(pose: Pose, bright: Iterable[str] | None = None) -> list[Solid]:
    """The solids of a robot in one pose, a group a link; parts other than `bright` are pale, none if it is None."""
    shapes, parts = pose.robot.shapes, list(pose.robot.parts)
    lively = set(parts if bright is None else bright)
    found = []
    for shape in shapes:
        if shape.role == "solid":
            link = pose.transforms[shape.link]
            color = _of_part(parts.index(shape.part) if shape.part in parts else 0, shape.part in lively)
            place, turn = link[:3, :3] @ shape.position + link[:3, 3], link[:3, :3] @ shape.rotation
            found.append(Solid(shape.kind, shape.size, place, turn, color, group=shape.link, vertices=shape.vertices))
    return found


def object_solids(objects: Mapping[str, WorldObject]) -> list[Solid]:
    """World objects, in the colours of their roles; ghosts are seen through."""
    found = []
    for number, thing in enumerate(objects.values()):
        red, green, blue, opacity = (channel / 255.0 for channel in palette.of_object(thing.kind, thing.role, thing.color))
        through = min(opacity, 0.35) if thing.role == "ghost" else opacity
        place, aside = (thing.position, thing.rotation), thing.role != "target"
        found.append(Solid(thing.kind, thing.size, *place, (red, green, blue), through, group=WORLD + number, aside=aside))
    return found


def trail_solids(points: Array, group: int = -2) -> list[Solid]:
    """The way of a marker through points (P, 3) m, fresher towards its end, which is a ball at the last point."""
    way = _thinned(points)
    shares = np.linspace(0.0, 1.0, max(len(way) - 1, 1))[:, None]
    colors = [(float(r), float(g), float(b)) for r, g, b in (1.0 - shares) * OLD + shares * NEW]
    return [*tube(way, TRAIL, colors[: len(way) - 1], VEILED, group), ball(way[-1], TIP, colors[-1], VEILED, group)]


def focus(solids: Sequence[Solid]) -> list[Solid]:
    """What a picture is about: all but world objects that are no targets, which may be cut off."""
    return [solid for solid in solids if not solid.aside]


def lowest(solids: Sequence[Solid]) -> float:
    """How low they reach, m: the height of the floor."""
    down = np.array([0.0, 0.0, -1.0])
    return min(float(solid.position[2]) - solid.reach(down) for solid in solids)


def _thinned(points: Array) -> Array:
    """The points without those nearer than a PIECE to the one before; the last one stays."""
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) >= PIECE:
            kept.append(point)
    if np.any(kept[-1] != points[-1]):
        kept.append(points[-1])
    return np.array(kept)


def _of_part(number: int, lively: bool) -> Color:
    share = 0.0 if lively else PALE
    red, green, blue = (share + (1.0 - share) * channel / 255.0 for channel in palette.SOLIDS[number % len(palette.SOLIDS)])
    return red, green, blue
