# SPDX-License-Identifier: Apache-2.0
"""Checks the names in a robot: names that differ in upper and lower case only, and names that other programs cannot use."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from mobee.check.finding import Finding
from mobee.check.subject import Subject

KEY = re.compile(r"[a-z0-9_]+")


def names_differing_in_case(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each name that differs from another name of its kind (part, link, motor, ...) in upper and lower case only."""
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
    """Yield a finding (a problem of the file) for each name of a part or motor that other programs cannot use.

    The name of a part must be valid in a key (a topic) of the message bus: a-z, 0-9 and _ only. The name of a motor must not have blanks or
    commas, which separate the names in lists of motors.
    """
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
