"""robot_sim as a process; the test plays router, controller, model and everybody else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bus_schema import keys
from bus_schema.messages import Clock, Command, Event, State, Truth
from bus_schema.rpc import Driven, Take, Taken, WithEpoch
from mobee.robot.load import load_robot
from services.common.delivery import LATEST
from tests.services.harness import Rig, wait_for

ROBOT = load_robot("icub")
ELBOW = 3
ARM = len(ROBOT.part("left_arm"))
DT = 0.01


class Bench:
    """The process under test and all it says; plus a controller's hands."""

    def __init__(self, bus: Rig, *arguments: str) -> None:
        self.rig = bus
        self.clocks: list[Clock] = bus.record(keys.CLOCK, Clock)
        self.states: dict[str, list[State]] = {part: bus.record(keys.state(part), State, part) for part in ROBOT.parts}
        self.events: list[Event] = bus.record(keys.event("robot_sim"), Event)
        self.truths: list[Truth] = bus.record(keys.SIM_TRUTH, Truth)
        self.commands = {part: bus.bus.publisher(keys.command(part), Command, LATEST) for part in ROBOT.parts}
        bus.token("controller", "c1")
        self.program = bus.start("services.robot_sim", "robot_sim", "--seed", "7", *arguments)
        self.follow()

    def follow(self) -> None:
        """Take up the run that goes on now."""
        seen = len(self.clocks)
        wait_for(lambda: len(self.clocks) > seen and all(self.states.values()), "the streams")
        self.rig.bus.run = self.clocks[-1].run

    def newest(self, part: str) -> State:
        return self.states[part][-1]

    def next_state(self, part: str) -> State:
        """One that was sampled after now."""
        seen = len(self.states[part])
        wait_for(lambda: len(self.states[part]) > seen + 1, f"a state of {part}")
        return self.newest(part)

    def drive(self, part: str, verb: str, epoch: int) -> str:
        return str(self.rig.call(keys.drive(part, verb), WithEpoch, Driven, who="controller", epoch=epoch).gate)

    def free(self, part: str) -> None:
        """Have the part belong to nobody."""
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

    def keep(self, part: str, epoch: int, seconds: float, ref: Callable[[], list[float]], **fields: Any) -> None:
        """Answer every tick for a time of robot_sim's clock."""
        end = self.clocks[-1].t + seconds * 1e9
        while self.clocks[-1].t < end:
            seen = len(self.clocks)
            self.send(part, epoch, ref(), **fields)
            wait_for(lambda seen=seen: len(self.clocks) > seen, "a tick")

    def rejected(self, reason: str) -> int:
        return self.rig.stat("robot_sim").rejected.get(reason, 0)

    def numbers(self) -> dict[str, float]:
        return self.rig.stat("robot_sim").numbers


def elbow(value: float) -> list[float]:
    ref = [0.0] * ARM
    ref[ELBOW] = value
    return ref
