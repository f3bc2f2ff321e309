# SPDX-License-Identifier: Apache-2.0
"""The launcher's part in an emergency stop, whatever the clock of its sender says."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bus_schema import VERSION, encode, encoding_of
from bus_schema.messages import EStop
from mobee.robot.load import load_robot
from services.common.config import ServiceConfig
from services.common.emergency_stop import StopRecord
from services.common.service import Service
from services.launcher.stops import JUST_CONFIRMED, JUST_RELEASED, PERIOD, EmergencyStops
from tests.services.harness import Rig, rig

HOUR = 3_600_000_000_000  # ns


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with rig(tmp_path_factory.mktemp("bus"), load_robot("icub")) as made:
        yield made


@pytest.fixture
def launcher(bus: Rig) -> Iterator[Service]:
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    with Service("launcher", ServiceConfig(endpoint=bus.endpoint)) as service:
        yield service
    for number, handler in handlers.items():
        signal.signal(number, handler)


def put(bus: Rig, who: str, tw: int = 0) -> None:
    """Publish a stop of `who`."""
    header: dict[str, Any] = {"v": VERSION, "run": "-", "src": who, "seq": 0, "k": 0, "t": 0, "tw": tw}
    stop = EStop(**header, set=True, source=who, reason="a hand in the way")
    bus.session.put(EStop.stream.key(), encode(stop), encoding=encoding_of(EStop))


def said(launcher: Service, bus: Rig, record: StopRecord | None, *, who: str = "mobee_1", tw: int = 0) -> str:
    """What the launcher waits for after a stop by `who`, sent at `tw` of its clock."""
    stops = EmergencyStops(launcher, record, lambda text: None)
    launcher.spin(time.monotonic() + 0.05)  # the subscription reaches the router
    put(bus, who, tw)
    launcher.spin(time.monotonic() + 0.5, lambda: bool(stops.waiting))
    return stops.waiting


@pytest.mark.parametrize("ahead", [-HOUR, 0, HOUR])
def test_a_stop_of_a_host_with_another_clock_is_kept_on_disk_and_repeated(launcher: Service, bus: Rig, tmp_path: Path, ahead: int) -> None:
    record = StopRecord(tmp_path / "stop.json")
    record.create()
    time.sleep(JUST_RELEASED)
    assert "a hand in the way" in said(launcher, bus, record, tw=max(0, time.monotonic_ns() + ahead))
    stop = record.read()
    assert stop is not None and stop.source == "mobee_1"


def test_a_release_of_an_earlier_boot_hides_no_stop(launcher: Service, bus: Rig, tmp_path: Path) -> None:
    record = StopRecord(tmp_path / "stop.json")
    record.path.write_text(f'{{"stopped": false, "time": 0.0, "monotonic_ns": {time.monotonic_ns() + HOUR}}}')
    assert said(launcher, bus, record, tw=time.monotonic_ns())


def test_a_stop_that_may_be_older_than_the_release_is_left_to_robot_sim(launcher: Service, bus: Rig, tmp_path: Path) -> None:
    record = StopRecord(tmp_path / "stop.json")
    record.release()
    assert said(launcher, bus, record, tw=time.monotonic_ns() + HOUR) == ""
    assert record.read() is None


def test_a_stop_that_robot_sim_has_confirmed_first_is_not_kept(launcher: Service, bus: Rig) -> None:
    """robot_sim obeys the record of stops before the message arrives; a release at once must not be followed by a repetition."""
    stops = EmergencyStops(launcher, None, lambda text: None)
    launcher.spin(time.monotonic() + 0.05)
    put(bus, "robot_sim")
    put(bus, "page")
    launcher.spin(time.monotonic() + 3.0 * PERIOD)
    assert stops.waiting == ""
    launcher.spin(time.monotonic() + JUST_CONFIRMED)
    put(bus, "page")  # a new one
    launcher.spin(time.monotonic() + 0.5, lambda: bool(stops.waiting))
    assert stops.waiting


def test_launchers_do_not_repeat_each_others_stops(launcher: Service, bus: Rig) -> None:
    assert said(launcher, bus, None, who="launcher_desk") == ""
    assert said(launcher, bus, None, who="mobee_1")
