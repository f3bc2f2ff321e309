# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import sqlite3

import numpy as np
import pytest

from mobee.errors import InvalidValue, MobeeError, UnknownName
from mobee.learning.agent import CuriousAgent
from mobee.learning.discrete import DiscreteSpace
from mobee.learning.lattice import Lattice
from mobee.learning.record import load_learned, space_from
from mobee.learning.space import Space, Voronoi
from mobee.store import Transition, TransitionStore
from tests.mobee.learning.toys import FickleDice, arm, torso, toy_robot

ROBOT = toy_robot()


TWO = ["l_shoulder_pitch", "l_elbow"]


SPACES = {
    "lattice": arm(tie_seed=3),
    "equidistant": arm(neighbours="equidistant"),
    "levels of their own": Lattice(ROBOT, TWO, [(0.1, 0.9), (0.2, 0.5, 0.8)], 3, rest=0.2),
    "drawn": Voronoi(ROBOT, TWO, 40, seed=5, neighbours=3),
    "given": Voronoi(ROBOT, TWO, np.deg2rad([[-60, 30], [-50, 40], [-30, 90]])),
    "one's own": Space(ROBOT, ["l_elbow"], [[0.5], [0.7]], [[1], [0]]),
}


@pytest.mark.parametrize("name", SPACES)
def test_a_space_comes_back_from_its_record(name):
    space = SPACES[name]
    again = space_from(json.loads(json.dumps(space.settings)), ROBOT)
    assert type(again) is type(space)
    assert again.settings == space.settings
    assert np.array_equal(again.goals, space.goals)
    assert again.samples == pytest.approx(space.samples)
    assert np.array_equal(again.target(1), space.target(1))


def test_a_record_of_before_there_were_kinds_is_a_lattice():
    assert "kind" not in torso().settings
    assert isinstance(space_from(torso().settings, ROBOT), Lattice)


def test_a_record_that_gives_another_space_now_is_refused():
    with pytest.raises(MobeeError, match="digest .*, on record 0123"):
        space_from(torso().settings | {"digest": "0123"}, ROBOT)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "not of a space"),
        ([], "not the record of a space"),
        (torso().settings | {"kind": "circle"}, "kind 'circle'"),
        (DiscreteSpace(3, 2).settings, "DiscreteSpace"),
        (torso().settings | {"robot": "katana"}, "of robot 'katana'"),
    ],
)
def test_a_record_of_something_else_is_refused(settings, message):
    with pytest.raises(InvalidValue, match=message):
        space_from(settings, ROBOT)


OPTIONS = {"initial": "60-40", "divergence": "kl", "forgetting": 0.9}


@pytest.fixture
def run(tmp_path):
    """The file of two agents, and the agents."""
    path = tmp_path / "transitions.sqlite"
    agents = [
        CuriousAgent(space, FickleDice(toy_robot(), seed=2), store=TransitionStore(path, space.part), **options)
        for space, options in ((torso(), {}), (arm(), OPTIONS))
    ]
    for agent in agents:
        agent.run(40)
    return path, agents


def test_the_model_is_the_agent_s(run):
    path, agents = run
    for agent in agents:
        learned = load_learned(path, agent.part, toy_robot())
        assert np.array_equal(learned.model.probabilities, agent.model.probabilities)
        assert np.array_equal(learned.model.reward, agent.model.reward)
        assert (learned.part, learned.transitions, learned.state) == (agent.part, 40, agent.state)
        assert learned.space.settings == agent.space.settings


def test_a_record_of_before_there_were_other_settings_is_read(run):
    path, agents = run
    with sqlite3.connect(path) as database:
        database.execute("DELETE FROM meta WHERE key NOT IN ('space', 'explorer', 'seed', 'discount', 'initial')")
    learned = load_learned(path, "torso", toy_robot())
    assert np.array_equal(learned.model.reward, agents[0].model.reward)


def test_a_record_that_cannot_be_rebuilt_is_refused(run, tmp_path):
    path, _ = run
    with pytest.raises(MobeeError, match="several agents: name one of left_arm, torso"):
        load_learned(path, robot=toy_robot())
    with pytest.raises(UnknownName, match="Did you mean 'torso'"):
        load_learned(path, "tors", toy_robot())
    with pytest.raises(MobeeError, match="'toy'"):
        load_learned(path, "torso")
    with pytest.raises(MobeeError, match="there is no such file"):
        load_learned(tmp_path / "other.sqlite")
    assert not (tmp_path / "other.sqlite").exists()


def test_a_store_without_a_recorded_space_is_refused(tmp_path):
    with TransitionStore(tmp_path / "own.sqlite", "torso") as store:
        store.bind({"mine": json.dumps(1)})
        store.append(Transition(1, 0, 0, 1, 0.1, True, 1.0, (0.0,)))
    with pytest.raises(MobeeError, match="torso has no space on record"):
        load_learned(tmp_path / "own.sqlite")
