# SPDX-License-Identifier: Apache-2.0
"""Actions and reaches in progress on an offline plant (a robot simulated in one process), and their outcomes.

An action sets the attractor of a part (the position to which the control law's spring pulls its motors); in a reach a force pulls a marker
to a target. Both end when the part has settled or timed out.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mobee._core import Table
from mobee._core.plant import PART
from mobee.arrays import Array, real_array
from mobee.control.gains import VERDICTS
from mobee.errors import InvalidValue
from mobee.model.world_object import sphere
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachOutcome, ReachTarget, checked_target
from mobee.robot.motor_units import unit_name
from mobee.robot.robot import Robot

_FLOAT = np.dtype(np.float64)


_SETTLED = VERDICTS.index("settled")


class Actions:
    """The state of the present or last action of each part (group of motors) of a plant (simulated robot).

    `parts`: a table with a row for each part (`mobee._core.plant.PART`); the compiled core changes it in every tick of the plant.

    Args:
        robot: the robot.
        alive: (n,) whether each motor is active, that is, may move; a part without active motors cannot act.
    """

    __slots__ = ("_alive", "_limits", "_next_check", "_parts", "_robot", "_row", "_start", "_under_way", "_verdict", "parts")

    def __init__(self, robot: Robot, alive: NDArray[np.bool_]) -> None:
        self._robot = robot
        self._parts, self._row = robot.parts, {name: row for row, name in enumerate(robot.parts)}
        self._alive = {name: bool(alive[part.slice].any()) for name, part in robot.parts.items()}
        self._limits = {name: robot.limits[part.slice].tolist() for name, part in robot.parts.items()}
        self.parts: Table = np.zeros(len(self._row), dtype=PART)
        self.parts["motors"] = [(part.start, part.start + len(part)) for part in robot.parts.values()]
        self._start, self._next_check = self.parts["start"], self.parts["next_check"]
        self._under_way, self._verdict = self.parts["under_way"], self.parts["verdict"]

    @property
    def under_way(self) -> tuple[str, ...]:
        """The names of the parts whose action has not ended yet, in the robot's order."""
        return tuple(compress(self._parts, self._under_way.tolist()))

    def require_possible(self, part: str, target: Array) -> None:
        """Check a target (n_part,) of a part, rad or, for motors that slide, m.

        Raises InvalidValue if no motor of the part is active, or if the target is beyond the limits.

        The values of a target with a wrong shape are not checked; `Controller.set_attractor` refuses such a target.
        """
        if not self._alive[part]:
            raise InvalidValue(f"{part} cannot act: none of its motors is active in this plant; name it in active=[...]")
        values = target if type(target) is np.ndarray and target.dtype is _FLOAT else real_array(f"target for {part}", target)
        motors = self._parts[part].motors
        if values.shape != (len(motors),):
            return
        for index, (at, (low, high)) in enumerate(zip(values.tolist(), self._limits[part], strict=True)):
            if not low <= at <= high:
                unit = unit_name(self._robot, self._robot.motor_table[self._parts[part].start + index])
                raise InvalidValue(f"target {at:.4g} {unit} for {motors[index]}: must be within {low:.4g} to {high:.4g} {unit}")

    def begin(self, part: str, start: float, first_check: float) -> None:
        """Start an action of a part at time `start` [s]; the first check whether the part has settled is `first_check` [s] later."""
        row = self._row[part]
        self._start[row], self._next_check[row], self._under_way[row] = start, start + first_check, 1

    def end_all(self) -> None:
        """End all actions without an outcome."""
        self._under_way[:] = 0

    def outcome(self, part: str, q: Array, sampled: float, touched: tuple[str, ...]) -> Outcome:
        """Return the outcome of a part's last action.

        `q`: (n,) rad, encoders that were read at time `sampled` [s]. `touched`: names of the objects in contact with the part.
        """
        row = self._row[part]
        settled = bool(self._verdict[row] == _SETTLED)
        return Outcome(q[self._parts[part].slice].copy(), settled, sampled - float(self._start[row]), touched)


if TYPE_CHECKING:
    from mobee.control import Controller
    from mobee.model.model import Model
    from mobee.model.pose import Pose


@dataclass(slots=True, eq=False)
class Reach:
    """The state of one reach, in which a force pulls a marker to the target.

    `name`: name of the marker. `stay`: whether the part stays in the pose in which the force ended; otherwise it returns to its attractor,
    the position to which the control law's spring pulls its motors.
    `end`, `marker`: at the end of the force, the outcome and the position of the marker (3,) m, root frame; None while the force acts.
    `missing`: distance of the marker from the target at the end of the force [m].
    """

    name: str
    stay: bool
    end: Outcome | None = None
    marker: Array | None = None
    missing: float = 0.0


class ReachesUnderWay:
    """The reaches in progress of all parts of an offline plant (simulated robot), and the outcomes of those that have ended.

    In a reach, a force pulls a marker of the part to the target, which the method `present` sets; there is one target for all parts.
    """

    def __init__(self, model: Model, controller: Controller) -> None:
        self._model, self._controller = model, controller
        self._target: ReachTarget | None = None
        self._under_way: dict[str, Reach] = {}
        self._ended: dict[str, ReachOutcome] = {}
        self._settled: dict[str, Outcome] = {}  # outcomes of ended reaches, until they are read
        self.exempt: str | None = None
        """Name of a marker whose hand the targets do not repel, although no force pulls it to a target; None: no such marker."""

    @property
    def reaching(self) -> tuple[str, ...]:
        """The names of markers: the hands that carry these markers are not repelled by targets at present.

        They are the markers that a force pulls to the target, and the marker named in the attribute `exempt`, if it is not None.
        """
        drawn = [reach.name for reach in self._under_way.values() if reach.end is None]
        return tuple(dict.fromkeys(drawn if self.exempt is None else [*drawn, self.exempt]))

    @property
    def running(self) -> tuple[str, ...]:
        """The names of the parts that are reaching, or are returning to their attractors."""
        return tuple(self._under_way)

    def present(self, target: ReachTarget | None) -> None:
        """Add the target to the world, or move it if it is in the world already; None removes the target.

        Raises InvalidValue if the target is no `ReachTarget`, or if it is to be removed while a part is reaching for it.
        """
        if target is not None:
            checked_target(target)
        pulled = [part for part, reach in self._under_way.items() if reach.end is None]
        if target is None and pulled:
            raise InvalidValue(f"{', '.join(pulled)} is reaching for the target: it can be moved but not removed")
        world = self._model.world
        there, shape = world.objects.get(TARGET), None if target is None else sphere(target.radius)
        if target and there and shape and (there.kind, there.size, there.role) == (shape.kind, shape.size, "target"):
            world.move(TARGET, position=target.position)
        else:
            if there is not None:
                world.remove(TARGET)
            if target and shape:
                world.add(TARGET, shape, position=target.position, role="target")
        self._target = target
        if target is not None:
            for part in pulled:
                self._controller.reach_toward(part, self._under_way[part].name, target)

    def begin(self, part: str, marker: str, stay: bool) -> None:
        """Start the force that pulls the marker of a part to the target; raise InvalidValue if no target is presented.

        If the reach is refused, nothing changes. `stay`: whether the part stays in the pose in which the force ends.
        """
        if self._target is None:
            raise InvalidValue(f"{part} cannot reach: no target is presented; call present(ReachTarget(position)) first")
        self._controller.reaches.begin(part, marker)  # also ends an earlier reach of the part; if it refuses, that continues
        self._controller.reach_toward(part, marker, self._target)
        self._settled.pop(part, None)
        self._under_way[part] = Reach(marker, stay)

    def ended(self, part: str, end: Outcome, pose: Pose) -> bool:
        """Record that a part has settled or timed out; return whether the part must now return to its attractor.

        A reach has one or two motions. The first one is the pull to the target. When it has ended, this method ends the force. If the part
        stays where it is (`stay`), the reach has then ended, and False is returned; else True. The second motion is the return to the
        attractor; when it has ended, the reach has ended, and False is returned.

        `end`: the outcome of the motion. `pose`: the pose of the robot at its end.
        """
        reach = self._under_way[part]
        if reach.end is None and self._target is not None:
            reach.end, reach.marker = end, pose.position(reach.name)
            reach.missing = self._target.missing(reach.marker)
            self._controller.end_reach(part)
            if not reach.stay:
                return True
            self._controller.set_attractor(part, end.q)
        self._ended[part] = _outcome(reach, end)
        self._settled[part] = end
        del self._under_way[part]
        return False

    def outcome(self, part: str) -> ReachOutcome:
        """Return the outcome of the part's last reach; raise InvalidValue if no reach of the part has ended."""
        if part not in self._ended:
            raise InvalidValue(f"{part} has not ended a reach on this plant")
        return self._ended[part]

    def after(self, part: str) -> Outcome | None:
        """Return the outcome of the last motion of the part's reach, if the reach has ended and this was not returned before; else None.

        The last motion is the return to the attractor, or the pull to the target if the part stays where it is.
        """
        return self._settled.pop(part, None)

    def restart(self) -> None:
        """Cancel all reaches and forget the outcomes of earlier ones; the target stays."""
        for part in tuple(self._under_way):
            self.drop(part)
        self._settled.clear()
        self._ended.clear()

    def drop(self, part: str) -> None:
        """Cancel the reach of a part, if there is one, and end its force.

        If the reach has ended already, its last outcome is discarded, so that the method `after` does not return it.
        """
        self._settled.pop(part, None)
        if part in self._under_way:
            del self._under_way[part]
            self._controller.end_reach(part)


def _outcome(reach: Reach, after: Outcome) -> ReachOutcome:
    end = reach.end
    if end is None or reach.marker is None:
        raise InvalidValue("a reach that has not ended has no outcome")
    duration = end.duration + (0.0 if reach.stay else after.duration)
    return ReachOutcome(reach.marker, end.q, reach.missing, end.settled, duration, end.touched, after)
