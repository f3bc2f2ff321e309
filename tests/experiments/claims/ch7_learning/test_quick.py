# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse

import pytest

from experiments.registry import load_experiment


@pytest.mark.parametrize(
    "name",
    ["hypercube-exploration", "constraint-discovery", "exploration-uniformity", "information-gain", "neighbour-count", "mdp-planner"],
)
def test_a_short_version_with_all_conditions_gives_every_claim_a_number_and_can_be_drawn(tmp_path, name):
    pytest.importorskip("matplotlib")
    experiment = load_experiment(name)
    parser = argparse.ArgumentParser()
    experiment.method.add_arguments(parser)
    arguments = argparse.Namespace(seed=0, **vars(parser.parse_args(["--quick", "--seeds", "1", "--jobs", "1"])))
    claims = experiment.method.run(arguments, tmp_path)["claims"]
    assert [claim["text"] for claim in claims] == [claim.text for claim in experiment.claims]
    assert all(claim["ours"] for claim in claims)
    assert experiment.method.figure(tmp_path).stat().st_size > 0
