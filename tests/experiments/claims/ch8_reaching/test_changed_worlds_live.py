# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from argparse import Namespace

import numpy as np
import pytest
from msgspec.structs import replace

from experiments.claims.ch8_reaching import changed_worlds_live
from experiments.claims.ch8_reaching.changed_worlds_live import (
    CHANGES,
    CLAIMS,
    EXPERIMENT,
    Job,
    Score,
    changed_world,
    conditions,
    findings,
    runs_of,
    seen_plant,
    world_file,
)
from experiments.kit.cells import Cell
from experiments.kit.live.launch import LaunchFailed, append_done
from mobee import load_world
from tests.experiments.finished_cells import finished

OPTIONS = Namespace(quick=False, backend="pybullet", seed=0, seeds=5)


@pytest.mark.parametrize("change", ["", *CHANGES])
def test_the_simulator_and_the_model_have_the_same_changed_world(change, tmp_path):
    """The file is read by robot_sim and the model, the other world by the oracle's offline plant."""
    simulated, known = load_world(str(world_file(change, tmp_path))), changed_world(change)
    assert set(simulated.objects) == set(known.objects) == {"table"} | ({"ball"} if change == "ball" else set())
    for name, thing in known.objects.items():
        assert simulated.objects[name].position == pytest.approx(thing.position)
        assert simulated.objects[name].size == pytest.approx(thing.size)


def test_the_changed_object_is_seen_at_a_wrong_place():
    ball, table = (seen_plant(change, 3).model.world.objects[change].position for change in ("ball", "table"))
    true = {change: changed_world(change).objects[change].position for change in ("ball", "table")}
    for seen, name in ((ball, "ball"), (table, "table")):
        assert 0.001 < np.linalg.norm(seen - true[name]) < 0.05


def cells(score, failed, seeds=5):
    """All cells: oracles with the score 10; the learner has half of it after the change, and then `score`."""

    def values(cell):
        changes = len(cell.settings["changes"])
        if cell.settings["runs"] == "oracle":
            return {name: np.full((1, 1), 10.0) for name in ("score", "failures", "without", "detected")}
        found = {"score": np.tile([5.0, score], (changes, 1)), "failures": np.tile([9.0, failed], (changes, 1))}
        return found | {"without": np.zeros((changes, 2)), "detected": np.tile([0, 1], (changes, 1))}

    every = [Cell(f"{one.name}-s{seed}", seed, one.settings) for one in conditions(OPTIONS) for seed in one.seeds or range(seeds)]
    return finished(values, every)


def test_there_is_a_learner_per_seed_and_an_oracle_per_change():
    found = cells(9.8, 1.0)
    assert len(found) == 5 + len(CHANGES)
    assert {change: len(runs) for change, runs in runs_of(found).items()} == dict.fromkeys(CHANGES, 5)


@pytest.mark.parametrize(("score", "failed", "seeds", "verdict"), [(9.8, 1.0, 5, "met"), (9.0, 3.0, 5, "not met"), (9.8, 1.0, 4, "open")])
def test_claims_are_judged_by_the_scores_after_the_tries(score, failed, seeds, verdict):
    found = findings(cells(score, failed, seeds))
    assert [claim["verdict"] for claim in found["claims"]] == [verdict] * len(CLAIMS)
    assert "directly after the change 0.50" in found["claims"][0]["ours"]
    assert found["changes"]["a ball appears"]["runs with a detection"] == seeds


def test_the_figure_has_a_column_of_panels_for_each_change(tmp_path):
    drawing = EXPERIMENT.method.plot(cells(9.8, 1.0))
    assert [axes.get_title() for axes in drawing.axes[: len(CHANGES)]] == list(CHANGES.values())
    drawing.savefig(tmp_path / "live.png")


def test_a_system_that_ended_before_all_evaluations_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(changed_worlds_live, "launch", lambda folder, *_, **__: append_done(folder, Score(1.0, 0.0, 0.0, 0)))
    job = Job("after", 0, "store.sqlite", "ball", 60, 1000)
    with pytest.raises(LaunchFailed, match="ball: the system ended after 1 of 2 evaluations"):
        changed_worlds_live._launched(tmp_path / "ball", job, "pybullet")
    assert len(changed_worlds_live._launched(tmp_path / "ball", replace(job, kind="oracle"), "pybullet")) == 1


def test_a_short_run_has_one_seed_and_few_targets_for_learner_and_oracle(monkeypatch):
    assert [one.seeds for one in conditions(Namespace(**vars(OPTIONS) | {"quick": True}))] == [(0,), (0,)]
    jobs, measured = [], []
    monkeypatch.setattr(changed_worlds_live, "train", lambda *_: None)
    monkeypatch.setattr(changed_worlds_live, "measured_truth", lambda change, seed, targets: measured.append(len(targets)) or NoTruth())
    monkeypatch.setattr(changed_worlds_live, "_launched", lambda folder, job, backend: jobs.append(job) or [Score(1.0, 0.0, 0.0, 0)])
    for quick in (True, False):
        for one in conditions(Namespace(**vars(OPTIONS) | {"quick": quick})):
            EXPERIMENT.method.trial(one.settings, 0)
    assert [job.targets for job in jobs] == [3, 3, 3] + [None] * (1 + 2 * len(CHANGES))
    assert measured == [3] + [27] * len(CHANGES)


class NoTruth:
    def save(self, path):
        pass
