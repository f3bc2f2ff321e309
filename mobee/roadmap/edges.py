"""Which edges of a map are free: straight motions along which nothing touches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.engine import engine_of
from mobee.errors import InvalidValue
from mobee.model import Model
from mobee.roadmap.ik.solids import solid_model
from mobee.robot.robot import Array, Ints
from mobee.threads import checked_threads

STEP = 0.001  # m
SKIN = 0.04  # m: an edge moves a hand by a centimetre, and an elbow by more
_AT_ONCE = 4096  # poses

Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """`free` (E,): along which edges nothing touches; `poses`: how many were looked at for that, those at the ends included."""

    free: Flags
    poses: int


def check_edges(model: Model, q: Array, edges: Ints, step: float = STEP, marker: str | None = None, threads: int = 1) -> Flags:
    """Along which edges (E, 2) between poses q (V, n) rad nothing touches anything, (E,).

    Every vertex is looked at once.  Of each edge the middle comes first, and the first pose that touches is the last that is looked
    at; give each edge once, for it is the same in both directions.  Nearest to each other are edges in the order of a map's.

    Args:
        model: whose solids are felt, in its world as it is now.
        q: as of a Roadmap.
        edges: as of a Roadmap.
        step: how far the marker moves from one pose to the next, at most [m], along a straight line.
        marker: None: whatever shape of the robot moves farthest.
        threads: how many share the edges; the result is the same for any number.
    """
    return checked(model, q, edges, step, marker, threads).free


def checked(model: Model, q: Array, edges: Ints, step: float = STEP, marker: str | None = None, threads: int = 1) -> Checked:
    """What `check_edges` finds, and how many poses that took."""
    if not step > 0.0:
        raise InvalidValue(f"step {step} m: it must be above 0.")
    checked_threads(threads)
    solid = solid_model(model)
    vertices, ends = np.unique(edges, return_inverse=True)
    q, ends = np.ascontiguousarray(q[vertices], dtype=np.float64), ends.reshape(-1, 2)
    stands = np.ones(len(q), dtype=bool)
    for some in np.array_split(np.arange(len(q)), len(q) // _AT_ONCE + 1):
        stands[some] = np.asarray(solid.evaluate(q[some]).count) == 0
    free: Flags = stands[ends[:, 0]] & stands[ends[:, 1]]
    left = np.flatnonzero(free)
    poses = between(solid, q, ends[left], step, marker)
    free[left], looked = _sweep(solid, q, ends[left], poses, threads)
    return Checked(free, len(vertices) + looked)


def between(model: Model, q: Array, edges: Ints, step: float = STEP, marker: str | None = None) -> Ints:
    """How many poses there are between the ends of each edge (E, 2), (E,), when none of them is farther than a step from the next."""
    far = np.zeros(len(edges))
    places = points(model, q, marker)
    for place in places:
        far = np.maximum(far, np.linalg.norm(place[edges[:, 0]] - place[edges[:, 1]], axis=1))
    count: Ints = np.maximum(np.ceil(far / step) - 1.0, 0.0).astype(np.int64)
    return count


def points(model: Model, q: Array, marker: str | None = None) -> Array:
    """Where the marker is in poses q (V, n), (1, V, 3) m; None: where the middles of all shapes are that move with the motors."""
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


def _sweep(model: Model, q: Array, edges: Ints, poses: Ints, threads: int) -> tuple[Flags, int]:
    from mobee._core.edges import sweep  # loads the core: not before somebody asks
    from mobee.engine.track import Neighbours

    users = [Neighbours(engine_of(model.robot), SKIN) for _ in range(threads)]
    snapshot, hands = model.world.snapshot, model.hands
    return sweep([one.enter(snapshot, hands) for one in users], q, np.ascontiguousarray(edges, dtype=np.int64), poses)
