from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.simulation import OfflinePlant, run_batch
from tests.mobee.control.two_parts import two_part_arm


def hash_of(seed: int) -> str:
    """What an arm does under a seed."""
    plant = OfflinePlant(Model(two_part_arm()), seed, hashed=True)
    plant.act("arm", np.array([0.4, -0.3]))
    return plant.hash


def refuse(seed: int) -> None:
    raise InvalidValue(f"seed {seed} is not liked")


def test_a_batch_is_its_plants_one_after_the_other() -> None:
    seeds = [5, 3, 4]
    alone = [hash_of(seed) for seed in seeds]
    assert len(set(alone)) == 3
    assert run_batch(hash_of, seeds, processes=2) == alone
    assert run_batch(hash_of, seeds, processes=1) == alone


def test_what_goes_wrong_in_a_plant_is_raised() -> None:
    with pytest.raises(InvalidValue, match="seed 3 is not liked"):
        run_batch(refuse, [3, 4], processes=2)


def test_no_seeds_no_results() -> None:
    assert run_batch(hash_of, []) == []


@pytest.mark.parametrize("processes", [0, -1, 1.5, True])
def test_a_number_of_processes_that_is_none_is_refused(processes: int) -> None:
    with pytest.raises(InvalidValue, match="processes"):
        run_batch(hash_of, [1, 2], processes=processes)
