# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.kit.learning.arm import RIGHT, robot
from experiments.kit.reaching.arm import MARKER, PART
from experiments.kit.reaching.targets import AT_CENTRE, between, counts, distances, grid, joints_of, nearest_pose, targets_at
from mobee import Model

PAGE = Path(__file__).parents[4] / "experiments" / "kit" / "reaching" / "README.md"


def test_the_grid_is_three_places_a_direction_and_its_cells_lie_between():
    assert grid().shape == (27, 3) and len(np.unique(grid(), axis=0)) == 27
    assert between().shape == (8, 3)
    assert np.abs(grid() - grid().mean(axis=0)).max(axis=0) == pytest.approx([0.1, 0.2, 0.2])
    assert np.ptp(between(), axis=0) == pytest.approx([0.1, 0.2, 0.2])
    assert all(target.radius == 0.05 and target.aim == "surface" for target in targets_at(grid(), "surface"))


@pytest.mark.parametrize("seed", range(4))
def test_the_place_of_the_palm_in_a_pose_is_reached_within_limits_and_cables(seed):
    body, rng = robot(), np.random.default_rng(seed)
    low, high = body.limits[body.parts[PART].slice][:4].T
    clauses = [clause for clause in body.clauses if clause.part == PART]
    q = body.home.copy()
    columns = slice(body.parts[PART].start, body.parts[PART].start + 4)
    while True:
        q[columns] = rng.uniform(low, high)
        if all((clause.a @ q + clause.b).max() > 0.05 for clause in clauses):
            break
    model = Model(body)
    found = nearest_pose(model, MARKER, model.evaluate(q).position(MARKER), RIGHT)
    assert found.distance < AT_CENTRE
    assert np.linalg.norm(model.evaluate(found.q).position(MARKER) - model.evaluate(q).position(MARKER)) == pytest.approx(
        found.distance, abs=1e-6
    )
    assert ((found.q[columns] >= low - 1e-9) & (found.q[columns] <= high + 1e-9)).all()
    assert all((clause.a @ found.q + clause.b).max() > -1e-5 for clause in clauses)


def test_a_place_too_far_away_is_missed_by_its_distance_from_the_reachable_region():
    model = Model(robot())
    near = nearest_pose(model, MARKER, np.array([-1.0, 0.2, 0.1]), RIGHT, restarts=4)
    far = nearest_pose(model, MARKER, np.array([-2.0, 0.2, 0.1]), RIGHT, restarts=4)
    assert 0.5 < near.distance < 0.7 and far.distance == pytest.approx(near.distance + 1.0, abs=0.01)


def test_the_targets_that_the_page_lists_as_reachable_are_reachable():
    page = PAGE.read_text()
    for count in (4, 7):
        centre, surface = counts(distances(between(), joints_of(count)))
        assert f"| {count} | the 8 between | {centre} | {surface} |" in page
