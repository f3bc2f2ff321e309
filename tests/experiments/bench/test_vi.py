# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys

import numpy as np
import pytest

from experiments.bench.peers import DecisionProblem, load_quantecon
from experiments.bench.vi import after_transitions, contestants, problem_of_size
from mobee.errors import NotInstalled
from mobee.learning.value_iteration import policy_iteration
from mobee_cli.__main__ import main


def test_peers_solve_the_same_problem():
    pytest.importorskip("quantecon")
    tables = problem_of_size(300).tables
    exact, _ = policy_iteration(tables, tables.reward)
    problem = DecisionProblem(tables, tables.reward, 0.9, 1e-9)
    assert problem.scipy_values() == pytest.approx(exact, abs=1e-7)
    assert problem.quantecon_values(problem.quantecon(), "value_iteration") == pytest.approx(exact, abs=1e-7)


def test_wrong_values_of_a_peer_raise(monkeypatch):
    pytest.importorskip("quantecon")
    monkeypatch.setattr(DecisionProblem, "scipy_values", lambda self: np.zeros(len(self.first)))
    with pytest.raises(ArithmeticError, match="SciPy sparse, cold is wrong by"):
        contestants(problem_of_size(100))


def test_changes_and_their_reversals_restore_the_model():
    known = after_transitions(50, 5)
    before = known.tables.probabilities.copy(), known.tables.reward.copy()
    assert len(known.changes) == 10
    changed = 0
    for change in known.changes:
        known.tables.put(change)
        changed += not np.array_equal(known.tables.reward, before[1])
    assert changed >= 8
    assert np.array_equal(known.tables.probabilities, before[0]) and np.array_equal(known.tables.reward, before[1])


def test_without_quantecon_it_names_the_extra(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "quantecon.markov", None)
    with pytest.raises(NotInstalled):
        load_quantecon()
    assert main(["bench", "vi", "--quick"]) == 3
    assert capsys.readouterr().err == 'mobee bench: quantecon is not installed: pip install "mobee[bench]"\n'
