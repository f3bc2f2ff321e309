# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee.control.forces import constraint_forces
from mobee.control.gains import Gains
from mobee.model.model import Model
from mobee.robot.robot import Clause
from tests.mobee.control.two_parts import STRETCHED, touching, two_part_arm

BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)


@BOTH
def test_a_contact_pushes_the_tip_out(gains: Gains) -> None:
    model = touching(-0.02)
    forces = constraint_forces(model.evaluate(STRETCHED), gains)
    depth = [model.evaluate(q).contacts[0].depth for q in (STRETCHED, STRETCHED + 1e-3 * forces.total / np.linalg.norm(forces.total))]
    assert depth[1] < depth[0]
    assert not forces.limits.any() and not forces.constraints.any()


@BOTH
def test_without_contact_forces_a_contact_causes_no_force(gains: Gains) -> None:
    assert not constraint_forces(touching(-0.02).evaluate(STRETCHED), gains, contact_forces=False).total.any()


@BOTH
def test_an_object_out_of_reach_causes_no_force(gains: Gains) -> None:
    assert not constraint_forces(touching(+0.01).evaluate(STRETCHED), gains).total.any()


@BOTH
def test_all_three_kinds_add_up(gains: Gains) -> None:
    clause = Clause("arm", np.array([[0.0, 1.0, 0.0]]), np.array([-0.01]))  # m1 > .01
    model = touching(-0.02)
    bounded = replace(
        model.robot, clauses=(clause,), motor_table=tuple(replace(m, limits=np.array([0.0, 1.0])) for m in model.robot.motor_table)
    )
    forces = constraint_forces(Model(bounded, model.world).evaluate(STRETCHED), gains)
    assert forces.limits == pytest.approx(gains.max_limit * np.ones(3))
    assert forces.constraints[1] >= gains.max_constraint and not forces.constraints[[0, 2]].any()
    assert np.array_equal(forces.total, forces.limits + forces.constraints + forces.collision)


def test_robots_do_not_share_their_constraints() -> None:
    plain = two_part_arm()
    clause = Clause("arm", np.array([[0.0, 1.0, 0.0]]), np.array([0.0]))
    bound = replace(plain, clauses=(clause,))
    gains = Gains.default()
    assert constraint_forces(Model(bound).evaluate(STRETCHED), gains).constraints.any()
    assert not constraint_forces(Model(plain).evaluate(STRETCHED), gains).constraints.any()
