# SPDX-License-Identifier: Apache-2.0
"""Places, sizes and orientations from outlines, and what is no thing at all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee import World, box
from mobee.vision.lens import rotation_of
from mobee.vision.objects.detection import Detection
from mobee.vision.objects.placing import EDGE, Eye, Eyes, Outline, Placed, locate_all
from mobee.vision.objects.placing import place as place_outlines
from mobee.vision.objects.thing import Thing, surface, touching, upright
from tests.mobee.vision.objects.drawn import BALL, BOX, CUP, THINGS, eyes, seen

PLACES = st.tuples(st.floats(-0.45, -0.25), st.floats(-0.12, 0.12), st.floats(-0.06, 0.06)).map(np.array)
YAWS = st.floats(-3.0, 3.0)


def place(thing: Thing, found: Mapping[str, Detection], view: Eyes) -> Placed | None:
    """The place of a thing that was detected once in each picture."""
    return place_outlines(thing, [Outline.all_of(eye, [found[name]])[0] for name, eye in zip(view.names, view.eyes, strict=True)], view)


@given(PLACES, st.sampled_from(THINGS), st.floats(0.0, 6.28))
@settings(max_examples=30, deadline=None)
def test_a_line_touches_a_silhouette_where_the_projected_shape_is_farthest(at: np.ndarray, thing: Thing, angle: float) -> None:
    position, size = at + (0.3, 0.0, 0.5), np.array(thing.size)
    turn = rotation_of(np.array([0.4, -0.3, 0.2]))
    direction = np.array([[np.cos(angle), np.sin(angle)]])
    offset, farthest = touching(thing.kind, size, position, turn, direction)
    if thing.kind == "sphere":
        directions = np.random.default_rng(0).standard_normal((4000, 3))
        inside = size[0] * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        tolerance = 5e-4
    else:
        inside, tolerance = surface(thing.kind, size) @ turn.T, 1e-12
    along = ((position + inside)[:, :2] / (position + inside)[:, 2:]) @ direction[0]
    assert along.max() <= farthest[0] + 1e-12 and along.max() >= farthest[0] - tolerance
    point = position + offset[0]
    assert point[:2] @ direction[0] / point[2] == pytest.approx(farthest[0])


@given(PLACES, st.sampled_from(THINGS), YAWS)
@settings(max_examples=15, deadline=None)
def test_exact_outlines_give_place_size_and_orientation(at: np.ndarray, thing: Thing, yaw: float) -> None:
    view = eyes()
    larger = replace(thing, size=tuple(1.04 * length for length in thing.size))  # than the usual size
    found = place(thing, seen(larger, at, yaw, view), view)
    assert found is not None and found.share > 0.98
    error = found.position - at
    assert error @ np.linalg.solve(found.covariance, error) < 2.0  # the usual size pulls a little
    assert np.abs(found.size / larger.size - 1.0).max() < 3.0 * (found.size_deviation / found.size).max()
    if thing.kind == "box":
        off = (np.arctan2(found.rotation[1, 0], found.rotation[0, 0]) - yaw + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi
        assert abs(off) < np.deg2rad(2.0)


def moved(view: Eyes, rng: np.random.Generator) -> Eyes:
    """The true cameras, whose errors are drawn from the covariance of those assumed."""
    drawn = (view.noise @ rng.standard_normal(view.noise.shape[1]) + view.bias @ rng.standard_normal(view.bias.shape[1])).reshape(2, 6)
    both = (Eye(e.position + d[:3], rotation_of(d[3:]) @ e.rotation, e.lens) for e, d in zip(view.eyes, drawn, strict=True))
    return replace(view, eyes=tuple(both))


@pytest.mark.parametrize("thing", THINGS, ids=lambda thing: thing.name)
def test_the_covariance_of_a_place_is_that_of_its_errors(thing: Thing, rng: np.random.Generator) -> None:
    view, normalised = eyes(), []
    for _ in range(60):
        at = rng.uniform((-0.42, -0.1, -0.06), (-0.28, 0.1, 0.04))
        found = seen(thing, at, rng.uniform(-3.0, 3.0), moved(view, rng))
        noisy = {name: replace(one, outline=one.outline + EDGE * rng.standard_normal(one.outline.shape)) for name, one in found.items()}
        placed = place(thing, noisy, view)
        assert placed is not None
        error = placed.position - at
        normalised.append(error @ np.linalg.solve(placed.covariance, error))
    assert 0.88 <= np.mean(np.array(normalised) <= 7.815)
    assert 1.5 < np.mean(normalised) < 4.0  # 3 without the shifts of outlines, which are not drawn here


def test_outlines_that_are_partly_hidden_give_a_place_of_larger_covariance() -> None:
    view, at = eyes(), np.array([-0.35, 0.02, 0.0])
    whole = seen(CUP, at, 0.0, view)
    cut = {name: replace(one, outline=np.minimum(one.outline, (one.outline[:, 0].max() - 2.5, np.inf))) for name, one in whole.items()}
    full, part = place(CUP, whole, view), place(CUP, cut, view)
    assert full is not None and part is not None
    assert np.linalg.norm(part.position - at) < 0.006
    assert part.share < 0.97 and np.trace(part.covariance) > 1.2 * np.trace(full.covariance)
    half = {name: replace(one, outline=np.minimum(one.outline, (one.centre[0], np.inf))) for name, one in whole.items()}
    assert place(CUP, half, view) is None


def flat(radius: float, at: np.ndarray, view: Eyes) -> dict[str, object]:
    """A disc of paper that lies on the table."""
    return seen(replace(CUP, name="ball", size=(radius, 1e-4)), at, 0.0, view)


def test_things_of_other_shapes_and_sizes_are_none() -> None:
    view, at = eyes(), np.array([-0.35, 0.02, -0.05])
    assert place(BALL, seen(BOX, at, 0.4, view), view) is None
    assert place(BOX, seen(BALL, at, 0.0, view), view) is None
    assert place(BALL, seen(replace(BALL, size=(0.05,)), at, 0.0, view), view) is None


def test_paper_on_the_table_is_no_ball(rng: np.random.Generator) -> None:
    table = World()
    table.add("table", box(0.6, 1.5, 0.5), position=(-0.44, 0.0, -0.35))
    solids, view = list(table.objects.values()), eyes()
    for _ in range(30):
        at = np.array([rng.uniform(-0.5, -0.25), rng.uniform(-0.1, 0.1), -0.1])
        found = {name: [one] for name, one in flat(rng.uniform(0.02, 0.045), at, view).items()}
        assert locate_all([BALL], found, view, solids) == []


def test_each_thing_is_found_once_among_several(rng: np.random.Generator) -> None:
    view = eyes()
    places = {"ball": np.array([-0.35, 0.1, -0.05]), "cup": np.array([-0.35, -0.1, -0.04]), "box": np.array([-0.3, 0.0, -0.05])}
    detections = {name: [] for name in view.names}
    for thing in (*THINGS, BALL):
        at = places[thing.name] if thing is not BALL or not detections["left"] else places["ball"] + (0.0, 0.05, 0.1)
        for name, one in seen(thing, at, 0.3, view).items():
            detections[name].insert(0, one)
    found = locate_all(THINGS, detections, view)
    assert sorted(one.name for one in found) == ["ball", "ball", "box", "cup"]
    for one in found:
        nearest = min(np.linalg.norm(one.position - at) for at in (places[one.name], places["ball"] + (0.0, 0.05, 0.1)))
        assert nearest < 0.003
    assert locate_all(THINGS, {"left": detections["left"], "right": []}, view) == []


def test_an_upright_rotation_turns_about_the_vertical() -> None:
    np.testing.assert_allclose(upright(0.5), rotation_of(np.array([0.0, 0.0, 0.5])), atol=1e-12)
