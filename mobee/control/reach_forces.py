# SPDX-License-Identifier: Apache-2.0
"""Forces with which a controller pulls markers to targets (thesis 8.2); the formulas are in core/reach.cpp and core/reach_pull.cpp."""

from __future__ import annotations

import ctypes

import numpy as np

from mobee._core import Table, address, view
from mobee._core import law as core
from mobee.arrays import Array, Ints
from mobee.control.law import Law
from mobee.errors import InvalidValue
from mobee.model.kinematics import tables
from mobee.reach import ReachTarget
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Marker, Robot

Chain = tuple[int, Marker, Table, Table, Table]
"""The arguments of `ReachForce` for one part and one marker: part, marker, joints, drives and motors, as its constructor describes them."""


class ReachForce:
    """One reach in progress: a force that pulls a marker to a target. Its state is in the compiled core."""

    def __init__(self, part: int, marker: Marker, joints: Table, drives: Table, motors: Table) -> None:
        """Begin a reach without a target.

        `part`: index of the first motor of the part; -1: the whole body. `joints`, `drives`, `motors`: tables with the columns JOINT, DRIVE
        and PULLED of `mobee._core.law`, for the chain from the base to the marker; joints and motors are copied, because the core changes
        them.
        """
        self.marker = marker.name
        self.joints, self.motors = joints.copy(), motors.copy()
        self._drives, self._curvature = drives, np.zeros((len(motors), len(motors)))
        self.struct = core.Reach(
            part=part, joint_count=1 + int(np.flatnonzero(joints["pulled"])[-1]),  # joints up to the last that a pulled motor drives
            joints=view(self.joints), drives=view(self._drives), motors=view(self.motors),
            curvature=address(self._curvature), point=tuple(marker.position), normal=tuple(marker.normal),
        )  # fmt: skip
        self.address = ctypes.addressof(self.struct)

    def aim(self, target: ReachTarget) -> None:
        """Set the target of the reach, or replace it."""
        self.struct.to_surface, self.struct.faces_target = target.aim == "surface", target.faces
        self.struct.turns_normal = target.faces or target.normal is not None
        self.struct.target[:], self.struct.radius = target.position.tolist(), target.radius
        self.struct.target_normal[:] = [0.0] * 3 if target.normal is None else target.normal.tolist()


class ReachForces:
    """The reaches in progress, forces that pull markers to targets: at most one for each part, and at most one for the whole body.

    In all methods, the part None means the reach of the whole body.
    """

    __slots__ = ("_addresses", "_chains", "_core", "_law", "_robot", "_under_way", "address")

    def __init__(self, robot: Robot, law: Law) -> None:
        self._robot, self._law = robot, law
        self._chains: dict[tuple[str | None, str], Chain] = {}  # by part and marker
        self._under_way: dict[str | None, ReachForce] = {}  # by part, None the whole body
        self._core = core.calls()
        self._list()

    def __len__(self) -> int:
        return len(self._under_way)

    def __getitem__(self, part: str | None) -> ReachForce:
        return self._under_way[part]

    @property
    def markers(self) -> tuple[str, ...]:
        """The names of the markers that are pulled at present, without repetition."""
        return tuple(dict.fromkeys(reaching.marker for reaching in self._under_way.values()))

    def begin(self, part: str | None, marker: str) -> None:
        """Begin a reach of a part (None: of the whole body): a force that will pull a marker. It has no target yet (see `ReachForce.aim`).

        A reach of the part that is in progress is replaced.
        Raises UnknownName for an unknown part or marker, InvalidValue if the marker is moved by none of the motors that may move.
        """
        if (part, marker) not in self._chains:
            self._chains[part, marker] = _chain(self._robot, part, marker, self._drawn(part, marker))
        self._under_way.pop(part, None)
        self._under_way[part] = ReachForce(*self._chains[part, marker])
        self._list()

    def end(self, part: str | None) -> None:
        """End the reach of a part (None: of the whole body), if there is one."""
        if self._under_way.pop(part, None) is not None:
            self._list()

    def marker(self, part: str | None) -> str | None:
        """Return the name of the marker with which a part (None: the whole body) reaches; None if there is no such reach."""
        reaching = self._under_way.get(part)
        return None if reaching is None else reaching.marker

    def add_forces(self, q: Array, attractor: Array, dt: float, total: Array) -> None:
        """Add the forces of all reaches at the measured q (n,) rad to `total`, in place.

        `attractor`: (n,) rad, q* of the control law, the posture to which its springs pull the motors; a reach cancels these springs for
        the motors that it moves (not with the gains of 2014). `dt`: time since the last tick [s]. `total`: (n,) rad/s^2, at the call the
        sum of all other forces; these springs and the damping are not in it, because `Law.step` adds them later.
        """
        copy = q.copy()
        self._core.add_reaches(self._law.address, self.address, len(self), address(copy), attractor.tobytes(), dt, address(total))

    def is_approaching(self, part: str | None) -> bool:
        """Return whether the reach of a part (None: of the whole body) still moves its marker nearer to the target.

        Always False without a reach, and with the gains of 2014 (`Gains.published_2014`).
        """
        return bool(self._core.reach_is_approaching(self._law.address, self.address, len(self), _first(self._robot, part)))

    def _list(self) -> None:
        """Update the addresses of the reaches under way, which the core reads."""
        self._addresses = np.array([reaching.address for reaching in self._under_way.values()], dtype=np.int64)
        self.address = address(self._addresses)

    def _drawn(self, part: str | None, marker: str) -> Ints:
        """Return the motors of a part, or of the whole body, that may be moved and move a marker."""
        robot = self._robot
        link, where = robot.marker(marker).link, slice(0, None) if part is None else robot.part(part).slice
        moving = np.zeros(len(robot.motors), dtype=bool)
        moving[self._law.active] = True
        moving &= (robot.coupling[0][tables(robot).ancestry[link]] != 0.0).any(axis=0)
        motors: Ints = where.start + np.flatnonzero(moving[where])
        if not len(motors):
            raise InvalidValue(
                f"{part or 'the robot'} cannot reach with {marker} on {robot.links[link]}: none of the motors that it may move does"
            )
        return motors


def _first(robot: Robot, part: str | None) -> int:
    """Return the number of the first motor of a part, by which the core identifies the part; -1 for None (the whole body).

    An action of a part that has settled waits for the reach of this part while its marker still approaches the target. No action waits for
    a reach of the whole body, because -1 is the number of no motor.
    """
    return -1 if part is None else robot.part(part).start


def _chain(robot: Robot, part: str | None, marker: str, motors: Ints) -> Chain:
    """Return the tables of the chain of joints from the base to a marker, restricted to these motors."""
    placed, (matrix, offset), units = robot.marker(marker), robot.coupling, motor_units(robot)
    links = tables(robot).ancestry[placed.link]
    number = {int(motor): k for k, motor in enumerate(motors)}
    joints: Table = np.zeros(len(links), dtype=core.JOINT)
    joints["angle"] = np.nan  # no pose computed yet
    joints["frame"][:1] = np.eye(3)
    drives = list[tuple[int, int, float, float]]()
    for row, j in zip(joints, links, strict=True):
        joint, by = robot.joints[j], np.flatnonzero(matrix[j])
        row["slides"], row["pulled"] = joint.kind == "prismatic", np.isin(by, motors).any()
        row["axis"], row["pivot"], row["offset"] = joint.axis, joint.point, offset[j]
        row["drives"] = len(drives), len(drives) + len(by)
        drives += [(int(m), number.get(int(m), -1), matrix[j, m], matrix[j, m] * units[m] * (int(m) in number)) for m in by]
    pulled: Table = np.zeros(len(motors), dtype=core.PULLED)
    pulled["motor"] = motors
    return _first(robot, part), placed, joints, np.array(drives, dtype=core.DRIVE), pulled
