# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.reach import TARGET
from tests.mobee.learning.reaching.toy import BLOCKED, PLACES, SPACE, TARGETS, plant, world


def test_a_reach_ends_where_the_table_says_and_the_part_where_it_was():
    table = plant(noise=0.0, start=7)
    table.present(TARGETS[4])
    outcome = table.reach(SPACE.part, "hand")
    assert outcome.missing == world(PLACES[4])[0][7]
    assert table.state == 7 == SPACE.state_of(outcome.after.q[SPACE.columns])


def test_noise_follows_from_the_seed_and_the_number_of_the_action():
    def missing(seed, actions):
        table = plant(seed)
        table.actions = actions
        table.present(TARGETS[4])
        return [table.reach(SPACE.part, "hand").missing for _ in range(3)]

    assert missing(1, 0) == missing(1, 0)
    assert missing(1, 0)[1:] == missing(1, 1)[:2]
    assert missing(1, 0) != missing(2, 0)


def test_the_target_blocks_the_share_of_tries_that_the_table_says():
    state, action = np.argwhere(BLOCKED[0])[0]
    table = plant()
    table.present(TARGETS[0])
    target, stayed = SPACE.target(SPACE.goal(state, action)), 0
    for _ in range(1000):
        table.state = int(state)
        outcome = table.act(SPACE.part, target)
        stayed += table.state == state
        assert outcome.touched == ((TARGET,) if table.state == state else ())
    assert stayed == pytest.approx(900, abs=30)
    table.present(None)
    table.state = int(state)
    table.act(SPACE.part, target)
    assert table.state == SPACE.goal(state, action)


def test_a_reach_without_a_presented_target_is_refused():
    with pytest.raises(InvalidValue, match="present a target"):
        plant().reach(SPACE.part, "hand")
