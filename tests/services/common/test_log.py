from __future__ import annotations

import subprocess
import sys

LOG = "from pathlib import Path; from services.common import log; log.set_up('launcher', Path('/dev/full')).info({})"


def said_of(call: str) -> str:
    return subprocess.run([sys.executable, "-c", LOG.format(call)], stderr=subprocess.PIPE, text=True, check=True).stderr


def test_a_full_disk_puts_no_traceback_on_the_screen() -> None:
    assert said_of("'a line'") == ""


def test_a_mistake_in_a_log_call_is_still_told() -> None:
    assert "TypeError" in said_of("'a line', 'too much'")
