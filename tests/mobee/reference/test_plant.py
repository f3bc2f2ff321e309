# SPDX-License-Identifier: Apache-2.0
"""The plant of the definition: the compiled loop has the same trajectory, and a user-defined force can be tried on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.control import Gains
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.reference.forces import State
from mobee.reference.law import TERMS, Term
from mobee.reference.plant import Plant
from mobee.robot.load import load_robot
from mobee.simulation import MotorParameters, OfflinePlant
from tests.mobee.control.two_parts import touching, two_part_arm

ICUB = load_robot("icub")
BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
PRESS = {"torso": (0.5, 0.5, 0.9), "left_arm": (0.6, 0.3, 0.5, 0.4), "right_arm": (0.5, 0.2, 0.5, 0.5)}  # shares of the ranges


@BOTH
@pytest.mark.parametrize("dt", [0.01, 0.02])
def test_the_offline_plant_follows_the_same_path(gains: Gains, dt: float) -> None:
    """Hands into the table, two seconds.  To rounding, which the springs keep from growing; a tick adds the forces in another order."""
    model = Model(ICUB, load_world("table"))
    compiled, mine = OfflinePlant(model, 5, gains, dt=dt), Plant(model, 5, gains, dt=dt)
    goal = ICUB.home.copy()
    for part, shares in PRESS.items():
        low, high = ICUB.limits[ICUB.part(part).slice].T
        share = np.full(len(low), 0.5)
        share[: len(shares)] = shares
        goal[ICUB.part(part).slice] = low + share * (high - low)
    compiled.controller.attractor = mine.attractor = goal
    trace = compiled.run(round(2.0 / dt))
    assert trace.field.max() > 0.0
    for encoders, q in zip(trace.encoders, trace.q, strict=True):
        mine.tick()
        assert mine.q == pytest.approx(encoders, abs=1e-12)
        assert mine.motors.q == pytest.approx(q, abs=1e-12)


@BOTH
def test_an_action_ends_here_as_on_the_offline_plant(gains: Gains) -> None:
    target = np.array([0.4, -0.3])
    compiled, mine = OfflinePlant(Model(two_part_arm()), 2, gains), Plant(Model(two_part_arm()), 2, gains)
    outcome = compiled.act("arm", target)
    assert mine.act("arm", target) == outcome.settled
    assert mine.ticks * mine.dt == pytest.approx(outcome.duration)
    assert mine.q[1:] == pytest.approx(outcome.q, abs=1e-12)


def viscous(s: State) -> Array:
    """Slows the robot down while its fields overlap something."""
    return -5000.0 * max((contact.depth for contact in s.contacts), default=0.0) * s.velocity


def test_a_force_of_ones_own_acts_beside_the_others() -> None:
    """The arm is sent through a ball: with the force it does not go as deep."""

    def deepest(terms: Sequence[Term]) -> float:
        plant, depth = Plant(touching(0.1), parameters=MotorParameters.ideal(), terms=terms), 0.0
        plant.attractor = np.array([-0.5, 0.0, 0.0])
        for _ in range(100):
            plant.tick()
            depth = max([depth, *(contact.depth for contact in plant.state.contacts)])
        return depth

    assert 0.005 < deepest((*TERMS, viscous)) < 0.9 * deepest(TERMS)
