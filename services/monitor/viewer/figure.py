# SPDX-License-Identifier: Apache-2.0
"""Draws a robot in Rerun: its visuals and shapes are logged once, then one transform per link and pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr

from mobee.arrays import Array
from mobee.model.contact import Contact
from mobee.model.kinematics import link_transforms, quaternion_from_matrix
from mobee.model.model import Model
from mobee.model.world import World
from mobee.rendering import palette
from mobee.rendering.palette import Rgba
from mobee.rendering.solid import LinkSolid, Solid, link_solids
from mobee.robot.robot import Robot, Shape, ShapeKind
from mobee.robot.urdf.hull import facets
from services.monitor.web.surfaces import flat


def drawn(
    kind: ShapeKind, size: tuple[float, ...], position: Array, rotation: Array, color: Rgba, vertices: Array | None = None
) -> rr.AsComponents:
    """Return a shape as a Rerun component, filled with a colour.

    `size` [m]: (radius,) of a sphere, (radius, length) of a cylinder or of a capsule without its caps, three edge lengths of a box.
    `position` (3,) m, of the centre, and `rotation` (3, 3): in the frame of the Rerun entity. `color`: red, green, blue, opacity, 0 to 255.
    `vertices`: (v, 3) m in the frame of the shape, for kind "convex" only.
    """
    if kind == "convex":
        return _mesh(position + (np.empty((0, 3)) if vertices is None else vertices) @ rotation.T, color)
    return drawn_together(kind, [size], position[None], rotation[None], [color])


def drawn_together(
    kind: ShapeKind, sizes: Sequence[tuple[float, ...]], positions: Array, rotations: Array, colors: Sequence[Rgba]
) -> rr.AsComponents:
    """Return shapes of one kind, which is not "convex", as one Rerun component.

    The sizes, the positions (k, 3) m of the centres, the rotations (k, 3, 3) and the colours of the k shapes are as in `drawn`.
    """
    turns = [rr.Quaternion(xyzw=wxyz[[1, 2, 3, 0]]) for wxyz in quaternion_from_matrix(rotations)]
    fill, first = rr.components.FillMode.Solid, [size[0] for size in sizes]
    if kind == "box":
        return rr.Boxes3D(sizes=sizes, centers=positions, quaternions=turns, colors=colors, fill_mode=fill)
    if kind == "sphere":
        return rr.Ellipsoids3D(radii=first, centers=positions, quaternions=turns, colors=colors, fill_mode=fill)
    lengths = [size[1] for size in sizes]
    if kind == "capsule":  # drawn from one end
        starts = positions - rotations[:, :, 2] * np.array(lengths)[:, None] / 2.0
        return rr.Capsules3D(radii=first, lengths=lengths, translations=starts, quaternions=turns, colors=colors, fill_mode=fill)
    return rr.Cylinders3D(radii=first, lengths=lengths, centers=positions, quaternions=turns, colors=colors, fill_mode=fill)


def recolored(kind: ShapeKind, color: Rgba) -> rr.AsComponents:
    """Return the Rerun components that change the colour of an already logged shape of this kind.

    `color`: red, green, blue, opacity, 0 to 255.
    """
    if kind == "convex":
        return rr.Mesh3D.from_fields(albedo_factor=color)
    if kind == "box":
        return rr.Boxes3D.from_fields(colors=[color])
    if kind == "sphere":
        return rr.Ellipsoids3D.from_fields(colors=[color])
    if kind == "capsule":
        return rr.Capsules3D.from_fields(colors=[color])
    return rr.Cylinders3D.from_fields(colors=[color])


def _mesh(points: Array, color: Rgba) -> rr.Mesh3D:
    """Return the hull of points (v, 3) as a mesh with flat faces."""
    corners, normals, triangles = flat(facets(points))
    return rr.Mesh3D(vertex_positions=corners, triangle_indices=triangles, vertex_normals=normals, albedo_factor=color)


def drawn_link(solids: Sequence[LinkSolid]) -> Iterator[tuple[str, rr.AsComponents]]:
    """Yield (name, components) of each Rerun entity that draws one link.

    `solids`: the link's volumes and meshes. The entities are in the root frame, with every joint at zero. All opaque meshes together are
    one entity.
    """
    opaque = [one.solid for one in solids if one.solid.mesh is not None and one.solid.opacity >= 1.0]
    if opaque:
        yield "mesh", _joined(opaque)
    for number, one in enumerate(solids):
        solid = one.solid
        red, green, blue, opacity = (round(255.0 * channel) for channel in (*solid.color, solid.opacity))
        color = (red, green, blue, opacity)
        if solid.kind == "mesh":
            if solid.opacity < 1.0:
                yield f"mesh_{number}", _joined([solid], color)
        else:
            yield f"volume_{number}", drawn(solid.kind, solid.size, solid.position, solid.rotation, color, solid.vertices)


def _joined(solids: Sequence[Solid], color: Rgba | None = None) -> rr.Mesh3D:
    """Return meshes as one, each in its colour, or all in one colour."""
    corners, normals, triangles, colors, count = [], [], [], [], 0
    for solid in solids:
        assert solid.mesh is not None
        corners.append(solid.mesh.corners @ solid.rotation.T.astype(np.float32) + solid.position.astype(np.float32))
        normals.append(solid.mesh.normals @ solid.rotation.T.astype(np.float32))
        triangles.append(solid.mesh.triangles + count)
        colors.append(np.tile(np.round(255.0 * np.array(solid.color)).astype(np.uint8), (len(corners[-1]), 1)))
        count += len(corners[-1])
    return rr.Mesh3D(
        vertex_positions=np.vstack(corners),
        triangle_indices=np.vstack(triangles),
        vertex_normals=np.vstack(normals),
        vertex_colors=np.vstack(colors) if color is None else None,
        albedo_factor=color,
    )


TIMELINE = "time"
NORMAL = 0.05  # m, the arrow of a marker
PUSH, LONGEST = 5.0, 0.15  # length of a contact's arrow: in depths, and at most in m


class Figure:
    """Logs a robot and its world to a Rerun stream, then its poses over time.

    A link is drawn by its visuals (the surfaces in the robot file). Its solids (the volumes by which contacts are found) are shown only
    while they are in contact. `solids`: True: always draw the solids, never the visuals.
    """

    def __init__(self, stream: rr.RecordingStream, robot: Robot, world: World | None, solids: bool = False) -> None:
        self._stream, self._robot = stream, robot
        self._model = Model(robot, world)
        self._shapes = {shape.name: shape for shape in robot.shapes}
        self._parts = {part: palette.SOLIDS[k % len(palette.SOLIDS)] for k, part in enumerate(robot.parts)}
        self._touched: frozenset[str] = frozenset()
        self._pairs: frozenset[tuple[str, str]] = frozenset()
        visuals = [] if solids else [one for one in link_solids(robot) if not one.collides]
        self._dressed = frozenset(one.link for one in visuals)  # links whose solids are not shown while nothing touches them
        for link in self._dressed:
            for name, body in drawn_link([one for one in visuals if one.link == link]):
                self._log(["robot", robot.links[link], "visuals", name], body)
        for shape in robot.shapes:
            if not self._is_under(shape):
                self._log(self._path(shape), self._drawn(shape))
        for name, thing in (world.objects if world else {}).items():
            color = palette.of_object(thing.kind, thing.role, thing.color)
            self._log(["world", name], drawn(thing.kind, thing.size, thing.position, thing.rotation, color))
        for link in {marker.link for marker in robot.markers.values()}:
            self._log_markers(link)

    def move(self, begin: float, rate: float, poses: Array) -> None:
        """Log a motion of the robot with its contacts.

        `poses`: (k, n) rad; the first one is at the time `begin` [s] of the stream's timeline, the others follow with `rate` poses
        per second.
        """
        times = begin + np.arange(len(poses)) / rate
        transforms = link_transforms(self._robot, poses)
        turns = quaternion_from_matrix(transforms[..., :3, :3])[..., [1, 2, 3, 0]]
        for index, link in enumerate(self._robot.links):
            columns = rr.Transform3D.columns(translation=transforms[:, index, :3, 3], quaternion=turns[:, index])
            self._columns(["robot", link], times, columns)
        counts = np.zeros((len(poses), 2))
        for now, q in enumerate(poses):
            self._stream.set_time(TIMELINE, duration=times[now])
            contacts = self._model.evaluate(q).contacts
            counts[now] = [sum(contact.kind == kind for contact in contacts) for kind in ("solid", "field")]
            self._log_contacts(contacts)
        self._columns(["plots", "contacts"], times, rr.Scalars.columns(scalars=counts.ravel()).partition([2] * len(poses)))
        low, high = self._robot.limits.T
        shares = 100.0 * (poses - low) / np.maximum(high - low, 1e-9)
        self._columns(["plots", "motors"], times, rr.Scalars.columns(scalars=shares.ravel()).partition([len(low)] * len(poses)))

    def say(self, begin: float, text: str) -> None:
        """Log a text as an event at the time `begin` [s] of the stream's timeline."""
        self._stream.set_time(TIMELINE, duration=begin)
        self._stream.log("events", rr.TextLog(text, level="INFO"))

    def _log_contacts(self, contacts: tuple[Contact, ...]) -> None:
        touched = frozenset(name for contact in contacts for name in (contact.first, contact.second)) & self._shapes.keys()
        for name in sorted(touched ^ self._touched):
            self._show_touch(self._shapes[name], name in touched)
        pairs = frozenset((contact.first, contact.second) for contact in contacts)
        for contact in contacts:
            if (contact.first, contact.second) not in self._pairs:
                text = f"{contact.kind}: {contact.first} meets {contact.second}"
                self._stream.log("events", rr.TextLog(text, level="WARN" if contact.kind == "solid" else "INFO"))
        if contacts or self._pairs:
            self._stream.log(
                "contacts",
                rr.Arrows3D(
                    origins=[contact.point for contact in contacts],
                    vectors=[min(PUSH * contact.depth, LONGEST) * contact.normal for contact in contacts],
                    colors=[palette.CONTACT] * len(contacts),
                    radii=0.002,
                ),
            )
        self._touched, self._pairs = touched, pairs

    def _show_touch(self, shape: Shape, touched: bool) -> None:
        """Give a shape the colour of contact or its own; a solid whose link is drawn as meshes is shown only while it touches."""
        if not self._is_under(shape):
            self._stream.log(self._path(shape), recolored(shape.kind, self._color(shape, touched)))
        elif touched:
            self._stream.log(self._path(shape), self._drawn(shape, palette.TOUCHED))
        else:
            self._stream.log(self._path(shape), rr.Clear(recursive=False))

    def _is_under(self, shape: Shape) -> bool:
        return shape.role == "solid" and shape.link in self._dressed

    def _log_markers(self, link: int) -> None:
        markers = [marker for marker in self._robot.markers.values() if marker.link == link]
        self._log(
            ["robot", self._robot.links[link], "markers"],
            rr.Arrows3D(
                origins=[marker.position for marker in markers],
                vectors=[NORMAL * marker.normal for marker in markers],
                colors=[palette.MARKER] * len(markers),
                labels=[marker.name for marker in markers],
                radii=0.002,
            ),
        )

    def _drawn(self, shape: Shape, color: Rgba | None = None) -> rr.AsComponents:
        return drawn(shape.kind, shape.size, shape.position, shape.rotation, color or self._color(shape, False), shape.vertices)

    def _color(self, shape: Shape, touched: bool) -> Rgba:
        if shape.role == "field":
            return palette.TOUCHED if touched else palette.FIELD
        return palette.COLLIDING if touched else (*self._parts.get(shape.part, palette.SOLIDS[0]), 255)

    def _path(self, shape: Shape) -> list[object]:
        return ["robot", self._robot.links[shape.link], f"{shape.role}s", shape.name]

    def _log(self, path: list[object], what: rr.AsComponents) -> None:
        """Log components at time 0: they are shown from the beginning, until they are logged again with another colour."""
        self._stream.set_time(TIMELINE, duration=0.0)
        self._stream.log(path, what)

    def _columns(self, path: list[object], times: Array, columns: rr.ComponentColumnList) -> None:
        self._stream.send_columns(rr.new_entity_path(path), [rr.TimeColumn(TIMELINE, duration=times)], columns)
