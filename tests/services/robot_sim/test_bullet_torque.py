# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.control.law import FRICTION, INERTIA
from services.robot_sim.bullet_torque import Gears, Motion

H = 0.005  # s
FREE = (np.full(3, -np.inf), np.full(3, np.inf))


def arm(seed: int) -> Motion:
    """Three joints somewhere, the last one as light as a wrist."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3)) * np.array([[1.0], [0.3], [0.05]])
    return Motion(root @ root.T + 0.02 * np.eye(3), rng.normal(size=3), rng.normal(size=3))


def after(now: Motion, torque: Array, held: Array) -> Array:
    """Where an engine without gears takes the joints: `held` ones at 0 rad/s, the others by their torque."""
    velocity = np.zeros(3)
    at, rest = np.flatnonzero(~held), np.flatnonzero(held)
    push = H * (torque - now.bias)[at] - now.mass[np.ix_(at, rest)] @ -now.velocity[rest]
    velocity[at] = now.velocity[at] + np.linalg.solve(now.mass[np.ix_(at, at)], push)
    return velocity


@given(st.integers(0, 2**32 - 1), st.lists(st.booleans(), min_size=3, max_size=3))
def test_arm_rotor_and_friction_move_as_one(seed: int, held: list[bool]) -> None:
    now, torque, stopped = arm(seed), np.random.default_rng(seed).normal(size=3), np.array(held)
    share = Gears(3).transmit(now, torque, ~stopped, np.zeros(3), FREE, False, H)
    then = after(now, share.torque, stopped)
    change = (then - now.velocity) / H
    together = now.mass @ change + INERTIA * change + FRICTION * then + now.bias - torque
    np.testing.assert_allclose(together[~stopped], 0.0, atol=1e-8)
    assert not share.torque[stopped].any() and (share.free == ~stopped).all()


@pytest.mark.parametrize("seed", range(5))
def test_a_blocked_joint_is_pressed_with_the_whole_torque_in_the_end(seed: int) -> None:
    still = Motion(arm(seed).mass, arm(seed).bias, np.zeros(3))
    gears, torque = Gears(3), np.array([5.0, -3.0, 1.0])
    for _ in range(600):
        share = gears.transmit(still, torque, np.ones(3, dtype=bool), np.zeros(3), FREE, True, H)
    np.testing.assert_allclose(share.torque, torque, atol=1e-5)


def test_a_joint_stops_at_the_end_of_its_range_and_disturbs_the_others() -> None:
    now, torque = replace(arm(1), velocity=np.zeros(3)), np.array([30.0, 0.0, 0.0])
    fastest = (np.full(3, -np.inf), np.array([0.0, np.inf, np.inf]))
    share = Gears(3).transmit(now, torque, np.ones(3, dtype=bool), np.zeros(3), fastest, False, H)
    assert share.free.tolist() == [False, True, True]
    assert share.velocity[0] == 0.0
    alone = Gears(3).transmit(now, torque, share.free, np.zeros(3), FREE, False, H)
    np.testing.assert_allclose(share.torque, alone.torque)


def test_external_torque_is_forgotten_without_contact_and_on_demand() -> None:
    now, free, torque = arm(2), np.ones(3, dtype=bool), np.array([5.0, 0.0, 0.0])
    fresh = Gears(3).transmit(now, torque, free, np.zeros(3), FREE, True, H)
    gears = Gears(3)
    gears.transmit(arm(3), torque, free, np.zeros(3), FREE, True, H)
    assert not np.allclose(gears.transmit(now, torque, free, np.zeros(3), FREE, True, H).torque, fresh.torque)
    assert (gears.transmit(now, torque, free, np.zeros(3), FREE, False, H).torque == fresh.torque).all()
    gears.forget()
    assert (gears.transmit(now, torque, free, np.zeros(3), FREE, True, H).torque == fresh.torque).all()
