# SPDX-License-Identifier: Apache-2.0
"""An attractor that moves: the part follows it without a lag, yields to forces, and stops when it is no longer moved."""

from __future__ import annotations

import numpy as np
import pytest

from mobee.control import Controller, Gains
from mobee.control.controller import FOLLOW_TIME
from mobee.errors import InvalidValue
from mobee.model.model import Model
from tests.mobee.control.two_parts import two_part_arm

ROBOT = two_part_arm()
DT, SPEED, START = 0.01, 0.8, -0.4
TRUNK, ARM = (ROBOT.part(name).slice for name in ("trunk", "arm"))


def followed(ticks: int, moved: int) -> tuple[Controller, np.ndarray]:
    """A controller on ideal motors whose trunk follows a goal at SPEED, moved in the first `moved` ticks; and its positions (ticks, n)."""
    ctrl = Controller(Model(ROBOT), Gains.default())
    q = np.array([START, 0.0, 0.0])
    ctrl.reset(q)
    path = []
    for k in range(ticks):
        if k < moved:
            ctrl.follow("trunk", np.full(TRUNK.stop - TRUNK.start, START + SPEED * k * DT), np.full(TRUNK.stop - TRUNK.start, SPEED))
        q = q + ctrl.step(q, DT).velocity * DT
        path.append(q)
    return ctrl, np.array(path)


def test_a_part_follows_without_a_lag_and_faster_than_its_spring_alone_could() -> None:
    gains = Gains.default()
    assert gains.max_spring / gains.damping < SPEED
    _, path = followed(100, 100)
    assert path[-1][TRUNK] == pytest.approx(START + SPEED * 100 * DT, abs=0.03)
    assert not path[:, ARM].any()


def test_a_goal_that_is_no_longer_moved_stands_still() -> None:
    _, path = followed(400, 60)
    assert np.ptp(path[60 + round(FOLLOW_TIME / DT) :][:, TRUNK]) < SPEED * FOLLOW_TIME + 0.05
    assert path[-1][TRUNK] == pytest.approx(START + SPEED * 59 * DT, abs=0.01)


def test_an_attractor_that_is_set_stands_still() -> None:
    for stop in (lambda ctrl: ctrl.set_attractor("trunk", np.zeros(1)), lambda ctrl: setattr(ctrl, "attractor", np.zeros(3))):
        ctrl, path = followed(50, 50)
        stop(ctrl)
        assert not ctrl.state["goal_time"].any()
        assert ctrl.step(path[-1], DT).velocity[TRUNK] < SPEED - 0.05


def test_a_part_yields_to_a_force_that_opposes_its_goal() -> None:
    ctrl = Controller(Model(ROBOT), Gains.default())
    ctrl.reset(np.zeros(3))
    free = _velocity(ctrl, 0.0)
    assert free == pytest.approx(SPEED, rel=0.05)
    assert _velocity(ctrl, -0.5) < 0.0  # from 0.25 rad/s^2 on, nothing of the goal's velocity is left
    assert _velocity(ctrl, 0.5) > free


def _velocity(ctrl: Controller, force: float) -> float:
    """The velocity of the trunk after a second of following a goal that stays where the trunk is."""
    ctrl.reset(np.zeros(3))
    ctrl.force(np.array([force, 0.0, 0.0]))
    for _ in range(100):
        ctrl.follow("trunk", np.zeros(1), np.full(1, SPEED))
        velocity = ctrl.step(np.zeros(3), DT).velocity[0]
    return float(velocity)


def test_what_cannot_be_followed_is_refused() -> None:
    ctrl = Controller(Model(ROBOT), Gains.default())
    for q, velocity in (([0.0, 0.0], [0.0]), ([0.0], [np.nan])):
        with pytest.raises(InvalidValue):
            ctrl.follow("trunk", np.array(q), np.array(velocity))
    assert not ctrl.state["goal_time"].any()
