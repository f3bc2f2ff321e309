from __future__ import annotations

import pytest

import mobee
from experiments.registry import EXPERIMENTS, load_experiment


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_states_its_claim_and_its_source(name):
    experiment = load_experiment(name)
    assert name == experiment.name
    assert all(text.strip() and "\n" not in text for text in (experiment.claim, experiment.source))
    notes = " ".join(experiment.notes.split())
    assert all(part in notes for part in ("Claim:", "Source:", "Run time:"))


def test_an_unknown_experiment_names_the_nearest():
    with pytest.raises(mobee.UnknownName, match="Did you mean 'flood'"):
        load_experiment("flod")
