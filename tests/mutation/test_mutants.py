# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import ast

from tests.mutation.__main__ import OTHERS, SAFETY, chosen
from tests.mutation.mutants import mutants
from tests.mutation.running import ROOT

SOURCE = '''
def nearer(a: float, b: float = 2.0) -> bool:
    """Return whether a is nearer."""
    if not found(a) or a < b:
        raise ValueError("1 < 2")
    self.count += 1
    return min(a, b) == a - 1
'''


def test_each_mutant_is_one_change_that_the_tests_could_notice() -> None:
    found = mutants(SOURCE)
    assert [mutant.change for mutant in found] == [
        "2.0 -> 3.0",
        "not found(a) or a < b -> not found(a) and a < b",
        "not found(a) -> found(a)",
        "a < b -> a <= b",
        "without self.count += 1",
        "1 -> 2",
        "min(a, b) == a - 1 -> min(a, b) != a - 1",
        "min(a, b) -> max(a, b)",
        "a - 1 -> a + 1",
        "1 -> 2",
    ]
    original = ast.unparse(ast.parse(SOURCE))
    sources = {mutant.source for mutant in found}
    assert len(sources) == len(found) and original not in sources
    assert all("1 < 2" in source and "a: float" in source for source in sources)


def test_the_files_and_their_tests_exist_and_a_sample_depends_on_its_seed_alone() -> None:
    for file, tests in {**SAFETY, **OTHERS}.items():
        assert all((ROOT / path).exists() for path in (file, *tests)), file
    first, again, other = ([str(mutant) for _, mutant in chosen(list(OTHERS)[:2], 20, seed)] for seed in (0, 0, 1))
    assert first == again != other
    assert len(first) == 20
