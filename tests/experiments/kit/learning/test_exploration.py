# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.learning.arm import table_agents, table_plant
from experiments.kit.learning.exploration import explore_together


@pytest.fixture(scope="module")
def explored():
    plant = table_plant(0)
    agents = table_agents(plant, "random")
    return agents, explore_together(agents, plant, 6)


def test_every_agent_makes_that_many_transitions_and_the_faster_ones_continue(explored):
    agents, logs = explored
    counts = {part: len(log.seen) for part, log in logs.items()}
    assert min(counts.values()) == 6
    assert counts == {agent.part: agent.transitions for agent in agents}


def test_a_transition_begins_where_the_last_one_ended(explored):
    for log in explored[1].values():
        seen = np.array(log.seen)
        assert (seen[1:, 0] == seen[:-1, 2]).all()
        assert (np.diff(log.ends) > 0.0).all()


def test_arrays_hold_as_many_of_each(explored):
    arrays = explored[1]["torso"].arrays("torso", 4)
    assert {name: len(array) for name, array in arrays.items()} == dict.fromkeys(
        ("seen_torso", "settled_torso", "durations_torso", "ends_torso"), 4
    )
