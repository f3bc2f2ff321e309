# SPDX-License-Identifier: Apache-2.0
"""Runs the tests on a changed copy of the project, each time in a new process."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COPIED = ("mobee", "mobee_cli", "mobee_system", "bus_schema", "services", "experiments", "tests", "examples", "docs", "docker", "core")


def copy_of_project(folder: Path) -> None:
    """Copy the sources and tests of the project."""
    for name in COPIED:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", ".build-*"))
    for name in ("pyproject.toml", "README.md", "launch", "test"):
        shutil.copy(ROOT / name, folder / name)


def is_noticed(folder: Path, tests: Sequence[str], seconds: float) -> bool:
    """Run tests in the copy; returns whether one fails, or they have not ended after that time."""
    process = SERVER.Process(target=_run, args=(folder, tuple(tests)))
    process.start()
    process.join(seconds)
    if process.exitcode is not None:
        return process.exitcode != 0
    assert process.pid is not None
    os.killpg(process.pid, signal.SIGKILL)  # and what the tests have started
    process.join()
    return True


SERVER = multiprocessing.get_context("forkserver")
SERVER.set_forkserver_preload(["numpy", "scipy.spatial", "msgspec", "hypothesis", "pytest", "zenoh", "psutil"])  # no mutant changes these


def _run(folder: Path, tests: Sequence[str]) -> None:
    """Run tests on the sources of the copy, in a process of its own."""
    os.setsid()
    os.chdir(folder)
    for name in [name for name in sys.modules if name.partition(".")[0] in COPIED]:
        del sys.modules[name]
    sys.path[:] = [str(folder), *(place for place in sys.path if Path(place) != ROOT)]
    os.environ["PYTHONPATH"] = str(folder)
    sys.dont_write_bytecode = True
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
        # Ends without Python's own end, which would wait for threads of a broken test.
        os._exit(int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-o", "addopts=--import-mode=importlib", *tests])))
