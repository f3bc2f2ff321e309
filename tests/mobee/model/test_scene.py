# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import math

import numpy as np
import pytest

import mobee
from mobee._core.engine import Grid, grid_of
from mobee.model.engine import OBSTACLE, TARGET, Engine
from tests.mobee.model.random_scenes import loaded, random_world


def made(world: mobee.World) -> Grid:
    return grid_of(Engine(loaded("katana")).scene_of(world.snapshot).handle)


@pytest.mark.parametrize("count", [0, 1, 99, 100, 101, 700])
def test_every_free_object_stands_in_the_scene_once(count: int, rng: np.random.Generator) -> None:
    world = random_world(rng, loaded("katana"), count)
    here, snapshot = made(world), world.snapshot
    free = np.flatnonzero((snapshot.roles == OBSTACLE) | (snapshot.roles == TARGET))
    order, target = here.objects.T
    assert np.array_equal(np.sort(order), free)
    assert np.array_equal(target == 1, snapshot.roles[order] == TARGET)
    assert np.array_equal(here.centers, snapshot.rows["position"][order])
    assert len(here.starts) == math.prod(here.cells) + 1
    assert here.starts[0] == here.large
    assert here.starts[-1] == len(free)
    assert (np.diff(here.starts) >= 0).all()


def test_a_table_among_small_objects_does_not_widen_the_grid(rng: np.random.Generator) -> None:
    world = mobee.World()
    for index in range(200):
        world.add(f"o{index}", mobee.sphere(0.02), position=rng.uniform(-1, 1, 3))
    world.add("table", mobee.box(3.0, 3.0, 0.1))
    here = made(world)
    assert here.large == 1
    assert here.objects[0, 0] == 200
