from __future__ import annotations

import numpy as np
import pytest

from experiments.simultaneous.findings import CLAIMS, EVEN, Runs, above, actions_to, findings, judged, level, no_more
from experiments.simultaneous.trial import WAYS

SEEDS = 6
LOOKS = np.array([1000, 2000, 4000])
SPREAD = np.array([-1.0, 1.0, -0.8, 0.9, 0.0, 0.1])


def runs(**changes):
    """Scores and errors at the three looks; nobody reaches before the model is learned."""
    given = {
        "contact": ((4.0, 8.0, 10.0), 0.05),
        "first-3000": ((np.nan, np.nan, 9.0), 0.01),
        "first-1000": ((1.0, 6.0, 10.0), 0.02),
        "model": ((4.0, 7.0, 9.0), 0.2),
        "target": ((3.0, 5.0, 6.0), 0.3),
    } | changes
    return {
        way: Runs(
            LOOKS,
            np.tile(scores, (SEEDS, 1)),
            np.full((SEEDS, 3), error),
            np.full((SEEDS, 3), error),
            np.full(SEEDS, 900),
            np.full(SEEDS, 80),
        )
        for way, (scores, error) in given.items()
    }


def verdicts(found):
    return [claim.verdict for claim in judged(found)]


def test_a_score_is_come_to_between_two_looks():
    scores = np.array([[2.0, 4.0, 8.0], [6.0, 2.0, 6.0], [1.0, 2.0, 3.0], [np.nan, 6.0, 7.0]])
    assert actions_to(5.0, LOOKS, scores).tolist() == [2500.0, 1000.0, np.inf, 2000.0]


@pytest.mark.parametrize(("ours", "expected"), [(2000.0, True), (3000.0, True), (3500.0, False)])
def test_as_many_actions_are_no_more(ours, expected):
    assert no_more(np.full(SEEDS, ours), np.full(SEEDS, 3000.0)) is expected


@pytest.mark.parametrize("never", [(1000.0, np.inf), (np.inf, 1000.0), (np.inf, np.inf)])
def test_how_many_actions_a_run_needs_that_never_comes_to_the_score_is_open(never):
    ours, theirs = (np.where(np.arange(SEEDS) == 2, last, 1000.0) for last in never)
    assert no_more(ours, theirs) is None


def test_a_claim_tells_how_many_runs_never_came_to_the_score():
    sooner = judged(runs(contact=((1.0, 2.0, 3.0), 0.05)))[0]
    assert sooner.verdict == "open" and sooner.ours.startswith(f"never in {SEEDS} of {SEEDS} runs against 4000")


def test_a_difference_that_its_interval_leaves_open_is_open():
    assert no_more(3000.0 + SPREAD, np.full(SEEDS, 3000.0)) is None
    assert above(5.0 + SPREAD, np.full(SEEDS, 5.0)) is None
    assert level(9.5 + SPREAD, [np.full(SEEDS, 10.0)]) is None


def test_scores_are_level_with_the_best_of_the_others():
    ours, theirs = np.full(SEEDS, 10.0), np.full(SEEDS, 10.0)
    assert level(ours, [theirs, theirs * (1.0 + EVEN)]) is True
    assert level(ours, [theirs, theirs * (1.1 + EVEN)]) is False


def test_all_claims_hold_where_contact_tells_whose_fault_it_is():
    assert verdicts(runs()) == ["confirmed"] * len(CLAIMS)


def test_all_claims_fail_where_the_others_do_better():
    late = {"first-3000": ((np.nan, 9.0, 9.0), 0.01), "first-1000": ((1.0, 9.0, 10.0), 0.02), "target": ((3.0, 9.0, 10.0), 0.3)}
    worse = runs(contact=((1.0, 2.0, 9.05), 0.4), **late)
    assert verdicts(worse) == ["refuted"] * len(CLAIMS)


def test_claims_tell_their_numbers():
    texts = [claim.ours for claim in judged(runs())]
    assert "3000" not in texts[0] and "2100" in texts[0] and "4000" in texts[0] and "8.1" in texts[0]
    assert "contact 0.050" in texts[3] and "target 6.00" in texts[4]


def test_nothing_is_judged_before_everybody_has_run():
    assert findings({}) == {"ways": []}
    assert set(WAYS) == set(runs())
