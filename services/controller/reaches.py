# SPDX-License-Identifier: Apache-2.0
"""Reaches in progress: a force pulls a marker (named point on a link) to a target until the part settles or times out (thesis 8.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bus_schema.messages import Reach as ReachMessage
from bus_schema.messages import ReachPhase, Targets, Tick
from bus_schema.rpc import ReachFor
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.engine import MAX_HANDS
from mobee.reach import ReachTarget
from mobee.robot.robot import Robot
from services.common.bus import Bus
from services.controller.action import Action
from services.controller.law import RobotLaw

PUBLISH_PERIOD = 0.01  # s of real time between two messages of a reach in free mode, where messages may be lost
ENDED_PERIODS = 10  # of these between two messages of a reach that has ended


@dataclass
class Reach:
    """The last reach of a part: a force pulls a marker to a target.

    `object`: name of the target in the model's world. `stay`: whether the part stays where it is when the force ends; otherwise the
    attractor pulls it back. `end_k`: tick at which the force ended because the part had settled or timed out; otherwise the tick of the
    last measurement. `q`: positions of all motors (n,) rad, measured at that tick. `position`: position of the marker (3,) m, root frame,
    at that tick. `settled`: whether the force ended because the part had settled. `touched`: world objects in contact with the part at that
    time.
    """

    action_id: str
    marker: str
    object: str
    target: ReachTarget
    stay: bool
    q: Array
    position: Array
    end_k: int
    phase: ReachPhase = "reaching"
    settled: bool = False
    touched: tuple[str, ...] = ()


class Reaches:
    """Begins, updates and ends the reaches of all parts.

    In a reach a force pulls a marker (named point of a link) of the part to a target, until the part settles or times out.
    """

    def __init__(self, bus: Bus, robot: Robot, law: RobotLaw, actions: Mapping[str, Action]) -> None:
        self._bus, self._robot, self._law, self._actions = bus, robot, law, actions
        self._last: dict[str, Reach] = {}
        self._streams = {part: bus.publisher(ReachMessage, part) for part in robot.parts}

    def begin(self, part: str, asked: ReachFor) -> None:
        """Start to pull a part's marker to its target, as the request `asked` describes.

        Raises InvalidValue or UnknownName if the part cannot reach for the target.
        """
        normal = None if asked.normal is None else np.array(asked.normal)
        target = ReachTarget(np.array(asked.position), asked.radius, asked.aim, normal, asked.faces)
        others = {reach.marker for other, reach in self._last.items() if other != part and reach.phase == "reaching"} - {asked.marker}
        if len(others) >= MAX_HANDS:
            raise InvalidValue(f"{' and '.join(sorted(others))} are reaching: at most {MAX_HANDS} markers may reach at once")
        self._law.reach(part, asked.marker, target)
        position = self._law.marker_position(asked.marker)
        self._last[part] = Reach(asked.action_id, asked.marker, asked.object, target, asked.stay, self._law.q, position, self._bus.k)
        self._publish(part)

    def follow_targets(self, targets: Targets) -> None:
        """Set the targets of all reaches to their new positions, and end the reaches whose targets are gone.

        An invalid position is refused; it changes nothing.
        """
        for part, reach in self._last.items():
            if reach.phase == "reaching" and reach.object in targets.gone:
                self._bus.event(
                    "warning", "target_gone", f"{part}: the reach ends, since {reach.object} is not in the model's world any more"
                )
                self.interrupt(part)
                continue
            position = targets.positions.get(reach.object)
            if reach.phase == "reaching" and position is not None and position != reach.target.position.tolist():
                try:
                    reach.target = replace(reach.target, position=np.array(position))
                except InvalidValue as error:
                    self._bus.reject("value", f"{reach.object} at tick {targets.re_k}: {error}")
                    continue
                self._law.reach(part, reach.marker, reach.target)

    def update(self, part: str, tick: Tick) -> None:
        """Stop the pull of a part's reach to its target when the part has settled or timed out.

        The attractor then pulls the part back. The reach is over when the part has settled or timed out a second time. If the reach was
        requested with `stay`, the part stays where it is instead: its attractor is set to this position, and the reach is over at once.
        """
        reach, action = self._last.get(part), self._actions[part]
        if reach is None or action.status == "moving" or reach.phase not in ("reaching", "returning"):
            return
        if reach.phase == "returning":
            reach.phase = "over"
        else:
            self._law.end_reach(part)
            self._measure(reach, tick.k)
            reach.settled, reach.touched = action.status == "settled", tuple(self._law.forces.touched(part))
            reach.phase = "over" if reach.stay else "returning"
            if reach.stay:
                self._law.set_attractor(part, reach.q[self._robot.part(part).slice])
            else:
                action.settle_again(tick.k, tick.t * 1e-9)
        self._publish(part)

    def interrupt(self, part: str) -> None:
        """End the part's reach, if one is in progress; its phase is then "interrupted"."""
        reach = self._last.get(part)
        if reach is not None and reach.phase in ("reaching", "returning"):
            self._law.end_reach(part)
            reach.phase = "interrupted"
            self._publish(part)

    def publish_regularly(self, tick: Tick) -> None:
        """In free mode, publish all reaches again at regular intervals, because messages may be lost there.

        The intervals are 0.01 s of real time, and 0.1 s for a reach that has ended. In free mode ticks do not wait for the services.
        """
        period = max(1, round(1e9 * PUBLISH_PERIOD * tick.rate / tick.dt))
        for part, reach in self._last.items():
            if tick.k % (period if reach.phase in ("reaching", "returning") else ENDED_PERIODS * period) == 0:
                if reach.phase == "reaching":
                    self._measure(reach, tick.k)
                self._publish(part)

    def _measure(self, reach: Reach, k: int) -> None:
        reach.q, reach.position, reach.end_k = self._law.q, self._law.marker_position(reach.marker), k

    def _publish(self, part: str) -> None:
        reach = self._last[part]
        self._streams[part].put(
            action_id=reach.action_id,
            phase=reach.phase,
            marker=reach.marker,
            object=reach.object,
            end_k=reach.end_k,
            target=reach.target.position.tolist(),
            q=reach.q[self._robot.part(part).slice].tolist(),
            position=reach.position.tolist(),
            missing=reach.target.missing(reach.position),
            settled=reach.settled,
            touched=list(reach.touched),
        )
