# SPDX-License-Identifier: Apache-2.0
"""Tiny, huge, flat, touching and concentric volumes: always a number, and always a least separation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee._core.narrow import KINDS
from tests.mobee.model.narrow.solids import Solid, distance, overlap, overlap_along, random_turn, sampled_depth, solid

PAIRS = [(first, second) for i, first in enumerate(KINDS) for second in KINDS[i:]]
SIZES = st.sampled_from([1e-4, 1e-2, 1.0, 10.0])
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
TILTED = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
TURNS = st.one_of(
    st.sampled_from([np.eye(3), QUARTER, TILTED, QUARTER @ TILTED]),
    st.integers(0, 999).map(lambda k: random_turn(np.random.default_rng(k))),
)
HULLS = {
    "tetrahedron": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "plate": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
    "triangle": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
    "needle": [[0, 0, -1], [0, 0, 1]],
    "cube with the middles of its faces": [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)],
}


@st.composite
def solids(draw, kind) -> Solid:
    size = draw(SIZES)
    if kind == "convex":
        half = np.array(HULLS[draw(st.sampled_from(sorted(HULLS)))]) * size
    elif kind == "box":
        half = size * np.array(draw(st.sampled_from([(1.0, 1.0, 1.0), (1.0, 0.5, 0.01), (1.0, 0.01, 0.01)])))
    else:
        half = size * np.array(draw(st.sampled_from([(1.0, 1.0), (0.01, 1.0), (1.0, 0.01)])))[: 1 if kind == "sphere" else 2]
    return solid(kind, half, rotation=draw(TURNS))


@pytest.mark.parametrize(("first", "second"), PAIRS)
@settings(max_examples=30)
@given(data=st.data())
def test_there_is_always_a_finite_smallest_separation(first, second, data):
    a, b = data.draw(solids(first)), data.draw(solids(second))
    direction = np.array(data.draw(st.sampled_from([(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.3, 0.2, 0.1)])))
    # At a multiple of 0.5 of a size, faces and edges of these solids just touch.
    step = data.draw(st.sampled_from([0.0, 0.5, 1.0, 2.0])) * np.abs(a.half if data.draw(st.booleans()) else b.half).max()
    a = a.moved(direction * step)
    size = max(np.abs(a.half).max(), np.abs(b.half).max(), 1.0)
    found, apart = overlap(a, b), distance(a, b)
    assert np.isfinite(found.depth) and np.isfinite(apart) and apart >= 0.0
    axes = np.concatenate([a.rotation.T, b.rotation.T, -a.rotation.T, -b.rotation.T])  # sampling does not meet them exactly
    bound = min(sampled_depth(a, b, np.random.default_rng(0)), overlap_along(a, b, axes).min())
    # Around a cylinder's axis nearly all directions may separate equally fast; the engine then stops this close to the shortest motion.
    exact = 1e-6 if "cylinder" in (first, second) else 1e-8
    assert found.depth <= max(bound, 0.0) + exact * size
    if apart > 1e-9 * size:
        assert found.depth <= 0.0
        assert bound >= -apart - 1e-9 * size
    if found.depth > 0.0:
        assert apart <= 1e-9 * size
        assert np.isfinite(found.point).all()
        assert np.linalg.norm(found.normal) == pytest.approx(1.0, abs=1e-9)
        assert overlap_along(a, b, found.normal[None])[0] == pytest.approx(found.depth, abs=1e-8 * size)
        assert abs((found.point - a.position) @ found.normal) <= 20.0 * size
    elif bound > 1e-4 * size:
        pytest.fail(f"overlap by at least {bound} m is not found")
