"""Something that moves to and fro while the arm reaches: in the model's world, and for an obstacle in the simulator's too."""

from __future__ import annotations

import numpy as np

from bus_schema import keys
from bus_schema.messages import Clock, Geometry
from bus_schema.rpc import AddObject, Done, MoveObject, OneName, Place
from experiments.live_reach.problems import SPEED
from mobee.reach import RADIUS
from mobee.robot.robot import Array
from services.common.lockstep import Participant
from services.common.service import Service

THING, OBSTACLE = "thing", "obstacle"  # the target that moves; the world file's obstacle
EVERY = 5  # ticks, after which it is moved on
AWAY = np.array([0.6, 0.9, 0.6])  # m, where an obstacle is in nobody's way
UPRIGHT, SPHERE = [1.0, 0.0, 0.0, 0.0], Geometry(kind="sphere", size=[RADIUS])


class Mover:
    """Takes part in every tick, as a service of its own, for an arm under way is told of none."""

    def __init__(self, service: Service, tick: float) -> None:
        """`tick`: s."""
        self._service, self._dt = service, tick
        self._step = Participant(service)
        self._name = ""
        self._ends = np.zeros((2, 3))
        self._begin = self._k = 0
        service.on_clock(self._tick)

    def start(self, name: str, ends: list[list[float]]) -> None:
        """Move a thing between two places from now on, beginning at the first."""
        self._ends, self._begin = np.array(ends), self._k
        if name == THING:
            self._service.call(
                keys.world_rpc("add"), AddObject, Done, name=name, geometry=SPHERE, position=ends[0], quaternion=UPRIGHT, role="target"
            )
        self._name = name
        self._put(self.at(self._k))

    def stop(self) -> None:
        """Take it away."""
        name, self._name = self._name, ""
        if name == THING:
            self._service.call(keys.world_rpc("remove"), OneName, Done, name=name)
        elif name:
            self._place(name, AWAY)

    def at(self, k: int) -> Array:
        """Where it is at a tick, (3,) m."""
        way = self._ends[1] - self._ends[0]
        gone = SPEED * self._dt * ((k - self._begin) // EVERY * EVERY) / max(float(np.linalg.norm(way)), 1e-9)
        found: Array = self._ends[0] + (1.0 - abs(1.0 - gone % 2.0)) * way
        return found

    def now(self) -> Array:
        """Where it is."""
        return self.at(self._k)

    def leave(self) -> None:
        """Take part no longer."""
        self._name = ""
        self._step.done(self._k, last=True)

    def _tick(self, clock: Clock) -> None:
        self._k = clock.k
        if self._name and (clock.k - self._begin) % EVERY == 0:
            self._put(self.at(clock.k))
        self._step.done(clock.k)

    def _put(self, position: Array) -> None:
        if self._name == THING:
            self._move(THING, position)
        else:
            self._place(self._name, position)

    def _place(self, name: str, position: Array) -> None:
        self._move(name, position)
        self._service.call(keys.sim("place"), Place, Done, name=name, position=position.tolist(), tries=3)

    def _move(self, name: str, position: Array) -> None:
        self._service.call(keys.world_rpc("move"), MoveObject, Done, name=name, position=position.tolist())
