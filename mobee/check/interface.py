# SPDX-License-Identifier: Apache-2.0
"""Defines the interface of the checks: their input, the robot with sampled poses and contacts, and their output, findings.

It also has functions that write numbers and lists as texts in findings.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sized
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.model.contact import Contact
from mobee.model.model import Model
from mobee.model.world import World
from mobee.robot.mjcf.compiled import is_mjcf
from mobee.robot.motor_units import in_metres
from mobee.robot.robot import Motor, Robot, Shape
from mobee.robot.xml.node import read_xml

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
POSES = 256  # sampled; a pair that touches in all of them cannot be separated
SEED = 20141030  # fixed, so that the same file always gets the same findings
Touch = tuple[str, str, str]  # first, second, kind


@dataclass(frozen=True, slots=True)
class Finding:
    """One problem of a file.

    `severity`: "error": the robot cannot work; "warning": it will behave unexpectedly; "note": useful to know, and possibly intended.
    `check`: short name of the check. `where`: "file:line". `what`: the fault. `why`: its effect. `remedy`: what the user should do.
    """

    severity: Severity
    check: str
    where: str
    what: str
    why: str
    remedy: str


class Subject:
    """A robot that is checked for faults, with values that several checks use; each value is computed at its first use.

    `world`: the objects around the robot; None: there are no objects.
    """

    def __init__(self, robot: Robot, world: World | None = None) -> None:
        self.robot = robot
        self.world = world

    def where(self, kind: str, name: str) -> str:
        """Return the place "file:line" of an element, given its kind (such as "joint") and its name.

        If the line of the element is not known, return the place of the robot; if that is not known either, the robot's name.
        """
        return self.robot.where.get((kind, name)) or self.robot.where.get(("robot", self.robot.name)) or self.robot.name

    def is_urdf(self, kind: str, name: str) -> bool:
        """Return whether an element was read from a URDF file; the remedies for some findings are different then.

        `kind`, `name`: as for `where`. A robot can be joined from URDF and other files.
        """
        return self.where(kind, name).rpartition(":")[0].lower().endswith(".urdf")

    @cached_property
    def is_mjcf(self) -> bool:
        """Whether the robot was read from an MJCF file; the remedies for some findings are different then."""
        return is_mjcf(Path(self.where("robot", self.robot.name).rpartition(":")[0]))

    def urdf_link(self, shape: str) -> str | None:
        """Return the name of the link of a shape in the URDF file, before links of fixed joints are merged.

        `shape`: name of the shape. The link is found by the line number of the shape. So None is returned if several links are in this line
        of the file, and for a file that is not a URDF.
        """
        return self._urdf_links.get(self.where("shape", shape))

    @cached_property
    def _urdf_links(self) -> dict[str, str]:
        """The name of the link for each place "file:line" where an element of a link begins, in the URDF files of the robot's shapes.

        Places that belong to several links are left out.
        """
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
        """The lower and upper limit of each motor, (n, 2) rad; an infinite limit is replaced by -pi or pi."""
        return np.nan_to_num(self.robot.limits, nan=0.0, neginf=-np.pi, posinf=np.pi)

    @cached_property
    def samples(self) -> Array:
        """The sampled poses, (POSES, n) rad, POSES = 256: uniformly distributed within `range`, with a fixed seed."""
        low, high = self.range.T
        return np.random.default_rng(SEED).uniform(low, np.maximum(high, low), (POSES, len(low)))

    @cached_property
    def home(self) -> Array:
        """The motor positions at home, (n,) rad; 0 for a home that is not finite."""
        return np.nan_to_num(self.robot.home, nan=0.0, posinf=0.0, neginf=0.0)

    @cached_property
    def limited(self) -> Robot:
        """A copy of the robot in which all motors have finite limits, those of the property `range`, instead of the limits of its file.

        The checks make their models from this copy.
        """
        motors = zip(self.robot.motor_table, self.range, strict=True)
        return replace(self.robot, motor_table=tuple(replace(motor, limits=limits) for motor, limits in motors))

    @cached_property
    def at_home(self) -> tuple[Contact, ...]:
        """The contacts of the robot at home with itself and with the objects of the world."""
        return Model(self.limited, self.world).evaluate(self.home).contacts

    @cached_property
    def always(self) -> frozenset[Touch]:
        """The pairs of shapes that overlap at home and in every sampled pose, as (first name, second name, "solid" or "field")."""
        model = Model(self.limited)
        left = touches(model.evaluate(self.home).contacts)
        for q in self.samples:
            if not left:
                break
            left &= touches(model.evaluate(q).contacts)
        return frozenset(left)

    @cached_property
    def foreign(self) -> tuple[tuple[Shape, Shape, float], ...]:
        """The fields that overlap a solid of another part at home without a repulsive force, each as (field, solid, depth [m]).

        Fields are volumes around solids. A force acts only between two fields that overlap, and these fields have no contact with a field
        of the solid's link. So no force keeps the field's part away from the solid.
        """
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
        """The indices of the links that a motor moves."""
        driven = set(np.flatnonzero(self.robot.coupling[0].any(axis=1)))
        found: set[int] = set()
        for index, joint in enumerate(self.robot.joints):
            if index in driven or joint.parent in found:
                found.add(index + 1)
        return frozenset(found)

    @cached_property
    def below(self) -> tuple[frozenset[int], ...]:
        """For each joint, the indices of the links that it carries, including the link that it moves."""
        carried: list[set[int]] = [{index + 1} for index in range(len(self.robot.joints))]
        for index in reversed(range(len(self.robot.joints))):
            parent = self.robot.joints[index].parent
            if parent > 0:
                carried[parent - 1] |= carried[index]
        return tuple(frozenset(links) for links in carried)


def touches(contacts: tuple[Contact, ...]) -> set[Touch]:
    """Return the pairs of volumes of some contacts, as a set of (first name, second name, "solid" or "field")."""
    return {(contact.first, contact.second, contact.kind) for contact in contacts}


def interval(limits: Array, kind: str) -> str:
    """Return an interval as text for a message, in degrees or m.

    `limits`: (2,) rad if `kind` is "revolute", (2,) m if it is "prismatic".
    """
    low, high = np.rad2deg(limits) if kind == "revolute" else np.asarray(limits)
    return f"{low:.4g} to {high:.4g} {'deg' if kind == 'revolute' else 'm'}"


def motor_interval(robot: Robot, motor: Motor) -> str:
    """Return the limits of a motor as text for a message, in degrees or, for a motor that slides, in m."""
    return interval(motor.limits, "prismatic" if in_metres(robot, motor) else "revolute")


def position(robot: Robot, motor: Motor, value: float) -> str:
    """Return a position of a motor, or a difference of two positions, as text: in degrees or, for a motor that slides, in mm.

    `value`: rad or m.
    """
    return f"{1e3 * value:.3g} mm" if in_metres(robot, motor) else f"{np.rad2deg(value):.3g} deg"


def length(metres: float) -> str:
    """Return a length [m] as text for a message, in mm if it is below 0.1 m, else in m."""
    return f"{1e3 * metres:.3g} mm" if metres < 0.1 else f"{metres:.3g} m"


def some(names: Iterable[str], most: int = 4) -> str:
    """Return the first `most` names of a list as text for a message, and the number of further names: "a, b, c, d and 3 more"."""
    listed = list(names)
    more = f" and {len(listed) - most} more" if len(listed) > most else ""
    return ", ".join(listed[:most]) + more


def count(things: Sized, noun: str) -> str:
    """Return the number of items with their noun as text for a message: "1 motor", "3 motors"."""
    return f"{len(things)} {noun}{'' if len(things) == 1 else 's'}"
