# SPDX-License-Identifier: Apache-2.0
"""Runs the controller: once per tick, computes the commands from the parts' states and the model's forces."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial

import numpy as np

from bus_schema import keys
from bus_schema.messages import Forces, Order, Targets, Tick
from bus_schema.rpc import PartMeta
from mobee import Gains
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.exit_codes import BAD_INPUT
from services.common.inbox import Timer
from services.common.rpc import CallFailed
from services.common.service import Service
from services.common.worlds import robot_hash
from services.controller.action import Action
from services.controller.config import Config
from services.controller.drives import Drives
from services.controller.forces import MAX_STATE_AGE, MAX_TICKS
from services.controller.goals import GoalServer
from services.controller.law import RobotLaw
from services.controller.publish import CommandPublisher, Counters, MotionPublisher
from services.controller.reaches import Reaches


class ControllerNode:
    """Waits for the forces of a tick, steps the control law, and commands the parts that are under control.

    The state is in objects that only their own methods change: `RobotLaw` keeps the law's state, `Action` the goal and status of one part,
    `Drives` the ownership of the motors at robot_sim, `Reaches` the reaches in progress.
    """

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._service, self._config, self._robot = service, config, robot
        self._law = RobotLaw(service.bus, config, robot)
        self._actions = {part: Action(Gains.named(config.gains).settle) for part in robot.parts}
        self._drives = Drives(service, robot)
        self._motions = MotionPublisher(service.bus, robot, self._law, self._actions)
        self._commands = CommandPublisher(service, config.ttl, self._law, self._actions, self._drives)
        self._reaches = Reaches(service.bus, robot, self._law, self._actions)
        self._goals = GoalServer(service, robot, self._law, self._actions, self._reaches, self._commands)
        self._tick: Tick | None = None  # waits for its forces
        self._timer: Timer | None = None  # free mode: end of that wait
        self._mark()
        service.mark, service.describe = self._mark, self._describe
        service.on_run(self._new_run)
        service.on_newest(Forces, self._take_forces, "model")
        service.on_newest(Targets, self._reaches.follow_targets)
        service.on_tick(self._begin)
        if service.locked:
            service.on_alive(self._note_alive)

    # The wait for forces

    def _begin(self, tick: Tick) -> None:
        if tick.mode == "paused":
            self._goals.paused_at = tick.k
            return
        if tick.dt / 1e9 >= self._law.max_dt:
            limit = 1e3 * self._law.max_dt
            self._service.bus.reject("rate", f"ticks of {tick.dt / 1e6:g} ms: these gains are stable below {limit:.4g} ms only")
            return
        self._tick = tick
        self._commands.begin_tick()
        if self._law.forces.answer(tick.k):
            self._step()
        elif tick.mode == "lock":
            self._step_without_model()
        else:
            half = 0.5e-9 * tick.dt / tick.rate  # s of real time
            self._timer = self._service.inbox.at(time.monotonic() + half, partial(self._stop_waiting, tick.k))

    def _take_forces(self, forces: Forces) -> None:
        if why := self._law.forces.take(forces):
            self._service.bus.reject("value", f"forces of tick {forces.re_k}: {why}")
        elif self._tick is not None and forces.re_k >= self._tick.k:
            self._step()

    def _stop_waiting(self, k: int) -> None:
        if self._tick is not None and self._tick.k == k:
            self._counters.late_forces += 1
            self._step()

    def _step_without_model(self) -> None:
        """In lockstep, make the pending step without the model's forces if no model is running; otherwise it waits for the forces."""
        if self._tick is not None and not self._service.alive.get("model"):
            self._law.forces.forget()
            self._step()

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        if who == "model" and not up:
            self._step_without_model()

    # One tick

    def _step(self) -> None:
        tick, self._tick = self._tick, None
        if self._timer is not None:
            self._timer.cancel()  # otherwise it would wake the process half a tick later
            self._timer = None
        if tick is None:
            return
        self._law.measure(np.array(tick.q))
        fresh = self._law.forces.are_fresh(tick.k)
        is_stopped = self._drives.watch_stop(tick.parts)
        self._supervise(tick, fresh, is_stopped)
        if self._goals.paused_at is not None and tick.k > self._goals.paused_at:  # the parts are in hold now
            self._goals.paused_at = None
        orders, reference = self._control(tick, fresh, is_stopped) if tick.k > 0 else ({}, self._law.q)
        if tick.mode == "lock":
            self._motions.publish(tick)  # first: a service that gets its turn must know the state of its action
            self._commands.send_and_answer(tick, fresh, orders, reference)
        else:
            self._commands.send(tick.k, orders, reference)
            self._motions.publish(tick)
            self._reaches.publish_regularly(tick)

    def _supervise(self, tick: Tick, fresh: bool, is_stopped: bool) -> None:
        """Arm the parts that can be armed; a part that is not under control has no action and rests where it is.

        In the tick in which the controller learns of an emergency stop (`is_stopped`), no part is under control, although its status may
        be older than the stop.
        """
        for part, action in self._actions.items():
            state = tick.parts[part]
            lacking = "no fresh forces" if not fresh else "no fresh state" if tick.t - state.t > MAX_STATE_AGE else ""
            if is_stopped or lacking or not self._drives.is_armed(part, state):
                if not is_stopped and not lacking:
                    self._drives.try_arm(part, state)
                why = "emergency stop" if is_stopped else lacking or f"gate {state.gate}"
                self._lose(part, tick, why, not is_stopped and action.may_continue(tick.t * 1e-9, state.gate))
                self._law.rest(part)
                self._counters.held_ticks += 1
            elif action.is_in_hold:
                self._regain(part, tick)

    def _lose(self, part: str, tick: Tick, why: str, may_continue: bool) -> None:
        """Suspend the action of a part that is not under control, or end it and hold the part if the action must not continue later.

        A suspended action remains suspended as long as it may continue. `why`: the reason, for the messages.
        """
        action = self._actions[part]
        if may_continue and action.status == "moving":
            action.suspend(tick.k, tick.t * 1e-9)
            self._law.clear_client_forces(part)
            self._service.bus.event("warning", "suspended", f"{part} holds, and its action waits: {why}")
        elif action.status != "held" and not may_continue:
            self._hold(part, tick.k, why)

    def _regain(self, part: str, tick: Tick) -> None:
        """Continue with a part that is under control again, from rest: with its suspended action, or without an action."""
        action = self._actions[part]
        self._law.rest(part)
        if action.status == "suspended" and action.target is not None:
            self._law.set_attractor(part, action.target)
            action.settle_again(tick.k, tick.t * 1e-9)
            return
        if action.owner is None:
            self._law.seek_posture(part)
        action.resume(tick.k)

    def _control(self, tick: Tick, fresh: bool, is_stopped: bool) -> tuple[dict[str, Order], Array]:
        """Return the orders to the parts, and their reference (n,).

        Without fresh forces, and in an emergency stop, every part that follows commands is ordered to hold (to brake and stand still).
        """
        ticks = self._law.count_ticks(tick.k)
        self._counters.ticks += 1
        self._counters.long_gaps += ticks > MAX_TICKS
        if not self._service.locked:  # in lockstep ticks have no period
            self._counters.note_step(ticks * tick.dt / 1e9 / tick.rate)
        followers = [part for part, state in tick.parts.items() if (is_stopped or not fresh) and self._drives.is_armed(part, state)]
        holds = {part: Order(self._drives.epochs[part], "hold") for part in followers}
        if not fresh:
            return holds, self._law.q
        reference = self._law.step(tick, min(ticks, MAX_TICKS))
        speeds = {part: self._law.settle_speeds(part) for part in self._actions}
        moving = {part: action for part, action in self._actions.items() if not action.is_in_hold}
        for part, action in moving.items():
            action.update(tick.k, tick.t * 1e-9, *speeds[part], partial(self._law.is_approaching, part))
            self._reaches.update(part, tick)
        return holds or {part: Order(self._drives.epochs[part], self._config.modality) for part in moving}, reference

    def _hold(self, part: str, k: int, why: str) -> None:
        self._actions[part].hold(k)
        self._end_requests(part)
        self._service.bus.event("warning", "held", f"{part} holds: {why}", epoch=float(self._drives.epochs[part]))

    def _end_requests(self, part: str) -> None:
        self._reaches.interrupt(part)
        self._law.clear_client_forces(part)

    # Life cycle

    def _new_run(self) -> None:
        for part in self._robot.parts:
            self._service.ask(keys.meta(part), PartMeta, self._note_meta)
        self._drives.forget()
        self._tick = self._goals.paused_at = None
        self._commands.begin_tick()
        self._law.reset()
        for part, action in self._actions.items():
            action.hold(self._service.bus.k)
            self._end_requests(part)

    def _note_meta(self, answer: PartMeta | CallFailed) -> None:
        """Limit the torques of a part as robot_sim does, so that its gate accepts them.

        The process ends, before any part is armed, if robot_sim moves another robot, which may have the same number of motors.
        """
        if isinstance(answer, CallFailed):
            self._service.log.info("robot_sim did not answer which robot it moves: %s", answer)
        elif answer.robot_hash != robot_hash(self._robot):
            robots = f"robot_sim moves the robot {answer.robot!r}, the controller has {self._config.robot!r}"
            self._service.bus.event("error", "other_robot", f"{robots}: set the same in both, as shared.robot")
            raise SystemExit(BAD_INPUT)
        else:
            self._law.limit_torques(answer.part, np.array(answer.max_torque))

    def _mark(self) -> None:
        self._counters = Counters()

    def _describe(self) -> tuple[str, Mapping[str, float]]:
        controlled = [part for part, action in self._actions.items() if not action.is_in_hold]
        return f"{len(controlled)} of {len(self._actions)} parts under control", self._counters.numbers()
