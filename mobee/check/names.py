"""Checks names and duplicates: identical shapes, names that differ in case only, names that other programs cannot use."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np

from mobee.check.fields import vertices
from mobee.check.finding import Finding
from mobee.check.subject import Subject
from mobee.robot.robot import Shape

SAME_WITHIN = 1e-6  # m
KEY = re.compile(r"[a-z0-9_]+")


def identical_shapes(subject: Subject) -> Iterator[Finding]:
    """Find shapes of the same role, kind, size and position on the same link."""
    for one, other in combinations(subject.robot.shapes, 2):
        if _same(one, other):
            yield Finding(
                "warning",
                "duplicate",
                subject.where("shape", other.name),
                f"{other.role} {other.name!r} is a duplicate of {one.name!r}: same kind, size and position",
                "each contact is counted twice, and so is its force",
                "remove one of the two",
            )


def names_differing_in_case(subject: Subject) -> Iterator[Finding]:
    """Find names of one kind that differ in upper and lower case only."""
    robot = subject.robot
    kinds: dict[str, Iterable[str]] = {
        "part": robot.parts,
        "link": robot.links,
        "joint": (joint.name for joint in robot.joints),
        "motor": robot.motors,
        "marker": robot.markers,
        "shape": (shape.name for shape in robot.shapes),
    }
    for kind, names in kinds.items():
        seen: dict[str, str] = {}
        for name in names:
            before = seen.setdefault(name.lower(), name)
            if before != name:
                yield Finding(
                    "warning",
                    "name-case",
                    subject.where(kind, name),
                    f"{kind} {name!r} differs from {kind} {before!r} in upper and lower case only",
                    "names are case-sensitive, and people overlook the difference",
                    "rename one of the two",
                )


def unusable_names(subject: Subject) -> Iterator[Finding]:
    """Find parts whose names are not valid in a key of the bus, and motors whose names are not valid in a list."""
    for part in subject.robot.parts:
        if not KEY.fullmatch(part):
            yield Finding(
                "warning",
                "part-name",
                subject.where("part", part),
                f"part name {part!r} is not valid in a key of the bus",
                "the services name their keys after the parts, so that none of them can run this robot",
                "rename it: a-z, 0-9 and _ only",
            )
    for motor in subject.robot.motors:
        if re.search(r"[\s,]", motor):
            yield Finding(
                "warning",
                "motor-name",
                subject.where("motor", motor),
                f"motor name {motor!r} contains a space or a comma",
                "lists of motors are separated by these, so that no constraint can name it",
                "rename it, with _ instead",
            )


def _same(one: Shape, other: Shape) -> bool:
    if (one.link, one.role, one.kind) != (other.link, other.role, other.kind) or not np.allclose(
        one.size, other.size, rtol=0, atol=SAME_WITHIN
    ):
        return False
    if not np.allclose(one.position, other.position, rtol=0, atol=SAME_WITHIN):
        return False
    if one.kind == "convex":
        return np.array_equal(vertices(one), vertices(other))
    if one.kind == "sphere":
        return True
    if one.kind == "box":
        return np.allclose(one.rotation, other.rotation, atol=SAME_WITHIN)
    return bool(abs(one.rotation[:, 2] @ other.rotation[:, 2]) > 1 - SAME_WITHIN)  # an axis has no sign
