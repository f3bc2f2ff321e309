"""What the controller tells of the parts' motions, and when."""

from __future__ import annotations

from collections.abc import Mapping

from bus_schema import keys
from bus_schema.chain import Tick
from bus_schema.messages import Forces, Motion
from mobee import Controller
from mobee.robot.robot import Array, Robot
from services.common.bus import Bus
from services.controller.action import Action, Owner

SOMETIMES = 50  # ticks: so often a part under way, or one that nobody owns, tells of its motion in lockstep
NEWS = 0.01  # s of real time: so often every part tells of its motion in free mode, and of a change at once


class Telling:
    """The motion streams."""

    def __init__(self, bus: Bus, robot: Robot, law: Controller, actions: Mapping[str, Action]) -> None:
        self._law, self._actions = law, actions
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._streams = {part: bus.publisher(keys.motion(part), Motion, bus.control) for part in robot.parts}
        self._told: dict[str, tuple[str, Owner | None]] = {}  # of each part's last message

    def tell(self, tick: Tick, q: Array, forces: Forces | None) -> None:
        """Where the actions stand, of those of which that is not known; q (n,) rad measured."""
        parts = [part for part in self._actions if not self._goes_without_saying(part, tick)]
        if not parts:
            return
        touched = forces.touched if forces is not None else {}
        velocity, acceleration, attractor = self._law.velocity, self._law.acceleration, self._law.attractor
        for part in parts:
            action, where = self._actions[part], self._where[part]
            self._streams[part].put(
                k=tick.k,
                t=tick.t,
                action_id=action.id,
                epoch=action.owner.epoch if action.owner is not None else 0,
                status=action.status,
                since_k=action.since_k,
                start_k=action.start_k,
                q=q[where].tolist(),
                dq=velocity[where].tolist(),
                ddq=acceleration[where].tolist(),
                goal=attractor[where].tolist(),
                touched=touched.get(part, []),
            )

    def _goes_without_saying(self, part: str, tick: Tick) -> bool:
        """Whether nobody waits for news of the part, since it is under way as it was, or nobody's, or in free mode goes on in any way."""
        action, k = self._actions[part], tick.k
        known, self._told[part] = self._told.get(part), (action.id, action.owner)
        if known != self._told[part] or action.since_k >= k:
            return False
        if tick.mode == "lock":
            return (action.status == "moving" or action.owner is None) and k % SOMETIMES > 0
        return k % max(1, round(1e9 * NEWS * tick.rate / tick.dt)) > 0
