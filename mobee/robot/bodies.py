# SPDX-License-Identifier: Apache-2.0
"""Masses and moments of inertia: one body for each link, conversions, and a check whether an inertia is possible."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import Body

WATER_DENSITY = 1000.0  # kg/m^3
ROUNDING = 1e-6  # tolerance, relative to the largest moment of inertia


def one_a_link(bodies: Iterable[Body]) -> tuple[Body, ...]:
    """Merge the bodies of each link into one, and return one body for each link that has a mass, in the order of the links.

    The inertia of a merged body is None if that of any of its parts is unknown.
    """
    of: dict[int, list[Body]] = {}
    for body in bodies:
        of.setdefault(body.link, []).append(body)
    return tuple(_merged(of[link]) for link in sorted(of))


def _merged(bodies: list[Body]) -> Body:
    if len(bodies) == 1:
        return bodies[0]
    mass = sum(body.mass for body in bodies)
    centre = np.sum([body.mass * body.centre for body in bodies], axis=0) / mass
    known = [body.inertia + body.mass * _spread(body.centre - centre) for body in bodies if body.inertia is not None]
    return Body(bodies[0].link, mass, centre, np.sum(known, axis=0) if len(known) == len(bodies) else None)


def _spread(arm: Array) -> Array:
    """Return the inertia (3, 3) of 1 kg at the end of an arm (3,) m (Steiner)."""
    spread: Array = arm @ arm * np.eye(3) - np.outer(arm, arm)
    return spread


def ball_of_water(mass: float) -> Array:
    """Return the inertia (3, 3) [kg m^2] of a ball of water of this mass [kg]: an estimate for a body whose inertia is unknown."""
    radius = (3.0 * mass / (4.0 * np.pi * WATER_DENSITY)) ** (1.0 / 3.0)
    return np.diag(np.full(3, 0.4 * mass * radius**2))


def from_six(values: Iterable[float]) -> Array:
    """Return the inertia tensor (3, 3) with the components ixx, ixy, ixz, iyy, iyz and izz, which `values` has in this order."""
    xx, xy, xz, yy, yz, zz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def to_six(inertia: Array) -> list[float]:
    """Return the components ixx, ixy, ixz, iyy, iyz and izz of an inertia tensor (3, 3), in this order."""
    return [float(inertia[i, j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]


def can_be(inertia: Array) -> bool:
    """Return whether a rigid body can have this inertia (3, 3): no principal moment is negative or above the sum of the other two."""
    moments = np.linalg.eigvalsh(inertia)
    slack = ROUNDING * float(np.abs(moments).max())
    return bool(moments[0] >= -slack and moments[2] <= moments[0] + moments[1] + slack)
