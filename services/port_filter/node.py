# SPDX-License-Identifier: Apache-2.0
"""Runs the port filter: forwards the robot's states to the clients, and the commands of the clients to the robot.

If a measured pose is in contact or beyond a limit, the reflex moves the robot back instead, and commands are refused.
"""

from __future__ import annotations

import numpy as np

from bus_schema import VERSION, keys
from bus_schema.messages import Clock, Tick
from bus_schema.rpc import Done, Empty
from mobee import Model
from mobee.arrays import Array
from mobee.control.reflex import KINDS, Reflex, Violation, Watch
from mobee.robot.motor_units import slides
from mobee.robot.robot import Robot
from services.common.lockstep import Barrier, Participant
from services.common.service import CallRefused, Service
from services.port_filter.config import Config
from services.port_filter.drives import DriveServer, Forwarder
from services.port_filter.passage import Streams


class Switch:
    """Decides at every tick who commands the robot: the clients, or the reflex.

    The reflex moves the robot back along its past poses when a motion leads into contact. `reflex`: the reflex of the present run. `q`:
    newest measured pose (n,) rad. `violations`: the contacts of this pose, and the limits and clauses (conditions on several motors) that
    it violates.
    """

    def __init__(self, config: Config, robot: Robot) -> None:
        self._settings = config.reflex
        model = Model(robot, config.load_world())
        for name, item in list(model.world.objects.items()):
            if item.role == "target":  # vision perceives targets, as in the model service
                model.world.remove(name)
        self._track, self._watch = model.track(), Watch(robot, KINDS if config.contacts == "both" else (config.contacts,), config.tolerance)
        self._max_velocity = np.array([motor.max_velocity for motor in robot.motor_table])
        self._track.evaluate(robot.home).contacts  # noqa: B018  # fills caches before the robot moves
        self.q: Array = robot.home
        self.violations: tuple[Violation, ...] = ()
        self.restart(0.01)

    def restart(self, dt: float) -> None:
        """Begin a new run: a new reflex with no recorded poses. `dt`: duration of a tick [s]."""
        self.reflex = Reflex(self._settings, dt, self._max_velocity)

    def tick(self, q: Array) -> Array | None:
        """Check the measured pose `q` (n,) rad for contacts and violated limits, and advance the reflex by one tick.

        Returns the target (n,) rad of the reflex, which moves the robot back along its past poses after a violation; None while the clients
        command the robot.
        """
        self.q = q
        self.violations = self._watch.check(self._track.evaluate(q))
        return self.reflex.tick(q, self.violations)


class FilterNode:
    """The port filter: passes commands of clients to the robot, and moves the robot back if a motion leads into contact.

    `service`: connection in the robot's namespace, in which the filter is a client of the robot. `twin`: connection in the namespace of the
    filter's clients (first part of all their keys), in which the filter acts as the robot.
    """

    def __init__(self, service: Service, twin: Service, config: Config, robot: Robot) -> None:
        self._service, self._twin, self._config, self._robot = service, twin, config, robot
        self._switch = Switch(config, robot)
        self._driven: list[str] = []  # parts that the reflex moves
        self._last_k = -1
        self._complete = self._is_waiting = False  # lockstep: every client that takes part has come; some have not answered yet
        self._drives = DriveServer(service, twin, robot, self._refusal, lambda part: part in self._driven, self._mark)
        self._streams = Streams(service, twin, robot, self._drives.epochs, self._refusal, self._mark)
        Forwarder(service, twin, robot)
        self._clock = twin.bus.publisher(Clock)
        self._participant = Participant(service)
        twin.keeps_step = twin.locked
        self._barrier = Barrier(
            twin,
            config.participants,
            lambda who, why: twin.bus.event("warning", "not_repeatable", f"{who} {why}"),
            patience=config.patience,
        )
        self._streams.answered = lambda commands, answer: self._barrier.note(commands.src, commands.re_k, answer)
        self._declare()

    def _declare(self) -> None:
        service, twin = self._service, self._twin
        service.describe = self._describe
        twin.describe = self._describe
        twin.on_request(keys.waypoint("*"), Empty, self._waypoint, part_of_key=True)
        service.on_run(self._new_run)
        service.on_tick(self._tick)

    def _refusal(self) -> str:
        """Return the reason why clients may not command now; "" if they may."""
        state = self._switch.reflex.state
        if state == "stuck":
            accept = "if this pose is safe, accept it by the call rpc/waypoint of any part"
            return f"{self._where()}, and no motion back was found; {accept}"
        return "" if state == "forward" else f"the reflex moves the robot back ({state}): wait, then arm again"

    def _tick(self, tick: Tick) -> None:
        twin = self._twin.bus
        if self._is_waiting:
            return  # robot_sim continued without its late participants
        twin.run, twin.k, twin.t, twin.dt = tick.run, tick.k, tick.t, tick.dt
        self._streams.note(tick)
        if tick.mode != "paused" and tick.k != self._last_k:
            if self._last_k < 0:
                self._switch.restart(tick.dt * 1e-9)
            self._last_k = tick.k
            self._check_pose(tick)
        self._streams.publish(tick)
        if self._clock.has_subscribers:
            self._clock.put(dt=tick.dt, mode=tick.mode, rate=tick.rate)
        if tick.mode == "lock":
            self._answer(tick.k)

    def _check_pose(self, tick: Tick) -> None:
        if self._streams.is_stale:
            return
        reflex = self._switch.reflex
        before = reflex.state
        if before not in ("forward", "stuck") and not all(map(self._streams.follows, self._driven)):
            reflex.give_up()
        target = self._switch.tick(self._streams.q())
        if before == "forward" and reflex.state != "forward":
            self._cut_off()
        if before != "stuck" and reflex.state == "stuck":
            self._get_stuck()
        if before != "forward" and reflex.state == "forward":
            self._hand_back()
        if target is not None and reflex.state != "stuck":
            self._command(tick.k, target, moving=reflex.state != "brake")

    def _command(self, k: int, target: Array, moving: bool) -> None:
        for part in self._driven:
            where = self._robot.part(part).slice
            reference = target[where].clip(self._robot.limits[where, 0], self._robot.limits[where, 1]).tolist()
            self._streams.commands[part].put(self._drives.epochs[part], k, "position" if moving else "hold", reference, self._config.ttl)

    def _cut_off(self) -> None:
        self._driven = [part for part in self._robot.parts if self._streams.follows(part)]
        self._streams.forget_moves()
        if self._driven:
            driven = ", ".join(self._driven)
            self._report("warning", "reflex", f"{self._where()}: clients' commands are refused, {driven} move back along their path")
        else:
            self._switch.reflex.give_up()  # no part is driven, so there is no motion to undo

    def _hand_back(self) -> None:
        self._end_recovery()
        recovery = self._switch.reflex.recovery
        if recovery is not None:
            where = "the robot stays where it was held" if recovery.outcome == "stuck" else f"was undone to the {recovery.outcome}"
            self._report(
                "warning",
                "motion_failed",
                f"the motion failed and {where}; arm to continue",
                deepest=recovery.deepest,
                ticks=float(recovery.ticks),
                again=float(recovery.again),
                passed=float(recovery.passed),
            )

    def _get_stuck(self) -> None:
        self._end_recovery()
        self._report("error", "stuck", self._refusal())

    def _end_recovery(self) -> None:
        for part in self._driven:
            self._drives.hold(part)
        self._driven = []

    def _where(self) -> str:
        """Return a short description of the deepest contact; if there is none, of the first violation."""
        recovery = self._switch.reflex.recovery
        worst = next(iter(self._switch.violations or (recovery.cause if recovery else ())), None)
        return "in violation" if worst is None else described(self._robot, worst)

    def _report(self, level: str, code: str, text: str, **values: float) -> None:
        for bus in (self._service.bus, self._twin.bus):
            bus.event(level, code, text, **values)

    def _mark(self) -> None:
        """Mark the pose to which later motions can be undone: a client has armed a part, or begins a move."""
        self._switch.reflex.mark()

    def _waypoint(self, request: Empty, key: str) -> Done:
        reflex = self._switch.reflex
        if reflex.state == "stuck":
            reflex.accept(self._switch.q, self._switch.violations)
            self._report("info", "accepted", f"{request.who} accepted the present pose as safe")
        elif reflex.state != "forward":
            raise CallRefused("reflex", f"no waypoint while the reflex is in control ({reflex.state})")
        elif not reflex.mark():
            raise CallRefused("empty", "no pose without a violation has been seen yet")
        return Done(v=VERSION)

    def _answer(self, k: int) -> None:
        """Wait until the filter's clients have answered tick `k`, then send the filter's own answer to robot_sim; only used in lockstep.

        `k`: number of the tick. In lockstep, robot_sim (the process that simulates the robot and counts the ticks) begins the next tick
        after all services have answered the present one. An answer is a `StepDone` message: the sender has published all its messages for
        the tick. If a client does not answer within the time `patience` of the configuration, the filter's answer has `ok` = False: the run
        is not repeatable. Nothing is sent until all services in `participants` of the configuration have once been present in the run.
        """
        self._complete = self._complete or not self._barrier.absent()
        if self._complete:
            self._is_waiting = True
            late = self._barrier.wait(k)
            self._is_waiting = False
            self._participant.done(k, ok=not late)

    def _new_run(self) -> None:
        self._streams.forget()
        self._drives.forget()
        self._barrier.begin()
        self._driven, self._last_k, self._complete = [], -1, False
        self._switch.restart(0.01)

    def _describe(self) -> tuple[str, dict[str, float]]:
        reflex = self._switch.reflex
        counts = reflex.counts
        text = f"{reflex.state}, {counts.reflexes} reflexes, {counts.recovered} recovered, {counts.stuck} stuck"
        numbers = {"reflexes": counts.reflexes, "recovered": counts.recovered, "stuck": counts.stuck, "flips": counts.flips}
        return text, {**numbers, "recorded": reflex.recorded, "refused": sum(self._twin.bus.rejected.values())}


def described(robot: Robot, violation: Violation) -> str:
    """Return a violation of a pose of the robot in a few words, such as "limit l_elbow by 3.0 degrees"."""
    if violation.kind == "contact":
        return f"contact {violation.what} {1e3 * violation.depth:.0f} mm deep"
    is_slide = violation.kind == "limit" and slides(robot, robot.motor_table[robot.motor_index(violation.what)])
    size = f"{1e3 * violation.depth:.1f} mm" if is_slide else f"{np.rad2deg(violation.depth):.1f} degrees"
    return f"{violation.kind} {violation.what} by {size}"
