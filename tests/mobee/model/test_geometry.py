# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

import mobee


def test_sizes_are_kept_in_the_order_given():
    assert mobee.box(1, 2, 3).size == (1.0, 2.0, 3.0)
    assert mobee.cylinder(0.1, 0.5) == mobee.cylinder(radius=0.1, height=0.5)
    assert mobee.sphere(0.1) == mobee.Geometry("sphere", (0.1,))
    assert mobee.capsule(0.1, 0.5).kind == "capsule"


@pytest.mark.parametrize("length", [0.0, -0.1, float("nan"), float("inf"), 1e160, 1e-10, "a", None, True, [1.0]])
def test_an_invalid_length_is_refused_by_name(length):
    with pytest.raises(mobee.InvalidValue, match="cylinder: height"):
        mobee.cylinder(0.1, length)


@pytest.mark.parametrize("length", [1e-9, 1e5, 3])
def test_lengths_from_a_nanometre_to_a_hundred_kilometres_are_kept(length):
    assert mobee.sphere(length).size == (length,)
