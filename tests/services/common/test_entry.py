# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from services.common.entry import HELD
from services.launcher.child import Child, Program

PROGRAM = """
from services.common.entry import wait_until_released
print("imported", flush=True)
wait_until_released()
print("released", flush=True)
"""
LIMIT = 30.0  # s


def test_a_service_that_was_started_early_waits_until_it_is_released(tmp_path: Path) -> None:
    log = tmp_path / "one.log"
    child = Child(Program("one", (sys.executable, "-c", PROGRAM), log))
    child.spawn("i1_launcher")
    try:
        end = time.monotonic() + LIMIT
        while log.read_text() != "imported\n" and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(0.2)
        assert log.read_text() == "imported\n"
        assert child.running()
        child.release()
        assert child.process is not None
        assert child.process.wait(LIMIT) == 0
        assert log.read_text() == "imported\nreleased\n"
    finally:
        child.kill()


def test_a_service_that_waits_ends_with_its_launcher(tmp_path: Path) -> None:
    """It must not join: on a joined host, the service that it should replace and the router still run."""
    log = tmp_path / "one.log"
    child = Child(Program("one", (sys.executable, "-c", PROGRAM), log))
    child.prepare("i1_router 1234")
    try:
        assert child.standby is not None and child.standby.stdin is not None
        child.standby.stdin.close()  # as the operating system does when the launcher dies
        assert child.standby.wait(LIMIT) == 0
        assert log.read_text() == "imported\n"
    finally:
        child.dismiss()


def test_a_service_that_is_started_by_hand_does_not_wait() -> None:
    environment = {name: value for name, value in os.environ.items() if name != HELD}
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True
    ) as process:
        assert process.wait(LIMIT) == 0


LOG = "from pathlib import Path; from services.common.entry import set_up_log; set_up_log('launcher', Path('/dev/full')).info({})"


def said_of(call: str) -> str:
    return subprocess.run([sys.executable, "-c", LOG.format(call)], stderr=subprocess.PIPE, text=True, check=True).stderr


def test_a_full_disk_puts_no_traceback_on_the_screen() -> None:
    assert said_of("'a line'") == ""


def test_an_error_in_a_log_call_is_still_reported() -> None:
    assert "TypeError" in said_of("'a line', 'too much'")
