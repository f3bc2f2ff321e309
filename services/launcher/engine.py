"""The model's engine, compiled before anything is started: no service compiles while another moves the robot."""

from __future__ import annotations

import os
import subprocess
import sys

from mobee.engine.cache import cache_folder, is_ready


class EngineMissing(Exception):
    """The engine's machine code is not there and cannot be made; the message holds the remedy."""


def compile_engine() -> None:
    """Compile the engine, if need be, in a process of its own, with progress on standard error; raises EngineMissing."""
    folder = cache_folder()
    if is_ready(folder):
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EngineMissing(f"cannot make {error.filename}: {error.strerror}; {_REMEDY}") from None
    if not os.access(folder, os.W_OK):
        raise EngineMissing(f"cannot write {folder}; {_REMEDY}")
    # In a group of its own, so that a terminal's Ctrl-C reaches the launcher alone, and `run` ends it without a traceback.
    argv = [sys.executable, "-m", "mobee.engine"]
    code = subprocess.run(argv, stdout=subprocess.DEVNULL, check=False, process_group=0).returncode
    if not is_ready(folder):
        raise EngineMissing(f"the engine was not compiled into {folder} (exit code {code}), see above; try `python -m mobee.engine`")


_REMEDY = "let the environment variable MOBEE_CACHE name a folder for the engine's machine code"
