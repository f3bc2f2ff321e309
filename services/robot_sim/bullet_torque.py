# SPDX-License-Identifier: Apache-2.0
"""Applies torques to PyBullet's joints through gears: reflected inertia and friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.control.law import FRICTION, INERTIA

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The equation of motion at present: mass * acceleration + bias = joint torques + torques of contacts; (d,) driven joints."""

    mass: Array  # (d, d) kg m^2
    bias: Array  # (d,) N m, gravity and what velocities do
    velocity: Array  # (d,) rad/s


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """The command of each joint in a substep: a torque where `free`, else a velocity; each (d,)."""

    free: Mask
    torque: Array  # N m, what passes the gear; 0 where not free
    velocity: Array  # rad/s


class Gears:
    """Solves a substep of motor, gear and arm together, implicitly, and returns the torque that passes the gear.

    A geared motor adds its rotor's inertia and its friction to its joint: (M + INERTIA) a = torque - FRICTION v - bias + outside. Both are
    far larger than the inertia of a wrist, so an explicit step of 5 ms would diverge.  The external torque (contacts) is taken from the
    last substep: it explains the difference between the motion of the joints and the computed motion.
    """

    def __init__(self, joints: int) -> None:
        self._last: tuple[Motion, Share] | None = None
        self._nothing = np.zeros(joints)

    def forget(self) -> None:
        """Forget the last substep, as if no torque had been transmitted in it."""
        self._last = None

    def transmit(
        self, now: Motion, torque: Array, free: Mask, velocity: Array, fastest: tuple[Array, Array], touched: bool, h: float
    ) -> Share:
        """Return the commands of the joints in a substep of h [s]; all arrays (d,).

        `torque` N m acts where `free`, the other joints move at `velocity` rad/s.  A joint that would leave the range `fastest`
        (lowest and highest velocity, rad/s) is not free: it moves at the limit of the range.
        """
        outside = self._outside(now, h) if touched else self._nothing
        free, velocity = free.copy(), velocity.copy()
        known = now.velocity @ now.mass + h * (torque - now.bias + outside) + INERTIA * now.velocity
        while True:
            at, rest = np.flatnonzero(free), np.flatnonzero(~free)
            mass = now.mass[np.ix_(at, at)] + (INERTIA + h * FRICTION) * np.eye(len(at))
            # `known` holds the momentum of all joints; the momentum of those that are not free is given
            found = np.linalg.solve(mass, known[at] - now.mass[np.ix_(at, rest)] @ velocity[rest])
            within = np.clip(found, fastest[0][at], fastest[1][at])
            velocity[at] = within
            if (within == found).all():
                break
            free[at[within != found]] = False
        passed = torque - FRICTION * velocity - INERTIA * (velocity - now.velocity) / h
        share = Share(free, np.where(free, passed, 0.0), np.where(free, 0.0, velocity))
        self._last = now, share
        return share

    def _outside(self, now: Motion, h: float) -> Array:
        """Return the external torques [N m] on the joints that were free in the last substep; 0 for the other joints."""
        if self._last is None:
            return self._nothing
        then, share = self._last
        outside = then.mass @ (now.velocity - then.velocity) / h + then.bias - share.torque
        return np.where(share.free, outside, 0.0)
