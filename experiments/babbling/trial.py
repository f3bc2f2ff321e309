"""One trial: a fresh system of real processes in lockstep, from home, until its robot time is over."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.babbling.command_log import COMMANDS
from experiments.babbling.measured import POSITIONS, SUMMARY
from experiments.babbling.modes import scenario
from experiments.kit.live import free_endpoint, stop
from mobee.errors import MobeeError
from mobee.robot.robot import Robot

LOOK = 0.05  # s between looks at how far it is
BEGINS = 60.0  # s within which the first tick must come
STANDS = 30.0  # s without a tick after which a trial is given up


class TrialFailed(MobeeError):
    """A trial that did not come to its end; the message names its logs."""


def run_trial(folder: Path, mode: str, robot: Robot, seed: int, ticks: int, show: Callable[[float], None]) -> None:
    """Leave commands, positions and contacts in the folder; `show` is told which share is done.  Raises TrialFailed."""
    folder.mkdir(parents=True, exist_ok=True)
    for left in (COMMANDS, POSITIONS):  # of a trial that was broken off
        (folder / left).unlink(missing_ok=True)
    file = folder / f"{mode}.toml"
    file.write_text(scenario(mode, folder.resolve(), seed, ticks))
    due = ticks * 8 * len(robot.motors)  # bytes of a whole record
    with _launched(file, folder) as process:
        written, stands_at = 0, time.monotonic() + BEGINS
        while process.poll() is None:  # robot_sim counts the ticks, and the launcher ends with it
            time.sleep(LOOK)
            size = _size(folder / POSITIONS)
            if size != written:
                written, stands_at = size, time.monotonic() + STANDS
                show(size / due)
            elif time.monotonic() > stands_at:
                raise TrialFailed(f"{mode}: no tick for {STANDS:g} s; see {folder / 'news'} and {folder / 'launch'}")
    if _size(folder / POSITIONS) != due:
        raise TrialFailed(f"{mode}: the system ended before its time; see {folder / 'news'} and {folder / 'launch'}")


@contextmanager
def _launched(file: Path, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """`mobee launch` at an endpoint of its own; what it sums up must be without fault, and it is stopped when anything is raised."""
    argv = [sys.executable, "-m", "mobee_cli", "launch", str(file), "--headless", "--json"]
    argv += ["--endpoint", free_endpoint(), "--runs", str(folder / "launch")]
    with (folder / SUMMARY).open("wb") as summary, (folder / "news").open("wb") as news:
        # In a group of its own, so that a terminal's Ctrl-C reaches this process alone, which then ends it in order.
        process = subprocess.Popen(argv, stdin=subprocess.DEVNULL, stdout=summary, stderr=news, process_group=0)
    try:
        yield process
    finally:
        code = stop(process)
    if code != 0:
        raise TrialFailed(f"{file.stem}: the system ended with code {code}: {_last_line(folder / 'news')}")


def _last_line(path: Path) -> str:
    *_, last = ["it said nothing", *path.read_text(errors="replace").strip().splitlines()]
    return last


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0
