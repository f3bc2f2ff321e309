# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import mobee
from experiments.kit.reaching.arm import MARKER, reach_space
from experiments.kit.reaching.truth import Known, Truth, _Measuring, load_truth, oracle, truth_of
from mobee import TransitionModel
from mobee.plant import Outcome
from mobee.reach import ReachOutcome, ReachTarget

PLACE = np.array([-0.2, 0.2, 0.2])


class ExactPlant:
    """The arm is where it is sent, but no transition ends in a closed state while the target is there; reaches miss by the state."""

    def __init__(self, space, closed=()):
        self.space, self.closed, self.robot = space, closed, space.robot
        self.state, self.target = 0, None

    def measure(self, part):
        return self.space.target(self.state)

    def act(self, part, pose):
        wanted = self.space.state_of(pose)
        if self.target is None or wanted not in self.closed:
            self.state = wanted
        return Outcome(self.space.target(self.state), True, 1.0)

    def present(self, target):
        self.target = target

    def reach(self, part, marker, stay=False):
        after = Outcome(self.space.target(self.state), True, 1.0)
        return ReachOutcome(np.zeros(3), after.q, 0.01 * self.state, True, 2.0, (), after)


@pytest.fixture(scope="module")
def space():
    return reach_space()


def test_everything_is_tried_as_often_as_asked_and_blocked_transitions_are_found(space):
    closed = (40, 41)
    tried = _Measuring(space, ExactPlant(space, closed), ReachTarget(PLACE), 3, seed=0).run()
    exists = space.goals >= 0
    assert (tried.made == 3 * exists).all()
    assert ((tried.failed > 0) == np.isin(space.goals, closed) & exists).all() and tried.failed.max() == 3
    assert tried.missing == pytest.approx(np.repeat(0.01 * np.arange(81.0)[:, None], 3, axis=1))


def test_a_state_that_is_never_come_to_stays_unknown(space):
    plant = ExactPlant(space)
    act = plant.act
    plant.act = lambda part, pose: Outcome(space.target(plant.state), True, 1.0) if space.state_of(pose) == 7 else act(part, pose)
    tried = _Measuring(space, plant, ReachTarget(PLACE), 1, seed=1).run()
    assert np.isnan(tried.missing[7]).all() and not tried.made[7].any()
    assert np.isfinite(np.delete(tried.missing, 7, axis=0)).all()


def test_truth_is_read_as_it_was_written_and_rewards_are_means_over_tries(tmp_path, space):
    missing = np.full((81, 2), np.nan)
    missing[0], missing[1] = (0.0, 0.01), (0.09, np.nan)
    counts = {"made": np.full(space.goals.shape, 2), "failed": np.ones(space.goals.shape, dtype=int)}
    truth = truth_of({tuple(PLACE): {"missing": missing, **counts}})
    truth.save(tmp_path / "truth.npz")
    again = load_truth(tmp_path / "truth.npz")
    assert again.rewards(0.01)[0, :3] == pytest.approx([0.75, 0.1, 0.0])
    assert (again.blocked == 0.5).all() and again.places.tolist() == [PLACE.tolist()]


def test_the_oracle_avoids_blocked_transitions_on_the_path_to_the_best_reach(space):
    missing = np.full((1, 81, 1), 1.0)
    missing[0, 80] = 0.0
    plant, blocked = ExactPlant(space, closed=(77,)), np.where(np.isin(space.goals, (77,)), 1.0, 0.0)[None]
    plant.reach = lambda part, marker: ReachOutcome(
        np.zeros(3),
        space.target(plant.state),
        float(missing[0, plant.state, 0]),
        True,
        2.0,
        (),
        Outcome(space.target(plant.state), True, 1.0),
    )
    beliefs = TransitionModel(space).debiased()
    knowing = oracle(Truth(PLACE[None], missing, blocked), space, plant, beliefs, MARKER, 0.01, seed=3)
    found = knowing.evaluate([ReachTarget(PLACE)], 5)
    assert (found.states == 80).all() and found.scores == pytest.approx(np.ones(5)) and not found.failures.any()


def test_the_oracle_knows_nothing_of_other_targets():
    known = Known(SimpleNamespace(places=PLACE[None], rewards=lambda scale: np.ones((1, 81))), 0.01)
    assert known.mean(PLACE.copy()).shape == (81,)
    with pytest.raises(mobee.InvalidValue, match="was not measured"):
        known.mean(PLACE + 0.1)
