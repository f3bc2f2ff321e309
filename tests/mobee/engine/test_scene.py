from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.collision.snapshot import OBSTACLE, TARGET
from mobee.engine.pack import pack
from mobee.engine.scene import CELLS, COUNT, LARGE, W_COLUMNS, W_START, Scene, scene
from tests.mobee.engine.random_scenes import loaded, random_world


def made(world: mobee.World) -> Scene:
    return scene(pack(loaded("katana")), world.snapshot, np.empty(0, dtype=np.int64))


@pytest.mark.parametrize("count", [0, 1, 99, 100, 101, 700])
def test_every_free_object_stands_in_the_scene_once(count: int, rng: np.random.Generator) -> None:
    world = random_world(rng, loaded("katana"), count)
    here, snapshot = made(world), world.snapshot
    free = np.flatnonzero((snapshot.roles == OBSTACLE) | (snapshot.roles == TARGET))
    cells = int(here.integers[CELLS : CELLS + 3].prod())
    starts = here.integers[W_START : W_START + cells + 1]
    order = here.integers[W_START + cells + 1 :][: len(free)].astype(int)
    target = here.integers[W_START + cells + 1 + len(free) :][: len(free)].astype(bool)
    assert here.integers[COUNT] == len(free)
    assert np.array_equal(np.sort(order), free)
    assert np.array_equal(target, snapshot.roles[order] == TARGET)
    if len(free):
        assert starts[0] == here.integers[LARGE]
        assert starts[-1] == len(free)
        assert (np.diff(starts.astype(int)) >= 0).all()
        columns = here.floats[W_COLUMNS:][: 4 * len(free)].reshape(4, -1)
        assert np.array_equal(columns[:3].T, snapshot.rows[order, 1:4])
        assert np.array_equal(columns[3], snapshot.rows[order, 16])


def test_a_table_among_small_things_does_not_widen_the_grid(rng: np.random.Generator) -> None:
    world = mobee.World()
    for index in range(200):
        world.add(f"o{index}", mobee.sphere(0.02), position=rng.uniform(-1, 1, 3))
    world.add("table", mobee.box(3.0, 3.0, 0.1))
    here = made(world)
    assert here.integers[LARGE] == 1
    assert here.integers[W_START + int(here.integers[CELLS : CELLS + 3].prod()) + 1] == 200
