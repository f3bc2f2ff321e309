from __future__ import annotations

import argparse

from experiments import simultaneous
from experiments.simultaneous.trial import WAYS


def cells(*given):
    parser = argparse.ArgumentParser()
    simultaneous.add_arguments(parser)
    parser.add_argument("--seed", type=int, default=0)
    return simultaneous.cells(parser.parse_args(given))


def test_every_way_runs_with_every_seed_and_the_truth_is_walked_for_once():
    found = cells("--seeds", "3")
    assert len({cell.name for cell in found}) == len(found) == 3 * len(WAYS) + len(simultaneous.WALKS)
    assert {cell.seed for cell in found if cell.settings["way"] == "contact"} == {0, 1, 2}
    assert not {cell.seed for cell in found if cell.settings["way"] != "walk"} & set(simultaneous.WALKS)
