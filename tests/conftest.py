# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import gc
import os
import secrets
import signal
import socket
import warnings
from collections.abc import Iterator

import hypothesis
import numpy as np
import psutil
import pytest

hypothesis.settings.register_profile("mobee", deadline=None, derandomize=True, max_examples=50)
hypothesis.settings.load_profile("mobee")


@pytest.fixture(scope="session", autouse=True)
def nothing_left_running() -> Iterator[None]:
    """No process that a test started outlives the tests, even if it was detached: remaining processes are named and killed."""
    name, mark = "MOBEE_STARTED_BY_TESTS", secrets.token_hex(8)
    os.environ[name] = mark  # inherited by all that the tests start
    yield
    all_now = psutil.process_iter(["environ", "cmdline"])
    started = [each for each in all_now if (each.info["environ"] or {}).get(name) == mark and each.pid != os.getpid()]
    started = [each for each in started if not any("resource_tracker" in word for word in each.info["cmdline"])]  # Python's own
    for each in psutil.wait_procs(started, timeout=3.0)[1]:
        warnings.warn(f"left running by the tests and killed: {' '.join(each.info['cmdline'])}", stacklevel=1)
        each.kill()


@pytest.fixture(scope="session", autouse=True)
def states_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Records of emergency stops are kept in a folder of the tests, not in the user's."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("states"))


@pytest.fixture
def rng() -> np.random.Generator:
    """The only source of chance in a test: the global state of numpy is never used."""
    return np.random.default_rng(2014)


@pytest.fixture
def free_port() -> int:
    """A TCP port of the loopback interface on which no process listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


# Files that take long, longest first: whole systems, then those that start many processes.
LONG = ("tests/system/", "tests/examples/", "tests/services/", "tests/mobee_cli/", "tests/experiments/")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With several processes, long files come first: none works on one alone at the end."""
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: next((rank for rank, start in enumerate(LONG) if item.nodeid.startswith(start)), len(LONG)))


def pytest_collection_finish() -> None:
    """What has been imported stays: the garbage collector is not to walk through it again and again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Handle signals as a new process does, before a test and its fixtures start programs, which would inherit that they are ignored.

    A shell has the programs that it starts in the background ignore Ctrl-C, and a service of ours ignores signals from its end on.  A
    session of lockstep restricts Zenoh to one thread, also in the programs that later tests would start.
    """
    os.environ.pop("ZENOH_RUNTIME", None)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print skipped tests, and the findings of ./test before pytest, just above the closing line."""
    if any("live picture" in str(report.longrepr) for report in terminalreporter.stats.get("skipped", ())):
        terminalreporter.write_line("skipped: live picture")
    if summary := os.environ.get("MOBEE_CHECKS"):
        terminalreporter.write_line(summary, red="FAILED" in summary)
