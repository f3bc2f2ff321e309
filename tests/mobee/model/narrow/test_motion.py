# SPDX-License-Identifier: Apache-2.0
"""The answer follows the motion of the volumes, as far as the least separation does by its nature.

Let h be how far any point of the pair moves.  The depth never changes by more than h.  While the core of a rounded volume is
apart from the other by d, depth * normal = (r - d) v / d, and v, the closest point of a convex set that moves by h, changes by
at most sqrt(h (d + d')).  Deeper than that, the least separation jumps from one face to the next, in truth.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee._core.narrow import KINDS
from tests.mobee.model.narrow.solids import overlap, random_solid

SEEDS = st.integers(0, 1_000_000)
PAIRS = [(first, second) for i, first in enumerate(KINDS) for second in KINDS[i:]]
ROUNDED = [pair for pair in PAIRS if pair[0] in ("sphere", "capsule")]


def moved(rng, item, h):
    """The item moved and turned about its centre, no point of it by more than h."""
    direction, axis = rng.normal(size=(2, 3))
    reach = 1.0  # m: more than any of these solids
    angle = 0.5 * h / reach
    x, y, z = axis / np.linalg.norm(axis) * angle
    turn = np.eye(3) + np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn, _ = np.linalg.qr(turn)
    turn *= np.sign(np.diag(turn))
    item = item.moved()
    item.position = item.position + direction / np.linalg.norm(direction) * 0.4 * h
    item.rotation = turn @ item.rotation
    return item


@pytest.mark.parametrize(("first", "second"), PAIRS)
@pytest.mark.parametrize("h", [1e-3, 1e-6])
@settings(max_examples=20)
@given(seed=SEEDS)
def test_the_depth_changes_by_no_more_than_the_motion(first, second, h, seed):
    rng = np.random.default_rng(seed)
    a, b = random_solid(rng, first, 0.05), random_solid(rng, second, 0.05)
    one, other = overlap(a, b).depth, overlap(moved(rng, a, h), b).depth
    if one > 0.0:
        assert abs(max(other, 0.0) - one) <= h + 1e-8


@pytest.mark.parametrize(("first", "second"), ROUNDED)
@pytest.mark.parametrize("h", [1e-4, 1e-9])
@settings(max_examples=30)
@given(seed=SEEDS)
def test_the_force_follows_the_motion_while_the_core_is_outside(first, second, h, seed):
    rng = np.random.default_rng(seed)
    a, b = random_solid(rng, first, 0.12), random_solid(rng, second, 0.12)
    one, other = overlap(a, b), overlap(moved(rng, a, h), b)
    reach = a.half[0] + (b.half[0] if second in ("sphere", "capsule") else 0.0)
    d, e = reach - one.depth, reach - other.depth
    if one.depth > 0.0 and other.depth > 0.0 and min(d, e) > 0.002:
        change = np.sqrt(h * (d + e))
        bound = change * (1.0 + 2.0 * reach / max(d, e)) + 1e-7
        assert np.linalg.norm(one.depth * one.normal - other.depth * other.normal) <= bound
