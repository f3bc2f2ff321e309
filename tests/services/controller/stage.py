# SPDX-License-Identifier: Apache-2.0
"""The controller as a process: the test plays robot_sim, the model and the agents."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import Command, Message, Motion
from bus_schema.rpc import Done, Force, Goal, Started, Take, Taken
from mobee import Gains, load_robot
from mobee.arrays import Array
from services.common.rpc import CallFailed
from tests.services.fake_model import FakeModel
from tests.services.fake_sim import FakeSim
from tests.services.harness import Program, Rig, wait_for

ROBOT = load_robot("icub")
PARTS = tuple(ROBOT.parts)
HEAD = [-0.3, 0.0, 0.1, 0.0, 0.0, 0.0]
SETTLE = Gains.published_2014().settle


@dataclass
class Stage:
    """The controller under test and its messages."""

    rig: Rig
    sim: FakeSim
    model: FakeModel
    controller: Program
    motions: dict[str, list[Motion]]
    owned: list[tuple[str, str]] = field(default_factory=list)
    names: Iterator[int] = field(default_factory=lambda: itertools.count(1))

    def motion(self, part: str) -> Motion:
        return self.motions[part][-1]

    def answered(self, k: int) -> bool:
        """Every part's motion has come, and its command if it obeys: each comes on a thread of its own."""
        return all(self._is_of(k, motions) for motions in self.motions.values()) and all(
            self._is_of(k, self.sim.commands[part]) for part in PARTS if self.motion(part).status != "held"
        )

    def _is_of(self, k: int, stream: Sequence[Message]) -> bool:
        return bool(stream) and (stream[-1].run, stream[-1].k) == (self.rig.bus.run, k)

    def tick(self, **how: Any) -> int:
        k = self.sim.tick(**how)
        wait_for(lambda: self.answered(k), f"motion {k}")
        return k

    def ticks(self, n: int) -> None:
        for _ in range(n):
            self.tick()

    def play(self, until: Callable[[], Any], what: str, ticks: int = 3000) -> Any:
        return self.sim.play(until, what, self.answered, ticks)

    def statuses(self) -> set[str]:
        return {self.motion(part).status for part in PARTS}

    def under_control(self) -> None:
        def reached() -> bool:
            known = all(motions and motions[-1].run == self.rig.bus.run for motions in self.motions.values())
            return known and self.statuses() == {"idle"}

        self.play(reached, "all parts under control")

    def own(self, part: str, who: str = "agent_test") -> tuple[str, int]:
        """A new agent that owns the part's goal: its instance and epoch."""
        instance = f"n{next(self.names)}"
        self.rig.token(who, instance)
        self.owned.append((who, instance))
        return instance, wait_for(lambda: self.take(part, instance, who), "the goal")

    def take(self, part: str, instance: str, who: str = "agent_test") -> int | None:
        """None while the controller has not seen the token."""
        try:
            return int(self.rig.call(keys.goal(part, "take"), Take, Taken, who=who, instance=instance).epoch)
        except CallFailed as error:
            if error.code == "token":
                return None
            raise

    def leave(self, who: str, instance: str) -> None:
        self.owned.remove((who, instance))
        self.rig.drop_token(who, instance)

    def goal(self, part: str, epoch: int, q: Array, action: str = "a") -> Started:
        return self.rig.call(keys.goal(part, "goal"), Goal, Started, epoch=epoch, action_id=action, q=[float(x) for x in q])

    def force(self, part: str, epoch: int, **fields: Any) -> None:
        self.rig.call(keys.goal(part, "force"), Force, Done, epoch=epoch, **fields)

    def commands(self, part: str, since: int = 0) -> list[Command]:
        return [c for c in self.sim.commands[part] if c.run == self.rig.bus.run and c.re_k > since]

    def numbers(self) -> dict[str, float]:
        return self.rig.stat("controller").numbers


def staged(made: Rig, *arguments: str) -> Stage:
    sim = FakeSim(made)
    model = FakeModel(made, sim)
    motions = {part: made.record(Motion, part) for part in PARTS}
    return Stage(made, sim, model, made.start("services.controller", "controller", *arguments), motions)


def near(part: str, shift: float = 0.3) -> Array:
    """A valid posture of the part, at a distance from home."""
    p = ROBOT.part(part)
    low, high = ROBOT.limits[p.slice].T
    return np.clip(ROBOT.home[p.slice] + shift, low + 0.2 * (high - low), high - 0.2 * (high - low))


def refused(code: str, call: Callable[[], Any]) -> str:
    with pytest.raises(CallFailed) as caught:
        call()
    assert caught.value.code == code
    return str(caught.value)
