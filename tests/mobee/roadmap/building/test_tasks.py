# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee import tasks
from mobee.errors import InvalidValue, UnknownName
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.ik import costs
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.solve import Descent

MARKER = "right_palm"
BOX = [(-0.5, -0.2), (-0.2, 0.4)]
ONE = (-1.0, 1.0)


def test_place_is_where_the_marker_is(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    task = tasks.place(MARKER, "xz", BOX)
    np.testing.assert_array_equal(task.of(pose), pose.position(MARKER)[:, [0, 2]])
    assert task.names == ("right_palm x", "right_palm z")
    np.testing.assert_array_equal(task.box, BOX)


def test_along_is_the_printed_sum(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    np.testing.assert_allclose(tasks.along(MARKER, (1, 1, 1), *ONE).of(pose)[:, 0], pose.position(MARKER).sum(axis=1))


def test_spaces_are_put_together(free: mobee.Model, icub: mobee.Robot, postures: np.ndarray) -> None:
    task = tasks.motors({"r_elbow": (0.1, 1.0), "l_elbow": (0.2, 1.0)}) + tasks.place(MARKER, "xy", BOX)
    y = task.of(free.evaluate(postures))
    np.testing.assert_array_equal(y[:, :2], postures[:, [icub.motor_index("r_elbow"), icub.motor_index("l_elbow")]])
    assert y.shape == (len(postures), 4) and task.box.shape == (4, 2)
    assert task.names == ("r_elbow", "l_elbow", "right_palm x", "right_palm y")


def test_angle_is_that_about_the_axis(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    normal = pose.normal(MARKER)
    angle = tasks.angle(MARKER, (0, 0, 2), (0, 3, 1), *ONE).of(pose)[:, 0]  # from y about z
    np.testing.assert_allclose(np.tan(angle), -normal[:, 0] / normal[:, 1])
    assert (np.cos(angle) * normal[:, 1] > 0.0).all()
    finger = pose.rotation(MARKER)[:, :, 0]
    np.testing.assert_allclose(
        tasks.angle(MARKER, (1, 0, 0), (0, 1, 0), *ONE, direction=(1, 0, 0)).of(pose)[:, 0], np.arctan2(finger[:, 2], finger[:, 1])
    )


def test_any_function_for_a_batch_or_for_one_pose(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    batched = tasks.function(lambda pose: pose.position(MARKER)[..., 2], *ONE, name="height", unit="m")
    single = tasks.function(lambda pose: pose.position(MARKER)[2] + len(pose.contacts), *ONE)
    for _ in range(2):
        np.testing.assert_array_equal(batched.of(pose)[:, 0], pose.position(MARKER)[:, 2])
        np.testing.assert_allclose(single.of(pose)[:, 0], pose.position(MARKER)[:, 2] + [len(one.contacts) for one in pose.each()])
    assert batched.names == ("height",) and batched.coordinates[0].unit == "m"


def spaces(icub: mobee.Robot) -> dict[str, Task]:
    return {
        "place": tasks.place(MARKER, "xy", BOX),
        "along": tasks.along(MARKER, (1, 1, 1), *ONE),
        "motors": tasks.motors({"r_elbow": ONE, "torso_yaw": ONE}),
        "angle": tasks.angle(MARKER, (0, 0, 1), (0, 1, 0), *ONE),
        "finger": tasks.angle(MARKER, (0, 1, 1), (1, 0, 0), *ONE, direction=(1, 0, 0)),
    }


@pytest.mark.parametrize("name", ["place", "along", "motors", "angle", "finger"])
def test_least_squares_meets_a_value_at_once(free: mobee.Model, icub: mobee.Robot, name: str) -> None:
    """The slopes are right: with a wrong one the last digits take many steps."""
    rng, task = np.random.default_rng(3), spaces(icub)[name]
    for _ in range(5):
        goal = icub.limits.mean(axis=1) + 0.25 * rng.uniform(-1.0, 1.0, len(icub.motors)) * (icub.limits[:, 1] - icub.limits[:, 0])
        y = task.of(free.evaluate(goal[None]))[0]
        problem = Problem(free, [costs.home()], goal + 0.05 * rng.standard_normal(len(goal)), None)
        aims = task.aims(icub, y)
        assert aims is not None
        met = Descent(problem, [(aim, 1e-9) for aim in aims]).run(problem.start[None])
        assert len(met) == 1 and problem.evaluations <= 10
        np.testing.assert_allclose(task.of(free.evaluate(met))[0], y, rtol=0.0, atol=1e-9)


def test_a_function_has_no_aims_nor_has_a_task_that_contains_one(icub: mobee.Robot) -> None:
    task = tasks.place(MARKER, "xy", BOX) + tasks.function(len, *ONE)
    assert task.aims(icub, np.zeros(3)) is None


@pytest.mark.parametrize("box", [(1.0, 1.0), (1.0, -1.0), (float("nan"), 1.0), (0.0, float("inf"))])
def test_a_box_is_from_low_to_high(box: tuple[float, float]) -> None:
    for make in (
        lambda: tasks.place(MARKER, "x", [box]),
        lambda: tasks.motors({"r_elbow": box}),
        lambda: tasks.along(MARKER, (0, 0, 1), *box),
        lambda: tasks.angle(MARKER, (0, 0, 1), (0, 1, 0), *box),
        lambda: tasks.function(len, *box),
    ):
        with pytest.raises(InvalidValue, match="low"):
            make()


def test_an_invalid_task_space_is_refused() -> None:
    for make, words in (
        (lambda: tasks.place(MARKER, "xyz", BOX), "2 ranges"),
        (lambda: tasks.place(MARKER, "xx", BOX), "at most once"),
        (lambda: tasks.place(MARKER, "xw", BOX), "'x', 'y', 'z'"),
        (lambda: tasks.along(MARKER, (0, 0, 0), *ONE), "direction"),
        (lambda: tasks.angle(MARKER, (0, 0, 1), (0, 0, 2), *ONE), "perpendicular"),
        (lambda: tasks.angle(MARKER, (0, 0, 1), (0, 1, 0), -4.0, 1.0), "pi"),
        (lambda: tasks.function(3, *ONE), "function of a pose"),
        (lambda: tasks.motors({}), "at least"),
        (lambda: tasks.place(MARKER, "xy", BOX) + tasks.place(MARKER, "x", BOX[:1]), "right_palm x more than once"),
    ):
        with pytest.raises(InvalidValue, match=words):
            make()


def test_unknown_names_and_values_that_are_no_numbers_are_refused(free: mobee.Model, icub: mobee.Robot) -> None:
    pose = free.evaluate(icub.home[None])
    for task in (tasks.place("right_plam", "xy", BOX), tasks.motors({"r_elbw": ONE})):
        with pytest.raises(UnknownName, match="Did you mean 'r"):
            task.of(pose)
        with pytest.raises(UnknownName, match="Did you mean 'r"):
            task.aims(icub, np.zeros(len(task.names)))
    with pytest.raises(InvalidValue, match="'mine' is nan"):
        tasks.function(lambda pose: np.nan * pose.q[..., 0], *ONE, name="mine").of(pose)
