"""The planar arm of three segments of 0.3 m shows what is reachable: a disk of radius 0.9, less what touches."""

from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee import costs, tasks
from mobee.errors import InvalidValue
from mobee.roadmap.building.flood import OFF, Flood, flooded
from mobee.roadmap.building.task import Task
from mobee.roadmap.ik.problem import Problem
from tests.mobee.planar import planar_arm

SPACING = np.array([0.1, 0.1])
BOX = [(-1.1, 1.1), (-1.1, 1.1)]
TIP = tasks.place("tip", "xy", BOX)


@pytest.fixture(scope="module")
def arm() -> mobee.Model:
    return mobee.Model(planar_arm())


def flood(
    model: mobee.Model, task: Task, spacing: np.ndarray = SPACING, start=None, seed: int = 0, terms=()
) -> tuple[Problem, np.ndarray, np.ndarray]:
    problem = Problem(model, [costs.collision(), *terms], start, None)
    return problem, *flooded(problem, task, spacing, np.random.default_rng(seed))


def gaps(of: np.ndarray, to: np.ndarray) -> np.ndarray:
    return np.linalg.norm((of[:, None] - to[None]) / SPACING, axis=2).min(axis=1)


def test_what_is_reachable_is_covered_by_valid_poses_at_their_spacing(arm: mobee.Model) -> None:
    problem, q, y = flood(arm, TIP)
    _, good = problem.look(q)
    assert good.all()
    np.testing.assert_allclose(y, arm.evaluate(q).position("tip")[:, :2], atol=1e-12)
    assert (q >= arm.robot.limits[:, 0]).all() and (q <= arm.robot.limits[:, 1]).all()
    angles, radii = np.meshgrid(np.linspace(-3.1, 3.1, 60), np.linspace(0.3, 0.88, 8))
    places = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1).reshape(-1, 2)
    assert gaps(places, y).max() <= 1.0
    apart = np.linalg.norm((y[:, None] - y[None]) / SPACING, axis=2) + 9.0 * np.eye(len(y))
    assert apart.min() >= 0.8
    on_lattice = np.abs(apart.min(axis=1) - 1.0) <= 2.0 * np.sqrt(2.0) * OFF
    assert on_lattice.mean() > 0.9


def test_the_same_seed_gives_the_same_map_and_another_one_the_same_region(arm: mobee.Model) -> None:
    first, again, other = flood(arm, TIP)[1:], flood(arm, TIP)[1:], flood(arm, TIP, seed=1)[1:]
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    assert gaps(first[1], other[1]).max() <= 1.0 and gaps(other[1], first[1]).max() <= 1.0


def test_it_flows_around_an_obstacle_and_leaves_out_what_that_takes(arm: mobee.Model) -> None:
    world = mobee.World()
    world.add("pillar", mobee.cylinder(0.1, 1.0), position=[0.5, 0.5, 0.0])
    _, _, y = flood(mobee.Model(planar_arm(), world), TIP)
    assert np.linalg.norm(y - 0.5, axis=1).min() > 0.1
    behind = np.array([[0.6, 0.62], [0.65, 0.5]])
    free = gaps(behind, flood(arm, TIP)[2])
    assert (gaps(behind, y) > free).any()


def test_neighbours_have_postures_alike(arm: mobee.Model) -> None:
    _, q, y = flood(arm, tasks.place("tip", "xy", [(0.4, 0.8), (-0.3, 0.3)]), start=[-0.6, 0.8, 0.5])
    beside = np.argwhere(np.triu(np.linalg.norm((y[:, None] - y[None]) / SPACING, axis=2) < 1.1, 1))
    steps = np.abs(q[beside[:, 0]] - q[beside[:, 1]]).max(axis=1)
    assert len(beside) > 60 and (steps <= 0.8).mean() > 0.9


def test_terms_without_a_derivative_are_asked_afterwards(arm: mobee.Model) -> None:
    _, _, y = flood(arm, TIP, terms=[costs.term(lambda pose, contacts: np.maximum(0.0, pose.position("tip")[..., 0]), tolerance=0.0)])
    assert len(y) > 20 and (y[:, 0] <= 0.0).all()


def test_motors_and_one_dimension(arm: mobee.Model) -> None:
    _, q, y = flood(arm, tasks.motors({"m1": (-1.0, 1.0)}), np.array([0.25]), terms=[costs.plane("tip", (0, 1, 0), 0.2)])
    np.testing.assert_allclose(np.sort(y[:, 0]), np.linspace(-1.0, 1.0, 9), atol=0.02 * 0.25)
    np.testing.assert_array_equal(q[:, 1], y[:, 0])


def test_where_nothing_is_reached_there_is_no_vertex(arm: mobee.Model) -> None:
    _, q, y = flood(arm, tasks.place("tip", "xy", [(2.0, 3.0), (2.0, 3.0)]))
    assert q.shape == (0, 3) and y.shape == (0, 2)


def test_a_coordinate_without_derivative_is_refused(arm: mobee.Model) -> None:
    with pytest.raises(InvalidValue, match=r"'mine' has no derivative.*nes"):
        flood(arm, tasks.function(lambda pose: pose.q[..., 0], -1.0, 1.0, name="mine"), np.array([0.1]))


def test_progress_is_told(arm: mobee.Model) -> None:
    told: list[int] = []
    problem = Problem(arm, [costs.collision()], None, None)
    q, _ = flooded(problem, TIP, SPACING, np.random.default_rng(0), told.append)
    assert told == sorted(told) and told[-1] <= len(q)


def test_it_goes_on_where_it_was_interrupted(arm: mobee.Model) -> None:
    whole = flood(arm, TIP)[1:]
    rng = np.random.default_rng(0)
    first = Flood(Problem(arm, [costs.collision()], None, None), TIP, SPACING, rng)
    for _ in range(9):
        assert first.step()
    state, generator = first.state(), rng.bit_generator.state
    assert 0 < len(state["q"]) == first.vertices < len(whole[0]) and first.open > 0
    again = np.random.default_rng(5)
    again.bit_generator.state = generator
    second = Flood(Problem(arm, [costs.collision()], None, None), TIP, SPACING, again)
    second.restore(state)
    while second.step():
        pass
    for one, other in zip(second.result(), whole, strict=True):
        np.testing.assert_array_equal(one, other)


def test_three_dimensions(arm: mobee.Model) -> None:
    _, q, y = flood(arm, tasks.motors({name: (-1.0, 1.0) for name in ("m0", "m1", "m2")}), np.full(3, 0.5))
    np.testing.assert_array_equal(q, y)
    far = np.linalg.norm(np.random.default_rng(0).uniform(-0.75, 0.75, (50, 1, 3)) - y, axis=2).min(axis=1)
    assert far.max() <= 0.5 / np.sqrt(2.0) + 0.02
