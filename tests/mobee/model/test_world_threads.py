# SPDX-License-Identifier: Apache-2.0
"""The world under many threads at once."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import mobee
from tests.mobee.planar import LENGTH, planar_arm

TIP = (3 * LENGTH, 0.0, 0.0)
PATIENCE = 30.0  # s; what does not come until then hangs


def started(work) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def test_no_edit_of_many_threads_is_lost():
    world, threads, each = mobee.World(), 4, 300

    def fill(number):
        for i in range(each):
            world.add(f"{number}:{i}", mobee.sphere(0.1), position=(number, i, 0.0))
            world.move(f"{number}:{i}", position=(number, i, 1.0))
            if i % 3 == 0:
                world.remove(f"{number}:{i}")

    crew = [started(lambda number=number: fill(number)) for number in range(threads)]
    for thread in crew:
        thread.join(PATIENCE)
    assert sorted(world.objects) == sorted(f"{number}:{i}" for number in range(threads) for i in range(each) if i % 3)
    assert world.version == threads * (2 * each + each // 3)
    places = dict(zip(world.snapshot.names, world.snapshot.rows["position"].tolist(), strict=True))
    assert places == {name: [*map(float, name.split(":")), 1.0] for name in world.objects}


def test_of_threads_that_want_one_name_exactly_one_gets_it():
    world, outcomes = mobee.World(), []
    gate = threading.Barrier(4)

    def claim(number):
        for i in range(100):
            gate.wait(PATIENCE)
            try:
                world.add(f"thing{i}", mobee.sphere(0.1), position=(number, 0.0, 0.0))
                outcomes.append((i, number))
            except mobee.InvalidValue:
                pass

    crew = [started(lambda number=number: claim(number)) for number in range(4)]
    for thread in crew:
        thread.join(PATIENCE)
    winners = dict(outcomes)
    assert len(outcomes) == len(winners) == 100
    assert {name: thing.position[0] for name, thing in world.objects.items()} == {f"thing{i}": n for i, n in winners.items()}


def test_the_next_evaluation_has_the_edits_of_another_thread():
    model = mobee.Model(planar_arm())
    done, go = threading.Semaphore(0), threading.Semaphore(0)

    def edit():
        for i in range(200):
            go.acquire(timeout=PATIENCE)
            if i % 2:
                model.world.remove("ball")
            else:
                model.world.add("ball", mobee.sphere(0.1), position=TIP)
            done.release()

    editor = started(edit)
    for i in range(200):
        go.release()
        assert done.acquire(timeout=PATIENCE)
        assert model.evaluate(np.zeros(3)).count == (i % 2 == 0)
    editor.join(PATIENCE)


@pytest.mark.parametrize("what", ["transforms", "contacts"])
def test_edits_and_other_evaluations_do_not_wait_for_an_evaluation(monkeypatch, what):
    """An evaluation that does not end delays no other thread."""
    model = mobee.Model(planar_arm())
    model.world.add("ball", mobee.sphere(0.1), position=TIP)
    inside, end = threading.Event(), threading.Event()
    engine = type(model._engine)
    compute, slow = getattr(engine, what), np.array([0.1, 0.2, 0.3])

    def held(self, q, *rest, **more):
        if np.array_equal(np.ravel(q), slow):
            inside.set()
            assert end.wait(PATIENCE)
        return compute(self, q, *rest, **more)

    monkeypatch.setattr(engine, what, held)
    other = mobee.Model(model.robot, model.world)
    model.world.follow(model.evaluate(np.zeros(3)))
    results = []
    evaluation = started(lambda: results.append((model.evaluate(slow[None]).count, model.evaluate(slow[None]).transforms)))
    finished = threading.Event()

    def edit_and_evaluate():
        world = model.world
        world.add("cup", mobee.sphere(0.1), position=TIP)
        world.move("cup", position=(0.0, 0.5, 0.0))
        world.set_role("cup", "target")
        world.attach("cup", "link3")
        world.detach("cup")
        assert other.evaluate(np.zeros(3)).transforms.shape == (4, 4, 4)
        assert {c.second for c in other.evaluate(np.zeros(3)).contacts} == {"ball"}
        world.remove("cup")
        finished.set()

    try:
        assert inside.wait(PATIENCE)
        editor = started(edit_and_evaluate)
        assert finished.wait(PATIENCE / 6)
    finally:
        end.set()
    for thread in (evaluation, editor):
        thread.join(PATIENCE)
    assert len(results) == 1


def test_edits_are_made_while_a_large_batch_is_evaluated(rng):
    model = mobee.Model(mobee.load_robot("icub"))
    low, high = model.robot.limits.T
    poses = rng.uniform(low, high, (400, len(low)))
    model.world.add("ball", mobee.sphere(0.1), position=(-0.3, 0.0, 0.0))
    expected = model.evaluate(poses).count
    begun, ended, counts = threading.Event(), threading.Event(), []

    def evaluate():
        begun.set()
        counts.append(model.evaluate(np.tile(poses, (20, 1))).count)
        ended.set()

    evaluation = started(evaluate)
    begun.wait(PATIENCE)
    edits_meanwhile = 0
    while not ended.is_set():
        model.world.add(f"box{edits_meanwhile}", mobee.box(0.1, 0.1, 0.1), position=(-0.3, 0.0, 0.1), role="ghost")
        model.world.remove(f"box{edits_meanwhile}")
        edits_meanwhile += not ended.is_set()
    evaluation.join(PATIENCE)
    assert edits_meanwhile > 10
    assert np.array_equal(counts[0], np.tile(expected, 20))
