# SPDX-License-Identifier: Apache-2.0
"""The robot under check, with sampled poses and contacts that several checks use."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from functools import cached_property
from itertools import product
from pathlib import Path

import numpy as np

from mobee.arrays import Array
from mobee.model.contact import Contact
from mobee.model.model import Model
from mobee.model.world import World
from mobee.robot.mjcf.compiled import is_mjcf
from mobee.robot.robot import Robot, Shape
from mobee.robot.xml.node import read_xml

POSES = 256  # sampled; a pair that touches in all of them cannot be separated
SEED = 20141030  # fixed, so that the same file always gets the same findings

Touch = tuple[str, str, str]  # first, second, kind


class Subject:
    """A robot, perhaps in a world, with the values that several checks use."""

    def __init__(self, robot: Robot, world: World | None = None) -> None:
        self.robot = robot
        self.world = world

    def where(self, kind: str, name: str) -> str:
        """Return file and line of an element, or those of the robot where the reader recorded none."""
        return self.robot.where.get((kind, name)) or self.robot.where.get(("robot", self.robot.name)) or self.robot.name

    @property
    def is_urdf(self) -> bool:
        """Whether the robot was read from a URDF, for which some remedies differ."""
        return any(".urdf:" in line for line in self.robot.where.values())

    @cached_property
    def is_mjcf(self) -> bool:
        """Whether the robot was read from an MJCF file."""
        return is_mjcf(Path(self.where("robot", self.robot.name).rpartition(":")[0]))

    def urdf_link(self, shape: str) -> str | None:
        """Return the URDF link of a shape; a fixed joint may join it to the robot's link.

        None for another kind of file, and where shapes of several links begin in one line.
        """
        return self._urdf_links.get(self.where("shape", shape))

    @cached_property
    def _urdf_links(self) -> dict[str, str]:
        """The link for every line of a URDF on which a shape of the robot begins."""
        lines = (line.rpartition(":")[0] for (kind, _), line in self.robot.where.items() if kind == "shape")
        files = {Path(file) for file in lines if file.lower().endswith(".urdf")}
        links = (node for file in files for node in read_xml(file) if node.tag == "link")
        found: dict[str, set[str]] = defaultdict(set)
        for link in links:
            for inner in link:
                found[f"{inner.file}:{inner.line}"].add(link.optional("name") or "")
        return {line: names.pop() for line, names in found.items() if len(names) == 1}

    @cached_property
    def range(self) -> Array:
        """Motor limits (n, 2) rad; half a turn to each side for a motor without limits."""
        return np.nan_to_num(self.robot.limits, nan=0.0, neginf=-np.pi, posinf=np.pi)

    @cached_property
    def samples(self) -> Array:
        """Poses (POSES, n) rad, uniform within the limits."""
        low, high = self.range.T
        return np.random.default_rng(SEED).uniform(low, np.maximum(high, low), (POSES, len(low)))

    @cached_property
    def home(self) -> Array:
        """The home posture, (n,) rad."""
        return np.nan_to_num(self.robot.home)

    @cached_property
    def limited(self) -> Robot:
        """The robot with finite limits for all motors: `range` replaces the limits of the file. A model needs finite limits."""
        motors = zip(self.robot.motor_table, self.range, strict=True)
        return replace(self.robot, motor_table=tuple(replace(motor, limits=limits) for motor, limits in motors))

    @cached_property
    def at_home(self) -> tuple[Contact, ...]:
        """Contacts at home, including those with the world."""
        return Model(self.limited, self.world).evaluate(self.home).contacts

    @cached_property
    def always(self) -> frozenset[Touch]:
        """Pairs of the robot's shapes that overlap at home and in every sampled pose."""
        model = Model(self.limited)
        left = touches(model.evaluate(self.home).contacts)
        for q in self.samples:
            if not left:
                break
            left &= touches(model.evaluate(q).contacts)
        return frozenset(left)

    @cached_property
    def foreign(self) -> tuple[tuple[Shape, Shape, float], ...]:
        """(field, solid, depth [m]): fields that overlap a solid of another part at home, but touch no field of that solid's link."""
        robot, shapes = self.limited, self.robot.shapes
        tested = {frozenset((shapes[i].link, shapes[j].link)) for i, j in robot.solid_pairs}
        near = [
            sorted((i, j))
            for (i, one), (j, other) in product(enumerate(shapes), repeat=2)
            if (one.role, other.role) == ("field", "solid") and one.part != other.part and frozenset((one.link, other.link)) in tested
        ]
        bodies = tuple(replace(shape, role="solid") for shape in shapes)
        pairs = np.array(near, dtype=np.intp).reshape(-1, 2)
        probe = replace(robot, shapes=bodies, field_pairs=pairs[:0], solid_pairs=pairs)
        named = {shape.name: shape for shape in shapes}
        acting = {end for c in self.at_home if c.kind == "field" for end in ((c.first, c.second_link), (c.second, c.first_link))}
        found = []
        for contact in Model(probe).evaluate(self.home).contacts:
            field, solid = sorted((named[contact.first], named[contact.second]), key=lambda shape: shape.role)
            if (field.name, solid.link) not in acting:
                found.append((field, solid, contact.depth))
        return tuple(found)

    @cached_property
    def moved(self) -> frozenset[int]:
        """Links that a motor moves in the root frame."""
        driven = set(np.flatnonzero(self.robot.coupling[0].any(axis=1)))
        found: set[int] = set()
        for index, joint in enumerate(self.robot.joints):
            if index in driven or joint.parent in found:
                found.add(index + 1)
        return frozenset(found)

    @cached_property
    def below(self) -> tuple[frozenset[int], ...]:
        """The links that each joint carries, including the one that it moves."""
        carried: list[set[int]] = [{index + 1} for index in range(len(self.robot.joints))]
        for index in reversed(range(len(self.robot.joints))):
            parent = self.robot.joints[index].parent
            if parent > 0:
                carried[parent - 1] |= carried[index]
        return tuple(frozenset(links) for links in carried)


def touches(contacts: tuple[Contact, ...]) -> set[Touch]:
    """Return the pairs of these contacts."""
    return {(contact.first, contact.second, contact.kind) for contact in contacts}
