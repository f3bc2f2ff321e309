# SPDX-License-Identifier: Apache-2.0
"""The 3D scene: robot and objects, fields (volumes that cause repulsive forces), trails of the hands, poses in which actions ended."""

from __future__ import annotations

from collections import deque

import numpy as np
import rerun as rr

from bus_schema.messages import ContactItem, WorldObject
from bus_schema.rpc import ObjectState
from mobee.arrays import Array, Ints
from mobee.model.kinematics import link_transforms, matrix_from_quaternion, quaternion_from_matrix
from mobee.rendering import palette
from mobee.rendering.solid import link_solids
from mobee.robot.robot import Robot, Shape, ShapeKind
from mobee.robot.urdf.hull import facets
from services.monitor.viewer.blueprint import ROOT
from services.monitor.viewer.figure import drawn, drawn_link, drawn_together
from services.monitor.viewer.frames import Frames
from services.monitor.web.surfaces import flat


class Links:
    """Logs the visuals of each link to a Rerun stream once, on entities below robot/. Then `move` logs one transform per link."""

    def __init__(self, stream: rr.RecordingStream | Frames, robot: Robot) -> None:
        self._stream = stream
        solids = link_solids(robot)
        self._frames = {one.link: f"link_{one.link}" for one in solids}
        for link, frame in self._frames.items():
            for name, body in drawn_link([one for one in solids if one.link == link]):
                path = rr.new_entity_path(["robot", "links", robot.links[link], name])
                stream.log(path, rr.CoordinateFrame(frame), body, static=True)

    def move(self, transforms: Array) -> None:
        """Log the present poses of the links in the root frame, (L, 4, 4), as `mobee.model.kinematics.link_transforms` returns them."""
        turns = quaternion_from_matrix(transforms[:, :3, :3])[:, [1, 2, 3, 0]]
        for link, frame in self._frames.items():
            place = rr.Transform3D(
                translation=transforms[link, :3, 3], quaternion=rr.Quaternion(xyzw=turns[link]), parent_frame=ROOT, child_frame=frame
            )
            self._stream.log(f"robot/frames/{frame}", place)


TRAIL = 60  # points a hand
TRAIL_STEP = 2  # updates for each point
TRAIL_PIECES = 8  # of fading brightness
FIELD_PATHS: dict[ShapeKind, str] = {  # entities of the fields, one for each kind of shape that the robot's fields have
    "capsule": "scene/fields/capsules",
    "sphere": "scene/fields/spheres",
    "cylinder": "scene/fields/cylinders",
    "box": "scene/fields/boxes",
    "convex": "scene/fields/hulls",
}
HANDS = {"left_palm": palette.PARTS["left_arm"], "right_palm": palette.PARTS["right_arm"]}


class Scene:
    """Logs the robot, its fields, the trails of its hands and the objects to a Rerun stream.

    Fields are larger volumes around links, whose contacts cause repulsive forces. A trail is a line through the last positions of a hand.
    The geometry of the links is logged once, then only their poses.
    """

    def __init__(self, stream: rr.RecordingStream | Frames, robot: Robot) -> None:
        self._stream, self._robot = stream, robot
        self._all_fields = [shape for shape in robot.shapes if shape.role == "field"]
        self._fields = self._all_fields
        self._field_paths = {kind: path for kind, path in FIELD_PATHS.items() if any(shape.kind == kind for shape in self._fields)}
        self._hulls = {one.name: _hull(one) for one in self._fields if one.kind == "convex"}
        self._trails: dict[str, deque[Array]] = {name: deque(maxlen=TRAIL) for name in HANDS if name in robot.markers}
        self._objects: dict[str, ObjectState | WorldObject] = {}
        self._updates = 0
        for path in (*self._field_paths.values(), "scene/objects", "scene/trails"):
            stream.log(path, rr.CoordinateFrame(ROOT), static=True)
        self._links = Links(stream, robot)

    def show_fields(self, shown: bool) -> None:
        """Show or hide the robot's fields (volumes that cause repulsive forces), from the next update on."""
        self._fields = self._all_fields if shown else []

    def forget(self) -> None:
        """Delete the trails of the hands, because a new run has begun."""
        for trail in self._trails.values():
            trail.clear()

    def log_robot(self, q: Array, contacts: list[ContactItem]) -> None:
        """Log the robot in the pose `q` (n,) rad, with its fields, the volumes that cause repulsive forces.

        A field that is named in one of the contacts is red.
        """
        transforms = link_transforms(self._robot, q)
        self._links.move(transforms)
        self._log_fields(transforms, {name for c in contacts for name in (c.first, c.second)})
        if self._updates % TRAIL_STEP == 0:
            self._log_trails(transforms)
        self._updates += 1

    def set_objects(self, objects: list[ObjectState]) -> None:
        """Show all objects of the world of the service `model`, and remove those that this world no longer contains."""
        known = {thing.name: thing for thing in objects}
        for name in self._objects.keys() - known.keys():
            self._stream.log(f"scene/objects/{name}", rr.Clear(recursive=False))
        self._objects = {**known}
        for thing in objects:
            self.log_object(thing)

    def log_object(self, thing: ObjectState | WorldObject) -> None:
        """Log one object with its shape, position and colour, as a message about the world describes it (root frame)."""
        self._objects[thing.name] = thing
        color = palette.of_object(thing.geometry.kind, thing.role)
        turn = matrix_from_quaternion(np.array(thing.quaternion))
        body = drawn(thing.geometry.kind, tuple(thing.geometry.size), np.array(thing.position), turn, color)
        self._stream.log(f"scene/objects/{thing.name}", rr.CoordinateFrame(ROOT), body)

    def _log_fields(self, transforms: Array, touched: set[str]) -> None:
        for kind, path in self._field_paths.items():
            shapes = [shape for shape in self._fields if shape.kind == kind]
            colors = [palette.TOUCHED if shape.name in touched else palette.FIELD for shape in shapes]
            moved = transforms[[shape.link for shape in shapes]]
            if kind == "convex":
                body: rr.AsComponents = _hulls([self._hulls[shape.name] for shape in shapes], moved, colors)
            else:
                turns = np.array([link[:3, :3] @ shape.rotation for link, shape in zip(moved, shapes, strict=True)]).reshape(-1, 3, 3)
                centres = [link[:3, :3] @ shape.position + link[:3, 3] for link, shape in zip(moved, shapes, strict=True)]
                body = drawn_together(kind, [shape.size for shape in shapes], np.array(centres).reshape(-1, 3), turns, colors)
            self._stream.log(path, body)

    def _log_trails(self, transforms: Array) -> None:
        strips, colors = [], []
        for name, trail in self._trails.items():
            marker = self._robot.marker(name)
            link = transforms[marker.link]
            trail.append(link[:3, :3] @ marker.position + link[:3, 3])
            points = np.array(trail)
            edges = np.linspace(0, len(points) - 1, TRAIL_PIECES + 1).astype(int)
            for piece, (first, last) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
                if last > first:
                    strips.append(points[first : last + 1])
                    colors.append((*HANDS[name], round(40 + 215 * (piece + 1) / TRAIL_PIECES)))
        if strips:
            self._stream.log("scene/trails", rr.LineStrips3D(strips, colors=colors, radii=0.003))


def _hull(shape: Shape) -> tuple[Array, Array, Ints]:
    """Return corners (v, 3) m, normals (v, 3) and triangles (t, 3) of a convex shape, in the root frame with every joint at zero."""
    assert shape.vertices is not None
    return flat(facets(shape.position + shape.vertices @ shape.rotation.T))


def _hulls(hulls: list[tuple[Array, Array, Ints]], transforms: Array, colors: list[palette.Rgba]) -> rr.Mesh3D:
    """Return convex bodies as one mesh.

    `hulls`: corners, normals and triangles of each body at zero pose. `transforms`: (k, 4, 4), the pose of each body's link. `colors`: one
    for each body.
    """
    corners, normals, triangles, paint, count = [np.empty((0, 3))], [np.empty((0, 3))], [np.empty((0, 3), dtype=np.intp)], [], 0
    for (points, outward, indices), link, color in zip(hulls, transforms, colors, strict=True):
        corners.append(points @ link[:3, :3].T + link[:3, 3])
        normals.append(outward @ link[:3, :3].T)
        triangles.append(indices + count)
        paint += [color] * len(points)
        count += len(points)
    return rr.Mesh3D(
        vertex_positions=np.vstack(corners), triangle_indices=np.vstack(triangles), vertex_normals=np.vstack(normals), vertex_colors=paint
    )


KEPT = 600  # poses
OPACITY = 40  # of 255, of one pose
CHAINS = {"left_arm": ("left_elbow", "left_palm"), "right_arm": ("right_elbow", "right_palm")}
SHOULDERS = {"left_arm": "l_shoulder_pitch", "right_arm": "r_shoulder_pitch"}


class Poses:
    """Draws the last 600 arm poses in which an action ended, as thin lines from shoulder to elbow to palm, in a Rerun stream."""

    def __init__(self, stream: rr.RecordingStream | Frames, robot: Robot) -> None:
        self._stream, self._robot = stream, robot
        joints = {joint.name: index for index, joint in enumerate(robot.joints)}
        known = (set(robot.markers), set(joints))
        self._chains = {
            part: (joints[SHOULDERS[part]], markers)
            for part, markers in CHAINS.items()
            if set(markers) <= known[0] and SHOULDERS[part] in known[1]
        }
        self._kept: deque[tuple[str, Array]] = deque(maxlen=KEPT)
        stream.log("scene/poses", rr.CoordinateFrame(ROOT), static=True)

    def note(self, q: Array) -> None:
        """Draw the arms of the robot in the pose `q` (n,) rad, in which an action has ended, in addition to the earlier ones."""
        transforms = link_transforms(self._robot, q)
        for part, (joint, markers) in self._chains.items():
            shoulder = self._robot.joints[joint]
            points = [transforms[shoulder.parent, :3, :3] @ shoulder.point + transforms[shoulder.parent, :3, 3]]
            for name in markers:
                marker = self._robot.marker(name)
                points.append(transforms[marker.link, :3, :3] @ marker.position + transforms[marker.link, :3, 3])
            self._kept.append((part, np.array(points)))
        colors = [(*palette.PARTS[part], OPACITY) for part, _ in self._kept]
        self._stream.log("scene/poses", rr.LineStrips3D([points for _, points in self._kept], colors=colors, radii=0.0015))
