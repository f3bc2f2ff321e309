# SPDX-License-Identifier: Apache-2.0
"""Where the deepest point or the least separation is not unique, rounding must not choose."""

from __future__ import annotations

import numpy as np
import pytest

from tests.mobee.model.narrow.solids import overlap, random_turn, solid

ALONG_X = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # takes local z to x
TIES = {
    "capsule axis inside a box": (
        solid("capsule", (0.02, 0.1), (0.0, 0.0, 0.04), ALONG_X),
        solid("box", (0.3, 0.2, 0.05)),
    ),
    "capsule axis in the middle plane of a box": (
        solid("capsule", (0.02, 0.1), (0.05, 0.0, 0.0), ALONG_X),
        solid("box", (0.3, 0.2, 0.05)),
    ),
    "capsule axis in a face of a box": (solid("capsule", (0.02, 0.1), (0.1, 0.0, 0.05), ALONG_X), solid("box", (0.3, 0.2, 0.05))),
    "capsule lying on a box": (solid("capsule", (0.02, 0.1), (0.25, 0.0, 0.06), ALONG_X), solid("box", (0.3, 0.2, 0.05))),
    "capsule across the middle of a square rod": (solid("capsule", (0.02, 0.3), (0.1, 0.0, 0.0)), solid("box", (0.2, 0.05, 0.05))),
    "sphere in the middle of a cube": (solid("sphere", (0.02,)), solid("box", (0.05, 0.05, 0.05))),
    "concentric spheres": (solid("sphere", (0.02,)), solid("sphere", (0.05,))),
    "sphere on the axis of a capsule": (solid("sphere", (0.02,), (0.0, 0.0, 0.05)), solid("capsule", (0.04, 0.1))),
    "parallel capsules": (solid("capsule", (0.04, 0.1), (0.05, 0.0, 0.06)), solid("capsule", (0.04, 0.1))),
    "capsules on one line": (solid("capsule", (0.04, 0.1), (0.0, 0.0, 0.15)), solid("capsule", (0.04, 0.1))),
    "crossing capsules": (solid("capsule", (0.04, 0.1), (0.02, 0.0, 0.0), ALONG_X), solid("capsule", (0.04, 0.1))),
    "box face on face": (solid("box", (0.1, 0.1, 0.1), (0.15, 0.05, 0.19)), solid("box", (0.1, 0.1, 0.1))),
    "box in the middle of its double": (solid("box", (0.1, 0.1, 0.1)), solid("box", (0.1, 0.1, 0.1))),
    "sphere on the axis of a cylinder": (solid("sphere", (0.01,)), solid("cylinder", (0.05, 0.05))),
    "cylinder cap on a box": (solid("cylinder", (0.05, 0.1), (0.1, 0.0, 0.14)), solid("box", (0.1, 0.1, 0.05))),
    "cylinder lying on a box": (solid("cylinder", (0.05, 0.1), (0.1, 0.0, 0.09), ALONG_X), solid("box", (0.1, 0.1, 0.05))),
    "cylinder standing on a cylinder": (solid("cylinder", (0.05, 0.1), (0.03, 0.0, 0.19)), solid("cylinder", (0.05, 0.1))),
    "parallel cylinders": (solid("cylinder", (0.05, 0.1), (0.09, 0.0, 0.06)), solid("cylinder", (0.05, 0.1))),
    "cylinder in the middle of its double": (solid("cylinder", (0.05, 0.1)), solid("cylinder", (0.05, 0.1))),
    "capsule lying on a cylinder's cap": (solid("capsule", (0.02, 0.1), (0.03, 0.0, 0.11), ALONG_X), solid("cylinder", (0.05, 0.1))),
    "hull face on a box": (
        solid("convex", [[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.2]], (0.05, 0.0, 0.045)),
        solid("box", (0.1, 0.1, 0.05)),
    ),
}


@pytest.mark.parametrize("name", TIES)
def test_moves_of_a_picometre_and_motions_of_both_do_not_change_the_answer(name):
    a, b = TIES[name]
    rng = np.random.default_rng(3)
    first = overlap(a, b)
    assert first.depth > 0.0
    for _ in range(40):
        turn, shift = random_turn(rng), rng.uniform(-1.0, 1.0, 3)
        jitter = rng.uniform(-1e-12, 1e-12, 3)
        again = overlap(a.moved(shift + jitter, turn), b.moved(shift, turn))
        assert again.depth == pytest.approx(first.depth, abs=1e-9)
        assert turn.T @ again.normal == pytest.approx(first.normal, abs=1e-6)
        assert turn.T @ (again.point - shift) == pytest.approx(first.point, abs=1e-6)


def point(name):
    return overlap(*TIES[name]).point


def test_a_capsule_that_a_box_swallows_is_met_above_the_middle_of_its_axis():
    found = overlap(*TIES["capsule axis inside a box"])
    assert found.normal == pytest.approx([0.0, 0.0, 1.0])
    assert found.depth == pytest.approx(0.03)
    assert found.point == pytest.approx([0.0, 0.0, 0.035])


def test_a_capsule_along_a_face_is_met_in_the_middle_of_the_part_above_the_face():
    assert point("capsule lying on a box") == pytest.approx([0.225, 0.0, 0.045])
    assert point("capsule axis in a face of a box") == pytest.approx([0.1, 0.0, 0.04])


def test_parallel_capsules_are_met_in_the_middle_of_the_part_beside_each_other():
    assert point("parallel capsules") == pytest.approx([0.025, 0.0, 0.03])


def test_the_contact_point_of_faces_is_the_middle_of_their_common_area():
    assert point("box face on face") == pytest.approx([0.075, 0.025, 0.095])
    assert point("cylinder standing on a cylinder") == pytest.approx([0.015, 0.0, 0.095])
    assert point("cylinder lying on a box") == pytest.approx([0.05, 0.0, 0.045])
    assert point("capsule lying on a cylinder's cap") == pytest.approx([0.0, 0.0, 0.095])


@pytest.mark.parametrize("name", TIES)
def test_a_tie_is_still_a_separation(name):
    a, b = TIES[name]
    found = overlap(a, b)
    assert overlap(a.moved(found.normal * (found.depth + 1e-8)), b).depth <= 0.0
    assert overlap(a.moved(found.normal * (found.depth - 1e-8)), b).depth > 0.0
