# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import time
from pathlib import Path

import pytest

from mobee import load_robot
from services.common.bus_follow import WINDOW, BusFollower
from services.common.config import ServiceConfig
from services.common.service import Service
from tests.services.fake_sim import FakeSim
from tests.services.harness import rig


def test_a_follower_keeps_all_ticks_of_a_path_but_otherwise_only_those_of_two_windows(tmp_path: Path) -> None:
    robot = load_robot("icub")
    with rig(tmp_path, robot) as made, Service("test", ServiceConfig(endpoint=made.endpoint), robot) as service:
        follower, sim = BusFollower(service, robot), FakeSim(made)
        made.token("controller", "x")
        service.spin(time.monotonic() + 5.0, lambda: bool(service.alive.get("controller")))

        def tick(count: int = 1) -> None:
            for _ in range(count):
                sim.tick()
                service.spin(time.monotonic() + 5.0, lambda: service.bus.k == made.bus.k)

        most = round(2.0 * WINDOW * 1e9 / sim.dt_ns)
        tick(2 * most)
        assert 0 < len(follower._seen) <= most and not follower.seen()[0].size
        follower.follow([], [robot.home] * most * 3, 0.999e-9 * sim.dt_ns, lambda share: tick())
        times, q = follower.seen()
        assert times[0] == 0.0 and times[-1] > 2.0 * 2.0 * WINDOW  # only the newest of the ticks that wait is noted, so not their number
        assert q.shape == (len(times), len(robot.motors)) and follower.q == pytest.approx(robot.home)
        follower.let_go()
        tick(10)
        assert len(follower.seen()[0]) == len(times)
        sim.new_run()
        tick(5)  # some may come too early, and be refused as those of an unknown run
        service.spin(time.monotonic() + 5.0, lambda: len(follower._seen) <= 5)
        assert len(follower._seen) <= 5
