# SPDX-License-Identifier: Apache-2.0
"""A batch of plants as rows of arrays gives what separate plants give, to the last bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mobee import BatchInterrupted, OfflinePlant, PlantSettings, load_robot, load_world
from mobee.errors import ActionInterrupted, InvalidValue
from mobee.model.model import Model
from mobee.simulation import PlantBatch

ICUB = load_robot("icub")
SETTINGS = PlantSettings(dt=0.02, active=["left_arm"])
COUNT, TICKS = 4, 15


def low_arm(rng: np.random.Generator) -> np.ndarray:
    """Attractors of all robots, at and in the table."""
    goals = np.tile(ICUB.home, (COUNT, 1))
    arm = ICUB.parts["left_arm"].slice
    goals[:, arm] = rng.uniform(*ICUB.limits[arm].T, size=(COUNT, arm.stop - arm.start))
    return goals


def disturb(step: int, plants: list[OfflinePlant]) -> None:
    """What a user may do with a plant between two runs."""
    if step == 2:
        plants[0].controller.force(np.full(41, 0.5))
    if step == 3:
        plants[0].controller.force(np.zeros(41))
        plants[1].controller.push("left_palm", np.array([0.0, 0.0, 3.0]))
    if step == 4:
        plants[1].controller.clear()
        plants[2].run(3)
    if step == 5:
        plants[2].begin("left_arm", plants[2].measure("left_arm"))
    if step == 6:
        plants[3].restart(9)


@pytest.mark.parametrize("threads", [1, 2])
def test_each_plant_moves_as_if_it_were_alone(threads: int) -> None:
    rng, every = np.random.default_rng(0), np.arange(COUNT)
    model, apart = Model(ICUB, load_world("table")), Model(ICUB, load_world("table"))
    batch, alone = PlantBatch(model, COUNT, SETTINGS, threads), [OfflinePlant(apart, settings=SETTINGS) for _ in range(COUNT)]
    for plants in (batch.plants, alone):
        for seed, plant in enumerate(plants):
            plant.restart(seed)
    for step in range(8):
        which = every if step != 1 else np.array([3, 1])
        goals = low_arm(rng)[which]
        for plants in (batch.plants, alone):
            disturb(step, plants)
        if step == 6:
            for one in (model, apart):
                one.world.move("ball", position=(-0.3, -0.2, 0.0))
        batch.aim(which, goals)
        depths = batch.run(which, TICKS)
        for row, number in enumerate(which.tolist()):
            plant = alone[number]
            plant.controller.attractor = goals[row]
            trace = plant.run(TICKS)
            assert depths[row].tolist() == [trace.solid.max(), trace.field.max()]
        for found, plant, twin in zip(batch.state(), alone, batch.plants, strict=True):
            assert np.array_equal(found, [plant.q, plant.controller.attractor, plant.controller.velocity])
            assert twin.time == plant.time and twin.acting == plant.acting
            assert np.array_equal(twin.controller.last_forces.total, plant.controller.last_forces.total)
            assert twin.pose is not None and twin.pose.count == plant.pose.count
    assert depths[:, 1].max() > 0.0


@pytest.mark.parametrize("forced", [False, True])  # a force of a client: Python takes part in the ticks
def test_a_plant_that_is_lost_takes_nothing_from_the_others(forced: bool) -> None:
    batch = PlantBatch(Model(ICUB), 3, SETTINGS)
    batch.run(np.arange(3), 2)
    if forced:
        batch.plants[0].controller.force(np.full(len(ICUB.motors), 0.1))
    batch.plants[1].motors.state["q"][:] = np.nan
    with pytest.raises(BatchInterrupted, match=r"1 of 3 plants were interrupted, the first plants\[1\]") as caught:
        batch.run(np.arange(3), 5)
    results: list[Any] = caught.value.results
    assert isinstance(results[1], ActionInterrupted) and results[0].tolist() == results[2].tolist() == [0.0, 0.0]
    assert [plant.time for plant in batch.plants] == pytest.approx([0.14, 0.04, 0.14])
    assert batch.run(np.array([], dtype=np.intp), 5).shape == (0, 2)


@pytest.mark.parametrize("forced", [False, True])
def test_no_ticks_have_no_depths(forced: bool) -> None:
    """Also of plants that need Python between ticks."""
    batch = PlantBatch(Model(ICUB, load_world("table")), 2, SETTINGS)
    if forced:
        batch.plants[1].each_tick = lambda plant: None
    assert batch.run(np.arange(2), 0).tolist() == [[0.0, 0.0], [0.0, 0.0]]


def test_attractors_of_other_types_are_converted_and_of_other_shapes_refused() -> None:
    robot = load_robot("icub")
    batch, n = PlantBatch(Model(robot), 2, PlantSettings(active=["left_arm"])), len(robot.motors)
    for values in (np.ones((1, n), np.float32), np.ones((1, n), int), np.ones((1, n)).tolist()):
        batch.aim(np.array([0]), np.zeros((1, n)))
        batch.aim(np.array([0]), values)  # type: ignore[arg-type]  # a list is converted, too
        np.testing.assert_array_equal(batch.state()[0, 1], np.ones(n))
    for wrong in (np.ones((1, n)), np.ones((2, n - 1)), np.full((2, n), np.nan)):
        with pytest.raises(InvalidValue, match="attractors of shape"):
            batch.aim(np.array([0, 1]), wrong)


def test_a_new_attractor_does_not_move() -> None:
    batch = PlantBatch(Model(ICUB), 2, SETTINGS)
    for plant in batch.plants:
        plant.controller.follow("left_arm", plant.measure("left_arm"), np.ones(16))
    batch.aim(np.array([1]), ICUB.home[None])
    assert [bool(plant.controller.state["goal_time"].any()) for plant in batch.plants] == [True, False]


@pytest.mark.parametrize("which", [np.array([True, False, True]), np.array([0, 0]), np.array([-1]), np.array([3]), np.array([0.0])])
def test_plants_are_chosen_by_distinct_indices(which: Any) -> None:
    """A mask of another length than the chosen plants, or a plant in two threads, would read and write memory of others."""
    batch = PlantBatch(Model(ICUB), 3, SETTINGS)
    with pytest.raises(InvalidValue, match="which .*indices of plants, 0 to 2, each at most once"):
        batch.aim(which, np.tile(ICUB.home, (len(which), 1)))
    with pytest.raises(InvalidValue, match="which .*indices of plants, 0 to 2, each at most once"):
        batch.run(which, 1)
    assert [plant.time for plant in batch.plants] == [0.0, 0.0, 0.0]
    with pytest.raises(InvalidValue, match="it must be empty, as there are no plants"):
        PlantBatch(Model(ICUB), 0, SETTINGS).run(np.array([0]), 1)


@pytest.mark.parametrize("ticks", [-1, 1.5, True, "a"])
def test_a_number_of_ticks_is_whole(ticks: Any) -> None:
    batch = PlantBatch(Model(ICUB), 1, SETTINGS)
    for run in (lambda: batch.run(np.array([0]), ticks), lambda: batch.plants[0].run(ticks)):
        with pytest.raises(InvalidValue, match="ticks=.*: give a whole number, 0 or more"):
            run()


@pytest.mark.parametrize("count", [-1, 1.5, True])
def test_a_number_of_plants_is_whole(count: Any) -> None:
    with pytest.raises(InvalidValue, match="count=.*: give a whole number, 0 or more"):
        PlantBatch(Model(ICUB), count)
