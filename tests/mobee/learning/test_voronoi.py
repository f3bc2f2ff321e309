# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.learning.agent import CuriousAgent
from mobee.learning.space import Voronoi
from tests.mobee.learning.toys import SHOULDER_ELBOW, InstantPlant, toy_robot

JOINTS = [f"l_{name}" for name in SHOULDER_ELBOW]
drawn = st.builds(
    lambda joints, samples, seed, tie_seed: Voronoi(toy_robot(), JOINTS[:joints], samples, seed, min(5, samples - 1), tie_seed),
    st.integers(1, 4),
    st.integers(2, 60),
    st.integers(0, 99),
    st.integers(0, 9),
)


def fractions(space, poses):
    low, high = space.robot.limits[space.robot.parts["left_arm"].slice][: len(space.joints)].T
    return (poses - low) / (high - low)


@settings(max_examples=50)
@given(drawn)
def test_every_sample_lies_in_its_own_state_and_within_the_limits(space):
    assert [space.state_of(q) for q in space.samples] == list(range(len(space)))
    inside = fractions(space, space.samples)
    assert (inside >= 0).all() and (inside <= 1).all()


@settings(max_examples=50)
@given(drawn)
def test_goals_are_the_nearest_other_states_in_ascending_order(space):
    points = fractions(space, space.samples)
    for s, goals in enumerate(space.goals):
        assert s not in goals
        assert (np.diff(goals) > 0).all()
        distance = np.linalg.norm(points - points[s], axis=1)
        assert distance[goals].max() <= np.delete(distance, [s, *goals]).min(initial=np.inf) + 1e-9


@settings(max_examples=50)
@given(drawn, st.lists(st.floats(-3, 3), min_size=4, max_size=4))
def test_a_state_is_the_cell_of_the_nearest_sample(space, q):
    given = np.array(q[: len(space.joints)])
    distance = np.linalg.norm(fractions(space, space.samples) - fractions(space, given), axis=1)
    assert distance[space.state_of(given)] == pytest.approx(distance.min(), abs=1e-12)


def test_a_seed_gives_the_same_space_and_another_seed_another():
    assert Voronoi(toy_robot(), JOINTS, 50, seed=3).settings == Voronoi(toy_robot(), JOINTS, 50, seed=3).settings
    assert len({Voronoi(toy_robot(), JOINTS, 50, seed=seed).settings["digest"] for seed in range(5)}) == 5


def test_samples_may_be_given_and_ties_among_them_are_drawn_by_their_seed():
    rows, columns = np.deg2rad([-60, -40, -20]), np.deg2rad([30, 50, 70, 90, 110])
    grid = np.stack(np.meshgrid(rows, columns), axis=-1).reshape(-1, 2)
    spaces = [Voronoi(toy_robot(), JOINTS[:2], grid, neighbours=1, tie_seed=seed) for seed in (0, 0, 1)]
    assert np.array_equal(spaces[0].samples, grid)
    assert np.array_equal(spaces[0].goals, spaces[1].goals)
    assert not np.array_equal(spaces[0].goals, spaces[2].goals)


def test_five_thousand_states_need_memory_in_proportion():
    Voronoi(toy_robot(), JOINTS, 20)  # what SciPy takes once
    tracemalloc.start()
    space = Voronoi(toy_robot(), JOINTS, 5000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert space.state_actions == 5000 * 16
    assert peak < 20e6  # one matrix of distances would be 200 MB


def test_a_curious_agent_learns_on_random_samples():
    space = Voronoi(toy_robot(), JOINTS, 30, neighbours=4)
    agent = CuriousAgent(space, InstantPlant(space.robot))
    agent.run(150)
    assert (agent.model.tries > 0).mean() > 0.9  # 3 on average; a sample on the rim may be the neighbour of few, or none


@pytest.mark.parametrize(
    ("samples", "options", "message"),
    [
        (1, {}, "2 to 100000"),
        (True, {}, "2 to 100000"),
        (100_001, {}, "2 to 100000"),
        ([[0.1, 0.2]], {}, "shape"),
        ([[-0.1, 0.2], [-0.1, 0.2]], {}, "same pose"),
        ([[-0.1, 0.2], [-0.1, 99]], {}, "sample 1 has l_shoulder_roll at 99"),
        ([[-0.1, 0.2], [-0.1, np.nan]], {}, "sample 1 has l_shoulder_roll at nan"),
        (20, {"neighbours": 20}, "from 1 to 19"),
        (20, {"neighbours": "equidistant"}, "from 1 to 19"),
        (20, {"seed": -1}, "seed -1"),
        (20, {"tie_seed": 1.5}, "seed 1.5"),
    ],
)
def test_samples_that_make_no_space_are_refused_with_what_is_valid(samples, options, message):
    with pytest.raises(InvalidValue, match=message):
        Voronoi(toy_robot(), JOINTS[:2], samples, **options)
