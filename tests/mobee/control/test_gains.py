# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest

from mobee.control.gains import Gains, Settle, SettleTest
from mobee.errors import InvalidValue, UnknownName


def test_the_published_numbers() -> None:
    g = Gains.published_2014()
    degrees = np.rad2deg([g.max_spring, g.max_limit, g.limit_width, g.max_constraint, g.constraint_width, g.max_contact, g.max_client])
    assert degrees == pytest.approx([1000.0, 1000.0, 10.0, 1500.0, 40.0, 1200.0, 1000.0])
    assert (g.damping, g.stiffness, g.contact_gain, g.contact_slope, g.client_slope) == (50.0, 50.0, 1000.0, 50.0, 50.0)
    assert np.rad2deg([g.settle.speed, g.settle.acceleration]) == pytest.approx([1.0, 50.0])
    assert (g.settle.first_check, g.settle.interval, g.settle.timeout) == (1.0, 0.2, 20.0)


def test_published_fingers_and_eyes_do_not_move_and_the_rest_does() -> None:
    names = ("torso_yaw", "neck_yaw", "eyes_tilt", "eyes_vergence", "l_elbow", "r_wrist_yaw", "l_hand_finger", "r_thumb_oppose", "l_pinky")
    assert Gains.published_2014().weight(names).tolist() == [1, 1, 0, 0, 1, 1, 0, 0, 0]
    assert Gains.default().weight(names).tolist() == [1] * 9


def test_the_first_pattern_that_matches_counts() -> None:
    gains = replace(Gains.default(), weights=(("joint_1", 1.0), ("joint_*", 0.0)))
    assert gains.weight(("joint_1", "joint_2", "other")).tolist() == [1, 0, 1]


def test_named_sets() -> None:
    assert Gains.named("published_2014") == Gains.published_2014()
    assert Gains.named("default") == Gains.default()
    with pytest.raises(UnknownName, match="published_2014"):
        Gains.named("published_2013")


@pytest.mark.parametrize(
    "change", [{"damping": 0.0}, {"damping": -5}, {"stiffness": np.inf}, {"stiffness": "50"}, {"weights": (("a", 0.5),)}]
)
def test_nonsense_is_refused_with_its_name(change: dict[str, object]) -> None:
    with pytest.raises(InvalidValue, match=next(iter(change)).rstrip("s")):
        replace(Gains.default(), **change)


def test_motors_can_have_gains_of_their_own_the_last_set_counts_first() -> None:
    gains = Gains.default().with_motors("*_elbow", stiffness=50.0, weight=0.0).with_motors("l_*", stiffness=70.0)
    motors = ("l_elbow", "r_elbow", "torso_yaw")
    assert gains.of_motors("stiffness", motors).tolist() == [70.0, 50.0, Gains.default().stiffness]
    assert gains.of_motors("damping", motors).tolist() == [40.0] * 3
    assert gains.weight(motors).tolist() == [0, 0, 1]


def test_gains_with_motors_are_values() -> None:
    first, second = (Gains.default().with_motors("*_elbow", stiffness=50, damping=30) for _ in range(2))
    assert first == second and hash(first) == hash(second) and first != Gains.default()
    assert "('*_elbow', (('damping', 30), ('stiffness', 50)))" in repr(first)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"stifness": 1.0}, "Did you mean 'stiffness'"),
        ({"damping": -1.0}, r"damping of the motors '\*_elbow' -1"),
        ({"damping": "much"}, "damping of the motors .* 'much': must be a finite number above 0"),
        ({"weight": 2}, "weight 2"),
    ],
)
def test_nonsense_for_some_motors_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises((InvalidValue, UnknownName), match=said):
        Gains.default().with_motors("*_elbow", **changes)


def test_a_pattern_that_matches_no_motor_is_refused_where_the_robot_is_known() -> None:
    with pytest.raises(UnknownName, match="motor pattern 'l_elbw'.*Did you mean 'l_elbow'"):
        Gains.default().with_motors("l_elbw", damping=30.0).of_motors("damping", ("l_elbow", "r_elbow"))


def test_an_unknown_squash_is_refused() -> None:
    with pytest.raises(UnknownName, match="'norm'.*Valid: direction, each"):
        replace(Gains.default(), client_squash="norm")


def test_gains_go_through_json_and_back() -> None:
    gains = Gains.published_2014().with_motors("*_elbow", stiffness=50.0)
    again = Gains(**json.loads(json.dumps(asdict(gains))))
    assert again == gains and hash(again) == hash(gains)


SETTLE = Settle(speed=0.02, acceleration=0.9)
REST = np.zeros(3)


def test_a_resting_part_is_settled_at_the_first_check_and_not_before() -> None:
    test = SettleTest(SETTLE, 5.0)
    assert [test.update(t, REST, REST) for t in (5.0, 5.5, 5.99, 6.0)] == ["moving"] * 3 + ["settled"]


def test_the_settle_test_checks_only_at_its_interval() -> None:
    test = SettleTest(SETTLE, 0.0)
    assert test.update(1.0, np.array([0.0, 0.03, 0.0]), REST) == "moving"
    assert [test.update(t, REST, REST) for t in (1.1, 1.19, 1.2)] == ["moving", "moving", "settled"]


def test_one_fast_or_accelerated_motor_keeps_the_part_moving() -> None:
    for speeds, accelerations in ((np.array([0.0, -0.021]), np.zeros(2)), (np.zeros(2), np.array([-0.91, 0.0]))):
        assert SettleTest(SETTLE, 0.0).update(1.0, speeds, accelerations) == "moving"
    assert SettleTest(SETTLE, 0.0).update(1.0, np.array([0.02]), np.array([0.9])) == "settled"


def test_a_part_that_never_rests_times_out() -> None:
    test = SettleTest(SETTLE, 1.0)
    verdicts = [test.update(1.0 + 0.01 * k, np.ones(3), REST) for k in range(2001)]
    assert verdicts.count("timeout") == 1 and verdicts[-1] == "timeout"


def test_ticks_that_add_up_to_almost_a_second_count_as_one() -> None:
    test = SettleTest(SETTLE, 0.1)
    assert test.update(sum([0.01] * 110), REST, REST) == "settled"


def test_settle_checks_missed_by_a_late_caller_are_skipped() -> None:
    test = SettleTest(SETTLE, 0.0)
    assert test.update(1.55, np.ones(3), REST) == "moving"
    assert test.update(1.59, REST, REST) == "moving"
    assert test.update(1.6, REST, REST) == "settled"


def test_a_threshold_of_zero_is_refused() -> None:
    with pytest.raises(InvalidValue, match="speed 0"):
        Settle(speed=0.0, acceleration=1.0)


@pytest.mark.parametrize(
    "change", [{"timeout": np.inf}, {"interval": np.nan}, {"first_check": np.nan}, {"first_check": -1.0}, {"timeout": "3"}]
)
def test_times_that_would_never_end_an_action_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(InvalidValue, match=f"settle {next(iter(change))}"):
        Settle(speed=0.02, acceleration=0.9, **change)
