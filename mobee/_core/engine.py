# SPDX-License-Identifier: Apache-2.0
"""Robots, scenes and evaluations; declares core/robot.cpp, scene.cpp, kinematics.cpp, evaluate.cpp and neighbours.cpp.

A `Handle` owns an object of the core: it frees the object, and keeps alive the objects to which that object refers.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, BYTES, INTEGER, REAL, address, function
from mobee._core.narrow import VOLUME
from mobee._core.tables import NUMBERS, REALS, ROW_BYTES

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

NO_NUMBERS, NO_REALS = np.empty((0, NUMBERS), dtype=np.int64), np.empty((0, REALS))
MANY = 128  # contacts for which a new room has space


class Handle:
    """The owner of an object of the core."""

    __slots__ = ("__weakref__", "_free", "_kept", "at")

    def __init__(self, at: int, free: Callable[[int], None], kept: object = None) -> None:
        self.at = at
        self._free = free
        self._kept = kept

    def __del__(self) -> None:
        self._free(self.at)


class _Memory:
    """An array allocated by the core; it is freed when no NumPy array uses it any more."""

    def __init__(self, at: int, shape: tuple[int, ...], kind: str) -> None:
        self.__array_interface__ = {"shape": shape, "typestr": kind, "data": (at, False), "version": 3}
        self._at = at

    def __del__(self) -> None:
        _rows_end(self._at)


def _rows(take: Callable[[int, int], None], at: int, count: int) -> tuple[Ints, Array]:
    """Return the contacts that an object of the core has computed, (count, NUMBERS) and (count, REALS)."""
    if count == 0:
        return NO_NUMBERS, NO_REALS
    arrays = (ADDRESS * 2)()
    take(at, ctypes.addressof(arrays))
    numbers, reals = _Memory(arrays[0] or 0, (count, NUMBERS), "<i8"), _Memory(arrays[1] or 0, (count, REALS), "<f8")
    return np.asarray(numbers), np.asarray(reals)


class _RobotTables(ctypes.Structure):
    """`RobotTables` of core/robot.cpp."""

    _fields_ = (
        *((name, INTEGER) for name in ("motors", "joints", "drives", "shapes", "own_shapes", "clusters", "corners", "edges")),
        *((name, ADDRESS) for name in ("parent", "slides", "border", "axis", "point", "motor", "scale", "offset")),
        *((name, ADDRESS) for name in ("volume", "link", "name", "field", "meets_world", "cluster", "tested")),
        *((name, ADDRESS) for name in ("corner", "edge_start", "edge", "travel")),
        ("least_lever", REAL),
    )


class _WorldTables(ctypes.Structure):
    """`WorldTables` of core/scene.cpp."""

    _fields_ = (
        *((name, INTEGER) for name in ("objects", "carried", "side")),
        *((name, ADDRESS) for name in ("volume", "role", "which")),
    )


class _Request(ctypes.Structure):
    """`Request` of core/evaluate.cpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("scene", "q", "torque")),
        *((name, INTEGER) for name in ("poses", "cut", "threads")),
        ("hands", INTEGER * 4),
    )


class _RequestOfOne(ctypes.Structure):
    """`RequestOfOne` of core/evaluate.cpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("room", "scene", "torque", "rows")),
        *((name, INTEGER) for name in ("most", "cut")),
        ("hands", INTEGER * 4),
    )


_robot_new = function("robot_new", ADDRESS, result=ADDRESS)
_robot_free = function("robot_free", ADDRESS)
_scene_new = function("scene_new", ADDRESS, ADDRESS, result=ADDRESS)
_scene_free = function("scene_free", ADDRESS)
_room_new = function("room_new", result=ADDRESS)
_room_free = function("room_free", ADDRESS)
_room_rows = function("room_rows", ADDRESS, ADDRESS)
_rows_end = function("rows_end", ADDRESS)
_evaluate = function("evaluate", ADDRESS, ADDRESS, result=INTEGER)
evaluate_one = function("evaluate_one", result=INTEGER)
"""Evaluate one pose, given `Room.asked` and the bytes of q (n,); returns the number of contacts. Undeclared arguments pass faster."""
_link_poses = function("link_poses", ADDRESS, BYTES, INTEGER, ADDRESS)
_jacobians = function("jacobians", ADDRESS, BYTES, INTEGER, INTEGER, BYTES, ADDRESS)
_neighbours_new = function("neighbours_new", REAL, INTEGER, result=ADDRESS)
_neighbours_free = function("neighbours_free", ADDRESS)
_neighbours_enter = function("neighbours_enter", ADDRESS, ADDRESS, ADDRESS)
_neighbours_rows = function("neighbours_rows", ADDRESS, ADDRESS)
_neighbours_state = function("neighbours_state", ADDRESS, ADDRESS)
_follow = function("follow", ADDRESS, BYTES, INTEGER, ADDRESS, result=INTEGER)
_sines_cosines = function("sines_cosines", ADDRESS, INTEGER, ADDRESS, ADDRESS)
_place = function("place", ADDRESS, ADDRESS, ADDRESS)
_scene_counts = function("scene_counts", ADDRESS, ADDRESS)
_scene_objects = function("scene_objects", ADDRESS, ADDRESS, ADDRESS, ADDRESS)
_span = function("span", REAL, REAL, REAL, INTEGER, ADDRESS)
_swung = function("swung", ADDRESS, ADDRESS, ADDRESS, ADDRESS)


def robot(numbers: Mapping[str, float], arrays: Mapping[str, NDArray[Any]]) -> Handle:
    """Return a robot of the core, made from tables that the core copies; see mobee/model/robot_tables.py."""
    tables = _RobotTables(**numbers, **{name: address(array) for name, array in arrays.items()})
    return Handle(_robot_new(ctypes.addressof(tables)), _robot_free)


def scene(of: Handle, volumes: NDArray[Any], roles: Ints, carried: Ints, side: int) -> Handle:
    """Return a scene of the core: a robot and the objects of a world.

    `volumes` and `roles`: of each object. `carried`: indices of the objects that the robot carries. `side`: number of grid cells along the
    longest side, see mobee/model/engine.py.
    """
    tables = _WorldTables(len(roles), len(carried), side, address(volumes), address(roles), address(carried))
    return Handle(_scene_new(of.at, ctypes.addressof(tables)), _scene_free, of)


def link_poses(of: Handle, q: Array, links: int) -> Array:
    """Return the transforms (B, L, 4, 4) of all links to the root frame, in the poses q (B, n) [rad]."""
    out = np.empty((len(q), links, 4, 4))
    _link_poses(of.at, q.tobytes(), len(q), address(out))
    return out


def jacobians(of: Handle, q: Array, link: int, point: Array) -> Array:
    """Return the Jacobians (B, 6, n) of a point of a link in the poses q (B, n) [rad]; `point` (3,) [m]: root frame, at zero pose."""
    out = np.empty((len(q), 6, q.shape[1]))
    _jacobians(of.at, q.tobytes(), len(q), link, point.tobytes(), address(out))
    return out


class Room:
    """The buffers of an evaluation; they are reused, since allocating memory takes longer than evaluating a pose."""

    __slots__ = ("_at", "_handle", "_request", "asked", "most", "rows", "torque")

    def __init__(self, motors: int) -> None:
        self._handle = Handle(_room_new(), _room_free)
        self._at = self._handle.at
        self.torque = np.empty(motors)
        """The projection of the contacts to the motors that `evaluate_one` writes, (n,)."""
        self._request = _RequestOfOne(room=self._at, torque=address(self.torque))
        self.asked = ctypes.byref(self._request)
        """The arguments of `evaluate_one`, see `ask`."""
        self.make_space(MANY)

    def evaluate(self, scene: Handle, q: Array, hands: Sequence[int], cut: bool, threads: int) -> tuple[Ints, Array, Array]:
        """Return the rows of all contacts in the poses q (B, n), (c, NUMBERS) and (c, REALS), and their projection to the motors (B, n).

        `hands`: the links that are reaching; targets do not repel them. `cut`: a contact acts only on the motors of its own part.
        """
        torque = np.empty(q.shape)
        request = _Request(scene.at, address(q), address(torque), len(q), cut, threads, (INTEGER * 4)(*hands))
        count = _evaluate(self._at, ctypes.addressof(request))
        return *_rows(_room_rows, self._at, count), torque

    def ask(self, scene: Handle, hands: Sequence[int], cut: bool) -> None:
        """Set the arguments of the next calls of `evaluate_one`, see `evaluate`; the caller keeps the scene alive."""
        self._request.scene, self._request.hands[:], self._request.cut = scene.at, hands, cut

    def make_space(self, most: int) -> None:
        """Allocate the buffer in which `evaluate_one` writes up to `most` contacts."""
        self.most, self.rows = most, bytearray(most * ROW_BYTES)
        self._request.most, self._request.rows = most, address(np.frombuffer(self.rows, dtype=np.uint8))


class Following:
    """A neighbour list of a robot in a scene, which is reused from pose to pose; for one thread at a time.

    `at` is the address of the list in the core, which a plant of the core uses. It is valid after `enter`, while this object exists.
    `skin`: distance [m] that volumes may move before the list is made again. `cut`: see `Room.evaluate`.
    """

    def __init__(self, skin: float, cut: bool) -> None:
        self._handle = Handle(_neighbours_new(skin, cut), _neighbours_free)
        self.at = self._handle.at
        self._scene: Handle | None = None

    def enter(self, scene: Handle, hands: Sequence[int]) -> None:
        """Set the scene and the reaching hands; targets do not repel these hands."""
        self._scene = scene  # before the core releases the last one, which has no other user
        numbers = (INTEGER * 4)(*hands)
        _neighbours_enter(self.at, scene.at, ctypes.addressof(numbers))

    def follow(self, q: Array) -> tuple[Ints, Array, Array]:
        """Return contacts and their projection to the motors as `Room.evaluate` does, for consecutive poses q (B, n) [rad]."""
        torque = np.empty(q.shape)
        count = _follow(self.at, q.tobytes(), len(q), address(torque))
        return *_rows(_neighbours_rows, self.at, count), torque

    def state(self) -> tuple[int, int, int]:
        """Return the list's state (0 empty, 1 pose, 2 list, 3 pose with outdated list), the pairs in it, and the poses it was used for."""
        found = np.empty(3, dtype=np.int64)
        _neighbours_state(self.at, address(found))
        remembered, listed, served = found.tolist()
        return remembered, listed, served


def sines_cosines(angles: Array) -> tuple[Array, Array]:
    """Return the sine and 1 - cosine of angles (n,) rad."""
    sines, cosines = np.empty(len(angles)), np.empty(len(angles))
    _sines_cosines(address(angles), len(angles), address(sines), address(cosines))
    return sines, cosines


def swung(of: Handle, then: Array, now: Array, shapes: int) -> Array:
    """Return bounds (S, L) m of how far each shape moves relative to each link, from the joint angles `then` (J,) to `now` (J,)."""
    out = np.empty((shapes, len(then) + 1))
    _swung(of.at, address(then), address(now), address(out))
    return out


def place(of: Handle, q: Array, shapes: int) -> NDArray[Any]:
    """Return all shapes (S,), `VOLUME` of mobee._core.narrow, at q (n,), in the order of the robot's tables."""
    out = np.zeros(shapes, dtype=VOLUME)
    _place(of.at, address(q), address(out))
    return out


class Grid(NamedTuple):
    """The grid of a scene, in which objects are sorted by cell; large objects come first."""

    large: int
    cells: tuple[int, ...]  # along x, y and z
    starts: Ints  # (cells + 1,)
    objects: Ints  # (objects, 2): index of each object in the world, and whether it is a target
    centers: Array  # (objects, 3) m


def grid_of(scene: Handle) -> Grid:
    """Return the grid of a scene."""
    counts = np.empty(5, dtype=np.int64)
    _scene_counts(scene.at, address(counts))
    objects, large, *cells = counts.tolist()
    starts, which, centers = np.empty(math.prod(cells) + 1, dtype=np.int64), np.empty((objects, 2), dtype=np.int64), np.empty((objects, 3))
    _scene_objects(scene.at, address(starts), address(which), address(centers))
    return Grid(large, tuple(cells), starts, which, centers)


def span(offset: float, along: float, per_metre: float, cells: int) -> tuple[int, int]:
    """Return the first cell that an object overlaps in a row of `cells` grid cells, and the cell after the last one.

    `offset`: of the object's centre from the start of the row [m]; `along`: half its size [m]; `per_metre`: cells in 1 m.
    """
    out = np.empty(2, dtype=np.int64)
    _span(offset, along, per_metre, cells, address(out))
    first, end = out.tolist()
    return first, end
