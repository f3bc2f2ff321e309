# SPDX-License-Identifier: Apache-2.0
"""robot_sim as a process; the test plays router, controller, model and everybody else."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from bus_schema import keys
from bus_schema.messages import Clock, Command, Event, State, Truth
from bus_schema.rpc import Driven, Take, Taken, WithEpoch
from mobee.robot.load import load_robot
from tests.services.harness import Rig, wait_for

ROBOT = load_robot("icub")
ELBOW = 3
ARM = len(ROBOT.part("left_arm"))
DT = 0.01


class Bench:
    """The process under test and all it says; plus a controller's hands."""

    def __init__(self, bus: Rig, *arguments: str) -> None:
        self.rig = bus
        self.clocks: list[Clock] = bus.record(Clock)
        self.states: dict[str, list[State]] = {part: bus.record(State, part) for part in ROBOT.parts}
        self.events: list[Event] = bus.record(Event, "robot_sim")
        self.truths: list[Truth] = bus.record(Truth)
        self.commands = {part: bus.bus.publisher(Command, part) for part in ROBOT.parts}
        bus.token("controller", "c1")
        self.program = bus.start("services.robot_sim", "robot_sim", "--seed", "7", *arguments)
        self.follow()

    def follow(self) -> None:
        """Follow the run that has begun: late messages of the run before are ignored."""
        before = self.rig.bus.run
        wait_for(lambda: self.clocks and self.clocks[-1].run != before, "the new run")
        self.rig.bus.run = self.clocks[-1].run
        wait_for(lambda: all(states and states[-1].run == self.rig.bus.run for states in self.states.values()), "its states")

    def newest(self, part: str) -> State:
        return self.states[part][-1]

    def now(self) -> int:
        """The tick in which robot_sim is: what the test has heard of may be older."""
        found = re.search(r"tick (\d+)", self.rig.stat("robot_sim").text)
        assert found
        return int(found[1])

    def next_state(self, part: str) -> State:
        """One that was sampled after now."""
        return self.state_after(part, self.now())

    def state_after(self, part: str, k: int) -> State:
        """The first sampled after tick k of this run."""
        run, states = self.rig.bus.run, self.states[part]
        wait_for(lambda: states[-1].run == run and states[-1].k > k, f"a state of {part} after tick {k}")
        return next(state for state in states if state.run == run and state.k > k)

    def events_since(self, since: int, part: str = "") -> list[Event]:
        """Events of this run from tick `since` on, which may come late; those that begin with the part's name."""
        return [e for e in list(self.events) if e.run == self.rig.bus.run and e.k >= since and e.text.startswith(part)]

    def hears(self, code: str, since: int, says: str = "") -> Event:
        return wait_for(lambda: next((e for e in self.events_since(since) if e.code == code and says in e.text), None), f"the event {code}")

    def drive(self, part: str, verb: str, epoch: int) -> str:
        return str(self.rig.call(keys.drive(part, verb), WithEpoch, Driven, who="controller", epoch=epoch).gate)

    def free(self, part: str) -> None:
        """Release the part, so that it has no owner."""
        self.drive(part, "release", self.take(part))

    def take(self, part: str, instance: str = "c1") -> int:
        return int(self.rig.call(keys.drive(part, "take"), Take, Taken, who="controller", instance=instance).epoch)

    def arm(self, part: str) -> int:
        epoch = self.take(part)
        assert self.drive(part, "arm", epoch) == "armed"
        return epoch

    def send(self, part: str, epoch: int, ref: list[float], mode: str = "velocity", ttl: int = 1000, **fields: Any) -> None:
        fields.setdefault("re_k", self.clocks[-1].k)
        self.commands[part].put(epoch=epoch, mode=mode, ref=ref, ttl=ttl, **fields)

    def keep(self, part: str, epoch: int, seconds: float, ref: Callable[[], list[float]], **fields: Any) -> State:
        """Answer every tick for a time of robot_sim's clock; the part's first state after it."""
        end = self.clocks[-1].t + seconds * 1e9
        while self.clocks[-1].t < end:
            seen = len(self.clocks)
            self.send(part, epoch, ref(), **fields)
            wait_for(lambda seen=seen: len(self.clocks) > seen, "a tick")
        return self.state_after(part, int(end / self.clocks[-1].dt))

    def refuses(self, reason: str, send: Callable[[], None]) -> None:
        """Send until that is counted: what the test sends may come late, and is then refused as too old."""
        counted = self.rejected(reason)

        def is_counted() -> bool:
            send()
            return self.rejected(reason) > counted

        wait_for(is_counted, reason)

    def rejected(self, reason: str) -> int:
        return self.rig.stat("robot_sim").rejected.get(reason, 0)

    def numbers(self) -> dict[str, float]:
        return self.rig.stat("robot_sim").numbers


def elbow(value: float) -> list[float]:
    ref = [0.0] * ARM
    ref[ELBOW] = value
    return ref
