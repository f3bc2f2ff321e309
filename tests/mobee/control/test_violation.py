# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee import Model, load_robot, load_world
from mobee.arrays import Array
from mobee.control.reflex import Violation, Watch
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Clause
from tests.mobee.control.test_slides import SLIDING

SLIDE_CLAUSE = Clause("arm", np.array([[0.0, -1.0, 0.0]]), np.array([0.01]))  # the slide at most at 1 cm
ROBOT = load_robot("icub")
MODEL = Model(ROBOT, load_world("table"))


def posture(**degrees: float) -> Pose:
    q: Array = ROBOT.home.copy()
    for motor, angle in degrees.items():
        q[ROBOT.motor_index(motor)] = np.deg2rad(angle)
    return MODEL.evaluate(q)


def test_nothing_is_wrong_at_home() -> None:
    assert Watch(ROBOT).check(posture()) == ()


def test_the_deepest_contact_is_reported_first() -> None:
    pose = posture(torso_pitch=50.0)
    found = Watch(ROBOT).check(pose)
    assert len(found) > 1
    assert {violation.kind for violation in found} == {"contact"}
    assert [violation.depth for violation in found] == sorted((c.depth for c in pose.contacts), reverse=True)


def test_only_the_kinds_asked_for_count() -> None:
    pose = posture(torso_pitch=50.0)
    fields = [c for c in pose.contacts if c.kind == "field"]
    assert 0 < len(fields) == len(Watch(ROBOT, kinds=("field",)).check(pose))


def test_a_limit_counts_beyond_the_tolerance() -> None:
    lower, upper = np.rad2deg(ROBOT.limits[ROBOT.motor_index("neck_yaw")])
    watch = Watch(ROBOT, tolerance=np.deg2rad(1.0))
    assert watch.check(posture(neck_yaw=upper + 0.9)) == ()
    (found,) = watch.check(posture(neck_yaw=lower - 3.0))
    assert (found.kind, found.what) == ("limit", "neck_yaw")
    assert found.depth == pytest.approx(np.deg2rad(3.0))


def test_a_clause_of_a_slide_is_checked_as_precisely_as_its_limit() -> None:
    """The slide has a range of 6 cm. If 1 rad counted as 1 m, a tolerance of 2 degrees would be 3.5 cm."""
    motor = replace(SLIDING.motor_table[1], limits=np.array([-0.03, 0.03]))
    robot = replace(SLIDING, motor_table=(SLIDING.motor_table[0], motor, SLIDING.motor_table[2]), clauses=(SLIDE_CLAUSE,))
    tolerance = np.deg2rad(2.0) * fine_units(robot)[1]
    model, watch = Model(robot), Watch(robot, kinds=(), tolerance=np.deg2rad(2.0))
    assert watch.check(model.evaluate(np.array([0.0, 0.01 + 0.9 * tolerance, 0.0]))) == ()
    (found,) = watch.check(model.evaluate(np.array([0.0, 0.01 + 1.1 * tolerance, 0.0])))
    assert (found.kind, found.what) == ("clause", "arm clause 0")


def test_a_clause_is_broken_when_none_of_its_rows_is_satisfied() -> None:
    clause = next(c for c in ROBOT.clauses if len(c.b) == 1)
    normal = clause.a[0] / np.linalg.norm(clause.a[0])
    boundary = -normal * clause.b[0] / np.linalg.norm(clause.a[0])
    model, watch = Model(ROBOT), Watch(ROBOT, kinds=())

    def clauses(beyond: float) -> list[Violation]:
        return [v for v in watch.check(model.evaluate(boundary - normal * beyond)) if v.kind == "clause"]

    assert clauses(np.deg2rad(0.5)) == []
    assert clauses(np.deg2rad(3.0))[0].depth == pytest.approx(np.deg2rad(3.0))


def test_unknown_kinds_are_refused() -> None:
    with pytest.raises(InvalidValue, match="solid, field"):
        Watch(ROBOT, kinds=("soft",))
