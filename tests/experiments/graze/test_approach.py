from __future__ import annotations

import numpy as np
import pytest

from experiments.graze.approach import BEFORE, BEHIND, MARKER, STEP, Spot, Table
from experiments.graze.client import SPEED, Client


@pytest.fixture(scope="module")
def table() -> Table:
    return Table()


@pytest.fixture(scope="module")
def spot(table: Table) -> Spot:
    return table.spots(1, seed=3)[0]


@pytest.mark.parametrize("angle", [90.0, 20.0, 2.0])
def test_a_way_goes_straight_into_the_table_at_its_angle(table: Table, spot: Spot, angle: float) -> None:
    way = table.way(spot, np.deg2rad(angle))
    assert way is not None
    palm = table.model.evaluate(way.postures).position(MARKER)[way.start :]
    step = (palm[-1] - palm[0]) / (BEFORE + BEHIND)
    assert np.arcsin(-step[2]) == pytest.approx(np.deg2rad(angle), abs=0.005)
    straight = palm[0] + np.linspace(0.0, 1.0, len(palm))[:, None] * (palm[-1] - palm[0])
    assert np.abs(palm - straight).max() < 5e-4


def test_contact_begins_where_the_way_says(table: Table, spot: Spot) -> None:
    way = table.way(spot, np.deg2rad(45.0))
    assert way is not None
    touching = [bool(table.watch.look(table.model.evaluate(q))) for q in way.postures]
    first = way.start + round(BEFORE / STEP)
    assert not any(touching[: first - 1])
    assert all(touching[first + 1 :])


def test_the_same_seed_gives_the_same_spots(table: Table) -> None:
    one, other = (table.spots(1, seed=3)[0] for _ in range(2))
    assert np.array_equal(one.q, other.q)


def test_the_client_drives_at_a_share_of_full_speed(table: Table, spot: Spot) -> None:
    way = table.way(spot, np.deg2rad(10.0))
    assert way is not None
    client = Client(table.robot, way, dt=0.01)
    references = []
    while not client.is_over:
        references.append(client.next())
    speeds = np.abs(np.diff(references, axis=0)) / 0.01 / [motor.max_velocity for motor in table.robot.motor_table]
    assert speeds.max() == pytest.approx(SPEED, rel=1e-6)
    assert client.runs == 1


def test_the_client_goes_on_from_where_it_was_put(table: Table, spot: Spot) -> None:
    way = table.way(spot, np.deg2rad(10.0))
    assert way is not None
    client = Client(table.robot, way, dt=0.01)
    for place, leaves in ((way.start, True), (0, False)):
        client.retry(way.postures[place])
        assert client.leaves_start is leaves
        assert np.abs(client.next() - way.postures[place]).max() < 0.01
