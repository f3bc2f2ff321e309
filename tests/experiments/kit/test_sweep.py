from __future__ import annotations

import pytest

from experiments.kit.sweep import Condition, Sweep
from mobee.roadmap.ompl_base import OmplMissing
from tests.experiments.kit.toy_sweep import options


def missing():
    raise OmplMissing("not installed")


def test_a_condition_has_the_seeds_of_the_run_or_its_own(tmp_path):
    sweep = Sweep(lambda arguments: [Condition("truth", {}, seeds=(9001,)), Condition("learner", {})], dict, dict, dict)
    arguments = options(str(tmp_path), "--seeds", "2")
    arguments.seed = 3
    assert [(cell.name, cell.seed) for cell in sweep.cells(arguments)] == [("truth-s9001", 9001), ("learner-s3", 3), ("learner-s4", 4)]


def test_a_missing_package_is_named_before_anything_is_begun(tmp_path):
    sweep = Sweep(lambda arguments: [Condition("one", {})], dict, dict, dict, require=missing)
    with pytest.raises(OmplMissing, match="not installed"):
        sweep.run(options(str(tmp_path)), tmp_path)
    assert not list(tmp_path.iterdir())
