# SPDX-License-Identifier: Apache-2.0
"""One model, many threads: each evaluation uses one consistent world, and equals the evaluation in a single thread."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue
from mobee.model.engine import NO_HANDS
from tests.mobee.model.random_scenes import loaded, posed, random_world

THREADS = 8


def test_evaluations_in_threads_equal_single_ones_during_edits(rng: np.random.Generator) -> None:
    robot = loaded("katana")
    model, q = mobee.Model(robot, random_world(rng, robot, 120, 0.4)), posed(rng, robot, 40)
    stop = threading.Event()

    def edit(seed: int) -> None:
        mine = np.random.default_rng(seed)
        while not stop.is_set():
            name = f"edited{seed}"
            model.world.add(name, mobee.box(0.2, 0.2, 0.2), position=mine.uniform(-0.4, 0.4, 3))
            model.world.move(name, position=mine.uniform(-0.4, 0.4, 3))
            model.world.attach(name, robot.links[mine.integers(len(robot.links))], (mine.uniform(-0.2, 0.2, 3), np.eye(3)))
            model.world.remove(name)

    def evaluate(seed: int) -> list[mobee.Pose]:
        poses = []
        for index in np.random.default_rng(seed).integers(0, len(q), 100):
            pose = model.evaluate(q[index]) if seed % 2 else model.evaluate(q[index : index + 3], threads=1 + seed % 3)
            assert len(pose.table) >= 0  # now, while the others evaluate and edit
            poses.append(pose)
        return poses

    editors = [threading.Thread(target=edit, args=(seed,)) for seed in range(2)]
    for editor in editors:
        editor.start()
    try:
        with ThreadPoolExecutor(THREADS) as pool:
            threaded = [pose for poses in pool.map(evaluate, range(THREADS)) for pose in poses]
    finally:
        stop.set()
        for editor in editors:
            editor.join()

    assert len({pose._snapshot.version for pose in threaded}) > 10
    alone = mobee.Model(robot)
    for pose in threaded:
        table, torque = alone._engine.contacts(pose._flat, pose._snapshot, NO_HANDS)
        assert np.array_equal(pose.table.numbers, table.numbers)
        assert np.array_equal(pose.table.reals, table.reals)
        assert np.array_equal(pose.projection, torque.reshape(pose.q.shape))


def test_threads_leave_at_most_a_room_each(rng: np.random.Generator) -> None:
    robot = loaded("katana")
    model, q = mobee.Model(robot, random_world(rng, robot, 50)), posed(rng, robot, 30)
    with ThreadPoolExecutor(THREADS) as pool:
        for _ in range(5):
            list(pool.map(lambda one: len(model.evaluate(one).table), q))
    assert len(model._engine._rooms) <= THREADS


@pytest.mark.parametrize("objects", [0, 120])
@pytest.mark.parametrize("poses", [0, 1, 2, 50])
def test_any_number_of_threads_gives_the_same_bits(poses: int, objects: int, rng: np.random.Generator) -> None:
    robot = loaded("icub")
    model, q = mobee.Model(robot, random_world(rng, robot, objects, 0.6)), posed(rng, robot, poses)
    model.world.add("held", mobee.sphere(0.1))
    model.world.attach("held", robot.links[-1], ((0.0, 0.0, 0.0), np.eye(3)))
    alone = model.evaluate(q)
    assert len(alone.table) > 0 or poses * objects == 0
    for threads in (2, 3, 7, 100):
        shared = model.evaluate(q, threads=threads)
        assert np.array_equal(shared.table.numbers, alone.table.numbers)
        assert np.array_equal(shared.table.reals, alone.table.reals)
        assert np.array_equal(shared.projection, alone.projection)
        assert np.array_equal(shared.projection_of_part, alone.projection_of_part)


def test_fewer_threads_than_one_are_refused() -> None:
    robot = loaded("katana")
    for threads in (0, 2.5, 5000):
        with pytest.raises(InvalidValue, match=f"threads={threads}: give a whole number from 1 to 1024"):
            mobee.Model(robot).evaluate(robot.home, threads=threads)  # type: ignore[arg-type]


def test_results_of_an_evaluation_stay_valid_after_the_model_is_deleted(rng: np.random.Generator) -> None:
    """Its memory is the table's; later evaluations must not write there."""
    robot = loaded("icub")
    model, q = mobee.Model(robot, random_world(rng, robot, 150, 0.6)), posed(rng, robot, 200)
    kept = [model.evaluate(q).table for _ in range(3)]
    numbers, reals = kept[0].numbers.copy(), kept[0].reals.copy()
    for shift in (0.1, 0.2):
        assert len(model.evaluate(q + shift, threads=2).table) > 1000
    del model
    for table in kept:
        assert np.array_equal(table.numbers, numbers)
        assert np.array_equal(table.reals, reals)
