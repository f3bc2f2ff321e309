# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue
from mobee.roadmap.ik import costs

PLACE = np.array([-0.3, 0.1, 0.1])


def test_a_function_for_one_pose_and_one_for_a_batch_say_the_same(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    single = costs.term(lambda pose, contacts: float(np.linalg.norm(pose.position("left_palm") - PLACE)))
    batched = costs.term(lambda pose, contacts: np.linalg.norm(pose.position("left_palm") - PLACE, axis=-1))
    expected = costs.position("left_palm", PLACE).residual(pose)
    for _ in range(2):
        np.testing.assert_allclose(single.residual(pose), expected)
        np.testing.assert_allclose(batched.residual(pose), expected)


def test_a_function_may_be_written_for_a_batch_only(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    counted = costs.term(lambda pose, contacts: np.bincount(contacts.pose, minlength=len(pose.q)))
    high = costs.term(lambda pose, contacts: np.abs(pose.position("left_palm")[:, 2]))
    for _ in range(2):
        np.testing.assert_array_equal(counted.residual(pose), [len(one.contacts) for one in pose.each()])
        np.testing.assert_array_equal(high.residual(pose), np.abs(pose.position("left_palm")[:, 2]))
    with pytest.raises(ZeroDivisionError):  # the error for a pose, not the one for a batch
        costs.term(lambda pose, contacts: 1 / 0 if pose.q.ndim == 1 else [][0]).residual(pose)


def test_a_batched_function_is_called_once_a_batch(free: mobee.Model, postures: np.ndarray) -> None:
    calls = []

    def height(pose: mobee.Pose, contacts: object) -> np.ndarray:
        calls.append(pose.q.shape)
        return np.abs(pose.position("left_palm")[..., 2])

    one = costs.term(height)
    one.residual(free.evaluate(postures))
    del calls[:]
    one.residual(free.evaluate(postures))
    assert calls == [postures.shape]
    assert one.name == "height"


def test_contacts_are_those_of_the_pose(free: mobee.Model, postures: np.ndarray) -> None:
    counted = costs.term(lambda pose, contacts: len(contacts))
    pose = free.evaluate(postures)
    np.testing.assert_array_equal(counted.residual(pose), [len(one.contacts) for one in pose.each()])


def test_a_function_that_fails_says_why(free: mobee.Model, icub: mobee.Robot) -> None:
    def broken(pose: mobee.Pose, contacts: object) -> float:
        raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        costs.term(broken).residual(free.evaluate(icub.home[None]))


def test_a_function_that_returns_no_number_is_refused(free: mobee.Model, icub: mobee.Robot) -> None:
    with pytest.raises(InvalidValue, match=r"\(3,\)"):
        costs.term(lambda pose, contacts: pose.position("left_palm") - PLACE).residual(free.evaluate(icub.home[None]))


def test_a_function_that_is_nan_in_a_pose_is_refused_by_name(free: mobee.Model, postures: np.ndarray) -> None:
    heights = free.evaluate(postures).position("left_palm")[:, 2]
    one = costs.term(lambda pose, contacts: np.where(pose.position("left_palm")[..., 2] > np.median(heights), np.nan, 0.0), name="mine")
    with pytest.raises(InvalidValue, match="'mine' is nan in a pose.*inf"):
        one.residual(free.evaluate(postures))


def test_weight_is_one_at_ten_tolerances() -> None:
    assert costs.term(len, tolerance=0.05).weight * 0.5 == pytest.approx(1.0)
    assert costs.term(len, tolerance=None).weight == 1.0
    assert costs.term(len, name="mine").name == "mine"
