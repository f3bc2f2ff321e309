# SPDX-License-Identifier: Apache-2.0
"""Checks which edges of a roadmap are free of contact, and keeps the checks up to date while the world changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints, checked_threads
from mobee.errors import InvalidValue
from mobee.model.core_tables import bound
from mobee.model.engine import Snapshot
from mobee.model.model import Model, Reaching, engine_of
from mobee.model.world_object import WorldObject
from mobee.roadmap.ik.costs import lengths
from mobee.roadmap.ik.problem import solid_model

STEP = 0.001  # m
TURN = 1.0  # rad; in a larger turn the straight distance between the ends says too little about the path
SKIN = 0.04  # m: an edge moves a hand by a centimetre, and an elbow by more
_AT_ONCE = 4096  # poses

Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """The result of a check of E edges.

    `free`: (E,) whether each edge is without contacts. `poses`: number of poses checked, the ends of the edges included.
    """

    free: Flags
    poses: int


def check_edges(
    model: Model, q: Array, edges: Ints, step: float = STEP, marker: str | None = None, threads: int = 1, reaching: Reaching = None
) -> Flags:
    """Return whether each of the edges (E, 2) between poses q (V, n) rad is free of contacts between solids, (E,).

    An edge is the straight line between two poses (rows of q) in joint space. Every row of q that occurs in an edge is checked once; the
    check of an edge ends at the first pose with contacts. Give each edge only once: both directions have the same result. The check is
    fastest if the edges are sorted, like those of a Roadmap.

    Args:
        model: its solid shapes are checked, in the present state of its world.
        q: (V, n) rad, poses of all motors.
        edges: (E, 2) indices in q of the two poses of each edge.
        step: largest straight distance between successive checked poses [m], of the marker or of the centres of the shapes.
        marker: name of the marker whose motion `step` limits; None: it limits the motion of the centre of every shape.
        threads: number of threads; the result does not depend on it.
        reaching: name of a marker, or names of up to two; contacts between targets and the hand of each marker (its link, the
            links that this carries, and more, see `Model.hand`) are ignored.
    """
    return checked(model, q, edges, step, marker, threads, reaching).free


def checked(
    model: Model, q: Array, edges: Ints, step: float = STEP, marker: str | None = None, threads: int = 1, reaching: Reaching = None
) -> Checked:
    """Check which edges between poses are free of contacts between solids, as `check_edges` does; return also the number of poses checked.

    Args:
        model: its solid shapes are checked, in the present state of its world.
        q: (V, n) rad, poses of all motors.
        edges: (E, 2) indices in q of the two poses of each edge.
        step: largest straight distance between successive checked poses [m], of the marker or of the centres of the shapes.
        marker: name of the marker whose motion `step` limits; None: it limits the motion of the centre of every shape.
        threads: number of threads; the result does not depend on it.
        reaching: name of a marker, or names of up to two; contacts between targets and the hand of each marker (its link, the
            links that this carries, and more, see `Model.hand`) are ignored.
    """
    if not step > 0.0:
        raise InvalidValue(f"step {step} m: it must be above 0.")
    threads = checked_threads(threads)
    solid = solid_model(model)
    vertices, ends = np.unique(edges, return_inverse=True)
    q, ends = np.ascontiguousarray(q[vertices], dtype=np.float64), ends.reshape(-1, 2)
    stands = np.ones(len(q), dtype=bool)
    for some in np.array_split(np.arange(len(q)), len(q) // _AT_ONCE + 1):
        stands[some] = np.asarray(solid.evaluate(q[some], reaching=reaching).count) == 0
    free: Flags = stands[ends[:, 0]] & stands[ends[:, 1]]
    left = np.flatnonzero(free)
    poses = between(solid, q, ends[left], step, marker)
    free[left], count = _sweep(solid, q, ends[left], poses, threads, reaching)
    return Checked(free, len(vertices) + count)


def between(model: Model, q: Array, edges: Ints, step: float = STEP, marker: str | None = None) -> Ints:
    """Return how many intermediate poses of each edge must be checked, without its two ends, (E,).

    `q`: (V, n) rad, poses. `edges`: (E, 2) indices in q of the two poses of each edge. Each edge is divided into equal pieces in which no
    motor turns by more than TURN (1 rad), because the straight distance between the ends of a larger turn is much shorter than the path.
    The number is the smallest for which the longest straight distance of the marker in a piece, times the number of pieces and divided by
    (number + 1), is at most `step` [m]. Without a marker, this holds for the centre of every shape.
    """
    far, places = np.zeros(len(edges)), points(model, q, marker)
    turns = np.abs(q[edges[:, 0]] - q[edges[:, 1]]).max(axis=1, initial=0.0)
    pieces = np.maximum(np.ceil(turns / TURN), 1.0).astype(np.int64)
    for place in places:
        far = np.maximum(far, np.linalg.norm(place[edges[:, 0]] - place[edges[:, 1]], axis=1))
    for number in np.unique(pieces[pieces > 1]).tolist():
        some = np.flatnonzero(pieces == number)
        start, end = q[edges[some, 0]], q[edges[some, 1]]
        on = start + np.linspace(0.0, 1.0, number + 1)[:, None, None] * (end - start)
        for place in points(model, on.reshape(-1, q.shape[1]), marker):
            lengths = np.linalg.norm(np.diff(place.reshape(number + 1, len(some), 3), axis=0), axis=2)
            far[some] = np.maximum(far[some], number * lengths.max(axis=0))
    count: Ints = np.maximum(np.ceil(far / step) - 1.0, 0.0).astype(np.int64)
    return count


def points(model: Model, q: Array, marker: str | None = None) -> Array:
    """Return the positions of points of the robot in poses q (V, n) rad, (P, V, 3) m, root frame.

    With a marker, P is 1 and the point is the marker. Without a marker, the points are the centres of all P shapes of the robot, in the
    order of `robot.shapes`.
    """
    if marker is not None:
        model.robot.marker(marker)
    found = []
    for some in np.array_split(q, len(q) // _AT_ONCE + 1):
        pose = model.evaluate(some)
        if marker is not None:
            found.append(pose.position(marker)[None])
            continue
        links = np.array([shape.link for shape in model.robot.shapes])
        middles = np.array([shape.position for shape in model.robot.shapes]).reshape(-1, 3)
        there = pose.transforms[:, links, :3, :]
        found.append(np.einsum("vsij,sj->svi", there[..., :3], middles) + there[..., 3].transpose(1, 0, 2))
    return np.concatenate(found, axis=1)


def _sweep(model: Model, q: Array, edges: Ints, poses: Ints, threads: int, reaching: Reaching) -> tuple[Flags, int]:
    from mobee._core.roadmap import sweep  # loads the core, so it is imported only when needed
    from mobee.model.engine import Neighbours

    users = [Neighbours(engine_of(model.robot), SKIN) for _ in range(threads)]
    snapshot, hands = model.world.snapshot, model.hands(reaching)
    return sweep([one.enter(snapshot, hands) for one in users], q, np.ascontiguousarray(edges, dtype=np.int64), poses)


_LONGER = 1.1  # largest ratio of a shape's path to the two straight lines through its middle, for motors that turn by up to about 1 rad
_MARGIN = 1e-6  # m


class EdgeWatch:
    """Checks which edges (straight lines in joint space between two poses) are free of contacts, again after each change of the world.

    The attribute `free` (E,) is True for each edge that was free of contacts between solids at the last `update`.

    Args:
        model: its solid shapes are checked.
        q: (V, n) rad, poses of all motors.
        edges: (E, 2) indices in q of the two poses of each edge.
        step: largest straight distance between successive checked poses [m], of the marker or of the centres of the shapes.
        marker: name of the marker whose motion `step` limits; None: it limits the motion of the centre of every shape.
        threads: number of threads; the result does not depend on it.
    """

    def __init__(self, model: Model, q: Array, edges: Ints, step: float = STEP, marker: str | None = None, threads: int = 1) -> None:
        self._model, self._threads = model, threads
        self._q, self._edges, self._step, self._marker = q, edges, step, marker
        solid = solid_model(model)
        robot = solid.robot
        meets = [index for index in range(len(robot.shapes)) if index not in robot.base_shapes]
        self._bounds = [bound(robot.shapes[index], robot.shapes[index].vertices) for index in meets]
        self._middles = points(solid, q)[meets]
        half = points(solid, 0.5 * (q[edges[:, 0]] + q[edges[:, 1]]))[meets]
        first, second = self._middles[:, edges[:, 0]], self._middles[:, edges[:, 1]]
        self._half_paths = 0.5 * _LONGER * (lengths(half - first) + lengths(second - half)) + _MARGIN
        self._seen = model.world.snapshot
        self.free: Flags = check_edges(model, q, edges, step, marker, threads)

    def update(self) -> Ints:
        """Check again the edges that a change of the world since the last update may affect, and return their indices.

        The attribute `free` is updated for these edges.
        """
        old, new = self._seen, self._model.world.snapshot
        self._seen = new
        changed = _changed(old, new)
        carries = any(one.link is not None for snapshot in (old, new) for one in snapshot.objects.values())
        if changed and carries:  # `near` knows the robot's own shapes only
            near = np.ones(len(self._edges), dtype=np.bool_)
        else:
            near = np.zeros(len(self._edges), dtype=np.bool_)
            for one in changed:
                near |= self.near(one)
        again = np.flatnonzero(near)
        self.free[again] = check_edges(self._model, self._q, self._edges[again], self._step, self._marker, self._threads)
        return again

    def near(self, item: WorldObject) -> Flags:
        """Return whether the robot could touch the object `item` on each edge, (E,).

        The test is conservative: it may also return True for an edge on which no contact is possible. For each shape
        it computes the distance of the object from the shape's bounding ball at both ends of the edge. The result is True if, for a shape,
        the smaller distance is below half of the length of the path of the shape's centre. `item` must not be attached to a link.
        """
        found = np.zeros(len(self._edges), dtype=np.bool_)
        for middles, radius, half_path in zip(self._middles, self._bounds, self._half_paths, strict=True):
            gap = apart(middles, item) - radius
            found |= np.minimum(gap[self._edges[:, 0]], gap[self._edges[:, 1]]) < half_path
        return found


def apart(places: Array, item: WorldObject) -> Array:
    """Return the distances (N,) m of `places` (N, 3) m, root frame, from an object that is not attached to a link; 0 inside the object."""
    local = np.abs((places - item.position) @ item.rotation)
    size = item.size
    if item.kind == "box":
        return lengths(np.maximum(local - 0.5 * np.array(size), 0.0))
    if item.kind == "cylinder":
        beyond = np.stack([np.hypot(local[:, 0], local[:, 1]) - size[0], local[:, 2] - 0.5 * size[1]], axis=1)
        return lengths(np.maximum(beyond, 0.0))
    if item.kind == "capsule":
        local[:, 2] = np.maximum(local[:, 2] - 0.5 * size[1], 0.0)
    found: Array = np.maximum(lengths(local) - size[0], 0.0)
    return found


def _changed(old: Snapshot, new: Snapshot) -> list[WorldObject]:
    """Return the objects that can be touched and differ between two snapshots, in both versions."""
    found = []
    for here, there in ((old.objects, new.objects), (new.objects, old.objects)):
        for name, one in here.items():
            if one.role != "ghost" and there.get(name) is not one:
                found.append(one)
    return found
