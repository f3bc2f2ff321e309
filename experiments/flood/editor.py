"""One of several threads that edit the same world in every way there is."""

from __future__ import annotations

import random
from collections.abc import Mapping

import numpy as np

from experiments.flood.boxes import Box, random_boxes
from mobee import InvalidValue, World
from mobee.collision import WorldObject, box
from mobee.collision.world_object import Role
from mobee.robot.robot import Robot

OWN = (5, 30)  # objects of a thread, least and most
CARRIED = 3  # of them attached at a time, at most
SHARED = ("shared 0", "shared 1", "shared 2")  # that all threads fight for
ROLES: tuple[Role, ...] = ("obstacle", "target", "ghost")
STEP, STEPS = 1e-3, 1000  # m; the two witnesses of a thread walk that way, and begin again
POOL = 500


class Editor:
    """Edits its own objects, of which it knows the state, so that none of these edits may be refused; and those of all.

    Two objects of its own are its witnesses: it always moves the first one a step, then the second.
    """

    def __init__(self, world: World, robot: Robot, shipped: str, number: int, seed: int) -> None:
        self.edits = self.refused = 0
        self._world, self._links, self._number = world, robot.links, number
        self._random = random.Random(f"{seed} {number}")
        self._boxes = random_boxes(np.random.default_rng([seed, number]), shipped, POOL)
        self._free: list[str] = []
        self._attached: list[str] = []
        self._made = self._step = 0
        for name in witnesses(number):
            world.add(name, box(0.05, 0.05, 0.05), position=self._witness_place())

    def edit(self) -> None:
        """One edit, or two of the witnesses."""
        kinds = (self._add, self._remove, self._move, self._role, self._attach, self._detach, self._walk, self._fight)
        self._random.choices(kinds, weights=(4, 4, 8, 2, 1, 1, 4, 2))[0]()
        self.edits += 1

    def _add(self) -> None:
        if len(self._free) + len(self._attached) >= OWN[1]:
            return self._remove()
        name, new = f"{self._number}:{self._made}", self._box()
        self._world.add(name, new.shape, position=new.position, rotation=new.rotation, role=self._random.choice(ROLES))
        self._free.append(name)
        self._made += 1

    def _remove(self) -> None:
        names = self._free if self._random.random() < 0.8 or not self._attached else self._attached
        if len(self._free) + len(self._attached) <= OWN[0] or not names:
            return self._add()
        self._world.remove(names.pop(self._random.randrange(len(names))))

    def _move(self) -> None:
        if self._free:
            new = self._box()
            self._world.move(self._random.choice(self._free), position=new.position, rotation=new.rotation)

    def _role(self) -> None:
        names = self._free + self._attached
        if names:
            self._world.set_role(self._random.choice(names), self._random.choice(ROLES))

    def _attach(self) -> None:
        if self._free and len(self._attached) < CARRIED:
            name = self._free.pop(self._random.randrange(len(self._free)))
            self._world.attach(name, self._random.choice(self._links))
            self._attached.append(name)

    def _detach(self) -> None:
        if self._attached:
            name = self._attached.pop(self._random.randrange(len(self._attached)))
            self._world.detach(name)
            self._free.append(name)

    def _walk(self) -> None:
        self._step = (self._step + 1) % STEPS
        for name in witnesses(self._number):
            self._world.move(name, position=self._witness_place())

    def _fight(self) -> None:
        name, new = self._random.choice(SHARED), self._box()
        what = self._random.randrange(4)
        try:
            if what == 0:
                self._world.move(name, position=new.position, rotation=new.rotation)
            elif what == 1:
                self._world.set_role(name, self._random.choice(ROLES))
            elif what == 2:
                self._world.attach(name, self._random.choice(self._links))
            else:
                self._world.detach(name)
        except InvalidValue:  # attached by another thread, or by none: who loses is told
            self.refused += 1

    def _box(self) -> Box:
        return self._random.choice(self._boxes)

    def _witness_place(self) -> tuple[float, float, float]:
        return STEP * self._step, 0.0, 5.0 + self._number


def witnesses(number: int) -> tuple[str, str]:
    """The two objects that thread `number` moves one after the other."""
    return f"{number}:first", f"{number}:second"


def out_of_order(objects: Mapping[str, WorldObject], threads: int) -> str | None:
    """Which thread's edits are seen in another order than it made them; None if none are."""
    for number in range(threads):
        first, second = (round(objects[name].position[0] / STEP) for name in witnesses(number))
        if (first - second) % STEPS > 1:
            return f"thread {number}'s second edit is seen, its first is not: steps {first} and {second}"
    return None
