"""The reaches that are under way, as the compiled law reads them (see `reach_layout`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mobee.control import reach_layout as at
from mobee.control.layout import ACTIVE, I_ACTIVE
from mobee.errors import InvalidValue
from mobee.kinematics.tables import tables
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Array, Ints, Marker, Robot

if TYPE_CHECKING:
    from mobee.reach import ReachTarget

Integers = NDArray[np.int64]
Arrays = tuple[Integers, Integers, Integers, Array, Array, Array]


class PackedReaches:
    """One for each part that reaches; the law keeps its memory in their arrays."""

    __slots__ = ("_known", "_law", "_markers", "_robot", "arrays")

    def __init__(self, robot: Robot, law: Ints) -> None:
        """`law`: its integers, see `layout`."""
        self._robot, self._law = robot, law
        self._known: dict[tuple[str | None, str], Arrays] = {}  # by part and marker
        self._markers: dict[str | None, str] = {}  # of each part that reaches, None the whole body, in the order of the arrays' rows
        self.arrays: Arrays = self._stacked([])

    def __bool__(self) -> bool:
        return bool(self._markers)

    def begin(self, part: str | None, marker: str) -> None:
        """Let a part draw a marker, None: the whole body, to nowhere yet; its reach before is forgotten.

        Raises InvalidValue if none of its motors that may be moved moves the marker; UnknownName.
        """
        known = self._known.get((part, marker))
        if known is None:
            known = _packed(self._robot, part, self._robot.marker(marker), self._drawn(part, marker))
            self._known[part, marker] = known
        self.end(part)
        self._markers[part] = marker
        self.arrays = self._stacked([*self._rows(), known])

    def aim(self, part: str | None, target: ReachTarget) -> None:
        """Tell a part's reach where to."""
        row = list(self._markers).index(part)
        whole, real = self.arrays[0][row], self.arrays[3][row]
        whole[at.SURFACE], whole[at.TURNED] = target.aim == "surface", target.normal is not None
        real[at.TARGET : at.TARGET + 3], real[at.RADIUS] = target.position, target.radius
        real[at.WANTED : at.WANTED + 3] = 0.0 if target.normal is None else target.normal

    def end(self, part: str | None) -> None:
        """Forget a part's reach, if there is one."""
        if part in self._markers:
            rows = self._rows()
            del rows[list(self._markers).index(part)], self._markers[part]
            self.arrays = self._stacked(rows)

    def marker(self, part: str | None) -> str | None:
        """The marker that a part draws."""
        return self._markers.get(part)

    def _drawn(self, part: str | None, marker: str) -> Ints:
        """The motors of a part, or of the whole body, that may be moved and that move a marker."""
        robot, law = self._robot, self._law
        link, where = robot.marker(marker).link, slice(0, None) if part is None else robot.part(part).slice
        moving = np.zeros(len(robot.motors), dtype=bool)
        moving[law[law[I_ACTIVE] :][: law[ACTIVE]]] = True
        moving &= (robot.coupling[0][tables(robot).ancestry[link]] != 0.0).any(axis=0)
        motors: Ints = where.start + np.flatnonzero(moving[where])
        if not len(motors):
            who = "the robot" if part is None else part
            raise InvalidValue(f"{who} cannot reach with {marker} on {robot.links[link]}: none of the motors that it may move does")
        return motors

    def _rows(self) -> list[Arrays]:
        a, b, c, d, e, f = self.arrays
        return [(a[r], b[r], c[r], d[r], e[r], f[r]) for r in range(len(a))]

    def _stacked(self, rows: list[Arrays]) -> Arrays:
        """One reach a row, those with fewer joints or motors filled up."""
        count, n, drives = len(rows), len(self._robot.motors), _drives(self._robot)
        joints, tall = max((len(row[2]) for row in rows), default=0), max((len(row[5]) for row in rows), default=0)
        stacked = (
            np.zeros((count, at.WHOLE), dtype=np.int64),
            np.zeros((count, n), dtype=np.int64),
            np.zeros((count, joints, at.DRIVEN_BY + drives), dtype=np.int64),
            np.zeros((count, at.REAL)),
            np.zeros((count, joints, at.LINK + 2 * drives)),
            np.zeros((count, tall, n)),
        )
        for r, row in enumerate(rows):
            for whole, one in zip(stacked, row, strict=True):
                whole[r][tuple(slice(0, length) for length in one.shape)] = one
        return stacked


def _drives(robot: Robot) -> int:
    """The most motors that drive one joint."""
    return int((robot.coupling[0] != 0.0).sum(axis=1).max(initial=1))


def _packed(robot: Robot, part: str | None, marker: Marker, motors: Ints) -> Arrays:
    """The arrays of one reach, without a target."""
    links = tables(robot).ancestry[marker.link]
    matrix, offset = robot.coupling
    drives, n = _drives(robot), len(robot.motors)
    # The whole body is no part that begins with a motor: no part's action waits for its reach.
    first, stop = (-1, -1) if part is None else (robot.part(part).slice.start, robot.part(part).slice.stop)
    driven = np.zeros((len(links), at.DRIVEN_BY + drives), dtype=np.int64)
    chain = np.zeros((len(links), at.LINK + 2 * drives))
    chain[:, at.ANGLE] = np.nan  # no pose yet
    for k, j in enumerate(links):
        joint, by = robot.joints[j], np.flatnonzero(matrix[j])
        pulled = np.isin(by, motors)
        driven[k, at.SLIDES], driven[k, at.PULLED] = joint.kind == "prismatic", pulled.any()
        driven[k, at.DRIVEN_BY : at.DRIVEN_BY + len(by)] = by
        chain[k, at.AXIS : at.AXIS + 3], chain[k, at.PIVOT : at.PIVOT + 3], chain[k, at.OFFSET] = joint.axis, joint.point, offset[j]
        chain[k, at.LINK : at.LINK + len(by)] = matrix[j, by]
        chain[k, at.LINK + drives : at.LINK + drives + len(by)] = matrix[j, by] * motor_units(robot)[by] * pulled
    chain[:1, at.FRAME : at.FRAME + 9] = np.eye(3).ravel()
    used = 1 + int(np.flatnonzero(driven[:, at.PULLED])[-1])
    whole = np.array([first, stop, len(motors), len(links), used, 0, 0], dtype=np.int64)
    real = np.zeros(at.REAL)
    real[at.POINT : at.POINT + 3], real[at.NORMAL : at.NORMAL + 3] = marker.position, marker.normal
    return whole, np.pad(motors, (0, n - len(motors))).astype(np.int64), driven, real, chain, np.zeros((at.ROWS + len(motors), n))
