# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import InvalidValue, UnknownName
from mobee.learning.lattice import Lattice
from tests.mobee.learning.toys import SHOULDER_ELBOW, TORSO, arm, torso, toy_robot


@pytest.mark.parametrize(
    ("space", "states", "state_actions", "widest"),
    [
        (arm((0.25, 0.75), "equidistant"), 16, 64, 4),
        (arm(neighbours="equidistant"), 81, 432, 8),
        (arm(neighbours=16), 81, 1296, 16),
        (torso(), 27, 216, 8),
        (arm((0.2, 0.4, 0.6, 0.8), "equidistant"), 256, 1536, 8),
    ],
    ids=["hypercube", "rank 3", "rank 3, 16 nearest", "torso", "rank 4"],
)
def test_sizes_are_those_of_the_thesis(space, states, state_actions, widest):
    assert (len(space), space.state_actions) == (states, state_actions)
    assert space.goals.shape == (states, widest)
    assert space.samples.shape == (states, len(space.joints))
    assert sum(len(space.actions(s)) for s in range(states)) == state_actions


def test_first_joint_is_the_fastest():
    space = arm()
    low, high = space.robot.limits[space.robot.parts["left_arm"].slice][:4].T
    assert space.samples[0] == pytest.approx(low + 0.25 * (high - low))
    assert space.samples[1 + 2 * 3 + 0 * 9 + 1 * 27] == pytest.approx(low + np.array([0.5, 0.75, 0.25, 0.5]) * (high - low))


def test_numbering_makes_the_unreachable_states_those_that_violate_the_cables_most():
    # Rank 4 states 60, 124, 188, 252 were never reached on the robot (thesis 7.3); rows in degrees, satisfied when a.q + b > 0.
    a = np.array([[1.71, -1.71, 0], [1.71, -1.71, -1.71], [-1.71, 1.71, 1.71], [0, 1, 1], [0, -1, -1]])
    b = np.array([347.0, 366.57, 112.42, 66.6, 213.3])
    worst = (np.rad2deg(arm((0.2, 0.4, 0.6, 0.8), "equidistant").samples[:, :3]) @ a.T + b).min(axis=1)
    shoulder = [44, 45, 56, 60, 61, 62]
    assert np.flatnonzero(worst <= 0).tolist() == [s + 64 * elbow for elbow in range(4) for s in shoulder]
    assert sorted(np.argsort(worst)[:4].tolist()) == [60, 124, 188, 252]


def test_action_blocks_of_the_thesis_belong_to_its_hard_states():
    blocks = arm(neighbours="equidistant")
    first = np.cumsum([0] + [len(blocks.actions(s)) for s in range(81)])
    assert [(first[s], first[s + 1] - 1) for s in (24, 51, 78)] == [(122, 125), (281, 285), (419, 422)]


def test_equidistant_goals_are_one_step_along_one_joint_in_ascending_order():
    space = arm(neighbours="equidistant")
    assert space.actions(40).tolist() == [13, 31, 37, 39, 41, 43, 49, 67]
    assert space.actions(0).tolist() == [1, 3, 9, 27]
    assert space.goal(0, 2) == 9
    assert 24 in space.actions(21) and 24 in space.actions(15) and 78 in space.actions(69) and 51 in space.actions(42)


def test_sixteen_nearest_are_nearest_and_their_ties_are_drawn():
    space = arm(neighbours=16)
    digits = np.arange(81)[:, None] // 3 ** np.arange(4) % 3
    distance = ((digits[:, None] - digits) ** 2).sum(axis=-1)
    np.fill_diagonal(distance, 99)
    for s in range(81):
        chosen = space.actions(s)
        assert np.all(np.diff(chosen) > 0)
        assert distance[s, chosen].max() <= np.delete(distance[s], chosen).min()
    in_degree = np.bincount(space.goals.ravel(), minlength=81)
    assert in_degree.min() >= 6 and in_degree.max() <= 46  # index-order ties: 4..39, over ten draws of random ties: 8..44
    assert np.array_equal(arm(neighbours=16).goals, space.goals)
    assert not np.array_equal(arm(neighbours=16, tie_seed=1).goals, space.goals)


@given(st.lists(st.floats(-3, 3), min_size=4, max_size=4))
def test_state_is_the_cell_of_the_nearest_sample(q):
    space = arm()
    ranges = np.ptp(space.robot.limits[space.robot.parts["left_arm"].slice][:4], axis=1)
    distances = (((space.samples - q) / ranges) ** 2).sum(axis=1)
    assert distances[space.state_of(q)] == pytest.approx(distances.min(), abs=1e-12)


def test_every_sample_lies_in_its_own_state_and_is_the_target_there():
    for space in (arm(), torso(), Lattice(toy_robot(), ["l_elbow", "l_shoulder_pitch"], neighbours=4)):
        for s in range(len(space)):
            assert space.state_of(space.samples[s]) == s
            assert space.state_of(space.target(s)[space.columns]) == s


def test_the_part_s_other_motors_stay_at_rest():
    low, high = toy_robot().limits[toy_robot().parts["left_arm"].slice][4]
    assert arm().target(7)[4] == pytest.approx((low + high) / 2)
    space = Lattice(toy_robot(), ["l_elbow"], levels=(0, 1), neighbours=1, rest=0.25)
    assert space.target(1)[4] == pytest.approx(low + 0.25 * (high - low))
    assert space.target(1)[3] == pytest.approx(np.deg2rad(106))


def test_a_whole_part_and_its_lattice_joints_give_the_same_state():
    space = Lattice(toy_robot(), ["l_elbow", "l_shoulder_pitch"], neighbours=4)
    assert space.state_of(space.target(5)) == space.state_of(space.samples[5]) == 5


def test_joints_are_read_in_the_lattice_s_order_and_a_pose_of_the_part_in_the_part_s():
    space = Lattice(toy_robot(), list(TORSO)[::-1], neighbours=8)
    assert [space.state_of_joints(space.samples[s]) for s in range(27)] == list(range(27))
    assert [space.state_of(space.target(s)) for s in range(27)] == list(range(27))


def test_different_spaces_have_different_settings():
    assert arm().settings == arm().settings
    assert len({repr(s.settings) for s in (arm(), arm(tie_seed=1), arm(neighbours="equidistant"), arm(side="r"), torso())}) == 5


def test_numbers_of_numpy_make_the_same_space_as_plain_ones():
    joints = ["l_elbow", "l_shoulder_yaw"]
    plain, given = (Lattice(toy_robot(), joints, neighbours=kind(4), tie_seed=kind(3)) for kind in (int, np.int64))
    assert json.dumps(given.settings) == json.dumps(plain.settings)


@pytest.mark.parametrize(
    ("joints", "options", "message"),
    [
        (["l_elbow", "r_elbow"], {}, "one lattice, and one agent, a part"),
        (["l_elbow", "l_elbow"], {}, "twice"),
        ([], {}, "list of motor names"),
        ("l_elbow", {}, "list of motor names"),
        (["l_elbow"], {"levels": (0.5,)}, "at least two ascending fractions"),
        (["l_elbow"], {"levels": (0.5, 0.25)}, "at least two ascending fractions"),
        (["l_elbow"], {"levels": (50, 75)}, "at least two ascending fractions"),
        (["l_elbow"], {"neighbours": 3}, "from 1 to 2"),
        (["l_elbow"], {"neighbours": "nearest"}, "equidistant"),
        (["l_elbow"], {"neighbours": 2, "rest": 50}, "fraction"),
        (["l_elbow"], {"rest": "middle"}, "rest is 'middle'"),
        (["l_elbow"], {"levels": "many"}, "levels is 'many'"),
        (["l_elbow"], {"tie_seed": -1}, "seed -1"),
        (["l_elbow"], {"tie_seed": 1.5}, "seed 1.5"),
        ([f"l_{n}" for n in ("shoulder_pitch", "elbow", "wrist_prosup")], {"levels": np.linspace(0, 1, 50)}, "the limit is 100000"),
    ],
)
def test_a_space_that_cannot_be_is_refused_with_what_is_valid(joints, options, message):
    with pytest.raises(InvalidValue, match=message):
        Lattice(toy_robot(), joints, **options)


def test_a_small_space_has_all_other_states_as_neighbours_by_default():
    small = Lattice(toy_robot(), ["l_elbow", "l_shoulder_pitch"])
    assert (small.neighbours, small.settings["neighbours"], small.goals.shape) == (8, 8, (9, 8))
    assert Lattice(toy_robot(), ["l_elbow", "l_shoulder_pitch"], np.linspace(0, 1, 5)).neighbours == 16
    with pytest.raises(InvalidValue, match="from 1 to 8"):
        Lattice(toy_robot(), ["l_elbow", "l_shoulder_pitch"], neighbours=16)


def test_an_unknown_motor_is_refused_with_the_nearest_name():
    with pytest.raises(UnknownName, match="Did you mean 'l_elbow'"):
        Lattice(toy_robot(), ["l_elbo"])


@pytest.mark.parametrize("q", [np.zeros(3), np.zeros((1, 4)), [0, 0, 0, np.nan]])
def test_a_q_of_the_wrong_shape_or_not_finite_is_refused(q):
    with pytest.raises(InvalidValue, match="l_shoulder_pitch|not finite"):
        arm().state_of(q)


def test_states_and_actions_beyond_the_space_are_refused():
    for call in (lambda: arm().actions(81), lambda: arm().target(-1), lambda: arm().goal(0, 16)):
        with pytest.raises(InvalidValue, match="valid are 0 to"):
            call()


def test_each_joint_may_have_levels_of_its_own():
    joints = ["l_shoulder_pitch", "l_elbow"]
    each = [(0.1, 0.9), (0.2, 0.5, 0.8)]
    space = Lattice(toy_robot(), joints, each, neighbours="equidistant")
    low, high = space.robot.limits[[space.robot.motor_index(name) for name in joints]].T
    expected = [(pitch, elbow) for elbow in each[1] for pitch in each[0]]  # pitch fastest
    assert space.samples == pytest.approx(low + np.array(expected) * (high - low))
    assert space.actions(2).tolist() == [0, 3, 4]
    assert [space.state_of(q) for q in space.samples] == list(range(6))
    by_name = Lattice(toy_robot(), joints, dict(zip(joints[::-1], each[::-1], strict=True)), neighbours="equidistant")
    assert by_name.settings == space.settings
    assert space.settings["levels"] == [list(one) for one in each]


@given(st.lists(st.sets(st.integers(0, 20), min_size=2, max_size=4), min_size=1, max_size=4), st.integers(0, 9))
def test_samples_lie_in_their_own_states_and_goals_are_the_nearest_others_for_any_levels(levels, tie_seed):
    joints = [f"l_{name}" for name in SHOULDER_ELBOW][: len(levels)]
    fractions = [sorted(n / 20 for n in one) for one in levels]
    space = Lattice(toy_robot(), joints, fractions, tie_seed=tie_seed)
    assert [space.state_of(q) for q in space.samples] == list(range(len(space)))
    low, high = space.robot.limits[[space.robot.motor_index(name) for name in joints]].T
    points = (space.samples - low) / (high - low)
    for s, goals in enumerate(space.goals):
        assert s not in goals and (np.diff(goals) > 0).all()
        distance = np.linalg.norm(points - points[s], axis=1)
        assert distance[goals].max() <= np.delete(distance, [s, *goals]).min(initial=np.inf) + 1e-6


def test_the_same_levels_for_each_joint_are_those_for_all():
    assert arm([(0.25, 0.5, 0.75)] * 4).settings == arm().settings
    assert arm().settings["levels"] == [0.25, 0.5, 0.75]


@pytest.mark.parametrize(
    ("levels", "error", "message"),
    [
        ({"l_elbow": (0.2, 0.8)}, InvalidValue, "levels of l_shoulder_pitch are missing"),
        ({"l_elbow": (0.2, 0.8), "l_elbo": (0.2, 0.8)}, UnknownName, "Did you mean 'l_elbow'"),
        ([(0.2, 0.8)] * 3, InvalidValue, "levels of 3 joints given"),
        ([(0.2, 0.8), 0.5], InvalidValue, "at least two ascending fractions"),
    ],
)
def test_levels_that_do_not_fit_the_joints_are_refused(levels, error, message):
    with pytest.raises(error, match=message):
        Lattice(toy_robot(), ["l_shoulder_pitch", "l_elbow"], levels)
