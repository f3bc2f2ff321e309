# SPDX-License-Identifier: Apache-2.0
"""The hand on its way to a cup stops when vision fails, and continues when the cup is seen again; the test plays vision."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from bus_schema.messages import Geometry, WorldObject
from services.common.bus import Bus
from services.common.session import open_client
from tests.system.live import Watcher, running, until

pytestmark = [pytest.mark.system, pytest.mark.untimed]

SCENARIO = """title = "A hand on its way to a cup"

[shared]
robot = "icub"
world = "cup"
gains = "default"
seed = 0

[services.robot_sim]
backend = "kinematic"

[services.model]
[services.controller]
[services.cup]
module = "services.cup"
"""
VALID = 5_000_000_000  # ns


class Vision:
    """Publishes the cup's place ten times a second, while it sees it."""

    def __init__(self, watcher: Watcher) -> None:
        self._watcher, self.sees = watcher, True
        self._session = open_client(watcher.endpoint)
        self._bus = Bus(self._session, "vision", logging.getLogger("vision"))
        self._places = self._bus.publisher(WorldObject, "cup")
        self._ends, self._lock = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._ends.set()
        self._thread.join()
        self._session.close()

    def put(self, valid: int) -> None:
        """Publish the place, valid for some ns from now; withdraw it with 0."""
        clock = self._watcher.clock
        assert clock is not None
        self._bus.run, self._bus.k, self._bus.t = clock.run, clock.k, clock.t
        self._places.put(
            name="cup", geometry=Geometry("cylinder", [0.028, 0.13]), position=[-0.38, 0.0, -0.035], quaternion=[1.0, 0.0, 0.0, 0.0],
            covariance=[0.0] * 9, role="target", t_capture=clock.t, valid_until=clock.t + valid if valid else 0,
        )  # fmt: skip

    def fail(self) -> None:
        """See nothing from now on: no place that was on its way is published after this call."""
        with self._lock:
            self.sees = False

    def _run(self) -> None:
        while not self._ends.wait(0.1):
            with self._lock:
                if self.sees:
                    self.put(VALID)


@contextmanager
def vision_of(watcher: Watcher) -> Iterator[Vision]:
    vision = Vision(watcher)
    try:
        yield vision
    finally:
        vision.close()


def test_the_hand_stops_when_the_cameras_fail_and_continues_when_they_see_the_cup_again(tmp_path: Path) -> None:
    scenario = tmp_path / "cup.toml"
    scenario.write_text(SCENARIO)
    with running(tmp_path, str(scenario)) as (_, watcher), vision_of(watcher) as vision:
        for valid, reason in ((None, "no picture of cup for 1 s"), (0, "cup is stale")):
            until(lambda: watcher.speed("right_arm") > 0.1, 60.0, "the hand moves")
            vision.fail()
            last = watcher.k
            if valid is not None:  # as vision does when pictures are dark, frozen or late
                vision.put(valid)
            else:  # after a long computation the service may pause sooner, and continue while its newest picture is fresh
                until(partial(has_passed, watcher, last + 150), 20.0, "the last picture is old")
            until(partial(says, watcher, reason), 10.0, f"the service pauses: {reason}")
            until(lambda: not watcher.motions["right_arm"][-1].owner, 10.0, "the arm is free")
            until(lambda: watcher.rests("right_arm"), 10.0, "the arm rests")
            begun = watcher.k
            until(partial(has_passed, watcher, begun + 100), 20.0, "one more second has passed")
            assert watcher.rests("right_arm")
            vision.sees = True


def says(watcher: Watcher, text: str) -> bool:
    return text in watcher.stat("cup").text


def has_passed(watcher: Watcher, k: int) -> bool:
    return watcher.k > k
