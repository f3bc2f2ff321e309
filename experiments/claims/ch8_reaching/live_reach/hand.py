# SPDX-License-Identifier: Apache-2.0
"""A plant that times the reaches of the live arm, and an object that moves a target or an obstacle during a reach.

In a reach a force pulls the palm to a target.
"""

from __future__ import annotations

import numpy as np

from bus_schema import keys
from bus_schema.messages import Clock, Commands, Geometry, Reach
from bus_schema.rpc import AddObject, Done, MoveObject, OneName, Place, Request
from experiments.claims.ch8_reaching.live_reach.problems import SPEED
from experiments.kit.reaching.arm import PART
from mobee.arrays import Array
from mobee.reach import RADIUS
from mobee.robot.robot import Robot
from services.common.bus_plant import BusPlant, Sent
from services.common.lockstep import Participant
from services.common.service import Service

MIN_CHANGE = 5e-3  # rad/s, difference of a command that moves from the last one before the request
MOVING_TARGET, OBSTACLE = "moving_target", "obstacle"  # names in the world; the obstacle is that of obstacle.xml
MOVE_PERIOD = 5  # ticks between two positions of a moving object
AWAY = np.array([0.6, 0.9, 0.6])  # m, position of an obstacle that is not used
UPRIGHT, SPHERE = [1.0, 0.0, 0.0, 0.0], Geometry(kind="sphere", size=[RADIUS])


class Hand(BusPlant):
    """The live arm as a plant, which records when its last reach was requested, began to move, and ended.

    `asked`: tick of the last request.  `first`: number of ticks from it to the first command that moves the arm; -1: not timed.  `end`:
    tick at which the force of the reach ended.
    """

    def __init__(self, service: Service, robot: Robot) -> None:
        super().__init__(service, robot, (PART,))
        self._link, self._where = service, robot.part(PART).slice
        self.end = 0
        """Tick at which the force of the last reach ended."""
        self.first = -1
        """Ticks from the request of the last reach to the first command that moves; -1: not timed."""
        self.asked = 0
        """Tick of the last request."""
        self._before: Array | None = None
        service.on_each(Reach, self._note_reach, PART)

    @property
    def tick(self) -> int:
        """The current tick: the newer one of the tick of the bus and that of the part's last motion message.

        In lockstep (every tick waits for all participants) only messages of this part arrive.
        """
        motion = self._motion.get(PART)
        return self._link.bus.k if motion is None else max(self._link.bus.k, motion.k)

    def watch_commands(self) -> None:
        """Time the first motion of every following reach: after a reach, `first` has the number of ticks until its first motion.

        From then on all commands are received, which costs time in every tick.
        """
        self._link.on_each(Commands, self._note_commands)

    def _send(self, part: str, verb: str, request: type[Request], action_id: str, **fields: object) -> Sent:
        self.first = -1
        sent = super()._send(part, verb, request, action_id, **fields)
        self.asked = sent.k
        return sent

    def _note_reach(self, reach: Reach) -> None:
        self.end = reach.end_k

    def _note_commands(self, commands: Commands) -> None:
        """Find the first command that moves: a command of tick k acts from tick k + 1 on, and can respond to requests before tick k."""
        reference = np.array(commands.ref[self._where])
        if commands.re_k <= self.asked:
            self._before = reference
        elif self.first < 0 and self._before is not None and np.abs(reference - self._before).max() > MIN_CHANGE:
            self.first = commands.re_k + 1 - self.asked


class Mover:
    """Moves one object back and forth at 3 cm/s; its service takes part in the lockstep (every tick waits for all participants).

    It moves the object in the world of the model and, if it is the obstacle, in the simulator.
    """

    def __init__(self, service: Service, tick: float) -> None:
        """Take part in the lockstep by `service`; `tick`: duration of a tick, s."""
        self._service, self._dt = service, tick
        self._step = Participant(service)
        self._name = ""
        self._ends = np.zeros((2, 3))
        self._begin = self._k = 0
        service.on_clock(self._tick)

    def start(self, name: str, ends: list[list[float]]) -> None:
        """Move an object back and forth between two positions from now on, starting at the first.

        `name`: "moving_target", which is added to the world, or "obstacle".  `ends`: two positions [x, y, z], m, root frame.
        """
        self._ends, self._begin = np.array(ends), self._k
        if name == MOVING_TARGET:
            self._service.call(
                keys.world_rpc("add"), AddObject, Done, name=name, geometry=SPHERE, position=ends[0], quaternion=UPRIGHT, role="target"
            )
        self._name = name
        self._put(self.at(self._k))

    def stop(self) -> None:
        """Stop the motion: remove the target from the world, or put the obstacle far away."""
        name, self._name = self._name, ""
        if name == MOVING_TARGET:
            self._service.call(keys.world_rpc("remove"), OneName, Done, name=name)
        elif name:
            self._place(name, AWAY)

    def at(self, k: int) -> Array:
        """Return the position of the moving object at tick `k`, (3,) m, root frame."""
        path = self._ends[1] - self._ends[0]
        gone = SPEED * self._dt * ((k - self._begin) // MOVE_PERIOD * MOVE_PERIOD) / max(float(np.linalg.norm(path)), 1e-9)
        found: Array = self._ends[0] + (1.0 - abs(1.0 - gone % 2.0)) * path
        return found

    def now(self) -> Array:
        """Return the position of the moving object at the present tick, (3,) m, root frame."""
        return self.at(self._k)

    def leave(self) -> None:
        """End the motion, and leave the lockstep: later ticks do not wait for this service."""
        self._name = ""
        self._step.done(self._k, last=True)

    def _tick(self, clock: Clock) -> None:
        self._k = clock.k
        if self._name and (clock.k - self._begin) % MOVE_PERIOD == 0:
            self._put(self.at(clock.k))
        self._step.done(clock.k)

    def _put(self, position: Array) -> None:
        if self._name == MOVING_TARGET:
            self._move(MOVING_TARGET, position)
        else:
            self._place(self._name, position)

    def _place(self, name: str, position: Array) -> None:
        self._move(name, position)
        self._service.call(keys.sim("place"), Place, Done, name=name, position=position.tolist(), tries=3)

    def _move(self, name: str, position: Array) -> None:
        self._service.call(keys.world_rpc("move"), MoveObject, Done, name=name, position=position.tolist())
