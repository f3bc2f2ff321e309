# SPDX-License-Identifier: Apache-2.0
"""Robots, scenes and evaluations: the functions of core/robot.cpp, scene.cpp, kinematics.cpp, evaluate.cpp and neighbours.cpp.

A `Handle` owns an object of the core: it frees the object, and keeps alive the objects to which that object refers.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, BYTES, INTEGER, NUMBERS, REAL, REALS, ROW_BYTES, address, function
from mobee._core.narrow import VOLUME

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

NO_NUMBERS, NO_REALS = np.empty((0, NUMBERS), dtype=np.int64), np.empty((0, REALS))
MANY = 128  # contacts for which a new room has space


class Handle:
    """The owner of an object of the core: it frees the core's object when it is deleted itself.

    `at`: memory address of the core's object. `free`: function that frees it, given the address. `kept`: an object that must live as long,
    because the core's object refers to its memory.
    """

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
    """Return the contacts that an object of the core has computed: their integers (count, NUMBERS), and their reals (count, REALS).

    `take`: function of the core that moves the two arrays to the caller. `at`: address of the object. `count`: number of contacts.
    """
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
"""Evaluate one pose in the compiled core and return the number of its contacts. Arguments: `Room.asked`, and the pose q (n,) rad as bytes
of float64. The contacts are written into `Room.rows`, unless there are more than `Room.most`. The projection of the contacts to the motors
is written into `Room.torque`. The argument types are not declared, because this is faster."""
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
    """Make a robot in the compiled core from tables, which the core copies; return the handle that owns the robot.

    `numbers`, `arrays`: the single numbers and the arrays of the tables, by name, as `mobee.model.core_tables.RobotTables.for_core`
    returns them.
    """
    tables = _RobotTables(**numbers, **{name: address(array) for name, array in arrays.items()})
    return Handle(_robot_new(ctypes.addressof(tables)), _robot_free)


def scene(of: Handle, volumes: NDArray[Any], roles: Ints, carried: Ints, side: int) -> Handle:
    """Make a scene in the compiled core, that is, a robot and the objects of a world; return the handle that owns the scene.

    `of`: handle of the robot. `volumes` (N,) and `roles` (N,): volume and role of each object of the world, as in
    `mobee.model.engine.Snapshot`. `carried`: indices of the objects that the robot carries. `side`: number of cells along the longest
    side of the grid into which the core sorts the obstacles and targets that the robot does not carry.
    """
    tables = _WorldTables(len(roles), len(carried), side, address(volumes), address(roles), address(carried))
    return Handle(_scene_new(of.at, ctypes.addressof(tables)), _scene_free, of)


def link_poses(of: Handle, q: Array, links: int) -> Array:
    """Return the transforms (B, L, 4, 4) of all links in the poses q (B, n) rad, root frame.

    A transform maps a point's position at zero pose to its position at q. `of`: handle of the robot. `links`: the number L of links.
    """
    out = np.empty((len(q), links, 4, 4))
    _link_poses(of.at, q.tobytes(), len(q), address(out))
    return out


def jacobians(of: Handle, q: Array, link: int, point: Array) -> Array:
    """Return the Jacobians (B, 6, n) of a point that is fixed to a link, in the poses q (B, n) rad: linear rows, then angular, root frame.

    `of`: handle of the robot. `link`: index of the link. `point` (3,) m: position of the point in the root frame at zero pose.
    """
    out = np.empty((len(q), 6, q.shape[1]))
    _jacobians(of.at, q.tobytes(), len(q), link, point.tobytes(), address(out))
    return out


class Room:
    """Buffers in which the core (the compiled library) evaluates poses, that is, finds their contacts; for one thread at a time.

    They are reused, because to allocate them takes longer than to evaluate a pose. `motors`: the number n of motors. To evaluate many
    poses, call `evaluate`. To evaluate one pose, call `ask`, then the function `evaluate_one` of this module, which uses four attributes.

    `asked`: pointer to the inputs of `evaluate_one` except the pose: scene, reaching hands and `cut` (set by `ask`), and the addresses of
    the buffers. `rows`: buffer for c contacts: the integers of all contacts, (c, 6) int64, then their real numbers, (c, 7) float64; the
    columns are those of `mobee.model.contact.ContactTable`. `most`: number of contacts for which `rows` has space. `torque`: (n,) m^2/rad,
    buffer for the projection of the contacts to the motors: the sum of J^T (depth * normal) over the contacts of fields (volumes that cause
    repulsive forces), as in `evaluate`. It is not yet in the unit of a torque: the control law multiplies it by the gain `contact_gain`.
    """

    __slots__ = ("_at", "_handle", "_request", "asked", "most", "rows", "torque")

    def __init__(self, motors: int) -> None:
        self._handle = Handle(_room_new(), _room_free)
        self._at = self._handle.at
        self.torque = np.empty(motors)
        """The projection of the contacts of fields to the motors, (n,) m^2/rad, into which `evaluate_one` writes."""
        self._request = _RequestOfOne(room=self._at, torque=address(self.torque))
        self.asked = ctypes.byref(self._request)
        """Pointer to the inputs of `evaluate_one`, its first argument: scene, hands and `cut` (set by `ask`), addresses of the buffers."""
        self.make_space(MANY)

    def evaluate(self, scene: Handle, q: Array, hands: Sequence[int], cut: bool, threads: int) -> tuple[Ints, Array, Array]:
        """Return the contacts in the poses q (B, n) rad, and their projection to the motors, (B, n) m^2/rad.

        The contacts are two arrays: numbers (c, 6) and reals (c, 7), the columns of `mobee.model.contact.ContactTable`. The projection is
        the sum of J^T (depth * normal) over the contacts of fields; J is the Jacobian of the contact's point. A field is a volume that
        causes a repulsive force. `scene`: handle of the scene. `hands`: up to two reaching hands as four link indices, two for each hand,
        as `mobee.model.engine.hand_numbers` returns them; their contacts with targets are ignored. `cut`: True: a contact acts only on
        the motors of the part that touches, as in the MoBeE program of 2014; False: also on the motors nearer to the base. `threads`:
        number of threads.
        """
        torque = np.empty(q.shape)
        request = _Request(scene.at, address(q), address(torque), len(q), cut, threads, (INTEGER * 4)(*hands))
        count = _evaluate(self._at, ctypes.addressof(request))
        return *_rows(_room_rows, self._at, count), torque

    def ask(self, scene: Handle, hands: Sequence[int], cut: bool) -> None:
        """Set the scene, the reaching hands and `cut` for the next calls of `evaluate_one`.

        `scene`: handle of the scene; the caller keeps it alive. `hands`: up to two hands as four link indices, two for each hand, as
        `mobee.model.engine.hand_numbers` returns them; their contacts with targets are ignored. `cut`: True: a contact acts only on the
        motors of the touching link's own part; False: also on the motors nearer to the base.
        """
        self._request.scene, self._request.hands[:], self._request.cut = scene.at, hands, cut

    def make_space(self, most: int) -> None:
        """Allocate a new buffer `rows`, into which `evaluate_one` writes up to `most` contacts."""
        self.most, self.rows = most, bytearray(most * ROW_BYTES)
        self._request.most, self._request.rows = most, address(np.frombuffer(self.rows, dtype=np.uint8))


class Following:
    """A neighbour list of a robot in a scene: the pairs of volumes that are near each other in consecutive poses; for one thread at a time.

    `skin`: a distance [m]; pairs nearer than this are in the list. The list is no longer valid when two volumes may have approached each
    other by this distance. `cut`: True: a contact acts only on the motors of the touching link's own part; False: also on the motors nearer
    to the base. `at`: memory address of the list in the core, for a simulated robot that runs in the core (`Plant` of core/plant.cpp); it
    may be used after the first `enter`, while this object exists.
    """

    def __init__(self, skin: float, cut: bool) -> None:
        self._handle = Handle(_neighbours_new(skin, cut), _neighbours_free)
        self.at = self._handle.at
        self._scene: Handle | None = None

    def enter(self, scene: Handle, hands: Sequence[int]) -> None:
        """Set the scene and the reaching hands for the poses that are evaluated next.

        `scene`: handle of the scene, which is kept alive. `hands`: up to two hands as four link indices, two for each hand, as
        `mobee.model.engine.hand_numbers` returns them; their contacts with targets are ignored.
        """
        self._scene = scene  # before the core releases the last one, which has no other user
        numbers = (INTEGER * 4)(*hands)
        _neighbours_enter(self.at, scene.at, ctypes.addressof(numbers))

    def follow(self, q: Array) -> tuple[Ints, Array, Array]:
        """Return the contacts in the consecutive poses q (B, n) rad, and their projection to the motors, (B, n) m^2/rad.

        The contacts are two arrays: numbers (c, 6) and reals (c, 7), the columns of `mobee.model.contact.ContactTable`. The projection is
        the sum of J^T (depth * normal) over the contacts of fields; J is the Jacobian of the contact's point. A field is a volume that
        causes a repulsive force.
        """
        torque = np.empty(q.shape)
        count = _follow(self.at, q.tobytes(), len(q), address(torque))
        return *_rows(_neighbours_rows, self.at, count), torque

    def state(self) -> tuple[int, int, int]:
        """Return three numbers, for tests: a state, the number of pairs of volumes in the neighbour list, and how many poses used the list.

        States: 0: nothing is stored; 1: only the last pose is stored; 2: the neighbour list is stored; 3: the world or the reaching hands
        changed after a list had been used for at least 4 poses, and a new list is made in the next pose.
        """
        found = np.empty(3, dtype=np.int64)
        _neighbours_state(self.at, address(found))
        remembered, listed, served = found.tolist()
        return remembered, listed, served


def sines_cosines(angles: Array) -> tuple[Array, Array]:
    """Return the sine and 1 - cosine of angles (n,) rad, two arrays (n,), as the core computes them."""
    sines, cosines = np.empty(len(angles)), np.empty(len(angles))
    _sines_cosines(address(angles), len(angles), address(sines), address(cosines))
    return sines, cosines


def swung(of: Handle, then: Array, now: Array, shapes: int) -> Array:
    """Return upper bounds (S, L) m of the motion of each shape between two poses, for tests.

    Rows are the S shapes, in the order of the robot's tables; columns are the L links. Column k bounds the motion of the shape relative to
    the last common ancestor of its link and link k in the kinematic tree (one of the two, if it carries the other). `of`: handle of the
    robot. `then`, `now`: (J,) rad or m, positions of all J = L - 1 joints in the two poses. `shapes`: the number S of shapes.
    """
    out = np.empty((shapes, len(then) + 1))
    _swung(of.at, address(then), address(now), address(out))
    return out


def place(of: Handle, q: Array, shapes: int) -> NDArray[Any]:
    """Return all shapes of a robot at q (n,) rad, (S,) rows of `mobee._core.narrow.VOLUME`, in the order of the robot's tables.

    The volumes are in the root frame. `of`: handle of the robot. `shapes`: the number S of shapes.
    """
    out = np.zeros(shapes, dtype=VOLUME)
    _place(of.at, address(q), address(out))
    return out


class Grid(NamedTuple):
    """The grid of cells by which the compiled core sorts world objects of a scene to find contacts.

    The grid contains the obstacles and targets that the robot does not carry. `large`: number of large objects, which are in no cell.
    `cells`: number of cells along x, y and z. `objects`: (N, 2), the large objects first, then those of each cell: index in the world, and
    1 for a target, else 0. `starts`: (number of cells + 1,): the objects of cell k are the rows starts[k] to starts[k + 1] - 1 of
    `objects`. `centers`: (N, 3) m, root frame, of the objects in the rows of `objects`.
    """

    large: int
    cells: tuple[int, ...]
    starts: Ints
    objects: Ints
    centers: Array


def grid_of(scene: Handle) -> Grid:
    """Return the grid of cells by which the compiled core sorts world objects of a scene to find contacts; only for tests.

    The grid contains the obstacles and targets that the robot does not carry. `scene`: handle of the scene in the core.
    """
    counts = np.empty(5, dtype=np.int64)
    _scene_counts(scene.at, address(counts))
    objects, large, *cells = counts.tolist()
    starts, which, centers = np.empty(math.prod(cells) + 1, dtype=np.int64), np.empty((objects, 2), dtype=np.int64), np.empty((objects, 3))
    _scene_objects(scene.at, address(starts), address(which), address(centers))
    return Grid(large, tuple(cells), starts, which, centers)


def span(offset: float, along: float, per_metre: float, cells: int) -> tuple[int, int]:
    """Return the index of the first cell that an object overlaps in a row of `cells` grid cells, and the index after the last such cell.

    `offset`: distance of the object's centre from the start of the row [m]; `along`: half the object's size [m]; `per_metre`: cells in 1 m.
    """
    out = np.empty(2, dtype=np.int64)
    _span(offset, along, per_metre, cells, address(out))
    first, end = out.tolist()
    return first, end
