from __future__ import annotations

import numpy as np
import pytest

from experiments.reaching.peer_belief import NEAR
from experiments.reaching.peer_memory import PeerMemory
from mobee.reach import ReachTarget

SPAN = np.array([1.0, 2.0])
HERE, ELSEWHERE = (ReachTarget(np.array(place)) for place in ([-0.3, 0.2, 0.2], [-0.2, 0.4, 0.2]))


def poses(memory, target):
    return [each.tolist() for each in memory.of(target)]


def test_what_the_target_blocked_counts_for_it_alone():
    memory = PeerMemory(SPAN)
    memory.blocked(np.array([0.02, 0.0]), np.zeros(2), HERE, touched=True)
    memory.blocked(np.array([0.04, 0.0]), np.zeros(2), HERE, touched=False)
    assert poses(memory, HERE) == [[[0.04, 0.0], [0.02, 0.0]], [[0.02, 0.0]]]
    assert poses(memory, ELSEWHERE) == [[[0.04, 0.0]], []] and len(memory) == 2


@pytest.mark.parametrize(("aim", "kept"), [([0.5, 0.0], [NEAR, 0.0]), ([0.0, 0.5], [0.0, 2.0 * NEAR]), ([0.0, 0.1], [0.0, 0.1])])
def test_it_keeps_away_from_where_a_blocked_motion_would_have_gone_next(aim, kept):
    memory = PeerMemory(SPAN)
    memory.blocked(np.array(aim), np.zeros(2), HERE, touched=False)
    assert memory.of(HERE)[0] == pytest.approx(np.array([kept]))


def test_what_is_learned_after_it_was_asked_is_not_in_the_knowledge():
    memory = PeerMemory(SPAN)
    memory.missed(np.ones(2), HERE)
    known = memory.knowledge()
    memory.missed(np.zeros(2), HERE)
    memory.restore(known)
    assert poses(memory, HERE)[0] == [[1.0, 1.0]]
    memory.clear()
    assert len(memory) == 0 and memory.of(HERE)[0].shape == (0, 2)
