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
    """The equation of motion of the d driven joints at present: mass * acceleration + bias = torques of the joints and of contacts.

    `mass`: (d, d) kg m^2. `bias`: (d,) N m, gravity and Coriolis torques. `velocity`: (d,) rad/s.
    """

    mass: Array
    bias: Array
    velocity: Array


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """The command of each of the d joints in a substep: a torque if the joint is `free`, otherwise a velocity; all arrays (d,).

    `torque`: N m, torque of the gear on the joint; 0 for a joint that is not free. `velocity`: rad/s; 0 for a joint that is free.
    """

    free: Mask
    torque: Array
    velocity: Array


class Gears:
    """Computes the torques that gears transmit to joints: solves a substep of motor, gear and arm together by an implicit method.

    A geared motor adds its rotor's inertia and its friction to its joint: (M + INERTIA) a = torque - FRICTION v - bias + outside. M is the
    mass matrix of the arm, v and a are joint velocity and acceleration, and bias is the torque of gravity and Coriolis forces. INERTIA,
    and FRICTION times the step, are far larger than the inertia of a wrist, so an explicit step of 5 ms would diverge. The external torque
    `outside` (contacts) is estimated from the last substep: the torque that the joints' acceleration required, minus the torque that the
    gears transmitted.
    """

    def __init__(self, joints: int) -> None:
        self._last: tuple[Motion, Share] | None = None
        self._nothing = np.zeros(joints)

    def forget(self) -> None:
        """Drop the last substep, so that the next one assumes no external torque."""
        self._last = None

    def transmit(
        self, now: Motion, torque: Array, free: Mask, velocity: Array, fastest: tuple[Array, Array], touched: bool, h: float
    ) -> Share:
        """Return the commands of the joints in a substep of h [s]; all arrays (d,), by joint.

        Args:
            now: the equation of motion at present.
            torque: commanded torques, N m, of the joints that are `free`.
            free: which joints are in torque mode.
            velocity: velocities, rad/s, of the other joints.
            fastest: lowest and highest velocity of each joint, rad/s. A joint that would leave this range is not free in the result: it
                moves at the limit of the range.
            touched: whether the robot had a contact in the last substep; without one, the external torques are 0.
            h: length of the substep, s.
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
