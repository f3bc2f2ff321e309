"""Evaluating poses that follow each other closely, as while the robot moves."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mobee.collision.contact import ContactTable
from mobee.collision.snapshot import Snapshot
from mobee.engine.evaluate import settle
from mobee.engine.layout import CAPSULE, ROW, ROW_BOUND, ROW_HALF, ROW_KIND, ROW_POSITION, SLOT
from mobee.engine.memory import HEADER, sizes
from mobee.engine.neighbours import EMPTY, LIST, PAUSE, RENEW, SERVED, STATE, WORTH, Around, follow
from mobee.engine.numba_engine import Engine
from mobee.engine.pack import CLUSTERS, F_AXIS, F_POINT, F_REACH, F_ROW, I_LINK, I_PARENT, JOINTS, LINKS, SHAPES, Flags, Packed, UInts
from mobee.engine.room import at_least
from mobee.engine.scene import COUNT, W_COLUMNS, WIDEST, Scene
from mobee.robot.robot import Array, Ints

if TYPE_CHECKING:
    from mobee.pose import Pose


class Neighbours:
    """Finds the contacts of one robot pose after pose, with a list of the pairs nearer than the skin [m]."""

    def __init__(self, engine: Engine, skin: float) -> None:
        self._engine = engine
        self._skin = skin
        self._known: tuple[Scene | None, int] = None, -1
        self._packed: Packed | None = None
        self._wide = self._wide_places = self._floats = self._slots = np.empty(0)
        self._pairs: UInts = np.empty(0, dtype=np.uint64)
        self._common: UInts = np.empty(0, dtype=np.uint64)
        self._ints: Ints = np.zeros(HEADER, dtype=np.int64)
        self._flags: Flags = np.empty(0, dtype=np.bool_)

    def contacts(self, q: Array, snapshot: Snapshot, reaching: int) -> tuple[ContactTable, Array]:
        """What `Engine.contacts` gives for the poses q (B, n), one after the other."""
        scene, memory = self.scene(snapshot, reaching), self.memory
        numbers, reals, torque = follow(*scene, q, *memory)
        return self._engine.table(snapshot, numbers, reals), torque

    def scene(self, snapshot: Snapshot, reaching: int, cut: bool = False) -> Around:
        """What `follow` takes before the poses; what is remembered of another world is forgotten.  `cut`: see `project`."""
        here = self._engine.scene_of(snapshot)
        if self._known[0] is not here or self._known[1] != reaching:
            self._begin(here, reaching)
        packed, own = here.packed, len(self._engine.robot.shapes)
        return Around(
            packed.integers, packed.floats, self._wide, packed.vertices, here.integers, here.floats, self._wide_places, here.carried,
            own, reaching, self._skin, cut, self._common, self._slots,
        )  # fmt: skip

    @property
    def memory(self) -> tuple[Array, UInts, Ints, Flags]:
        """What `follow` takes behind the poses, after `scene`."""
        return self._floats, self._pairs, self._ints, self._flags

    def _begin(self, here: Scene, reaching: int) -> None:
        """Forget the list; the world, what is carried, or who reaches, is another."""
        packed, header = here.packed, here.packed.integers
        if self._packed is not packed:
            self._packed, self._wide, self._common = packed, _widened(packed, self._skin), _common(packed)
        objects, count = int(here.integers[COUNT]), len(packed.order)
        self._wide_places = here.floats.copy()
        self._wide_places[WIDEST] += self._skin
        self._wide_places[W_COLUMNS + 3 * objects :] += self._skin
        was_of_use = self._ints[STATE] == LIST and self._ints[SERVED] >= WORTH
        floats, pairs, ints, flags = sizes(int(header[JOINTS]), int(header[LINKS]), count, int(header[CLUSTERS]), objects)
        self._floats = at_least(self._floats, floats)
        self._pairs = at_least(self._pairs, pairs)
        self._ints = at_least(self._ints, ints)
        self._flags = at_least(self._flags, flags)
        self._slots = at_least(self._slots, (count + objects) * SLOT)
        settle(header, packed.floats, here.integers, here.rows, self._slots)
        self._ints[STATE] = RENEW if was_of_use else EMPTY
        self._ints[PAUSE] = 0 if was_of_use or self._known[0] is None else WORTH  # a world in motion outdates its lists
        self._known = here, reaching


class Track:
    """Evaluates poses of one model that follow each other closely: the same results as `Model.evaluate`, sooner.

    Pairs that cannot touch before something has moved by half the skin are not looked at again.  Cheap to make; not for two
    threads at once: each user has its own.  Where the steps are large it is as fast as `Model.evaluate`.
    """

    def __init__(self, evaluate: Callable[[ArrayLike], Pose], engine: object, skin: float) -> None:
        self._evaluate = evaluate
        self._neighbours = Neighbours(engine, skin) if isinstance(engine, Engine) else None

    def evaluate(self, q: ArrayLike) -> Pose:
        """The pose at q (n,), or the poses along a path (..., n) rad in this order; raises InvalidValue as `Model.evaluate` does.

        The contacts are found at once, not when they are asked for.
        """
        pose = self._evaluate(q)
        if self._neighbours is not None:
            pose.feel(self._neighbours)
        return pose


def _widened(packed: Packed, skin: float) -> Array:
    """The floats of a packed robot with pairs that reach farther by the skin, and behind them what `follow` says."""
    shapes, joints = int(packed.integers[SHAPES]), int(packed.integers[JOINTS])
    rows = _table(packed, F_ROW, shapes, ROW)
    bound = rows[:, ROW_BOUND]
    wide = packed.floats.copy()
    reach = int(packed.integers[F_REACH])
    tested = wide[reach : reach + shapes * shapes].reshape(shapes, shapes)
    tested[tested >= 0.0] = ((bound[:, None] + bound + skin) ** 2)[tested >= 0.0]
    link, parent = _indices(packed, I_LINK, shapes), _indices(packed, I_PARENT, joints)
    at = _joints_at(_table(packed, F_AXIS, joints, 3), _table(packed, F_POINT, joints, 3), parent)
    spans = np.linalg.norm(at[1:] - at[parent], axis=1)
    core = np.where(rows[:, ROW_KIND] <= CAPSULE, bound - rows[:, ROW_HALF], bound)
    levers = np.linalg.norm(rows[:, ROW_POSITION : ROW_POSITION + 3] - at[link], axis=1) + core
    return np.concatenate([wide, spans, levers])


def _joints_at(axis: Array, point: Array, parent: Ints) -> Array:
    """For every link a point on the axis of its joint, the nearest to the one before, (L, 3) at zero pose; the base's is its origin."""
    at = np.zeros((len(axis) + 1, 3))
    for j, before in enumerate(parent):
        at[j + 1] = point[j] + ((at[before] - point[j]) @ axis[j]) * axis[j]
    return at


@lru_cache(maxsize=8)
def _common(packed: Packed) -> UInts:
    """The last link that carries both of two links, (L L,)."""
    links = int(packed.integers[LINKS])
    parent = _indices(packed, I_PARENT, links - 1)
    carriers = [[0]]
    for j, before in enumerate(parent):
        carriers.append([*carriers[before], j + 1])
    last = [[max(set(one).intersection(two)) for two in carriers] for one in carriers]
    return np.array(last, dtype=np.uint64).ravel()


def _table(packed: Packed, where: int, rows: int, columns: int) -> Array:
    start = int(packed.integers[where])
    return packed.floats[start : start + rows * columns].reshape(rows, columns)


def _indices(packed: Packed, where: int, count: int) -> Ints:
    start = int(packed.integers[where])
    found: Ints = packed.integers[start : start + count].astype(np.intp)
    return found
