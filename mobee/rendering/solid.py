# SPDX-License-Identifier: Apache-2.0
"""Coloured volumes and meshes that a picture shows, and functions that make them from a robot's links, a world or a path.

A link is drawn as the visuals in the robot's file. If it has none that can be drawn, its solids are drawn: its volumes that have contacts.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee._core.rays import CONVEX, KINDS, SURFACE
from mobee.arrays import Array
from mobee.errors import MobeeError, Simplified
from mobee.model.pose import Pose
from mobee.model.world_object import WorldObject
from mobee.rendering import palette
from mobee.rendering.mesh import Mesh, ellipsoid_piece, fair_most, mesh_of, read_pieces, simplified, smaller
from mobee.robot.robot import Channels, MeshSource, Robot, ShapeKind, Visual, per_robot
from mobee.robot.urdf.hull import facets

Color = tuple[float, float, float]  # red, green, blue in 0..1
SolidKind = ShapeKind | Literal["mesh"]

TRAIL_RADIUS, TIP_RADIUS = 0.005, 0.009  # m
SHORTEST_PIECE = 0.006  # m, of a trail
OLD, NEW = np.array([1.0, 0.90, 0.55]), np.array([0.96, 0.62, 0.0])  # colours of a trail
TRAIL_VEIL = 0.35
GHOST_OPACITY = 0.35
TRAIL_GROUP, FIRST_OBJECT_GROUP = -2, 1000

BUDGET = 60_000  # triangles of a robot; large meshes are simplified until all have no more
MOST_NAMED = 3  # meshes that a warning lists
PALENESS = 0.72  # share of white in the colour of parts that do not matter


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A coloured convex volume or mesh of a picture.

    Attributes:
        kind: "sphere", "box", "cylinder", "capsule", "convex" or "mesh".
        size: m, depends on the kind: sphere (radius,); cylinder (radius, height) and capsule (radius, height without the caps), both along
            the solid's z axis; box (x, y, z), full edges; convex and mesh ().
        position: (3,) m, root frame.
        rotation: (3, 3), root frame.
        color: red, green, blue, 0 to 1.
        opacity: below 1 the volume is transparent.
        veiled: share of its colour, 0 to 1, that remains visible where opaque volumes are in front of it; 0: it is hidden there.
        group: there is no outline between solids of the same group.
        vertices: (V, 3) m, corners for "convex", in the solid's frame (`position`, `rotation`).
        aside: whether it may lie outside of the picture's frame.
        mesh: the triangles, for "mesh".
    """

    kind: SolidKind
    size: tuple[float, ...]
    position: Array
    rotation: Array
    color: Color
    opacity: float = 1.0
    veiled: float = 0.0
    group: int = 0
    vertices: Array | None = None
    aside: bool = False
    mesh: Mesh | None = None

    def extent(self, along: Array) -> float:
        """Return the distance [m] from the solid's position to its farthest point along a unit vector (3,), root frame."""
        x, y, z = along @ self.rotation
        if self.kind == "sphere":
            return self.size[0]
        if self.kind == "box":
            return 0.5 * float(np.abs(np.array([x, y, z])) @ np.array(self.size))
        if self.kind == "mesh":
            assert self.mesh is not None
            return float((self.mesh.corners @ np.array([x, y, z])).max())
        if self.kind == "convex":
            assert self.vertices is not None
            return float((self.vertices @ np.array([x, y, z])).max())
        radius, height = self.size
        return radius * (1.0 if self.kind == "capsule" else float(np.hypot(x, y))) + 0.5 * height * abs(float(z))


def ball(position: Array, radius: float, color: Color, veiled: float = 0.0, group: int = 0) -> Solid:
    """Return a sphere at a position (3,) m, root frame, with a radius [m].

    `color`: red, green, blue, 0 to 1. `veiled`: share of its colour, 0 to 1, that remains visible where opaque volumes are in front of
    it; 0: it is hidden there. `group`: solids of the same group have no outline between them.
    """
    return Solid("sphere", (radius,), position, np.eye(3), color, veiled=veiled, group=group)


def tube(points: Array, radius: float, colors: Sequence[Color], veiled: float = 0.0, group: int = 0) -> list[Solid]:
    """Return a tube of capsules along the line through points (P, 3) m, root frame, with a radius [m].

    `colors`: colours of the P - 1 pieces. `veiled`: share of the colour, 0 to 1, that remains visible where opaque volumes are in front of
    the tube; 0: it is hidden there. `group`: solids of the same group have no outline between them.
    """
    pieces = []
    for start, end, color in zip(points[:-1], points[1:], colors, strict=True):
        length = float(np.linalg.norm(end - start))
        rotation = _rotation_with_z((end - start) / length) if length > 0.0 else np.eye(3)
        pieces.append(Solid("capsule", (radius, length), 0.5 * (start + end), rotation, color, veiled=veiled, group=group))
    return pieces


def object_solids(objects: Mapping[str, WorldObject]) -> list[Solid]:
    """Return world objects, given by name, as solids in their own colours or those of their roles.

    Objects with the role "ghost" (without contacts, only drawn) are transparent.
    """
    found = []
    for number, item in enumerate(objects.values()):
        red, green, blue, given = (channel / 255.0 for channel in palette.of_object(item.kind, item.role, item.color))
        opacity = min(given, GHOST_OPACITY) if item.role == "ghost" else given
        frame, aside = (item.position, item.rotation), item.role != "target"
        group = FIRST_OBJECT_GROUP + number
        found.append(Solid(item.kind, item.size, *frame, (red, green, blue), opacity, group=group, aside=aside))
    return found


def trail_solids(points: Array, group: int = TRAIL_GROUP) -> list[Solid]:
    """Return the path of a marker as solids: a line that is brighter towards its end, and a ball at the end.

    `points`: (P, 3) m, root frame, positions of the marker. `group`: number that the solids get as `Solid.group`.
    """
    path = _thinned(points)
    shares = np.linspace(0.0, 1.0, max(len(path) - 1, 1))[:, None]
    colors = [(float(r), float(g), float(b)) for r, g, b in (1.0 - shares) * OLD + shares * NEW]
    line = tube(path, TRAIL_RADIUS, colors[: len(path) - 1], TRAIL_VEIL, group)
    return [*line, ball(path[-1], TIP_RADIUS, colors[-1], TRAIL_VEIL, group)]


def focus(solids: Sequence[Solid]) -> list[Solid]:
    """Return the solids that must lie inside a picture's frame: all solids except those of world objects that are not targets."""
    return [solid for solid in solids if not solid.aside]


def lowest(solids: Sequence[Solid]) -> float:
    """Return the height [m] of the lowest point of the solids, at which the floor is drawn."""
    down = np.array([0.0, 0.0, -1.0])
    return min(float(solid.position[2]) - solid.extent(down) for solid in solids)


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """Solids in the form that the compiled core reads.

    `volumes`: (N,) structured array (dtype CONVEX) of the volumes. `surfaces`: (M,) structured array (dtype SURFACE) of the meshes.
    `numbers`: for each of these N + M volumes and meshes, volumes first, its index in the list of solids that was packed. `kept`: arrays
    to which pointers in `volumes` refer; keep them as long as `volumes` is used. Pointers in `surfaces` refer to arrays of the solids'
    meshes.
    """

    volumes: NDArray[np.void]
    surfaces: NDArray[np.void]
    numbers: list[int]
    kept: list[Array]


def packed(solids: Sequence[Solid]) -> Packed:
    """Convert solids to the form that the compiled core reads."""
    convex = [number for number, solid in enumerate(solids) if solid.mesh is None]
    others = [number for number, solid in enumerate(solids) if solid.mesh is not None]
    volumes, kept = _packed_volumes([solids[number] for number in convex])
    surfaces = np.zeros(len(others), SURFACE)
    for place, (row, number) in enumerate(zip(surfaces, others, strict=True), start=len(convex)):
        solid = solids[number]
        assert solid.mesh is not None
        row["center"], row["rotation"], row["number"] = solid.position, solid.rotation, place
        row["middle"], row["bound"] = solid.mesh.middle, solid.mesh.radius
        row["corners"], row["normals"] = solid.mesh.corners.ctypes.data, solid.mesh.normals.ctypes.data
        row["triangles"], row["count"] = solid.mesh.triangles.ctypes.data, len(solid.mesh.triangles)
    return Packed(volumes, surfaces, convex + others, kept)


def _packed_volumes(solids: Sequence[Solid]) -> tuple[NDArray[np.void], list[Array]]:
    table, kept = np.zeros(len(solids), CONVEX), []
    for row, solid in zip(table, solids, strict=True):
        row["center"], row["rotation"], row["kind"] = solid.position, solid.rotation, KINDS.index(solid.kind)
        if solid.kind == "convex":
            assert solid.vertices is not None
            planes = _planes(solid.vertices.tobytes())
            kept.append(planes)
            row["planes"], row["count"] = planes.ctypes.data, len(planes)
            row["bound"] = np.linalg.norm(solid.vertices, axis=1).max()
        elif solid.kind == "box":
            row["half"] = 0.5 * np.array(solid.size)
            row["bound"] = np.linalg.norm(row["half"])
        else:
            radius, half_height = solid.size[0], 0.5 * solid.size[1] if len(solid.size) > 1 else 0.0
            row["half"] = radius, half_height, 0.0
            row["bound"] = np.hypot(radius, half_height) if solid.kind == "cylinder" else radius + half_height
    return table, kept


@lru_cache(maxsize=256)
def _planes(vertices: bytes) -> Array:
    """Return the outward unit normals and offsets (F, 4) of a hull's faces; `vertices`: the bytes of its vertices (V, 3)."""
    corners = facets(np.frombuffer(vertices).reshape(-1, 3))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([normals, (normals * corners[:, 0]).sum(axis=1)])


def _rotation_with_z(z: Array) -> Array:
    """Return a rotation (3, 3) whose z axis is this unit vector (3,)."""
    other = np.zeros(3)
    other[np.abs(z).argmin()] = 1.0
    x = np.cross(other, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _thinned(points: Array) -> Array:
    """Return the points of a line without points closer than SHORTEST_PIECE to the kept point before; the last point is kept."""
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) >= SHORTEST_PIECE:
            kept.append(point)
    if np.any(kept[-1] != points[-1]):
        kept.append(points[-1])
    return np.array(kept)


@dataclass(frozen=True, slots=True, eq=False)
class LinkSolid:
    """A coloured volume or mesh that is drawn on a link.

    `link`: index of the link. `part`: name of the part that moves it. `solid`: in the root frame at the zero pose. `collides`: whether it
    is one of the robot's solids, which have contacts; otherwise it is only drawn.
    """

    link: int
    part: str
    solid: Solid
    collides: bool

    def at(self, transforms: Array, white: float = 0.0) -> Solid:
        """Return the solid in the root frame, moved with its link to the robot's present pose.

        `transforms`: (L, 4, 4), transforms of all links from the zero pose to the present pose, as `Pose.transforms`. `white`: share of
        white that is mixed into its colour, 0 to 1.
        """
        link = transforms[self.link]
        red, green, blue = (white + (1.0 - white) * channel for channel in self.solid.color)
        position, rotation = link[:3, :3] @ self.solid.position + link[:3, 3], link[:3, :3] @ self.solid.rotation
        return replace(self.solid, position=position, rotation=rotation, color=(red, green, blue))


@per_robot
def link_solids(robot: Robot) -> tuple[LinkSolid, ...]:
    """Return all volumes and meshes that are drawn for a robot; large meshes are simplified.

    The visuals of a link are drawn; if a link has none, or if their meshes cannot be read, its solids are drawn. A warning in one line
    lists meshes that cannot be read.
    """
    meshes = _meshes(robot)
    parts = _parts_of_links(robot)
    found = []
    for visual in robot.visuals:
        found += _drawn(visual, parts[visual.link], robot, meshes)
    drawn = {one.link for one in found}
    for shape in robot.shapes:
        if shape.role == "solid" and shape.link not in drawn:
            color = _color_of_part(robot, shape.part)
            solid = Solid(shape.kind, shape.size, shape.position, shape.rotation, color, group=shape.link, vertices=shape.vertices)
            found.append(LinkSolid(shape.link, shape.part, solid, True))
    return tuple(found)


def coarser(solids: Sequence[LinkSolid], budget: int) -> list[LinkSolid]:
    """Return the solids with simplified meshes that together have at most about `budget` triangles.

    Viewers without a graphics card need fewer triangles.
    """
    meshes = {id(one.solid.mesh): one.solid.mesh for one in solids if one.solid.mesh is not None}
    counts = [len(one.solid.mesh.triangles) for one in solids if one.solid.mesh is not None]
    most = fair_most(counts, budget)
    made = {key: simplified(mesh, most) for key, mesh in meshes.items()}
    return [replace(one, solid=replace(one.solid, mesh=made.get(id(one.solid.mesh)))) for one in solids]


def robot_solids(pose: Pose, bright: Iterable[str] | None = None) -> list[Solid]:
    """Return the solids that are drawn for a robot in one pose; the solids of one link have the same `group` (see `Solid`).

    `bright`: names of the parts in full colour, all others are pale; None: all parts are in full colour.
    """
    vivid = set(pose.robot.parts if bright is None else bright)
    return [one.at(pose.transforms, 0.0 if one.part in vivid else PALENESS) for one in link_solids(pose.robot)]


def _meshes(robot: Robot) -> dict[MeshSource, tuple[Mesh, ...]]:
    """Return the meshes that can be read, within the budget, each file read once."""
    pieces, faults = {}, {}
    for source in dict.fromkeys(visual.mesh for visual in robot.visuals if visual.mesh is not None):
        try:
            pieces[source] = read_pieces(source)
        except MobeeError as error:
            faults[source] = str(error)
    if faults:
        first, why = next(iter(faults.items()))
        names = list(dict.fromkeys(source.name or source.file for source in faults))
        listed = ", ".join(names[:MOST_NAMED]) + (f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else "")
        text = f"{first.robot_file}:{first.line}: cannot draw {listed}: {why}. Solids are drawn instead, where nothing else is"
        warnings.warn(text, Simplified, stacklevel=5)
    counts = [len(piece.triangles) for visual in robot.visuals if visual.mesh in pieces for piece in pieces[visual.mesh]]
    most = fair_most(counts, BUDGET)
    return {source: tuple(mesh_of(smaller(piece, most)) for piece in some) for source, some in pieces.items()}


def _drawn(visual: Visual, part: str, robot: Robot, meshes: Mapping[MeshSource, tuple[Mesh, ...]]) -> list[LinkSolid]:
    """Return the solids that draw a visual; none for a mesh that is not in `meshes`.

    A mesh of several colours keeps them. Otherwise, the first known colour is used: that of the visual in the robot's file, that of the
    mesh, that of the part.
    """
    otherwise = _color_of_part(robot, part)
    if visual.mesh is not None:
        shown = meshes.get(visual.mesh, ())
        several = len({mesh.color for mesh in shown}) > 1
        colors = [mesh.color if several else visual.color or mesh.color for mesh in shown]
        solids = [_mesh_solid(visual, mesh, color, otherwise) for mesh, color in zip(shown, colors, strict=True)]
        return [LinkSolid(visual.link, part, solid, False) for solid in solids]
    if visual.kind == "ellipsoid":
        return [LinkSolid(visual.link, part, _mesh_solid(visual, mesh_of(ellipsoid_piece(visual.size)), visual.color, otherwise), False)]
    assert visual.kind != "mesh"
    color, opacity = _channels(visual.color, otherwise)
    solid = Solid(visual.kind, visual.size, visual.position, visual.rotation, color, opacity, group=visual.link)
    return [LinkSolid(visual.link, part, solid, False)]


def _mesh_solid(visual: Visual, mesh: Mesh, given: Channels | None, otherwise: Color) -> Solid:
    color, opacity = _channels(given, otherwise)
    return Solid("mesh", (), visual.position, visual.rotation, color, opacity, group=visual.link, mesh=mesh)


def _channels(given: Channels | None, otherwise: Color) -> tuple[Color, float]:
    return (otherwise, 1.0) if given is None else (given[:3], given[3] if given[3] > 0.0 else 1.0)


def _color_of_part(robot: Robot, part: str) -> Color:
    names = list(robot.parts)
    number = names.index(part) if part in names else 0
    red, green, blue = (channel / 255.0 for channel in palette.SOLIDS[number % len(palette.SOLIDS)])
    return red, green, blue


def _parts_of_links(robot: Robot) -> list[str]:
    """Return the part that moves each link; the base belongs to the first part."""
    driven = {joint: motor.part for motor in robot.motor_table for joint, _, _ in motor.joints}
    owner = [next(iter(robot.parts), "")]
    for index, joint in enumerate(robot.joints):
        owner.append(driven.get(index, owner[joint.parent]))
    return owner
