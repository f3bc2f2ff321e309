# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from mobee.errors import UnknownName


@pytest.mark.parametrize(("given", "valid"), [(3, ["cup", "3d"]), ("cup", [3, "cups"]), (None, [])])
def test_a_name_of_any_type_is_answered(given: object, valid: list[object]) -> None:
    said = str(UnknownName("world object", given, valid))
    assert said.startswith(f"unknown world object {given!r}.")
    assert all(str(name) in said for name in valid)
