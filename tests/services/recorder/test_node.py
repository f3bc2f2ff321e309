# SPDX-License-Identifier: Apache-2.0
"""The recorder in the process of the test, which plays the other services."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from bus_schema.messages import Targets
from mobee import load_robot
from services.common.service import Service
from services.recorder import node
from services.recorder.config import Config
from services.recorder.files import parts_of
from services.recorder.node import RecorderNode
from services.recorder.reader import Recording
from tests.services.harness import rig


def test_messages_that_are_dropped_while_the_disk_is_full_count_as_lost_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, folder, free = load_robot("icub"), tmp_path / "run", [10**12]
    folder.mkdir()
    monkeypatch.setattr(node, "shutil", SimpleNamespace(disk_usage=lambda folder: SimpleNamespace(free=free[0])))
    with rig(tmp_path, robot) as made:
        config = Config(endpoint=made.endpoint, run_dir=str(folder))
        with Service("recorder", config, robot) as service:
            recorder = RecorderNode(service, config, robot)
            targets = made.bus.publisher(Targets)

            def publish(count: int) -> None:
                for _ in range(count):
                    targets.put(re_k=0, positions={}, gone=[])

            def until(condition: Callable[[], bool]) -> None:
                service.spin(time.monotonic() + 20.0, condition)
                assert condition(), service.describe()

            def recorded() -> int:
                return sum(one.key == Targets.stream.key() for one in Recording(folder)) if parts_of(folder) else 0

            def lost() -> float:
                return service.describe()[1]["lost"]

            until(lambda: targets.has_subscribers)
            publish(10)
            until(lambda: recorded() == 10)
            free[0] = 0
            publish(30)
            until(lambda: lost() >= 30)
            publish(20)  # before the recorder tries again
            until(lambda: lost() >= 51)  # with its own event
            free[0] = 10**12
            until(lambda: not service.describe()[0].startswith("nothing is recorded"))
            publish(10)
            until(lambda: recorded() == 20)
            assert lost() == 51
            recorder.end()


def test_a_missing_run_dir_is_reported(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "services.recorder", "--run-dir", str(tmp_path / "none"), "--endpoint", "tcp/127.0.0.1:1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert f"run_dir {tmp_path / 'none'} is not a folder" in done.stderr
