# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import mobee
from mobee._core.engine import span
from mobee.model import engine as engines
from mobee.model.engine import NO_HANDS, Engine
from tests.mobee.model.random_scenes import loaded, posed, random_world

Places = Callable[[np.random.Generator, int], np.ndarray]

PLACES: dict[str, Places] = {
    "a cube": lambda rng, n: rng.uniform(-0.6, 0.6, (n, 3)),
    "a plane": lambda rng, n: rng.uniform(-0.6, 0.6, (n, 3)) * [1, 1, 0] + [0, 0, 0.4],
    "a line": lambda rng, n: rng.uniform(-0.6, 0.6, (n, 3)) * [0, 0, 1],
    "one point": lambda rng, n: np.full((n, 3), 0.3),
    "two heaps, far apart": lambda rng, n: rng.uniform(-0.3, 0.3, (n, 3)) + 1e7 * (rng.random((n, 1)) < 0.5),
    "all far away": lambda rng, n: rng.uniform(-0.6, 0.6, (n, 3)) + 50.0,
    "the corners of the world": lambda rng, n: rng.choice([-1e150, 0.3, 1e150], (n, 3)),
}


@pytest.mark.parametrize("places", PLACES)
@pytest.mark.parametrize("robot", ["icub", "katana"])
def test_a_grid_hides_nothing(robot: str, places: str, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    world = mobee.World()
    for index, where in enumerate(PLACES[places](rng, 300)):
        world.add(f"o{index}", mobee.sphere(float(rng.uniform(0.01, 0.1))), position=where)
    q, found = posed(rng, loaded(robot), 20), []
    for first in (1, 10**9):
        monkeypatch.setattr(engines, "GRID_MIN_OBJECTS", first)
        found.append(Engine(loaded(robot)).contacts(q, world.snapshot, NO_HANDS))
    (gridded, torque), (plain, plain_torque) = found
    assert len(plain) > 0 or places == "all far away"
    assert np.array_equal(gridded.numbers, plain.numbers)
    assert np.array_equal(gridded.reals, plain.reals)
    assert torque == pytest.approx(plain_torque, abs=1e-12)  # summed in another order


def test_contacts_do_not_depend_on_the_number_of_objects(rng: np.random.Generator) -> None:
    """A grid begins at 100 objects; the first ones touch the same before and after."""
    robot = loaded("icub")
    world, q = random_world(rng, robot, 98, 0.5), posed(rng, robot, 5)
    engine = Engine(robot)
    before, _ = engine.contacts(q, world.snapshot, NO_HANDS)
    for index in range(4):
        world.add(f"far{index}", mobee.sphere(0.1), position=(10.0 + index, 0.0, 0.0))
        after, _ = engine.contacts(q, world.snapshot, NO_HANDS)
        assert np.array_equal(after.numbers, before.numbers)
        assert np.array_equal(after.reals, before.reals)


@pytest.mark.parametrize("offset", [0.0, -1e300, 1e300, float("inf"), -float("inf"), float("nan")])
@pytest.mark.parametrize("along", [0.0, 1e300, float("inf"), float("nan")])
@pytest.mark.parametrize("per_metre", [0.0, 1e-300, 2.5, 1e300, float("inf")])
def test_coordinates_that_overflow_stay_in_the_grid(offset: float, along: float, per_metre: float) -> None:
    first, end = span(offset, along, per_metre, 4)
    assert 0 <= first < end <= 4
