# SPDX-License-Identifier: Apache-2.0
"""The fuzzer of handlers feeds its seeds to services: no handler fails, every call has a reply, most reasons to refuse occur."""

from __future__ import annotations

import ast
import subprocess
import sys

from tests.fuzz.handlers import SERVICES


def test_no_handler_fails_on_drawn_messages_and_calls() -> None:
    command = [sys.executable, "-m", "tests.fuzz.handlers", "60"]  # a process of its own: a service takes over the signals
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr[-3000:]
    refused = {name: ast.literal_eval(counts) for name, counts in (line.split(" ", 1) for line in done.stdout.splitlines())}
    assert refused.keys() == SERVICES.keys()
    for reason in ("decode", "version", "caller", "epoch", "world"):
        assert sum(counts.get(reason, 0) for counts in refused.values()) > 0, reason
