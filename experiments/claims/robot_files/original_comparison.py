# SPDX-License-Identifier: Apache-2.0
"""Compares two readings of a robot file of 2010 to 2014, pose by pose: by this library, and by the rules of the MoBeE program of 2014."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
from numpy.typing import NDArray

from experiments.claims.robot_files.program_2014 import Node, Program, Volume
from mobee.model.kinematics import link_transforms
from mobee.model.model import Model
from mobee.robot.robot import Robot

Array = NDArray[np.float64]
_Placed = tuple[coal.ShapeBase, coal.Transform3s]
MIN_DEPTH = 1e-6  # m; a contact that is not deeper may be found by one side only
Y_TO_Z = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])  # the axis of the program's cylinder is y, of coal's z
SHRINKAGE = 1e-4  # m; a contact that ends when the volumes are smaller by this may be found by one side only


@dataclass(frozen=True)
class Comparison:
    """Differences between two readings of a robot file: by this library, and by the rules of the MoBeE program of 2014.

    `poses`: number of compared poses.  `position_error`: largest distance between the positions of a volume's centre or a marker [m].
    `rotation_error`: largest difference of a component of a unit vector, for normals of markers and axes of boxes; and 1 - |cos| of the
    angle between the height axes of cylinders.
    Counts of differences, 0 if the readings agree: `pairs`, pairs of volumes that only one reading tests; `base`, volumes that only one
    reading tests against the world; `clauses`, clauses (constraints on several joints) that hold in a pose by one reading only; `contacts`,
    contacts that only one reading finds.  `all_contacts`: number of all contacts, in all poses.
    """

    poses: int
    position_error: float
    rotation_error: float
    pairs: int
    base: int
    clauses: int
    contacts: int
    all_contacts: int

    @property
    def agrees(self) -> bool:
        """Whether both readings are the same, with directions and positions [m] within 1e-6."""
        return self.position_error < 1e-6 and self.rotation_error < 1e-6 and not (self.pairs or self.base or self.clauses or self.contacts)


def compare(path: Path, robot: Robot, poses: int, seed: int) -> Comparison:
    """Compare a robot as this library reads it from `path` with the reading of `program_2014.Program`.

    They are compared at home and at `poses` - 1 random positions of the motors within the limits, drawn with `seed`.  Raises ValueError if
    the volumes differ.
    """
    program = Program.read(path)
    low, high = robot.limits.T
    drawn = np.random.default_rng(seed).uniform(low, high, (poses, len(robot.motors)))
    drawn[0] = robot.home
    volumes = [(node, volume, role) for node in program.nodes for role in ("solid", "field") for volume in _of(node, role)]
    order = _matched(program, robot, volumes, drawn[-1])
    pairs = {role: _pairs(program, volumes, role) for role in ("solid", "field")}
    mine = {
        role: {frozenset(pair) for pair in found.tolist()} for role, found in (("solid", robot.solid_pairs), ("field", robot.field_pairs))
    }
    theirs = {role: {frozenset((int(order[i]), int(order[j]))) for i, j in pairs[role]} for role in pairs}
    base = {int(order[k]) for k, (node, _, _) in enumerate(volumes) if program.is_base(node)}
    comparison = _PoseComparison(program, robot, volumes, order, pairs)
    for q in drawn:
        comparison.compare(q)
    return Comparison(
        poses,
        comparison.position_error,
        comparison.rotation_error,
        sum(len(mine[role] ^ theirs[role]) for role in mine),
        len(base ^ set(robot.base_shapes)),
        comparison.clauses,
        comparison.contacts,
        comparison.all_contacts,
    )


def _of(node: Node, role: str) -> list[Volume]:
    return node.solids if role == "solid" else node.fields


def _degrees(robot: Robot, q: Array) -> dict[str, float]:
    return dict(zip(robot.motors, np.rad2deg(q).tolist(), strict=True))


def _placed(program: Program, robot: Robot, volumes: list[tuple[Node, Volume, str]], q: Array) -> tuple[Array, Array]:
    """Return the centres (v, 3) m and rotation matrices (v, 3, 3) of the volumes by the rules of the program, in the root frame.

    `q`: one pose (n,) rad.
    """
    at = program.poses(_degrees(robot, q))
    centres = np.array([at[node][:3, :3] @ volume.position + at[node][:3, 3] for node, volume, _ in volumes])
    return centres.reshape(-1, 3), np.array([at[node][:3, :3] @ volume.rotation for node, volume, _ in volumes]).reshape(-1, 3, 3)


def _shapes(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Return the centres (v, 3) m and rotation matrices (v, 3, 3) of the robot's shapes as this library reads them, in the root frame.

    `q`: one pose (n,) rad.
    """
    transforms = link_transforms(robot, q)
    at = [transforms[shape.link] for shape in robot.shapes]
    centres = np.array([link[:3, :3] @ shape.position + link[:3, 3] for link, shape in zip(at, robot.shapes, strict=True)])
    return centres.reshape(-1, 3), np.array([link[:3, :3] @ shape.rotation for link, shape in zip(at, robot.shapes, strict=True)])


def _matched(program: Program, robot: Robot, volumes: list[tuple[Node, Volume, str]], q: Array) -> NDArray[np.intp]:
    """Return for each of the program's volumes the index of the nearest shape of its kind, role and size, at home and in another pose.

    Equal volumes in one place are matched in the order of the file.  Raises ValueError if the volumes and shapes differ.
    """
    if len(volumes) != len(robot.shapes):
        raise ValueError(f"{len(volumes)} volumes by the program's rules, {len(robot.shapes)} shapes here")
    poses = (robot.home, q)
    theirs, mine = [_placed(program, robot, volumes, pose) for pose in poses], [_shapes(robot, pose) for pose in poses]
    order = np.full(len(volumes), -1, dtype=np.intp)
    free = dict.fromkeys(range(len(volumes)))
    for k, (_, volume, role) in enumerate(volumes):
        best: tuple[float, int] = (np.inf, -1)
        for i in free:
            shape = robot.shapes[i]
            if (shape.kind, shape.role) != (volume.kind, role) or not np.allclose(shape.size, volume.size, atol=1e-12):
                continue
            distance = max(float(np.abs(a[0][k] - b[0][i]).max()) for a, b in zip(theirs, mine, strict=True))
            rotation_gap = max(_rotation_difference(volume, a[1][k], b[1][i]) for a, b in zip(theirs, mine, strict=True))
            best = min(best, (round(distance + rotation_gap, 9), i))
        if best[1] < 0:
            raise ValueError(f"no {role} {volume.kind} of size {volume.size} here")
        order[k] = best[1]
        del free[best[1]]
    return order


def _pairs(program: Program, volumes: list[tuple[Node, Volume, str]], role: str) -> list[tuple[int, int]]:
    """Return the pairs of volumes that the program tests for contacts, as indices in `volumes`.

    `role`: "solid" or "field"; both volumes of a pair have this role.
    """
    ignored = program.ignored()[0 if role == "solid" else 1]
    mine = [k for k, one in enumerate(volumes) if one[2] == role]
    return [
        (i, j)
        for index, i in enumerate(mine)
        for j in mine[index + 1 :]
        if volumes[i][0] is not volumes[j][0] and frozenset((volumes[i][0], volumes[j][0])) not in ignored
    ]


class _PoseComparison:
    """Compares the two readings of a robot file in one pose after another, and keeps the largest differences and the counts.

    One reading is by this library, the other by the rules of the MoBeE program of 2014.  The fields are as in `Comparison`.
    """

    def __init__(
        self,
        program: Program,
        robot: Robot,
        volumes: list[tuple[Node, Volume, str]],
        order: NDArray[np.intp],
        pairs: dict[str, list[tuple[int, int]]],
    ) -> None:
        self.program, self.robot, self.volumes, self.order = program, robot, volumes, order
        self.model = Model(robot)
        self.pairs = {role: np.array(found, dtype=np.intp).reshape(-1, 2) for role, found in pairs.items()}
        self.radii = np.array([_radius(volume) for _, volume, _ in volumes])
        self.position_error = self.rotation_error = 0.0
        self.clauses = self.contacts = self.all_contacts = 0

    def compare(self, q: Array) -> None:
        """Compare the two readings in one pose `q` (n,) rad, and add the differences to the fields of this object."""
        degrees = _degrees(self.robot, q)
        centres, turns = _placed(self.program, self.robot, self.volumes, q)
        mine, mine_turned = (one[self.order] for one in _shapes(self.robot, q))
        self.position_error = max([self.position_error, *np.linalg.norm(centres - mine, axis=1)])
        for (_, volume, _), theirs, ours in zip(self.volumes, turns, mine_turned, strict=True):
            self.rotation_error = max(self.rotation_error, _rotation_difference(volume, theirs, ours))
        self._markers(degrees, q)
        for clause, ours in zip(self.program.clauses, self.robot.clauses, strict=True):
            self.clauses += self.program.obeys(clause, degrees) != bool((ours.a @ q + ours.b > 0).any())
        self._contacts(centres, turns, q)

    def _markers(self, degrees: dict[str, float], q: Array) -> None:
        at, pose = self.program.poses(degrees), self.model.evaluate(q)
        for (_, node, normal), (name, marker) in zip(self.program.markers, self.robot.markers.items(), strict=True):
            self.position_error = max(self.position_error, float(np.linalg.norm(pose.position(name) - at[node][:3, 3])))
            here = pose.rotation(name) @ marker.rotation.T @ marker.normal
            self.rotation_error = max(self.rotation_error, float(np.abs(here - at[node][:3, :3] @ normal).max()))

    def _contacts(self, centres: Array, turns: Array, q: Array) -> None:
        found = {frozenset((contact.first, contact.second)): contact.depth for contact in self.model.evaluate(q).contacts}
        names = [self.robot.shapes[k].name for k in self.order]
        objects = [_object(volume, c, t) for (_, volume, _), c, t in zip(self.volumes, centres, turns, strict=True)]
        theirs = set[frozenset[str]]()
        for pairs in self.pairs.values():
            near = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1) < self.radii[pairs].sum(axis=1)
            for i, j in pairs[near].tolist():
                if _touch(objects[i], objects[j]):
                    theirs.add(frozenset((names[i], names[j])))
        self.all_contacts += len(theirs | found.keys())
        self.contacts += sum(found[pair] > MIN_DEPTH for pair in found.keys() - theirs)
        self.contacts += sum(self._remains(pair, names, centres, turns) for pair in theirs - found.keys())

    def _remains(self, pair: frozenset[str], names: list[str], centres: Array, turns: Array) -> bool:
        """Return whether a contact that only coal finds remains when both volumes are a little smaller."""
        i, j = (names.index(name) for name in pair)
        small = [_object(self.volumes[k][1], centres[k], turns[k], SHRINKAGE) for k in (i, j)]
        return _touch(*small)


def _touch(first: _Placed, second: _Placed) -> bool:
    """Return whether two volumes overlap, by coal: fcl misses contacts of cylinders that are centimetres deep."""
    return bool(coal.collide(*first, *second, coal.CollisionRequest(), coal.CollisionResult()))


def _radius(volume: Volume) -> float:
    """Return the radius [m] of a ball around the centre of a volume that contains it."""
    if volume.kind == "sphere":
        return volume.size[0]
    half = (volume.size[0], volume.size[1] / 2) if volume.kind == "cylinder" else tuple(size / 2 for size in volume.size)
    return float(np.linalg.norm(half))


def _rotation_difference(volume: Volume, theirs: Array, mine: Array) -> float:
    """Return the difference of two orientations (3, 3) of a volume, without unit; 0 if they differ only by a symmetry of the volume.

    Cylinder: 1 - |cos| of the angle between the height axes.  Box: largest difference of a component of the axes.  Sphere: 0.
    """
    if volume.kind == "sphere":
        return 0.0
    if volume.kind == "cylinder":  # the program's axis is y, ours z
        return float(1.0 - abs(theirs[:, 1] @ mine[:, 2]))
    return float(np.abs(np.abs(theirs.T @ mine) - np.eye(3)).max())


def _object(volume: Volume, centre: Array, turn: Array, less: float = 0.0) -> _Placed:
    """Return a volume as a shape and a transform for the library coal.

    `centre` (3,) m, `turn` (3, 3): its centre and orientation in the root frame.  Each length in its size becomes shorter by `less` [m],
    but at most by half.
    """
    size = [max(length - less, length / 2) for length in volume.size]
    if volume.kind == "sphere":
        shape = coal.Sphere(*size)
    elif volume.kind == "cylinder":
        shape = coal.Cylinder(*size)
        turn = turn @ Y_TO_Z
    else:
        shape = coal.Box(*size)
    return shape, coal.Transform3s(turn, centre)
