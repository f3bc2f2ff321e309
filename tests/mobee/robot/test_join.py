# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import InvalidValue, UnknownName
from mobee.model.kinematics import link_transforms
from mobee.model.model import Model
from mobee.robot.join import join_robots
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.xml.volume import Z, turn_about

ICUB, KATANA = load_robot("icub"), load_robot("katana")
AT, TURN = np.array([-0.4, 0.3, 0.306]), turn_about(Z, 0.7)


def both() -> Robot:
    return join_robots({"": ICUB, "katana": KATANA}, {"katana": (AT, TURN)})


def test_parts_motors_and_names_follow_each_other() -> None:
    robot = both()
    assert robot.motors == (*ICUB.motors, *(f"katana_{name}" for name in KATANA.motors))
    assert list(robot.parts) == [*ICUB.parts, "katana_arm"]
    assert robot.motors[robot.parts["katana_arm"].slice] == robot.parts["katana_arm"].motors
    assert robot.links == (*ICUB.links, *(f"katana_{name}" for name in KATANA.links[1:]))
    assert {motor.part for motor in robot.motor_table} == set(robot.parts)
    np.testing.assert_array_equal(robot.home, [*ICUB.home, *KATANA.home])
    assert join_robots({"": ICUB, "katana": replace(KATANA, least_lever=0.05)}).least_lever == 0.05


@given(st.integers(0, 2**32 - 1))
def test_every_robot_moves_as_it_would_alone(seed: int) -> None:
    robot, rng = both(), np.random.default_rng(seed)
    q = rng.uniform(*robot.limits.T)
    together = link_transforms(robot, q)
    shift = np.eye(4)
    shift[:3, :3], shift[:3, 3] = TURN, AT
    n = len(ICUB.motors)
    np.testing.assert_allclose(together[: len(ICUB.links)], link_transforms(ICUB, q[:n]), atol=1e-12)
    alone = shift @ link_transforms(KATANA, q[n:])[1:] @ np.linalg.inv(shift)
    np.testing.assert_allclose(together[len(ICUB.links) :], alone, atol=1e-12)
    first = len(ICUB.shapes)
    for old, new in zip(KATANA.shapes, robot.shapes[first:], strict=True):
        np.testing.assert_allclose(new.position, TURN @ old.position + AT, atol=1e-12)
        np.testing.assert_allclose(new.rotation, TURN @ old.rotation, atol=1e-12)
        assert (new.kind, new.size, new.role) == (old.kind, old.size, old.role)


def test_own_pairs_stay_and_all_of_different_robots_are_tested() -> None:
    robot, first = both(), len(ICUB.shapes)
    for role, own, other in (("solid", ICUB.solid_pairs, KATANA.solid_pairs), ("field", ICUB.field_pairs, KATANA.field_pairs)):
        cross = {
            (i, j + first)
            for i, a in enumerate(ICUB.shapes)
            for j, b in enumerate(KATANA.shapes)
            if a.role == b.role == role and (a.link or b.link)
        }
        expected = cross | set(map(tuple, own.tolist())) | set(map(tuple, (other + first).tolist()))
        pairs = (robot.solid_pairs if role == "solid" else robot.field_pairs).tolist()
        assert set(map(tuple, pairs)) == expected
        assert pairs == sorted(pairs)


def test_reasons_and_lines_are_kept() -> None:
    robot, shift = both(), len(ICUB.joints)
    for pair, reason in KATANA.untested.items():
        if 0 not in pair:
            assert robot.untested[frozenset(link + shift for link in pair)] == f"{reason} (katana)"
    assert frozenset((0, shift + 1)) not in robot.untested  # the base bears the iCub's pelvis too, which the Katana can reach
    assert robot.where["motor", "katana_arm_0"] == KATANA.where["motor", "arm_0"]
    assert robot.where["marker", "head"] == ICUB.where["marker", "head"]


def test_clauses_concern_the_motors_they_concerned_alone() -> None:
    robot = join_robots({"katana": KATANA, "left": ICUB, "right": ICUB})
    n, m = len(KATANA.motors), len(ICUB.motors)
    assert len(robot.clauses) == 2 * len(ICUB.clauses)
    for index, old in enumerate(ICUB.clauses):
        left, right = robot.clauses[index], robot.clauses[index + len(ICUB.clauses)]
        np.testing.assert_array_equal(left.a[:, n : n + m], old.a)
        np.testing.assert_array_equal(right.a[:, n + m :], old.a)
        assert not left.a[:, n + m :].any() and not right.a[:, : n + m].any()
        assert (left.part, right.part) == (f"left_{old.part}", f"right_{old.part}")
        assert robot.where["clause", str(index + len(ICUB.clauses))] == ICUB.where["clause", str(index)]


def test_equal_names_are_refused() -> None:
    inner = join_robots({"b": KATANA})
    with pytest.raises(InvalidValue, match="two parts of the joined robots have the name 'a_b_arm'"):
        join_robots({"a": inner, "a_b": KATANA})


@pytest.mark.parametrize(
    ("robots", "problem"),
    [
        ([KATANA, KATANA], "robots is a list; it must be a dict"),
        (KATANA, "robots is a Robot; it must be a dict"),
        ({1: KATANA}, "robots has the key 1; a key must be text"),
        ({"a": "katana"}, "robot 'a' is 'katana'; it must be a Robot"),
    ],
)
def test_robots_of_a_wrong_type_are_refused(robots: Any, problem: str) -> None:
    with pytest.raises(InvalidValue, match=problem):
        join_robots(robots)


def test_a_place_without_a_robot_or_without_a_pose_is_refused() -> None:
    with pytest.raises(UnknownName, match="unknown robot 'katna'. Did you mean 'katana'"):
        join_robots({"katana": KATANA}, {"katna": (AT, TURN)})
    with pytest.raises(InvalidValue, match="place of robot 'katana': rotation"):
        join_robots({"katana": KATANA}, {"katana": (AT, -TURN)})
    with pytest.raises(InvalidValue, match="place of robot 'katana': position"):
        join_robots({"katana": KATANA}, {"katana": (AT[:2], TURN)})
    for place in (AT, (0.0, 0.0, 1.0), AT.tolist()):
        with pytest.raises(InvalidValue, match=r"place of robot 'katana' is no pair. Give \(position, rotation\)"):
            join_robots({"katana": KATANA}, {"katana": place})
    with pytest.raises(InvalidValue, match="place of robot 'katana': position is 'here'"):
        join_robots({"katana": KATANA}, {"katana": ("here", TURN)})
    with pytest.raises(InvalidValue, match="there is no robot"):
        join_robots({})


def test_the_shipped_pair_rests_without_touching_and_can_touch_each_other() -> None:
    robot = load_robot("icub_katana")
    model = Model(robot)
    assert model.evaluate(robot.home).contacts == ()
    poses = np.random.default_rng(3).uniform(*robot.limits.T, size=(300, len(robot.motors)))
    met = {frozenset((c.first, c.second)) for q in poses for c in model.evaluate(q).contacts}
    assert any(a.startswith("katana_") != b.startswith("katana_") for a, b in met)
