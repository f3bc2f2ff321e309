# SPDX-License-Identifier: Apache-2.0
"""Serves the page, `python -m services.monitor.page`: becomes Rerun's own program.

Rerun's Python calls listen on every interface; its program has an option to listen on loopback only.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from importlib.util import find_spec
from pathlib import Path

HOST = "127.0.0.1"
PR_SET_PDEATHSIG = 1


def arguments(bind: str, web_port: int, grpc_port: int, memory_limit: str) -> list[str]:
    """The command line of Rerun's program."""
    return [
        "rerun",
        "--serve-web",
        *("--bind", bind),
        *("--port", str(grpc_port)),
        *("--web-viewer-port", str(web_port)),
        *("--server-memory-limit", memory_limit),
    ]


def program() -> Path:
    """Rerun's program, as its wheel brings it."""
    spec = find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise SystemExit('the page needs rerun-sdk: pip install "mobee[viz]"')
    return Path(spec.origin).parent / "rerun"


def main() -> None:
    """Become the server; the kernel ends it when the monitor that started it has died."""
    parent, *rest = sys.argv[1:]
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != int(parent):  # it ended before the call above
        return
    os.execv(program(), arguments(rest[0], int(rest[1]), int(rest[2]), rest[3]))


if __name__ == "__main__":
    main()
