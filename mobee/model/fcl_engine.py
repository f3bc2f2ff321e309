# SPDX-License-Identifier: Apache-2.0
"""A slow, independent engine that uses python-fcl, the reference for the compiled core; and the rules for which pairs are tested.

Depths are exact to 1e-6 m, fcl's tolerance. Only pairs whose bounding spheres overlap are given to fcl.
"""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import NotInstalled, UnknownName
from mobee.model.contact import ContactTable
from mobee.model.core_tables import bound
from mobee.model.engine import ATTACHED, NO_HANDS, OBSTACLE, TARGET, Hands, Snapshot
from mobee.model.kinematics import link_transforms, point_jacobian, push_factors
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Robot, Shape

try:
    import fcl
except ModuleNotFoundError:
    raise NotInstalled('this needs python-fcl, which is not installed: pip install "mobee[reference]"') from None

# fcl.collide is off by up to centimetres for capsules and boxes (it stops at any separating direction); signed distances are not.
_DISTANCE = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)
_COLLISION = fcl.CollisionRequest(enable_contact=True)


class FclEngine:
    """Evaluates poses of one robot with python-fcl; the results equal the results of the compiled engine up to fcl's tolerance, 1e-6 m."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._pairs: tuple[Snapshot | None, Hands, tuple[Ints, Ints, Ints] | None] = None, NO_HANDS, None

    def transforms(self, q: Array) -> Array:
        """Return the transforms (B, L, 4, 4) of the L links of the robot in the poses q (B, n) rad, in the root frame [m].

        The transform of a link maps a point of the link from its position at zero pose to its position in the pose.
        """
        return link_transforms(self.robot, q)

    def jacobians(self, q: Array, link: int, point: Array) -> Array:
        """Return the Jacobians (B, 6, n) of a point that is fixed to a link, in the poses q (B, n) rad: linear rows, then angular.

        `link`: index of the link. `point`: (3,) m, position of the point in the root frame at zero pose.
        """
        transforms = link_transforms(self.robot, q)
        moved = transforms[:, link, :3, :3] @ point + transforms[:, link, :3, 3]
        return point_jacobian(self.robot, transforms, link, moved)

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands, cut: bool = False, threads: int = 1) -> tuple[ContactTable, Array]:
        """Return all contacts in the poses q (B, n) rad, and their projection to the motors, (B, n) m^2/rad.

        The projection is the sum of J^T (factor * depth * normal) over the contacts of fields (volumes that cause repulsive forces). J is
        the Jacobian of the contact's point; the factors (1 if `robot.least_lever` is 0) are those of `mobee.model.kinematics.push_factors`.
        `snapshot`: the state of the world. `reaching`: the hands that reach for targets; their contacts with targets are ignored. `cut`:
        True: a contact acts only on the motors of the touching link's own part, as in the MoBeE program of 2014; False: also on the motors
        nearer to the base. `threads`: not used; the poses are computed one after the other.
        """
        transforms = link_transforms(self.robot, q)
        pairs = self._tested(snapshot, reaching)
        tables = [_contact_table(self.robot, one, snapshot, pairs) for one in transforms]
        for pose, table in enumerate(tables):
            table.numbers[:, 0] = pose
        torque = np.array([self._projection(*of_one, cut) for of_one in zip(transforms, tables, strict=True)]).reshape(q.shape)
        none = _table(self.robot, snapshot, np.empty((0, 6), dtype=np.int64), np.empty((0, 7)))
        numbers, reals = (np.concatenate([getattr(table, what) for table in (none, *tables)]) for what in ("numbers", "reals"))
        return _table(self.robot, snapshot, numbers, reals), torque

    def contacts_of_one(self, q: bytes, snapshot: Snapshot, reaching: Hands, cut: bool = False) -> tuple[ContactTable, Array]:
        """Return the contacts of one pose, and their projection to the motors, (n,) m^2/rad.

        The projection is that of `contacts`: the sum of J^T (factor * depth * normal) over the contacts of fields (volumes that cause
        repulsive forces); the factors are those of `mobee.model.kinematics.push_factors`, 1 if `robot.least_lever` is 0. `q`: the pose (n,)
        rad as bytes of float64. `snapshot`: the state of the world. `reaching`: the hands that reach for targets; their contacts with
        targets are ignored. `cut`: True: a contact acts only on the motors of the touching link's own part, as in the MoBeE program of
        2014; False: also on the motors nearer to the base.
        """
        table, torque = self.contacts(np.frombuffer(q)[None], snapshot, reaching, cut)
        return table, torque[0]

    def _tested(self, snapshot: Snapshot, reaching: Hands) -> tuple[Ints, Ints, Ints]:
        known = self._pairs
        if known[2] is not None and known[0] is snapshot and known[1] == reaching:
            return known[2]
        pairs = tested_pairs(self.robot, snapshot, reaching)
        self._pairs = snapshot, reaching, pairs
        return pairs

    def _projection(self, transforms: Array, table: ContactTable, cut: bool) -> Array:
        total = np.zeros(len(self.robot.motor_table))
        rows = np.flatnonzero(table.kind == 1)
        both = np.stack([table.first_link[rows], table.second_link[rows]], axis=1)
        factors = push_factors(self.robot, transforms, both, table.depth[rows], table.point[rows], table.normal[rows])
        for row, links, factor in zip(rows.tolist(), both.tolist(), factors.tolist(), strict=True):
            push = factor * table.depth[row] * table.normal[row]
            for link, force in zip(links, (push, -push), strict=True):
                if link > 0:
                    columns = self._own_columns(link) if cut else slice(None)
                    jacobian = point_jacobian(self.robot, transforms, link, table.point[row])[:3, columns]
                    total[columns] += jacobian.T @ force
        return total

    def _own_columns(self, link: int) -> slice:
        """Return the motors, as a slice of q, of the part that moves a link; an empty one for a link that no motor moves."""
        matrix, _ = self.robot.coupling
        while link > 0:
            driven = np.flatnonzero(matrix[link - 1])
            if driven.size:
                return self.robot.parts[self.robot.motor_table[int(driven[0])].part].slice
            link = self.robot.joints[link - 1].parent
        return slice(0)


def _contact_table(robot: Robot, transforms: Array, snapshot: Snapshot, pairs: tuple[Ints, Ints, Ints]) -> ContactTable:
    """Return every contact in the pose of `transforms` (L, 4, 4)."""
    volumes: tuple[Shape | WorldObject, ...] = (*robot.shapes, *snapshot.objects.values())
    links = _links(robot, snapshot)
    objects, centers, bounds = _placed(volumes, links, transforms)
    first, second, kind = pairs
    apart = ((centers[first] - centers[second]) ** 2).sum(axis=1) >= (bounds[first] + bounds[second]) ** 2
    numbers, reals = [], []
    for row in np.flatnonzero(~apart):
        a, b = first[row], second[row]
        found = _found(volumes, objects, centers, a, b)
        if found is not None:
            numbers.append((0, kind[row], a, b, links[a], links[b]))
            reals.append(found)
    table = np.array(numbers, dtype=np.int64).reshape(-1, 6)
    order = np.lexsort((table[:, 3], table[:, 2], table[:, 1]))
    return _table(robot, snapshot, table[order], np.array(reals).reshape(-1, 7)[order])


def _table(robot: Robot, snapshot: Snapshot, numbers: Ints, reals: Array) -> ContactTable:
    return ContactTable(tuple(shape.name for shape in robot.shapes), snapshot.names, (numbers, reals))


def _links(robot: Robot, snapshot: Snapshot) -> list[int]:
    """Return each volume's link, -1 for a free object and for a ghost on a link of another robot."""
    carrying = [robot.links.index(thing.link) if thing.link in robot.links else -1 for thing in snapshot.objects.values()]
    return [shape.link for shape in robot.shapes] + carrying


def _placed(volumes: tuple[Shape | WorldObject, ...], links: list[int], transforms: Array) -> tuple[list[Any], Array, Array]:
    """Return fcl's objects of all volumes, and centres (v, 3) and radii (v,) of their bounding spheres, root frame at this pose."""
    moved = np.concatenate([transforms, np.eye(4)[None]])[links]  # the last stands for -1
    position = np.array([volume.position for volume in volumes]).reshape(-1, 3)
    rotation = np.array([volume.rotation for volume in volumes]).reshape(-1, 3, 3)
    centers = np.einsum("vij,vj->vi", moved[:, :3, :3], position) + moved[:, :3, 3]
    turns = moved[:, :3, :3] @ rotation
    # New objects for every pose, so that no two threads share one; only the geometries, which never change, are kept.
    objects = [fcl.CollisionObject(_geometry(one), fcl.Transform(*at)) for one, *at in zip(volumes, turns, centers, strict=True)]
    return objects, centers, np.array([_bound(volume) for volume in volumes])


def _found(volumes: tuple[Shape | WorldObject, ...], objects: list[Any], centers: Array, a: int, b: int) -> tuple[float, ...] | None:
    for ball, other, sign in ((a, b, 1.0), (b, a, -1.0)):
        if volumes[ball].kind == "sphere" and volumes[other].kind != "convex":
            return _ball_overlap(objects[a], objects[b], centers[ball], volumes[ball].size[0], sign)
    return _overlap(objects[a], objects[b])


def _overlap(first: Any, second: Any) -> tuple[float, ...] | None:
    """Return depth, the direction in which the first must move, and the point midway between the two deepest points; None: apart."""
    if not fcl.collide(first, second):
        return None
    # fcl reports one in some thousand shallow overlaps as a small distance, but not with the two objects exchanged.
    for one, other in ((first, second), (second, first)):
        result = fcl.DistanceResult()
        depth = -fcl.distance(one, other, _DISTANCE, result)
        if depth > 0.0:
            deepest, surface = (np.array(point) for point in result.nearest_points)  # of `one`: inside the other, and separated
            normal = (surface - deepest) / np.linalg.norm(surface - deepest)
            return depth, *(normal if one is first else -normal), *(deepest + surface) / 2.0
    return _contact(first, second)  # they touch without overlap


def _contact(first: Any, second: Any) -> tuple[float, ...] | None:
    """Return depth, normal and a point that both volumes share, computed by fcl.collide; None: apart."""
    result = fcl.CollisionResult()
    fcl.collide(first, second, _COLLISION, result)
    if not result.contacts or not result.contacts[0].penetration_depth > 0.0:
        return None
    contact = result.contacts[0]
    return contact.penetration_depth, *(-contact.normal), *contact.pos  # fcl's normal points from the first to the second


def _ball_overlap(first: Any, second: Any, ball: Array, radius: float, sign: float) -> tuple[float, ...] | None:
    """Return depth, normal and point of a contact with a ball, for which fcl has closed forms; None: apart.

    `ball` (3,) and `radius` [m]; `sign`: 1.0 if the ball is the first volume, -1.0 if it is the second.
    """
    found = _contact(first, second)
    if found is None:
        return None
    depth, normal = found[0], np.array(found[1:4])
    return depth, *normal, *(ball - sign * (radius - depth / 2.0) * normal)


def _bound(volume: Shape | WorldObject) -> float:
    return bound(volume, getattr(volume, "vertices", None))


def _geometry(volume: Shape | WorldObject) -> Any:
    vertices = getattr(volume, "vertices", None)
    return _hull(vertices.tobytes()) if vertices is not None else _primitive(volume.kind, volume.size)


@lru_cache(maxsize=4096)
def _primitive(kind: str, size: tuple[float, ...]) -> Any:
    makers = {"sphere": fcl.Sphere, "capsule": fcl.Capsule, "cylinder": fcl.Cylinder, "box": fcl.Box}
    return makers[kind](*size)


@lru_cache(maxsize=4096)
def _hull(vertices: bytes) -> Any:
    """Return the convex hull of vertices, given as the bytes of (v, 3) float64, as a shape of fcl.

    Only one face is given, so the surface is open, and fcl then compares all vertices, not only neighbours along faces.
    """
    points = np.frombuffer(vertices).reshape(-1, 3)
    return fcl.Convex(points, 1, np.array([3, 0, 1, 2]))


SOLID, FIELD = 0, 1


def tested_pairs(robot: Robot, snapshot: Snapshot, reaching: Hands) -> tuple[Ints, Ints, Ints]:
    """Return the p tested pairs of volumes as three arrays (p,): first volume, second volume and kind (0 solid, 1 field).

    Fields are volumes that cause repulsive forces. Volumes are numbered: first the robot's shapes, then the world's objects. Pairs of the
    robot's own shapes are those in its lists `solid_pairs` and `field_pairs`. A free object (one that is not attached to a link) is tested
    against every shape except those of the base; if it is a target, it is not tested against the hands in `reaching`, which reach for it.
    The kind of a pair of a shape and an object is that of the shape: 0 for a solid, 1 for a field. An attached object counts as a solid of
    its link. It is tested against free objects, and against the shapes and attached objects of other links, except if the pair of links is
    in `robot.untested`. Ghosts, objects that are only drawn, are not tested. Raises UnknownName for an object that is attached to a link
    which the robot does not have.
    """
    own = [(int(a), int(b), kind) for kind, pairs in ((SOLID, robot.solid_pairs), (FIELD, robot.field_pairs)) for a, b in pairs]
    roles = [FIELD if shape.role == "field" else SOLID for shape in robot.shapes]
    start = len(robot.shapes)
    things = list(enumerate(zip(snapshot.objects.values(), snapshot.roles, strict=True), start))
    free = [(index, role == TARGET) for index, (_, role) in things if role in (OBSTACLE, TARGET)]
    carried = [(index, _link(robot, thing.link)) for index, (thing, role) in things if role == ATTACHED and thing.link is not None]
    bodies = [(index, shape.link, role) for index, (shape, role) in enumerate(zip(robot.shapes, roles, strict=True))]

    with_free = [(index, link, role) for index, link, role in bodies if index not in robot.base_shapes]
    with_free += [(index, link, SOLID) for index, link in carried]
    sparing = [set[int](), set[int]()]  # links, by kind
    for hand in reaching:
        sparing[SOLID] |= _carried(robot, hand.link)
        sparing[FIELD] |= _carried(robot, hand.link) | _carried(robot, hand.fields)
    world = [(a, b, kind) for a, link, kind in with_free for b, is_target in free if not (is_target and link in sparing[kind])]
    load = [(a, b, kind) for a, link, kind in bodies for b, other in carried if _meet(robot, link, other)]
    loads = [(a, b, SOLID) for (a, link), (b, other) in itertools.combinations(carried, 2) if _meet(robot, link, other)]
    first, second, kind = np.array([*own, *world, *load, *loads], dtype=np.intp).reshape(-1, 3).T
    return first, second, kind


def _carried(robot: Robot, link: int) -> set[int]:
    """Return a link and all links that are mounted on it."""
    found = {link}
    for j, joint in enumerate(robot.joints):
        if joint.parent in found:
            found.add(j + 1)
    return found


def _link(robot: Robot, name: str) -> int:
    if name not in robot.links:
        raise UnknownName("link", name, robot.links)
    return robot.links.index(name)


def _meet(robot: Robot, link: int, other: int) -> bool:
    return link != other and frozenset((link, other)) not in robot.untested
