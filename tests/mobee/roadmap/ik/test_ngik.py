# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue, UnknownName
from mobee.roadmap.ik import costs

ARM = ["torso", "r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow", "r_wrist_prosup", "r_wrist_pitch", "r_wrist_yaw"]


@pytest.fixture(scope="module")
def table(icub: mobee.Robot) -> mobee.Model:
    """The iCub at a table, with a box on it."""
    world = mobee.load_world("table")
    world.add("box", mobee.box(0.1, 0.1, 0.1), position=(-0.3, 0.2, 0.0))
    return mobee.Model(icub, world)


@pytest.fixture(scope="module")
def goal(table: mobee.Model) -> list:
    """Right palm beside the box, palm down."""
    return [
        costs.position("right_palm", [-0.3, 0.1, 0.05]),
        costs.orientation("right_palm", [0.0, 0.0, -1.0]),
        costs.collision(),
        costs.home(),
    ]


@pytest.mark.parametrize("method", ["hybrid", "nes"])
def test_a_pose_without_contacts_is_found(table: mobee.Model, goal: list, method: str) -> None:
    ik = mobee.solve_ik(table, goal, seed=1, motors=ARM, method=method)
    pose = table.evaluate(ik.q)
    assert ik.reached and ik.contacts == () and pose.count == 0
    assert np.linalg.norm(pose.position("right_palm") - [-0.3, 0.1, 0.05]) <= 0.005
    assert np.arccos(-pose.normal("right_palm")[2]) <= np.deg2rad(5.0)
    assert ik.residuals["position right_palm"] == pytest.approx(np.linalg.norm(pose.position("right_palm") - [-0.3, 0.1, 0.05]))
    assert list(ik.residuals) == ["position right_palm", "orientation right_palm", "collision", "home"]
    assert ik.residuals["collision"] == 0.0


def test_the_reference_engine_finds_no_contact_either(table: mobee.Model, goal: list) -> None:
    ik = mobee.solve_ik(table, goal, motors=ARM, method="nes")
    assert mobee.Model(table.robot, table.world, engine="fcl").evaluate(ik.q).count == 0


@pytest.mark.parametrize("method", ["hybrid", "nes"])
def test_the_same_seed_gives_the_same_pose(table: mobee.Model, goal: list, method: str) -> None:
    one, two = (mobee.solve_ik(table, goal, seed=3, motors=ARM, method=method) for _ in range(2))
    np.testing.assert_array_equal(one.q, two.q)
    assert one.evaluations == two.evaluations


def test_motors_that_may_not_move_stay(table: mobee.Model, goal: list) -> None:
    robot = table.robot
    start = robot.home.copy()
    start[robot.part("left_arm").slice] += 0.01
    ik = mobee.solve_ik(table, goal, start=start, motors=ARM)
    held = [k for k, name in enumerate(robot.motors) if name not in ARM and name not in robot.part("torso").motors]
    np.testing.assert_array_equal(ik.q[held], start[held])
    moved = np.setdiff1d(np.arange(len(robot.motors)), held)
    assert (ik.q[moved] >= robot.limits[moved, 0]).all() and (ik.q[moved] <= robot.limits[moved, 1]).all()


def test_plain_functions_are_terms(free: mobee.Model) -> None:
    """Raise the left palm to a height, with the elbow no higher than the shoulder: nothing that least squares knows."""

    def height(pose: mobee.Pose, contacts: object) -> np.ndarray:
        return np.abs(pose.position("left_palm")[..., 2] - 0.3)

    def elbow_down(pose: mobee.Pose, contacts: object) -> float:
        return max(0.0, float(pose.position("left_elbow")[2]) - 0.1)

    ik = mobee.solve_ik(free, [height, elbow_down, costs.collision()], motors=["left_arm"])
    pose = free.evaluate(ik.q)
    assert ik.reached and abs(pose.position("left_palm")[2] - 0.3) <= 0.005 and pose.position("left_elbow")[2] <= 0.105
    assert set(ik.residuals) == {"height", "elbow_down", "collision"}


def test_evolution_finds_a_pose_that_least_squares_misses(free: mobee.Model) -> None:
    """A residual without a derivative that hardly any solution of the rest meets: three motors, each within 5 mrad."""
    robot = free.robot
    goal = robot.limits.mean(axis=1)
    bends = [robot.motor_index(name) for name in ("r_elbow", "r_wrist_prosup", "torso_yaw")]
    palm = costs.position("right_palm", free.evaluate(goal).position("right_palm"))

    def bent(pose: mobee.Pose, contacts: object) -> np.ndarray:
        return np.abs(pose.q[..., bends] - goal[bends]).max(axis=-1)

    both = [palm, costs.term(bent, tolerance=5e-3)]
    assert not mobee.solve_ik(free, both, motors=ARM, method="least_squares").reached
    assert mobee.solve_ik(free, both, motors=ARM).reached


def test_contacts_of_fields_do_not_count_in_plain_functions_either(icub: mobee.Robot) -> None:
    world = mobee.World()
    world.add("ball", mobee.sphere(0.02), position=mobee.Model(icub).evaluate(icub.home).position("right_palm") + [0.0, -0.05, 0.0])
    model = mobee.Model(icub, world)
    count = costs.term(lambda pose, contacts: len(contacts), tolerance=0.5, name="contacts")
    ik = mobee.solve_ik(model, [count], motors=ARM)
    assert model.evaluate(ik.q).table.kind.tolist().count(1) > 0  # fields
    assert ik.reached and ik.residuals == {"contacts": 0.0}


def test_an_unreachable_target_ends_with_the_nearest_pose(free: mobee.Model) -> None:
    far = [costs.position("right_palm", [-3.0, 0.0, 0.0])]
    ik = mobee.solve_ik(free, far, motors=ARM, method="nes", evaluations=2000)
    assert not ik.reached and ik.evaluations <= 2000
    start = costs.position("right_palm", [-3.0, 0.0, 0.0]).residual(free.evaluate(free.robot.home[None]))[0]
    assert ik.residuals["position right_palm"] < start


def test_contacts_that_remain_are_reported(icub: mobee.Robot) -> None:
    world = mobee.World()
    model = mobee.Model(icub, world)
    world.add("wall", mobee.box(0.2, 0.2, 0.2), position=model.evaluate(icub.home).position("right_palm"))
    ik = mobee.solve_ik(model, [costs.collision()], motors=["r_wrist_pitch"], method="nes", evaluations=100)
    assert not ik.reached and ik.residuals["collision"] > 0.0
    assert {contact.kind for contact in ik.contacts} == {"solid"}
    assert any(contact.second == "wall" for contact in ik.contacts)


def test_the_world_is_that_of_the_call(icub: mobee.Robot) -> None:
    world = mobee.World()
    model = mobee.Model(icub, world)
    term = [costs.collision()]
    assert mobee.solve_ik(model, term).evaluations == 1  # home is good enough
    world.add("ball", mobee.sphere(0.05), position=model.evaluate(icub.home).position("right_palm"))
    ik = mobee.solve_ik(model, term, motors=["right_arm"])
    assert ik.reached and ik.evaluations > 1 and model.evaluate(ik.q).count == 0


def test_without_tolerances_it_ends_when_it_has_converged(free: mobee.Model) -> None:
    ik = mobee.solve_ik(free, [costs.comfort()], motors=["torso"])
    middle = free.robot.limits[:3].mean(axis=1)
    assert ik.reached
    np.testing.assert_allclose(ik.q[:3], middle, atol=0.05)


def test_terms_with_equal_names_get_numbers(free: mobee.Model) -> None:
    ik = mobee.solve_ik(free, [costs.home(), costs.home()], motors=["torso"], evaluations=100)
    assert list(ik.residuals) == ["home", "home 2"]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"costs": []}, InvalidValue),
        ({"start": np.zeros(3)}, InvalidValue),
        ({"motors": []}, InvalidValue),
        ({"motors": "torso"}, InvalidValue),
        ({"motors": ["left_leg"]}, UnknownName),
        ({"method": "newton"}, UnknownName),
        ({"evaluations": 3}, InvalidValue),
        ({"evaluations": float("nan")}, InvalidValue),
        ({"seed": -1}, InvalidValue),
        ({"seed": 1.5}, InvalidValue),
        ({"costs": costs.home()}, InvalidValue),
        ({"costs": None}, InvalidValue),
    ],
)
def test_invalid_arguments_are_refused(free: mobee.Model, arguments: dict, error: type) -> None:
    with pytest.raises(error):
        mobee.solve_ik(free, **({"costs": [costs.home()]} | arguments))


@pytest.mark.parametrize("method", ["nes", "hybrid"])
def test_the_result_is_never_worse_than_the_start(free: mobee.Model, method: str) -> None:
    home = free.robot.home
    near = free.evaluate(home).position("right_palm") + [0.0, 0.006, 0.0]
    goals = [costs.home()], [costs.position("right_palm", near, tolerance=0.002), costs.home()]
    for goal in goals:
        ik = mobee.solve_ik(free, goal, seed=1, method=method, evaluations=200)
        cost = [sum(one.residual(free.evaluate(q[None]))[0] for one in goal) for q in (home, ik.q)]
        assert ik.reached or cost[1] <= cost[0]
    assert np.array_equal(mobee.solve_ik(free, [costs.home()], method="nes").q, home)
