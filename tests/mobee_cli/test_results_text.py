# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import hypothesis.strategies as st
from hypothesis import given

from mobee_cli.results_text import results_text

NAMES = st.text("abcdefgh_", min_size=1, max_size=12)
SCALARS = st.none() | st.booleans() | st.integers(-999, 999) | st.floats(-1e3, 1e3) | st.text("abc ", max_size=12)
ROWS = st.lists(st.dictionaries(NAMES, SCALARS, max_size=3), max_size=3)
RESULTS = st.recursive(
    SCALARS | st.lists(SCALARS, max_size=2) | ROWS, lambda inner: st.dictionaries(NAMES, inner, max_size=5), max_leaves=20
)


def test_results_of_the_same_names_are_a_table():
    found = {"default": {"left_hand": {"depth_mm": 0.0, "pair": None}, "chest": {"depth_mm": 1.23456, "pair": "a in b"}}}
    assert results_text(found, 40).splitlines() == [
        "default:",
        "             depth",
        "                mm    pair",
        "  left hand      0       -",
        "  chest      1.235  a in b",
    ]


def test_a_list_of_results_is_a_table_whose_first_names_the_rows():
    found = {"ways": [{"way": "contact", "score at 5": 1, "tries": 2}, {"way": "first-3", "tries": 4, "L1": 0.5}]}
    assert results_text(found, 40).splitlines() == [
        "ways:",
        "           score",
        "              at",
        "  way          5  tries   L1",
        "  contact      1      2    -",
        "  first-3      -      4  0.5",
    ]


def test_rows_have_as_many_names_as_are_needed_to_distinguish_them():
    found = {"rows": [{"law": "old", "who": "both", "x": 1}, {"law": "old", "who": "reach", "x": 2}, {"law": "new", "who": "both", "x": 3}]}
    assert results_text(found, 40).splitlines() == ["rows:", "  law  who    x", "  old  both   1", "  old  reach  2", "  new  both   3"]


def test_columns_beyond_the_width_are_in_a_further_table():
    found = {str(row): {"one": 1, "two": 2, "three": 3} for row in (7, 8)}
    assert results_text(found, 12).splitlines() == ["   one  two", "7    1    2", "8    1    2", "   three", "7      3", "8      3"]


def test_single_values_are_one_line_each():
    found = {"passed": True, "judged": None, "objective": [1.0, 0.5], "found": {}, "claims": {"nothing touches": False}}
    said = ["passed: yes", "judged: -", "objective: 1, 0.5", "found: none", "claims:", "  nothing touches: no"]
    assert results_text(found, 80).splitlines() == said


@given(st.dictionaries(NAMES, RESULTS, max_size=5))
def test_every_line_fits_the_terminal(results):
    assert all(len(line) <= 80 for line in results_text(results, 80).splitlines())
