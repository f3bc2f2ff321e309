# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.claims.ch8_reaching.simultaneous_learning import (
    CLAIMS,
    LABELS,
    MARGIN,
    VARIANTS,
    BlamingPlant,
    Runs,
    actions_to,
    are_complete,
    findings,
    level,
    no_more,
    plot,
)
from experiments.kit.experiment import judged
from experiments.kit.reaching.arm import reach_space
from mobee import TransitionModel
from mobee.plant import Outcome
from mobee.reach import TARGET
from tests.experiments.finished_cells import Cell, finished
from tests.mobee.learning.reaching import toy

SEEDS = 6
CHECKPOINTS = np.array([1000, 2000, 4000])
SPREAD = np.array([-1.0, 1.0, -0.8, 0.9, 0.0, 0.1])


def runs(**changes):
    """Scores and errors at the three checkpoints; "first-3000" does not reach before it has learned the transitions."""
    given = {
        "contact": ((4.0, 8.0, 10.0), 0.05),
        "first-3000": ((np.nan, np.nan, 9.0), 0.01),
        "first-1000": ((1.0, 6.0, 10.0), 0.02),
        "model": ((4.0, 7.0, 9.0), 0.2),
        "target": ((3.0, 5.0, 6.0), 0.3),
    } | changes
    return {
        variant: Runs(
            CHECKPOINTS,
            np.tile(scores, (SEEDS, 1)),
            np.full((SEEDS, 3), error),
            np.full((SEEDS, 3), error),
            np.full(SEEDS, 900),
            np.full(SEEDS, 80),
        )
        for variant, (scores, error) in given.items()
    }


def verdicts(found):
    return [claim["verdict"] for claim in judged(CLAIMS, found)]


def test_the_number_of_actions_to_a_score_is_interpolated_between_checkpoints():
    scores = np.array([[2.0, 4.0, 8.0], [6.0, 2.0, 6.0], [1.0, 2.0, 3.0], [np.nan, 6.0, 7.0]])
    assert actions_to(5.0, CHECKPOINTS, scores).tolist() == [2500.0, 1000.0, np.inf, 2000.0]


@pytest.mark.parametrize(("ours", "expected"), [(2000.0, True), (3000.0, True), (3500.0, False)])
def test_an_equal_number_of_actions_is_no_more(ours, expected):
    assert no_more(np.full(SEEDS, ours), np.full(SEEDS, 3000.0)) is expected


@pytest.mark.parametrize("never", [(1000.0, np.inf), (np.inf, 1000.0), (np.inf, np.inf)])
def test_a_run_that_never_reaches_the_score_leaves_the_comparison_open(never):
    ours, theirs = (np.where(np.arange(SEEDS) == 2, last, 1000.0) for last in never)
    assert no_more(ours, theirs) is None


def test_an_interval_that_contains_the_bound_leaves_the_comparison_open():
    assert no_more(3000.0 + SPREAD, np.full(SEEDS, 3000.0)) is None
    assert level(9.5 + SPREAD, [np.full(SEEDS, 10.0)]) is None


def test_scores_are_level_with_the_best_of_the_others():
    ours, theirs = np.full(SEEDS, 10.0), np.full(SEEDS, 10.0)
    assert level(ours, [theirs, theirs * (1.0 + MARGIN)]) is True
    assert level(ours, [theirs, theirs * (1.1 + MARGIN)]) is False


def test_the_claims_hold_where_learning_at_the_same_time_by_contact_does_better():
    assert verdicts(runs()) == ["confirmed"] * len(CLAIMS)


def test_all_claims_fail_where_the_others_do_better():
    late = {"first-3000": ((np.nan, 9.0, 9.0), 0.01), "first-1000": ((1.0, 9.0, 10.0), 0.02), "target": ((3.0, 9.0, 10.0), 0.3)}
    worse = runs(contact=((1.0, 2.0, 9.05), 0.4), **late)
    assert verdicts(worse) == ["refuted"] + ["not reproduced"] * (len(CLAIMS) - 1)


def test_claims_are_open_where_a_run_ends_before_the_model_is_learned():
    short = runs(**{"first-3000": ((np.nan, np.nan, np.nan), np.nan)})
    assert not are_complete(short) and are_complete(runs())


def cells():
    """Two runs of every variant, whose models believe that a quarter of all transitions fail: none does."""
    space, model = reach_space(), TransitionModel(reach_space())
    pairs = np.argwhere(space.goals >= 0)
    seen = np.column_stack([pairs, space.goals[tuple(pairs.T)]])

    def work(cell):
        if cell.settings["variant"] == "walk":
            return {"seen": seen}
        values = {"scores": np.full((2, 3), 5.0 + cell.seed), "tries": np.array([300, 700]), "failed": np.array([20, 40])}
        if cell.settings["variant"] == "first-3000":
            values["scores"][0] = np.nan
        return values | {"outcomes_1": model.outcomes, "probabilities_1": model.debiased(0.3, 0.1).probabilities}

    learners = [
        Cell(f"{variant}-s{seed}", seed, {"variant": variant, "checkpoints": [1000, 2000]}) for variant in VARIANTS for seed in range(2)
    ]
    return finished(work, [Cell("truth", 9001, {"variant": "walk"}), *learners])


def test_models_are_compared_with_the_walks_and_runs_are_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    found = cells()
    rows = {row["variant"]: row for row in findings(found)["variants"]}
    contact, first = rows[LABELS["contact"]], rows[LABELS["first-3000"]]
    assert contact["L1 error after 2000 actions"] == "0.500 [0.500, 0.500]" and "L1 error after 1000 actions" not in contact
    assert "score after 1000 actions" in contact and "score after 1000 actions" not in first
    plot(found).savefig(tmp_path / "simultaneous.png")
    assert (tmp_path / "simultaneous.png").stat().st_size > 20_000


class Stuck:
    """Goes a share of the distance to its target, and reports given contacts."""

    robot = None

    def __init__(self, touched, share):
        self.touched, self.share = touched, share

    def act(self, part, target):
        return Outcome(self.share * target, settled=True, duration=1.0, touched=self.touched)


SPACE = SimpleNamespace(columns=np.array([0]), state_of=lambda q: round(float(q[0])))


@pytest.mark.parametrize("touched", [(), (TARGET,)])
@pytest.mark.parametrize(("share", "reported"), [(1.0, ()), (0.5, (TARGET,))])
def test_where_the_target_is_blamed_every_failed_transition_touches_it(touched, share, reported):
    plant = BlamingPlant(Stuck(touched, share), SPACE, "target")
    assert plant.act("arm", np.array([4.0])).touched == reported


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_where_the_model_is_blamed_no_transition_touches_the_target(share):
    plant = BlamingPlant(Stuck((TARGET,), share), SPACE, "model")
    outcome = plant.act("arm", np.array([4.0]))
    assert outcome.touched == () and outcome.q.tolist() == [4.0 * share]


def learned(blame):
    """Transitions that the model has observed and that failed, and those remembered as failures, of a learner on a toy."""
    model, arm = TransitionModel(toy.SPACE), toy.plant(0)
    on = arm if blame is None else BlamingPlant(arm, toy.SPACE, blame)
    agent = toy.agent(0, on=on, model=model, strategy="random", failures="local")
    agent.learn(toy.TARGETS, 60)
    stayed = (model.counts[:, :, 0] - model.imagined[0] > 0.0).sum()
    return stayed, sum((agent.failures.rewards(target.position) < 0.0).sum() for target in toy.TARGETS)


def test_a_failure_changes_either_the_model_or_the_memory_of_failures():
    (by_contact, remembered), (models, none), (of_target, most) = learned(None), learned("model"), learned("target")
    assert by_contact == of_target == none == 0  # where targets alone block, contact and blaming the target are the same
    assert models > 10 and remembered > 10 and most > 10
