# SPDX-License-Identifier: Apache-2.0
"""A planar arm of three segments of 0.3 m reaches a disk of radius 0.9, except where it touches something."""

from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee import costs, tasks
from mobee.errors import InvalidValue
from mobee.roadmap.building.lattice_builder import MAX_DEVIATION, MIN_DISTANCE, Lattice, LatticeBuilder, lattice_poses
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.ik.problem import Problem
from tests.mobee.planar import planar_arm

SPACING = np.array([0.1, 0.1])
BOX = [(-1.1, 1.1), (-1.1, 1.1)]
TIP = tasks.place("tip", "xy", BOX)


@pytest.fixture(scope="module")
def arm() -> mobee.Model:
    return mobee.Model(planar_arm())


def built(
    model: mobee.Model, task: Task, spacing: np.ndarray = SPACING, start=None, seed: int = 0, terms=()
) -> tuple[Problem, np.ndarray, np.ndarray]:
    problem = Problem(model, [costs.collision(), *terms], start, None)
    return problem, *lattice_poses(problem, task, spacing, np.random.default_rng(seed))


def gaps(of: np.ndarray, to: np.ndarray) -> np.ndarray:
    return np.linalg.norm((of[:, None] - to[None]) / SPACING, axis=2).min(axis=1)


def test_the_reachable_region_is_covered_by_valid_poses_at_their_spacing(arm: mobee.Model) -> None:
    problem, q, y = built(arm, TIP)
    _, good = problem.evaluate(q)
    assert good.all()
    np.testing.assert_allclose(y, arm.evaluate(q).position("tip")[:, :2], atol=1e-12)
    assert (q >= arm.robot.limits[:, 0]).all() and (q <= arm.robot.limits[:, 1]).all()
    angles, radii = np.meshgrid(np.linspace(-3.1, 3.1, 60), np.linspace(0.3, 0.88, 8))
    places = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1).reshape(-1, 2)
    assert gaps(places, y).max() <= 1.0
    apart = np.linalg.norm((y[:, None] - y[None]) / SPACING, axis=2) + 9.0 * np.eye(len(y))
    assert apart.min() >= 0.8
    on_lattice = np.abs(apart.min(axis=1) - 1.0) <= 2.0 * np.sqrt(2.0) * MAX_DEVIATION
    assert on_lattice.mean() > 0.9


def test_the_same_seed_gives_the_same_map_and_another_one_the_same_region(arm: mobee.Model) -> None:
    first, again, other = built(arm, TIP)[1:], built(arm, TIP)[1:], built(arm, TIP, seed=1)[1:]
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    assert gaps(first[1], other[1]).max() <= 1.0 and gaps(other[1], first[1]).max() <= 1.0


def test_points_that_an_obstacle_occupies_are_left_out(arm: mobee.Model) -> None:
    world = mobee.World()
    world.add("pillar", mobee.cylinder(0.1, 1.0), position=[0.5, 0.5, 0.0])
    _, _, y = built(mobee.Model(planar_arm(), world), TIP)
    assert np.linalg.norm(y - 0.5, axis=1).min() > 0.1
    behind = np.array([[0.6, 0.62], [0.65, 0.5]])
    free = gaps(behind, built(arm, TIP)[2])
    assert (gaps(behind, y) > free).any()


def test_neighbours_have_similar_postures(arm: mobee.Model) -> None:
    _, q, y = built(arm, tasks.place("tip", "xy", [(0.4, 0.8), (-0.3, 0.3)]), start=[-0.6, 0.8, 0.5])
    beside = np.argwhere(np.triu(np.linalg.norm((y[:, None] - y[None]) / SPACING, axis=2) < 1.1, 1))
    steps = np.abs(q[beside[:, 0]] - q[beside[:, 1]]).max(axis=1)
    assert len(beside) > 60 and (steps <= 0.8).mean() > 0.9


def test_terms_without_a_derivative_are_checked_afterwards(arm: mobee.Model) -> None:
    _, _, y = built(arm, TIP, terms=[costs.term(lambda pose, contacts: np.maximum(0.0, pose.position("tip")[..., 0]), tolerance=0.0)])
    assert len(y) > 20 and (y[:, 0] <= 0.0).all()


def test_a_term_that_is_nan_in_some_poses_is_an_error(arm: mobee.Model) -> None:
    with pytest.raises(InvalidValue, match="'mine' is nan"):
        built(arm, TIP, terms=[costs.term(lambda pose, contacts: np.where(pose.position("tip")[..., 0] > 0.0, np.nan, 0.0), name="mine")])


def test_motors_and_one_dimension(arm: mobee.Model) -> None:
    _, q, y = built(arm, tasks.motors({"m1": (-1.0, 1.0)}), np.array([0.25]), terms=[costs.plane("tip", (0, 1, 0), 0.2)])
    np.testing.assert_allclose(np.sort(y[:, 0]), np.linspace(-1.0, 1.0, 9), atol=0.02 * 0.25)
    np.testing.assert_array_equal(q[:, 1], y[:, 0])


def test_where_nothing_is_reached_there_is_no_vertex(arm: mobee.Model) -> None:
    _, q, y = built(arm, tasks.place("tip", "xy", [(2.0, 3.0), (2.0, 3.0)]))
    assert q.shape == (0, 3) and y.shape == (0, 2)


def test_a_coordinate_without_derivative_is_refused(arm: mobee.Model) -> None:
    with pytest.raises(InvalidValue, match=r"'mine' has no derivative.*nes"):
        built(arm, tasks.function(lambda pose: pose.q[..., 0], -1.0, 1.0, name="mine"), np.array([0.1]))


def test_progress_is_reported(arm: mobee.Model) -> None:
    reported: list[int] = []
    problem = Problem(arm, [costs.collision()], None, None)
    q, _ = lattice_poses(problem, TIP, SPACING, np.random.default_rng(0), reported.append)
    assert reported == sorted(reported) and reported[-1] <= len(q)


def test_it_resumes_where_it_was_interrupted(arm: mobee.Model) -> None:
    whole = built(arm, TIP)[1:]
    rng = np.random.default_rng(0)
    first = LatticeBuilder(Problem(arm, [costs.collision()], None, None), TIP, SPACING, rng)
    for _ in range(9):
        assert first.step()
    state, generator = first.state(), rng.bit_generator.state
    assert 0 < len(state["q"]) == first.vertices < len(whole[0]) and first.open > 0
    again = np.random.default_rng(5)
    again.bit_generator.state = generator
    second = LatticeBuilder(Problem(arm, [costs.collision()], None, None), TIP, SPACING, again)
    second.restore(state)
    while second.step():
        pass
    for one, other in zip(second.result(), whole, strict=True):
        np.testing.assert_array_equal(one, other)


def test_three_dimensions(arm: mobee.Model) -> None:
    _, q, y = built(arm, tasks.motors({name: (-1.0, 1.0) for name in ("m0", "m1", "m2")}), np.full(3, 0.5))
    np.testing.assert_array_equal(q, y)
    far = np.linalg.norm(np.random.default_rng(0).uniform(-0.75, 0.75, (50, 1, 3)) - y, axis=2).min(axis=1)
    assert far.max() <= 0.5 / np.sqrt(2.0) + 0.02


SPACINGS = {1: [0.1], 2: [0.1, 0.2], 3: [0.1, 0.2, 0.3], 4: [0.1, 0.2, 0.3, 0.4]}
NEIGHBOURS = {1: 2, 2: 6, 3: 12, 4: 8}


def lattice(dimensions: int) -> tuple[Lattice, np.ndarray, np.ndarray]:
    box = np.array([(-1.0, 2.0)] * dimensions)
    spacing = np.array(SPACINGS[dimensions])
    return Lattice(box, spacing), box, spacing


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4])
def test_neighbours_are_a_spacing_away(dimensions: int) -> None:
    points, box, spacing = lattice(dimensions)
    middle = np.zeros((1, dimensions), dtype=np.intp)
    np.testing.assert_allclose(points.y(middle)[0], box.mean(axis=1))
    beside = points.neighbours(middle)[0]
    assert len(beside) == NEIGHBOURS[dimensions]
    np.testing.assert_allclose(np.linalg.norm((points.y(np.array(beside)) - points.y(middle)) / spacing, axis=1), 1.0)


def test_no_neighbour_is_outside_the_box() -> None:
    points, box, _ = lattice(2)
    corner = points.nearest(np.array([[2.0, 2.0]]))
    beside = points.y(np.array(points.neighbours(corner)[0]))
    assert 0 < len(beside) < 6 and (beside <= box[:, 1] + 1e-9).all()


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4])
def test_the_nearest_point_is_in_the_box_and_near(dimensions: int) -> None:
    points, box, spacing = lattice(dimensions)
    y = np.random.default_rng(0).uniform(-1.3, 2.3, (200, dimensions))
    found = points.nearest(y)
    there = points.y(found)
    assert (found % 2 == 0).all() and (np.abs(there - box.mean(axis=1)) <= 1.5 + 1e-9).all()
    far = np.linalg.norm((there - np.clip(y, -1.0, 2.0)) / spacing, axis=1)
    assert far.max() <= 1.5 and np.median(far) < 1.0


@pytest.mark.parametrize("dimensions", [2, 3])
def test_intermediate_points_are_either_too_near_or_far_enough(dimensions: int) -> None:
    points, _, spacing = lattice(dimensions)
    middle = (0,) * dimensions
    halves = points.intermediate(np.array([middle]))[0]
    assert all(any(number % 2 for number in half) and half in points.too_close(middle) for half in halves)
    close = set(points.too_close(halves[0]))
    lattice_points = [point for step in points.neighbours(np.array([middle]))[0] for point in points.neighbours(np.array([step]))[0]]
    for point in lattice_points:
        far = np.linalg.norm((points.y(np.array([point])) - points.y(np.array([halves[0]]))) / spacing)
        assert (point in close) == bool(far < MIN_DISTANCE)


def test_a_box_narrower_than_the_spacing_has_its_middle() -> None:
    points = Lattice(np.array([(0.0, 0.01), (0.0, 1.0)]), np.array([0.1, 0.1]))
    y = points.y(points.nearest(np.array([[0.3, 0.52]])))
    np.testing.assert_allclose(y, [[0.005, 0.5]])
