# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue
from mobee.roadmap.ik import costs
from mobee.roadmap.ik.problem import Problem, needed
from mobee.roadmap.ik.solve import Descent, aim_reals, least_squares
from mobee.roadmap.ik.terms import level

PALMS = "left_palm", "right_palm"
CLOSED = (
    "position",
    "point",
    "normal",
    "rotation",
    "hold",
    "gaze",
    "fingers",
    "relative position",
    "relative orientation",
    "aligned",
    "plane",
)


def tight(term):
    return dataclasses.replace(term, tolerance=1e-9)


def terms_at(model: mobee.Model, q: np.ndarray) -> dict[str, object]:
    """Terms that are met at q."""
    pose = model.evaluate(q)
    eyes, ahead = pose.position("head"), pose.normal("head")
    left, right = (pose.position(name) for name in PALMS)
    return {
        "position": costs.position(PALMS[1], right),
        "point": costs.position(PALMS[1], right + pose.rotation(PALMS[1]) @ (0.1, 0.0, -0.2), offset=(0.1, 0.0, -0.2)),
        "normal": costs.orientation(PALMS[1], pose.normal(PALMS[1])),
        "rotation": costs.orientation(PALMS[0], pose.rotation(PALMS[0])),
        "hold": costs.hold(*PALMS, float(np.linalg.norm(left - right))),
        "gaze": costs.gaze(eyes + 0.3 * ahead),
        "fingers": costs.orientation(PALMS[1], pose.rotation(PALMS[1])[:, 0], direction=(1.0, 0.0, 0.0)),
        "relative position": costs.relative_position(PALMS[1], PALMS[0], pose.rotation(PALMS[0]).T @ (right - left)),
        "relative orientation": costs.relative_orientation(*PALMS, pose.rotation(PALMS[1]).T @ pose.rotation(PALMS[0])),
        "plane": costs.plane(PALMS[1], [0.0, 0.6, 0.8], float(right @ [0.0, 0.6, 0.8])),
        "aligned": costs.aligned(*PALMS, (1.0, 2.0, 0.5), pose.rotation(PALMS[1]).T @ pose.rotation(PALMS[0]) @ (1.0, 2.0, 0.5)),
    }


@pytest.mark.parametrize("name", [*CLOSED])
def test_near_a_solution_it_converges_at_once(free: mobee.Model, icub: mobee.Robot, name: str) -> None:
    """The slopes are right: with a wrong one the last digits take many steps."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        goal = icub.limits.mean(axis=1) + 0.25 * rng.uniform(-1.0, 1.0, len(icub.motors)) * (icub.limits[:, 1] - icub.limits[:, 0])
        start = goal + 0.05 * rng.standard_normal(len(goal))
        term = tight(terms_at(free, goal)[name])
        problem = Problem(free, [term], start, None)
        met = Descent(problem).run(problem.start[None])
        assert len(met) == 1 and problem.evaluations <= 10
        assert term.residual(free.evaluate(met))[0] <= 1e-9


def test_gaze_at_a_moving_marker_and_palms_that_face_each_other_converge(free: mobee.Model, icub: mobee.Robot) -> None:
    for term in (costs.gaze("left_palm"), costs.palm_to_palm()):
        problem = Problem(free, [tight(term)], None, None)
        met = Descent(problem).run(problem.start[None])
        assert len(met) == 1 and problem.evaluations <= 25
        assert term.residual(free.evaluate(met))[0] <= 1e-9


def test_all_terms_at_once(free: mobee.Model, icub: mobee.Robot) -> None:
    terms = terms_at(free, icub.limits.mean(axis=1))
    problem = Problem(free, list(terms.values()), None, None)
    found = least_squares(problem, np.random.default_rng(0))
    assert found is not None
    pose = free.evaluate(found[None])
    assert all(one.residual(pose)[0] <= one.tolerance for one in terms.values())


def test_only_the_free_motors_move_and_all_stay_within_their_limits(free: mobee.Model, icub: mobee.Robot, postures: np.ndarray) -> None:
    goal = free.evaluate(icub.limits[:, 1]).position("right_palm")  # in a corner of the box
    problem = Problem(free, [costs.position("right_palm", goal)], None, ["torso", "r_elbow"])
    starts = problem.whole(np.random.default_rng(0).uniform(*problem.limits.T, (20, 4)))
    ends, missing = Descent(problem).ends(starts)
    held = np.setdiff1d(np.arange(len(icub.motors)), problem.free)
    np.testing.assert_allclose(missing[:, 0], np.linalg.norm(free.evaluate(ends).position("right_palm") - goal, axis=1), atol=1e-12)
    np.testing.assert_array_equal(ends[:, held], starts[:, held])
    assert (ends >= icub.limits[:, 0]).all() and (ends <= icub.limits[:, 1]).all()


def test_a_search_for_impossible_costs_ends_soon(free: mobee.Model) -> None:
    problem = Problem(free, [costs.position("right_palm", [2.0, 0.0, 0.0])], None, None)
    assert least_squares(problem, np.random.default_rng(0)) is None
    assert problem.evaluations <= 41 * 61


def test_a_half_turn_is_no_trap(free: mobee.Model, icub: mobee.Robot) -> None:
    normal = free.evaluate(icub.home).normal("right_palm")
    problem = Problem(free, [costs.orientation("right_palm", -normal)], None, None)
    assert least_squares(problem, np.random.default_rng(0)) is not None


def test_at_most_draws_from_beyond_alone(free: mobee.Model, icub: mobee.Robot) -> None:
    height = float(free.evaluate(icub.home).position("right_elbow")[2])
    for most, looked in ((height - 0.05, 10), (height + 0.05, 1)):
        term = costs.at_most("right_elbow", [0, 0, 1], most, tolerance=1e-9)
        problem = Problem(free, [term], None, None)
        met = Descent(problem).run(problem.start[None])
        assert len(met) == 1 and problem.evaluations <= looked
        assert term.residual(free.evaluate(met))[0] <= 1e-9


def test_other_aims_may_differ_from_start_to_start(free: mobee.Model, icub: mobee.Robot) -> None:
    problem = Problem(free, [costs.orientation("right_palm", [0, 0, -1])], None, ["torso", "right_arm"])
    goals, x = [-0.3, -0.25], np.array([1.0, 0.0, 0.0])
    besides = [[(level(icub.marker("right_palm"), x, goal), 1e-4)] for goal in goals]
    met = Descent(problem, besides[0]).run(np.repeat(problem.start[None], 2, axis=0), np.stack([aim_reals(one) for one in besides]))
    np.testing.assert_allclose(free.evaluate(met).position("right_palm")[:, 0], goals, rtol=0.0, atol=1e-4)


def test_without_aims_there_is_nothing_to_do(free: mobee.Model) -> None:
    problem = Problem(free, [costs.collision()], None, None)
    assert least_squares(problem, np.random.default_rng(0)) is None
    assert problem.evaluations == 0


def test_motors_that_move_no_aim_stay(free: mobee.Model, icub: mobee.Robot) -> None:
    """Nothing would ever move a finger back from where a restart put it."""
    place = free.evaluate(icub.limits.mean(axis=1)).position("right_palm")
    terms = [costs.position("right_palm", place), costs.orientation("right_palm", [0.0, 1.0, 0.0])]
    problem = Problem(free, terms, None, ["torso", "right_arm", "l_elbow"])
    moved = needed(problem, [aim for one in problem.terms if one.aims for aim in one.aims(icub)])
    names = {icub.motors[k] for k in problem.free[moved]}
    assert names == {*icub.parts["torso"].motors, *icub.parts["right_arm"].motors[:7]}
    hard = [*terms, costs.term(lambda pose, contacts: np.abs(pose.q[..., 0] - 0.5), tolerance=0.2)]
    problem = Problem(free, hard, None, ["torso", "right_arm"])
    found = least_squares(problem, np.random.default_rng(0))
    assert found is not None and 0.3 <= found[0] <= 0.7  # which only restarts lead to
    fingers = [icub.motor_index(name) for name in icub.parts["right_arm"].motors[7:]]
    np.testing.assert_array_equal(found[fingers], icub.home[fingers])


def test_motors_that_affect_a_plain_function_are_drawn(free: mobee.Model, icub: mobee.Robot) -> None:
    finger = icub.motor_index("r_pinky")
    bent = costs.term(lambda pose, contacts: np.abs(pose.q[..., finger] - 1.0), tolerance=0.3)
    soft = costs.term(lambda pose, contacts: pose.q[..., icub.motor_index("l_pinky")] ** 2, tolerance=None)
    problem = Problem(free, [costs.position("right_palm", [-0.3, 0.1, 0.1]), bent, soft], None, None)
    drawn = Descent(problem).drawn
    assert drawn[finger] and not drawn[icub.motor_index("l_pinky")] and not drawn[icub.motor_index("r_thumb_oppose")]
    found = least_squares(problem, np.random.default_rng(0))
    assert found is not None and abs(found[finger] - 1.0) <= 0.3


def test_any_number_of_threads_leads_to_the_same_ends(free: mobee.Model, icub: mobee.Robot) -> None:
    rng, (low, high) = np.random.default_rng(2), icub.limits.T
    terms = list(terms_at(free, rng.uniform(low, high)).values())
    starts, found = rng.uniform(low, high, (30, len(low))), []
    for threads in (1, 2, 7, 100):
        problem = Problem(free, terms, None, None)
        ends, missing = Descent(problem, threads=threads).ends(starts)
        found.append((ends.tobytes(), missing.tobytes(), problem.evaluations))
    alone = [Descent(Problem(free, terms, None, None)).ends(start[None])[0] for start in starts]
    assert len(set(found)) == 1 and np.concatenate(alone).tobytes() == found[0][0]
    with pytest.raises(InvalidValue, match="whole number from 1"):
        Descent(Problem(free, terms, None, None), threads=0)


def test_no_start_is_no_trouble(free: mobee.Model) -> None:
    problem = Problem(free, [costs.position("right_palm", [0.2, 0.0, 0.0])], None, None)
    ends, missing = Descent(problem, threads=2).ends(problem.start[None][:0])
    assert ends.shape == (0, len(problem.start)) and missing.shape == (0, 1)


def test_starts_and_goals_of_other_shapes_are_refused(free: mobee.Model, icub: mobee.Robot) -> None:
    problem = Problem(free, [costs.position("right_palm", [0.2, 0.0, 0.0])], None, None)
    start = problem.start
    goals = aim_reals([(level(icub.marker("right_palm"), np.array([1.0, 0.0, 0.0]), 0.1), 1e-4)])
    for q, given in (
        (start, None),
        (start[None, :-1], None),
        (np.stack([start] * 3), goals[None].repeat(2, axis=0)),
        (start[None], goals[None]),
    ):
        with pytest.raises(InvalidValue, match="starts of shape"):
            Descent(problem).ends(q, given)


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": 8},
        {"kind": -1},
        {"first_link": 10**6},
        {"second_link": -1},
        {"motor": 41},
        {"first_point": np.zeros(2)},
        {"length": np.nan},
    ],
)
def test_aims_at_links_or_motors_that_do_not_exist_are_refused(free: mobee.Model, icub: mobee.Robot, wrong: dict[str, object]) -> None:
    aim = dataclasses.replace(level(icub.marker("right_palm"), np.array([1.0, 0.0, 0.0]), 0.1), **wrong)
    term = dataclasses.replace(costs.position("right_palm", [0.2, 0.0, 0.0]), aims=lambda robot: (aim,))
    with pytest.raises(InvalidValue, match="an aim"):
        Descent(Problem(free, [term], None, None))
