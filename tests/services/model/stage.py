# SPDX-License-Identifier: Apache-2.0
"""The model as a process: the test plays robot_sim, vision and the clients that edit the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import Contacts, Forces, Geometry, Message, Pose, WorldObject
from bus_schema.rpc import (
    Done,
    Empty,
    ObjectState,
    World,
)
from mobee import Model, load_robot, load_world
from mobee.arrays import Array
from tests.services.fake_sim import FakeSim
from tests.services.harness import Program, Rig, wait_for

TICK = 10_000_000  # ns
BALL = Geometry(kind="sphere", size=[0.03])
UPRIGHT = [1.0, 0.0, 0.0, 0.0]


@dataclass
class Stage:
    """The model under test and its messages."""

    rig: Rig
    sim: FakeSim
    model: Program
    forces: list[Forces]
    poses: list[Pose]
    contacts: list[Contacts]

    def tick(self, **how: Any) -> Forces:
        """One tick of the simulator, and the model's whole answer to it."""
        k = self.sim.tick(**how)
        for stream in (self.contacts, self.forces):
            self.wait_for_answer(stream, k)
        return self.forces[-1]

    def wait_for_answer(self, stream: Sequence[Message], k: int) -> None:
        """The newest of a stream answers tick k of this run; runs before had a tick k too."""
        wait_for(lambda: stream and (stream[-1].run, stream[-1].re_k) == (self.rig.bus.run, k), f"the answer to tick {k}")

    def at(self, q: Array) -> Forces:
        self.sim.q = q.copy()
        return self.tick()

    def edit(self, verb: str, request: type[Any], **fields: Any) -> None:
        self.rig.call(keys.world_rpc(verb), request, Done, **fields)

    def world(self) -> dict[str, ObjectState]:
        return {o.name: o for o in self.listed().objects}

    def listed(self) -> World:
        return self.rig.call(keys.world_rpc("list"), Empty, World)

    def numbers(self) -> dict[str, float]:
        return self.rig.stat("model").numbers

    def perceive(self, position: list[float], valid_for: int = 50, **fields: Any) -> None:
        """As vision does; `valid_for` ticks."""
        t = self.rig.bus.t
        same = {"name": "ball", "geometry": BALL, "quaternion": UPRIGHT, "role": "target", "covariance": [0.0] * 9, "t_capture": t}
        publisher = self.rig.bus.publisher(WorldObject, "ball")
        publisher.put(position=position, valid_until=t + valid_for * TICK, **{**same, **fields})


def staged(made: Rig, *arguments: str) -> Stage:
    sim = FakeSim(made)
    streams = (made.record(Forces, "model"), made.record(Pose), made.record(Contacts))
    return Stage(made, sim, made.start("services.model", "model", *arguments), *streams)


def library() -> Model:
    """The world that the model service should have: the table's world without objects that only vision reports."""
    world = load_world("table")
    for name in [name for name, thing in world.objects.items() if thing.role == "target"]:
        world.remove(name)
    return Model(load_robot("icub"), world)


def on_the_table() -> Array:
    """A pose whose left arm pushes into the table's field, found with the library."""
    model, rng = library(), np.random.default_rng(5)
    robot = model.robot
    where = robot.part("left_arm").slice
    for _ in range(2000):
        q = robot.home.copy()
        q[where] = rng.uniform(*robot.limits[where].T)
        if any(c.second == "table" for c in model.evaluate(q).contacts):
            return q
    raise AssertionError("no such pose")
