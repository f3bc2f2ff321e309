# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee import Model, load_robot, load_world
from mobee.arrays import Array
from mobee.control.reflex import Violation, Watch
from mobee.errors import InvalidValue
from mobee.model.pose import Pose

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
