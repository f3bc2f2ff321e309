"""Runs the controller: once a tick, from the parts' states and the model's forces to the commands."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial

import numpy as np

from bus_schema import keys
from bus_schema.messages import EStop, Mode, Order, Targets, Tick
from bus_schema.messages import Forces as ForcesMessage
from bus_schema.rpc import PartMeta
from mobee import Controller, Gains, Model
from mobee._core.tables import Table
from mobee.arrays import Array
from mobee.control import Command, Forces
from mobee.control.checked import LARGEST_FORCE
from mobee.control.forces import needs_contacts, told_terms
from mobee.errors import InvalidValue
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from services.common.exit_codes import BAD_INPUT
from services.common.inbox import CROWDED_WITH_STOPS, Timer
from services.common.rpc import CallFailed
from services.common.service import Service
from services.common.worlds import robot_hash
from services.controller.action import Action
from services.controller.commanding import Commanding, Counters, Telling
from services.controller.config import Config
from services.controller.drives import Drives
from services.controller.goals import GoalDesk
from services.controller.reaches import ReachesUnderWay
from services.controller.terms import ToldContacts, load_terms
from services.controller.warm import warm

OLDEST = 3  # ticks: with forces older than that the robot holds
STALE = 100_000_000  # ns: a part whose state is older than that is not under control


class ControllerNode:
    """Waits for the forces of the tick, steps the law, commands the parts that obey."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._service, self._config, self._robot = service, config, robot
        gains = Gains.named(config.gains)
        self._model = Model(robot)  # knows no world
        self._law = Controller(self._model, gains, config.modality, speed_scale=config.speed_scale, terms=load_terms(config.terms))
        self._needs_contacts = bool(self._law.terms) or needs_contacts()
        self._own_forces = service.bus.publisher(ForcesMessage, "controller", "LATEST")
        self._actions = {part: Action(gains.settle) for part in robot.parts}
        self._drives = Drives(service, robot)
        self._forces: ForcesMessage | None = None
        self._acting: Forces  # the same as vectors
        self._q: Array = robot.home  # measured, at the newest tick
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._units = fine_units(robot)
        self._tick: Tick | None = None  # that still waits for its forces
        self._patience: Timer | None = None  # how long, in free mode
        self._last_k = -1
        self._last: tuple[Tick, dict[str, Order], Table] | None = None  # step that commanded: its orders, and the law's state before
        self._telling = Telling(service.bus, robot, self._law, self._actions)
        self._commanding = Commanding(service, config.ttl, self._actions, self._drives)
        self._mark()
        service.mark, service.describe = self._mark, self._describe
        warm(self._law, robot)
        self._reaches = ReachesUnderWay(service.bus, robot, self._law, self._actions, lambda: self._q)
        self._goals = GoalDesk(service, robot, self._law, self._actions, self._reaches, self._stay, self._amend)
        service.on_run(self._new_run)
        service.on_newest(ForcesMessage, self._take_forces, "model")
        service.on_newest(Targets, self._reaches.aim)
        service.on_each(EStop, self._drives.note_stop, any_run=True, crowd=CROWDED_WITH_STOPS)
        service.on_tick(self._begin)
        if service.locked:
            service.on_alive(self._note_alive)

    def _begin(self, tick: Tick) -> None:
        if tick.mode == "paused":
            return
        if tick.dt / 1e9 >= self._law.max_dt:
            self._service.bus.reject("rate", f"ticks of {tick.dt / 1e6:g} ms: these gains need less than {1e3 * self._law.max_dt:.4g} ms")
            return
        self._tick = tick
        self._commanding.forget()
        if self._forces is not None and self._forces.re_k >= tick.k:
            self._step()
        elif tick.mode == "lock":
            self._go_without_model()
        else:
            k = tick.k
            self._patience = self._service.inbox.at(time.monotonic() + 0.5e-9 * tick.dt / tick.rate, lambda: self._wait_is_over(k))

    def _take_forces(self, forces: ForcesMessage) -> None:
        why = self._refusal(forces)
        if why:
            self._service.bus.reject("value", f"forces of tick {forces.re_k}: {why}")
            return
        self._forces, self._acting = forces, Forces(**{name: np.array(row) for name, row in forces.terms.items()})
        if self._tick is not None and forces.re_k >= self._tick.k:
            self._step()

    def _refusal(self, forces: ForcesMessage) -> str:
        """What is wrong with forces, empty if nothing is."""
        terms = forces.terms
        if terms.keys() != set(told_terms()):
            return f"they are {', '.join(terms) or 'none'}; the law has {', '.join(told_terms())}"
        largest = LARGEST_FORCE / len(terms)
        if any(max(row, default=0.0) > largest or min(row, default=0.0) < -largest for row in terms.values()):
            return "larger than any law makes them"
        if self._needs_contacts and forces.contacts is None:
            return "without the contacts, on which this controller's terms may depend: set shared.terms"
        links = max((max(c.first_link, c.second_link) for c in forces.contacts or ()), default=-1)
        return f"a contact of link {links}, there are {len(self._robot.links)}" if links >= len(self._robot.links) else ""

    def _go_without_model(self) -> None:
        """Lockstep: a tick waits for its forces as long as there is somebody to send them."""
        if self._tick is not None and not self._service.alive.get("model"):
            self._forces = None
            self._step()

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        if who == "model" and not up:
            self._go_without_model()

    def _wait_is_over(self, k: int) -> None:
        if self._tick is not None and self._tick.k == k:
            self._counters.late_forces += 1
            self._step()

    def _step(self) -> None:
        tick, self._tick = self._tick, None
        if self._patience is not None:
            self._patience.cancel()  # or half a tick later it wakes the process for nothing
            self._patience = None
        if tick is None:
            return
        self._q = np.array(tick.q)
        fresh = self._forces is not None and self._are_fresh(self._forces, tick.k)
        self._supervise(tick, fresh)
        self._last = None
        orders, reference = self._control(tick, fresh) if tick.k > 0 else ({}, self._q)
        if tick.mode == "lock":
            self._telling.tell(tick, self._q, self._forces)  # who hears that it is its turn must have heard where its action stands
            self._commanding.close(tick, self._forces, fresh, orders, reference)
        else:
            self._commanding.command(tick.k, orders, reference)
            self._telling.tell(tick, self._q, self._forces)
            self._reaches.tell(tick)

    def _control(self, tick: Tick, fresh: bool) -> tuple[dict[str, Order], Array]:
        """What becomes of each part in this tick."""
        gap, self._last_k = max(tick.k - self._last_k, 1) if self._last_k >= 0 else 1, tick.k
        self._counters.ticks += 1
        self._counters.long_gaps += gap > OLDEST
        if not self._service.locked:  # in lockstep no tick is due
            self._counters.watch_period(gap * tick.dt / 1e9 / tick.rate)
        return self._advance(tick, min(gap, OLDEST)) if fresh else (self._starve(tick), self._q)

    def _are_fresh(self, forces: ForcesMessage, k: int) -> bool:
        """Whether they answer a tick near k, and were formed of states of all parts near that tick: a contact concerns many."""
        return abs(k - forces.re_k) <= OLDEST and all(forces.part_age.get(part, STALE + 1) <= STALE for part in self._where)

    def _supervise(self, tick: Tick, fresh: bool) -> None:
        """Arm what can be armed; what is not under control has no action and rests where it is."""
        for part, action in self._actions.items():
            state = tick.parts[part]
            lacking = "no fresh forces" if not fresh else "no fresh state" if tick.t - state.t > STALE else ""
            if lacking or not self._drives.armed(part, state):
                if not lacking:
                    self._drives.try_arm(part, state)
                if action.status != "held":
                    self._held(part, tick.k, lacking or f"gate {state.gate}")
                self._law.rest(part, self._q[self._where[part]])
                self._counters.held_ticks += 1
            elif action.status == "held":
                self._law.rest(part, self._q[self._where[part]])
                self._seek_posture(part)
                action.resume(tick.k)

    def _advance(self, tick: Tick, ticks: int) -> tuple[dict[str, Order], Array]:
        """Step the law over the ticks that have passed, and command what is armed."""
        for _ in range(ticks):
            before = self._law.state.copy()
            command = self._step_law(tick)
        modality: Mode = self._config.modality
        velocity, acceleration = self._law.velocity / self._units, self._law.acceleration / self._units
        touched = self._forces.touched if self._forces is not None else {}
        orders = {}
        for part, action in self._actions.items():
            if action.status != "held":
                where = self._where[part]
                orders[part] = Order(self._drives.epochs[part], modality)
                action.look(tick.k, tick.t * 1e-9, velocity[where], acceleration[where], partial(self._law.still_nears, part))
                self._reaches.look(part, tick, touched.get(part, []))
        self._last = tick, orders, before
        return orders, getattr(command, modality)

    def _step_law(self, tick: Tick) -> Command:
        """One step under the forces of the model, with the forces from outside at its contacts."""
        if not self._needs_contacts:
            return self._law.step(self._q, tick.dt / 1e9, self._acting)
        pose = self._model.evaluate(self._q)
        pose.feel(ToldContacts(pose, self._forces.contacts or () if self._forces is not None else ()))
        try:
            command = self._law.step(self._q, tick.dt / 1e9, self._acting, pose)
        except InvalidValue as error:  # a term that gives no force now would give none after a restart
            self._service.bus.event("error", "term", str(error))
            raise SystemExit(BAD_INPUT) from None
        if self._own_forces.heard:
            own = {name: row.tolist() for name, row in self._law.last_forces.items() if name not in self._acting}
            self._own_forces.put(re_k=tick.k, terms=own, part_age={}, touched={})
        return command

    def _amend(self, part: str) -> None:
        """Free mode: what was asked between two ticks is not to wait for the next; the last step is made anew and commanded."""
        if self._service.locked or self._tick is not None or self._last is None or part not in self._last[1]:
            return
        tick, orders, before = self._last
        self._law.state[:] = before
        command = self._step_law(tick)
        self._commanding.command(tick.k, orders, getattr(command, self._config.modality))

    def _starve(self, tick: Tick) -> dict[str, Order]:
        """No forces, no motion: tell every part that still obeys to hold."""
        return {part: Order(self._drives.epochs[part], "hold") for part, state in tick.parts.items() if self._drives.armed(part, state)}

    def _held(self, part: str, k: int, why: str) -> None:
        self._actions[part].hold(k)
        self._goals.end(part)
        self._service.bus.event("warning", "held", f"{part} is in hold ({why})", epoch=float(self._drives.epochs[part]))

    def _stay(self, part: str) -> None:
        """Its owner is gone: brake and stay where it is, or go to its posture if one is given."""
        if self._last_k >= 0:
            self._law.hold(part, self._q[self._where[part]])
            self._last = None
            self._seek_posture(part)

    def _seek_posture(self, part: str) -> None:
        if self._actions[part].owner is None and part in self._config.posture:
            self._law.set_attractor(part, np.array(self._config.posture[part]))

    def _compare(self, answer: PartMeta | CallFailed) -> None:
        """Commands for one robot must not reach another of as many motors: then this process ends, and nothing is armed."""
        if isinstance(answer, CallFailed):
            self._service.log.info("which robot robot_sim moves is not known: %s", answer)
        elif answer.robot_hash != robot_hash(self._robot):
            self._service.bus.event(
                "error", "other_robot", f"robot_sim moves another robot ({answer.robot}) than {self._config.robot}: give both the same"
            )
            raise SystemExit(BAD_INPUT)

    def _new_run(self) -> None:
        self._service.ask(keys.meta(next(iter(self._robot.parts))), PartMeta, self._compare)
        self._drives.forget()
        self._forces, self._tick, self._last_k, self._last = None, None, -1, None
        self._commanding.forget()
        self._law.reset(self._robot.home)
        for part, action in self._actions.items():
            action.hold(self._service.bus.k)
            self._goals.end(part)

    def _mark(self) -> None:
        self._counters = Counters()

    def _describe(self) -> tuple[str, Mapping[str, float]]:
        under = [part for part, action in self._actions.items() if action.status != "held"]
        return f"{len(under)} of {len(self._actions)} parts under control", self._counters.numbers()
