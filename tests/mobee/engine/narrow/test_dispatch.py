from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee._core.narrow import KINDS
from tests.mobee.engine.narrow.solids import (
    coal_distance,
    distance,
    overlap,
    overlap_along,
    random_solid,
    random_turn,
    sampled_depth,
)

PAIRS = list(itertools.product(KINDS, KINDS))
SORTED = list(itertools.combinations_with_replacement(KINDS, 2))
EXACT = {("sphere", k) for k in ("sphere", "capsule", "cylinder", "box")} | {("capsule", "capsule"), ("capsule", "box")}
SEEDS = st.integers(0, 1_000_000)


def pair(seed, first, second, spread=0.08):
    rng = np.random.default_rng(seed)
    return random_solid(rng, first, spread), random_solid(rng, second, spread), rng


@pytest.mark.parametrize(("first", "second"), PAIRS)
@settings(max_examples=30)
@given(seed=SEEDS)
def test_the_way_out_just_separates(first, second, seed):
    a, b, _ = pair(seed, first, second)
    found = overlap(a, b)
    if found.depth > 0.0:
        assert np.linalg.norm(found.normal) == pytest.approx(1.0, abs=1e-12)
        assert overlap_along(a, b, found.normal[None])[0] == pytest.approx(found.depth, abs=1e-11)
        assert overlap(a.moved(found.normal * (found.depth * (1 + 1e-6) + 1e-9)), b).depth <= 0.0
        assert overlap(a.moved(found.normal * (found.depth * (1 - 1e-6) - 1e-9)), b).depth > 0.0 or found.depth < 2e-9


@pytest.mark.parametrize(("first", "second"), SORTED)
@settings(max_examples=25)
@given(seed=SEEDS)
def test_no_direction_separates_sooner(first, second, seed):
    a, b, rng = pair(seed, first, second)
    depth, bound = overlap(a, b).depth, sampled_depth(a, b, rng)
    assert depth <= max(bound, 0.0) + 1e-8
    if bound < 0.0:
        assert depth <= 0.0


@pytest.mark.parametrize(("first", "second"), SORTED)
@settings(max_examples=30)
@given(seed=SEEDS)
def test_what_touches_and_how_far_the_rest_is_agree_with_coal(first, second, seed):
    a, b, _ = pair(seed, first, second, spread=0.2)
    ours, theirs = distance(a, b), coal_distance(a, b, tolerance=1e-10)
    if abs(theirs) > 1e-6:
        assert (overlap(a, b).depth > 0.0) == (theirs < 0.0)
        assert ours == pytest.approx(max(theirs, 0.0), abs=1e-7)


@pytest.mark.parametrize(("first", "second"), PAIRS)
@settings(max_examples=30)
@given(seed=SEEDS)
def test_what_is_apart_gets_a_lower_bound_of_its_distance(first, second, seed):
    a, b, _ = pair(seed, first, second, spread=0.3)
    depth, apart = overlap(a, b).depth, distance(a, b)
    assert (apart > 0.0) == (depth < 0.0) or abs(depth) < 1e-12
    if depth <= 0.0:
        assert -depth <= apart + 1e-12
        if (first, second) in EXACT and "box" not in (first, second):
            assert -depth == pytest.approx(apart, abs=1e-12)


@pytest.mark.parametrize(("first", "second"), PAIRS)
@settings(max_examples=25)
@given(seed=SEEDS)
def test_changing_places_turns_the_normal(first, second, seed):
    a, b, _ = pair(seed, first, second)
    one, other = overlap(a, b), overlap(b, a)
    assert one.depth == pytest.approx(other.depth, abs=1e-9)
    if one.depth > 1e-6 and sampled_gap(a, b, one):
        assert other.normal == pytest.approx(-one.normal, abs=1e-4)
        assert other.point == pytest.approx(one.point, abs=1e-4)


@pytest.mark.parametrize(("first", "second"), PAIRS)
@settings(max_examples=25)
@given(seed=SEEDS)
def test_a_rigid_motion_of_both_moves_the_answer_with_them(first, second, seed):
    a, b, rng = pair(seed, first, second)
    turn, way = random_turn(rng), rng.uniform(-1.0, 1.0, 3)
    one, other = overlap(a, b), overlap(a.moved(way, turn), b.moved(way, turn))
    assert other.depth == pytest.approx(one.depth, abs=1e-9)
    if one.depth > 1e-6:
        assert other.normal == pytest.approx(turn @ one.normal, abs=1e-4)
        assert other.point == pytest.approx(turn @ one.point + way, abs=1e-4)


def sampled_gap(a, b, found) -> bool:
    """Whether no direction well away from the normal is nearly as short a way out."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    far = directions[directions @ found.normal < 0.95]
    return bool(overlap_along(a, b, far).min() > found.depth + 2e-3)
