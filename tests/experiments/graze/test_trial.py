from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.graze import figure, holds, results
from experiments.graze.approach import Table, Way
from experiments.graze.records import as_record, read_trials
from experiments.graze.trial import COLUMNS, VARIANTS, Control, Trial, run_trial
from experiments.kit.records import Records
from mobee.errors import InvalidValue

CLEAN = Trial("naive", 90.0, 0, 0, 0.01, 0.0, 0.5, 1.0, 0.0, 3, False, False, False, False, False, False, 0.05)


@pytest.fixture(scope="module")
def steep() -> tuple[Table, Way]:
    table = Table()
    way = table.way(table.spots(1, seed=0)[0], np.deg2rad(90.0))
    assert way is not None
    return table, way


def test_head_on_the_mended_reflex_recovers_and_the_controller_settles(steep: tuple[Table, Way]) -> None:
    found = {variant: run_trial(*steep, variant, 90.0, 0, 0) for variant in VARIANTS}
    assert found["off"].depth > 0.035
    assert found["mended"].recovered
    assert found["mended"].reflexes > 1  # the client insists
    assert found["2.0"].settled
    assert found["2.0"].switches == 0
    assert max(found[variant].depth for variant in VARIANTS[1:]) < 0.02


def test_a_trial_can_be_repeated(steep: tuple[Table, Way]) -> None:
    assert run_trial(*steep, "naive", 90.0, 0, 5) == run_trial(*steep, "naive", 90.0, 0, 5)


def test_a_recovery_is_clean_when_nothing_is_seen_on_the_way_back() -> None:
    assert CLEAN.clean
    flickers = replace(CLEAN, again=True)
    assert flickers.recovered
    assert not flickers.clean
    for fault in ("came_back", "never", "deeper", "relapse"):
        assert not replace(CLEAN, **{fault: True}).recovered
    assert not replace(CLEAN, reflexes=0).recovered


def test_a_reflex_that_follows_at_once_is_a_relapse() -> None:
    assert Control(taken=[100, 130], given=[120, 150]).relapsed
    assert not Control(taken=[100, 190], given=[120, 200]).relapsed
    assert not Control(taken=[100], given=[120]).relapsed
    assert Control(taken=[100, 130], given=[120]).switches == 3


def test_trials_are_read_as_they_were_written(tmp_path: Path) -> None:
    with Records(tmp_path / "graze.csv", COLUMNS) as records:
        records.append(as_record(CLEAN))
    assert read_trials(tmp_path / "graze.csv") == [CLEAN]


def claimed() -> list[Trial]:
    """Trials that are as the claim says."""
    low = {"angle": 1.0}
    return [
        CLEAN,
        replace(CLEAN, **low, relapse=True, switches=9.0),
        replace(CLEAN, variant="mended"),
        replace(CLEAN, **low, variant="mended"),
        replace(CLEAN, variant="2.0", settled=True),
        replace(CLEAN, **low, variant="2.0", settled=True),
    ]


def test_the_claim_fails_with_any_of_its_parts() -> None:
    trials = claimed()
    assert holds(trials)
    for index, change in (
        (1, {"relapse": False}),
        (3, {"relapse": True}),
        (3, {"switches": 9.0}),
        (4, {"settled": False}),
        (5, {"solid": 0.001}),
    ):
        spoiled = list(trials)
        spoiled[index] = replace(spoiled[index], **change)
        assert not holds(spoiled)


def test_results_tell_shares_of_each_variant_and_angle() -> None:
    found = results(claimed())
    assert found["naive"]["90"]["recovered"] == 1.0
    assert found["naive"]["1"]["relapse"] == 1.0
    assert found["off"]["90"] == {"trials": 0}


def test_the_figure_is_drawn_and_refused_without_trials(tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match="no trial"):
        figure(tmp_path)
    with Records(tmp_path / "graze.csv", COLUMNS) as records:
        for trial in claimed():
            records.append(as_record(trial))
    assert figure(tmp_path).stat().st_size > 10_000
