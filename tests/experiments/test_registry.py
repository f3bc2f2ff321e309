# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

import mobee
from experiments.registry import EXPERIMENTS, FORMER_NAMES, load_experiment


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_states_its_claim_and_its_source(name):
    experiment = load_experiment(name)
    assert name == experiment.name
    assert all(text.strip() and "\n" not in text for text in (experiment.claim, experiment.source))
    notes = " ".join(experiment.notes.split())
    assert all(part in notes for part in ("Claim:", "Source:", "Run time:"))


def test_an_unknown_experiment_names_the_nearest():
    with pytest.raises(mobee.UnknownName, match="Did you mean 'model-throughput'"):
        load_experiment("model-troughput")


@pytest.mark.parametrize(("former", "current"), FORMER_NAMES.items())
def test_a_former_name_loads_the_experiment_that_has_it_now(former, current):
    assert former not in EXPERIMENTS and load_experiment(former).name == current
