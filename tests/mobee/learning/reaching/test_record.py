# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from mobee.errors import MobeeError, UnknownName
from mobee.learning.agent import CuriousAgent
from mobee.learning.reaching.predictors import PREDICTORS
from mobee.learning.reaching.record import load_reaches
from mobee.learning.reaching.store import ReachStore
from mobee.learning.transitions import TransitionModel
from mobee.store import TransitionStore
from tests.mobee.learning.reaching.toy import HANDS, PLACES, SPACE, TARGETS, agent, plant

PART = SPACE.part


@pytest.mark.parametrize("predictor", PREDICTORS)
def test_a_learner_is_made_again_from_its_record(tmp_path, predictor):
    path = tmp_path / "run.sqlite"
    with ReachStore(path, PART) as store:
        learner = agent(store=store, predictor=predictor, failures="local", strategy="random")
        learner.learn(TARGETS, 12)
    loaded = load_reaches(path, plant(), hands=HANDS)
    assert loaded.predictor.mean(PLACES[7]).tolist() == learner.predictor.mean(PLACES[7]).tolist()
    assert loaded.failures.rewards(PLACES[7]).tolist() == learner.failures.rewards(PLACES[7]).tolist()
    assert loaded.problems.tries == learner.problems.tries
    assert [loaded.plan(target, 3) for target in TARGETS] == [learner.plan(target, 3) for target in TARGETS]
    loaded.try_problem(TARGETS[0])
    with ReachStore(path, PART, read_only=True) as store:
        assert len(store.load()) == learner.steps


def test_it_believes_what_the_part_learned_in_the_same_run(tmp_path):
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, PART) as store:
        curious = CuriousAgent(SPACE, plant(), store=store)
        curious.run(50)
    with ReachStore(path, PART) as store:
        agent(store=store).learn(TARGETS, 2)
    loaded = load_reaches(path, plant(), PART, hands=HANDS)
    assert loaded.planning.probabilities[:81, :16].tolist() == curious.model.debiased().probabilities.tolist()


def test_what_was_learned_of_the_model_at_the_same_time_is_made_again_too(tmp_path):
    path = tmp_path / "run.sqlite"
    model = TransitionModel(SPACE)
    with ReachStore(path, PART) as store:
        agent(store=store, model=model, strategy="random").learn(TARGETS, 20)
    loaded = load_reaches(path, plant(), hands=HANDS)
    assert loaded.model.counts.tolist() == model.counts.tolist() and model.tries.sum() > 10


def test_the_part_must_be_named_if_there_are_several(tmp_path):
    path = tmp_path / "run.sqlite"
    for part in ("left_arm", "right_arm"):
        with ReachStore(path, part) as store:
            agent(store=store).learn(TARGETS, 2)
    with pytest.raises(MobeeError, match="name one of left_arm, right_arm"):
        load_reaches(path, plant(), hands=HANDS)
    with pytest.raises(UnknownName, match="torso.*left_arm, right_arm"):
        load_reaches(path, plant(), "torso", hands=HANDS)
    assert load_reaches(path, plant(), "left_arm", hands=HANDS).tries == 2


def test_absent_files_and_parts_are_reported(tmp_path):
    with pytest.raises(MobeeError, match="no such file"):
        load_reaches(tmp_path / "none.sqlite", plant())
    with TransitionStore(tmp_path / "run.sqlite", PART) as store:
        CuriousAgent(SPACE, plant(), store=store).run(1)
    with pytest.raises(MobeeError, match="no agent has learned to reach in this run yet"):
        load_reaches(tmp_path / "run.sqlite", plant())


def test_a_learner_that_has_done_nothing_yet_has_nothing_to_load(tmp_path):
    with ReachStore(tmp_path / "run.sqlite", PART) as store:
        agent(store=store)
    with pytest.raises(MobeeError, match="no agent has learned to reach"):
        load_reaches(tmp_path / "run.sqlite", plant(), hands=HANDS)


def test_a_predictor_of_ones_own_has_to_be_given(tmp_path):
    class Own(type(PREDICTORS["weighted"](agent().reaches))):
        settings = {"name": "own"}

    with ReachStore(tmp_path / "run.sqlite", PART) as store:
        agent(store=store, predictor=Own(agent().reaches)).learn(TARGETS, 1)
    with pytest.raises(UnknownName, match="predictor on record 'own'"):
        load_reaches(tmp_path / "run.sqlite", plant(), hands=HANDS)
