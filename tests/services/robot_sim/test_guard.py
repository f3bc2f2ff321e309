# SPDX-License-Identifier: Apache-2.0
"""The guard within the test's process: no message is received and no timer ends, because the test alone calls it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bus_schema.messages import EStop
from mobee import World, load_robot
from mobee.simulation.motors import MotorParameters
from services.common.config import ServiceConfig
from services.common.emergency_stop import StopRecord
from services.common.service import Service
from services.robot_sim.guard import Guard
from services.robot_sim.kinematic import KinematicBackend
from tests.services.harness import Rig, rig, wait_for

ROBOT = load_robot("icub")


@pytest.fixture
def record(tmp_path: Path) -> StopRecord:
    made = StopRecord(tmp_path / "stop.json")
    made.create()
    return made


@pytest.fixture
def bus(tmp_path: Path) -> Iterator[Rig]:
    with rig(tmp_path, ROBOT) as made:
        yield made


@pytest.fixture
def guard(bus: Rig, record: StopRecord) -> Iterator[Guard]:
    with Service("robot_sim", ServiceConfig(endpoint=bus.endpoint), ROBOT) as service:
        yield Guard(service, ROBOT, KinematicBackend(ROBOT, World, MotorParameters(), 0), 0.01, record)


def test_a_stop_on_disk_is_obeyed_in_the_next_tick(guard: Guard, record: StopRecord) -> None:
    guard.tick(1)
    assert not guard.stop_reason
    record.stop("test", "because")
    guard.tick(2)
    assert {gate.state for gate in guard.gates.values()} == {"estop"}
    assert guard.stop_reason.endswith("because")


def test_a_long_reason_is_published_in_part(guard: Guard, bus: Rig, record: StopRecord) -> None:
    stops = bus.record(EStop)
    record.stop("test", 3000 * "y")
    guard.tick(1)
    wait_for(lambda: stops, "the stop")
    assert stops[-1].reason == 2000 * "y"
