# SPDX-License-Identifier: Apache-2.0
"""Runs all checks of a robot: limits, home, units, contacts, fields, constraints, masses, meshes and names."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mobee.check.constraints import constraints
from mobee.check.finding import SEVERITIES, Finding
from mobee.check.masses import masses
from mobee.check.motors import coupling, home_limits, home_zones, idle_motors, idle_parts, joint_limits, unreachable_markers
from mobee.check.names import names_differing_in_case, unusable_names
from mobee.check.shapes import fields, identical_shapes
from mobee.check.subject import Subject
from mobee.check.touching import always_touching, foreign_solids, home_contacts, world_contacts
from mobee.check.units import radians, size
from mobee.check.visuals import missing_meshes
from mobee.model.world import World
from mobee.robot.robot import Robot

Check = Callable[[Subject], Iterator[Finding]]

CHECKS: tuple[Check, ...] = (
    joint_limits,
    home_limits,
    home_zones,
    coupling,
    idle_motors,
    idle_parts,
    size,
    radians,
    always_touching,
    home_contacts,
    world_contacts,
    foreign_solids,
    fields,
    constraints,
    unreachable_markers,
    masses,
    missing_meshes,
    identical_shapes,
    names_differing_in_case,
    unusable_names,
)


def check_robot(robot: Robot, world: World | None = None) -> list[Finding]:
    """Return all findings about a robot, errors first.

    `world`: a world; the objects that the robot touches in it at home are reported too. Poses are sampled with a fixed seed, so that the
    same robot always gets the same findings.
    """
    subject = Subject(robot, world)
    with np.errstate(invalid="ignore"):  # joints without limits are a finding, not a failure of the others
        found = [finding for check in CHECKS for finding in check(subject)]
    return sorted(found, key=lambda finding: SEVERITIES.index(finding.severity))
