"""Edges that stay checked while the world changes: only those near what has changed are looked at again."""

from __future__ import annotations

import numpy as np

from mobee.collision.snapshot import Snapshot
from mobee.collision.world_object import WorldObject
from mobee.engine.volumes import bound
from mobee.model import Model
from mobee.roadmap.edges import STEP, Flags, check_edges, points
from mobee.roadmap.ik.solids import solid_model
from mobee.roadmap.ik.vectors import lengths
from mobee.robot.robot import Array, Ints

_LONGER = 1.1  # than the straight lines over the middle is the way of a shape, at most: its motors turn by no more than about 1 rad
_MARGIN = 1e-6  # m


class EdgeWatch:
    """Which edges (E, 2) between poses q (V, n) rad are free, `free` (E,), in the world of the last `update`.

    `step`, `marker`, `threads`: as of `check_edges`.
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
        self._half_ways = 0.5 * _LONGER * (lengths(half - first) + lengths(second - half)) + _MARGIN
        self._seen, self._reaching = model.world.snapshot, model.reaching
        self.free: Flags = check_edges(model, q, edges, step, marker, threads)

    def update(self) -> Ints:
        """Check again what may be free no more, or again, in the world as it is now; returns the indices of those edges."""
        old, new = self._seen, self._model.world.snapshot
        self._seen = new
        changed = _changed(old, new, self._reaching != self._model.reaching)
        self._reaching = self._model.reaching
        if any(one.link is not None for one in changed):
            near = np.ones(len(self._edges), dtype=np.bool_)
        else:
            near = np.zeros(len(self._edges), dtype=np.bool_)
            for one in changed:
                near |= self.near(one)
        again = np.flatnonzero(near)
        self.free[again] = check_edges(self._model, self._q, self._edges[again], self._step, self._marker, self._threads)
        return again

    def near(self, thing: WorldObject) -> Flags:
        """Along which edges the robot may come to touch an object, (E,); along the others it cannot.

        A shape on its way is never farther from both of its ends than half of that way.
        """
        found = np.zeros(len(self._edges), dtype=np.bool_)
        for middles, radius, ways in zip(self._middles, self._bounds, self._half_ways, strict=True):
            gap = apart(middles, thing) - radius
            found |= np.minimum(gap[self._edges[:, 0]], gap[self._edges[:, 1]]) < ways
        return found


def apart(places: Array, thing: WorldObject) -> Array:
    """How far places (N, 3) are from a free object, (N,) m, 0 within it."""
    local = np.abs((places - thing.position) @ thing.rotation)
    size = thing.size
    if thing.kind == "box":
        return lengths(np.maximum(local - 0.5 * np.array(size), 0.0))
    if thing.kind == "cylinder":
        beyond = np.stack([np.hypot(local[:, 0], local[:, 1]) - size[0], local[:, 2] - 0.5 * size[1]], axis=1)
        return lengths(np.maximum(beyond, 0.0))
    if thing.kind == "capsule":
        local[:, 2] = np.maximum(local[:, 2] - 0.5 * size[1], 0.0)
    found: Array = np.maximum(lengths(local) - size[0], 0.0)
    return found


def _changed(old: Snapshot, new: Snapshot, targets_too: bool) -> list[WorldObject]:
    """Objects that can be touched as they were and as they are, where the two differ; `targets_too`: the targets in any case."""
    found = []
    for here, there in ((old.objects, new.objects), (new.objects, old.objects)):
        for name, one in here.items():
            if one.role != "ghost" and (there.get(name) is not one or (targets_too and one.role == "target")):
                found.append(one)
    return found
