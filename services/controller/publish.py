# SPDX-License-Identifier: Apache-2.0
"""Publishes the commands and motions of all parts, and in lockstep the answer to each tick; counts ticks."""

from __future__ import annotations

import time
from collections.abc import Mapping

from bus_schema.messages import Answer, Commands, Motion, Order, Tick
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.bus import Bus
from services.common.lockstep import Participant
from services.common.rate import Percentiles
from services.common.service import Service
from services.controller.action import Action, Owner, busy_owners
from services.controller.drives import Drives
from services.controller.law import RobotLaw

LOCKSTEP_PUBLISH_PERIOD = 50  # ticks between two motions of a part that is moving or has no owner, in lockstep
PUBLISH_PERIOD = 0.01  # s of real time between two motions of a part in free mode; a change is published at once


class Counters:
    """The counts of the controller since a measurement began, and the jitter of its steps (error of the time between two steps)."""

    def __init__(self) -> None:
        self.ticks = self.late_forces = self.held_ticks = self.long_gaps = 0
        self._stepped_at = 0.0  # s, monotonic clock
        self._jitter = Percentiles()  # ms, of the time between two steps

    def note_step(self, period: float) -> None:
        """Record by how much the time since the last step differs from `period` [s of real time]; call this once per step."""
        before, self._stepped_at = self._stepped_at, time.monotonic()
        if before > 0.0:
            self._jitter.add(abs(self._stepped_at - before - period) * 1e3)

    def numbers(self) -> Mapping[str, float]:
        """Return the counts of the measurement by name, for the call `stat`.

        "ticks": number of control steps. "late_forces": number of steps that were made before the model's forces of the tick had arrived.
        "held_ticks": number of ticks in which a part did not follow the control law, summed over all parts. "long_gaps": number of steps
        that came more than 3 ticks (MAX_TICKS) after the one before. "jitter_ms_p50", "jitter_ms_p99": percentiles of the jitter [ms].
        """
        return {
            "ticks": self.ticks,
            "late_forces": self.late_forces,
            "held_ticks": self.held_ticks,
            "long_gaps": self.long_gaps,
            "jitter_ms_p50": self._jitter.at(50),
            "jitter_ms_p99": self._jitter.at(99),
        }


class MotionPublisher:
    """Publishes a `Motion` message for each part: its action, measured positions, commanded velocity and acceleration, and attractor."""

    def __init__(self, bus: Bus, robot: Robot, law: RobotLaw, actions: Mapping[str, Action]) -> None:
        self._law, self._actions = law, actions
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._streams = {part: bus.publisher(Motion, part) for part in robot.parts}
        self._published: dict[str, tuple[str, Owner | None]] = {}  # action and owner in each part's last message

    def publish(self, tick: Tick) -> None:
        """Publish the motion of every part for which a message is due: at once after a change, otherwise at regular intervals."""
        for part, action in self._actions.items():
            if self._is_redundant(part, tick):
                continue
            velocity, acceleration, attractor = self._law.motion(part)
            self._streams[part].put(
                k=tick.k,
                t=tick.t,
                action_id=action.id,
                epoch=action.owner.epoch if action.owner is not None else 0,
                owner=action.owner.who if action.owner is not None else "",
                status=action.status,
                since_k=action.since_k,
                start_k=action.start_k,
                q=self._law.q[self._where[part]].tolist(),
                dq=velocity.tolist(),
                ddq=acceleration.tolist(),
                goal=attractor.tolist(),
                touched=self._law.forces.touched(part),
            )

    def _is_redundant(self, part: str, tick: Tick) -> bool:
        """Return whether action, owner and status are as in the last message, and no regular message is due."""
        action, k = self._actions[part], tick.k
        known, self._published[part] = self._published.get(part), (action.id, action.owner)
        if known != self._published[part] or action.since_k >= k:
            return False
        if tick.mode == "lock":
            return (action.is_under_way or action.owner is None) and k % LOCKSTEP_PUBLISH_PERIOD > 0
        return k % max(1, round(1e9 * PUBLISH_PERIOD * tick.rate / tick.dt)) > 0


class CommandPublisher:
    """Publishes one message per tick with the commands to all parts that follow this controller.

    In lockstep robot_sim waits in every tick for the answers of all participants. This class then also sends the controller's answer.
    """

    def __init__(self, service: Service, ttl: int, law: RobotLaw, actions: Mapping[str, Action], drives: Drives) -> None:
        self._service, self._ttl, self._law, self._actions, self._drives = service, ttl, law, actions, drives
        self._commands = service.bus.publisher(Commands)
        self._participant = Participant(service)
        self._sent: tuple[int, dict[str, Order]] | None = None  # tick and orders of the last message
        self._to_answer: tuple[int, Answer] | None = None  # lockstep: a tick that is not answered yet, and its answer
        drives.on_attempt_end(self._answer)

    def begin_tick(self) -> None:
        """Forget the commands of the last tick, and its answer if that is not sent yet; call this at the start of a tick or a run."""
        self._sent = self._to_answer = None

    def send(self, k: int, orders: dict[str, Order], reference: Array, answer: Answer | None = None) -> None:
        """Publish the commands of tick k, if there are any.

        `orders`: for each commanded part, the epoch (number of this controller's ownership of the part's drive) and the kind of command:
        "hold" (brake and stand still), or the `modality` in the settings ("position", "velocity" or "torque"). `reference`: value for every
        motor of the robot, (n,), in rad, rad/s or N m by this modality. `answer`: in lockstep, the answer to the tick, sent in the same
        message; None: the message has no answer.
        """
        self._sent = k, orders
        if orders:
            self._commands.put(re_k=k, parts=orders, ref=reference.tolist(), ttl=self._ttl, answer=answer)

    def send_again(self, part: str) -> None:
        """In free mode (ticks do not wait for answers), let a client's request for a part take effect before the next tick.

        The last control step is computed again with the request, and its commands are published. In lockstep (every tick waits for all
        participants) nothing is done.
        """
        if self._service.locked or self._sent is None or part not in self._sent[1]:
            return
        reference = self._law.repeat_step()
        if reference is not None:
            self.send(*self._sent, reference)

    def send_and_answer(self, tick: Tick, fresh: bool, orders: dict[str, Order], reference: Array) -> None:
        """In lockstep, publish the commands of a tick, and answer the tick in the same message.

        The answer is a message of its own for tick 0, if there are no commands, and while a part is being armed (permitted to follow
        commands); in the last case it is sent when the arming has ended. Tick 0 is answered only if all parts that can be armed are armed,
        the commands have a subscriber, and `fresh` is true; otherwise nothing is sent, and robot_sim repeats tick 0.

        `fresh`: whether the forces of the model may be used. `orders`: for each commanded part, the epoch (number of this controller's
        ownership of the part's drive) and the kind of command. `reference`: command of every motor, as in `send`.
        """
        if tick.k == 0 and not (fresh and self._is_ready(tick)):
            return
        forces = self._law.forces.message
        including = [forces.src] if forces is not None and forces.re_k == tick.k else []
        answer = Answer(fresh, busy_owners(self._actions.values()), including)
        self._to_answer = tick.k, answer
        if tick.k == 0 or not orders or self._drives.is_arming:
            self.send(tick.k, orders, reference)
            self._answer()
            return
        self._participant.inject_test_delay()
        self.send(tick.k, orders, reference, answer)
        self._to_answer = None

    def _is_ready(self, tick: Tick) -> bool:
        """Return whether tick 0 may be answered: every part that can be armed is armed, and the commands have a subscriber."""
        ready = (self._drives.is_armed(part, state) or not self._drives.can_arm(state) for part, state in tick.parts.items())
        return all(ready) and self._commands.has_subscribers

    def _answer(self) -> None:
        """In lockstep, send the answer to the tick, which is delayed while a part is being armed."""
        if self._to_answer is not None and not self._drives.is_arming:
            (k, answer), self._to_answer = self._to_answer, None
            busy = busy_owners(self._actions.values())
            self._participant.done(k, ok=answer.ok, busy=busy, including=answer.including)
