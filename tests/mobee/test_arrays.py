# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import mobee
from mobee.arrays import checked_count, checked_threads, is_number, real_array
from mobee.model.masses import gravity_torque, potential_energy
from mobee.roadmap.playback import timed

NO_NUMBERS, DATES = np.array(["1", 2], dtype=object), np.array(["2014-01-01"], dtype="datetime64[D]")


def test_numbers_are_copied_as_floats() -> None:
    given = np.arange(6.0).reshape(2, 3).T
    value = real_array("q", given)
    value[0, 0] = 9.0
    assert (given[0, 0], value.flags.c_contiguous, value.shape) == (0.0, True, (3, 2))
    assert real_array("q", [1, True, np.float32(0.5)]).tolist() == [1.0, 1.0, 0.5]
    assert real_array("q", np.array([1, 2.5], dtype=object)).tolist() == [1.0, 2.5]


@pytest.mark.parametrize("given", ["home", [[1.0], [1.0, 2.0]], object(), [1.0, "a"], ["1", "2"], np.full((9, 1), "1"), NO_NUMBERS, DATES])
def test_an_argument_that_is_no_array_of_numbers_is_refused(given: Any) -> None:
    with pytest.raises(mobee.InvalidValue, match=r"^q is .*; it must be an array of numbers\.$"):
        real_array("q", given)


@pytest.mark.parametrize("given", [1j, [0.0, 1j], np.zeros(2, dtype=np.complex64), [np.complex128(1.0)]])
def test_complex_numbers_are_refused_even_without_an_imaginary_part(given: Any) -> None:
    with pytest.raises(mobee.InvalidValue, match="q is complex, .* first; it must be real numbers"):
        real_array("q", given)


@pytest.mark.parametrize("value", [1, 0.5, np.float32(0.5), np.int64(1), Fraction(1, 2), np.nan])
def test_real_numbers_of_all_types_are_numbers(value: Any) -> None:
    assert is_number(value)


@pytest.mark.parametrize("value", ["1", None, 1j, np.complex128(1.0), [1.0], np.ones(1)])
def test_other_values_are_no_numbers(value: Any) -> None:
    assert not is_number(value)


@pytest.mark.parametrize("value", [True, 2, -1, 3.0, "3", None])
def test_a_count_is_a_whole_number_from_the_least_on(value: Any) -> None:
    with pytest.raises(mobee.InvalidValue, match=f"n={value!r}: give a whole number, 3 or more"):
        checked_count("n", value, 3)


def test_counts_and_threads_of_numpy_become_ints() -> None:
    for found in (checked_count("n", np.int64(3), 3), checked_threads(np.int32(3))):  # type: ignore[arg-type]
        assert type(found) is int and found == 3


def test_times_may_be_fractions() -> None:
    model = mobee.Model(mobee.load_robot("katana"))
    motors = mobee.MotorParameters(substep=Fraction(1, 200))  # type: ignore[arg-type]
    plant, same = (mobee.OfflinePlant(model, seed=0, motors=motors, dt=dt) for dt in (Fraction(1, 50), 0.02))  # type: ignore[arg-type]
    part = next(iter(model.robot.parts))
    assert plant.act(part, plant.measure(part)).q.tolist() == same.act(part, same.measure(part)).q.tolist()


def test_a_complex_q_is_refused_wherever_a_pose_is_taken() -> None:
    robot = mobee.load_robot("icub")
    model = mobee.Model(robot)
    q = robot.home + 0j
    controller, plant, space = mobee.Controller(model), mobee.OfflinePlant(model, seed=0), mobee.Lattice(robot, joints=robot.motors[:2])
    part, arm = "left_arm", robot.part("left_arm").slice
    ask = (
        lambda: model.evaluate(q),
        lambda: model.jacobian(q, "left_palm"),
        lambda: model.track().evaluate(q),
        lambda: controller.step(q, 0.01),
        lambda: controller.reset(q),
        lambda: controller.set_attractor(part, q[arm]),
        lambda: setattr(controller, "attractor", q),
        lambda: plant.act(part, q[arm]),
        lambda: space.state_of(q),
        lambda: gravity_torque(robot, q),
        lambda: potential_energy(robot, q),
        lambda: mobee.solve_ik(model, [mobee.costs.home()], start=q),
        lambda: mobee.reach_path(model, "left_palm", np.zeros(3), start=q),
        lambda: timed(robot, np.array([q, q]), mobee.Gains.default()),
    )
    for one in ask:
        with pytest.raises(mobee.InvalidValue, match="is complex"):
            one()
