"""Reaches in progress: a marker is drawn to a target, then released (thesis 8.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bus_schema.messages import Reach as ReachMessage
from bus_schema.messages import ReachPhase, Targets, Tick
from bus_schema.rpc import ReachFor
from mobee import Controller
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.hands import MAX_HANDS
from mobee.reach import ReachTarget
from mobee.robot.robot import Robot
from services.common.bus import Bus
from services.controller.action import Action

NEWS = 0.01  # s of real time: so often a reach under way is told of in free mode, where messages may be lost
REST = 10  # times that, when it is over


@dataclass
class Reach:
    """The last reach of a part; q (n,) rad and what follows are of the force's end, tick `end_k`."""

    action_id: str
    marker: str
    object: str
    target: ReachTarget
    stay: bool
    q: Array
    position: Array  # (3,) m
    end_k: int
    phase: ReachPhase = "reaching"
    settled: bool = False
    touched: tuple[str, ...] = ()


class ReachesUnderWay:
    """Begins, follows and ends the reaches of all parts."""

    def __init__(self, bus: Bus, robot: Robot, law: Controller, actions: Mapping[str, Action], measured: Callable[[], Array]) -> None:
        """`measured`: q (n,) rad at the newest tick."""
        self._bus, self._robot, self._law, self._actions, self._measured = bus, robot, law, actions, measured
        self._last: dict[str, Reach] = {}
        self._streams = {part: bus.publisher(ReachMessage, part) for part in robot.parts}

    def begin(self, part: str, asked: ReachFor) -> None:
        """Force the part from now on.  Raises InvalidValue, UnknownName for what cannot be reached for."""
        target = ReachTarget(np.array(asked.position), asked.radius, asked.aim, None if asked.normal is None else np.array(asked.normal))
        others = {reach.marker for other, reach in self._last.items() if other != part and reach.phase == "reaching"} - {asked.marker}
        if len(others) >= MAX_HANDS:
            raise InvalidValue(f"{' and '.join(sorted(others))} are reaching: at most {MAX_HANDS} markers may reach at once")
        self._law.reach_toward(part, asked.marker, target)
        self._last[part] = Reach(asked.action_id, asked.marker, asked.object, target, asked.stay, *self._here(asked.marker), self._bus.k)
        self._tell(part)

    def aim(self, targets: Targets) -> None:
        """The model has seen where the targets are; one that it knows no more, or where none can be, is where it was."""
        for part, reach in self._last.items():
            position = targets.positions.get(reach.object)
            if reach.phase == "reaching" and position is not None and position != reach.target.position.tolist():
                try:
                    reach.target = replace(reach.target, position=np.array(position))
                except InvalidValue as error:
                    self._bus.reject("value", f"{reach.object} at tick {targets.re_k}: {error}")
                    continue
                self._law.reach_toward(part, reach.marker, reach.target)

    def look(self, part: str, tick: Tick, touched: list[str]) -> None:
        """Let go of a part whose action has come to its end: it is drawn back, and has to settle once more, unless it is to stay."""
        reach, action = self._last.get(part), self._actions[part]
        if reach is None or action.status == "moving" or reach.phase not in ("reaching", "returning"):
            return
        if reach.phase == "returning":
            reach.phase = "over"
        else:
            self._law.end_reach(part)
            reach.q, reach.position = self._here(reach.marker)
            reach.end_k = tick.k
            reach.settled, reach.touched, reach.phase = action.status == "settled", tuple(touched), "over" if reach.stay else "returning"
            if reach.stay:
                self._law.set_attractor(part, reach.q[self._robot.part(part).slice])
            else:
                action.go_on(tick.k, tick.t * 1e-9)
        self._tell(part)

    def drop(self, part: str) -> None:
        """End the part's reach, if there is one, without an outcome."""
        reach = self._last.get(part)
        if reach is not None and reach.phase in ("reaching", "returning"):
            self._law.end_reach(part)
            reach.phase = "interrupted"
            self._tell(part)

    def tell(self, tick: Tick) -> None:
        """Free mode: tell of all reaches again now and then."""
        period = max(1, round(1e9 * NEWS * tick.rate / tick.dt))
        for part, reach in self._last.items():
            if tick.k % (period if reach.phase in ("reaching", "returning") else REST * period) == 0:
                if reach.phase == "reaching":
                    reach.q, reach.position = self._here(reach.marker)
                    reach.end_k = tick.k
                self._tell(part)

    def _here(self, marker: str) -> tuple[Array, Array]:
        """The encoders (n,) rad, and where a marker is by them, (3,) m."""
        q = self._measured()
        return q, self._law.model.evaluate(q).position(marker)

    def _tell(self, part: str) -> None:
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
