# SPDX-License-Identifier: Apache-2.0
"""The coloured volumes and meshes that are drawn for a robot's links.

A link is drawn as the visuals in the robot's file. If it has none that can be drawn, its solids are drawn: its volumes that have contacts.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from mobee.arrays import Array
from mobee.errors import MobeeError, Simplified
from mobee.model.pose import Pose
from mobee.rendering import palette
from mobee.rendering.mesh import Mesh, ellipsoid_piece, fair_most, mesh_of, read_pieces, simplified, smaller
from mobee.rendering.solid import Color, Solid
from mobee.robot.robot import Robot, per_robot
from mobee.robot.visual import Channels, MeshSource, Visual

BUDGET = 60_000  # triangles of a robot; large meshes are simplified until all have no more
MOST_NAMED = 3  # meshes that a warning lists
PALENESS = 0.72  # share of white in the colour of parts that do not matter


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
    """Return the solids that are drawn for a robot in one pose; the solids of a link form a group.

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
    """Return what a visual draws: a mesh of several colours in these, else in the colour of the robot's file, the mesh's, or the part's."""
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
