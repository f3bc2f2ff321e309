from __future__ import annotations

import math

import numpy as np
import pytest

from mobee.engine.compiled import FOLDER, entry, entry_exact, inner, inner_as_written, inner_exact
from mobee.engine.evaluate import link_poses


@entry("float64(float64)")
def root(x: float) -> float:
    return math.sqrt(x)


@inner
def carried_over(a: float, b: float) -> float:
    return (a + b) - a


@inner_as_written
def carried_over_as_written(a: float, b: float) -> float:
    return (a + b) - a


@inner_exact
def product(a: float, b: float) -> float:
    return a * b


@entry_exact("float64(float64, float64, float64)")
def product_and_sum(a: float, b: float, c: float) -> float:
    return product(a, b) + c


def test_an_entry_is_compiled_when_its_module_is_imported_for_its_types_only() -> None:
    assert [str(types) for types in root.signatures] == ["(float64,)"]
    assert root(2.0) == math.sqrt(2.0)
    with pytest.raises(TypeError, match="No matching definition"):
        root("two")


def test_an_entry_takes_no_array_of_another_type_or_order() -> None:
    with pytest.raises(TypeError, match="No matching definition"):
        link_poses(np.zeros(25, dtype=np.int64), np.zeros(9), np.zeros((1, 1)))
    with pytest.raises(TypeError, match="No matching definition"):
        link_poses(np.zeros(25, dtype=np.uint64), np.zeros(9), np.zeros((2, 2)).T)


def test_terms_stay_where_they_are_written_only_when_asked_for() -> None:
    assert carried_over_as_written(1.0, 1e-16) == 0.0
    assert carried_over(1.0, 1e-16) == 1e-16


def test_exact_arithmetic_is_that_of_python_also_across_calls() -> None:
    a, b = 1.0 + 2.0**-30, 1.0 - 2.0**-30
    assert product_and_sum(a, b, -1.0) == a * b - 1.0 == 0.0  # joined into one operation it would be -2**-60


def test_not_a_number_stays_one() -> None:
    assert math.isnan(root(-1.0))
    assert math.isnan(root(math.nan))


def test_machine_code_is_on_disk_one_file_a_function() -> None:
    assert len(list(FOLDER.glob("root-*"))) >= 1
    assert list(FOLDER.glob("link_poses-*")) != []
